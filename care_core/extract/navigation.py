"""Goal navigation on ROS 1: how missions are found in a bag of an actionlib goal server, and what tells them apart.

A mission is a list of goals sent one after the other. The planner says little about why it fails (a robot boxed in
by its own cost weights dithers on the spot without one warning), so beside counts of messages and recoveries the
extractors measure what such a failure looks like: commands to stand or to turn on the spot, reversals of the turn
command, standstill, distance left to the goal.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from care_core.extract.drive import (
    BATTERY_FIELDS,
    COMMAND_FIELDS,
    GOAL_FIELDS,
    MOVING_MPS,
    ODOMETRY_FIELDS,
    RECOVERY_FIELDS,
    RESULT_FIELDS,
    ROSOUT_FIELDS,
    TOLERANCE_M,
    TURNING_RADPS,
    Commands,
    Drive,
    Floats,
    Leg,
    Odometry,
    Status,
    analyse,
    angle_between,
    find_legs,
    has,
    listed_goals,
    longest,
    share,
    timeout_s,
    topics,
)
from care_core.extract.registry import MISSION_KINDS, Args, Mission, MissionKind, extractor, missing
from care_core.logs.base import Table, Wanted
from care_core.run import Evidence, Unavailable, Value

_IDLE_S = 120.0
"""A pause this long between goals ends a mission."""

_WARN = 4
"""Level of a warning in rosgraph_msgs/Log (1 debug, 2 info, 4 warn, 8 error, 16 fatal)."""

_STUCK_S = 15.0
"""A robot that stands or only swings for this long with a goal ahead is stuck."""

_CRAWL_M = 0.3
"""How much nearer a goal must have come in the last fifth of its time to count as under way."""
_ROSOUT = ("/rosout", "/rosout_agg")

_MESSAGE_KINDS: tuple[tuple[re.Pattern[str], str], ...] = (
    (re.compile(r"recovery|clearing .* costmap|clearing costmap", re.IGNORECASE), "recovery"),
    (re.compile(r"abort", re.IGNORECASE), "abort"),
    (re.compile(r"failed to (produce|find|get|make) .*(path|plan|control)|rotation cmd in collision|error when rotating"
                r"|unable to|off the map|in collision|oscillat", re.IGNORECASE), "planner"),
    (re.compile(r"(control|map update) loop missed|sensor origin|transform", re.IGNORECASE), "timing"),
)  # fmt: skip
"""What a message of the log speaks about, first match counts."""

_TOO_SHORT = Unavailable("too few messages while a goal was active", "record the whole mission")


class ActionlibGoals(MissionKind):
    """From the first goal of a list to the answer to its last."""

    name = "actionlib_goals"
    args: Mapping[str, str] = {
        "action": "namespace of the goal server, /move_base unless given",
        "goals": "list of [x, y] in m, in the frame of the goals, that the thresholds belong to",
        "goal_timeout_s": "time within which each goal must be reached, 60 unless given",
        "tolerance_m": "how far a goal may be from the listed one, 0.3 unless given",
        "passages": "list of [x, y] of narrow passages, in the frame of the odometry",
        "odometry": "topic of nav_msgs/Odometry, /odom unless given",
        "commands": "topic of geometry_msgs/Twist, /cmd_vel unless given",
        "battery": "topic of sensor_msgs/BatteryState, /battery_state unless given",
    }

    def needs(self, spec: Args) -> Wanted:
        names = topics(spec)
        return {
            names.goal: GOAL_FIELDS,
            names.result: RESULT_FIELDS,
            names.recovery: RECOVERY_FIELDS,
            names.odometry: ODOMETRY_FIELDS,
            names.commands: COMMAND_FIELDS,
            names.battery: BATTERY_FIELDS,
            **dict.fromkeys(_ROSOUT, ROSOUT_FIELDS),
        }

    def missions(self, tables: Mapping[str, Table], duration_s: float, spec: Args) -> tuple[Mission, ...]:
        """One mission each time the list of goals starts again, or goals come after a long pause."""
        missions = []
        groups = _split(find_legs(tables, spec, duration_s), spec)
        for number, legs in enumerate(groups):
            until_s = groups[number + 1][0].sent_s if number + 1 < len(groups) else duration_s
            missions.append(Mission(tables, legs[0].sent_s, legs[-1].end_s, _has_ended(legs, spec, until_s), spec))
        return tuple(missions)

    def mismatch(self, mission: Mission) -> str:
        goals = listed_goals(mission.spec)
        if not goals:
            return ""
        tolerance_m = float(mission.spec.get("tolerance_m", TOLERANCE_M))
        legs = mission.shared(analyse).legs
        for number, leg in enumerate(legs, start=1):
            if number > len(goals):
                return f"{len(legs)} goals were sent, the profile's mission has {len(goals)}"
            off_m = leg.offset(*goals[number - 1])
            if off_m > tolerance_m:
                return f"goal {number} lies {off_m:.1f} m from the profile's"
        return ""

    def evidence(self, mission: Mission) -> tuple[Evidence, ...]:
        """Failed goals, recoveries, standstill, and warnings of the log: each kind of message once, with its count."""
        found = (*_failed_goals(mission), *_recoveries(mission), *_stuck(mission), *_warnings(mission))
        return tuple(sorted(found, key=lambda one: one.time_s))


MISSION_KINDS[ActionlibGoals.name] = ActionlibGoals()


def _split(legs: Sequence[Leg], spec: Args) -> list[list[Leg]]:
    goals = listed_goals(spec)
    tolerance_m = float(spec.get("tolerance_m", TOLERANCE_M))
    groups: list[list[Leg]] = []
    for leg in legs:
        if not groups or _starts_again(leg, groups[-1], goals, tolerance_m):
            groups.append([])
        groups[-1].append(leg)
    return groups


def _starts_again(leg: Leg, group: Sequence[Leg], goals: Sequence[tuple[float, float]], tolerance_m: float) -> bool:
    """Whether a goal begins a new mission after those of `group`."""
    if leg.sent_s - group[-1].end_s > _IDLE_S:
        return True
    # A goal that replaces one still under way belongs to the same mission, wherever it lies.
    replaces = group[-1].status is None or group[-1].end_s >= leg.sent_s
    first = goals[0] if goals else (group[0].x, group[0].y)
    return not replaces and leg.offset(*first) <= tolerance_m


def _has_ended(legs: Sequence[Leg], spec: Args, until_s: float) -> bool:
    """Whether the log shows the mission's end: its last goal answered or out of time, and no goal of the list to come.

    A client may give up after failed goals, so a list that was not finished has ended too once a goal failed; while
    every goal so far was reached, the log must go on for a goal's time without the next.
    """
    limit_s = timeout_s(spec)
    last = legs[-1]
    if last.status is None:
        return until_s - last.sent_s > limit_s
    if len(legs) < len(listed_goals(spec)) and all(leg.reached(limit_s) for leg in legs):
        return until_s - last.end_s > limit_s
    return True


# Evidence


def _failed_goals(mission: Mission) -> Iterator[Evidence]:
    drive = mission.shared(analyse)
    for number, leg in enumerate(drive.legs, start=1):
        said = f": {leg.text}" if leg.text else ""
        if leg.status in (Status.ABORTED, Status.REJECTED, Status.LOST):
            word = Status(leg.status).name.lower()
            yield Evidence(leg.end_s, f"goal {number} {word} after {leg.time_s:.0f} s{said}", "abort")
        elif leg.time_s > drive.timeout_s:
            yield Evidence(leg.end_s, f"goal {number} not reached within {drive.timeout_s:.0f} s{said}", "timeout")
        elif leg.status in (Status.PREEMPTED, Status.RECALLED):
            yield Evidence(leg.end_s, f"goal {number} cancelled after {leg.time_s:.0f} s{said}", "cancel")


def _recoveries(mission: Mission) -> Iterator[Evidence]:
    table = mission.table(topics(mission.spec).recovery)
    if table is not None and has(table, RECOVERY_FIELDS):
        names = [f"recovery behavior {name}" for name in table["recovery_behavior_name"]]
        yield from _condensed([(float(t), text, "recovery") for t, text in zip(table.t, names, strict=True)])


def _stuck(mission: Mission) -> Iterator[Evidence]:
    """Goals on which the robot made no way for long, and what it was commanded meanwhile."""
    drive = mission.shared(analyse)
    if drive.odometry is None:
        return
    for number, leg in enumerate(drive.legs):
        inside = drive.odometry.leg == number
        still_s = longest(np.abs(drive.odometry.speed[inside]) < MOVING_MPS, drive.odometry.dt[inside])
        if still_s < _STUCK_S or leg.reached(drive.timeout_s):
            continue
        text = f"made no way for {still_s:.0f} s on goal {number + 1}{_commanded(drive.commands, leg)}"
        yield Evidence(leg.end_s, text, "stuck")


def _commanded(commands: Commands | None, leg: Leg) -> str:
    if commands is None:
        return ""
    inside = (commands.t >= leg.sent_s) & (commands.t <= leg.end_s)
    shares = {
        "to stand": share(commands.stands[inside], commands.dt[inside]),
        "to turn on the spot": share(commands.turns_on_spot[inside], commands.dt[inside]),
    }
    order = max(shares, key=lambda one: shares[one])
    return f", commanded {order} {shares[order]:.0%} of the time" if shares[order] > 0 else ""


def _warnings(mission: Mission) -> Iterator[Evidence]:
    """Warnings and errors of the log, and recoveries that it announces at a lower level."""
    table = _rosout(mission)
    if table is None:
        return
    rows = []
    for time_s, level, text in zip(table.t.tolist(), table["level"].tolist(), table["msg"].tolist(), strict=True):
        kind = next((kind for pattern, kind in _MESSAGE_KINDS if pattern.search(text)), None)
        if level >= _WARN or kind == "recovery":
            rows.append((time_s, text, kind or "warning"))
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


def _rosout(mission: Mission) -> Table | None:
    for channel in _ROSOUT:
        table = mission.table(channel)
        if table is not None and all(name in table.columns for name in ROSOUT_FIELDS):
            return table
    return None


# Goals and time


@extractor("goals_sent", needs={}, unit="")
def goals_sent(mission: Mission, args: Args) -> Value:
    """Number of goals that were sent."""
    return float(len(mission.shared(analyse).legs))


@extractor("goals_reached", needs={}, unit="")
def goals_reached(mission: Mission, args: Args) -> Value:
    """Number of goals that ended in success, late ones included."""
    return float(sum(leg.status == Status.SUCCEEDED for leg in mission.shared(analyse).legs))


@extractor("goals_success", needs={}, unit="")
def goals_success(mission: Mission, args: Args) -> Value:
    """1 when every goal of the mission's list was reached within its time, else 0."""
    drive = mission.shared(analyse)
    wanted = len(drive.goals) or len(drive.legs)
    answered = [leg for leg in drive.legs if leg.status is not None or leg.time_s > drive.timeout_s]
    if all(leg.reached(drive.timeout_s) for leg in answered) and not mission.ended:
        return Unavailable("the log ends before the mission does", "record until the mission has ended")
    return float(len(drive.reached) == wanted and len(drive.legs) == wanted)


