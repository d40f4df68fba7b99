"""What only ArduPilot's planes and QuadPlanes log: height, airspeed and way along the legs, surfaces, throttle, wind.

What a leg is measured over: from the start of a waypoint's item to its arrival. The first leg is left out, since a
plane climbs out along its runway before it turns to its mission, and so is the landing: what comes after the item that
begins it, and the straight final. Loiters are items of their own, and no legs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from care_core.ecosystems.ardupilot.held_missions import (
    CIRCLES,
    LAND,
    LAND_START,
    LOITER_TURNS,
    PLACES,
    RETURN,
    HeldMission,
    Item,
)
from care_core.ecosystems.ardupilot.instances import split
from care_core.ecosystems.ardupilot.measures import rests
from care_core.ecosystems.ardupilot.measures.flown_mission import NEEDS, analyse
from care_core.ecosystems.ardupilot.measures.phases import flown_mission
from care_core.ecosystems.ardupilot.measures.requested import (
    ITEMS,
    home_of,
    mission_held,
    number_set,
    place_of,
    requested_mission,
)
from care_core.ecosystems.ardupilot.measures.samples import samples
from care_core.ecosystems.ardupilot.measures.series import MIN_ROWS
from care_core.ecosystems.coverage import EXTREME, USUAL, Samples
from care_core.ecosystems.measures import Args, Mission, RestsOn, extractor, missing, numeric, one_of
from care_core.ecosystems.spans import Span, during, seconds_in
from care_core.ecosystems.statistic import statistic
from care_core.ecosystems.vehicles.way import distance_to_legs
from care_core.logs.base import Table, Wanted, merge_needs
from care_core.numbers import Floats, median
from care_core.records import Record
from care_core.run import Unavailable, Value

_STAT = one_of("mean, max, min, rms or peak (95th percentile)", "mean", "max", "min", "rms", "peak")
_FULL_DEFLECTION, _AT_LIMIT = 4500.0, 0.95
"""AETR of a surface that is out to its stop (SRV_Channel: -4500 to 4500)."""
_LANDING = (RETURN, LAND, LAND_START)
_STRAIGHT_DEG = 15.0
"""Legs on the final lead on within so much."""
_STEADY_DEG, _STEADY_MS = 15.0, 1.0
"""A plane flies level and straight within so much bank and so much climb."""
_TOUCHDOWN_S = 4.0
"""The last seconds of a glide before the ground."""
_GROUND_M, _CLIMBED_M = 3.0, 5.0
_SAME_PLACE_M = 1.0
_LOITER_RADIUS_M = 60.0
"""As shipped (ArduPlane/config.h)."""
_MIN_AIRSPEED = 5.0
_MORE_TURNS = 0.85
"""What a turn takes longer than its circle, in what joining a wait takes; training flights of the reference."""

_AIRSPEED: Wanted = {"CTUN": ("As",), "NTUN": ("TAsp",)}
_HEIGHT: Wanted = {"NTUN": ("AltE",)}
_SURFACES: Wanted = {"AETR": ("Ail", "Elev", "Thr")}
_CLIMB: Wanted = {"TECS": ("dh", "dhdem")}
_WIND: Wanted = {"XKF2": ("C", "VWN", "VWE")}


class Corner(NamedTuple):
    """A place that a mission leads to: north and east of home and above it, in metres."""

    north: float
    east: float
    height: float
    circle: float | None = None
    """Of a circle its radius as a share of WP_LOITER_RAD; None of a waypoint."""


_HOME = Corner(0.0, 0.0, 0.0)


class Leg(NamedTuple):
    """A leg that is judged, from where the item before it led to."""

    start: Corner
    end: Corner

    @property
    def length(self) -> float:
        return math.hypot(self.end.north - self.start.north, self.end.east - self.start.east)

    @property
    def rise(self) -> float:
        return self.end.height - self.start.height


class Legs(Record, eq=False):
    """The legs of a plane's mission that are judged: those to its waypoints but the first."""

    corners: tuple[Corner, ...]
    """Where the mission leads to up to the last of them, its circles too, without home."""
    legs: Mapping[int, Leg]
    """By the number of the waypoint among the waypoints, from 2."""
    spans: Mapping[int, Span]
    """When each that was flown whole was flown."""
    loiters: float
    """Circles of WP_LOITER_RAD that joining and leaving those of the whole mission takes."""

    @property
    def after_loiter(self) -> float:
        """The widest circle that one of the legs begins on, and so off its line; 0 where none does."""
        return max((leg.start.circle or 0.0 for leg in self.legs.values()), default=0.0)

    def first_rise(self, start_m: float) -> float:
        """How much the way to the first of them leads up, from a height on; 0 where a circle before them gives the time
        for it."""
        if not self.legs or self.legs[min(self.legs)].start.circle is not None:
            return 0.0
        return max(self.corners[0].height - start_m, 0.0)

    @property
    def way(self) -> Floats:
        """Shape (corners + 1, 2): the way that was asked for, from home."""
        return np.array([(0.0, 0.0), *((corner.north, corner.east) for corner in self.corners)])


