"""Whether a PX4 flight did what it set out to do, and the events that speak against it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.coverage import SUM, Samples
from care_core.ecosystems.measures import Args, Mission, extractor, has, one_of
from care_core.ecosystems.px4 import failsafes, upset
from care_core.ecosystems.px4.flight import BY_STICK, MESSAGES, RESULT, STATUS
from care_core.ecosystems.px4.flown_mission import mission_outcome
from care_core.ecosystems.px4.measures.flown import NEEDS, flown_mission, is_armed
from care_core.ecosystems.px4.measures.requested import flight_of
from care_core.ecosystems.px4.measures.route import landing_error
from care_core.ecosystems.vehicles import mode_name, way_of
from care_core.ecosystems.vehicles.arming import CUT, NEVER_ARMED
from care_core.logs.base import Wanted, merge_needs
from care_core.run import Unavailable, Value, is_known
from care_core.text import log_time

TOLERANCE_M = 5.0
PLACE_M = 5.0
"""Within it a vehicle stays where it is: wind moves one that hovers."""
STRANDED_S = 60.0
TAKEOFF_S = 120.0
"""Longer than any take-off takes: the mission does not go on."""

_EVENTS: Wanted = merge_needs((
    NEEDS, upset.READS, failsafes.READS, {MESSAGES: ("message",)},
))  # fmt: skip


def everything(mission: Mission, args: Args) -> Iterator[Samples]:
    """Whatever comes steadily: where nothing of it was recorded, no event was either."""
    streams = [table.t for topic, table in mission.tables.items() if topic not in (MESSAGES, RESULT)]
    if streams:
        yield Samples("the flight", np.concatenate(streams), [(mission.start_s, mission.end_s)], SUM)


def failsafe_s(mission: Mission) -> float | None:
    """When a failsafe first acted in the mission, None where none did."""
    return flight_of(mission).first_s(STATUS, "failsafe", 1, (mission.start_s, mission.end_s))


def left_s(mission: Mission) -> float | None:
    """When a failsafe took the vehicle off the mission that it was flying, None where none did."""
    return failsafe_s(mission) if flew_automatically(mission) else None


def reasons_of_failsafe(mission: Mission) -> tuple[str, ...]:
    """What the failsafes that acted were about."""
    acted_s = failsafe_s(mission)
    if acted_s is None:
        return ()
    return failsafes.reasons(flight_of(mission), acted_s)


def lost_s(mission: Mission) -> float | None:
    """When control was lost or the vehicle hit the ground in the mission, None where neither happened."""
    flight = flight_of(mission)
    hit, lost = upset.hit(flight), upset.lost_control(flight)
    times = [one.time_s for one in (hit, lost) if one is not None]
    return next((t for t in sorted(times) if mission.start_s <= t <= mission.end_s + 1.0), None)


def halted(mission: Mission) -> tuple[float, str] | None:
    """Since when a mission in force does not go on to the end of the log, in seconds of the log, and how, in words:
    its take-off is not over, or the vehicle stays in one place beyond the longest wait that was asked for."""
    flight, flown = flight_of(mission), flown_mission(mission)
    modes = [(t, mode) for t, mode in flight.modes if t <= mission.end_s]
    if mission.ended or isinstance(flown, Unavailable) or not modes or way_of("px4", modes[-1][1]) != "mission":
        return None
    begun_s = max(mission.start_s, modes[-1][0])
    if not flown.places and mission.end_s - begun_s >= TAKEOFF_S:
        return begun_s, f"its take-off was not over after {mission.end_s - begun_s:.0f} s"
    track = None if flown.track is None else flown.track.between(mission.start_s, mission.end_s)
    if track is None:
        return None
    places = np.column_stack((track.north, track.east, track.height))
    away_s = track.t[np.linalg.norm(places - places[-1], axis=1) > PLACE_M]
    since_s = max([begun_s, *away_s[-1:].tolist()])
    wait_s = STRANDED_S + max((item.hold_s for item in flown.places.values()), default=0.0)
    stays = float(track.t[-1]) - since_s >= wait_s
    return (since_s, f"it stayed where it was from {log_time(since_s)} on") if stays else None


def flew_automatically(mission: Mission) -> bool:
    """Whether the mode that flies missions was in force."""
    modes = flight_of(mission).modes_during((mission.start_s, mission.end_s))
    return any(way_of("px4", mode) == "mission" for mode in modes)


@extractor("px4_mission_success", needs=_EVENTS, unit="")
def mission_success(mission: Mission, args: Args) -> Value:
    """1 when every waypoint was reached, the vehicle landed where the mission ends (within `tolerance_m` of it) and
    disarmed, with no loss of control, no hard contact and no failsafe; else 0. A refused arming is 0, and so is a
    mission in force that does not go on."""
    if not is_armed(mission):
        return 0.0
    if not flew_automatically(mission):
        return Unavailable("no mission was flown")
    if any(one(mission) is not None for one in (lost_s, failsafe_s, halted)):
        return 0.0
    return _flown_whole(mission) if mission.ended else CUT


def _flown_whole(mission: Mission) -> Value:
    """1 where all waypoints were reached and it came down where the mission ends."""
    flown = flown_mission(mission)
    if isinstance(flown, Unavailable):
        return flown
    if not has(mission.table(RESULT), "seq_reached"):
        return Unavailable("the log does not say which items were reached", f"record {RESULT}", RESULT)
    if not flown.all_reached:
        flight, span = flight_of(mission), (mission.start_s, mission.end_s)
        last = next(reversed(flight.modes_during(span)), None)
        if last in BY_STICK:  # what somebody broke off did not fail
            return Unavailable(f"the mission was not flown to its end, the last mode was {mode_name('px4', last)}")
        return mission_outcome(flight, span) if flown.items is None else 0.0
    off_m = landing_error(mission, {})
    if flown.end is None:
        return 1.0
    return float(off_m <= float(mission.spec.get("tolerance_m", TOLERANCE_M))) if is_known(off_m) else off_m


_ABOUT = one_of(", ".join(failsafes.REASONS), *failsafes.REASONS)


@extractor("px4_failsafe", needs=_EVENTS, unit="", args={"about": _ABOUT}, rests_on=everything)
def failsafe(mission: Mission, args: Args) -> Value:
    """1 when a failsafe acted in flight, of what `about` names or of any kind, else 0."""
    if not is_armed(mission):
        return NEVER_ARMED
    about = str(args.get("about", ""))
    return float(about in reasons_of_failsafe(mission) if about else failsafe_s(mission) is not None)


@extractor("px4_lost", needs=_EVENTS, unit="", rests_on=everything)
def lost(mission: Mission, args: Args) -> Value:
    """1 when control was lost in the air, or the vehicle hit the ground at speed, else 0."""
    return float(lost_s(mission) is not None) if is_armed(mission) else NEVER_ARMED


@extractor("px4_arming_refused", needs=_EVENTS, unit="")
def arming_refused(mission: Mission, args: Args) -> Value:
    """1 when arming was refused to the end of the log, else 0."""
    return float(not is_armed(mission))


@extractor("px4_mission_broken_off", needs=_EVENTS, unit="")
def mission_broken_off(mission: Mission, args: Args) -> Value:
    """1 when the vehicle left the mode that flies missions before all waypoints were reached, else 0."""
    flown = flown_mission(mission)
    if isinstance(flown, Unavailable):
        return flown
    modes = flight_of(mission).modes_during((mission.start_s, mission.end_s))
    return float(not flown.all_reached and bool(modes) and way_of("px4", modes[-1]) != "mission")
