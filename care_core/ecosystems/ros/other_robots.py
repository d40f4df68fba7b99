"""What is said of robots that were recorded beside the one that findings are of."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from care_core.ecosystems.findings import Event, Finding
from care_core.ecosystems.ros.drive import OPEN_S, Drive
from care_core.ecosystems.ros.goals import Goal
from care_core.ecosystems.ros.messages import GOALS, reading
from care_core.records import replace

READS = reading(*GOALS)
_SOURCE = "name spaces of the topics"


def other_robots(drive: Drive, found: Iterable[tuple[Drive, Sequence[Finding]]]) -> Iterator[Finding]:
    """What another robot failed in, else that it is there.

    Args:
        found: the other robots with what their checks found.
    """
    for other, findings in found:
        name = other.robots[0]
        failed = [*_missed(other), *(one for one in findings if one.severity == "critical")]
        for one in failed:
            # A symptom by its kind: what is wrong with one robot explains nothing of another.
            title = f"{_called(name)}, in the same recording: {one.title}"
            yield replace(one, kind="log", title=title, consequences=())
        if not failed:
            reached = sum(goal.outcome == "reached" for goal in other.goals)
            yield Finding(
                kind="log",
                title=f"{_called(name)} is in this recording, too: this answer is of {_called(drive.robots[0])}",
                onset_s=0.0,
                end_s=drive.duration_s,
                severity="info",
                evidence=f"{reached} of its {len(other.goals)} goals were reached"
                if other.goals
                else "it has no goals",
                source=_SOURCE,
                suspect="operation",
            )


def other_goals(drive: Drive) -> Iterator[Event]:
    """How the goals of the other robots ended."""
    for other in drive.others:
        for number, goal in enumerate(other.goals, start=1):
            yield Event(goal.end_s, "goal", f"{_called(other.robots[0])}: goal {number} {_ended(goal)}", goal.action)


def _missed(drive: Drive) -> Iterator[Finding]:
    missed = [goal for goal in drive.goals if goal.failed or (not goal.outcome and goal.time_s > OPEN_S)]
    if missed:
        which = "its goal was" if len(drive.goals) == 1 else f"{len(missed)} of its {len(drive.goals)} goals were"
        yield Finding(
            kind="planner",
            title=f"{which} not reached",
            onset_s=missed[0].end_s,
            end_s=drive.duration_s,
            severity="critical",
            evidence=_ended(missed[0]),
            source=_SOURCE,
            suspect="operation",
        )


def _ended(goal: Goal) -> str:
    return f"{goal.outcome or 'still open'} after {goal.time_s:.0f} s"


def _called(namespace: str) -> str:
    return f"robot {namespace}" if namespace else "the robot without a name space"
