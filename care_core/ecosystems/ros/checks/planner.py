"""Planner and controller: no path, no command, or only turning to and fro with a goal ahead."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding, FindingKind
from care_core.ecosystems.ros.drive import Drive
from care_core.ecosystems.ros.goals import Goal
from care_core.ecosystems.ros.messages import COMMANDS, GOALS, ODOMETRY, ROSOUT, reading
from care_core.ecosystems.ros.motion import BREAKS_LOOSE_MPS, STANDS_RADPS, Commands, Odometry
from care_core.ecosystems.ros.node_messages import Level, LogMessage
from care_core.ecosystems.spans import stretches
from care_core.text import shortened

FAILS = re.compile(
    r"failed to (produce|find|get|make|create|generate) .*(path|plan|control)|failed to make progress"
    r"|no valid (trajector|control|path)|no path found|rotation cmd in collision|unable to (find|compute|make) a"
    r"|off the (global )?costmap|collision ahead|robot (is )?oscillating|aborting because"
    r"|valid (plan|control) could not be found|exceeded max retries|controller patience exceeded"
    r"|planning algorithm .* failed",
    re.IGNORECASE,
)
"""What move_base, its planners, move_base_flex and Nav2's servers say when they find no way."""
_OF_CONTROLLER = re.compile(
    r"make progress|follow_path|patience|control\b|controller|trajector|dwa|local.?planner|teb\b|rotation cmd|rotating"
    r"|collision ahead|oscillating",
    re.IGNORECASE,
)
"""Which of these messages are the controller's, that follows a path: where it fails, the planner did find one."""

LIMITS = Limits()
OFTEN = LIMITS.add("complaints", 10, "", "with fewer, and its goals reached, a planner found a way")
STUCK_S = LIMITS.add(
    "time without way while commands ask for none", 15.0, "s",
    "move_base's oscillation_timeout and Nav2's movement_time_allowance are 10 s",
)  # fmt: skip
STUCK_M = LIMITS.add("way in that time", 0.3, "m", "less than Nav2's required_movement_radius, 0.5 m")
COVERED = LIMITS.add("share of that time that samples cover", 0.8, "", "over less nobody knows where the robot was")
BREAK_S = LIMITS.add("break in which the robot moves a little", 2.0, "s", "a shorter one is no way made")
FORWARD = LIMITS.add("share of commands to move forward", 0.3, "", "with more of them the robot does not obey")
TURNING = LIMITS.add("share of commands to turn", 0.5, "", "most of what the controller asks for")
FEWEST = LIMITS.add("commands in that time", 5, "", "fewer tell nothing of a controller")
SAMPLES = LIMITS.add("samples of odometry on a goal", 5, "", "fewer tell of no way")


def find(drive: Drive) -> Iterator[Finding]:
    """Messages that no path is found or followed, and goals on which the controller is stuck."""
    said = [one for one in drive.log_messages if one.level >= Level.WARN and FAILS.search(one.text)]
    yield from _fails(drive, [one for one in said if not _is_controllers(one)], "planner", "the planner finds no path")
    controllers = [one for one in said if _is_controllers(one)]
    yield from _fails(drive, controllers, "control", "the controller makes no progress on its path")
    yield from _stuck(drive)


def _is_controllers(message: LogMessage) -> bool:
    return "controller" in message.node or _OF_CONTROLLER.search(message.text) is not None


def _fails(drive: Drive, complaints: list[LogMessage], kind: FindingKind, title: str) -> Iterator[Finding]:
    failed = any(goal.failed for goal in drive.goals)
    if not complaints or (drive.goals and not failed and len(complaints) < OFTEN):
        return
    if not drive.goals and len(complaints) < OFTEN and complaints[0].level < Level.ERROR:
        return
    at = _beginning(complaints, drive.goals)
    text = Counter(message.text for message in complaints).most_common(1)[0][0]
    often = "message" if len(complaints) == 1 else "messages, most often"
    yield Finding(
        kind=kind,
        title=title,
        onset_s=at,
        end_s=complaints[-1].time_s,
        severity=drive.severity(at),
        evidence=f'{len(complaints)} {often} "{shortened(text, 90)}"',
        source=f"{complaints[0].node} in /rosout",
        suspect="parameter",
        probability=0.4,
    )


def _beginning(complaints: list[LogMessage], goals: tuple[Goal, ...]) -> float:
    """The first message on the first goal that failed: a planner may complain on the way to a goal that it reaches."""
    for goal in goals:
        times = [message.time_s for message in complaints if goal.sent_s <= message.time_s <= goal.end_s]
        if goal.failed and times:
            return times[0]
    return complaints[0].time_s


def _stuck(drive: Drive) -> Iterator[Finding]:
    """The first goal on which the robot gets nowhere because its commands ask for no forward motion."""
    odometry, commands = drive.odometry, drive.commands
    if odometry is None or commands is None:
        return
    for goal in drive.goals:
        span = _nowhere(odometry, goal) if goal.failed else None
        shares = None if span is None else _commanded(commands, *span)
        if span is None or shares is None or shares[0] >= FORWARD:
            continue
        forward, turns = shares
        yield Finding(
            kind="control",
            title=f"the controller is stuck: {'it turns to and fro' if turns > TURNING else 'it commands no motion'}",
            onset_s=span[0],
            end_s=span[1],
            severity=drive.severity(span[0]),
            evidence=f"less than {STUCK_M} m in {span[1] - span[0]:.0f} s, {1 - forward:.0%} of its commands ask for no"
            " forward motion",
            source=f"{commands.topic}, {odometry.topic}",
            suspect="parameter",
            probability=0.6,
        )
        return


def _nowhere(odometry: Odometry, goal: Goal) -> tuple[float, float] | None:
    """From when to when the robot got nowhere on a goal; None where it made way."""
    inside = (odometry.t >= goal.sent_s) & (odometry.t <= goal.end_s)
    t, x, y = odometry.t[inside], odometry.x[inside], odometry.y[inside]
    if len(t) < SAMPLES:
        return None
    later = np.minimum(np.searchsorted(t, t + STUCK_S), len(t) - 1)
    stays = (np.hypot(x[later] - x, y[later] - y) < STUCK_M) & (t[later] - t > COVERED * STUCK_S)
    still = [(first, last) for first, last in stretches(t, stays, BREAK_S) if last > first]
    return (still[0][0], min(still[-1][1] + STUCK_S, goal.end_s)) if still else None


def _commanded(commands: Commands, start_s: float, end_s: float) -> tuple[float, float] | None:
    """Shares of the commands of a time that ask to move forward, and to turn on the spot; None: hardly any came."""
    inside = (commands.t >= start_s) & (commands.t <= end_s)
    if np.count_nonzero(inside) < FEWEST:
        return None
    forward = np.abs(commands.speed[inside]) >= BREAKS_LOOSE_MPS
    turns = np.abs(commands.turn[inside]) >= STANDS_RADPS
    return float(forward.mean()), float((turns & ~forward).mean())


READS = reading(*ROSOUT, ODOMETRY, *COMMANDS, *GOALS)
CHECK = Check("planner", "a planner that finds no path, a controller that makes no progress", READS, LIMITS, find)
