"""Gyros and accelerometers that are noisy, offset, apart or upside down."""

from __future__ import annotations

import numpy as np
import pytest

from care_core.ecosystems.findings import every_finding
from tests.flights import DOWN_S, END_S, FAILS_S, UP_S, Made, first


def offset_gyro(made: Made, dps: float) -> None:
    for table in ("IMU", "IMU#2"):
        made.table[table]["GyrX"] += np.radians(dps)


@pytest.mark.parametrize(("dps", "is_told"), [(8.0, True), (1.0, False)])
def test_a_gyro_that_turns_at_rest_while_gravity_stays_is_offset(dps: float, is_told: bool) -> None:
    made = Made()
    made.table["CTUN"]["ThO"][made.t < UP_S] = 0.0
    offset_gyro(made, dps)
    assert ("the gyro is offset at rest" in [one.title for one in made.find()]) is is_told


def test_what_is_turned_about_the_vertical_as_it_stands_has_no_offset_gyro() -> None:
    made = Made()
    made.table["CTUN"]["ThO"][made.t < UP_S] = 0.0
    for table in ("IMU", "IMU#2"):
        made.table[table]["GyrZ"] += np.radians(20.0)
    assert "the gyro is offset at rest" not in [one.title for one in made.find()]


def test_control_was_not_lost_where_gravity_contradicts_the_attitude_at_rest() -> None:
    made = Made()
    made.table["CTUN"]["ThO"][(made.t < UP_S) | (made.t > DOWN_S)] = 0.0
    offset_gyro(made, 8.0)
    made.table["ATT"]["Roll"] = np.interp(made.t, [0.0, 20.0, END_S], [20.0, 50.0, 60.0])
    assert made.flight().lost_control_s is not None
    titles = [one.title for one in every_finding(made.find())]
    assert "the gyro is offset at rest" in titles
    assert "control was lost" not in titles


def test_a_failed_gyro() -> None:
    made = Made()
    made.table["IMU"]["GH"][made.after(FAILS_S)] = 0
    assert first(made).title == "gyro 1 failed"


@pytest.mark.parametrize(("felt", "is_told"), [(9.8, False), (9.2, False), (7.8, True)])
def test_accelerometers_that_do_not_feel_gravity_at_rest_are_told(felt: float, is_told: bool) -> None:
    made = Made()
    for name in ("IMU", "IMU#2"):
        made.table[name]["AccZ"] += 9.8 - felt
    titles = [one.title for one in every_finding(made.find())]
    assert ("the accelerometers do not feel gravity at rest" in titles) == is_told


@pytest.mark.parametrize(("roll_deg", "is_told"), [(0.0, True), (180.0, False)])
def test_gravity_that_is_felt_upside_down_is_told_unless_the_vehicle_hangs_so(roll_deg: float, is_told: bool) -> None:
    made = Made()
    for name in ("IMU", "IMU#2"):
        made.table[name]["AccZ"] *= -1
    made.table["ATT"]["Roll"] += roll_deg
    titles = [one.title for one in every_finding(made.find())]
    assert ("the accelerometers feel gravity upside down" in titles) == is_told


def test_gyros_that_turn_fast_differ_by_their_scale_and_are_not_noisy() -> None:
    made = Made()
    flips = made.after(FAILS_S, FAILS_S + 30)
    for axis, period in zip("XYZ", (3.0, 4.0, 5.0), strict=True):
        turn = np.radians(300 * np.sin(2 * np.pi * made.t / period))[flips]
        made.table["IMU"][f"Gyr{axis}"][flips] += turn
        made.table["IMU#2"][f"Gyr{axis}"][flips] += 0.97 * turn
    assert not [one for one in made.find() if one.kind == "imu"]


@pytest.mark.parametrize("stays", [True, False])
def test_gyros_disagree_by_an_offset_and_not_by_swings_that_the_record_turns_into_slow_ones(stays: bool) -> None:
    made = Made()
    apart = np.full_like(made.t, 9.0) if stays else 14.0 * np.sin(2 * np.pi * made.t / 40.0)
    made.table["IMU#2"]["GyrX"] += np.where(made.after(UP_S, DOWN_S), np.radians(apart), 0.0)
    assert ("the gyros disagree" in [one.title for one in every_finding(made.find())]) is stays
