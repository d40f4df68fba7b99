"""Parts that failed and come before any parameter, and findings that speak of how the robot was set.

Needs nothing that is slow to import.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence

from care_core.diagnose.estimates import MISSION_LOST_INFO
from care_core.diagnose.remedies import CHARGE
from care_core.ecosystems.findings import (
    BY_STICK,
    CAME_DOWN,
    HASTY,
    NO_MISSION,
    NOT_BEGUN,
    OF_MONITOR,
    OWN_SUPPLY,
    UNCHARGED,
    UNPOWERED,
    Finding,
    every_finding,
)
from care_core.ecosystems.ranking import LIKELY
from care_core.run import Run
from care_core.text import log_time

_REACHED = "waypoints_reached"
"""The metric of the waypoints that a run came to, in profiles of vehicles."""
OUTLASTED = "the flight outlasted its battery"
"""What explains a failsafe of the battery that is all that went wrong."""
LATE_S = 5.0
"""Seconds after a sign of how the robot was set from which what fails may be of that."""
SENSED = frozenset(("barometer", "compass", "gps", "vibration"))
"""Kinds that no setting brings about: on the training flights all 10 that came as critical after a sign of how the
vehicle was set have that part failing."""
_VOLTAGE = re.compile(r"batter|voltage", re.IGNORECASE)
_SET_APART = re.compile(r"critical\s*>=|failsafe critical|capacity", re.IGNORECASE)
"""A refusal for how two failsafes were set, whatever the voltage."""


def was_refused(findings: Iterable[Finding]) -> bool:
    """Whether it never armed, by what was found or by what that led to."""
    return any(one.kind == "prearm" for one in every_finding(findings))


def is_ahead(run: Run, findings: Iterable[Finding]) -> bool:
    """Whether the whole mission is still before a vehicle: it was refused, or reached nothing of it."""
    return was_refused(findings) or run.metrics.get(_REACHED) == 0.0


def never_flew(findings: Iterable[Finding]) -> bool:
    """Whether it never left the ground, for a reason that no parameter of its flight has: it was refused, its motors
    got no power, or nothing told it to lift."""
    found = tuple(every_finding(findings))
    return was_refused(found) or any(
        one.title in (HASTY, NO_MISSION, NOT_BEGUN, UNPOWERED) and one.severity == "critical" for one in found
    )


def set_wrong(finding: Finding) -> bool:
    """Whether a finding speaks of how the robot was set, while it still explains anything."""
    return finding.suspect == "parameter" and not finding.after_impact and finding.severity != "info"


def is_late(finding: Finding, by_setting: Iterable[Finding]) -> bool:
    """Whether the run was failing already, by a sign about as sure as this one. What senses does not fail of that."""
    if finding.kind in SENSED:
        return False
    sure = min(finding.probability, LIKELY)
    return any(one.onset_s + LATE_S < finding.onset_s and one.probability >= sure for one in by_setting)


def mend_first(findings: Sequence[Finding]) -> Finding | None:
    """The part that comes before any parameter, None where no such part failed.

    That is one that surely failed and mattered, a motor or thrust at its limit, what could not rise again, and a
    battery that was not charged or kept the vehicle from arming; but for what a sign of how the vehicle was set led to.
    """
    by_setting = [one for one in findings if set_wrong(one)]
    is_shown = any(one.severity == "critical" and one.parameters for one in by_setting)
    stopping = (one for one in _unexplained(findings) if _stops(one) and not (is_shown and _only_not_full(one)))
    return next((one for one in stopping if one.probability >= LIKELY or not is_late(one, by_setting)), None)


def _only_not_full(finding: Finding) -> bool:
    """Whether it is a battery that was flown with less than a full charge, and held: beside a parameter that was wrong
    in itself it is no matter."""
    return finding.title == UNCHARGED and finding.severity != "critical"


def _unexplained(findings: Sequence[Finding]) -> Iterator[Finding]:
    """The findings, and what those led to that speak of no parameter."""
    for one in findings:
        yield one
        if not set_wrong(one):
            yield from one.below


def _stops(finding: Finding) -> bool:
    if finding.kind == "prearm":
        return bool(_VOLTAGE.search(finding.title)) and not _SET_APART.search(finding.title)
    if finding.after_impact or finding.severity == "info" or finding.suspect in ("parameter", "world"):
        return False
    is_sure = finding.probability >= LIKELY
    if finding.title == UNCHARGED:
        return is_sure
    if finding.mission_lost is not None and finding.mission_lost <= MISSION_LOST_INFO.value:
        return False
    at_limit = finding.kind in ("motor", "thrust") or finding.title == CAME_DOWN
    return finding.severity == "critical" and (is_sure or at_limit)


def is_pack(part: Finding) -> bool:
    """Whether a part that failed is the battery itself, which is charged or replaced."""
    return part.kind in ("battery", "prearm") and not part.title.startswith((OWN_SUPPLY, *OF_MONITOR))


def unmended(part: Finding, then: str = "") -> str:
    """Why no parameter is changed while this part has failed.

    Args:
        then: what is likelier than the part, and changed once it is mended.
    """
    if is_pack(part):
        return f"{part.title}: {CHARGE}; nothing is changed until it is full"
    if part.title in BY_STICK:
        return f"{part.title} at {log_time(part.onset_s)}: no parameter is changed for how it was steered"
    if then:
        return f"{part.title} at {log_time(part.onset_s)}: mend that first; {then}"
    return f"{part.title} at {log_time(part.onset_s)}: nothing is changed until that is mended"
