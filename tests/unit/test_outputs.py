"""Rovers whose outputs are trimmed, ended or said to turn otherwise than they do."""

from __future__ import annotations

import numpy as np
import pytest

from care_core.ecosystems.ardupilot.checks import blocked
from care_core.ecosystems.ardupilot.checks.settings import outputs
from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.findings import Finding
from care_core.logs.base import Table
from care_core.run import Setting
from tests.flights import flight_of

T = np.arange(0.0, 120.0, 0.2)
ROVER = {"firmware": "ArduRover V4.5.4 (e47fb132)", "vehicle": "rover"}
ENDS = {f"SERVO{n}_{end}": us for n in (1, 3) for end, us in (("MIN", 1000.0), ("TRIM", 1500.0), ("MAX", 2000.0))}
STEERED = {"SERVO1_FUNCTION": 26.0, "SERVO3_FUNCTION": 70.0, "TURN_RADIUS": 0.9}
SKID = {"SERVO1_FUNCTION": 73.0, "SERVO3_FUNCTION": 74.0}
UNDER_WAY = (T > 11) & (T < 114)


def speed_of(push_us: np.ndarray) -> np.ndarray:
    """m/s of a vehicle that gains 4 m/s^2 at full throttle and loses half its speed in about 1.4 s."""
    speed = np.zeros_like(T)
    for i in range(1, len(T)):
        speed[i] = speed[i - 1] + 0.2 * (4.0 * push_us[i - 1] / 500 - 0.5 * speed[i - 1])
    return speed


def drive(
    first: np.ndarray, third: np.ndarray, *, noise: float = 0.0, wanted: float = 0.0, skid: bool = False,
    straight_us: float = 1500.0, **settings: float,
) -> Flight:  # fmt: skip
    """What a rover that drives straight at `straight_us` does with what they are told, and what it is asked for."""
    rng = np.random.default_rng(1)
    speed = speed_of(((first + third) / 2 if skid else third) - 1500)
    radians = (first - third) / 1000 if skid else speed * (first - straight_us) / 500 / 0.9
    turned = np.degrees(radians) + noise * rng.normal(size=len(T))
    tables = {
        "THR": Table(T, {"ThrOut": (third - 1500) / 5, "DesSpeed": np.where(UNDER_WAY, wanted, 0.0), "Speed": speed}),
        "STER": Table(T, {"SteerOut": first - 1500, "TurnRate": turned, "DesTurnRate": turned}),
        "RCOU": Table(T, {"C1": first, "C3": third}),
        "MODE": Table(np.array([0.0]), {"ModeNum": np.array([10.0])}),
        "ARM": Table(np.array([10.0, 115.0]), {"ArmState": np.array([1.0, 0.0])}),
    }
    defaults = {**ENDS, "TURN_RADIUS": 0.9}
    values = {**ENDS, **(SKID if skid else STEERED), **settings}
    known = {name: (Setting(name, value, "PARM", default=defaults.get(name)),) for name, value in values.items()}
    return flight_of(tables, known, ROVER, 120.0)


STEERS = np.where(UNDER_WAY, 1500 + 200 * np.sin(T / 4), 1500.0)
DRIVES = np.where(UNDER_WAY, 1650 + 60 * np.sin(T / 7), 1500.0)
LEFT, RIGHT = DRIVES + (STEERS - 1500) / 2, DRIVES - (STEERS - 1500) / 2


def found(flight: Flight) -> Finding:
    (finding,) = outputs.CHECK.find(flight)
    return finding


@pytest.mark.parametrize("noise", [0.0, 5.0])
def test_outputs_that_do_as_they_are_set_are_fine(noise: float) -> None:
    assert not list(outputs.CHECK.find(drive(STEERS, DRIVES, noise=noise)))
    assert not list(outputs.CHECK.find(drive(LEFT, RIGHT, noise=noise, skid=True)))
    assert not list(outputs.CHECK.find(drive(STEERS, DRIVES, SERVO1_TRIM=1470.0, SERVO3_TRIM=1530.0)))


@pytest.mark.parametrize(("trim", "severity"), [(1430.0, "warning"), (1320.0, "critical"), (1640.0, "critical")])
def test_a_steering_trim_that_does_not_drive_straight_is_told_with_the_one_that_does(
    trim: float, severity: str
) -> None:
    finding = found(drive(STEERS, DRIVES, noise=3.0, SERVO1_TRIM=trim))
    assert (finding.title, finding.severity) == ("the trim of the steering is not its middle", severity)
    assert finding.wanted == (("SERVO1_TRIM", 1500.0),)


def test_a_steering_that_was_mounted_off_its_middle_is_told_though_its_trim_is_as_shipped() -> None:
    finding = found(drive(STEERS, DRIVES, straight_us=1600.0))
    assert finding.wanted == (("SERVO1_TRIM", 1600.0),)


@pytest.mark.parametrize("trim", [1270.0, 1400.0, 1690.0])
def test_a_throttle_trim_that_drives_is_told_and_not_that_it_stands(trim: float) -> None:
    stands = drive(STEERS, np.where((T > 60) & UNDER_WAY, 1500.0, DRIVES), SERVO3_TRIM=trim)
    finding = found(stands)
    assert finding.title == "the trim of the throttle is not its middle"
    assert finding.wanted == (("SERVO3_TRIM", 1500.0),)
    assert not list(blocked.CHECK.find(stands))


def test_a_throttle_that_needs_a_push_to_start_is_no_wrong_trim() -> None:
    assert not list(outputs.CHECK.find(drive(STEERS, DRIVES - 90, SERVO3_TRIM=1500.0)))


def test_each_side_of_a_skid_steered_vehicle_is_told_by_itself() -> None:
    finding = found(drive(LEFT, RIGHT, skid=True, noise=1.0, SERVO3_TRIM=1620.0))
    assert finding.title == "the trim of the right wheels is not its middle"
    assert finding.wanted == (("SERVO3_TRIM", 1500.0),)


def test_an_end_that_keeps_it_from_its_speed_is_told_and_one_that_does_not_is_not() -> None:
    held = np.minimum(DRIVES, 1620.0)
    finding = found(drive(STEERS, held, wanted=5.0, SERVO3_MAX=1620.0))
    assert (finding.title, finding.severity) == ("an output ends before what it is asked for", "critical")
    assert finding.wanted == (("SERVO3_MAX", 2000.0),)
    assert not list(outputs.CHECK.find(drive(STEERS, held, wanted=2.0, SERVO3_MAX=1620.0)))
    assert not list(outputs.CHECK.find(drive(STEERS, held, wanted=5.0)))


@pytest.mark.parametrize(("said", "measured"), [(5.8, 0.9), (0.3, 0.9)])
def test_a_tightest_turn_that_is_not_the_vehicles_is_told_with_its_own(said: float, measured: float) -> None:
    finding = found(drive(STEERS, DRIVES, TURN_RADIUS=said))
    assert finding.title == "the tightest turn is not TURN_RADIUS"
    ((name, wanted),) = finding.wanted
    assert name == "TURN_RADIUS"
    assert wanted == pytest.approx(measured, rel=0.05)


def test_a_turn_that_the_outputs_do_not_explain_tells_nothing() -> None:
    assert not list(outputs.CHECK.find(drive(STEERS, DRIVES, noise=60.0, SERVO1_TRIM=1320.0, TURN_RADIUS=9.0)))
