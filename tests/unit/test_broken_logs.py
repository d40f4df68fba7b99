"""Logs cut anywhere and with flipped bits: read, or refused by a LogError; never anything else, and never a lie."""

from __future__ import annotations

import os
import re
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from rosbags.rosbag1 import Reader, Writer

from care_core import limits
from care_core.ecosystems.examine import examine
from care_core.ecosystems.registry import run_model
from care_core.errors import CareError, LogError
from care_core.extract.read import read_run
from care_core.logs import file_windows, formats
from care_core.logs.base import Log
from care_core.logs.formats import LogFormat
from care_core.logs.opening import open_log
from care_core.profile.reading import read_schema
from care_core.profile.store import load_profile
from care_core.run import is_known
from tests.rewritten import write_text, write_ulog
from tests.unit.test_mavlink import Station, flight, parameter
from tests.whole import WHOLE

pytestmark = pytest.mark.long

ROOT = Path(__file__).parents[2]
SAMPLE = ROOT / "samples" / "arducopter_failed.BIN"
TIMES = 200 if WHOLE else 60
LONGEST_S = 10.0


def short_bin(path: Path) -> Path:
    path.write_bytes(SAMPLE.read_bytes()[:60_000])
    return path


def short_text(path: Path) -> Path:
    return write_text(path, SAMPLE, only=("MSG", "GPS", "CMD", "ARM"))


def short_tlog(path: Path) -> Path:
    station: Station = flight(120)
    for number in range(60):
        station.hear(parameter(f"P{number}", number)).hear(
            mavlink.MAVLink_statustext_message(6, b"Mission: 1 WP", 0, 0)
        )
    return station.write(path)


MAKERS: dict[LogFormat, Callable[[Path], Path]] = {
    formats.DATAFLASH_BIN: short_bin,
    formats.DATAFLASH_TEXT: short_text,
    formats.MAVLINK_TLOG: short_tlog,
    formats.PX4_ULG: write_ulog,
}
FIELDS = ("roll", "text", "Roll", "TimeUS", "Message", "Value", "voltage_v", "message", "Lat")


def read_all(path: Path) -> Log | None:
    """Everything a log can be asked for; None when it is refused."""
    started = time.monotonic()
    try:
        log = open_log(path)
    except LogError:
        return None
    tables = log.read({channel.name: FIELDS for channel in log.channels()})
    assert all(len(column) == len(table) for table in tables.values() for column in table.columns.values())
    assert 0 <= log.duration_s < 1e6
    log.settings()
    assert dict(log.facts) is not None
    assert log.start is None or log.start[:2] == "20"
    assert time.monotonic() - started < LONGEST_S
    return log


@pytest.mark.parametrize("kind", MAKERS)
def test_a_log_cut_anywhere(kind: LogFormat, tmp_path: Path) -> None:
    whole = MAKERS[kind](tmp_path / "whole").read_bytes()
    path = tmp_path / "cut"
    counts = []
    for at in np.linspace(1, len(whole) - 1, TIMES).astype(int).tolist():
        path.write_bytes(whole[:at])
        log = read_all(path)
        counts.append(sum(channel.count for channel in log.channels()) if log else 0)
    assert counts == sorted(counts), "more of a log holds no fewer messages"
    assert counts[-1] > 0


HELD = (formats.DATAFLASH_BIN, formats.DATAFLASH_TEXT, formats.MAVLINK_TLOG)


