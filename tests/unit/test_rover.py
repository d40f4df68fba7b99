"""A rover's log from end to end: the bundled drive, whole and cut, and what its health check says."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from care_core.application.case import Request, open_case
from care_core.diagnose.records import Diagnosis
from care_core.ecosystems.ardupilot.checks import attitude, blocked
from care_core.ecosystems.ardupilot.flight import Flight
from care_core.files import bundled
from care_core.logs.base import Table
from care_core.logs.opening import open_log
from tests.flights import flight_of

SAMPLE = bundled("samples", "ardurover_failed.BIN")
COMPLETE_S = 105.7
"""When the sample says that its mission is complete; it drove off at 30.3 s."""


def triaged(path: Path) -> Diagnosis:
    return open_case(Request(path), lambda _step, _share: None).diagnosis


def cut_at(seconds: float, tmp_path: Path) -> Path:
    """The sample's first part: a log grows nearly evenly, from its parameters on."""
    data = SAMPLE.read_bytes()
    path = tmp_path / "cut.BIN"
    low, high = 0.0, 1.0
    for _ in range(12):
        share = (low + high) / 2
        path.write_bytes(data[: int(share * len(data))])
        low, high = (share, high) if open_log(path).duration_s < seconds else (low, share)
    return path


def test_the_bundled_drive_is_slow_for_its_acceleration() -> None:
    found = triaged(SAMPLE)
    assert found.profile.name == "ardurover"
    assert found.profile.fit.verdict == "fits"
    status = {result.variable.name: result.status for result in found.objectives}
    assert status == {"mission_success": "ok", "mission_time": "fault", "energy": "ok", "path_error_max": "ok"}
    (fault,) = found.faults
    assert fault.causes[0].option.name == "ATC_ACCEL_MAX"
    assert found.fix is not None
    assert [change.option.name for change in found.fix.changes] == ["ATC_ACCEL_MAX"]
    assert (found.hypotheses[0].what, found.hypotheses[0].name) == ("parameter", "ATC_ACCEL_MAX")
    need = next(result.need for result in found.objectives if result.variable.name == "mission_time")
    assert need is not None
    # The reference drive of this mission took 52.6 s from its start to its completion.
    assert need.low < 52.6 < need.high


@pytest.mark.parametrize(("seconds", "status"), [(COMPLETE_S - 1.0, "fault"), (80.0, "not_evaluated")])
def test_a_cut_drive_is_too_slow_only_once_it_has_taken_too_long(seconds: float, status: str, tmp_path: Path) -> None:
    found = triaged(cut_at(seconds, tmp_path))
    by_name = {result.variable.name: result for result in found.objectives}
    time = by_name["mission_time"]
    assert time.status == status
    if status == "fault":
        assert time.value == pytest.approx(seconds - 30.3, abs=1.0)
        assert time.reason == "so far: the log ends before the mission does"
    assert by_name["mission_success"].status == "not_evaluated"
    assert by_name["path_error_max"].status == "not_evaluated"


def stuck(speed_ms: float = 0.02, throttle: float = 30.0, turn_dps: float = 0.5, mode: int = 10) -> Flight:
    """Armed from 5 to 60 s; driven from 20 to 30 s as given, at 3 m/s before and after."""
    t = np.arange(0.0, 65.0, 0.4)
    held = (t >= 20) & (t <= 30)
    tables = {
        "ARM": Table(np.array([5.0, 60.0]), {"ArmState": np.array([1.0, 0.0])}),
        "MODE": Table(np.array([0.0]), {"ModeNum": np.array([float(mode)])}),
        "THR": Table(t, {"ThrOut": np.where(held, throttle, 30.0), "Speed": np.where(held, speed_ms, 3.0)}),
        "STER": Table(t, {"TurnRate": np.where(held, turn_dps, 0.0)}),
    }
    return flight_of(tables, {}, {"firmware": "ArduRover V4.5.4"}, 65.0)


def test_a_rover_that_is_driven_and_does_not_move_is_blocked() -> None:
    (finding,) = blocked.find(stuck())
    assert (finding.kind, finding.severity, finding.suspect) == ("blocked", "critical", "world")
    assert finding.onset_s == pytest.approx(20.0, abs=0.5)
    assert finding.end_s == pytest.approx(30.0, abs=0.5)


def test_a_rover_that_moves_turns_waits_or_is_driven_by_hand_is_not() -> None:
    assert not list(blocked.find(stuck(speed_ms=0.3)))
    assert not list(blocked.find(stuck(turn_dps=20.0)))
    assert not list(blocked.find(stuck(throttle=0.0)))
    assert not list(blocked.find(stuck(mode=0)))


def steering(speed_ms: float = 0.1, mode: int = 10, demand: float = 20.0, swing: float = 250.0) -> Flight:
    """Armed from 5 to 90 s; from 20 to 80 s it turns to and fro by so much, at 2.4 records a second."""
    t = np.arange(0.0, 95.0, 1 / 2.4)
    swung = np.where((t >= 20) & (t <= 80), swing * np.sign(np.sin(2 * np.pi * 0.9 * t)), 0.0)
    asked = demand * np.sin(t)
    tables = {
        "ARM": Table(np.array([5.0, 90.0]), {"ArmState": np.array([1.0, 0.0])}),
        "MODE": Table(np.array([0.0]), {"ModeNum": np.array([float(mode)])}),
        "THR": Table(t, {"ThrOut": np.full(len(t), 30.0), "Speed": np.full(len(t), speed_ms)}),
        "STER": Table(t, {"TurnRate": asked + swung, "DesTurnRate": asked, "SteerOut": -20 * swung}),
    }
    return flight_of(tables, {}, {"firmware": "ArduRover V4.5.4"}, 95.0)


def test_a_steering_that_swings_to_and_fro_is_set_wrong() -> None:
    (finding,) = attitude.find(steering())
    assert (finding.title, finding.severity, finding.suspect) == ("the steering oscillates", "critical", "parameter")
    assert finding.onset_s == pytest.approx(20.0, abs=2.0)
    assert finding.evidence.endswith("the vehicle makes no progress")
    (mild,) = attitude.find(steering(speed_ms=2.0))
    assert (mild.severity, mild.probability) == ("warning", 0.2)


def test_a_steering_that_follows_its_demand_or_is_turned_by_hand_does_not_oscillate() -> None:
    assert not list(attitude.find(steering(swing=10.0)))
    assert not list(attitude.find(steering(mode=0)))
    (full,) = attitude.find(steering(demand=200.0))  # the demand swings with it, and the steering gives all it has
    assert full.title == "the steering oscillates"
    assert not list(attitude.find(steering(demand=200.0, swing=100.0)))


def test_a_steering_gain_that_is_too_high_is_named_where_nothing_could_be_evaluated(recorded: Path) -> None:
    found = triaged(recorded / "data" / "rover" / "faults" / "h62_06_01.BIN")
    assert {result.status for result in found.objectives} == {"not_evaluated"}
    assert (found.hypotheses[0].what, found.hypotheses[0].name) == ("parameter", "ATC_STR_RAT_P")
    assert any("ATC_STR_RAT_P 1.86 (reference 0.2)" in note for note in found.notes)