def legs_of(mission: Mission) -> Legs | Unavailable:
    """The legs between the waypoints before the landing; use through `mission.shared`."""
    flown, held, home = mission.shared(analyse), mission.shared(mission_held), home_of(mission)
    if isinstance(held, Unavailable) or home is None or not len(flown.route):
        return held if isinstance(held, Unavailable) else missing("CMD")
    numbers = held.waypoints[: _before_landing(held, flown.route, flown.end)]
    corners: list[Corner] = []
    legs: dict[int, Leg] = {}
    radius_m = number_set(mission, "WP_LOITER_RAD", _LOITER_RADIUS_M)
    for number, corner in _corners(held, home, radius_m):
        if numbers and number <= numbers[-1]:
            if number in numbers[1:]:
                legs[numbers.index(number) + 1] = Leg(corners[-1], corner)
            corners.append(corner)
    spans = {
        index: (phase.start_s, phase.end_s)
        for (name, index), phase in flown.phases.items()
        if name == "leg" and index in legs
    }
    loiters = sum(_joined(item, radius_m) for item in held.items.values() if item.command in CIRCLES)
    return Legs(tuple(corners), legs, spans, loiters)


def _joined(item: Item, radius_m: float) -> float:
    """Circles that joining and leaving a loiter takes: one of a wait. Turns take half as long again as their circles,
    and where they have a radius of their own these are told as a wait."""
    if item.command != LOITER_TURNS:
        return 1.0
    return _MORE_TURNS * item.first * item.radius_m / max(abs(radius_m), 1.0)


def _before_landing(held: HeldMission, route: Floats, end: tuple[float, float] | None) -> int:
    """How many of the waypoints come before the landing."""
    landing = min((number for number, item in held.items.items() if item.command in _LANDING), default=math.inf)
    count = sum(number < landing for number in held.waypoints)
    if end is not None and held.items[max(held.items)].command == LAND:
        count -= _on_final(np.vstack((route[:count], end)))
    return max(count, 0)


def _corners(held: HeldMission, home: Sequence[float], radius_m: float) -> Iterator[tuple[int, Corner]]:
    """Where each item leads to, by its number; `radius_m` is that of circles for which the mission gives none."""
    place = (0.0, 0.0, 0.0)
    for number, item in held.items.items():
        if item.command in PLACES:
            place = place_of(item, home, place)
            own = item.radius_m / max(abs(radius_m), 1.0) if item.radius_m else 1.0
            yield number, Corner(*place, own if item.command in CIRCLES else None)


def _on_final(way: Floats) -> int:
    """How many of the waypoints before the last point of a way lie on the straight that leads to it; two at least make
    a final, one is any waypoint."""
    course = _courses(way)
    count = 0
    while count + 1 < len(course) and abs(_turn(course[-1] - course[-2 - count])) < _STRAIGHT_DEG:
        count += 1
    return count + 1 if count else 0


