"""How a PX4 flight fell short of what it set out to do, and what its firmware said of that."""

from __future__ import annotations

import re
from collections.abc import Iterator

from care_core.ecosystems.measures import Mission
from care_core.ecosystems.px4 import upset
from care_core.ecosystems.px4.failsafes import in_words
from care_core.ecosystems.px4.measures.flown import flown_mission, is_armed
from care_core.ecosystems.px4.measures.outcome import TOLERANCE_M, failsafe_s, halted, lost_s
from care_core.ecosystems.px4.measures.requested import flight_of
from care_core.ecosystems.px4.measures.route import landing_error
from care_core.run import Evidence, Unavailable, is_known
from care_core.text import log_time

_SAID = tuple(
    (re.compile(pattern, re.IGNORECASE), kind)
    for pattern, kind in (
        (r"failsafe|battery .*(low|critical|dangerous)|(low|critical|dangerous).* battery", "failsafe"),
        (r"failure detect|attitude failure|critical failure|motor failure|termination", "crash"),
        (r"geofence|mission (?:rejected|infeasible)|first waypoint", "mission"),
        (r"navigation failure|estimator|GPS|compass|mag(?:netic|netometer)|yaw reset|vertical velocity", "ekf"),
    )
)
"""Messages of a flight that speak about its failure; the first that matches counts."""


_REASONS = 3
"""As many as a report has room for: the last ones held to the end."""


def evidence(mission: Mission) -> tuple[Evidence, ...]:
    """Messages that speak about a failure of this mission, in time order."""
    flight = flight_of(mission)
    if not is_armed(mission):
        return tuple(Evidence(t, text, "refusal") for t, text in flight.refusals[-_REASONS:])
    found = []
    for t, level, text in flight.messages:
        kind = next((kind for pattern, kind in _SAID if pattern.search(text)), None)
        if kind is not None and level.casefold() != "info" and mission.start_s <= t <= mission.end_s + 1.0:
            found.append(Evidence(t, text, kind))
    return tuple(found)


def shortfall(mission: Mission) -> tuple[str, ...]:
    """What kept the mission from being accomplished: what was not reached, then what ended it."""
    return tuple(_clauses(mission))


def _clauses(mission: Mission) -> Iterator[str]:
    flight, flown = flight_of(mission), flown_mission(mission)
    if isinstance(flown, Unavailable):
        said = flight.refusals
        yield f"arming was refused: {said[-1][1]}" if said else "the vehicle never armed"
        return
    if not flown.all_reached:
        yield (
            f"{flown.reached + 1} of {flown.items} mission items were reached" if flown.items else "no item was reached"
        )
    else:
        off_m = landing_error(mission, {})
        if is_known(off_m) and off_m > float(mission.spec.get("tolerance_m", TOLERANCE_M)):
            yield f"it came down {off_m:.0f} m from where the mission ends"
    at_s, hit = lost_s(mission), upset.hit(flight)
    if at_s is not None:
        how = "it hit the ground" if hit is not None and hit.time_s == at_s else "control was lost"
        yield f"{how} at {log_time(at_s)}"
    halt = halted(mission)
    if halt is not None:
        yield halt[1]
    acted_s = failsafe_s(mission)
    if acted_s is not None:
        about = in_words(flight, acted_s)
        yield f"{f'the {about} ' if about else 'a '}failsafe acted at {log_time(acted_s)}"
