"""A QuadPlane that takes too long to go over from hover to its wings, or never does.

It speeds up until it flies by its wing, then lets the lift motors fade for Q_TRANSITION_MS: simulated flights that were
set as shipped took 9 to 11 s, 5 s of it fading.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.ardupilot.texts import mission_item
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.logs.base import Wanted
from care_core.text import log_time

READS: Wanted = {}

LIMITS = Limits()
_SPEEDS_UP_S = LIMITS.add("time to speed up, beside Q_TRANSITION_MS", 15.0, "s", "a choice: three times the usual")
_WEAK_P = LIMITS.add("probability of a part", 0.35, "", "a choice: limits of throttle and airspeed slow it as well")
_NEVER = LIMITS.add("times that limit, to the end of its flight", 3.0, "", "a choice: what can do it has done it")
_NEVER_P = LIMITS.add("probability of a part then", 0.6, "", "a choice: THR_MAX may keep its engine down as well")
_FADES_MS = 5000.0
"""Q_TRANSITION_MS as shipped (ArduPlane/quadplane.cpp)."""
_BEGINS, _DONE = re.compile(r"Transition started"), re.compile(r"Transition (?:FW )?done")
_FAILED = re.compile(r"Transition failed", re.IGNORECASE)


def find(flight: Flight) -> Iterator[Finding]:
    """The first transition of each flight that took too long; what flew on to a waypoint has gone over to its wings."""
    if flight.kind != "quadplane":
        return
    fades = flight.setting("Q_TRANSITION_MS")
    limit_s = (_FADES_MS if fades is None else fades) / 1000 + _SPEEDS_UP_S
    for span in flight.armed:
        told = flight.messages_between(*span)
        start = next((t for t, text in told if _BEGINS.match(text)), None)
        if start is None:
            continue
        broken_off = next((mode.start_s for mode in flight.modes if start < mode.start_s < span[1]), span[1])
        over = next((t for t, text in told if t > start and (_DONE.match(text) or _is_under_way(text))), broken_off)
        never = over == span[1] and over - start > _NEVER * limit_s
        gave_up = any(start < t <= over and _FAILED.match(text) for t, text in told)
        if over - start > limit_s or gave_up:
            yield Finding(
                kind="thrust",
                title="it never went over to its wings" if never else "the transition to the wings takes too long",
                onset_s=start,
                end_s=over,
                severity="critical" if never else "warning",
                evidence=(
                    f"{over - start:.0f} s from {log_time(start, 0)} on (limit {limit_s:.0f}: Q_TRANSITION_MS and "
                    f"{_SPEEDS_UP_S:g} s to speed up)" + ("; the vehicle says that it failed" if gave_up else "")
                ),
                source="MSG: Transition started, done",
                probability=_NEVER_P if never else _WEAK_P,
            )
            return


def _is_under_way(text: str) -> bool:
    item = mission_item(text)
    return item is not None and item[1] == "reached"


CHECK = Check("transition", "a QuadPlane that takes too long to go over to its wings", READS, LIMITS, find)
