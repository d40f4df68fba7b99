"""Motors that stop in the air: by a switch, by disarming, by their outputs."""

from __future__ import annotations

import numpy as np
import pytest

from care_core.ecosystems.findings import CLOSED, CUT, DROPPED, every_finding
from tests.flights import FAILS_S, Made, first


def _drop(made: Made, at_s: float) -> None:
    """It falls to the ground from a time on."""
    left = np.where(made.t > at_s, np.maximum(12.0 - 5 * (made.t - at_s) ** 2, 0.0) / 12.0, 1.0)
    made.table["POS"]["RelHomeAlt"] *= left
    made.table["CTUN"]["Alt"] *= left


@pytest.mark.parametrize(("at_s", "told"), [(50.0, True), (2.0, False)])
def test_motors_that_the_emergency_switch_stops_in_the_air_are_told(at_s: float, told: bool) -> None:
    made = Made()
    made.settings["RC8_OPTION"] = 31
    made.table["RCIN"] = {f"C{n}": np.full_like(made.t, 1500.0) for n in range(1, 15)}
    made.table["RCIN"]["C8"] = np.where(made.t > at_s, 1934.0, 1094.0)
    title = "the emergency switch stopped the motors in the air"
    recorded = Made()
    recorded.rows["EV"] = [(at_s, {"Id": 54.0})]
    for one in (made, recorded):
        _drop(one, at_s)
    assert (title in [one.title for one in made.find()]) is told
    assert (title in [one.title for one in recorded.find()]) is told


@pytest.mark.parametrize(("falls_s", "is_told"), [(50.0, True), (None, False), (44.0, False)])
def test_what_is_disarmed_in_the_air_and_falls_is_told(falls_s: float | None, is_told: bool) -> None:
    made = Made()
    made.rows["ARM"][1] = (50.0, {"ArmState": 0.0, "Forced": 0.0})
    if falls_s is not None:
        _drop(made, falls_s)
    assert (DROPPED in [one.title for one in made.find()]) is is_told


def test_who_forces_a_disarming_in_the_air_has_a_reason() -> None:
    made = Made()
    _drop(made, FAILS_S)
    made.rows["ARM"][1] = (FAILS_S, {"ArmState": 0.0, "Forced": 1.0})
    finding = first(made)
    assert (finding.title, finding.severity) == (DROPPED, "critical")
    assert finding.probability < 0.2
    assert finding.evidence.endswith("somebody forced it, for what came before")


@pytest.mark.parametrize(("pulse_us", "is_told"), [(1000.0, True), (1140.0, False)])
def test_motors_that_stop_in_the_air_while_it_is_armed_are_told(pulse_us: float, is_told: bool) -> None:
    made = Made()
    _drop(made, FAILS_S)
    for column in made.table["RCOU"].values():
        column[made.after(FAILS_S)] = pulse_us
    assert (CUT in {one.title for one in every_finding(made.find())}) == is_told


@pytest.mark.parametrize(("mode", "opens_s", "is_told"), [(0.0, None, True), (2.0, None, False), (0.0, 51.0, False)])
def test_a_throttle_that_is_closed_until_it_is_lost_is_told(mode: float, opens_s: float | None, is_told: bool) -> None:
    made = Made()
    made.rows["MODE"] = [(0.0, {"ModeNum": mode})]
    _drop(made, FAILS_S)
    for column in made.table["RCOU"].values():
        column[made.after(FAILS_S, opens_s or 200.0)] = 1100.0
    made.table["ATT"]["Roll"][made.after(FAILS_S + 2)] = 150.0
    assert (CLOSED in {one.title for one in every_finding(made.find())}) == is_told


def test_a_height_that_is_set_anew_when_it_is_disarmed_is_no_fall() -> None:
    made = Made()
    made.rows["ARM"][1] = (50.0, {"ArmState": 0.0, "Forced": 0.0})
    for table, name in (("POS", "RelHomeAlt"), ("CTUN", "Alt")):
        made.table[table][name][made.after(51.0)] = 0.0
    assert DROPPED not in [one.title for one in made.find()]


def test_what_keeps_its_height_without_motors_stands_whatever_its_barometer_says() -> None:
    made = Made()
    made.rows["EV"] = [(50.0, {"Id": 54.0})]
    assert "the emergency switch stopped the motors in the air" not in [one.title for one in made.find()]