@extractor(
    "goals_ended", needs={}, unit="", args={"status": "preempted, succeeded, aborted, rejected, recalled or lost"}
)
def goals_ended(mission: Mission, args: Args) -> Value:
    """Number of goals that the goal server answered with a status: aborted means that it gave up by itself."""
    status = str(args.get("status", "aborted")).upper()
    if status not in Status.__members__:
        return Unavailable(f"'{status.lower()}' is no goal status")
    return float(sum(leg.status == Status[status] for leg in mission.shared(analyse).legs))


@extractor("goals_time", needs={}, unit="s")
def goals_time(mission: Mission, args: Args) -> Value:
    """Time from sending the first goal to the answer to the last."""
    return mission.end_s - mission.start_s


@extractor("goal_time", needs={}, unit="s", args={"index": "number of the goal, from 1; all unless given",
                                                  "of": "mean or longest of all goals, mean unless given"})  # fmt: skip
def goal_time(mission: Mission, args: Args) -> Value:
    """Time that a goal took, reached or not."""
    legs = mission.shared(analyse).legs
    if "index" in args:
        number = int(args["index"])
        if not 1 <= number <= len(legs):
            return Unavailable(f"goal {number} was not sent")
        return legs[number - 1].time_s
    times = [leg.time_s for leg in legs]
    return max(times) if args.get("of") == "longest" else sum(times) / len(times)


