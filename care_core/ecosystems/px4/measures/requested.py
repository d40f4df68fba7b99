"""What was requested of one PX4 flight: its mission in numbers. Never a cause.

A log holds no mission as it was uploaded: the navigator names each item as it begins it, in single precision, and the
place that it flies to in double. Of a mission that broke off, only what was begun is known, and what would have come
next.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from care_core.ecosystems.measures import Args, Mission, extractor, has, one_of
from care_core.ecosystems.px4.flight import RESULT, RESULT_FIELDS, Px4Flight
from care_core.ecosystems.vehicles import way_of
from care_core.ecosystems.vehicles.way import NUMBERS, Ending, RequestedMission, number_asked
from care_core.geodesy import offset_m
from care_core.logs.base import Table, Wanted
from care_core.records import Record
from care_core.run import Unavailable, Value

ITEM, TRIPLET, HOME = "navigator_mission_item", "position_setpoint_triplet", "home_position"
ITEMS: Wanted = {
    ITEM: ("sequence_current", "nav_cmd", "latitude", "longitude", "altitude", "time_inside", "altitude_is_relative"),
    TRIPLET: (
        "current.valid", "current.lat", "current.lon", "current.cruising_speed",
        "next.valid", "next.lat", "next.lon", "next.alt",
    ),
    HOME: ("lat", "lon", "alt", "x", "y", "z"),
    RESULT: RESULT_FIELDS,
}  # fmt: skip
"""What `requested_mission` reads."""

TAKEOFF, LAND, RETURN = 22, 21, 20
PLACES = frozenset((16, 17, 18, 19, 31, 82))
"""Commands of MAVLink that lead to a place (MAV_CMD_NAV_*)."""
_SAME_PLACE_M = 5.0
"""How far single precision puts a place off: 1.7 m at a longitude of 150 degrees, and margin."""
_SOON_S = 1.5
"""The triplet follows its item within a moment, and logs take one in 0.2 s."""


class Item(Record):
    """A mission item that was begun: its command, its place, and its wait."""

    command: int
    lat: float
    lon: float
    height_m: float
    """Above home."""
    hold_s: float
    begun_s: float


class Home(Record):
    """Where home is: on the globe, and from the origin of the local frame (north, east and down in metres)."""

    lat: float
    lon: float
    alt_m: float
    local: tuple[float, float, float]

    def offset(self, lat: float, lon: float) -> tuple[float, float]:
        """Metres north and east of home."""
        return offset_m((self.lat, self.lon), lat, lon)


def flight_of(mission: Mission) -> Px4Flight:
    """The model of the flight that a mission is part of."""
    assert isinstance(mission.model, Px4Flight)
    return mission.model


def home_of(mission: Mission) -> Home | None:
    """Home as it was set last before the vehicle left the ground, None where the log does not say."""
    table = mission.tables.get(HOME)
    if not has(table, "lat", "lon", "alt", "x", "y", "z"):
        return None
    known = table.where(np.isfinite(table["lat"] + table["lon"] + table["alt"]) & (table["lat"] != 0.0))
    if not len(known):
        return None
    at = max(int(np.searchsorted(known.t, mission.start_s + 1.0, side="right")) - 1, 0)
    lat, lon, alt, x, y, z = (float(known[name][at]) for name in ("lat", "lon", "alt", "x", "y", "z"))
    return Home(lat, lon, alt, (x, y, z) if math.isfinite(x + y + z) else (0.0, 0.0, 0.0))


def items_begun(mission: Mission) -> Mapping[int, Item] | Unavailable:
    """The items that the navigator began, by their numbers; use through `mission.shared`."""
    table, home = mission.table(ITEM), home_of(mission)
    if not has(table, "sequence_current", "nav_cmd", "latitude", "longitude", "altitude"):
        return Unavailable("the log does not name the items of its mission", f"record {ITEM}", ITEM)
    if home is None:
        return Unavailable("the log does not say where home is", f"record {HOME}", HOME)
    numbers = table["sequence_current"]
    found = {int(number): _item(mission, table.where(numbers == number), home) for number in np.unique(numbers)}
    return found or Unavailable("no item of a mission was begun")


def _item(mission: Mission, rows: Table, home: Home) -> Item:
    """An item out of what the navigator did for it: it may first fly there, then turn, then land."""
    commands = rows["nav_cmd"].astype(int).tolist()
    command = next((one for one in commands if one in (TAKEOFF, LAND, RETURN)), commands[0])
    placed = np.flatnonzero(rows["latitude"] != 0.0)
    at = int(placed[0]) if len(placed) else 0
    lat, lon = _exact(mission, float(rows.t[at]), float(rows["latitude"][at]), float(rows["longitude"][at]), home)
    above_home = "altitude_is_relative" in rows.columns and rows["altitude_is_relative"][at] == 1
    height = float(rows["altitude"][at]) - (0.0 if above_home else home.alt_m)
    hold_s = float(rows["time_inside"][at]) if "time_inside" in rows.columns else 0.0
    return Item(command, lat, lon, height, max(hold_s, 0.0), float(rows.t[0]))


def _exact(mission: Mission, begun_s: float, lat: float, lon: float, home: Home) -> tuple[float, float]:
    """A place in double precision, as the vehicle was sent to it just after; else in single."""
    sent = mission.table(TRIPLET)
    if not has(sent, "current.lat", "current.lon"):
        return lat, lon
    wanted = home.offset(lat, lon)
    soon = sent.between(begun_s - 0.1, begun_s + _SOON_S)
    for there in zip(soon["current.lat"].tolist(), soon["current.lon"].tolist(), strict=True):
        if math.dist(home.offset(*there), wanted) < _SAME_PLACE_M:
            return there
    return lat, lon


def requested_mission(mission: Mission) -> RequestedMission | Unavailable:
    """The mission as far as the vehicle came to know of it in flight; use through `mission.shared`."""
    items, home = mission.shared(items_begun), home_of(mission)
    if isinstance(items, Unavailable):
        return items
    assert home is not None
    if _lands_under_way(items):
        return Unavailable("the mission lands on its way and takes off again")
    points, holds, speeds = [(0.0, 0.0, 0.0)], [], []
    ending: Ending = "open"
    for number in sorted(items):
        item = items[number]
        if item.command == TAKEOFF:
            points[0] = (0.0, 0.0, item.height_m)
        elif item.command in PLACES:
            points.append((*home.offset(item.lat, item.lon), item.height_m))
            holds.append(item.hold_s)
            speeds.append(_speed(mission, item.begun_s))
        elif item.command in (RETURN, LAND):
            ending = "return" if item.command == RETURN else "land"
            break
    for place in _next_place(mission, items, home) if ending == "open" else ():
        points.append(place)
        holds.append(0.0)
        speeds.append(speeds[-1] if speeds else 0.0)
    if len(points) < 2:
        return Unavailable("no waypoint of the mission was begun")
    return RequestedMission(np.array(points), np.array(holds), np.array(speeds), ending)


def _lands_under_way(items: Mapping[int, Item]) -> bool:
    """Whether a landing is followed by another take-off: that is more than one flight, and takes longer than its legs
    say."""
    landed = [number for number, item in items.items() if item.command == LAND]
    return bool(landed) and any(n > min(landed) and item.command in (TAKEOFF, *PLACES) for n, item in items.items())


def end_of(mission: Mission) -> tuple[float, float] | None:
    """Where the landing or return that is behind all other places ends, in metres north and east of home; None where
    none was begun."""
    items, home = mission.shared(items_begun), home_of(mission)
    if isinstance(items, Unavailable) or home is None:
        return None
    leading = {number: item for number, item in items.items() if item.command in (TAKEOFF, LAND, RETURN, *PLACES)}
    last = leading[max(leading)] if leading else None
    if last is None or last.command not in (LAND, RETURN):
        return None
    return (0.0, 0.0) if last.command == RETURN else home.offset(last.lat, last.lon)


def _speed(mission: Mission, begun_s: float) -> float:
    """The speed that the mission commands on the way to an item, 0 where a parameter rules."""
    sent = mission.table(TRIPLET)
    if not has(sent, "current.cruising_speed"):
        return 0.0
    speeds = sent.between(begun_s, begun_s + _SOON_S)["current.cruising_speed"]
    told = speeds[np.isfinite(speeds) & (speeds > 0)]
    return float(told[-1]) if len(told) else 0.0


def _next_place(mission: Mission, items: Mapping[int, Item], home: Home) -> Iterator[tuple[float, float, float]]:
    """The place after the item that was begun last, where the mission broke off before it. What comes next once the
    mission is left is of the way home."""
    sent = mission.table(TRIPLET)
    if not has(sent, "next.valid", "next.lat", "next.lon", "next.alt"):
        return
    begun_s = items[max(items)].begun_s
    since = sent.between(begun_s, _left_s(mission, begun_s))
    known = since.where((since["next.valid"] == 1) & np.isfinite(since["next.lat"] + since["next.lon"]))
    if len(known):
        lat, lon, alt = (float(known[f"next.{name}"][0]) for name in ("lat", "lon", "alt"))
        yield *home.offset(lat, lon), alt - home.alt_m


def _left_s(mission: Mission, begun_s: float) -> float:
    """When the vehicle left the mission for another mode after an item was begun, else when the flight ended."""
    left = (t for t, mode in flight_of(mission).modes if t > begun_s and way_of("px4", mode) != "mission")
    return min(next(left, mission.end_s), mission.end_s)


def items_in_all(mission: Mission) -> int | None:
    """How many items the mission has, None where the log does not say."""
    table = mission.table(RESULT)
    if not has(table, "seq_total"):
        return None
    counts: Sequence[float] = table["seq_total"][table["seq_total"] > 0].tolist()
    return int(counts[-1]) if counts else None


@extractor("px4_mission_asked", needs=ITEMS, unit="", args={"what": one_of(", ".join(NUMBERS), *NUMBERS)})
def mission_asked(mission: Mission, args: Args) -> Value:
    """One number of the mission, as far as it was begun: lengths and heights in m, times in s, turns in degrees,
    `commanded_speed` in m/s (0: none), `returns` 1 or 0."""
    return number_asked(mission.shared(requested_mission), str(args.get("what")))
