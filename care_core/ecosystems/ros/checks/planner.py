"""The planner: no path, no command, or only turning to and fro with a goal ahead."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.findings import Finding
from care_core.ecosystems.ros.action_goals import Goal
from care_core.ecosystems.ros.recording import ERROR, WARN, Recording, Said, stretches

FAILS = re.compile(
    r"failed to (produce|find|get|make|create|generate) .*(path|plan|control)|failed to make progress"
    r"|no valid (trajector|control|path)|no path found|rotation cmd in collision|unable to (find|compute|make) a"
    r"|off the (global )?costmap|collision ahead|robot (is )?oscillating|aborting because"
    r"|valid (plan|control) could not be found|exceeded max retries|controller patience exceeded"
    r"|planning algorithm .* failed",
    re.IGNORECASE,
)
"""What move_base, its planners, move_base_flex and Nav2's servers say when they find no way."""
OFTEN = 10
"""A planner that complains less often, and whose goals were reached, found its way."""
STANDS_S = 15.0
"""So long without way, with a goal ahead, while the commands themselves ask for none: move_base's oscillation_timeout
and Nav2's progress checker (movement_time_allowance) wait 10 s."""
WAY_M = 0.3


def check(recording: Recording) -> Iterator[Finding]:
    yield from _fails(recording)
    yield from _dithers(recording)


def _fails(recording: Recording) -> Iterator[Finding]:
    words = [one for one in recording.said if one.level >= WARN and FAILS.search(one.text)]
    failed = any(goal.failed for goal in recording.goals)
    if not words or (recording.goals and not failed and len(words) < OFTEN):
        return
    if not recording.goals and len(words) < OFTEN and words[0].level < ERROR:
        return
    at = _beginning(words, recording.goals)
    told = Counter(one.text for one in words).most_common(1)[0][0]
    often = "message" if len(words) == 1 else "messages, most often"
    yield Finding(
        "planner", "the planner finds no way", at, words[-1].time_s, recording.severity(at),
        f'{len(words)} {often} "{told[:90]}"', f"{words[0].node} in /rosout", "parameter", 0.4,
    )  # fmt: skip


def _beginning(words: list[Said], goals: tuple[Goal, ...]) -> float:
    """The first message on the first goal that failed: a planner may complain on the way to a goal that it reaches."""
    for goal in goals:
        own = [one.time_s for one in words if goal.sent_s <= one.time_s <= goal.end_s]
        if goal.failed and own:
            return own[0]
    return words[0].time_s


def _dithers(recording: Recording) -> Iterator[Finding]:
    """Goals on which the robot makes no way because its commands ask for none."""
    odometry, commands = recording.odometry, recording.commands
    if odometry is None or commands is None:
        return
    for goal in recording.goals:
        if not goal.failed:
            continue
        inside = (odometry.t >= goal.sent_s) & (odometry.t <= goal.end_s)
        t, x, y = odometry.t[inside], odometry.x[inside], odometry.y[inside]
        if len(t) < 5:
            continue
        later = np.minimum(np.searchsorted(t, t + STANDS_S), len(t) - 1)
        stays = (np.hypot(x[later] - x, y[later] - y) < WAY_M) & (t[later] - t > 0.8 * STANDS_S)
        still = [one for one in stretches(t, stays, 2.0) if one[1] > one[0]]
        if not still:
            continue
        start, end = still[0][0], min(still[-1][1] + STANDS_S, goal.end_s)
        asked = (commands.t >= start) & (commands.t <= end)
        forward = np.abs(commands.speed[asked]) >= 0.08
        if np.count_nonzero(asked) >= 5 and float(forward.mean()) < 0.3:
            turns = np.abs(commands.turn[asked]) >= 0.05
            doing = "to turn to and fro" if float((turns & ~forward).mean()) > 0.5 else "to stand"
            yield Finding(
                "planner", f"the planner makes no way: it asks {doing}", start, end, recording.severity(start),
                f"under {WAY_M} m of way in {end - start:.0f} s, {1 - forward.mean():.0%} of the commands ask for none",
                f"{commands.topic}, {odometry.topic}", "parameter", 0.6,
            )  # fmt: skip
            return