@extractor("time_per_metre", needs={}, unit="s/m")
def time_per_metre(mission: Mission, args: Args) -> Value:
    """Time with a goal per metre of way made towards the goals."""
    drive = mission.shared(analyse)
    odometry = _odometry(drive)
    if isinstance(odometry, Unavailable):
        return odometry
    made_m = sum(_progress(odometry, drive.legs))
    if made_m < 0.1:
        return Unavailable("the robot made no way towards its goals")
    return drive.active_s / made_m


@extractor("goals_approached", needs={}, unit="", args={"within_m": "how near counts, 0.6 m unless given"})
def goals_approached(mission: Mission, args: Args) -> Value:
    """Share of the mission's goals that the robot was near to when they ended, reached or not."""
    left = _at_end(mission, only_reached=False)
    if isinstance(left, Unavailable):
        return left
    drive = mission.shared(analyse)
    within_m = float(args.get("within_m", 0.6))
    return sum(distance <= within_m for distance, _ in left) / (len(drive.goals) or len(drive.legs))


@extractor(
    "first_failure",
    needs={},
    unit="",
    args={"how": "given_up, unsettled, crawling or stuck", "within_m": "how near to the goal, 0.6 m unless given"},
)
def first_failure(mission: Mission, args: Args) -> Value:
    """1 when the first goal that was not reached failed in this way, else 0: `given_up` by the stack; out of time
    `unsettled` near the goal, `crawling` (it still came nearer, a share of the way too slow), or `stuck` on the way."""
    drive = mission.shared(analyse)
    odometry = _odometry(drive)
    if isinstance(odometry, Unavailable):
        return odometry
    number = next((i for i, leg in enumerate(drive.legs) if not leg.reached(drive.timeout_s)), None)
    return 0.0 if number is None else float(_way_of_failing(drive, odometry, number, args) == args.get("how"))


