"""Complaints that passed keep no vehicle from arming."""

from __future__ import annotations

import numpy as np
import pytest

from care_core.ecosystems.findings import Finding
from tests.flights import Made

WOULD_ARM = float(0x10000000)


def on_the_ground(*said: tuple[float, str]) -> Made:
    made = Made()
    made.rows["ARM"], made.rows["MODE"] = [], [(0.0, {"ModeNum": 0.0})]
    del made.rows["ARM"]
    made.rows["MSG"] = [(t, {"Message": text}) for t, text in said]
    for column in made.table["CTUN"]:
        made.table["CTUN"][column] = np.zeros(len(made.t))
    made.table["RCOU"] = {name: np.full(len(made.t), 1000.0) for name in made.table["RCOU"]}
    return made


def refused(made: Made) -> list[Finding]:
    return [one for one in made.find() if one.kind == "prearm"]


def ready_from(made: Made, since_s: float, until_s: float = np.inf, *, enabled: bool = True) -> Made:
    bits = np.where((made.t >= since_s) & (made.t < until_s), WOULD_ARM, 0.0)
    made.table["SYS_STATUS"] = {
        "onboard_control_sensors_enabled": np.full(len(made.t), WOULD_ARM if enabled else 0.0),
        "onboard_control_sensors_health": bits,
    }
    return made


def test_a_vehicle_that_says_it_would_arm_is_not_refused() -> None:
    said = (2.0, "PreArm: EKF3 Roll/Pitch inconsistent by 14 deg")
    assert refused(on_the_ground(said))
    assert not refused(ready_from(on_the_ground(said), 18.0))


@pytest.mark.parametrize(("until_s", "enabled"), [(60.0, True), (np.inf, False)])
def test_its_word_counts_where_it_stays_and_is_checked(until_s: float, enabled: bool) -> None:
    said = (2.0, "PreArm: EKF3 Roll/Pitch inconsistent by 14 deg")
    assert refused(ready_from(on_the_ground(said), 18.0, until_s, enabled=enabled))


def test_what_was_refused_to_somebody_stays_refused() -> None:
    assert refused(ready_from(on_the_ground((2.0, "Arm: Throttle not neutral")), 18.0))


def test_a_place_that_was_found_settles_that_it_was_missed() -> None:
    found = (9.0, "EKF3 IMU0 is using external nav data")
    assert not refused(on_the_ground((2.0, "PreArm: Need Position Estimate"), found))
    assert refused(on_the_ground((2.0, "PreArm: Compass not calibrated"), found))
    assert refused(on_the_ground((9.5, "PreArm: Need Position Estimate"), found))


def test_a_copter_without_a_frame_would_not_arm() -> None:
    made = on_the_ground((2.0, "ArduCopter V4.5.4"))
    assert not refused(made)
    made.settings["FRAME_CLASS"] = 0
    (finding,) = refused(made)
    assert (finding.severity, finding.parameters) == ("warning", ("FRAME_CLASS",))