def _courses(way: Floats) -> Floats:
    """Course of each leg of a way, in degrees."""
    step = np.diff(way, axis=0)
    return np.asarray(np.degrees(np.arctan2(step[:, 1], step[:, 0])))


def _turn(degrees: Floats) -> Floats:
    return np.asarray((degrees + 180.0) % 360.0 - 180.0)


def legs_flown(mission: Mission) -> list[Span] | Unavailable:
    """When each leg was flown whole."""
    legs = mission.shared(legs_of)
    if isinstance(legs, Unavailable):
        return legs
    return list(legs.spans.values()) or Unavailable("the flight completed no leg after the first")


def on_legs(mission: Mission, channel: str, *fields: str) -> Table | Unavailable:
    """Rows of the first instance of a channel on those legs, with all of `fields` finite."""
    spans = legs_flown(mission)
    return spans if isinstance(spans, Unavailable) else _within(mission, spans, channel, *fields)


def under_way(mission: Mission) -> list[Span] | Unavailable:
    """From the start of the way to the first waypoint to the arrival at the last that was reached: all but the take-off
    and the landing."""
    flown = mission.shared(analyse)
    legs = [phase for (name, _), phase in flown.phases.items() if name == "leg"]
    if not legs:
        return Unavailable("the flight completed no leg")
    return [(min(leg.start_s for leg in legs), max(leg.end_s for leg in legs))]


def _within(mission: Mission, spans: Sequence[Span], channel: str, *fields: str) -> Table | Unavailable:
    table = mission.table(channel)
    if table is None:
        return missing(channel)
    lacking = [field for field in fields if field not in table.columns]
    if lacking:
        return missing(f"{channel} with {' and '.join(lacking)}", "judge a log of a firmware that records it")
    table = next(iter(split(channel, table)), table)
    wanted = np.logical_and.reduce([np.isfinite(table[field]) for field in fields])
    wanted &= during(spans, table.t)
    rows = table.where(wanted)
    return rows if len(rows) >= MIN_ROWS else Unavailable(f"too little {channel} on the legs")


def _rests_on(channels: Sequence[str], over: Callable[[Mission], Sequence[Span] | Unavailable] = legs_flown) -> RestsOn:
    def rests_on(mission: Mission, args: Args) -> Iterator[Samples]:
        spans = over(mission)
        for channel in channels:
            bears = EXTREME if args.get("stat") in ("max", "min") else USUAL
            yield samples(mission, channel, (), () if isinstance(spans, Unavailable) else spans, bears)

    return rests_on


def _of_legs(
    name: str, wanted: Wanted, unit: str, doc: str, measure: Callable[[Table, Mission, Args], Floats], *, stat: str,
    args: Mapping[str, str] | None = None,
) -> None:  # fmt: skip
    """Register an extractor that is a statistic of one channel on the legs."""
    ((channel, fields),) = wanted.items()
    required = [field for field in fields if field != "C"]

    def compute(mission: Mission, given: Args) -> Value:
        table = on_legs(mission, channel, *required)
        if isinstance(table, Unavailable):
            return table
        return statistic(measure(table, mission, given), str(given.get("stat", stat)))

    compute.__module__ = __name__
    compute.__doc__ = f"{doc} On the legs; statistic: {stat} unless `stat` says otherwise."
    described = {"stat": _STAT, **(args or {})}
    extractor(name, needs=merge_needs((NEEDS, wanted)), unit=unit, args=described, rests_on=_rests_on([channel]))(
        compute
    )


def _surface(table: Table, args: Args) -> Floats:
    column = {"roll": "Ail", "pitch": "Elev"}[str(args.get("axis", "roll"))]
    return np.asarray(table[column] / _FULL_DEFLECTION)


_AXIS = {"axis": one_of("roll (ailerons) or pitch (elevator); roll unless given", "roll", "pitch")}

