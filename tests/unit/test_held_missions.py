"""Which mission a vehicle flew: uploads before, during and after it, in its own log and in telemetry."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from care_core.ecosystems.ardupilot.held_missions import held_missions
from care_core.ecosystems.ardupilot.timeline import timelines
from care_core.logs import formats
from care_core.logs.base import Table
from care_core.logs.telemetry import as_dataflash
from care_core.run import Unavailable
from tests.tables import TablesLog
from tests.unit.test_ardupilot_extract import HOME, KIND, METRES, flight, north, only, table, value

Row = tuple[float, int, int, float, float]
"""Time, number, command, latitude, height."""
TAKEOFF, WAYPOINT, RETURN = 22, 16, 20


def upload(t: float, *metres: float, height: float = 20.0) -> list[Row]:
    """The records of a whole mission: home, take-off, waypoints so far north, and the way home."""
    middle = [(t, number, WAYPOINT, north(m), height) for number, m in enumerate(metres, start=2)]
    last = len(metres) + 2
    return [(t, 0, WAYPOINT, HOME[0], 0.0), (t, 1, TAKEOFF, 0.0, height), *middle, (t, last, RETURN, 0.0, 0.0)]


EMPTY: list[Row] = [(25.0, 0, WAYPOINT, HOME[0], 0.0)]
"""Home alone."""


def commands(*uploads: Sequence[Row]) -> Table:
    """CMD records, each upload with how many items it has."""
    rows = [
        (t, len(one), number, command, lat, HOME[1] if lat else 0.0, height)
        for one in uploads for t, number, command, lat, height in one
    ]  # fmt: skip
    return table(rows, "CTot", "CNum", "CId", "Lat", "Lng", "Alt")


def in_auto(**replaced: Table | None) -> dict[str, Table]:
    """The good flight of one waypoint with its modes: its mission begins at 12 s."""
    return flight(MODE=table([(0.0, 0), (12.0, 3)], "ModeNum"), **replaced)


FLOWN = upload(0.0, 100)


def told(mission: Any) -> list[str]:
    return [event.text for event in next(timelines(mission.model, ())) if event.source == "CMD"]


@pytest.mark.parametrize(
    "before",
    [
        upload(0.0, 300, 400, 500, 600),
        [(0.0, 0, WAYPOINT, HOME[0], 0.0), (0.0, 1, TAKEOFF, 0.0, 50.0)],
        upload(0.0, 170),
    ],
    ids=["longer", "shorter", "another of the same length"],
)
def test_what_was_uploaded_last_before_the_flight_is_judged(before: list[Row]) -> None:
    mission = only(in_auto(CMD=commands(before, upload(8.0, 100))))
    assert value(mission, "mission_success") == 1.0
    assert KIND.mismatch(mission) == ""
    assert value(mission, "mission_asked", what="path_length") == pytest.approx(100.0, abs=0.1)
    assert [text.partition(":")[0] for text in told(mission)] == ["another mission was uploaded"]


def test_an_upload_while_armed_before_the_mission_begins_is_what_is_flown() -> None:
    mission = only(in_auto(CMD=commands(upload(0.0, 300, 400), upload(11.0, 100))))
    assert value(mission, "mission_success") == 1.0
    assert told(mission) == ["another mission was uploaded while armed: 1 waypoint, 2 before"]


@pytest.mark.parametrize(
    "after", [upload(25.0, 300, 400), upload(25.0, 160), EMPTY, upload(25.0, 100, height=60)],
    ids=["longer", "elsewhere", "cleared", "higher"],
)  # fmt: skip
def test_a_mission_replaced_under_way_is_not_evaluated(after: list[Row]) -> None:
    mission = only(in_auto(CMD=commands(FLOWN, after)))
    found = value(mission, "mission_success")
    assert isinstance(found, Unavailable)
    assert found.reason == "the mission was replaced under way, at 25 s"
    assert KIND.mismatch(mission) == found.reason
    assert value(mission, "mission_asked", what="legs") == found
    assert isinstance(value(mission, "path_error"), Unavailable)
    assert told(mission)[0].startswith("another mission was uploaded while armed")


def test_a_crash_after_an_upload_is_still_a_failure() -> None:
    crash = table([(40.0, 12, 1)], "Subsys", "ECode")
    assert value(only(in_auto(CMD=commands(FLOWN, upload(25.0, 300)), ERR=crash)), "mission_success") == 0.0


@pytest.mark.parametrize(
    "after", [upload(25.0, 100), FLOWN[2:3], upload(45.0, 300, 400), upload(72.0, 300)],
    ids=["the same again", "an item as it is begun", "when all of it is done", "after the flight"],
)  # fmt: skip
def test_what_changes_nothing_of_the_mission_leaves_it_judged(after: list[Row]) -> None:
    rows = commands(FLOWN, after)
    if len(after) == 1:
        rows["CTot"][:] = len(FLOWN)
    assert value(only(in_auto(CMD=rows)), "mission_success") == 1.0


def test_a_part_uploaded_anew_is_another_mission() -> None:
    """The vehicle writes all of its mission after a part of it was sent."""
    (first, second) = held_missions(commands(upload(0.0, 100, 200), upload(30.0, 100, 250)))
    assert (second.since_s, second.lacks) == (30.0, 0)
    assert first.items[3].lat != second.items[3].lat


def test_a_mission_of_which_items_are_lost_is_no_success() -> None:
    whole = upload(0.0, 100, 200)
    kept = commands(whole).where(np.array([row[1] != 3 for row in whole]))
    found = value(only(in_auto(CMD=kept)), "mission_success")
    assert isinstance(found, Unavailable)
    assert found.reason == "the log holds 3 of the 4 items of the mission"


# --- telemetry -------------------------------------------------------------------------------------------------


class Link:
    """What a ground station hears of missions: messages of the vehicle and, `@SYSTEM.COMPONENT`, to it."""

    def __init__(self) -> None:
        self.rows: dict[str, list[tuple[float, dict[str, float]]]] = {}

    def send(self, name: str, t: float, **fields: float) -> None:
        kept = {"target_system": 1.0, "mission_type": 0.0, **fields}
        self.rows.setdefault(name, []).append((t, kept))

    def transfer(self, t: float, station: str, *metres: float, kind: float = 0.0, again: bool = False) -> None:
        """An upload of a station, item by item."""
        rows = upload(t, *metres)
        self.send(f"MISSION_COUNT{station}", t, count=len(rows), mission_type=kind)
        for at, (_, number, command, lat, height) in enumerate(rows):
            item = dict.fromkeys(("param1", "param2", "param3"), 0.0) | {"frame": 3.0, "mission_type": kind}
            item |= {"seq": number, "command": command, "x": lat * 1e7, "y": HOME[1] * 1e7 if lat else 0.0, "z": height}
            if station:
                self.send("MISSION_REQUEST_INT", t + 0.1 + at * 0.1, seq=number)
            for repeat in range(2 if again else 1):
                self.send(f"MISSION_ITEM_INT{station}", t + 0.15 + at * 0.1 + repeat * 0.01, **item)

    def held(self) -> list[tuple[float, list[float]]]:
        """Since when which waypoints were held, in m north."""
        tables = {}
        for name, rows in self.rows.items():
            fields = {field: np.array([row[field] for _, row in rows]) for field in rows[0][1]}
            tables[name] = Table(np.array([t for t, _ in rows]), fields)
        log = TablesLog(tables, 100.0, formats.MAVLINK_TLOG, {"system": "1.1"})
        found = held_missions(as_dataflash(log).read({"CMD": ("CNum", "CId", "Lat", "Lng", "Alt", "CTot")}).get("CMD"))
        return [
            (one.since_s, [round((one.items[n].lat - HOME[0]) * 111_319.49) for n in one.waypoints]) for one in found
        ]

    def waypoints(self) -> list[list[float]]:
        return [waypoints for _, waypoints in self.held()]


def test_items_sent_again_over_a_bad_link_are_one_upload() -> None:
    link = Link()
    link.transfer(5.0, "@255.190", 100, 200, again=True)
    assert link.held() == [(0.0, []), (5.0, [100, 200])]


def test_a_second_station_that_reads_the_mission_changes_nothing() -> None:
    link = Link()
    link.transfer(5.0, "@255.190", 100, 200)
    link.transfer(20.0, "", 100, 200)  # the vehicle, to another station
    assert link.waypoints() == [[], [100, 200]]


def test_what_a_vehicle_held_before_it_was_asked_is_what_it_tells() -> None:
    link = Link()
    link.transfer(20.0, "", 100, 200)
    assert link.held() == [(20.0, [100, 200])]


def test_a_second_station_that_uploads_replaces_the_mission() -> None:
    link = Link()
    link.transfer(5.0, "@255.190", 100, 200, 300)
    link.transfer(40.0, "@254.190", 150)
    assert link.held()[1:] == [(5.0, [100, 200, 300]), (40.0, [150])]


def test_an_upload_that_the_vehicle_declines_is_none() -> None:
    link = Link()
    link.transfer(5.0, "@255.190", 100, 200)
    link.send("MISSION_COUNT@254.190", 40.0, count=9)
    link.send("MISSION_ACK", 40.1, type=14)
    assert link.waypoints() == [[], [100, 200]]


def test_items_of_fence_and_rally_points_are_no_mission() -> None:
    link = Link()
    link.transfer(5.0, "@255.190", 100, 200)
    link.transfer(40.0, "@255.190", 500, 600, 700, kind=1.0)
    link.transfer(50.0, "@255.190", 800, kind=2.0)
    assert link.waypoints() == [[], [100, 200]]


def test_a_mission_that_is_cleared_is_held_no_more() -> None:
    link = Link()
    link.transfer(5.0, "@255.190", 100)
    link.send("MISSION_CLEAR_ALL@255.190", 40.0)
    assert link.held()[1:] == [(5.0, [100]), (40.0, [])]


# What the vehicle says of its waypoints may be lost on the way


def said(*texts: tuple[float, str]) -> Table:
    return table(list(texts), "Message")


def track(*path: tuple[float, float]) -> Table:
    """Where the vehicle was: seconds and metres north, at 20 m until 45 s, then down."""
    t, way = zip(*path, strict=True)
    at = np.arange(0.0, 75.0, 0.5)
    height = np.interp(at, [10, 20, 45, 69], [0, 20, 20, 0])
    return Table(at, {"Lat": HOME[0] + np.interp(at, t, way) / METRES, "Lng": 0 * at + HOME[1], "RelHomeAlt": height})


THERE = track((20, 0), (30, 100), (40, 0))
SHORT_OF_IT = track((20, 0), (25, 50), (40, 0))
WENT_ON, BEGUN = (30.0, "Mission: 3 RTL"), (20.0, "Mission: 2 WP")


@pytest.mark.parametrize(
    "texts", [(BEGUN, WENT_ON), (WENT_ON,), (BEGUN,)], ids=["of reaching it", "of all of it", "of all after it began"]
)
def test_a_waypoint_that_was_passed_counts_where_the_word_of_it_is_lost(texts: tuple[tuple[float, str], ...]) -> None:
    mission = only(in_auto(CMD=commands(FLOWN), MSG=said(*texts), POS=THERE))
    assert value(mission, "mission_success") == 1.0
    assert value(mission, "waypoints_reached") == 1.0


def test_a_waypoint_that_was_skipped_was_not_reached() -> None:
    mission = only(in_auto(CMD=commands(FLOWN), MSG=said(BEGUN, WENT_ON), POS=SHORT_OF_IT))
    assert value(mission, "mission_success") == 0.0


def test_a_waypoint_that_the_vehicle_never_went_on_from_was_not_reached() -> None:
    modes = table([(0.0, 0), (12.0, 3), (35.0, 9)], "ModeNum")
    mission = only(flight(MODE=modes, CMD=commands(FLOWN), MSG=said(BEGUN), POS=THERE))
    assert value(mission, "mission_success") == 0.0


def test_a_waypoint_of_which_neither_word_nor_place_is_known_is_not_judged() -> None:
    hole = THERE.where((THERE.t < 22) | (THERE.t > 38))
    mission = only(in_auto(CMD=commands(FLOWN), MSG=said(BEGUN, WENT_ON), POS=hole))
    assert isinstance(value(mission, "mission_success"), Unavailable)
