"""PX4 logs: one written here, and those from the wild against pyulog, topic by topic and word by word."""

from __future__ import annotations

import os
import struct
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from care_core.logs.opening import open_log
from care_core.logs.px4_ulog import Px4Log
from tests.rewritten import ULOG_MAGIC, ulog_record, write_ulog
from tests.whole import one_in


def test_reads_topics_parameters_texts_and_dropouts(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    log = open_log(write_ulog(tmp_path / "a.ulg"))
    tables = log.read({"battery_status": ("voltage_v", "none"), "logged_messages": ("message", "level")})
    np.testing.assert_allclose(tables["battery_status"].t, np.arange(100) * 0.1)
    np.testing.assert_allclose(tables["battery_status"]["voltage_v"], 12.0 - np.arange(100) / 100, rtol=1e-6)
    assert tables["logged_messages"]["message"].tolist() == ["Takeoff detected"]
    roll = log.settings()["MC_ROLL_P"]
    assert [one.value for one in roll] == [6.5, 0.1]
    assert roll[0].changed_at_s is None
    assert roll[1].changed_at_s == pytest.approx(5.0)
    assert log.settings()["COM_RC_LOSS_T"][0].value == 3.0
    (dropout,) = log.damage
    assert dropout.what == "120 ms were not recorded (dropout)"
    assert dropout.time_s == pytest.approx(5.0)
    assert [(one.name, one.count) for one in log.channels()] == [("battery_status", 100), ("logged_messages", 1)]
    assert log.facts == {"stack": "PX4", "firmware": "PX4", "hardware": "PX4_SITL"}
    assert log.duration_s == pytest.approx(9.9)
    assert capfd.readouterr() == ("", "")


def test_a_cut_log_says_where(tmp_path: Path) -> None:
    path = write_ulog(tmp_path / "a.ulg")
    path.write_bytes(path.read_bytes()[:-10])
    log = open_log(path)
    assert log.damage[-1].what == "cut in a record, 8 bytes of it are there"
    assert log.damage[-1].time_s == pytest.approx(log.duration_s)


SHARED = os.environ.get("CARE_SHARED")
RECORDED = sorted(Path(SHARED).glob("logs*/*/*.ulg")) if SHARED else []


def peer_of(path: Path) -> Any:
    """The log as pyulog reads it."""
    return pytest.importorskip("pyulog").ULog(str(path))


def assert_agrees(path: Path) -> None:
    """Every field of every topic, parameter, default, change, dropout, text and information is as pyulog reads it."""
    log, peer = Px4Log(path), peer_of(path)
    topics = {f"{one.name}#{one.multi_id}" if one.multi_id else one.name: one.data for one in peer.data_list}
    tables = log.read({name: tuple(data) for name, data in topics.items()})
    assert set(tables) == set(topics)
    for name, data in topics.items():
        assert set(tables[name].columns) == set(data)
        for field, column in data.items():
            np.testing.assert_array_equal(tables[name][field], column.astype(np.float64), f"{name}.{field}")
    assert_same_parameters(log, peer)
    said = [*peer.logged_messages, *(one for tagged in peer.logged_messages_tagged.values() for one in tagged)]
    words = log.read({"logged_messages": ("level", "message")}).get("logged_messages")
    strings = Counter((one.log_level_str(), one.message) for one in said)
    told = Counter(zip(words["level"], words["message"], strict=True) if words else [])
    assert not strings - told
    assert "event" in topics or not told - strings  # which pyulog leaves as numbers
    dropouts = [one.duration for one in peer.dropouts if one.duration]
    assert [int(one.what.split()[0]) for one in log.damage if "dropout" in one.what] == dropouts[: len(log.damage)]
    assert {key: [list(parts) for parts in lists] for key, lists in log.multiple.items()} == {
        key: [[as_read(part) for part in parts] for parts in lists]
        for key, lists in peer.msg_info_multiple_dict.items()
    }


def as_read(value: Any) -> Any:
    """What pyulog makes of information that is no text, as bytes."""
    return bytes(value) if isinstance(value, (bytes, bytearray, list)) else value


def assert_same_parameters(log: Px4Log, peer: Any) -> None:
    settings = log.settings()
    numbers = {name: value for name, value in peer.initial_parameters.items() if np.isfinite(value)}
    assert {name: np.float32(values[0].value) for name, values in settings.items()} == {
        name: np.float32(value) for name, value in numbers.items()
    }
    defaults = peer.get_default_parameters(1)
    for name, value in numbers.items():
        default = settings[name][0].default
        assert (default is None) == (not peer.has_default_parameters)
        if default is not None:
            assert np.float32(default) == np.float32(defaults.get(name, value))
    last = numbers | {name: value for _, name, value in peer.changed_parameters}
    assert {name: np.float32(values[-1].value) for name, values in settings.items()} == {
        name: np.float32(value) for name, value in last.items()
    }
    changed_at_s = {name: (stamp - peer.start_timestamp) / 1e6 for stamp, name, _ in peer.changed_parameters}
    for name, values in settings.items():
        if len(values) == 2:
            assert values[1].changed_at_s == pytest.approx(changed_at_s[name], abs=0.1)


def test_agrees_with_pyulog_on_a_written_log(tmp_path: Path) -> None:
    assert_agrees(write_ulog(tmp_path / "a.ulg"))


@pytest.mark.skipif(not RECORDED, reason="CARE_SHARED names no folder of recorded logs")
@pytest.mark.parametrize("path", one_in(2, RECORDED), ids=lambda path: path.stem)
def test_agrees_with_pyulog(path: Path) -> None:
    assert_agrees(path)


@pytest.mark.parametrize(("is_vtol", "vehicle"), [(1, "VTOL"), (0, "multicopter")])
def test_a_vtol_is_one_however_it_flies_just_now(tmp_path: Path, is_vtol: int, vehicle: str) -> None:
    parts = [ULOG_MAGIC + struct.pack("<Q", 1_000_000), ulog_record(b"B", bytes(40))]
    parts.append(ulog_record(b"F", b"vehicle_status:uint64_t timestamp;uint8_t vehicle_type;bool is_vtol;"))
    parts.append(ulog_record(b"A", b"\x00" + struct.pack("<H", 5) + b"vehicle_status"))
    parts += [ulog_record(b"D", struct.pack("<HQBB", 5, 1_000_000 + n * 500_000, 1, is_vtol)) for n in range(9)]
    (tmp_path / "a.ulg").write_bytes(b"".join(parts))
    assert open_log(tmp_path / "a.ulg").facts["vehicle"] == vehicle