_of_legs("height_error", _HEIGHT, "m", "Wanted minus flown height of a plane.",
         lambda t, _m, _a: np.abs(t["AltE"]), stat="mean")  # fmt: skip
_of_legs("airspeed", {"CTUN": ("As",)}, "m/s", "Airspeed of a plane.", lambda t, _m, _a: t["As"], stat="mean")
_of_legs("crosstrack_error", {"NTUN": ("XT",)}, "m", "Distance of a plane from the line that it steers along.",
         lambda t, _m, _a: np.abs(t["XT"]), stat="rms")  # fmt: skip
_of_legs("climb_error", _CLIMB, "m/s", "Wanted minus flown climb rate of a plane, by its energy controller.",
         lambda t, _m, _a: t["dhdem"] - t["dh"], stat="rms")  # fmt: skip
_of_legs("plane_throttle", {"CTUN": ("ThO",)}, "%", "Throttle of a plane.", lambda t, _m, _a: t["ThO"], stat="mean")
_of_legs("plane_throttle_saturation", {"CTUN": ("ThO",)}, "",
         "Share of the time in which a plane's throttle is at THR_MAX.",
         lambda t, m, _a: (t["ThO"] >= number_set(m, "THR_MAX", 100.0) - 1.0).astype(float), stat="mean")  # fmt: skip
_of_legs("surface_output", _SURFACES, "", "How far the ailerons or the elevator are out, as a share of their travel.",
         lambda t, _m, a: _surface(t, a), stat="rms", args=_AXIS)  # fmt: skip
_of_legs("surface_saturation", _SURFACES, "", "Share of the time in which ailerons or elevator are at their stop.",
         lambda t, _m, a: (np.abs(_surface(t, a)) >= _AT_LIMIT).astype(float), stat="mean", args=_AXIS)  # fmt: skip
_of_legs("bank_angle", {"ATT": ("Roll",)}, "deg", "Bank of a plane.", lambda t, _m, _a: np.abs(t["Roll"]), stat="peak")
_of_legs("plane_pitch", {"ATT": ("Pitch",)}, "deg", "Pitch of a plane.", lambda t, _m, _a: t["Pitch"], stat="mean")
_of_legs("wind_speed", _WIND, "m/s", "Wind as the estimator has it.",
         lambda t, _m, _a: np.hypot(t["VWN"], t["VWE"]), stat="mean")  # fmt: skip


@extractor(
    "airspeed_error",
    needs=merge_needs((NEEDS, _AIRSPEED)),
    unit="m/s",
    args={"stat": _STAT},
    rests_on=_rests_on(["CTUN", "NTUN"]),
)
def airspeed_error(mission: Mission, args: Args) -> Value:
    """Wanted minus flown airspeed of a plane on the legs. Statistic: mean unless `stat` says otherwise."""
    flown = on_legs(mission, "CTUN", "As")
    wanted = on_legs(mission, "NTUN", "TAsp")
    if isinstance(flown, Unavailable):
        return flown
    if isinstance(wanted, Unavailable):
        return wanted
    off = flown["As"] - np.interp(flown.t, wanted.t, wanted["TAsp"])
    return statistic(np.abs(off), str(args.get("stat", "mean")))


@extractor(
    "leg_error",
    needs=NEEDS,
    unit="m",
    args={"stat": one_of("max, mean or peak (95th percentile)", "max", "mean", "peak")},
    rests_on=rests.position(EXTREME),
)
def leg_error(mission: Mission, args: Args) -> Value:
    """Horizontal distance of a plane from the nearest of its legs while it flies one. Statistic: max unless `stat` says
    otherwise."""
    spans, legs, flown = legs_flown(mission), mission.shared(legs_of), flown_mission(mission)
    if isinstance(spans, Unavailable):
        return spans
    if isinstance(legs, Unavailable) or isinstance(flown, Unavailable) or flown.track is None:
        return missing("POS")
    parts = [part.filled_in() for start, end in spans if (part := flown.track.between(start, end)) is not None]
    if not parts:
        return missing("POS")
    points = np.concatenate([np.column_stack((part.north, part.east)) for part in parts])
    # corners are cut: a leg begins before the one to it ends
    return statistic(distance_to_legs(points, legs.way), str(args.get("stat", "max")))


