"""What was requested of one ArduPilot flight: its mission in numbers, and the vehicle that flew it. Never a cause.

A mission item's number 0 is home and never flown. Jumps are followed as often as they say. What is requested is known
before the flight, so a vehicle that never armed has it too.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import takewhile

import numpy as np

from care_core.ecosystems.ardupilot import held_missions
from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.ardupilot.held_missions import (
    CHANGE_SPEED,
    DELAY,
    HOLDS,
    JUMP,
    LAND,
    LOITER_TURNS,
    PLACES,
    RETURN,
    TAKEOFF,
    HeldMission,
    Item,
)
from care_core.ecosystems.ardupilot.instances import split
from care_core.ecosystems.ardupilot.measures.modes import flight_of, is_armed, modes_in_force
from care_core.ecosystems.ardupilot.measures.samples import samples, whole
from care_core.ecosystems.ardupilot.texts import mission_item
from care_core.ecosystems.coverage import USUAL, Samples
from care_core.ecosystems.measures import Args, Mission, extractor, has, missing, one_of
from care_core.ecosystems.vehicles.arming import NEVER_ARMED
from care_core.ecosystems.vehicles.way import NUMBERS, Ending, RequestedMission, number_asked
from care_core.geodesy import offset_m
from care_core.logs.base import Table, Wanted
from care_core.numbers import median
from care_core.run import Unavailable, Value
from care_core.text import log_time

ITEMS: Wanted = {
    **held_missions.READS,
    "ORGN": ("Type", "Lat", "Lng", "Alt"),
    "POS": ("Lat", "Lng"),
}
"""What `requested_mission` reads."""

_ABOVE_SEA = (0, 5)
"""MAV_FRAME of a height above sea level; the others count from home (3, 6) or from the terrain (10, 11)."""
_AIRSPEED, _GROUNDSPEED = 0, 1
_WINGED = ("plane", "quadplane")
_ONE_MISSION = "judge a run whose mission stays as it was uploaded"
_MOST_ITEMS = 2000
"""Items that are followed: a jump without end would never stop."""
_CIRCLE_RATE, _AIRSPEED_MS = 20.0, 12.0
"""As shipped (AC_Circle.h, ArduPlane/config.h)."""
_STOPS = (4, 1)
"""The first ArduCopter that is at a waypoint before it goes on to what is no waypoint (SCurve)."""
_SPEED_CMS, _ACCELERATION_CMSS, _POSITION_GAIN = 500.0, 100.0, 1.0
"""As shipped before (AC_WPNav.h, AC_PosControl.h)."""
_HOME = 1
"""Type of an ORGN record: home; 0 is the origin of the estimator."""


def requested_mission(mission: Mission) -> RequestedMission | Unavailable:
    """The mission that the vehicle was given; use through `mission.shared`."""
    held = mission.shared(mission_held)
    if isinstance(held, Unavailable):
        return held
    if not held.items:
        return Unavailable("the mission has no items", "upload one")
    home = home_of(mission)
    if home is None:
        return Unavailable("the log does not say where home is", "record ORGN or POS")
    if min(held.items) not in held.flight(items_begun(mission)):
        return Unavailable("the flight goes on with a mission behind a landing", _ONE_MISSION)
    points, holds, speeds = [(0.0, 0.0, 0.0)], [], []
    speed = 0.0
    ending: Ending = "open"
    circle_s, airspeed_ms = _circle_s(mission), _airspeed_ms(mission)
    # a ground speed is no more than the least that a plane's airspeed is to bring
    counted = (_AIRSPEED,) if flight_of(mission).kind in _WINGED else (_AIRSPEED, _GROUNDSPEED)
    for item in followed(held.items):
        if item.command == TAKEOFF:
            points[0] = (0.0, 0.0, _height(item, home))
        elif item.command == CHANGE_SPEED and item.first in counted:
            speed = item.second if item.second > 0 else speed
        elif item.command in PLACES:
            points.append(place_of(item, home, points[-1]))
            holds.append(_wait_s(item, circle_s, speed or airspeed_ms))
            speeds.append(speed)
        elif item.command == DELAY and holds:
            holds[-1] += max(item.first, 0.0)
        elif item.command in (RETURN, LAND):
            if last := _last_place(item, home, points[-1], drives=flight_of(mission).kind == "rover"):
                points.append(last)
                holds.append(0.0)
                speeds.append(speed)
            ending = "return" if item.command == RETURN else "land"
            break
    if len(points) < 2:
        return Unavailable("the mission has no waypoints")
    return RequestedMission(np.array(points), np.array(holds), np.array(speeds), ending)


def items_begun(mission: Mission) -> set[int]:
    """Numbers of the items that the vehicle said it began."""
    told = (mission_item(text) for _, text in flight_of(mission).messages_between(mission.start_s, mission.end_s))
    return {item[0] for item in told if item is not None and item[1] != "reached"}


def _last_place(
    item: Item, home: Sequence[float], before: tuple[float, float, float], *, drives: bool
) -> tuple[float, float, float] | None:
    """Where the leg of a return or of a landing leads. A rover drives home as it drives any leg; the way home of what
    flies has its own heights and speeds, and is no leg."""
    if item.command == RETURN:
        return (0.0, 0.0, 0.0) if drives else None
    return (*offset_m(home, item.lat, item.lng), before[2]) if item.lat or item.lng else None


def trails_m(mission: Mission) -> float:
    """How far behind its last waypoint a copter may be when it begins to land wherever it is then.

    Before 4.1 a waypoint without a wait counts as reached when the point that leads the copter is there, and it follows
    by up to its leash (AC_WPNav::advance_wp_target_along_track, AC_PosControl::calc_leash_length).
    """
    flight, held = flight_of(mission), mission.shared(mission_held)
    version = flight.vehicle.version
    if isinstance(held, Unavailable) or not flight.is_copter or version is None or version[:2] >= _STOPS:
        return 0.0
    leading = [item for item in followed(held.items) if item.command in (*PLACES, RETURN, LAND)]
    way = list(takewhile(lambda item: item.command in PLACES, leading))
    last = leading[len(way)] if len(way) < len(leading) else None
    if not way or way[-1].first > 0 or last is None or last.command != LAND or last.lat or last.lng:
        return 0.0
    speed = number_set(mission, "WPNAV_SPEED", _SPEED_CMS) / 100
    acceleration = max(number_set(mission, "WPNAV_ACCEL", _ACCELERATION_CMSS) / 100, 0.1)
    gain = max(number_set(mission, "PSC_POSXY_P", number_set(mission, "POS_XY_P", _POSITION_GAIN)), 0.1)
    if speed <= acceleration / gain:
        return speed / gain
    return acceleration / (2 * gain**2) + speed**2 / (2 * acceleration)


def _wait_s(item: Item, circle_s: float, airspeed_ms: float) -> float:
    """How long a vehicle stays where an item leads, a plane as long as it flies circles whose radius the mission gives:
    the others are flown with WP_LOITER_RAD, and are not waits."""
    if item.command == LOITER_TURNS:
        return max(item.first, 0.0) * (circle_s or math.tau * item.radius_m / airspeed_ms)
    return max(item.first, 0.0) if item.command in HOLDS else 0.0


def _circle_s(mission: Mission) -> float:
    """How long a copter takes for one circle, by CIRCLE_RATE in degrees a second; 0 of others."""
    if flight_of(mission).mode_kind not in ("copter", "heli"):
        return 0.0
    rate = number_set(mission, "CIRCLE_RATE", _CIRCLE_RATE)
    return 360.0 / abs(rate) if rate else 0.0


def _airspeed_ms(mission: Mission) -> float:
    """The airspeed at which a plane flies that is not told otherwise."""
    older = number_set(mission, "TRIM_ARSPD_CM", _AIRSPEED_MS * 100.0) / 100.0
    return max(number_set(mission, "AIRSPEED_CRUISE", older), 1.0)


def number_set(mission: Mission, name: str, default: float) -> float:
    """The number that a parameter is set to, or what it is as shipped."""
    value = mission.settings.get(name, default)
    return float(value) if isinstance(value, (int, float)) else default


def mission_held(mission: Mission) -> HeldMission | Unavailable:
    """The mission that the vehicle held while it flew one; use through `mission.shared`. What is uploaded before its
    mission begins counts, as does what is uploaded when all of it is done; else nobody was asked for one mission."""
    flight = flight_of(mission)
    known = [one for one in flight.held_missions if one.since_s <= mission.end_s]
    if not known:
        return Unavailable("the log names no mission items", "record CMD", "CMD")
    begun_s = _begun_s(mission)
    later = [one for one in known[1:] if one.since_s > begun_s]
    held = known[-len(later) - 1]
    if not later or _is_done(flight, held, begun_s, mission.end_s, later[0].since_s):
        return held
    return Unavailable(f"the mission was replaced under way, at {log_time(later[0].since_s, 0)}", _ONE_MISSION)


def _begun_s(mission: Mission) -> float:
    """When the vehicle began its mission; a vehicle that began none holds the last that it was given."""
    begun = [mode.start_s for mode in modes_in_force(mission) if mode.way == "mission"]
    return max(mission.start_s, min(begun)) if begun and is_armed(mission) else mission.end_s


def _is_done(flight: Flight, held: HeldMission, begun_s: float, end_s: float, replaced_s: float) -> bool:
    """Whether all waypoints of a mission were reached when it was replaced, and the new one was never begun."""
    told = [(t, item) for t, text in flight.messages_between(begun_s, end_s) if (item := mission_item(text))]
    reached = {number for t, (number, what) in told if what == "reached" and t <= replaced_s}
    return reached.issuperset(held.waypoints) and not any(t > replaced_s for t, _ in told)


def followed(items: Mapping[int, Item]) -> Iterator[Item]:
    """The items in the order in which they are flown."""
    left = {number: int(item.second) for number, item in items.items() if item.command == JUMP}
    number, count = min(items), 0
    while number in items and count < _MOST_ITEMS:
        item, count = items[number], count + 1
        if item.command == JUMP and left[number] > 0 and int(item.first) in items:
            left[number] -= 1
            number = int(item.first)
            continue
        yield item
        number += 1


def home_of(mission: Mission) -> tuple[float, float, float] | None:
    """Latitude, longitude and height above sea of home: as set on arming, else the first position, else the origin of
    the estimator, which is all that a vehicle knows that never armed."""
    origins, position = mission.tables.get("ORGN"), mission.table("POS")
    if not has(origins, "Type", "Lat", "Lng"):
        return _place_of(position)
    homes = origins.where((origins["Type"] == _HOME) & (origins.t <= mission.start_s + 1.0))
    return _place_of(homes) or _place_of(position) or _place_of(origins)


def _place_of(table: Table | None) -> tuple[float, float, float] | None:
    """The last place of home, the first of a track; its height is 0 where it is not known."""
    if not has(table, "Lat", "Lng"):
        return None
    at = -1 if "Type" in table.columns else 0
    height = float(table["Alt"][at]) if "Alt" in table.columns else 0.0
    return float(table["Lat"][at]), float(table["Lng"][at]), height


def _height(item: Item, home: Sequence[float]) -> float:
    return item.alt_m - home[2] if item.frame in _ABOVE_SEA and home[2] else item.alt_m


def place_of(item: Item, home: Sequence[float], before: tuple[float, float, float]) -> tuple[float, float, float]:
    """Where an item leads; coordinates or a height of 0 mean those of the item before."""
    north, east = offset_m(home, item.lat, item.lng) if item.lat or item.lng else before[:2]
    return north, east, _height(item, home) if item.alt_m else before[2]


# --- the mission ------------------------------------------------------------------------------------------------


@extractor("mission_asked", needs=ITEMS, unit="", args={"what": one_of(", ".join(NUMBERS), *NUMBERS)})
def mission_asked(mission: Mission, args: Args) -> Value:
    """One number of the mission that the vehicle was given: lengths and heights in m, times in s, turns in degrees,
    `commanded_speed` in m/s (0: none), `returns` 1 or 0; corners are `sharp` from 60 degrees, `sharp_turns` adds up
    theirs, those with a wait too."""
    return number_asked(mission.shared(requested_mission), str(args.get("what")))


# --- the vehicle ------------------------------------------------------------------------------------------------


_BATTERY: Wanted = {"BAT": ("Inst", "Instance", "Volt", "Curr", "Res")}


def _battery(mission: Mission, args: Args) -> Iterator[Samples]:
    yield samples(mission, "BAT", ("Volt",), [whole(mission)], USUAL)


@extractor("hover_power", needs=_BATTERY, unit="W", rests_on=_battery)
def hover_power(mission: Mission, args: Args) -> Value:
    """Median electric power while airborne: what the vehicle takes to stay up, with its load."""
    table = _in_the_air(mission, "Volt", "Curr")
    return table if isinstance(table, Unavailable) else float(median(table["Volt"] * table["Curr"]))


@extractor("internal_resistance", needs=_BATTERY, unit="ohm", rests_on=_battery)
def internal_resistance(mission: Mission, args: Args) -> Value:
    """Median of the battery's resistance while airborne, as the battery monitor estimates it."""
    table = _in_the_air(mission, "Res")
    return table if isinstance(table, Unavailable) else float(median(table["Res"]))


def _in_the_air(mission: Mission, *fields: str) -> Table | Unavailable:
    """The first battery's rows with a current, in the flight."""
    if not is_armed(mission):
        return NEVER_ARMED
    table = mission.table("BAT")
    if table is None or not has(table, "Curr", *fields):
        return missing(f"BAT with {' and '.join(fields)}")
    first = split("BAT", table)[0]
    most = float(first["Curr"].max())
    flown = first.where(first["Curr"] > 0.5 * most) if most > 0 else first.where(slice(0, 0))
    return flown if len(flown) else Unavailable("the battery's current was never above 0", "calibrate the monitor")