@pytest.mark.parametrize("kind", HELD)
def test_a_log_too_large_to_hold_is_the_same_in_windows(
    kind: LogFormat, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = MAKERS[kind](tmp_path / "log")
    held = open_log(path)
    monkeypatch.setattr(limits, "HELD_BYTES", 0)
    monkeypatch.setattr(file_windows, "WINDOW", 1000)
    windowed = open_log(path)
    assert (windowed.channels(), windowed.settings(), windowed.damage) == (
        held.channels(), held.settings(), held.damage
    )  # fmt: skip
    everything = {channel.name: FIELDS for channel in held.channels()}
    expected, found = held.read(everything), windowed.read(everything)
    assert expected.keys() == found.keys()
    for name, table in expected.items():
        np.testing.assert_array_equal(table.t, found[name].t)
        for field in table.columns:
            np.testing.assert_array_equal(table[field], found[name][field])


@pytest.mark.parametrize("kind", HELD)
def test_a_large_log_cut_while_it_is_read_is_an_error(
    kind: LogFormat, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(limits, "HELD_BYTES", 0)
    path = MAKERS[kind](tmp_path / "log")
    log = open_log(path)
    os.truncate(path, path.stat().st_size // 2)
    with pytest.raises(LogError, match="cut while it was read"):
        sum(
            len(column)
            for table in log.read({channel.name: FIELDS for channel in log.channels()}).values()
            for column in table.columns.values()
        )


DECLARED = {"BAT": "Volt", "GPS": "GMS", "PARM": "Value", "MSG": "Message", "MODE": "ModeNum", "ATT": "TimeUS"}


@pytest.mark.parametrize("name", DECLARED)
@pytest.mark.parametrize("is_text", [False, True], ids=["BIN", "text"])
def test_a_field_declared_as_what_it_is_not(is_text: bool, name: str, tmp_path: Path) -> None:
    """Numbers as text, text as numbers: as good as absent, and the rest is read."""
    whole = SAMPLE.read_bytes()
    body = whole.index(name.encode().ljust(4, b"\0") + b"Q")
    columns = whole[body + 20 : body + 84].split(b"\0")[0].decode().split(",")
    place = body + 4 + columns.index(DECLARED[name])
    size = {"Q": 8, "f": 4, "I": 4, "Z": 64, "B": 1, "M": 1}[chr(whole[place])]
    path, code = tmp_path / "log", {8: b"d", 4: b"n", 1: b"b", 64: b"a"}[size]
    if is_text:
        write_text(path, SAMPLE)
        line = re.search(rb"FMT, \d+, \d+, %s, (\w+), (\S+)" % name.encode(), path.read_bytes())
        assert line is not None
        at = line.start(1) + line[2].decode().split(",").index(DECLARED[name])
        code = b"f" if name == "MSG" else b"Z"
    else:
        path.write_bytes(whole)
        at = place
    raw = bytearray(path.read_bytes())
    raw[at : at + 1] = code
    path.write_bytes(raw)
    log = read_all(path)
    assert log is not None
    examine(run_model(log))
    read_run(run_model(log), load_profile("arducopter").schema)


def test_a_parameter_of_px4_whose_default_is_text(tmp_path: Path) -> None:
    raw = write_ulog(tmp_path / "a").read_bytes()
    for key in (b"char[4] MC_ROLL_P", b"float MC_ROLL_P"):
        body = b"\x01" + bytes([len(key)]) + key + b"\xff" * 4
        (tmp_path / "b").write_bytes(raw[:16] + _with_default(raw[16:], body))
        log = open_log(tmp_path / "b")
        assert all(isinstance(one.value, float) for history in log.settings().values() for one in history)


def _with_default(records: bytes, body: bytes) -> bytes:
    """The records of a ULog with the default of a parameter after the flags."""
    size = 3 + int.from_bytes(records[:2], "little")
    return records[:size] + len(body).to_bytes(2, "little") + b"Q" + body + records[size:]


@pytest.mark.parametrize(
    ("old", "new"),
    [(b"float64 x", b"float64[] x"), (b"float32 voltage", b"string voltage"), (b"float64 z", b"uint8[4] z")],
)
def test_a_bag_whose_definitions_are_not_those_of_ros(old: bytes, new: bytes, tmp_path: Path) -> None:
    with Reader(ROOT / "tests" / "data" / "move_base_good.bag") as bag, Writer(tmp_path / "a.bag") as made:
        written = {
            one.id: made.add_connection(
                one.topic, one.msgtype, msgdef=one.msgdef.data.replace(old.decode(), new.decode()), md5sum=one.digest
            )
            for one in bag.connections
        }
        for connection, time_ns, raw in bag.messages():
            made.write(written[connection.id], time_ns, raw)
    log = open_log(tmp_path / "a.bag")
    examine(run_model(log))
    with suppress(CareError):  # there may be no mission left
        read_run(run_model(log), load_profile("move_base").schema)


@pytest.mark.parametrize("kind", MAKERS)
def test_a_log_with_a_flipped_bit(kind: LogFormat, tmp_path: Path) -> None:
    whole = MAKERS[kind](tmp_path / "whole").read_bytes()
    path = tmp_path / "flipped"
    rng = np.random.default_rng(1)
    log = read_all(tmp_path / "whole")
    assert log is not None
    longest_s = log.duration_s + 6.0  # a last record may be moved by as much as a pause
    read, later = 0, 0
    for _ in range(TIMES):
        broken = bytearray(whole)
        broken[int(rng.integers(len(whole)))] ^= 1 << int(rng.integers(8))
        path.write_bytes(broken)
        log = read_all(path)
        read += log is not None
        later += log is not None and log.duration_s > longest_s
    assert read > 0.95 * TIMES
    assert later <= 0.02 * TIMES


def test_a_flipped_bit_makes_no_mission_succeed_and_no_absurd_value(tmp_path: Path) -> None:
    schema = read_schema(ROOT / "profiles" / "arducopter" / "profile.yaml")
    whole, path, rng = SAMPLE.read_bytes(), tmp_path / "a.BIN", np.random.default_rng(2)
    sound = read_run(run_model(open_log(SAMPLE)), schema)
    for _ in range(25):
        broken = bytearray(whole)
        for at in rng.integers(100_000, len(whole), 8).tolist():
            broken[at] ^= 1 << int(rng.integers(8))
        path.write_bytes(broken)
        try:
            run = read_run(run_model(open_log(path)), schema)
        except CareError:
            continue
        assert run.objectives["mission_success"] != 1.0 or sound.objectives["mission_success"] == 1.0
        bounds = {"mission_time": 400.0, "energy": 100.0, "path_error_max": 2000.0}
        for name, bound in bounds.items():
            value = run.objectives[name]
            assert not is_known(value) or 0 <= value < bound, name
        for name in ("min_voltage", "distance", "return_height"):
            value = run.metrics[name]
            assert not is_known(value) or 0 <= value < 5000.0, name


SHARED = os.environ.get("CARE_SHARED")
WILD = ("dataflash_bin", "dataflash_text", "mavlink_tlog", "px4_ulg")


@pytest.mark.skipif(SHARED is None, reason="CARE_SHARED names no folder of recorded logs")
@pytest.mark.parametrize("folder", WILD)
def test_every_wild_log_is_read(folder: str) -> None:
    unread = [path.name for path in sorted(Path(SHARED or "", "logs", folder).iterdir()) if read_all(path) is None]
    assert not unread
