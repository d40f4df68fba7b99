"""A run as what was found in its log has it, before it is judged.

An autopilot that hit the ground may report no crash, and a land detector takes a wreck for a landing. What the log
shows counts: no objective is met that a finding contradicts.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

from care_core.ecosystems.findings import Finding, FindingKind, every_finding
from care_core.logs.formats import format_named
from care_core.records import replace
from care_core.run import OutcomeCheck, Run, Unavailable, is_known
from care_core.text import log_time

DOWN: frozenset[FindingKind] = frozenset(("crash", "takeoff"))
"""What ends a flight on the ground against its will."""
SAID_AFTER_S = 5.0
"""An impact so shortly after the disarming belongs to the flight before it."""
_FAILED = frozenset(("no_crash", "mission_success"))


def as_found(run: Run, findings: Sequence[Finding], accomplished: Collection[str] = ()) -> Run:
    """The run with a crash that was found in it counted as one.

    Args:
        accomplished: the objectives that say whether the mission was accomplished.
    """
    crash = _crash_of(run, findings)
    if crash is None:
        return run
    how = f"{crash.title} at {log_time(crash.onset_s)}"
    met = [name for name, value in run.objectives.items() if value == 1.0 and name in accomplished]
    return replace(
        run,
        mission=replace(run.mission, ended=True),
        objectives={**run.objectives, **dict.fromkeys(met, 0.0)},
        shortfall=_with_crash(run.shortfall, how),
        checks=tuple(_contradicted(check, crash.title, how) for check in run.checks),
    )


def _with_crash(shortfall: tuple[str, ...], how: str) -> tuple[str, ...]:
    """What was not reached, then the crash, unless it is told already, then what followed."""
    if any("crash" in one or "hit" in one for one in shortfall):
        return shortfall
    return (*shortfall[:1], how, *shortfall[1:])


def _crash_of(run: Run, findings: Sequence[Finding]) -> Finding | None:
    """The first crash of this run: of a vehicle, for a robot that hit something may reach its goals all the same."""
    if format_named(run.log.format).ecosystem == "ros":
        return None
    during = (
        one
        for one in every_finding(findings)
        if one.kind in DOWN
        and one.severity == "critical"
        and run.mission.start_s <= one.onset_s <= run.mission.end_s + SAID_AFTER_S
    )
    return min(during, key=lambda one: one.onset_s, default=None)


def _contradicted(check: OutcomeCheck, title: str, how: str) -> OutcomeCheck:
    unjudged = check.name == "no_crash" and not is_known(check.value)  # of a flight that was recorded in part
    if unjudged or (check.name in _FAILED and check.value == 1.0):
        return replace(check, value=0.0, otherwise=how)
    if check.name == "landed" and is_known(check.value):
        return replace(check, value=Unavailable(title))
    return check
