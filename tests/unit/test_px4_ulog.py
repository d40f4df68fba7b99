"""PX4 logs: one written here, those from the wild against pyulog, and the way to have pyulog."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np
import pytest

from care_core.errors import LogError
from care_core.logs.opening import open_log
from tests.rewritten import write_ulog

pytest.importorskip("pyulog")


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


def test_without_pyulog_the_error_says_how_to_have_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyulog", None)
    with pytest.raises(LogError, match="pyulog") as caught:
        open_log(write_ulog(tmp_path / "a.ulg"))
    assert "pip install 'care-tui[px4]'" in caught.value.hint


SHARED = os.environ.get("CARE_SHARED")


@pytest.mark.skipif(SHARED is None, reason="CARE_SHARED names no folder of recorded logs")
@pytest.mark.parametrize("name", ["px4_appended_multiple", "px4_events", "px4_small_20min"])
def test_agrees_with_pyulog(name: str) -> None:
    from pyulog import ULog

    path = Path(SHARED or "", "logs", "px4_ulg", f"{name}.ulg")
    log, peer = open_log(path), ULog(str(path))
    names = {f"{one.name}#{one.multi_id}" if one.multi_id else one.name: one for one in peer.data_list}
    tables = log.read({channel: tuple(data.data) for channel, data in names.items()})
    assert set(tables) == set(names)
    for channel, data in names.items():
        for field, column in data.data.items():
            np.testing.assert_array_equal(tables[channel][field], column.astype(float))
    assert len(log.settings()) == len(peer.initial_parameters)
