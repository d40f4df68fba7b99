"""An estimated height that runs away from the barometer, and a copter that never left the ground."""

from __future__ import annotations

import numpy as np
import pytest

from care_core.ecosystems.findings import every_finding
from tests.flights import UP_S, Made

TITLE = "the estimated height runs away from the barometer's"


def drifting(metres: float) -> Made:
    made = Made()
    made.table["GPS"]["Status"][:] = 1.0  # no receiver tells
    away = np.interp(made.t, [20.0, 80.0], [0.0, metres])
    made.table["CTUN"]["Alt"] += away
    made.table["POS"]["RelHomeAlt"] += away
    return made


@pytest.mark.parametrize(("metres", "is_told"), [(3.0, False), (30.0, True)])
def test_an_estimate_that_leaves_the_barometer(metres: float, is_told: bool) -> None:
    assert (TITLE in [one.title for one in every_finding(drifting(metres).find())]) is is_told


def test_accelerometers_that_do_not_feel_gravity_are_told_with_it() -> None:
    made = drifting(30.0)
    for table in ("IMU", "IMU#2"):
        made.table[table]["AccZ"] += 1.6
    finding = next(one for one in every_finding(made.find()) if one.title == TITLE)
    assert "at rest the accelerometers feel 8.2 m/s^2" in finding.evidence
    assert finding.severity == "critical"  # Loiter goes by the height


def test_a_height_by_another_source_may_leave_the_barometer() -> None:
    made = drifting(30.0)
    made.settings["EK3_SRC1_POSZ"] = 3
    assert TITLE not in [one.title for one in every_finding(made.find())]


def test_a_barometer_on_the_ground_is_believed_before_an_estimate_that_runs_away() -> None:
    made = Made()
    for name in ("BARO", "BARO#2"):
        made.table[name]["Alt"] = made.noise(0.1)
    made.table["CTUN"]["BAlt"] = made.noise(0.1)
    made.table["GPS"]["Alt"] = 400.0 + made.noise(0.3)
    assert made.flight().airborne == ()
    made.table["GPS"]["Alt"] = 400.0 + np.interp(made.t, [UP_S, UP_S + 6], [0.0, 12.0])  # the receiver tells of a climb
    assert made.flight().airborne != ()


def test_a_barometer_that_leaves_the_receiver_and_the_estimate_is_no_runaway() -> None:
    made = Made()
    away = np.interp(made.t, [20.0, 80.0], [0.0, 30.0])
    for name, field in (("CTUN", "BAlt"), ("BARO", "Alt"), ("BARO#2", "Alt")):
        made.table[name][field] += away
    assert TITLE not in [one.title for one in every_finding(made.find())]


@pytest.mark.parametrize(("off_ms", "mode", "is_told"), [(3.0, 5.0, True), (3.0, 0.0, False), (1.0, 5.0, False)])
def test_a_climb_rate_that_the_barometer_contradicts(off_ms: float, mode: float, is_told: bool) -> None:
    made = Made()
    made.rows["MODE"] = [(0.0, {"ModeNum": mode})]
    made.table["CTUN"]["CRt"] = 100.0 * np.gradient(made.table["CTUN"]["Alt"], made.t)
    made.table["CTUN"]["CRt"][made.after(40.0, 50.0)] += 100.0 * off_ms
    assert ("the estimated climb rate runs away from the barometer's" in [one.title for one in made.find()]) is is_told


def test_one_damaged_value_is_no_climb() -> None:
    made = Made()
    made.rows["MODE"] = [(0.0, {"ModeNum": 5.0})]
    made.table["CTUN"]["CRt"] = 100.0 * np.gradient(made.table["CTUN"]["Alt"], made.t)
    made.table["CTUN"]["CRt"][int(np.flatnonzero(made.t > 45.0)[0])] = 17563.0
    assert "the estimated climb rate runs away from the barometer's" not in [one.title for one in made.find()]


def test_accelerometers_that_do_not_feel_gravity_bring_it_about() -> None:
    made = Made()
    made.table["CTUN"]["CRt"] = 100.0 * np.gradient(made.table["CTUN"]["Alt"], made.t)
    made.table["CTUN"]["CRt"][made.after(40.0, 50.0)] -= 300.0
    for table in ("IMU", "IMU#2"):
        made.table[table]["AccZ"] += 1.6
    finding = made.find()[0]
    assert (finding.kind, finding.severity) == ("imu", "critical")
    assert [one.kind for one in finding.consequences] == ["estimator"]


def test_a_receiver_that_rises_with_the_estimate_shows_a_wrong_barometer() -> None:
    made = Made()
    climbs = 3.0 * np.clip(made.t - 40.0, 0.0, 10.0)
    made.table["CTUN"]["CRt"] = 100.0 * np.gradient(made.table["CTUN"]["Alt"] + climbs, made.t)
    made.table["GPS"]["Alt"] += climbs
    assert "estimator" not in [one.kind for one in every_finding(made.find())]
