"""What of a mission was flown or driven: its items, the track around home, and its phases.

Everything is worked out once per mission (`Mission.shared(analyse)`) and read by the extractors of this package.
Positions are metres north and east of home on a plane, which is exact to centimetres over a few kilometres.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from care_core.ecosystems.ardupilot import armed, recorded
from care_core.ecosystems.ardupilot.held_missions import CURVES, LAND, PLACES, RETURN, SPLINE, HeldMission, Item
from care_core.ecosystems.ardupilot.measures.modes import flight_of, modes_in_force
from care_core.ecosystems.ardupilot.measures.requested import (
    ITEMS,
    home_of,
    items_begun,
    mission_held,
    number_set,
    requested_mission,
)
from care_core.ecosystems.ardupilot.measures.samples import samples
from care_core.ecosystems.ardupilot.measures.whole_way import whole_way
from care_core.ecosystems.ardupilot.messages import expanded
from care_core.ecosystems.coverage import EXTREME, doubt
from care_core.ecosystems.measures import Mission, has
from care_core.ecosystems.vehicles.way import (
    AIRBORNE_M,
    Phase,
    RequestedMission,
    Track,
    distance_to_legs,
    phases_home,
)
from care_core.geodesy import METRES_PER_DEGREE, offset_m
from care_core.logs.base import Wanted, merge_needs
from care_core.numbers import Bools, Floats, known_median
from care_core.records import Record
from care_core.run import Unavailable

NEEDS: Wanted = merge_needs((
    ITEMS,
    {"POS": ("RelHomeAlt",), "GPS": ("I", "GMS")},
    expanded(recorded.READS),
    expanded({"ARM": armed.READS["ARM"]}),
))  # fmt: skip
"""What `analyse` and the search for missions read."""

PASSED_M = 5.0
"""As near to a waypoint it was there: copters and rovers count one as reached within 2 m unless told otherwise."""

_SAYS, _AT_ONCE_S = (3, 3), 0.5
"""The first ArduCopter whose log holds what it says of its items; items written so closely are a whole mission."""
_HOMEWARD = (RETURN, LAND)
_LEADING = frozenset((*PLACES, *_HOMEWARD))
"""Items that lead somewhere."""
_WITHOUT_AIR = ("rover", "sub")
_STARTED = re.compile(r"Mission: (\d+) ")
_REACHED = re.compile(r"(?:Reached (?:command|waypoint)|Passed waypoint) #(\d+)")
"""A copter says it when the wait is over (ArduCopter/mode_auto.cpp), rovers and planes when they arrive
(Rover/mode_auto.cpp); a plane that flew past a waypoint's radius and over its finish line has passed it, and goes on
(ArduPlane/commands_logic.cpp: verify_nav_wp)."""
_COMPLETE = ("Mission Complete", "Mission complete")
"""What a rover (Rover/mode_auto.cpp) and a submarine say when no item is left."""
SAID_AFTER_S = 0.6
"""What ends a mission may be said a moment after it: a crash disarms first, and telemetry knows a disarming to half a
second (its heartbeats)."""


class Waypoint(NamedTuple):
    """A mission waypoint: latitude and longitude in degrees, height above home in metres."""

    lat: float
    lng: float
    alt_m: float


class FlownMission(Record, eq=False):
    """What was flown or driven of a mission. `phases` holds only what was completed, by name and index (legs count from
    1, the rest is 0); of a drive, the mission as far as it went."""

    waypoints: tuple[Waypoint, ...]
    """The waypoints of the mission that the vehicle was given."""
    route: Floats
    """Shape (waypoints, 2): north and east of home in metres, the flown order."""
    corners: Floats
    """Shape (legs + 1, 2): the way that was asked for, from home through the waypoints to where it ends."""
    end: tuple[float, float] | None
    """Where the mission ends, None where it says neither to return nor to land."""
    reached: int
    """How many of the waypoints were reached: the autopilot said so, or went on to the next after it had passed there,
    for of what it says a radio loses some."""
    untold: int
    """How many others it went on from without a word, while nothing tells where it was."""
    track: Track | None
    """None when the log holds no position."""
    phases: Mapping[tuple[str, int], Phase]
    drive: Phase | None = None
    """Of a vehicle that stays on the ground or in the water: from the start of its mission to where it was complete,
    or broken off. None of one that flies."""
    completed: bool = False
    """Whether the vehicle said that its mission is complete, as rovers and submarines do."""
    curved: tuple[Phase, ...] = ()
    """Where it was on a spline, or on a circle and the leg from its edge: no straight leg says where it should be."""

    def under_way(self, t: Floats) -> Bools:
        """Whether the vehicle was on its way at times `t`: in its mission, or, where it flies, above `AIRBORNE_M`."""
        if self.drive is not None:
            return np.asarray((t >= self.drive.start_s) & (t <= self.drive.end_s))
        if self.track is None:
            return np.zeros(len(t), dtype=bool)
        return np.asarray(np.interp(t, self.track.t, self.track.height) > AIRBORNE_M)

    def path_errors(self) -> Floats:
        """Horizontal distance in metres from the way that was asked for while under way, along the track as flown.

        A vehicle turns between two positions of a thinned log, so the corners are filled in first.
        """
        if self.track is None:
            return np.empty(0)
        track = self.track.filled_in()
        going = self.under_way(track.t)
        for start_s, end_s in self.curved:
            going &= (track.t < start_s) | (track.t > end_s)
        points = np.column_stack((track.north[going], track.east[going]))
        return distance_to_legs(points, self.corners)


def analyse(mission: Mission) -> FlownMission:
    """Works out what was flown of a mission; use through `mission.shared`."""
    held = mission.shared(mission_held)
    items, numbers = ({}, []) if isinstance(held, Unavailable) else (held.items, _waypoints_to_reach(mission, held))
    waypoints = tuple(Waypoint(items[n].lat, items[n].lng, items[n].alt_m) for n in numbers)
    home = home_of(mission)
    track = _track(mission, home)
    started, reached = _milestones(mission)
    texts = flight_of(mission).messages_between(mission.start_s, mission.end_s + SAID_AFTER_S)
    complete_s = next((t for t, text in reversed(texts) if text.startswith(_COMPLETE)), None)
    kind = flight_of(mission).kind
    if kind == "sub" and complete_s is None and numbers:
        complete_s = reached.get(numbers[-1])  # it says no more when no item is left, and holds its depth
    drive = _drive(mission, complete_s) if kind in _WITHOUT_AIR else None
    if drive is not None and numbers:
        started.setdefault(numbers[0], drive.start_s)  # named once, before the vehicle may move
    route = np.array([offset_m(home, w.lat, w.lng) for w in waypoints]) if home and waypoints else np.empty((0, 2))
    corners, end = _way(mission.shared(requested_mission))
    way = mission.shared(whole_way)
    if flight_of(mission).is_winged and not isinstance(way, Unavailable) and way.back:
        end = way.back[-1][:2]  # a return goes on with the landing of its mission
    places = dict(zip(numbers, route, strict=True)) if len(route) else dict.fromkeys(numbers)
    passed = _passed(mission, track, places, started, reached, lands=drive is None)
    return FlownMission(
        waypoints=waypoints,
        route=route.astype(np.float64),
        corners=corners,
        end=end,
        reached=sum(number in reached or passed.get(number) is True for number in numbers),
        untold=sum(number not in reached and number in passed and passed[number] is None for number in numbers),
        track=track,
        phases=_phases(mission, track, numbers, started, reached) if drive is None
        else _drive_phases(mission, drive, numbers, started, reached, complete_s),
        drive=drive,
        completed=complete_s is not None,
        curved=_curved(items, started, mission.start_s, mission.end_s),
    )  # fmt: skip


def _curved(items: Mapping[int, Item], started: Mapping[int, float], start_s: float, end_s: float) -> tuple[Phase, ...]:
    """When no straight leg was flown: from the start of each such item to that of the next, after a circle to that of
    the one after the next; all the time where no start is told."""
    legs = sorted(started[number] for number in started if number in items and items[number].command in _LEADING)
    curves = {number: 1 if item.command == SPLINE else 2 for number, item in items.items() if item.command in CURVES}
    if curves and not legs:
        return (Phase(start_s, end_s),)
    found = []
    for number, lasts in curves.items():
        if number in started:
            later = [t for t in legs if t > started[number]]
            found.append(Phase(started[number], later[lasts - 1] if len(later) >= lasts else end_s))
    return tuple(found)


def _waypoints_to_reach(mission: Mission, held: HeldMission) -> list[int]:
    """The waypoints that this flight was to reach."""
    own = set(held.flight(items_begun(mission)))
    return [number for number in held.waypoints if number in own]


def _passed(
    mission: Mission, track: Track | None, places: Mapping[int, Floats | None], started: Mapping[int, float],
    reached: Mapping[int, float], *, lands: bool,
) -> dict[int, bool | None]:  # fmt: skip
    """Of each waypoint that was not said to be reached, whether the vehicle went on from it after it had passed there;
    None where it went on and nothing tells where it was, or where the waypoint is: `places` are north and east of a
    home."""
    told = [*started.items(), *((number + 0.5, t) for number, t in reached.items())]
    if lands and track is not None and track.height.max() > AIRBORNE_M and _ends_by_itself(mission):
        told.append((math.inf, mission.end_s))
    found: dict[int, bool | None] = {}
    for number, place in places.items():
        later = [t for at, t in told if at > number + 0.5]
        if number in reached or not later:
            continue
        before = max((t for at, t in told if at <= number), default=mission.start_s)
        part = None if track is None else track.between(before, min(later))
        if (
            place is None
            or part is None
            or doubt(samples(mission, "POS", ("Lat", "Lng"), [(before, min(later))], EXTREME))
        ):
            found[number] = None
            continue
        way = np.column_stack((part.north, part.east))
        beyond_m = float(distance_to_legs(place[None], way)[0]) - PASSED_M
        between_m = float(np.hypot(*np.diff(way, axis=0).T).max())  # a corner may lie between two positions
        found[number] = True if beyond_m <= 0 else None if beyond_m < between_m else False
    return found


def _ends_by_itself(mission: Mission) -> bool:
    """Whether the vehicle was disarmed in a mission that ends with a landing, and not by force: what flew went on from
    every waypoint."""
    way, modes = mission.shared(requested_mission), modes_in_force(mission)
    changes = flight_of(mission).arm_changes
    is_forced = any(one.is_forced and mission.start_s <= one.time_s <= mission.end_s for one in changes)
    return (
        mission.ended and not is_forced and not isinstance(way, Unavailable) and way.ending != "open"
        and bool(modes) and modes[-1].way == "mission"
    )  # fmt: skip


def waypoint_offsets(waypoints: Sequence[Waypoint], expected: Sequence[Sequence[float]]) -> list[float]:
    """Distance in metres, height included, of each waypoint from the one it should be."""
    offsets = []
    for waypoint, (lat, lng, alt_m) in zip(waypoints, expected, strict=True):
        north, east = offset_m((lat, lng), waypoint.lat, waypoint.lng)
        offsets.append(math.hypot(north, east, waypoint.alt_m - alt_m))
    return offsets


def metres_between(lat: Floats, lng: Floats) -> float:
    """Diagonal in metres of the area that positions, in degrees, each of shape (n,), lie in."""
    north, east = (float(np.ptp(one[np.isfinite(one)])) * METRES_PER_DEGREE for one in (lat, lng))
    return math.hypot(north, east * math.cos(math.radians(known_median(lat))))


def _way(found: RequestedMission | Unavailable) -> tuple[Floats, tuple[float, float] | None]:
    """The corners of the way that was asked for, from home, and where it ends."""
    if isinstance(found, Unavailable):
        return np.empty((0, 2)), None
    corners = found.points[:, :2]
    if found.ending == "return":
        corners = np.vstack((corners, np.zeros(2)))
    end = (float(corners[-1, 0]), float(corners[-1, 1]))
    return corners, None if found.ending == "open" else end


def _track(mission: Mission, home: Sequence[float] | None) -> Track | None:
    position = mission.table("POS")
    if home is None or position is None or not has(position, "Lat", "Lng", "RelHomeAlt"):
        return None
    position = position.where(np.isfinite(position["Lat"] + position["Lng"] + position["RelHomeAlt"]))
    if not len(position):
        return None
    return Track(position.t, *offset_m(home, position["Lat"], position["Lng"]), position["RelHomeAlt"])


def _milestones(mission: Mission) -> tuple[dict[int, float], dict[int, float]]:
    """When each mission item was first started, and when it was first reported as reached."""
    started: dict[int, float] = {}
    reached: dict[int, float] = {}
    for t, text in flight_of(mission).messages_between(mission.start_s, mission.end_s):
        for pattern, found in ((_STARTED, started), (_REACHED, reached)):
            match = pattern.match(text)
            if match:
                found.setdefault(int(match[1]), t)
    return started or _items_as_begun(mission), reached


def _items_as_begun(mission: Mission) -> dict[int, float]:
    """When each item was first written by itself. Firmware before 3.3 says nothing of its items, and writes each as it
    begins it (ArduCopter/commands_logic.cpp: start_command); a whole mission is written at once."""
    version, items = flight_of(mission).vehicle.version, mission.table("CMD")
    if version is None or version[:2] >= _SAYS or items is None or not has(items, "CNum"):
        return {}
    apart = np.diff(items.t, prepend=-np.inf) > _AT_ONCE_S
    apart &= np.append(apart[1:], True)
    started: dict[int, float] = {}
    for t, number in zip(items.t[apart].tolist(), items["CNum"][apart].tolist(), strict=True):
        started.setdefault(int(number), t)
    return started


def _phases(
    mission: Mission, track: Track | None, numbers: Sequence[int], started: Mapping[int, float],
    reached: Mapping[int, float],
) -> dict[tuple[str, int], Phase]:  # fmt: skip
    phases: dict[tuple[str, int], Phase] = {}
    if numbers and numbers[0] in started:
        phases["takeoff", 0] = Phase(mission.start_s, started[numbers[0]])
    for index, number in enumerate(numbers, start=1):
        if number in started and number in reached:
            phases["leg", index] = Phase(started[number], reached[number])
    homeward, way = _homeward(mission, started), mission.shared(requested_mission)
    returns = isinstance(way, Unavailable) or way.ending == "return"
    if homeward is not None and track is not None:
        slow_below_m = number_set(mission, "LAND_ALT_LOW", 1000.0) / 100
        home = phases_home(track, homeward, mission.end_s, slow_below_m, returns=returns)
        phases.update({(name, 0): phase for name, phase in home.items()})
    return phases


def _drive(mission: Mission, complete_s: float | None) -> Phase:
    """A ground vehicle's mission in the time that it was armed: to where it said that it is complete."""
    automatic = [mode.start_s for mode in modes_in_force(mission) if mode.way == "mission"]
    start_s = max(mission.start_s, min(automatic, default=mission.start_s))
    return Phase(start_s, mission.end_s if complete_s is None else max(start_s, min(complete_s, mission.end_s)))


