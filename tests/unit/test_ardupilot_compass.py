"""Compasses that are disturbed, dead, apart or not to be used."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

from care_core.ecosystems import not_numbers
from care_core.run import Setting
from tests.flights import DOWN_S, END_S, FAILS_S, RATES, Made, first


@pytest.mark.parametrize("rate_hz", RATES)
def test_a_compass_that_goes_off(rate_hz: float) -> None:
    made = Made(rate_hz)
    made.table["MAG"]["MagX"][made.after(FAILS_S)] += 260
    made.table["XKF4"]["SM"][made.after(FAILS_S + 2)] = 1.6
    finding = first(made)
    assert (finding.kind, finding.title, finding.severity) == ("compass", "compass 1 is disturbed", "critical")
    assert finding.evidence.startswith("the difference of compasses 1 and 2 changes by 2")  # what is over its limit
    assert finding.onset_s == pytest.approx(FAILS_S, abs=3.0)


def test_a_difference_of_compasses_is_told_by_what_exceeds_its_limit() -> None:
    made = Made()
    made.table["MAG"]["MagX"][made.after(FAILS_S)] += np.where(np.sin(made.t[made.after(FAILS_S)] / 2) > 0.6, 190, 120)
    finding = first(made)
    found = re.search(r"changes by (\d+) mGauss in flight \(limit (\d+)\)", finding.evidence)
    assert found is not None
    assert int(found[1]) > int(found[2])


def test_compasses_that_differ_in_flips_alone_are_sound() -> None:
    made = Made()
    turns = made.after(FAILS_S, FAILS_S + 10)
    made.rows["MODE"].append((FAILS_S - 1, {"ModeNum": 1.0}))  # acro
    made.rows["MODE"].append((FAILS_S + 11, {"ModeNum": 5.0}))
    for demand in ("", "Des"):
        made.table["ATT"][f"{demand}Roll"][turns] = 170.0
    made.table["MAG#2"]["MagX"][turns] += 260
    assert not [one for one in made.find() if one.kind == "compass"]


def test_a_compass_that_is_not_used_is_nobodys_business() -> None:
    made = Made()
    made.table["MAG#2"]["MagX"][made.after(FAILS_S)] += 260
    made.settings["COMPASS_USE2"] = 0
    assert made.find() == ()


def test_what_stays_when_the_motors_stop_is_the_place() -> None:
    made = Made()
    for number in ("", "#2"):
        field = made.table[f"MAG{number}"]["MagZ"]
        field += 700 * made.table["CTUN"]["ThO"]
        field[made.after(DOWN_S)] += 250
    assert "the motors' currents disturb the compass" not in [one.title for one in made.find()]


def test_motors_that_disturb_a_compass() -> None:
    made = Made()
    for number in ("", "#2"):
        made.table[f"MAG{number}"]["MagZ"] += 700 * made.table["CTUN"]["ThO"]
    assert first(made).title == "the motors' currents disturb the compass"


def test_a_dead_compass() -> None:
    made = Made()
    for axis in "XYZ":
        made.table["MAG"][f"Mag{axis}"][made.after(FAILS_S)] = 0.0
    assert first(made).title == "the compass reads nothing"


def test_a_calibration_that_is_no_number_is_the_dead_compass() -> None:
    made = Made()
    for number in ("", "#2"):
        for axis in "XYZ":
            made.table[f"MAG{number}"][f"Mag{axis}"][made.after(FAILS_S)] = 0.0
    made.settings["COMPASS_MOT_X"] = math.nan
    finding = first(made)
    assert (finding.severity, finding.suspect) == ("critical", "parameter")
    assert "COMPASS_MOT_X" in finding.evidence
    assert (first(made).parameters, first(made).wanted) == (("COMPASS_MOT_X",), (("COMPASS_MOT_X", 0.0),))
    assert not [one for one in made.find() if one.title == "the compass reads nothing"]


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_what_is_not_a_number_is_named_with_the_value_to_put(value: float) -> None:
    made = Made()
    made.settings["ATC_RAT_RLL_P"] = value
    (finding,) = made.find()
    assert finding.title == "ATC_RAT_RLL_P is not a number"
    assert finding.wanted == (("ATC_RAT_RLL_P", 0.135),)
    assert finding.severity == "warning", "it flew well"


def test_what_is_not_a_number_is_critical_where_control_was_lost() -> None:
    known = {name: (Setting(name, math.nan, "PARM"),) for name in ("ATC_RAT_RLL_P", "ATC_RAT_PIT_P", "BATT_CAPACITY")}
    gains, battery = not_numbers.find(known, lambda _: None, END_S, failed=not_numbers.FLY, source="PARM")
    assert (gains.severity, battery.severity) == ("critical", "warning")
    assert gains.title == "ATC_RAT_RLL_P and ATC_RAT_PIT_P are not numbers"
    assert gains.wanted == ()


def test_a_refusal_that_names_the_compass_is_the_compass() -> None:
    made = Made()
    del made.rows["ARM"]
    made.table["CTUN"]["ThO"][:] = 0.0
    made.rows["MSG"] = [(t, {"Message": f"Arm: Check mag field (xy diff:{180 + t:.0f}>100)"}) for t in range(5, 105, 5)]
    finding = first(made)
    assert (finding.kind, finding.severity) == ("compass", "critical")
    assert [one.kind for one in finding.consequences] == ["prearm"]


@pytest.mark.parametrize("text", ["PreArm: Compass not calibrated", "PreArm: Compass calibrated requires reboot"])
def test_a_compass_that_is_to_be_calibrated_is_not_wrong(text: str) -> None:
    made = Made()
    del made.rows["ARM"]
    made.table["CTUN"]["ThO"][:] = 0.0
    made.rows["MSG"] = [(20.0, {"Message": text}), (50.0, {"Message": text})]
    assert [(one.kind, one.suspect) for one in made.find()] == [("prearm", "operation")]
