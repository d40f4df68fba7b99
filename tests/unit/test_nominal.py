"""The formulas against motion worked out by hand, and against a speed profile that is integrated step by step."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_core.causal.nominal import FORMULAS, nominal

OPTIONS = {
    "speed": 10.0, "acceleration": 2.5, "jerk": 1000.0, "radius": 0.0, "climb_speed": 2.5, "descent_speed": 1.5,
    "lean_limit": 45.0, "response": 0.0, "return_height": 15.0, "landing_speed": 0.5,
}  # fmt: skip
MISSION = {
    "path_length": 300.0, "legs": 3.0, "leg_variation": 0.0, "climb": 0.0, "climbing_legs": 0.0, "descent": 0.0,
    "descending_legs": 0.0, "flown_corners": 0.0, "corner_turn": 0.0, "commanded_speed": 0.0, "hold_time": 0.0,
    "takeoff_height": 20.0, "end_height": 20.0, "return_distance": 100.0, "returns": 1.0, "hover_power": 360.0,
}  # fmt: skip


def value(kind: str, **changed: float) -> float:
    given = {**OPTIONS, **MISSION, **changed}
    return float(nominal(kind, {}, dict.fromkeys(given, "")).of(
        np.array([[given[name] for name in FORMULAS[kind].arguments]])
    )[0])  # fmt: skip


def test_legs_from_rest_to_rest() -> None:
    lag = 0.2
    assert value("multicopter_cruise_time") == pytest.approx(3 * (10 + 4 + lag), abs=0.05)
    # 10 m are too short for 10 m/s: 5 m to speed up, 5 m to slow down.
    assert value("multicopter_cruise_time", path_length=30.0) == pytest.approx(
        3 * (2 * np.sqrt(10 / 2.5) + lag), abs=0.05
    )


def test_a_commanded_speed_beats_the_parameter_but_not_on_the_way_home() -> None:
    cruise, home = "multicopter_cruise_time", "multicopter_return_time"
    assert value(cruise, commanded_speed=4.0, speed=2.0) == value(cruise, commanded_speed=4.0, speed=18.0)
    assert value(home, commanded_speed=4.0, speed=2.0) > value(home, commanded_speed=4.0, speed=18.0)


def test_a_leg_is_no_faster_than_its_height_allows() -> None:
    slow = value("multicopter_cruise_time", climb=150.0, climbing_legs=3.0)
    assert slow > 3 * 50 / 2.5
    assert value("multicopter_cruise_time", climb=150.0, climbing_legs=3.0, climb_speed=5.0) < slow


@given(st.floats(0.1, 10), st.floats(0, 180), st.floats(0.5, 15))
def test_corners_flown_through_save_time_but_never_more_than_the_stop_costs(
    radius: float, turn: float, jerk: float
) -> None:
    stopping = value("multicopter_cruise_time", jerk=jerk)
    passing = value("multicopter_cruise_time", jerk=jerk, flown_corners=2.0, corner_turn=turn, radius=radius)
    ramp = 10 / 2.5 + 2.5 / jerk + 0.2 if jerk > 2.5**2 / 10 else 2 * np.sqrt(10 / jerk) + 0.2
    assert stopping - 2 * ramp - 1e-6 <= passing <= stopping


def test_a_wider_radius_cuts_more_of_a_corner() -> None:
    times = [
        value("multicopter_cruise_time", jerk=1.0, flown_corners=2.0, corner_turn=90.0, radius=r) for r in (1, 2, 5)
    ]
    assert times == sorted(times, reverse=True)
    assert times[0] > times[-1]


def test_the_mission_is_its_phases() -> None:
    names = ("takeoff", "cruise", "return", "descent", "landing")
    phases = sum(value(f"multicopter_{name}_time") for name in names)
    assert value("multicopter_mission_time", hold_time=8.0) == pytest.approx(phases + 8)
    assert value("multicopter_energy") == pytest.approx(360 * phases / 3600)


def test_a_mission_that_lands_where_it_ends_has_no_way_home() -> None:
    assert value("multicopter_return_time", returns=0.0) == pytest.approx(0, abs=1e-5)
    assert value("multicopter_descent_time", returns=0.0, return_height=60.0) == value("multicopter_descent_time")


def test_near_home_a_return_stays_low() -> None:
    assert value("multicopter_descent_time", return_distance=5.0, return_height=60.0) == value(
        "multicopter_descent_time"
    )
    assert value("multicopter_descent_time", return_height=60.0) > value("multicopter_descent_time")


def test_units_of_variables_become_those_of_arguments() -> None:
    given = nominal(
        "multicopter_takeoff_time", {"climb_speed": "WPNAV_SPEED_UP"}, {"WPNAV_SPEED_UP": "cm/s", "takeoff_height": "m"}
    )
    assert given.of(np.array([[20.0, 250.0]])) == pytest.approx(value("multicopter_takeoff_time"))


@pytest.mark.parametrize(
    ("kind", "given", "says"),
    [
        ("multicopter_time", {}, "no formula"),
        ("multicopter_takeoff_time", {"speed": "climb_speed"}, "no argument 'speed'"),
        ("multicopter_takeoff_time", {"climb_speed": "vz"}, "needs 'vz'"),
    ],
    ids=["kind", "argument", "variable"],
)
def test_what_is_wrong_is_named(kind: str, given: dict[str, str], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        nominal(kind, given, {"takeoff_height": "m", "climb_speed": "m/s"})


# --- rovers -----------------------------------------------------------------------------------------------------

ROVER = {
    "path_length": 200.0, "legs": 2.0, "leg_variation": 0.0, "flown_corners": 0.0, "corner_turn": 0.0,
    "sharp_corners": 0.0, "sharp_turns": 0.0, "commanded_speed": 0.0, "hold_time": 0.0, "speed": 5.0,
    "acceleration": 1.0, "deceleration": 0.0, "radius": 3.0, "turn_limit": 5.9, "turn_rate": 120.0,
    "throttle_limit": 100.0, "full_throttle_speed": 20.0, "steering_kind": 0.0, "energy_per_metre": 36.0,
}  # fmt: skip


def of_rover(kind: str, **changed: float) -> float:
    given = {**ROVER, **changed}
    row = np.array([[given[name] for name in FORMULAS[kind].arguments]])
    return float(nominal(kind, {}, dict.fromkeys(given, "")).of(row)[0])


def test_a_rovers_legs_from_rest_to_rest() -> None:
    # Each leg: 100 m at 5 m/s, 5 s for speeding up and slowing down at 1 m/s/s, 1 s for its rise and fall.
    assert of_rover("drive_cruise_time") == pytest.approx(2 * (20 + 5 + 1))
    assert of_rover("drive_mission_time", hold_time=7.0) == pytest.approx(of_rover("drive_cruise_time") + 7)
    assert of_rover("drive_cruise_speed") == pytest.approx(200 / 52)
    assert of_rover("drive_energy") == pytest.approx(2.0)


def test_the_smaller_of_both_accelerations_plans_a_rovers_mission() -> None:
    slow = of_rover("drive_cruise_time", deceleration=0.25)
    assert slow == of_rover("drive_cruise_time", acceleration=0.25)
    assert of_rover("drive_cruise_time", deceleration=4.0) == of_rover("drive_cruise_time")


def test_a_rover_is_no_faster_than_its_throttle_allows() -> None:
    slow = of_rover("drive_cruise_time", full_throttle_speed=4.0, throttle_limit=50.0)
    assert slow == pytest.approx(of_rover("drive_cruise_time", speed=2.0))
    # A limit below 30% counts as 30%.
    low = {"full_throttle_speed": 4.0, "throttle_limit": 10.0}
    assert of_rover("drive_cruise_time", **low) == pytest.approx(of_rover("drive_cruise_time", speed=1.2))


def test_a_commanded_speed_beats_a_rovers_parameter() -> None:
    assert of_rover("drive_cruise_time", commanded_speed=2.0) == of_rover("drive_cruise_time", speed=2.0)


def test_only_a_rover_that_steers_by_its_wheels_turns_on_the_spot() -> None:
    sharp = {"flown_corners": 1.0, "corner_turn": 90.0, "sharp_corners": 1.0, "sharp_turns": 90.0}
    stopping = of_rover("drive_cruise_time")
    assert of_rover("drive_cruise_time", steering_kind=1.0, **sharp) == pytest.approx(stopping + 90 / 60)
    assert of_rover("drive_cruise_time", steering_kind=1.0, turn_rate=30.0, **sharp) == pytest.approx(stopping + 3)
    assert of_rover("drive_cruise_time", **sharp) < stopping


@given(st.floats(12, 360), st.floats(1, 9))
def test_a_faster_rover_that_turns_more_slowly_strays_farther(rate: float, speed: float) -> None:
    here = of_rover("drive_path_error", turn_rate=rate, speed=speed)
    assert here <= of_rover("drive_path_error", turn_rate=rate / 2, speed=speed)
    assert here <= of_rover("drive_path_error", turn_rate=rate, speed=speed * 1.5)
    assert here <= of_rover("drive_path_error", turn_rate=rate, speed=speed, steering_kind=1.0)


@pytest.mark.parametrize("short", [10.0, 40.0, 90.0])
def test_legs_of_two_lengths_take_what_each_takes_alone(short: float) -> None:
    long = 200.0 - short
    together = value("multicopter_cruise_time", path_length=200.0, legs=2.0, leg_variation=(long - short) / 200.0)
    alone = [value("multicopter_cruise_time", path_length=length, legs=1.0) for length in (short, long)]
    assert together == pytest.approx(sum(alone), rel=1e-9)


PX4 = {
    "speed": 5.0, "fastest": 12.0, "acceleration": 3.0, "jerk": 1000.0, "radius": 0.0, "lean_limit": 45.0,
    "climb_speed": 3.0, "descent_speed": 1.5, "takeoff_speed": 1.5, "return_height": 30.0, "descend_height": 10.0,
    "landing_delay": 0.0, "landing_speed": 0.7, "detection_time": 1.0, "disarm_time": 2.0,
}  # fmt: skip


def px4(kind: str, **changed: float) -> float:
    return value(kind, **{**PX4, **changed})


def test_px4s_legs_from_rest_to_rest() -> None:
    assert px4("px4_cruise_time") == pytest.approx(3 * (100 / 5 + 5 / 3), rel=0.03)
    assert px4("px4_cruise_time", fastest=2.5) > 300 / 2.5
    assert px4("px4_cruise_speed") == pytest.approx(300 / px4("px4_cruise_time"))


def test_px4_is_no_faster_through_a_corner_than_its_radius_lets() -> None:
    times = [px4("px4_cruise_time", flown_corners=2.0, corner_turn=90.0, radius=r) for r in (0.0, 1.0, 4.0)]
    assert times == sorted(times, reverse=True)
    assert times[-1] >= 300 / 5


def test_px4s_mission_is_its_phases() -> None:
    names = ("takeoff", "cruise", "return", "descent", "landing")
    phases = sum(px4(f"px4_{name}_time") for name in names)
    assert px4("px4_mission_time", hold_time=8.0) == pytest.approx(phases + 8)
    assert px4("px4_energy") == pytest.approx(360 * phases / 3600)
    assert px4("px4_landing_time") == pytest.approx(5 / 0.7 + 3)
    assert px4("px4_return_time", returns=0.0) == pytest.approx(0.0, abs=1e-5)
    assert px4("px4_descent_time", landing_delay=9.0) == pytest.approx(px4("px4_descent_time") + 9)


@given(st.floats(0.3, 3.0), st.floats(10.0, 80.0))
def test_px4_comes_down_later_from_higher_up_and_more_slowly(descent: float, height: float) -> None:
    usual = px4("px4_descent_time", descent_speed=descent, return_height=height)
    assert px4("px4_descent_time", descent_speed=descent, return_height=height + 5) >= usual
    assert px4("px4_descent_time", descent_speed=descent / 2, return_height=height) > usual


PLANE = {
    "speed": 20.0, "least_speed": 12.0, "most_speed": 30.0, "commanded_speed": 0.0, "loiter_turns": 0.0,
    "loiters": 0.0, "loiter_radius": 80.0, "hold_time": 0.0, "period": 15.0, "leg_after_loiter": 0.0, "rises": 0.0,
    "first_rise": 0.0, "first_length": 200.0, "legs_length": 1000.0, "climb_rate": 5.0, "way_out": 2000.0,
    "way_back": 0.0, "home_height": 0.0, "climbs": 0.0, "level_power": 150.0, "climb_speed": 2.5, "descent_speed": 1.5,
    "takeoff_height": 30.0, "end_height": 60.0, "return_height": 15.0,
}  # fmt: skip


def plane(kind: str, **changed: float) -> float:
    given = {**PLANE, **changed}
    columns = np.array([[given[name] for name in FORMULAS[kind].arguments]])
    return float(nominal(kind, {}, dict.fromkeys(given, "")).of(columns)[0])


def test_a_planes_mission_is_its_legs_and_its_circles() -> None:
    straight = plane("plane_mission_time")
    assert plane("plane_mission_time", way_out=2200.0) - straight == pytest.approx(10.0)
    circle_s = 2 * np.pi * 80.0 / 20.0
    waits, turns = plane("plane_mission_time", hold_time=15.0, loiters=1.0), plane("plane_mission_time", loiter_turns=1)
    assert 15.0 < waits - straight < 15.0 + circle_s, "it has to find the circle, and its course out of it"
    assert circle_s < turns - straight < 2 * circle_s


def test_a_plane_returns_at_its_own_airspeed_whatever_the_mission_commanded() -> None:
    slow = plane("plane_mission_time", commanded_speed=15.0)
    assert plane("plane_mission_time", commanded_speed=15.0, way_back=500.0) - slow == pytest.approx(25.0)


def test_in_thin_air_a_plane_flies_faster_over_ground() -> None:
    # At 2000 m the density is 1.0065 kg/m^3, at the sea 1.225 (ISO 2533).
    faster = float(np.sqrt(1.225 / 1.0065))
    assert plane("plane_leg_speed", home_height=2000.0) == pytest.approx(20.0 * faster, rel=1e-3)
    assert plane("plane_airspeed", home_height=2000.0) == 20.0
    sea, high = (plane("plane_mission_time", home_height=height) for height in (0.0, 2000.0))
    assert sea - high == pytest.approx(100.0 * (1 - 1 / faster), rel=1e-3)


def test_a_planes_energy_is_that_of_its_way_its_climbs_and_its_take_off() -> None:
    level = plane("plane_energy")
    assert plane("plane_energy", level_power=300.0) == pytest.approx(2 * level)
    assert plane("plane_energy", way_back=440.0) - level == pytest.approx(150.0 * (20 / 22) ** 3.7 * 22.0 / 3600)
    twice = plane("plane_energy", way_out=4000.0) - level
    assert plane("plane_energy", way_out=4000.0, speed=30.0) - plane("plane_energy", speed=30.0) == pytest.approx(
        twice * 1.5**2.7
    ), "it is there sooner, and takes more"
    assert plane("plane_energy", climbs=100.0) > level


def test_a_quadplane_has_constants_of_its_own() -> None:
    lands = plane("quadplane_mission_time")
    assert plane("quadplane_mission_time", end_height=90.0) - lands == pytest.approx(20.0)
    assert plane("quadplane_mission_time", takeoff_height=55.0) - lands == pytest.approx(10.0)
    assert plane("quadplane_mission_time", way_back=500.0) - lands == pytest.approx(25.0 - 30.0), (
        "from the return's height"
    )
    for kind in ("mission_time", "path_error", "height_error"):
        changed = {"loiter_turns": 1.0, "leg_after_loiter": 1.0, "rises": 200.0}
        assert plane(f"quadplane_{kind}", **changed) != pytest.approx(plane(f"plane_{kind}", **changed))


def test_a_plane_is_below_its_leg_while_the_way_to_it_left_no_time_to_climb() -> None:
    level, steep = plane("plane_height_error"), plane("plane_height_error", first_rise=60.0)
    assert plane("plane_height_error", first_rise=60.0, first_length=600.0) == pytest.approx(level)
    assert steep > plane("plane_height_error", first_rise=40.0) > level
    assert level < plane("plane_height_error", rises=625.0) < plane("plane_height_error", rises=625.0, climb_rate=2.0)
