"""Values that cannot be are left out; values that are merely bad stay."""

from __future__ import annotations

import numpy as np
import pytest

from care_core.ecosystems.ardupilot.messages import MESSAGES
from care_core.ecosystems.plausible import clock_doubt, set_forward, sound
from care_core.logs.base import Table
from care_core.numbers import Floats


def battery(volts: list[float], **more: list[float]) -> dict[str, Table]:
    columns = {"Volt": np.array(volts), **{name: np.array(values) for name, values in more.items()}}
    return {"BAT": Table(np.arange(len(volts), dtype=float), columns)}


def plausible(tables: dict[str, Table]) -> dict[str, Table]:
    kept = {name: sound(MESSAGES, name, table) for name, table in tables.items()}
    return {name: table for name, table in kept.items() if table is not None}


def test_a_voltage_beyond_all_limits_is_left_out() -> None:
    np.testing.assert_array_equal(
        plausible(battery([12.0, 1e38, 11.9, -5.0, np.nan]))["BAT"]["Volt"], [12.0, 11.9, np.nan]
    )


def test_a_leap_of_one_sample_is_left_out_and_a_drop_stays() -> None:
    np.testing.assert_array_equal(plausible(battery([24.0, 24.0, 2.0, 23.9]))["BAT"]["Volt"], [24.0, 24.0, 23.9])
    dropped = [24.0, 24.0, 14.0, 13.0, 12.0]
    np.testing.assert_array_equal(plausible(battery(dropped))["BAT"]["Volt"], dropped)


def test_two_batteries_do_not_leap() -> None:
    volts = [12.0, 50.0] * 4
    assert len(plausible(battery(volts, Inst=[0.0, 1.0] * 4))["BAT"]) == 8


def test_a_position_off_the_planet_is_left_out() -> None:
    lat = np.array([-35.36, 200.0, -35.36, -35.3, -35.36])
    position = {"POS": Table(np.arange(5.0), {"Lat": lat, "Lng": np.full(5, 149.0), "RelHomeAlt": np.full(5, 10.0)})}
    np.testing.assert_array_equal(plausible(position)["POS"].t, [0.0, 2.0, 4.0])


def test_other_messages_pass() -> None:
    tables = {"XYZ": Table(np.arange(2.0), {"Volt": np.array([1e38, 0.0])})}
    assert len(plausible(tables)["XYZ"]) == 2


def test_a_dilution_of_precision_that_no_receiver_can_send_is_left_out() -> None:
    satellites = {"GPS": Table(np.arange(4.0), {"HDop": np.array([0.8, 655.35, 655.36, -0.1])})}
    np.testing.assert_array_equal(plausible(satellites)["GPS"]["HDop"], [0.8, 655.35])


def test_stamps_tell_a_recording_whose_clock_runs_wrong() -> None:
    t = np.arange(0.0, 60.0, 0.5)

    def stamped(*paces: float) -> dict[str, Table]:
        return {f"/{n}": Table(t, {"header.stamp": 5 + pace * t}) for n, pace in enumerate(paces)}

    assert clock_doubt(MESSAGES, stamped(0.99, 1.0), 0, 60) == ""
    assert clock_doubt(MESSAGES, stamped(2.0, 1.0), 0, 60) == ""  # one topic alone is wrong by itself
    assert "2 s pass in each" in clock_doubt(MESSAGES, stamped(2.0, 2.0), 0, 60)
    assert "0.5 s pass in each" in clock_doubt(MESSAGES, stamped(0.5), 0, 60)
    assert (
        clock_doubt(MESSAGES, {"/odom": Table(t, {"header.stamp": t / 2 - 1.7e9})}, 0, 60) == ""
    )  # a simulation's own time
    was_set = {"/odom": Table(t, {"header.stamp": t + 100 * (t > 20)})}
    assert clock_doubt(MESSAGES, was_set, 0, 60) == ""


