"""Which missions a vehicle held, and when: an upload replaces one, on the ground or in flight.

A log tells a mission by its items: all of them when it begins and after each upload, single ones as they are begun.
What differs from what was known of an item, or another number of items, is therefore another mission.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping

from care_core.logs.base import Table, Wanted
from care_core.records import Record, Struct

READS: Wanted = {"CMD": ("CNum", "CId", "Lat", "Lng", "Alt", "Prm1", "Prm2", "Prm3", "Frame", "CTot")}
"""What is read of missions; the first five fields are needed."""
NEEDED = READS["CMD"][:5]

# Commands of MAVLink's common dialect (MAV_CMD).
WAYPOINT, LOITER_TURNS, LOITER_TIME, RETURN, LAND, TAKEOFF, SPLINE = 16, 18, 19, 20, 21, 22, 82
LOITER_FOREVER, LOITER_TO_HEIGHT = 17, 31
DELAY, JUMP, CHANGE_SPEED, LAND_START = 93, 177, 178, 189
CIRCLES = frozenset((LOITER_FOREVER, LOITER_TURNS, LOITER_TIME, LOITER_TO_HEIGHT))
"""What a plane flies circles for."""
PLACES = frozenset((WAYPOINT, SPLINE, *CIRCLES))
CURVES = frozenset((SPLINE, LOITER_TURNS))
"""What a copter or a rover flies or drives no straight leg to."""
HOLDS = frozenset((WAYPOINT, LOITER_TIME))
_OF_QUADPLANES = {84: TAKEOFF, 85: LAND}
"""MAV_CMD_NAV_VTOL_TAKEOFF and _LAND: upright, but a take-off and a landing."""

_UPLOAD_S = 5.0
"""Changes that follow each other within this are one upload."""
_SAME_DEG, _SAME_M, _SAME_PARAMETER = 5e-5, 1.0, 0.5
"""A place sent in single precision is off by up to 1.5e-5 degrees."""


class Item(Record):
    """One mission item: command, its first three parameters, place in degrees, height in metres and its frame."""

    command: int
    first: float
    second: float
    third: float
    lat: float
    lng: float
    alt_m: float
    frame: int

    def asks_the_same(self, other: Item) -> bool:
        """Whether both ask the same of a vehicle. It keeps of an item what its command needs, so what a ground station
        sent and what the vehicle tells of it differ in the rest."""
        if self.command != other.command:
            return False
        pairs = [(self.first, other.first)] if self.command in HOLDS or self.command == DELAY else []
        if self.command in (JUMP, CHANGE_SPEED):
            pairs = [(self.first, other.first), (self.second, other.second)]
        if any(abs(a - b) > _SAME_PARAMETER for a, b in pairs):
            return False
        if self.command not in PLACES:
            return self.command != TAKEOFF or abs(self.alt_m - other.alt_m) <= _SAME_M
        off_deg = max(abs(self.lat - other.lat), abs(self.lng - other.lng))
        return off_deg <= _SAME_DEG and abs(self.alt_m - other.alt_m) <= _SAME_M

    @property
    def radius_m(self) -> float:
        """Of the circles that it asks for, 0 where the vehicle's own parameter rules."""
        radius = {LOITER_TURNS: self.third, LOITER_FOREVER: self.third, LOITER_TO_HEIGHT: self.second}
        return abs(radius.get(self.command, 0.0))

    @property
    def is_waypoint(self) -> bool:
        return self.command in (WAYPOINT, SPLINE) and (self.lat != 0 or self.lng != 0)


class HeldMission(Record, eq=False):
    """A mission that a vehicle held from `since_s` on. Home, its number 0, is no item."""

    since_s: float
    items: Mapping[int, Item]
    count: int | None
    """How many items it has, home among them; None where the log does not say."""

    @property
    def waypoints(self) -> list[int]:
        """Numbers of the waypoints."""
        return [number for number, item in self.items.items() if item.is_waypoint]

    def flight(self, begun: Collection[int]) -> list[int]:
        """Numbers of the items of one flight, of which it began these: a landing ends it, and what stands behind one is
        the next flight's, unless this one went on with it."""
        landings = [number for number, item in self.items.items() if item.command == LAND]
        first, last = min(begun, default=0), max(begun, default=0)
        start = max((number for number in landings if number < first), default=0)
        end = min((number for number in landings if number >= last), default=math.inf)
        return [number for number in self.items if start < number <= end]

    @property
    def lacks(self) -> int:
        """How many of its items the log does not hold."""
        return 0 if self.count is None else sum(number not in self.items for number in range(1, self.count))


class _Memory(Struct, eq=False):
    """What is known of the mission so far."""

    since_s: float
    items: dict[int, Item]
    count: int | None = None

    def held(self) -> HeldMission:
        return HeldMission(self.since_s, dict(sorted(self.items.items())), self.count)

    def is_changed_by(self, number: int, item: Item, count: int | None) -> bool:
        if count is not None and self.count is not None and count != self.count:
            return True
        known = self.items.get(number)
        return known is not None and not known.asks_the_same(item)


def held_missions(table: Table | None) -> tuple[HeldMission, ...]:
    """Every mission of a log in the order in which they were held; an upload of the same mission is none of its own."""
    if table is None or not len(table):
        return ()
    held: list[HeldMission] = []
    now = _Memory(float(table.t[0]), {})
    changed_s = -math.inf
    for t, number, item, count in _records(table):
        if now.is_changed_by(number, item, count):
            if t - changed_s > _UPLOAD_S:
                held.append(now.held())
                now = _Memory(t, now.items, now.count)
            changed_s = t
        if count is not None and now.count is not None and count != now.count:
            now.items = {}  # an item that is told no more is none of the new mission
        now.count = now.count if count is None else count
        if number > 0:
            now.items[number] = item
    return (*held, now.held())


def _records(table: Table) -> Iterator[tuple[float, int, Item, int | None]]:
    """Time, number, item, and how many there are."""
    blank = [0.0] * len(table)
    names = ("CNum", "CId", "Prm1", "Prm2", "Prm3", "Lat", "Lng", "Alt", "Frame")
    columns = [table[name].tolist() if name in table.columns else blank for name in names]
    counts = table["CTot"].tolist() if "CTot" in table.columns else [math.nan] * len(table)
    for t, count, row in zip(table.t.tolist(), counts, zip(*columns, strict=True), strict=True):
        number, command, first, second, third, lat, lng, alt, frame = row
        if math.isfinite(number) and math.isfinite(command):
            item = Item(
                _OF_QUADPLANES.get(int(command), int(command)),
                first,
                second,
                third if math.isfinite(third) else 0.0,
                lat,
                lng,
                alt,
                int(frame) if math.isfinite(frame) else 0,
            )
            yield t, int(number), item, int(count) if math.isfinite(count) else None
