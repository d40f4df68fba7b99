"""Rovers that are driven against their steering or throttle, and those that wait to be set off."""

from __future__ import annotations

import numpy as np
import pytest

from care_core.ecosystems.ardupilot.checks.settings import driven, standing
from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.findings import Finding
from care_core.logs.base import Table
from care_core.run import Setting
from tests.flights import flight_of

T = np.arange(0.0, 120.0, 0.4)
UNDER_WAY = (T > 15) & (T < 110)
ROVER = {"firmware": "ArduRover V4.5.4 (e47fb132)", "vehicle": "rover"}
WIRED = {"SERVO1_FUNCTION": 26.0, "SERVO3_FUNCTION": 70.0, "SERVO1_REVERSED": 0.0, "SERVO3_REVERSED": 0.0}


def drive(steers: float = 1.0, drives: float = 1.0, throttle: float = 30.0, **settings: float) -> Flight:
    """A drive in Auto on a winding way; `steers` and `drives` say how the vehicle answers to what it asks."""
    asked = np.where(UNDER_WAY, 1500 * np.sin(T / 4), 0.0)
    pushed = np.where(UNDER_WAY, throttle, 0.0)
    wanted = np.where(UNDER_WAY & (throttle > 0), 4.0, 0.0)
    tables = {
        "THR": Table(T, {"ThrOut": pushed, "DesSpeed": wanted, "Speed": drives * pushed / 8}),
        "STER": Table(T, {"SteerOut": asked, "TurnRate": steers * asked / 60}),
        "MODE": Table(np.array([0.0]), {"ModeNum": np.array([10.0])}),
        "ARM": Table(np.array([10.0, 115.0]), {"ArmState": np.array([1.0, 0.0])}),
    }
    known = {name: (Setting(name, value, "PARM"),) for name, value in {**WIRED, **settings}.items()}
    return flight_of(tables, known, ROVER, 120.0)


def found(flight: Flight) -> Finding:
    (finding,) = driven.CHECK.find(flight)
    return finding


def test_a_drive_that_answers_to_what_it_asks_is_fine() -> None:
    assert not list(driven.CHECK.find(drive()))
    assert not list(driven.CHECK.find(drive(SERVO1_REVERSED=1.0, SERVO3_REVERSED=1.0)))


@pytest.mark.parametrize("driven_as", [0.0, 1.0])
def test_steering_that_acts_the_wrong_way_is_turned_round_whatever_its_default(driven_as: float) -> None:
    finding = found(drive(steers=-1.0, SERVO1_REVERSED=driven_as))
    assert finding.title == "it turns against its steering"
    assert finding.wanted == (("SERVO1_REVERSED", 1.0 - driven_as),)


def test_a_throttle_that_acts_the_wrong_way_is_turned_round() -> None:
    finding = found(drive(drives=-1.0, SERVO3_REVERSED=1.0))
    assert (finding.title, finding.parameters) == ("it drives against its throttle", ("SERVO3_REVERSED",))
    assert finding.wanted == (("SERVO3_REVERSED", 0.0),)


def test_a_board_that_is_turned_in_its_own_eyes_tells_nothing_of_its_outputs() -> None:
    assert not list(driven.CHECK.find(drive(steers=-1.0, drives=-1.0, AHRS_ORIENTATION=4.0)))


def test_skid_steering_has_no_one_output_to_turn_round() -> None:
    skid = {"SERVO1_FUNCTION": 73.0, "SERVO3_FUNCTION": 74.0}
    assert not list(driven.CHECK.find(drive(steers=-1.0, drives=-1.0, **skid)))


def test_what_is_controlled_as_a_balance_bot_and_is_none_runs_away() -> None:
    tables = drive(drives=1.0, throttle=-40.0, FRAME_CLASS=3.0)
    thr = tables.one("THR", "DesSpeed")
    assert thr is not None
    thr["DesSpeed"][UNDER_WAY] = 4.0
    finding = found(tables)
    assert finding.wanted == (("FRAME_CLASS", 1.0),)


@pytest.mark.parametrize(("name", "value", "usual"), [("AUTO_KICKSTART", 2.0, 0.0), ("AUTO_TRIGGER_PIN", 55.0, -1.0)])
def test_one_that_waits_to_be_set_off_names_what_it_waits_for(name: str, value: float, usual: float) -> None:
    finding = found(drive(throttle=0.0, **{name: value}))
    assert finding.title == "it waits to be set off"
    assert finding.wanted == ((name, usual),)