@extractor("leg_speed", needs=NEEDS, unit="m/s")
def leg_speed(mission: Mission, args: Args) -> Value:
    """Length of the completed legs of a plane but the first over the time for them: speed over ground."""
    legs = mission.shared(legs_of)
    if isinstance(legs, Unavailable):
        return legs
    flown_s = seconds_in(legs.spans.values())
    if flown_s <= 0:
        return Unavailable("the flight completed no leg after the first")
    return sum(legs.legs[index].length for index in legs.spans) / flown_s


def _controller(args: Args) -> str:
    return "PIDP" if args.get("axis") == "pitch" else "PIDR"


@extractor(
    "surface_rate_error",
    needs=merge_needs((NEEDS, {"PIDR": ("Tar", "Act"), "PIDP": ("Tar", "Act")})),
    unit="deg/s",
    args={"stat": _STAT, **_AXIS},
    rests_on=lambda mission, args: _rests_on([_controller(args)])(mission, args),
)
def surface_rate_error(mission: Mission, args: Args) -> Value:
    """Wanted minus flown rotation rate of a plane on the legs. Statistic: rms unless `stat` says otherwise."""
    table = on_legs(mission, _controller(args), "Tar", "Act")
    if isinstance(table, Unavailable):
        return table
    return statistic(table["Tar"] - table["Act"], str(args.get("stat", "rms")))


@extractor(
    "level_power",
    needs=merge_needs((NEEDS, {"ATT": ("Roll",), "CTUN": ("As",), "BAT": ("Inst", "Volt", "Curr"), "TECS": ("dh",)})),
    unit="W",
    args={
        "airspeed": numeric("airspeed in m/s at which the power is given"),
        "power": numeric("by which power of the airspeed it grows; 3 unless given"),
    },
    rests_on=_rests_on(["BAT", "CTUN"], under_way),
)
def level_power(mission: Mission, args: Args) -> Value:
    """Electric power of a plane in straight and level flight between take-off and landing, as it would be at
    `airspeed`: median."""
    spans = under_way(mission)
    if isinstance(spans, Unavailable):
        return spans
    tables = []
    for channel, fields in (("ATT", ("Roll",)), ("CTUN", ("As",)), ("TECS", ("dh",)), ("BAT", ("Volt", "Curr"))):
        table = _within(mission, spans, channel, *fields)
        if isinstance(table, Unavailable):
            return table
        tables.append(table)
    leans, flown, climbs, battery = tables
    airspeed = np.interp(battery.t, flown.t, flown["As"])
    steady = (np.abs(np.interp(battery.t, leans.t, leans["Roll"])) < _STEADY_DEG) & (airspeed > _MIN_AIRSPEED)
    steady &= np.abs(np.interp(battery.t, climbs.t, climbs["dh"])) < _STEADY_MS
    if steady.sum() < MIN_ROWS:
        return Unavailable("it hardly flew straight and level")
    power = battery["Volt"][steady] * battery["Curr"][steady]
    factor = (float(args.get("airspeed", 20.0)) / airspeed[steady]) ** float(args.get("power", 3.0))
    value = float(median(power * factor))
    return value if value > 0 else Unavailable("the battery's current was never above 0", "calibrate the monitor")