T = np.arange(0.0, 60.0, 0.5)
SET = T + 40 * (T > 20)
"""The times of a log whose clock was set forward by 40 s under way."""


def satellites(t: Floats, true_s: Floats) -> dict[str, Table]:
    return {"GPS": Table(t, {"GMS": 3e8 + 1e3 * true_s, "I": np.zeros(len(t))})}


def test_a_clock_that_was_set_forward_under_way_is_told_with_its_step() -> None:
    says = "the log's clock was set forward by 40 s at 20.0 s, so no time across that is known"
    assert clock_doubt(MESSAGES, satellites(SET, T), 0, 100) == says
    assert clock_doubt(MESSAGES, {name: Table(SET, {"header.stamp": T}) for name in ("/odom", "/scan")}, 0, 100) == says
    assert clock_doubt(MESSAGES, satellites(SET, T), 30, 100) == ""  # before this run


@pytest.mark.parametrize(
    ("t", "own"),
    [
        (SET, SET),  # nothing was recorded for so long
        (np.where((T > 20) & (T < 40), 40.0, T), T),  # what was held up comes in one burst
        (T, np.where(T > 20, T - 3, T)),  # a receiver found the leap seconds
        (np.delete(T, range(42, 60)), np.delete(T, range(42, 60))),
    ],
)
def test_a_pause_or_what_was_held_up_is_no_clock_that_was_set(t: Floats, own: Floats) -> None:
    assert set_forward(t, own) is None


def test_a_receiver_that_repeats_its_time_without_a_fix_makes_no_clock_wrong() -> None:
    stood = np.where((T > 2) & (T < 34), 2.0, T)  # and has caught up after it
    assert clock_doubt(MESSAGES, satellites(T, stood), 0, 100) == ""
    assert "2 s pass in each" in clock_doubt(MESSAGES, satellites(T, 2 * T), 0, 100)


def test_one_topic_that_was_held_up_to_the_end_sets_no_clock() -> None:
    topics = {"/odom": Table(SET, {"header.stamp": T}), "/scan": Table(SET, {"header.stamp": SET})}
    assert clock_doubt(MESSAGES, topics, 0, 100) == ""


def test_what_a_vehicle_writes_at_once_says_nothing_of_its_clock() -> None:
    burst = Table(np.full(900, 0.5), {"Value": np.arange(900.0)})
    assert clock_doubt(MESSAGES, {"PARM": burst}, 0.0, 60.0) == ""
    assert "too slow or stands still" in clock_doubt(MESSAGES, {"ATT": burst}, 0.0, 60.0)


def test_a_rate_and_an_acceleration_that_no_sensor_measures_are_left_out() -> None:
    rates, accelerations = np.array([0.1, 6e29, 0.1, -0.2]), np.array([-9.8, -9.8, 1.9e11, np.nan])
    sensor = {"IMU2": Table(np.arange(4.0), {"GyrX": rates, "AccZ": accelerations})}
    np.testing.assert_array_equal(plausible(sensor)["IMU2"].t, [0.0, 3.0])


def track(lat: list[float], lng: list[float]) -> dict[str, Table]:
    t = np.arange(len(lat), dtype=float)
    return {"POS": Table(t, {"Lat": np.array(lat), "Lng": np.array(lng), "RelHomeAlt": t})}


def test_a_position_at_zero_degrees_is_none_of_a_vehicle_that_is_elsewhere() -> None:
    kept = plausible(track([47.0, 47.00001, 0.0, 0.0, 0.0, 47.00002], [8.0, 8.0, 0.0, 0.0, 0.0, 8.0]))
    np.testing.assert_array_equal(kept["POS"].t, [0.0, 1.0, 5.0])


def test_a_simulation_at_zero_degrees_keeps_its_track() -> None:
    kept = plausible(track([0.0, 1e-5, 2e-5, 0.0], [0.0, 0.0, 1e-5, 0.0]))
    assert len(kept["POS"]) == 4
