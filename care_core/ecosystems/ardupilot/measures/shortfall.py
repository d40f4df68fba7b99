"""How an ArduPilot run fell short of what it set out to do, in clauses that an operator reads first."""

from __future__ import annotations

import re
from collections.abc import Iterator

from care_core.ecosystems.ardupilot.heartbeat import shown_failsafes
from care_core.ecosystems.ardupilot.measures.events import crash_of, errors, forced, refused_for, telling
from care_core.ecosystems.ardupilot.measures.flown_mission import analyse
from care_core.ecosystems.ardupilot.measures.modes import flight_of, is_armed
from care_core.ecosystems.ardupilot.measures.requested import trails_m
from care_core.ecosystems.ardupilot.measures.route import landing_error
from care_core.ecosystems.measures import Mission
from care_core.ecosystems.vehicles import error_kind as kind_of_error
from care_core.ecosystems.vehicles import error_words
from care_core.run import is_known
from care_core.text import log_time, shortened

WAYPOINT_TOLERANCE_M = 5.0
_FAILSAFE_OF = re.compile(r"battery|radio|throttle|GCS|EKF|terrain|fence|leak|GPS|vibration", re.IGNORECASE)
"""What a failsafe's message speaks of."""
_BEGUN_S, _AT_ONCE_S = 1.0, 2.0
"""An arming so soon after the log begins may be older; a failsafe so soon after an arming was on before: BATT_LOW_TIMER
alone is 10 s."""
_VOWELS = frozenset("AEIOaeio")
_LONGEST = 60
"""Characters of a message that stands in a clause."""


def shortfall(mission: Mission) -> tuple[str, ...]:
    """What kept the mission from being accomplished: what was not reached, then what ended it, in order of time."""
    if not is_armed(mission):
        why = refused_for(mission)
        return (f"arming was refused: {why}",) if why else ("the vehicle never armed",)
    return tuple(_clauses(mission))


def _clauses(mission: Mission) -> Iterator[str]:
    flown = mission.shared(analyse)
    if flown.waypoints and flown.reached < len(flown.waypoints):
        yield short_of(mission)
    else:
        off_m = landing_error(mission, {})
        if is_known(off_m) and off_m > landing_tolerance_m(mission):
            yield f"it came down {off_m:.0f} m from where the mission ends"
        elif flown.drive is not None and not flown.completed:
            yield "it did not say that its mission is complete"
    crash = event_clause(mission, "crash") or crash_of(mission)
    yield from filter(None, (crash, event_clause(mission, "failsafe")))
    if forced(mission):
        yield f"disarmed by force at {log_time(mission.end_s)}"


def tolerance_m(mission: Mission) -> float:
    """How far a waypoint may be off."""
    return float(mission.spec.get("tolerance_m", WAYPOINT_TOLERANCE_M))


def landing_tolerance_m(mission: Mission) -> float:
    """How far from where the mission ends a landing may be."""
    return tolerance_m(mission) + trails_m(mission)


def short_of(mission: Mission) -> str:
    """How many of its waypoints a mission reached, at most where it went on from some without a word."""
    flown = mission.shared(analyse)
    if flown.untold:
        return f"at most {flown.reached + flown.untold} of {len(flown.waypoints)} waypoints were reached"
    return f"{flown.reached} of {len(flown.waypoints)} waypoints were reached"


def event_clause(mission: Mission, kind: str) -> str:
    """The first crash or failsafe that the autopilot reported, with its time; empty where it reported none. A failsafe
    that no text and no record tells of is told by the vehicle's heartbeat."""
    found = [
        (t, error_words(subsystem, code))
        for t, subsystem, code in errors(mission)
        if code and kind_of_error(subsystem) == kind
    ]
    found += [(t, _spoken(text, kind)) for t, text, known in telling(mission) if known == kind]
    if not found and kind == "failsafe":
        shown = ((start, words) for (start, _), words in shown_failsafes(flight_of(mission)))
        found = [(t, _spoken(words, kind)) for t, words in shown if mission.start_s <= t <= mission.end_s]
    if not found:
        return ""
    time_s, words = min(found, key=lambda one: one[0])
    at_once = mission.start_s > _BEGUN_S and time_s - mission.start_s < _AT_ONCE_S
    if words.endswith(" failsafe") and at_once and not _was_over(mission, kind):
        return f"it was armed with {'an' if words[0] in _VOWELS else 'a'} {words} on"
    return f"{words} at {log_time(time_s)}"


def _was_over(mission: Mission, kind: str) -> bool:
    """Whether the log records that what is of this kind had passed when the vehicle was armed."""
    records = flight_of(mission).whole.error_records
    before = [one.code for one in records if one.time_s < mission.start_s and kind_of_error(one.subsystem) == kind]
    return bool(before) and before[-1] == 0


def _spoken(text: str, kind: str) -> str:
    """A message as a clause."""
    if kind == "crash":
        return "crash detected"
    about = _FAILSAFE_OF.search(text)
    if about is None:
        return shortened(text, _LONGEST)
    return f"{about[0] if about[0].isupper() else about[0].lower()} failsafe"