def _drive_phases(
    mission: Mission, drive: Phase, numbers: Sequence[int], started: Mapping[int, float], reached: Mapping[int, float],
    complete_s: float | None,
) -> dict[tuple[str, int], Phase]:  # fmt: skip
    """The legs of a ground vehicle, each to its arrival, and its waits: to the next item, or the mission's end."""
    phases = {("mission", 0): drive}
    way = mission.shared(requested_mission)
    waits = () if isinstance(way, Unavailable) else way.holds_s
    ends = sorted((*started.values(), *(() if complete_s is None else (complete_s,))))
    for index, number in enumerate(numbers, start=1):
        if number not in started or number not in reached:
            continue
        phases["leg", index] = Phase(started[number], reached[number])
        after = next((t for t in ends if t > reached[number]), None)
        if after is not None and index <= len(waits) and waits[index - 1] > 0:
            phases["hold", index] = Phase(reached[number], after)
    return phases


def _homeward(mission: Mission, started: Mapping[int, float]) -> float | None:
    """When the vehicle set out for home: by a mission item, a failsafe or the operator."""
    held = mission.shared(mission_held)
    items = {} if isinstance(held, Unavailable) else held.items
    times = [t for number, t in started.items() if number in items and items[number].command in _HOMEWARD]
    homeward = (mode.start_s for mode in modes_in_force(mission) if mode.way in ("return", "land"))
    times += [t for t in homeward if t >= mission.start_s]
    return min(times, default=None)
