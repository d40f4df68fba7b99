"""A log that holds several runs: each is looked at as if it were a log of its own."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from care_core.diagnose.judging import judge_plainly
from care_core.ecosystems.ardupilot.examining import examine, find
from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.findings import every_finding
from care_core.logs.base import Table
from care_core.run import Setting
from tests.flights import ARMED_S, DOWN_S, END_S, UP_S, Made, flight_of

LATER_S = 200.0
"""When the second flight's record begins."""


def one_after_another(first: Made, second: Made, settings: Mapping[str, tuple[Setting, ...]] | None = None) -> Flight:
    """Both flights in one log."""
    tables = first.tables()
    for name, table in second.tables().items():
        before = tables[name]
        columns = {field: np.concatenate((before[field], table[field])) for field in before.columns}
        tables[name] = Table(np.concatenate((before.t, table.t + LATER_S)), columns)
    return flight_of(tables, settings or first.known, first.facts, LATER_S + END_S)


def overturned(made: Made, at_s: float = 90.0) -> Made:
    """It turns over with its motors up, and lies on its back."""
    over = made.t >= at_s
    made.table["ATT"]["Roll"][over] = 178.0
    made.table["ATT"]["DesRoll"][over] = 0.0
    made.table["CTUN"]["ThO"][made.t > at_s + 0.5] = 0.0
    made.rows["ARM"] = made.rows["ARM"][:1]
    return made


def titles(flight: Flight, start_s: float) -> list[str]:
    return [one.title for one in every_finding(examine(flight).of_run(start_s).findings)]


def test_a_crash_belongs_to_its_own_run() -> None:
    first, second = overturned(Made(seed=1)), Made(seed=2)
    first.rows["ARM"] = [(ARMED_S, {"ArmState": 1.0, "Forced": 0.0}), (DOWN_S, {"ArmState": 0.0, "Forced": 0.0})]
    flight = one_after_another(first, second)
    assert "it crashed" in titles(flight, ARMED_S)
    assert titles(flight, LATER_S + ARMED_S) == []
    assert "it crashed" in [one.title for one in every_finding(examine(flight).findings)]


def test_the_second_run_has_its_own_crash() -> None:
    flight = one_after_another(overturned(Made(seed=1)), overturned(Made(seed=2)))
    for start_s in (ARMED_S, LATER_S + ARMED_S):
        assert "it crashed" in titles(flight, start_s)
    judged = judge_plainly(flight, health=examine(flight), sha256=lambda: "")
    assert judged is not None
    assert [one.status for one in judged.missions] == ["fault", "fault"]


def test_a_run_in_which_something_critical_was_found_is_no_good_one() -> None:
    first = Made(seed=1)
    away = np.interp(first.t, [20.0, 50.0, 70.0, 90.0], [0.0, 40.0, 40.0, 0.0])
    first.table["CTUN"]["Alt"] += away
    first.table["POS"]["RelHomeAlt"] += away
    flight = one_after_another(first, Made(seed=2))
    judged = judge_plainly(flight, health=examine(flight), sha256=lambda: "")
    assert judged is not None
    assert "the estimated height runs away from the barometer's" in judged.missions[0].reason
    assert judged.missions[0].status == "fault"


def test_a_pack_that_the_runs_before_have_flown_down_is_told_so() -> None:
    flown = Made(seed=2)
    flown.table["BAT"]["Volt"] -= 1.5
    health = examine(one_after_another(Made(seed=1), flown))
    (empty,) = [one for one in health.of_run(LATER_S + ARMED_S).findings if one.kind == "battery"]
    assert "12.5 V before the first run of this log" in empty.evidence
    (alone,) = [one for one in flown.find() if one.kind == "battery"]
    assert "before the first run" not in alone.evidence


def test_a_parameter_has_the_value_with_which_its_run_began() -> None:
    history = (Setting("BATT_LOW_VOLT", 10.5, "PARM"), Setting("BATT_LOW_VOLT", 9.0, "PARM", changed_at_s=150.0))
    made = Made(seed=1)
    flight = one_after_another(made, Made(seed=2), {**made.known, "BATT_LOW_VOLT": history})
    assert [run.setting("BATT_LOW_VOLT") for run in flight.runs] == [10.5, 9.0]


def test_the_mode_in_force_before_a_run_holds_in_it() -> None:
    second = Made(seed=2)
    second.rows["MODE"] = [(60.0, {"ModeNum": 6.0})]
    flight = one_after_another(Made(seed=1), second)
    assert [mode.name for mode in flight.runs[1].modes_between(LATER_S + ARMED_S, LATER_S + DOWN_S)] == [
        "Loiter", "RTL",
    ]  # fmt: skip


def test_a_log_of_one_run_is_itself() -> None:
    flight = overturned(Made()).flight()
    assert flight.runs == (flight,)
    assert examine(flight).runs == ()
    assert examine(flight).findings == find(flight), "in the order of its causes"


@pytest.mark.parametrize(("throttle", "lies"), [(0.4, True), (0.0, False)])
def test_a_copter_on_its_back_has_crashed_where_its_motors_had_just_worked(throttle: float, lies: bool) -> None:
    made = Made()
    over = made.t >= DOWN_S + 4.0
    made.table["ATT"]["Roll"][over] = 178.0
    made.lies(over, 178.0)
    made.table["CTUN"]["ThO"][(made.t > DOWN_S) & (made.t < DOWN_S + 4.5)] = throttle
    made.rows["ARM"] = made.rows["ARM"][:1]
    assert (made.flight().lost_control_s is not None) is lies


@pytest.mark.parametrize(("lean_deg", "lies"), [(65.0, True), (25.0, False)])
def test_a_copter_that_lies_on_its_side_did_not_land(lean_deg: float, lies: bool) -> None:
    made = Made()
    made.table["ATT"]["Roll"][made.t >= DOWN_S + 2.0] = lean_deg
    made.lies(made.t >= DOWN_S + 2.0, lean_deg)
    assert (made.flight().lost_control_s is not None) is lies


@pytest.mark.parametrize(("rate", "tips"), [(1900.0, True), (300.0, False)])
def test_a_flip_that_is_faster_than_the_record_of_the_attitude_is_seen_in_the_rates(rate: float, tips: bool) -> None:
    made = Made()
    spins = (made.t >= UP_S + 0.5) & (made.t <= UP_S + 0.75)
    made.table["RATE"] = {"R": 0.0 * made.t, "P": np.where(spins, rate, 0.0)}
    assert (made.flight().lost_control_s is not None) is tips