@extractor("touchdown_sink", needs=NEEDS, unit="m/s", rests_on=rests.landing)
def touchdown_sink(mission: Mission, args: Args) -> Value:
    """The fastest sink of a plane in its last metres."""
    flown = flown_mission(mission)
    if isinstance(flown, Unavailable):
        return flown
    if flown.track is None:
        return missing("POS")
    t, height = flown.track.t, flown.track.height
    high = np.flatnonzero(height > height[-1] + _GROUND_M)
    if not len(high):
        return Unavailable("it never left the ground")
    last = (t >= t[high[-1]] - 0.5) & (t <= t[high[-1]] + _TOUCHDOWN_S)
    if last.sum() < MIN_ROWS:
        return Unavailable("too few positions at the landing", "record POS")
    return float(np.max(-np.diff(height[last]) / np.diff(t[last])))


@extractor("never_climbed", needs=NEEDS, unit="", rests_on=rests.position(EXTREME))
def never_climbed(mission: Mission, args: Args) -> Value:
    """1 when a plane was armed and never rose above 5 m, else 0."""
    flown = flown_mission(mission)
    if isinstance(flown, Unavailable):
        return flown
    if flown.track is None:
        return missing("POS")
    return float(np.ptp(flown.track.height) < _CLIMBED_M)


@extractor("loiter_turns", needs=ITEMS, unit="")
def loiter_turns(mission: Mission, args: Args) -> Value:
    """How many circles of WP_LOITER_RAD a mission asks a plane to fly; others are waits."""
    held = mission.shared(mission_held)
    if isinstance(held, Unavailable):
        return held
    asked = (item for item in held.items.values() if item.command == LOITER_TURNS and not item.radius_m)
    return float(sum(max(item.first, 0.0) for item in asked))


@extractor("sharpest_corner", needs=NEEDS, unit="deg")
def sharpest_corner(mission: Mission, args: Args) -> Value:
    """The largest change of course between two legs of a plane's mission."""
    legs = mission.shared(legs_of)
    if isinstance(legs, Unavailable):
        return legs
    corners = _apart((_HOME, *legs.corners))
    turned = [
        abs(float(_turn(np.diff(_courses(np.array([a[:2], b[:2], c[:2]])))[0])))
        for a, b, c in zip(corners, corners[1:], corners[2:], strict=False)
        if b.circle is None
    ]
    return max(turned, default=0.0)


def _apart(corners: Sequence[Corner]) -> list[Corner]:
    """The corners without those at the place of the one before, as a circle around a waypoint is."""
    kept = list(corners[:1])
    for corner in corners[1:]:
        if math.dist(corner[:2], kept[-1][:2]) > _SAME_PLACE_M:
            kept.append(corner)
    return kept


_LEGS: Mapping[str, Callable[[Legs, float], float]] = {
    "length": lambda legs, _start_m: sum(leg.length for leg in legs.legs.values()),
    "after_loiter": lambda legs, _start_m: legs.after_loiter,
    "loiters": lambda legs, _start_m: legs.loiters,
    "rises": lambda legs, _start_m: sum(max(leg.rise, 0.0) ** 2 for leg in legs.legs.values()),
    "first_length": lambda legs, _start_m: math.hypot(*legs.way[1]) if legs.corners else 0.0,
    "first_rise": lambda legs, start_m: legs.first_rise(start_m),
}


@extractor("legs_asked", needs=NEEDS, unit="", args={"what": one_of(", ".join(_LEGS), *_LEGS)})
def legs_asked(mission: Mission, args: Args) -> Value:
    """One number of the legs of a plane's mission that are judged: their `length` in m, the widest circle that one
    begins on as a share of WP_LOITER_RAD (`after_loiter`) and the squares of what they lead up, `rises` in m^2; of the
    way to the first of them its length and what it leads up, `first_length` and `first_rise` in m; of the whole mission
    the circles that joining and leaving its loiters takes, `loiters`, of WP_LOITER_RAD."""
    legs, asked = mission.shared(legs_of), mission.shared(requested_mission)
    if isinstance(legs, Unavailable):
        return legs
    start_m = 0.0 if isinstance(asked, Unavailable) else float(asked.points[0, 2])
    return _LEGS[str(args.get("what", "length"))](legs, start_m)
