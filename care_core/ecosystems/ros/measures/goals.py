"""Missions of goals sent one after the other: how they are found, what tells them apart, what went wrong in them.

The planner says little about why it fails (a robot boxed in by its own cost weights dithers on the spot without one
warning), so the evidence holds what such a failure looks like beside what the log says. How the log tells its goals
is the goal server's own, see `window.GoalServer`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from care_core.ecosystems.base import RunModel
from care_core.ecosystems.measures import Args, Mission, MissionKind, numeric, points
from care_core.ecosystems.ros.drive import BATTERY_FIELDS, COMMAND_FIELDS, LOG_FIELDS, ODOMETRY_FIELDS, Drive
from care_core.ecosystems.ros.goals import FAILED, Goal, Status
from care_core.ecosystems.ros.measures.window import (
    TOLERANCE_M,
    ActiveCommands,
    difference,
    drive_of,
    goal_server,
    listed_goals,
    longest,
    own_goals,
    share,
    time_limit_s,
    topics,
    window,
)
from care_core.ecosystems.ros.motion import STANDS_MPS
from care_core.ecosystems.ros.node_messages import ROSOUT_TOPICS, Level, LogMessage, kept_its_rate
from care_core.logs.base import Table, Wanted
from care_core.run import Evidence, OutcomeCheck, Unavailable, Value
from care_core.text import log_time

_IDLE_S = 120.0
"""A pause this long between goals ends a mission."""

_STUCK_S = 15.0
"""A robot that stands or only swings for this long with a goal ahead is stuck."""

_MESSAGE_KINDS: tuple[tuple[re.Pattern[str], str], ...] = (
    (re.compile(r"recovery|running (spin|backup|wait|drive_on_heading)"
                r"|clearing .* costmap|clearing costmap", re.IGNORECASE), "recovery"),
    (re.compile(r"abort", re.IGNORECASE), "abort"),
    (re.compile(r"failed to (produce|find|get|make|create|generate) .*(path|plan|control)|failed to make progress"
                r"|rotation cmd in collision|error when rotating|no valid (trajector|control)|unable to|off the map"
                r"|in collision|collision ahead|oscillat", re.IGNORECASE), "planner"),
    (re.compile(r"(control|map update|planner) loop missed|sensor origin|transform", re.IGNORECASE), "timing"),
)  # fmt: skip
"""What a message of the log speaks about, first match counts."""

GOAL_ARGS: Mapping[str, str] = {
    "goals": points(
        "list of [x, y] or [x, y, heading] in m and rad, in the frame of the goals: the mission that fixed thresholds "
        "and the time of a goal belong to",
        *(2, 3),
    ),
    "goal_timeout_s": numeric(
        "time within which each goal must be reached, 60 unless given; longer where goals lie farther apart than those "
        "of the list"
    ),
    "tolerance_m": numeric("how far a goal may be from the listed one, 0.3 unless given"),
    "passages": points("list of [x, y] of narrow passages, in the frame of the odometry", 2),
    "odometry": "topic of nav_msgs/Odometry, /odom unless given",
    "commands": "topic of geometry_msgs/Twist or TwistStamped, /cmd_vel unless given",
    "battery": "topic of sensor_msgs/BatteryState, /battery_state unless given",
}


class GoalMissions(MissionKind):
    """From the first goal of a list to the answer to its last."""

    def __init__(self, name: str, args: Mapping[str, str], rosout: Sequence[str] = ROSOUT_TOPICS) -> None:
        """`name` is the mission kind, which names its goal server too; `args` are those of that goal server alone.
        `rosout` is where its nodes speak."""
        self.name, self.rosout = name, rosout
        self.args = {**args, **GOAL_ARGS}

    def needs(self, spec: Args) -> Wanted:
        names = topics(spec)
        return {
            **goal_server(spec).needs(spec),
            names.odometry: ODOMETRY_FIELDS,
            names.commands: COMMAND_FIELDS,
            names.battery: BATTERY_FIELDS,
            **dict.fromkeys(self.rosout, LOG_FIELDS),
        }

    def missions(self, model: RunModel, tables: Mapping[str, Table], spec: Args) -> tuple[Mission, ...]:
        """One mission each time the list of goals starts again, or goals come after a long pause."""
        if not isinstance(model, Drive):
            return ()
        missions = []
        groups = _split(goal_server(spec).goals(model, spec), spec)
        for number, goals in enumerate(groups):
            until_s = groups[number + 1][0].sent_s if number + 1 < len(groups) else model.duration_s
            ended = _has_ended(goals, spec, until_s)
            missions.append(Mission(model, tables, goals[0].sent_s, goals[-1].end_s, ended, spec))
        return tuple(missions)

    def mismatch(self, mission: Mission) -> str:
        return difference(mission.shared(window).goals, mission.spec)

    def evidence(self, mission: Mission) -> tuple[Evidence, ...]:
        """Failed goals, recoveries, standstill, and warnings of the log: each kind of message once, with its count."""
        found = (*_failed_goals(mission), *_recoveries(mission), *_stuck(mission), *_warnings(mission))
        return tuple(sorted(found, key=lambda one: one.time_s))

    def shortfall(self, mission: Mission) -> tuple[str, ...]:
        drive = mission.shared(window)
        wanted = len(drive.listed) or len(drive.goals)
        if len(drive.goals) > wanted:
            return (f"{len(drive.goals)} goals were sent, the mission has {wanted}",)
        failed = [f"{one.text.partition(':')[0]} at {log_time(one.time_s)}" for one in _failed_goals(mission)]
        return (f"{len(drive.reached)} of {wanted} goals were reached", *failed)

    def outcome(self, mission: Mission) -> tuple[OutcomeCheck, ...]:
        """Whether the goals were reached; one that its sender cancelled or replaced is no failure of the robot."""
        drive = mission.shared(window)
        goals = drive.goals
        reached = sum(goal.status == Status.SUCCEEDED for goal in goals)
        failed = sum(goal.status in FAILED for goal in goals)
        word = f"{reached} of {len(goals)} goals were reached"
        value: Value = 1.0 if reached else Unavailable(f"{word}, the others were cancelled or left open")
        if failed:
            value = 0.0
        elif drive.untold is not None:
            value = drive.untold
        elif goals and goals[-1].status is None:
            value = Unavailable("the log ends before the last goal was answered", "record until it is")
        check = OutcomeCheck("goals_reached", value, "every goal that was not taken back was reached", word)
        return (goal_server(mission.spec).judged(goals, check),)


def _split(goals: Sequence[Goal], spec: Args) -> list[list[Goal]]:
    listed = listed_goals(spec)
    tolerance_m = float(spec.get("tolerance_m", TOLERANCE_M))
    groups: list[list[Goal]] = []
    for goal in goals:
        if not groups or _starts_again(goal, groups[-1], listed, tolerance_m):
            groups.append([])
        groups[-1].append(goal)
    return groups


def _starts_again(goal: Goal, group: Sequence[Goal], listed: Sequence[tuple[float, float]], tolerance_m: float) -> bool:
    """Whether a goal begins a new mission after those of `group`."""
    if goal.sent_s - group[-1].end_s > _IDLE_S:
        return True
    # A goal that replaces one still under way belongs to the same mission, wherever it lies.
    replaces = group[-1].status is None or group[-1].end_s >= goal.sent_s
    firsts = {(group[0].x, group[0].y), *listed[:1]}
    return not replaces and any(goal.offset(*first) <= tolerance_m for first in firsts)


def _has_ended(goals: Sequence[Goal], spec: Args, until_s: float) -> bool:
    """Whether the log shows the mission's end: its last goal answered or out of time, and no goal of the list to come.

    A client may give up after failed goals, so a list that was not finished has ended too once a goal failed; while
    every goal so far was reached, the log must go on for a goal's time without the next.
    """
    limit_s = time_limit_s(goals, spec)
    last = goals[-1]
    if last.status is None:
        return until_s - last.sent_s > limit_s
    if len(goals) < len(own_goals(goals, spec)) and all(goal.reached(limit_s) for goal in goals):
        return until_s - last.end_s > limit_s
    return True


# Evidence


def _failed_goals(mission: Mission) -> Iterator[Evidence]:
    drive = mission.shared(window)
    for number, goal in enumerate(drive.goals, start=1):
        why = f": {goal.text}" if goal.text else ""
        if goal.status in FAILED:
            word = Status(goal.status).name.lower().replace("_", " ")
            yield _concluded(goal.end_s, f"goal {number} {word} after {goal.time_s:.0f} s{why}", "abort")
        elif goal.time_s > drive.timeout_s:
            yield _concluded(goal.end_s, f"goal {number} not reached within {drive.timeout_s:.0f} s{why}", "timeout")
        elif goal.status in (Status.PREEMPTED, Status.RECALLED):
            yield _concluded(goal.end_s, f"goal {number} cancelled after {goal.time_s:.0f} s{why}", "cancel")


def _concluded(time_s: float, text: str, kind: str) -> Evidence:
    return Evidence(time_s, text, kind, is_concluded=True)


def _recoveries(mission: Mission) -> Iterator[Evidence]:
    ran = goal_server(mission.spec).recoveries(mission)
    if not isinstance(ran, Unavailable):
        yield from _condensed([(time_s, f"recovery {name}", "recovery") for time_s, name in ran])


def _stuck(mission: Mission) -> Iterator[Evidence]:
    """Goals on which the robot made no way for long, and what it was commanded meanwhile."""
    drive = mission.shared(window)
    if drive.odometry is None or not drive.odometry.tells_speed:
        return
    for number, goal in enumerate(drive.goals):
        inside = drive.odometry.goal == number
        still_s = longest(np.abs(drive.odometry.speed[inside]) < STANDS_MPS, drive.odometry.dt[inside])
        if still_s < _STUCK_S or goal.reached(drive.timeout_s):
            continue
        text = f"made no way for {still_s:.0f} s on goal {number + 1}{_commanded(drive.commands, goal)}"
        yield _concluded(goal.end_s, text, "stuck")


def _commanded(commands: ActiveCommands | None, goal: Goal) -> str:
    if commands is None:
        return ""
    inside = (commands.t >= goal.sent_s) & (commands.t <= goal.end_s)
    shares = {
        "to stand": share(commands.stands[inside], commands.dt[inside]),
        "to turn on the spot": share(commands.turns_on_spot[inside], commands.dt[inside]),
    }
    order = max(shares, key=shares.__getitem__)
    return f", commanded {order} {shares[order]:.0%} of the time" if shares[order] > 0 else ""


def _warnings(mission: Mission) -> Iterator[Evidence]:
    """Warnings and errors of the log, and recoveries that it announces at a lower level."""
    rows = []
    for message in log_messages(mission) or ():
        name, text = message.node, message.text
        kind = next((kind for pattern, kind in _MESSAGE_KINDS if pattern.search(text)), None)
        if (message.level >= Level.WARN and not kept_its_rate(text)) or kind == "recovery":
            # On ROS 1 one node does it all and its name begins with a slash; on ROS 2 the server that speaks matters.
            spoken = text if name.startswith("/") or not name else f"{name}: {text}"
            rows.append((message.time_s, spoken, kind or "warning"))
    yield from _condensed(rows)


def _condensed(rows: Sequence[tuple[float, str, str]]) -> Iterator[Evidence]:
    """The first of each kind of message, with how often it came; messages that differ in numbers only are one kind."""
    counts: dict[str, int] = {}
    firsts: dict[str, tuple[float, str, str]] = {}
    for row in rows:
        key = re.sub(r"-?\d+(\.\d+)?(e-?\d+)?", "#", row[1])
        counts[key] = counts.get(key, 0) + 1
        firsts.setdefault(key, row)
    for key, (time_s, text, kind) in firsts.items():
        times = f" ({counts[key]} times)" if counts[key] > 1 else ""
        yield Evidence(time_s, text + times, kind)


def log_messages(mission: Mission) -> tuple[LogMessage, ...] | None:
    """What nodes said during the mission; None where that was not recorded."""
    drive = drive_of(mission)
    spoken = None if drive is None else drive.log_messages_on(ROSOUT_TOPICS)
    if spoken is None:
        return None
    return tuple(message for message in spoken if mission.start_s <= message.time_s <= mission.end_s)
