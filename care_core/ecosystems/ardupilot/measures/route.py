"""Time and way of an ArduPilot run: its phases, legs and how far it was off them."""

from __future__ import annotations

import numpy as np

from care_core.ecosystems.ardupilot.measures import rests
from care_core.ecosystems.ardupilot.measures.flown_mission import NEEDS
from care_core.ecosystems.ardupilot.measures.modes import is_armed
from care_core.ecosystems.ardupilot.measures.phases import PHASE_ARGS, flown_mission, span_of_phase
from care_core.ecosystems.ardupilot.measures.requested import requested_mission
from care_core.ecosystems.coverage import EXTREME, SUM
from care_core.ecosystems.measures import Args, Mission, extractor, missing, one_of
from care_core.ecosystems.statistic import statistic
from care_core.ecosystems.vehicles import way
from care_core.ecosystems.vehicles.arming import NEVER_ARMED
from care_core.run import Unavailable, Value


@extractor("waypoints_reached", needs=NEEDS, unit="")
def waypoints_reached(mission: Mission, args: Args) -> Value:
    """How many of the mission's waypoints the autopilot reported as reached."""
    flown = flown_mission(mission)
    if isinstance(flown, Unavailable):
        return flown
    return float(flown.reached) if flown.waypoints else Unavailable("the log names no waypoints", "record CMD", "CMD")


@extractor("landing_error", needs=NEEDS, unit="m", rests_on=rests.landing)
def landing_error(mission: Mission, args: Args) -> Value:
    """Horizontal distance at the end of the flight from where the mission ends: home, or where it lands."""
    return way.landing_error(flown_mission(mission), missing("POS"), "the mission does not say where it ends")


@extractor("waypoint_miss", needs=NEEDS, unit="m", rests_on=rests.position(EXTREME))
def waypoint_miss(mission: Mission, args: Args) -> Value:
    """The largest, over the waypoints, of the smallest horizontal distance from the waypoint: corners cut."""
    flown = flown_mission(mission)
    if isinstance(flown, Unavailable):
        return flown
    if flown.track is None or not len(flown.route):
        return missing("POS" if flown.track is None else "CMD")
    north, east = flown.track.north[:, None] - flown.route[:, 0], flown.track.east[:, None] - flown.route[:, 1]
    return float(np.hypot(north, east).min(axis=0).max())


@extractor("mission_time", needs=NEEDS, unit="s")
def mission_time(mission: Mission, args: Args) -> Value:
    """Time from arming to disarming."""
    return mission.end_s - mission.start_s if is_armed(mission) else NEVER_ARMED


@extractor("phase_time", needs=NEEDS, unit="s", args=PHASE_ARGS, rests_on=rests.heights_of_phase)
def phase_time(mission: Mission, args: Args) -> Value:
    """Duration of one completed part of the flight."""
    span = span_of_phase(mission, args)
    return span if isinstance(span, Unavailable) else span[1] - span[0]


@extractor("cruise_speed", needs=NEEDS, unit="m/s")
def cruise_speed(mission: Mission, args: Args) -> Value:
    """Length of the legs that were completed over the time for them, without the waits at their ends."""
    flown = flown_mission(mission)
    if isinstance(flown, Unavailable):
        return flown
    given = mission.shared(requested_mission)
    if isinstance(given, Unavailable):
        return given
    done = [i - 1 for name, i in flown.phases if name == "leg"]
    if not done or len(given.lengths) != len(flown.waypoints):
        return Unavailable("the flight completed no leg")
    waited_s = 0.0 if flown.drive is not None else float(given.holds_s[done].sum())
    moving_s = sum(flown.phases["leg", i + 1].duration_s for i in done) - waited_s
    length_m = float(given.lengths[done].sum())
    return length_m / moving_s if moving_s > 0 and length_m > 0 else Unavailable("the legs have no length")


@extractor("return_height", needs=NEEDS, unit="m", rests_on=rests.heights_of_phase)
def return_height(mission: Mission, args: Args) -> Value:
    """The greatest height above home on the way back."""
    return way.return_height(flown_mission(mission), missing("POS"))


@extractor("distance", needs=NEEDS, unit="m", rests_on=rests.position(SUM))
def distance(mission: Mission, args: Args) -> Value:
    """Length of the way over ground while airborne; of a rover, in its mission."""
    flown = flown_mission(mission)
    if isinstance(flown, Unavailable):
        return flown
    if flown.track is None:
        return missing("POS")
    steps = np.hypot(np.diff(flown.track.north), np.diff(flown.track.east))
    return float(steps[flown.under_way(flown.track.t)[1:]].sum())


@extractor(
    "path_error",
    needs=NEEDS,
    unit="m",
    args={"stat": one_of("max or mean", "max", "mean")},
    rests_on=rests.position(EXTREME),
)
def path_error(mission: Mission, args: Args) -> Value:
    """Horizontal distance from the legs (home, waypoints, home if it returns) while airborne, or in a rover's
    mission."""
    flown = flown_mission(mission)
    if isinstance(flown, Unavailable):
        return flown
    if flown.track is None or not len(flown.corners):
        return missing("POS" if flown.track is None else "CMD")
    errors = flown.path_errors()
    if flown.curved and not len(errors):
        return Unavailable("the mission asks for curves alone, and no straight leg was flown")
    return statistic(errors, str(args.get("stat", "max")))
