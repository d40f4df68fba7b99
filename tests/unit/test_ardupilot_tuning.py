"""Oscillations, and what is none."""

from __future__ import annotations

import numpy as np
import pytest

from care_core.ecosystems.ardupilot.examining import find
from care_core.ecosystems.findings import every_finding
from care_core.run import Setting
from tests.flights import END_S, FAILS_S, RATES, Made, first, flight_of


def oscillating(made: Made, start: float = 30.0, end: float = 90.0) -> None:
    swing = np.where(made.after(start, end), 120 * np.sin(2 * np.pi * 3.1 * made.t), 0.0)
    made.table["RATE"] = {"R": made.noise(1), "P": swing, "RDes": made.noise(2), "PDes": made.noise(2)}


def test_default_gains_that_swing_in_a_simulator_are_a_note() -> None:
    made = Made()
    oscillating(made)
    flight = made.flight()
    simulator = {"SIM_RATE_HZ": (Setting("SIM_RATE_HZ", 1200.0, "PARM"),)}
    for value, severity in ((0.135, "info"), (0.4, "warning")):
        gains = {"ATC_RAT_RLL_P": (Setting("ATC_RAT_RLL_P", value, "PARM", default=0.135),)}
        known = {**flight.settings, **simulator, **gains}
        (finding,) = find(flight_of(made.tables(), known, flight.log.facts, END_S))
        assert (finding.title, finding.severity) == ("pitch oscillates", severity)


@pytest.mark.parametrize("rate_hz", RATES)
def test_noisy_gyros_are_told_from_an_oscillation(rate_hz: float) -> None:
    made = Made(rate_hz)
    bad = made.after(FAILS_S)
    for axis in "XYZ":
        made.table["IMU"][f"Gyr{axis}"][bad] += np.radians(made.noise(8.0)[bad])
    finding = first(made)
    assert (finding.kind, finding.title) == ("imu", "the gyros are noisy")
    assert finding.onset_s == pytest.approx(FAILS_S, abs=5.0 + 4 / rate_hz)
    swinging = Made(rate_hz)
    swing = np.radians(120 * np.sin(2 * np.pi * 4.3 * swinging.t))
    swinging.table["IMU"]["GyrX"] += swing
    swinging.table["IMU#2"]["GyrX"] += 0.95 * swing
    assert not [one for one in swinging.find() if one.kind == "imu"]


def test_an_oscillation_is_a_parameter() -> None:
    made = Made()
    t = made.t
    swing = np.where(made.after(30.0, 90.0), 120 * np.sin(2 * np.pi * 3.1 * t), 0.0)
    made.table["RATE"] = {"R": swing, "P": made.noise(1), "RDes": made.noise(2), "PDes": made.noise(2)}
    finding = first(made)
    assert (finding.kind, finding.title, finding.suspect) == ("tuning", "roll oscillates", "parameter")


def test_a_controller_that_asks_for_all_the_motors_have_oscillates_though_its_demand_swings_too() -> None:
    made = Made()
    oscillating(made)
    made.table["RATE"]["PDes"] = 0.6 * np.roll(made.table["RATE"]["P"], 3)
    assert made.find() == ()
    made.table["RATE"] |= {"ROut": made.noise(0.02), "POut": -made.table["RATE"]["P"] / 50}
    assert first(made).title == "pitch oscillates"


def test_an_oscillation_that_takes_all_the_thrust_leads_what_it_brings_about() -> None:
    made = Made()
    oscillating(made)
    made.table["CTUN"]["ThO"][made.after(50.0, 80.0)] = 0.98
    finding = first(made)
    assert (finding.title, finding.severity) == ("pitch oscillates", "critical")
    assert "at their limit for 30 s" in finding.evidence
    assert [one.title for one in finding.consequences] == ["too little thrust"]


def test_motors_at_their_limit_before_it_swings_are_not_the_oscillations_doing() -> None:
    made = Made()
    oscillating(made, start=60.0)
    made.table["CTUN"]["ThO"][made.after(30.0, 80.0)] = 0.98
    found = {one.title: one for root in made.find() for one in (root, *root.below)}
    assert found["pitch oscillates"].severity == "warning"
    assert first(made).title == "too little thrust"


def test_a_log_too_slow_to_show_each_swing_shows_that_they_come_out_even() -> None:
    made = Made(rate_hz=2.0)
    slow = np.where(made.after(30.0, 42.0), 60 * np.sin(2 * np.pi * (made.t - 30.0) / 9.0), 0.0)
    made.table["RATE"] = {"R": slow, "P": made.noise(1), "RDes": made.noise(1), "PDes": made.noise(1)}
    assert first(made).title == "roll oscillates"
    made.table["RATE"]["R"] = np.abs(slow)
    assert made.find() == ()


@pytest.mark.parametrize(("growth", "oscillates"), [(2.6, True), (1.0, False)])
def test_swings_that_grow_until_control_is_lost_are_an_oscillation(growth: float, *, oscillates: bool) -> None:
    """Of two half swings a second: as they grow, and as one push turns it over."""
    made = Made(rate_hz=25.0)
    swings = np.clip(np.floor((made.t - 50.0) * 2), 0, 5)
    rate = np.where(made.after(50.0, 53.0), 4.0 * growth**swings * np.sin(2 * np.pi * (made.t - 50.0)), made.noise(0.5))
    tumbles = made.after(53.0)
    made.table["RATE"] = {"R": rate, "P": made.noise(0.5), "RDes": made.noise(0.5), "PDes": made.noise(0.5)}
    made.table["ATT"]["Roll"] = np.where(tumbles, 150.0, np.cumsum(rate) / 25.0)
    made.table["CTUN"]["ThO"][tumbles] = 0.9
    titles = [one.title for one in every_finding(made.find())]
    assert ("roll oscillates" in titles) is oscillates
    assert "control was lost" in titles
