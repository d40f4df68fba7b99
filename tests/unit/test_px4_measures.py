"""What is read of a PX4 mission: planted waypoints, a return and a landing."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from care_core.ecosystems.measures import MISSION_KINDS, Mission, find_extractor
from care_core.ecosystems.px4 import missions  # noqa: F401  it registers the kind of mission
from care_core.ecosystems.px4.flight import Px4Flight
from care_core.ecosystems.px4.flown_mission import mission_outcome
from care_core.ecosystems.px4.measures import energy, outcome, requested, route, signals  # noqa: F401  theirs
from care_core.ecosystems.px4.measures.flown import flown_mission
from care_core.logs import formats
from care_core.logs.base import Table
from care_core.run import Unavailable, Value, is_known
from tests.tables import read

HOME = (47.0, 8.0, 500.0)
METRES = 111_319.49
EAST = METRES * math.cos(math.radians(HOME[0]))
WAY = [(0.0, 100.0, 20.0), (100.0, 100.0, 30.0), (100.0, 0.0, 30.0)]
"""North, east and height of the waypoints."""
BEGUN_S, REACHED_S = [20.0, 40.0, 65.0], [40.0, 60.0, 85.0]
AT = np.arange(0.0, 150.0, 0.1)
TAKEOFF, PLACE, RETURN = 22, 16, 20
MISSION, BACK = 3, 5


def table(rows: list[tuple[float, ...]], *fields: str) -> Table:
    columns = list(zip(*rows, strict=True))
    named = zip(fields, columns[1:], strict=True)
    return Table(np.array(columns[0]), {name: np.array(column, dtype=float) for name, column in named})


def steps(*changes: tuple[float, float]) -> np.ndarray:
    at, values = zip(*changes, strict=True)
    return np.array(values, dtype=float)[np.maximum(np.searchsorted(at, AT + 1e-9, side="right") - 1, 0)]


def item(t: float, number: int, command: int, place: tuple[float, float, float] | None) -> tuple[float, ...]:
    if place is None:
        return (t, number, command, 0.0, 0.0, 0.0, 0.0, 0.0)
    north, east, up = place
    hold_s = 5.0 if number == 2 else 0.0
    return (t, number, command, HOME[0] + north / METRES, HOME[1] + east / EAST, HOME[2] + up, hold_s, 0.0)


def flown(**replaced: Table) -> dict[str, Table]:
    """Armed at 5 s, at 20 m at 20 s; 5 m/s on the legs, 4 m beside the first one, 5 s at the second waypoint; home at
    85 s by way of 40 m, down at 130 s, disarmed at 132 s."""
    north = np.interp(AT, [0, 40, 60, 85, 105], [0, 0, 100, 100, 0])
    north = north + np.interp(AT, [24, 26, 34, 36], [0, 4, 4, 0])
    east = np.interp(AT, [0, 20, 40, 65, 85, 105], [0, 0, 100, 100, 0, 0])
    height = np.interp(AT, [8, 20, 40, 60, 85, 90, 105, 115, 130], [0, 20, 20, 30, 30, 40, 40, 5, 0])
    items = [(22, (0.0, 0.0, 20.0)), *((PLACE, place) for place in WAY), (RETURN, None)]
    begun = [5.0, *BEGUN_S, 85.0]
    result = [(5.0, -1.0), (20.0, 0.0), *((t, float(n)) for n, t in enumerate(REACHED_S, start=1)), (132.0, 3.0)]
    half = np.radians(5.0 + 0.1 * np.sin(AT))  # of a roll by ten degrees
    tables = {
        "vehicle_status": Table(AT, {
            "arming_state": steps((0, 1), (5, 2), (132, 1)), "nav_state": steps((0, 4), (5, MISSION), (85, BACK)),
            "failsafe": steps((0, 0)), "failure_detector_status": steps((0, 0)), "vehicle_type": steps((0, 1)),
        }),
        "vehicle_land_detected": Table(AT, {"landed": steps((0, 1), (8, 0), (130, 1))}),
        "vehicle_local_position": Table(AT, {
            "x": north + 2.0, "y": east - 3.0, "z": -1.0 - height, "vx": np.gradient(north, 0.1),
            "vy": np.gradient(east, 0.1), "vz": -np.gradient(height, 0.1),
        }),
        "home_position": table([(0.0, *HOME, 2.0, -3.0, -1.0)], "lat", "lon", "alt", "x", "y", "z"),
        "navigator_mission_item": table(
            [item(t, n, command, place) for n, (t, (command, place)) in enumerate(zip(begun, items, strict=True))],
            "sequence_current", "nav_cmd", "latitude", "longitude", "altitude", "time_inside", "altitude_is_relative",
        ),
        "mission_result": table([(t, n, 5.0, 0.0, 0.0, 1.0, 1.0) for t, n in result], "seq_reached", "seq_total",
                                "finished", "failure", "mission_id", "instance_count"),
        "battery_status": Table(AT, {
            "voltage_v": 16.0 - 0.01 * AT, "current_a": np.where((AT > 5) & (AT < 132), 10.0, 0.5),
            "remaining": 1.0 - 0.004 * AT, "connected": np.ones_like(AT),
        }),
        "vehicle_attitude": Table(AT, {"q[0]": np.cos(half), "q[1]": np.sin(half), "q[2]": 0 * AT, "q[3]": 0 * AT}),
        "vehicle_attitude_setpoint": Table(AT, {f"q_d[{n}]": (n == 0) + 0 * AT for n in range(4)}),
        "hover_thrust_estimate": Table(AT, {"hover_thrust": np.full_like(AT, 0.4), "valid": np.ones_like(AT)}),
    }  # fmt: skip
    return {**tables, **replaced}


def mission(**replaced: Table) -> Mission:
    model, tables = read(flown(**replaced), 150.0, formats.PX4_ULG, {"stack": "PX4", "firmware": "PX4 v1.15.0"})
    (found,) = MISSION_KINDS["px4_flight"].missions(model, tables, {"tolerance_m": 5})
    return found


def value(kind: str, /, flight: Mission | None = None, **args: Any) -> Value:
    return find_extractor(kind).compute(mission() if flight is None else flight, args)


@pytest.mark.parametrize(
    ("what", "wanted"),
    [
        ("path_length", 300.0), ("legs", 3), ("climb", 10.0), ("descent", 0.0), ("hold_time", 5.0),
        ("flown_corners", 1), ("corner_turn", 90.0), ("takeoff_height", 20.0), ("end_height", 30.0),
        ("return_distance", 100.0), ("returns", 1), ("commanded_speed", 0.0),
    ],
)  # fmt: skip
def test_the_mission_in_numbers(what: str, wanted: float) -> None:
    assert value("px4_mission_asked", what=what) == pytest.approx(wanted, rel=1e-2, abs=1e-6)


def test_time_energy_and_way() -> None:
    assert value("px4_mission_success") == 1.0
    assert value("px4_mission_time") == pytest.approx(127.0, abs=0.2)
    assert value("px4_energy_used") == pytest.approx(10.0 * 15.315 * 127 / 3600, rel=0.01)
    assert value("px4_path_error", stat="max") == pytest.approx(4.0, abs=0.1)
    assert value("px4_landing_error") == pytest.approx(0.0, abs=0.1)
    assert value("px4_items_reached") == 4.0


def test_the_phases_of_a_flight() -> None:
    assert value("px4_phase_time", phase="takeoff") == pytest.approx(15.0, abs=0.2)
    assert value("px4_phase_time", phase="leg", index=2) == pytest.approx(20.0, abs=0.2)
    assert value("px4_phase_time", phase="return") == pytest.approx(20.0, abs=0.5)
    assert value("px4_phase_time", phase="touchdown") == pytest.approx(17.0, abs=0.5)
    assert value("px4_return_height") == pytest.approx(40.0, abs=0.2)
    assert isinstance(value("px4_phase_time", phase="leg", index=4), Unavailable)


def test_attitude_and_hover() -> None:
    assert value("px4_attitude_error", axis="roll") == pytest.approx(10.0, abs=0.1)
    assert value("px4_attitude_error", axis="pitch") == pytest.approx(0.0, abs=0.1)
    assert value("px4_hover_thrust") == pytest.approx(0.4)
    assert value("px4_start_voltage") == pytest.approx(15.95, abs=0.05)


def test_a_flight_that_broke_off_knows_what_it_reached() -> None:
    back = flown()
    status = {**back["vehicle_status"].columns, "nav_state": steps((0, 4), (5, MISSION), (50, BACK))}
    early = mission(
        vehicle_status=Table(AT, status),
        navigator_mission_item=back["navigator_mission_item"].between(0.0, 45.0),
        mission_result=back["mission_result"].between(0.0, 45.0),
    )
    assert value("px4_mission_success", early) == 0.0
    assert value("px4_mission_broken_off", early) == 1.0
    found = flown_mission(early)
    assert not isinstance(found, Unavailable)
    assert not found.all_reached


@pytest.mark.parametrize(("mode", "success"), [(2, None), (1, None), (5, 0.0)], ids=["Position", "Altitude", "Return"])
def test_a_mission_that_a_pilot_took_over_did_not_fail(mode: int, success: float | None) -> None:
    back = flown()
    status = {**back["vehicle_status"].columns, "nav_state": steps((0, 4), (5, MISSION), (50, mode))}
    early = mission(vehicle_status=Table(AT, status), mission_result=back["mission_result"].between(0.0, 45.0))
    said = value("px4_mission_success", early)
    assert (said if is_known(said) else None) == success


@pytest.mark.parametrize(("told_s", "legs"), [(41.0, 3), (51.0, 2)])
def test_what_comes_next_on_the_way_home_is_no_part_of_the_mission(told_s: float, legs: int) -> None:
    back = flown()
    status = {**back["vehicle_status"].columns, "nav_state": steps((0, 4), (5, MISSION), (50, BACK))}
    ground = (*HOME[:2], 0.0)  # a return names the place where it lands without its height
    rows: list[tuple[float, ...]] = [(41.0, 0.0, math.nan, math.nan, 0.0), (told_s, 1.0, *ground)]
    early = mission(
        vehicle_status=Table(AT, status),
        navigator_mission_item=back["navigator_mission_item"].between(0.0, 45.0),
        position_setpoint_triplet=table(rows, "next.valid", "next.lat", "next.lon", "next.alt"),
    )
    assert value("px4_mission_asked", early, what="legs") == legs


def test_a_failsafe_tells_when_the_mission_was_left() -> None:
    kind = MISSION_KINDS["px4_flight"]
    status = {**flown()["vehicle_status"].columns, "failsafe": steps((0, 0), (60, 1))}
    assert kind.left_s(mission(vehicle_status=Table(AT, status))) == pytest.approx(60.0)
    assert kind.left_s(mission()) is None


@pytest.mark.parametrize(("last", "success"), [(6.0, 1.0), (5.0, 0.0)])
def test_a_mission_is_whole_once_its_last_item_was_reached_whatever_has_no_place(last: float, success: float) -> None:
    rows = [(5.0, -1.0), (20.0, 0.0), (40.0, 1.0), (60.0, 2.0), (85.0, 3.0), (86.0, last), (132.0, last)]
    names = ("seq_reached", "seq_total", "finished", "failure", "mission_id", "instance_count")
    result = table([(t, n, 7.0, 0.0, 0.0, 1.0, 1.0) for t, n in rows], *names)
    held = flown()["navigator_mission_item"].between(0.0, 84.0)
    assert value("px4_mission_success", mission(mission_result=result, navigator_mission_item=held)) == success


@pytest.mark.parametrize(("third_s", "success"), [(84.5, 1.0), (60.0, 0.0)])
def test_a_last_item_that_is_the_return_counts_in_a_log_that_names_no_items(third_s: float, success: float) -> None:
    rows = [(5.0, -1.0), (20.0, 0.0), (40.0, 1.0), (third_s, 2.0), (132.0, -1.0)]
    names = ("seq_reached", "seq_total", "finished", "failure", "mission_id", "instance_count")
    result = table([(t, n, 4.0, 0.0, 0.0, 1.0, 1.0) for t, n in rows], *names)
    unnamed = mission(mission_result=result, navigator_mission_item=flown()["navigator_mission_item"].between(0.0, 0.0))
    assert value("px4_mission_success", unnamed) == success
    assert value("px4_mission_broken_off", unnamed) == 1.0 - success


def test_a_failsafe_and_where_it_landed_count() -> None:
    status = {**flown()["vehicle_status"].columns, "failsafe": steps((0, 0), (100, 1))}
    flags = Table(AT, {"battery_warning": steps((0, 0), (100, 2)), "geofence_breached": steps((0, 0))})
    failed = mission(vehicle_status=Table(AT, status), failsafe_flags=flags)
    assert value("px4_mission_success", failed) == 0.0
    assert value("px4_failsafe", failed, about="battery") == 1.0
    assert value("px4_failsafe", failed, about="geofence") == 0.0
    place = flown()["vehicle_local_position"]
    beside = mission(vehicle_local_position=Table(AT, {**place.columns, "x": place["x"] + np.where(AT > 100, 9.0, 0)}))
    assert value("px4_mission_success", beside) == 0.0
    assert value("px4_landing_error", beside) == pytest.approx(9.0, abs=0.1)


def test_a_log_that_is_cut_says_nothing_of_success() -> None:
    cut = {name: one.between(0.0, 100.0) for name, one in flown().items()}
    model, tables = read(cut, 100.0, formats.PX4_ULG, {"stack": "PX4"})
    (found,) = MISSION_KINDS["px4_flight"].missions(model, tables, {})
    assert not is_known(value("px4_mission_success", found))


def test_a_refusal_to_arm_is_a_mission_that_failed() -> None:
    status = {**flown()["vehicle_status"].columns, "arming_state": steps((0, 1))}
    denied = ["Arming check: Gyro 1 missing", *["Arming denied: Resolve system health failures first"] * 4]
    said = Table(np.arange(5.0), {"level": np.array(["WARNING"] * 5, object), "message": np.array(denied, object)})
    refused = mission(vehicle_status=Table(AT, status), logged_messages=said)
    assert value("px4_mission_success", refused) == 0.0
    assert value("px4_arming_refused", refused) == 1.0
    assert not is_known(value("px4_lost", refused))
    assert [one.text for one in MISSION_KINDS["px4_flight"].evidence(refused)] == denied[:1]


def test_a_battery_that_says_the_same_measures_nothing() -> None:
    dead = Table(AT, {name: np.full_like(AT, 16.0) for name in ("voltage_v", "current_a", "remaining", "connected")})
    assert not is_known(value("px4_energy_used", mission(battery_status=dead)))
    assert not is_known(value("px4_start_voltage", mission(battery_status=dead)))


@pytest.mark.parametrize(
    ("end_s", "has_legs", "clause"),
    [
        (150.0, True, "it stayed where it was from 5.0 s on"),
        (150.0, False, "its take-off was not over after 145 s"),
        (40.0, True, ""),
    ],
)
def test_a_mission_in_force_that_does_not_go_on_has_failed(end_s: float, has_legs: bool, clause: str) -> None:
    place, status = flown()["vehicle_local_position"].columns, flown()["vehicle_status"].columns
    tables = flown(
        vehicle_local_position=Table(AT, {**place, "x": 2 + 0 * AT, "y": -3 + 0 * AT, "z": -1 - 0.1 * np.sin(AT)}),
        vehicle_status=Table(
            AT, {**status, "nav_state": steps((0, 4), (5, MISSION)), "arming_state": steps((0, 1), (5, 2))}
        ),
    )
    if not has_legs:
        tables["navigator_mission_item"] = tables["navigator_mission_item"].between(0.0, 10.0)
    model, cut = read({name: one.between(0.0, end_s) for name, one in tables.items()}, end_s, formats.PX4_ULG, {})
    kind = MISSION_KINDS["px4_flight"]
    (found,) = kind.missions(model, cut, {})
    assert value("px4_mission_success", found) == 0.0 if clause else not is_known(value("px4_mission_success", found))
    assert [one for one in kind.shortfall(found) if one in clause] == ([clause] if clause else [])


def test_a_mission_before_any_mode_is_known_has_no_outcome() -> None:
    status = flown()["vehicle_status"]
    late = Table(status.t + 200.0, status.columns)
    model, _ = read(flown(vehicle_status=late), 400.0, formats.PX4_ULG, {"stack": "PX4", "firmware": "PX4 v1.15.0"})
    assert isinstance(model, Px4Flight)
    told = mission_outcome(model, (5.0, 132.0))
    assert isinstance(told, Unavailable)
    assert told.reason == "the mission was not flown to its end"