def test_one_that_was_set_off_and_one_that_waits_for_nothing_are_fine() -> None:
    assert not list(driven.CHECK.find(drive(AUTO_KICKSTART=2.0)))
    assert not list(driven.CHECK.find(drive(throttle=0.0)))


SKID = {"SERVO1_FUNCTION": 73.0, "SERVO3_FUNCTION": 74.0, "SERVO1_TRIM": 1500.0, "SERVO3_TRIM": 1500.0}


def skid(speed: np.ndarray, turn: np.ndarray, steer: np.ndarray, left: np.ndarray, **settings: float) -> Flight:
    """A skid-steered rover that is asked for no throttle."""
    tables = {
        "THR": Table(T, {"ThrOut": np.zeros_like(T), "DesSpeed": np.zeros_like(T), "Speed": speed}),
        "STER": Table(T, {"SteerOut": steer, "TurnRate": turn}),
        "RCOU": Table(T, {"C1": left, "C3": np.full_like(T, 1500.0)}),
        "MODE": Table(np.array([0.0]), {"ModeNum": np.array([10.0])}),
        "ARM": Table(np.array([10.0, 115.0]), {"ArmState": np.array([1.0, 0.0])}),
    }
    defaults = {**SKID, "SERVO1_REVERSED": 0.0, "SERVO3_REVERSED": 0.0, "WP_PIVOT_DELAY": 0.0}
    values = {**defaults, **settings}
    known = {name: (Setting(name, value, "PARM", default=defaults[name]),) for name, value in values.items()}
    return flight_of(tables, known, ROVER, 120.0)


@pytest.mark.parametrize(("reversed_", "turned"), [(1.0, 0.0), (0.0, 0.0), (1.0, 40.0)])
def test_one_side_that_turns_round_drives_where_it_steers(reversed_: float, turned: float) -> None:
    runs = np.where(UNDER_WAY, 4.0, 0.0)
    steers = np.where(UNDER_WAY, -4500.0, 0.0)
    flight = skid(runs, np.where(UNDER_WAY, turned, 0.0), steers, np.full_like(T, 1500.0), SERVO1_REVERSED=reversed_)
    told = [one.wanted for one in driven.CHECK.find(flight) if one.title == "it drives where it steers"]
    assert told == ([(("SERVO1_REVERSED", 0.0),)] if reversed_ and not turned else [])


@pytest.mark.parametrize(("trim", "moves"), [(1274.0, True), (1274.0, False), (1500.0, True)])
def test_an_output_off_its_middle_drives_it_while_it_is_disarmed(trim: float, moves: bool) -> None:
    before = T < 10
    turn = np.where(before & moves, -63.0, 0.0)
    flight = skid(np.zeros_like(T), turn, np.zeros_like(T), np.full_like(T, trim), SERVO1_TRIM=trim)
    told = [one.wanted for one in standing.CHECK.find(flight)]
    assert told == ([(("SERVO1_TRIM", 1500.0),)] if moves and trim != 1500.0 else [])


@pytest.mark.parametrize(("speed_ms", "evenly", "trim", "is_told"), [
    (0.2, True, 1505.0, True), (0.05, True, 1505.0, False), (0.2, False, 1505.0, False), (0.2, True, 1500.0, False)
])  # fmt: skip
def test_a_rover_that_creeps_off_evenly_is_told(speed_ms: float, evenly: bool, trim: float, is_told: bool) -> None:
    before = (T < 10) if evenly else (T < 10) & (T % 2 < 1)
    later = np.where(T >= 115, speed_ms, 0.0)  # it creeps on once it is disarmed again
    speed = np.where(before, speed_ms, later)
    flight = skid(speed, np.zeros_like(T), np.zeros_like(T), np.full_like(T, trim), SERVO1_TRIM=trim)
    assert bool(list(standing.CHECK.find(flight))) == is_told


@pytest.mark.parametrize(("delay", "severity"), [(30.0, "critical"), (8.0, "warning"), (0.0, None)])
def test_it_stands_as_long_as_the_delay_before_it_turns_on_the_spot(delay: float, severity: str | None) -> None:
    stands = (T >= 40) & (40 + delay >= T)
    speed = np.where(UNDER_WAY & ~stands, 2.0, 0.0)
    flight = skid(speed, np.zeros_like(T), np.zeros_like(T), np.full_like(T, 1500.0), WP_PIVOT_DELAY=delay)
    told = [(one.severity, one.wanted) for one in standing.CHECK.find(flight)]
    assert told == ([] if severity is None else [(severity, (("WP_PIVOT_DELAY", 0.0),))])