def _way_of_failing(drive: Drive, odometry: Odometry, number: int, args: Args) -> str:
    leg = drive.legs[number]
    distance = _goal_distance(odometry, drive.legs)[odometry.leg == number]
    if leg.status in (Status.ABORTED, Status.REJECTED):
        return "given_up"
    if not len(distance) or distance[-1] <= float(args.get("within_m", 0.6)):
        return "unsettled"
    recent = distance[-max(2, len(distance) // 5) :]
    return "crawling" if recent[0] - recent[-1] >= _CRAWL_M else "stuck"


@extractor("passages_passed", needs={}, unit="", args={"within_m": "how near counts as passed, 0.6 m unless given"})
def passages_passed(mission: Mission, args: Args) -> Value:
    """Share of the narrow passages listed in the profile's mission section that the robot came near to."""
    odometry = _odometry(mission.shared(analyse))
    if isinstance(odometry, Unavailable):
        return odometry
    places = [(float(place[0]), float(place[1])) for place in mission.spec.get("passages", ())]
    if not places:
        return Unavailable("the profile lists no passages", "list them in its mission section")
    within_m = float(args.get("within_m", 0.6))
    near = [bool(np.hypot(odometry.x - x, odometry.y - y).min() <= within_m) for x, y in places]
    return sum(near) / len(places)


# Path


@extractor("path_length", needs={}, unit="m")
def path_length(mission: Mission, args: Args) -> Value:
    """Length of the odometry's path."""
    odometry = _odometry(mission.shared(analyse))
    return odometry if isinstance(odometry, Unavailable) else float(odometry.step_m.sum())


@extractor("detour", needs={}, unit="m")
def detour(mission: Mission, args: Args) -> Value:
    """Path driven beyond the way made towards the goals."""
    drive = mission.shared(analyse)
    odometry = _odometry(drive)
    if isinstance(odometry, Unavailable):
        return odometry
    return float(odometry.step_m.sum()) - sum(_progress(odometry, drive.legs))


@extractor("lateral_error", needs={}, unit="m")
def lateral_error(mission: Mission, args: Args) -> Value:
    """Mean distance from the straight line between where a goal was sent and where it lies."""
    drive = mission.shared(analyse)
    odometry = _odometry(drive)
    if isinstance(odometry, Unavailable):
        return odometry
    offsets = [_lateral(odometry, number, leg) for number, leg in enumerate(drive.legs)]
    joined = np.concatenate(offsets)
    return float(joined.mean()) if len(joined) else _TOO_SHORT


@extractor("distance_left", needs={}, unit="m")
def distance_left(mission: Mission, args: Args) -> Value:
    """Largest distance to a goal when it ended: the goal tolerance where all were reached, else where it got stuck."""
    left = _at_end(mission, only_reached=False)
    return left if isinstance(left, Unavailable) else max(distance for distance, _ in left)


@extractor("arrival_error", needs={}, unit="m")
def arrival_error(mission: Mission, args: Args) -> Value:
    """Mean distance to the reached goals on arrival."""
    left = _at_end(mission, only_reached=True)
    return left if isinstance(left, Unavailable) else float(np.mean([distance for distance, _ in left]))


@extractor("heading_error", needs={}, unit="rad")
def heading_error(mission: Mission, args: Args) -> Value:
    """Mean error of the heading on arrival at the reached goals."""
    left = _at_end(mission, only_reached=True)
    return left if isinstance(left, Unavailable) else float(np.mean([angle for _, angle in left]))


@extractor("settling_time", needs={}, unit="s", args={"within_m": "how near to the goal, 0.5 m unless given"})
def settling_time(mission: Mission, args: Args) -> Value:
    """Mean time near a goal before it ended: hunting for position and heading."""
    drive = mission.shared(analyse)
    odometry = _odometry(drive)
    if isinstance(odometry, Unavailable):
        return odometry
    near = _goal_distance(odometry, drive.legs) <= float(args.get("within_m", 0.5))
    return float(odometry.dt[near].sum()) / len(drive.legs)


# Motion


@extractor("drive_speed", needs={}, unit="m/s")
def drive_speed(mission: Mission, args: Args) -> Value:
    """Mean forward speed while driving."""
    odometry = _odometry(mission.shared(analyse))
    if isinstance(odometry, Unavailable):
        return odometry
    driving = np.abs(odometry.speed) >= MOVING_MPS
    return float(np.abs(odometry.speed[driving]).mean()) if driving.any() else 0.0


@extractor("top_speed", needs={}, unit="m/s")
def top_speed(mission: Mission, args: Args) -> Value:
    """95th percentile of the forward speed."""
    odometry = _odometry(mission.shared(analyse))
    return odometry if isinstance(odometry, Unavailable) else float(np.percentile(np.abs(odometry.speed), 95))


@extractor("top_turn_rate", needs={}, unit="rad/s")
def top_turn_rate(mission: Mission, args: Args) -> Value:
    """95th percentile of the turn rate."""
    odometry = _odometry(mission.shared(analyse))
    return odometry if isinstance(odometry, Unavailable) else float(np.percentile(np.abs(odometry.turn), 95))


@extractor("drive_acceleration", needs={}, unit="m/s^2")
def drive_acceleration(mission: Mission, args: Args) -> Value:
    """99th percentile of the change of forward speed."""
    odometry = _odometry(mission.shared(analyse))
    if isinstance(odometry, Unavailable):
        return odometry
    step_s = np.diff(odometry.t)
    usable = (step_s > 0) & (step_s <= 1.0)
    if not usable.any():
        return _TOO_SHORT
    return float(np.percentile(np.abs(np.diff(odometry.speed)[usable] / step_s[usable]), 99))


@extractor("standstill", needs={}, unit="", args={"of": "share of the time, or longest in s; share unless given"})
def standstill(mission: Mission, args: Args) -> Value:
    """Not moving while a goal is active: share of that time, or the longest stretch of it."""
    odometry = _odometry(mission.shared(analyse))
    if isinstance(odometry, Unavailable):
        return odometry
    if args.get("of") == "longest":
        return longest(odometry.stands, odometry.dt)
    return share(odometry.stands, odometry.dt)


@extractor("no_way_time", needs={}, unit="s")
def no_way_time(mission: Mission, args: Args) -> Value:
    """Longest time without forward motion while a goal is active, turning on the spot included."""
    odometry = _odometry(mission.shared(analyse))
    if isinstance(odometry, Unavailable):
        return odometry
    return longest(np.abs(odometry.speed) < MOVING_MPS, odometry.dt)


@extractor("total_turn", needs={}, unit="rad")
def total_turn(mission: Mission, args: Args) -> Value:
    """Sum of all turning, left and right alike."""
    odometry = _odometry(mission.shared(analyse))
    return odometry if isinstance(odometry, Unavailable) else float((np.abs(odometry.turn) * odometry.dt).sum())


@extractor("start_delay", needs={}, unit="s")
def start_delay(mission: Mission, args: Args) -> Value:
    """Mean time from sending a goal to the first motion."""
    drive = mission.shared(analyse)
    odometry = _odometry(drive)
    if isinstance(odometry, Unavailable):
        return odometry
    moving = ~odometry.stands
    delays = []
    for number, leg in enumerate(drive.legs):
        times = odometry.t[moving & (odometry.leg == number)]
        delays.append(float(times[0]) - leg.sent_s if len(times) else leg.time_s)
    return sum(delays) / len(delays)


# Commands


@extractor("commanded_speed", needs={}, unit="m/s")
def commanded_speed(mission: Mission, args: Args) -> Value:
    """Mean commanded forward speed among commands to drive."""
    commands = _commands(mission.shared(analyse))
    if isinstance(commands, Unavailable):
        return commands
    driving = np.abs(commands.speed) >= MOVING_MPS
    return float(commands.speed[driving].mean()) if driving.any() else 0.0


@extractor("commanded_share", needs={}, unit="", args={"order": "stand, spot_turn or reverse; stand unless given"})
def commanded_share(mission: Mission, args: Args) -> Value:
    """Share of the time with a goal that the robot was commanded to stand, to turn on the spot, or to back up."""
    commands = _commands(mission.shared(analyse))
    if isinstance(commands, Unavailable):
        return commands
    order = args.get("order", "stand")
    if order == "spot_turn":
        return share(commands.turns_on_spot, commands.dt)
    if order == "reverse":
        return share(np.asarray(commands.speed <= -MOVING_MPS), commands.dt)
    return share(commands.stands, commands.dt)


@extractor("blocked_share", needs={}, unit="")
def blocked_share(mission: Mission, args: Args) -> Value:
    """Share of the time with a goal that forward motion was commanded and none came: contact, slip, a dead drive."""
    drive = mission.shared(analyse)
    odometry, commands = _odometry(drive), _commands(drive)
    if isinstance(odometry, Unavailable):
        return odometry
    if isinstance(commands, Unavailable):
        return commands
    latest = np.clip(np.searchsorted(commands.t, odometry.t, side="right") - 1, 0, len(commands.t) - 1)
    ordered = np.abs(commands.speed[latest]) >= 2 * MOVING_MPS
    return share(np.asarray(ordered & (np.abs(odometry.speed) < MOVING_MPS)), odometry.dt)


@extractor("turn_reversals", needs={}, unit="1/min")
def turn_reversals(mission: Mission, args: Args) -> Value:
    """How often per minute the commanded turn changes side: a planner that cannot decide."""
    commands = _commands(mission.shared(analyse))
    if isinstance(commands, Unavailable):
        return commands
    sides = np.sign(commands.turn[np.abs(commands.turn) >= TURNING_RADPS])
    total_s = float(commands.dt.sum())
    return float(np.count_nonzero(np.diff(sides))) / total_s * 60 if total_s > 0 else _TOO_SHORT


@extractor("command_interval", needs={}, unit="s", args={"percentile": "0 to 100, 50 unless given"})
def command_interval(mission: Mission, args: Args) -> Value:
    """Time between commands while a goal is active: the controller's real period and, at the top, its stalls."""
    drive = mission.shared(analyse)
    commands = _commands(drive)
    if isinstance(commands, Unavailable):
        return commands
    inside = [np.diff(commands.t[(commands.t >= leg.sent_s) & (commands.t <= leg.end_s)]) for leg in drive.legs]
    intervals = np.concatenate(inside)
    return float(np.percentile(intervals, float(args.get("percentile", 50)))) if len(intervals) else _TOO_SHORT


# Recoveries and messages


@extractor("recoveries", needs={}, unit="", args={
    "behavior": "text in the behavior's name; all unless given",
    "absent": "value where the log lacks the topic, which is only published on a recovery; not known unless given",
})  # fmt: skip
def recoveries(mission: Mission, args: Args) -> Value:
    """Number of recovery behaviors that the goal server ran."""
    channel = topics(mission.spec).recovery
    table = mission.table(channel)
    if table is None or "recovery_behavior_name" not in table.columns:
        return float(args["absent"]) if "absent" in args else missing(channel)
    wanted = str(args.get("behavior", "")).casefold()
    return float(sum(wanted in str(name).casefold() for name in table["recovery_behavior_name"]))


@extractor("rosout_count", needs=dict.fromkeys(_ROSOUT, ROSOUT_FIELDS), unit="", args={
    "text": "text in the message, ignoring case",
    "level": "lowest level that counts: 1 debug, 2 info, 4 warn, 8 error, 16 fatal; any unless given",
})  # fmt: skip
def rosout_count(mission: Mission, args: Args) -> Value:
    """Number of messages on /rosout with a text."""
    table = _rosout(mission)
    if table is None:
        return missing("/rosout")
    text, level = str(args.get("text", "")).casefold(), float(args.get("level", 0))
    pairs = zip(table["level"].tolist(), table["msg"].tolist(), strict=True)
    return float(sum(one >= level and text in message.casefold() for one, message in pairs))


# Battery


@extractor("battery_energy", needs={}, unit="Wh")
def battery_energy(mission: Mission, args: Args) -> Value:
    """Energy drawn: voltage times current over time, or where no current is measured charge times mean voltage.

    Drivers differ in the sign of a discharge current, so the magnitude of the sum counts.
    """
    battery = _battery(mission)
    if isinstance(battery, Unavailable):
        return battery
    if np.isfinite(battery.current).all():
        power = battery.voltage * battery.current
        joule = np.concatenate([[0.0], np.cumsum(np.diff(battery.t) * (power[1:] + power[:-1]) / 2)])
        start, end = np.interp([mission.start_s, mission.end_s], battery.t, joule)
        return abs(float(end - start)) / 3600
    if np.isfinite(battery.charge).all():
        start, end = np.interp([mission.start_s, mission.end_s], battery.t, battery.charge)
        inside = (battery.t >= mission.start_s) & (battery.t <= mission.end_s)
        return float(start - end) * float(battery.voltage[inside].mean())
    return Unavailable("the battery reports neither current nor charge")


@extractor("battery_power", needs={}, unit="W")
def battery_power(mission: Mission, args: Args) -> Value:
    """Mean power drawn."""
    energy_wh = battery_energy(mission, args)
    time_s = mission.end_s - mission.start_s
    return energy_wh if isinstance(energy_wh, Unavailable) else energy_wh * 3600 / time_s if time_s > 0 else _TOO_SHORT


@extractor("battery_voltage", needs={}, unit="V", args={"of": "start or lowest, lowest unless given"})
def battery_voltage(mission: Mission, args: Args) -> Value:
    """The battery's voltage at the start, or its lowest."""
    battery = _battery(mission)
    if isinstance(battery, Unavailable):
        return battery
    inside = battery.voltage[(battery.t >= mission.start_s) & (battery.t <= mission.end_s)]
    return float(inside[0] if args.get("of") == "start" else inside.min())


# Parts


@dataclass(frozen=True, slots=True, eq=False)
class _Battery:
    """Battery of the whole log: s, V, A, Ah, each of shape (n,)."""

    t: Floats
    voltage: Floats
    current: Floats
    charge: Floats


def _battery(mission: Mission) -> _Battery | Unavailable:
    """The battery's record, which must cover the mission but for a few seconds."""
    channel = topics(mission.spec).battery
    table = mission.tables.get(channel)
    if table is None or not has(table, BATTERY_FIELDS):
        return missing(channel)
    known = np.isfinite(table["voltage"])
    inside = known & (table.t >= mission.start_s) & (table.t <= mission.end_s)
    edge_s = max(5.0, 0.05 * (mission.end_s - mission.start_s))
    if (
        inside.sum() < 2
        or table.t[inside][0] > mission.start_s + edge_s
        or table.t[inside][-1] < mission.end_s - edge_s
    ):
        return Unavailable(f"{channel} does not cover the mission", "record it from the first goal to the last")
    return _Battery(table.t[known], *(np.asarray(table[name][known], np.float64) for name in BATTERY_FIELDS))


def _odometry(drive: Drive) -> Odometry | Unavailable:
    """Odometry in the frame of the goals."""
    if drive.odometry is None:
        return missing(drive.topics.odometry)
    frames = {leg.frame.strip("/") for leg in drive.legs} - {""}
    own = drive.odometry.frame.strip("/")
    if own and frames - {own}:
        other = ", ".join(sorted(frames))
        return Unavailable(f"goals are in frame {other}, odometry is in {own}", "name odometry in the goals' frame")
    return drive.odometry


def _commands(drive: Drive) -> Commands | Unavailable:
    return missing(drive.topics.commands) if drive.commands is None else drive.commands


def _goal_distance(odometry: Odometry, legs: Sequence[Leg]) -> Floats:
    """Distance to the active goal, m, shape (n,)."""
    x, y = np.array([leg.x for leg in legs]), np.array([leg.y for leg in legs])
    distance: Floats = np.hypot(odometry.x - x[odometry.leg], odometry.y - y[odometry.leg])
    return distance


def _progress(odometry: Odometry, legs: Sequence[Leg]) -> list[float]:
    """How much nearer each goal came, m."""
    distance = _goal_distance(odometry, legs)
    made = []
    for number in range(len(legs)):
        inside = distance[odometry.leg == number]
        made.append(float(inside[0] - inside[-1]) if len(inside) else 0.0)
    return made


def _lateral(odometry: Odometry, number: int, leg: Leg) -> Floats:
    """Distance from the straight line to a goal, m, one per sample of its leg."""
    inside = odometry.leg == number
    x, y = odometry.x[inside], odometry.y[inside]
    if not len(x) or (length := math.hypot(leg.x - x[0], leg.y - y[0])) < TOLERANCE_M:
        return np.empty(0)
    offsets: Floats = np.abs((leg.x - x[0]) * (y - y[0]) - (leg.y - y[0]) * (x - x[0])) / length
    return offsets


def _at_end(mission: Mission, *, only_reached: bool) -> list[tuple[float, float]] | Unavailable:
    """Distance (m) and heading error (rad) at the end of each leg, never an empty list."""
    drive = mission.shared(analyse)
    odometry = _odometry(drive)
    if isinstance(odometry, Unavailable):
        return odometry
    ends = []
    for number, leg in enumerate(drive.legs):
        rows = np.flatnonzero(odometry.leg == number)
        if len(rows) and (leg.reached(drive.timeout_s) or not only_reached):
            last = rows[-1]
            offset = leg.offset(float(odometry.x[last]), float(odometry.y[last]))
            ends.append((offset, angle_between(leg.yaw, float(odometry.yaw[last]))))
    return ends or Unavailable("no goal was reached")
