"""A mission that never began: the navigator had none that it could fly, or the vehicle was armed in its mode, on the
ground, and nothing was asked of the motors.

The navigator flies no mission that it calls finished, and none that it cannot use; the vehicle then waits on the ground
until the firmware disarms it (COM_DISARM_PRFLT). No parameter of its flight has to do with that.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import HASTY, NO_MISSION, NOT_BEGUN, Finding
from care_core.ecosystems.px4.flight import LANDED, MESSAGES, RESULT, SAID_WITHIN_S, Px4Flight
from care_core.ecosystems.spans import Span
from care_core.ecosystems.vehicles import way_of
from care_core.logs.base import Wanted
from care_core.records import replace

_THRUST, _OLD_THRUST = "vehicle_thrust_setpoint", "vehicle_attitude_setpoint"
READS: Wanted = {
    LANDED: ("landed",),
    RESULT: ("finished", "seq_reached"),
    _THRUST: ("xyz[2]",),
    _OLD_THRUST: ("thrust_body[2]",),
    MESSAGES: ("message",),
}
_NO_MISSION = re.compile(r"no valid mission available", re.IGNORECASE)
_GIVEN_UP = re.compile(r"auto preflight disarm", re.IGNORECASE)
_GIVES_UP_AFTER, _SPOOLS_FOR = "COM_DISARM_PRFLT", "COM_SPOOLUP_TIME"
LIMITS = Limits()
_IDLES = LIMITS.add("thrust that is asked for on the ground", 0.1, "", "MPC_THR_MIN is 0.12 as shipped")
_WAITS_S = LIMITS.add("shortest time armed", 3.0, "s", "a choice: COM_SPOOLUP_TIME is 1 s as shipped, and margin")
_SURE_P = LIMITS.add("probability that it was not begun", 0.9, "", "nothing was asked of the motors")


def find(flight: Px4Flight) -> Iterator[Finding]:
    """One finding for the first time that it was armed for a mission and flew none of it."""
    for span in flight.armed if flight.hovers else ():
        found = _refused(flight, span) or _waited(flight, span)
        if found is not None:
            yield found
            return


def _waited(flight: Px4Flight, span: Span) -> Finding | None:
    """A mission that was last in force, on the ground: without thrust, or so late that the firmware gave up at once."""
    given_up = any(_GIVEN_UP.search(text) for t, _, text in flight.messages if abs(t - span[1]) < SAID_WITHIN_S)
    if given_up and (hasty := _hasty(flight, span)) is not None:
        return hasty
    modes = flight.modes_during(span)
    stays = flight.during(LANDED, "landed", span) is not None and not flight.ever(LANDED, "landed", 0, span)
    if not stays or not modes or way_of("px4", modes[-1]) != "mission" or span[1] - span[0] < _WAITS_S:
        return None
    asked = _most_asked(flight, span)
    begun_s = max(t for t, _ in flight.modes if t <= span[1])
    is_late = given_up and begun_s > span[1] - _WAITS_S
    if not is_late and (asked is None or asked >= _IDLES):
        return None
    why = "the firmware gave up before it could begin" if is_late else "no thrust was asked for"
    done = flight.ever(RESULT, "finished", 1, span) and not flight.at_least(RESULT, "seq_reached", 0, span)
    again = "; the navigator calls the mission finished: upload it again, or start it anew" if done else ""
    evidence = f"armed for {span[1] - span[0]:.0f} s on the ground, at last in mode Mission: {why}{again}"
    return _finding(NOT_BEGUN, span, evidence, f"{LANDED}, {_THRUST}, {RESULT}, {MESSAGES}")


def _hasty(flight: Px4Flight, span: Span) -> Finding | None:
    """The firmware gave up while the motors were still to spool up, by how it was set."""
    waits_s, spools_s = flight.parameter(_GIVES_UP_AFTER), flight.parameter(_SPOOLS_FOR)
    if waits_s is None or spools_s is None or not 0 < waits_s <= spools_s:
        return None
    named = [name for name in (_SPOOLS_FOR, _GIVES_UP_AFTER) if flight.off_default(name) is not None]
    evidence = (
        f"armed for {span[1] - span[0]:.1f} s: {_SPOOLS_FOR} is {spools_s:g} s, and {_GIVES_UP_AFTER} {waits_s:g} s, "
        "after which the firmware disarms what has not taken off"
    )
    found = _finding(HASTY, span, evidence, f"{MESSAGES}, parameters")
    return replace(found, suspect="parameter", parameters=tuple(named) or (_SPOOLS_FOR, _GIVES_UP_AFTER))


def _refused(flight: Px4Flight, span: Span) -> Finding | None:
    """A mission that the navigator does not fly, by its own words, and of which no item was ever reached."""
    said = ((t, text) for t, _, text in flight.messages if span[0] <= t <= span[1] and _NO_MISSION.search(text))
    first = next(said, None)
    if first is None or flight.at_least(RESULT, "seq_reached", 0, span):
        return None
    evidence = f"the firmware says: {first[1]}; upload the mission again, or start it anew"
    return _finding(NO_MISSION, (first[0], span[1]), evidence, f"{MESSAGES}, {RESULT}")


def _finding(title: str, span: Span, evidence: str, source: str) -> Finding:
    return Finding(
        kind="software",
        title=title,
        onset_s=span[0],
        end_s=span[1],
        severity="critical",
        evidence=evidence,
        source=source,
        suspect="operation",
        probability=_SURE_P,
    )


def _most_asked(flight: Px4Flight, span: Span) -> float | None:
    """The most lift (0 to 1) that was asked for in a span; None where the log does not say."""
    for topic, field in ((_THRUST, "xyz[2]"), (_OLD_THRUST, "thrust_body[2]")):
        table = flight.during(topic, field, span)
        if table is not None and np.isfinite(table[field]).any():
            return float(np.nanmax(-table[field]))
    return None


CHECK = Check("idle", "a mission that never began, though the vehicle was armed for it", READS, LIMITS, find)
