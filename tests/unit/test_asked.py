"""What was asked of a flight, on missions made up here."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.ardupilot.measures.requested import (
    hover_power,
    internal_resistance,
    mission_asked,
    requested_mission,
)
from care_core.ecosystems.measures import Mission
from care_core.ecosystems.vehicles.arming import NEVER_ARMED
from care_core.ecosystems.vehicles.way import RequestedMission
from care_core.logs.base import Table
from care_core.run import Unavailable
from tests.tables import TablesLog

HOME = (47.0, 8.0)
EAST = 111_319.49 * math.cos(math.radians(HOME[0]))
FIELDS = ("CNum", "CId", "Prm1", "Prm2", "Lat", "Lng", "Alt", "Frame")

TAKEOFF = (22, 0, 0, 0, 0, 20, 3)
RETURN = (20, 0, 0, 0, 0, 0, 0)
LAND = (21, 0, 0, 0, 0, 0, 0)


def place(north_m: float, east_m: float, height: float, hold_s: float = 0.0, frame: int = 3) -> tuple[float, ...]:
    return (16, hold_s, 0, HOME[0] + north_m / 111_319.49, HOME[1] + east_m / EAST, height, frame)


def mission(*items: tuple[float, ...], bat: Table | None = None) -> Mission:
    home = (16, 0, 0, HOME[0] + 1.0, HOME[1], 100.0, 0)
    rows = np.array([(number, *item) for number, item in enumerate((home, *items))], dtype=float)
    tables = {
        "CMD": Table(np.zeros(len(rows)), dict(zip(FIELDS, rows.T, strict=True))),
        "ORGN": table_of(Type=[0, 1], Lat=[0.0, HOME[0]], Lng=[0.0, HOME[1]], Alt=[0.0, 488.0]),
    }
    if bat is not None:
        tables["BAT"] = bat
        tables["ARM"] = table_of(ArmState=[1.0, 1.0], Forced=[0.0, 0.0])
    return Mission(Flight(TablesLog(tables, 100.0)), tables, 0.0, 100.0, True, {})


def table_of(**columns: list[float]) -> Table:
    count = len(next(iter(columns.values())))
    return Table(np.linspace(0.0, 1.0, count), {name: np.array(values) for name, values in columns.items()})


def found(*items: tuple[float, ...]) -> RequestedMission:
    answer = requested_mission(mission(*items))
    assert isinstance(answer, RequestedMission)
    return answer


def number(what: str, *items: tuple[float, ...]) -> Any:
    return mission_asked(mission(*items), {"what": what})


def test_home_is_no_waypoint_and_legs_begin_above_it() -> None:
    way = found(TAKEOFF, place(0, 100, 20), place(100, 100, 30), RETURN)
    assert way.points == pytest.approx(np.array([[0, 0, 20], [0, 100, 20], [100, 100, 30]]), abs=0.01)
    assert way.ending == "return"


def test_numbers_of_a_mission() -> None:
    items = (TAKEOFF, place(0, 100, 20, 3), place(100, 100, 30), place(100, 0, 10, 8), RETURN)
    expected = {
        "path_length": 300, "legs": 3, "leg_variation": 0, "climb": 10, "climbing_legs": 1, "descent": 20,
        "descending_legs": 1, "flown_corners": 1, "corner_turn": 90, "hold_time": 11, "stops": 2,
        "commanded_speed": 0, "takeoff_height": 20, "end_height": 10, "return_distance": 100, "returns": 1,
    }  # fmt: skip
    assert {what: number(what, *items) for what in expected} == pytest.approx(expected, abs=0.01)


def test_a_landing_elsewhere_has_no_way_home() -> None:
    assert number("return_distance", TAKEOFF, place(0, 100, 20), LAND) == 0
    assert found(TAKEOFF, place(0, 100, 20), LAND).ending == "land"
    assert found(TAKEOFF, place(0, 100, 20)).ending == "open"


def test_a_commanded_speed_holds_from_where_it_stands() -> None:
    speed = (178, 1, 4.0, 0, 0, 0, 0)
    assert number("commanded_speed", TAKEOFF, speed, place(0, 100, 20), RETURN) == 4
    assert number("commanded_speed", TAKEOFF, place(0, 100, 20), speed, place(0, 150, 20), RETURN) == 0
    climb_rate = (178, 2, 1.0, 0, 0, 0, 0)
    assert number("commanded_speed", TAKEOFF, climb_rate, place(0, 100, 20), RETURN) == 0


def test_a_jump_is_flown_as_often_as_it_says_and_one_without_end_stops() -> None:
    way = (TAKEOFF, place(0, 100, 20), place(0, 0, 20))
    assert number("path_length", *way, (177, 2, 2, 0, 0, 0, 0), RETURN) == pytest.approx(600)
    assert number("legs", *way, (177, 2, -1, 0, 0, 0, 0), RETURN) == 2


def test_a_height_above_the_sea_counts_from_home() -> None:
    assert number("end_height", TAKEOFF, place(0, 100, 518, frame=0), RETURN) == pytest.approx(30)


@pytest.mark.parametrize("items", [(), (TAKEOFF, RETURN)], ids=["none", "no waypoint"])
def test_without_waypoints_nothing_was_asked(items: tuple[tuple[float, ...], ...]) -> None:
    assert isinstance(requested_mission(mission(*items)), Unavailable)


def test_power_and_resistance_are_those_in_the_air() -> None:
    count = 50
    bat = Table(np.linspace(0.0, 100.0, 2 * count), {
        "Volt": np.repeat([12.6, 11.5], count), "Curr": np.r_[np.zeros(count), np.tile([30.0, 32.0], count)[:count]],
        "Res": np.r_[np.zeros(count), np.tile([0.01, 0.02], count)[:count]],
    })  # fmt: skip
    flown = mission(TAKEOFF, place(0, 100, 20), bat=bat)
    assert hover_power(flown, {}) == pytest.approx(11.5 * 31)
    assert internal_resistance(flown, {}) == pytest.approx(0.015)
    assert isinstance(hover_power(mission(TAKEOFF, bat=table_of(Volt=[12.0], Curr=[0.0])), {}), Unavailable)
    tables = {name: table for name, table in flown.tables.items() if name != "ARM"}
    stood = Mission(Flight(TablesLog(tables, 100.0)), tables, 0.0, 100.0, True, {})
    assert hover_power(stood, {}) == NEVER_ARMED, "what it takes on the ground is no flight"
