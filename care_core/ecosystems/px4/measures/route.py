"""Time and way of a PX4 flight: its phases, its legs, and how far it was off them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.coverage import EXTREME, SUM, Bears, Samples
from care_core.ecosystems.measures import Args, Mission, RestsOn, extractor, missing, one_of
from care_core.ecosystems.px4.flight import POSITION
from care_core.ecosystems.px4.measures.flown import (
    NEEDS,
    PHASE_ARGS,
    flown_mission,
    is_armed,
    span_of_phase,
)
from care_core.ecosystems.px4.measures.requested import ITEM, flight_of, requested_mission
from care_core.ecosystems.spans import Span
from care_core.ecosystems.statistic import statistic
from care_core.ecosystems.vehicles import way
from care_core.ecosystems.vehicles.arming import NEVER_ARMED
from care_core.run import Unavailable, Value

_RETURNING = ("return", "return_climb", "return_cruise", "descent", "touchdown")
"""Phases that are told by heights."""


def position(bears: Bears) -> RestsOn:
    """The estimated position from arming to disarming."""

    def rests_on(mission: Mission, args: Args) -> Iterator[Samples]:
        bearing = {"max": EXTREME}.get(str(args.get("stat", "")), bears)
        yield _positions(mission, [(mission.start_s, mission.end_s)], bearing)

    return rests_on


def _positions(mission: Mission, spans: list[Span], bears: Bears, *moments: float) -> Samples:
    table = mission.tables.get(POSITION)
    t = np.empty(0) if table is None else table.t
    return Samples(f"the position ({POSITION})", t, spans, bears, moments, dead=flight_of(mission).repeats(POSITION))


def heights_of_phase(mission: Mission, args: Args) -> Iterator[Samples]:
    """The height on the way back, for the phases that are told by it."""
    if str(args.get("phase", "return")) in _RETURNING:
        climb = span_of_phase(mission, {"phase": "return_climb"})
        start_s = mission.start_s if isinstance(climb, Unavailable) else climb[0]
        yield _positions(mission, [(start_s, mission.end_s)], EXTREME)


def landing(mission: Mission, args: Args) -> Iterator[Samples]:
    """The position where the flight ended."""
    yield _positions(mission, [], SUM, mission.end_s)


@extractor("px4_mission_time", needs=NEEDS, unit="s")
def mission_time(mission: Mission, args: Args) -> Value:
    """Time from arming to disarming."""
    return mission.end_s - mission.start_s if is_armed(mission) else NEVER_ARMED


@extractor("px4_phase_time", needs=NEEDS, unit="s", args=PHASE_ARGS, rests_on=heights_of_phase)
def phase_time(mission: Mission, args: Args) -> Value:
    """Duration of one completed part of the flight."""
    span = span_of_phase(mission, args)
    return span if isinstance(span, Unavailable) else span[1] - span[0]


@extractor("px4_cruise_speed", needs=NEEDS, unit="m/s")
def cruise_speed(mission: Mission, args: Args) -> Value:
    """Length of the legs that were completed over the time for them, without the waits at their ends."""
    flown, given = flown_mission(mission), mission.shared(requested_mission)
    if isinstance(flown, Unavailable):
        return flown
    if isinstance(given, Unavailable):
        return given
    done = [index - 1 for name, index in flown.phases if name == "leg" and index <= len(given.lengths)]
    if not done:
        return Unavailable("the flight completed no leg")
    moving_s = sum(flown.phases["leg", leg + 1].duration_s for leg in done) - float(given.holds_s[done].sum())
    length_m = float(given.lengths[done].sum())
    return length_m / moving_s if moving_s > 0 and length_m > 0 else Unavailable("the legs have no length")


@extractor("px4_items_reached", needs=NEEDS, unit="")
def items_reached(mission: Mission, args: Args) -> Value:
    """How many of the mission's items the navigator said to be reached."""
    flown = flown_mission(mission)
    return flown if isinstance(flown, Unavailable) else float(flown.reached + 1)


@extractor("px4_landing_error", needs=NEEDS, unit="m", rests_on=landing)
def landing_error(mission: Mission, args: Args) -> Value:
    """Horizontal distance at the end of the flight from where the mission ends: home, or where it lands."""
    return way.landing_error(flown_mission(mission), missing(POSITION), "the mission did not come to where it ends")


@extractor("px4_return_height", needs=NEEDS, unit="m", rests_on=heights_of_phase)
def return_height(mission: Mission, args: Args) -> Value:
    """The greatest height above home on the way back."""
    return way.return_height(flown_mission(mission), missing(POSITION))


@extractor("px4_peak_height", needs=NEEDS, unit="m", rests_on=position(EXTREME))
def peak_height(mission: Mission, args: Args) -> Value:
    """The greatest height above home."""
    flown = flown_mission(mission)
    if isinstance(flown, Unavailable):
        return flown
    return missing(POSITION) if flown.track is None else float(flown.track.height.max())


@extractor(
    "px4_path_error", needs=NEEDS, unit="m", args={"stat": one_of("max or mean", "max", "mean")},
    rests_on=position(EXTREME),
)  # fmt: skip
def path_error(mission: Mission, args: Args) -> Value:
    """Horizontal distance from the legs (home, then the waypoints) while they were flown."""
    flown = flown_mission(mission)
    if isinstance(flown, Unavailable):
        return flown
    if flown.track is None or not len(flown.corners):
        given = mission.shared(requested_mission)
        return missing(POSITION) if flown.track is None else given if isinstance(given, Unavailable) else missing(ITEM)
    return statistic(flown.path_errors(), str(args.get("stat", "max")))
