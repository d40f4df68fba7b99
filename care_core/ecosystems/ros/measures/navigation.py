"""Extractors of a drive along goals, whichever goal server was asked: goals and time, path, motion, commands, messages.

A planner says little about why it fails, so beside counts of messages and recoveries these measure what a failure
looks like: commands to stand or to turn on the spot, reversals of the turn command, standstill, distance left.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import wraps
from typing import TypeVar

import numpy as np

from care_core.ecosystems.coverage import EXTREME, MEAN, SUM, Bears, Samples
from care_core.ecosystems.measures import Args, Compute, Mission, RestsOn, extractor, missing, numeric, one_of
from care_core.ecosystems.ros.drive import LOG_FIELDS
from care_core.ecosystems.ros.goals import Goal, Status
from care_core.ecosystems.ros.measures.goals import log_messages
from care_core.ecosystems.ros.measures.requested import PER_GOAL, PER_METRE, divided, requested_way
from care_core.ecosystems.ros.measures.window import (
    TOLERANCE_M,
    ActiveCommands,
    ActiveOdometry,
    DriveWindow,
    angle_between,
    arrivals,
    goal_server,
    longest,
    no_odometry,
    resting_on,
    share,
    window,
)
from care_core.ecosystems.ros.motion import STANDS_MPS, STANDS_RADPS
from care_core.ecosystems.ros.node_messages import ROSOUT_TOPICS
from care_core.numbers import Floats, quantile
from care_core.run import Unavailable, Value
from care_core.text import log_time

_CRAWL_M = 0.3
"""How much nearer a goal must have come in the last fifth of its time to count as under way."""

_CUT = Unavailable("the log ends before the mission does", "record until the mission has ended")

T = TypeVar("T")
_Ends = list[tuple[float, float]]

_TOO_SHORT = Unavailable("too few messages while a goal was active", "record the whole mission")


# Parts of a drive, and what is measured on one


def _odometry(drive: DriveWindow) -> ActiveOdometry | Unavailable:
    return no_odometry(drive) if drive.odometry is None else drive.odometry


def _moving(drive: DriveWindow) -> ActiveOdometry | Unavailable:
    """Odometry that says how fast the robot is."""
    if drive.odometry is not None and not drive.odometry.tells_speed:
        return Unavailable(
            f"the twist of {drive.topics.odometry} stays zero while its position moves",
            "have its driver fill in the twist",
        )
    return _odometry(drive)


def _placed(drive: DriveWindow) -> ActiveOdometry | Unavailable:
    """Odometry in the frame of the goals, to measure distances to them."""
    odometry = drive.placed or drive.odometry
    if odometry is None:
        return no_odometry(drive)
    if any(math.isnan(goal.x) for goal in drive.goals):
        return Unavailable("the log does not say where the goals lie", "ros2 bag record /goal_pose /plan")
    frames = {goal.frame.strip("/") for goal in drive.goals} - {""}
    own = odometry.frame.strip("/")
    if own and frames - {own}:
        other = ", ".join(sorted(frames))
        hint = "name in the mission section a topic of nav_msgs/Odometry in the goals' frame"
        return Unavailable(f"goals are in frame {other}, odometry is in {own}", hint)
    return odometry


def _commands(drive: DriveWindow) -> ActiveCommands | Unavailable:
    return missing(drive.topics.commands) if drive.commands is None else drive.commands


def _goal_distance(odometry: ActiveOdometry, goals: Sequence[Goal]) -> Floats:
    """Distance to the active goal, m, shape (n,)."""
    x, y = np.array([goal.x for goal in goals]), np.array([goal.y for goal in goals])
    distance: Floats = np.hypot(odometry.x - x[odometry.goal], odometry.y - y[odometry.goal])
    return distance


def _progress(odometry: ActiveOdometry, goals: Sequence[Goal]) -> list[float]:
    """How much nearer each goal came, m."""
    distance = _goal_distance(odometry, goals)
    made = []
    for number in range(len(goals)):
        inside = distance[odometry.goal == number]
        made.append(float(inside[0] - inside[-1]) if len(inside) else 0.0)
    return made


def _lateral(odometry: ActiveOdometry, number: int, goal: Goal) -> Floats:
    """Distance from the straight line to a goal, m, one per sample on the way to it."""
    inside = odometry.goal == number
    x, y = odometry.x[inside], odometry.y[inside]
    if not len(x) or (length := math.hypot(goal.x - x[0], goal.y - y[0])) < TOLERANCE_M:
        return np.empty(0)
    offsets: Floats = np.abs((goal.x - x[0]) * (y - y[0]) - (goal.y - y[0]) * (x - x[0])) / length
    return offsets


def _ends(drive: DriveWindow, *, only_reached: bool = False) -> _Ends | Unavailable:
    """Distance (m) and heading error (rad) at the end of each goal, never an empty list."""
    odometry = _placed(drive)
    if isinstance(odometry, Unavailable):
        return odometry
    ends = []
    for number, goal in enumerate(drive.goals):
        rows = np.flatnonzero(odometry.goal == number)
        if len(rows) and (goal.reached(drive.timeout_s) or not only_reached):
            last = rows[-1]
            offset = goal.offset(float(odometry.x[last]), float(odometry.y[last]))
            ends.append((offset, angle_between(goal.yaw, float(odometry.yaw[last]))))
    return ends or Unavailable("no goal was reached", "see why its goals failed")


def _arrivals(drive: DriveWindow) -> _Ends | Unavailable:
    """The same of the goals that were reached."""
    return _ends(drive, only_reached=True)


def measured(
    name: str,
    part: Callable[[DriveWindow], T | Unavailable],
    *,
    unit: str = "",
    args: Mapping[str, str] | None = None,
    parts: tuple[str, ...] = ("goals", "odometry"),
    bears: Bears = MEAN,
    rests_on: RestsOn | None = None,
) -> Callable[[Callable[[DriveWindow, T, Args], Value]], Compute]:
    """Register an extractor of what is measured on a part of the drive; where the part is missing, that is the answer.
    It needs its topics throughout, unless it `rests_on` else.

    A measure with the argument `per` is a sum over the mission, see `divided`.
    """

    def register(measure: Callable[[DriveWindow, T, Args], Value]) -> Compute:
        @wraps(measure)
        def compute(mission: Mission, args: Args) -> Value:
            drive = mission.shared(window)
            found = part(drive)
            return found if isinstance(found, Unavailable) else measure(drive, found, args)

        answer = divided(compute) if args and "per" in args else compute
        needed = rests_on or resting_on(*(part for part in parts if part in ("odometry", "commands")), bears=bears)
        return extractor(name, needs={}, unit=unit, parts=parts, args=args, rests_on=needed)(answer)

    return register


def _anything(mission: Mission, args: Args) -> Iterator[Samples]:
    """Of what measures pauses: they are no holes in it."""
    return iter(())


# Goals and time


@extractor("goals_sent", needs={}, parts=("goals",), unit="")
def goals_sent(mission: Mission, args: Args) -> Value:
    """Number of goals that were sent."""
    return float(len(mission.shared(window).goals))


@extractor("goals_reached", needs={}, parts=("goals",), unit="", args=PER_GOAL)
@divided
def goals_reached(mission: Mission, args: Args) -> Value:
    """Number of goals that ended in success, late ones included."""
    return float(sum(goal.status == Status.SUCCEEDED for goal in mission.shared(window).goals))


@extractor("goals_success", needs={}, parts=("goals",), unit="")
def goals_success(mission: Mission, args: Args) -> Value:
    """1 when every goal of the mission's list was reached within its time, else 0."""
    drive = mission.shared(window)
    wanted = len(drive.listed) or len(drive.goals)
    unknown = _untold(drive) if mission.ended or drive.untold is not None else _CUT
    if unknown is not None and not any(_is_missed(goal, drive) for goal in drive.goals):
        return unknown
    return float(len(drive.reached) == wanted and len(drive.goals) == wanted)


def _untold(drive: DriveWindow) -> Unavailable | None:
    """Why it is not known whether the robot would have reached its goals, None where it is."""
    for number, goal in enumerate(drive.goals, start=1):
        if goal.is_replaced and goal.time_s <= drive.timeout_s:
            replaced = f"goal {number} was replaced by another under way, at {log_time(goal.end_s, 0)}"
            return Unavailable(replaced, "judge a drive whose goals stay as they were sent")
    return drive.untold


def _is_missed(goal: Goal, drive: DriveWindow) -> bool:
    """Whether a goal failed, or ran out of its time, as far as the recording tells."""
    if goal.is_replaced or not goal.outcome:
        return goal.time_s > drive.timeout_s and (goal.is_replaced or drive.untold is None)
    return not goal.reached(drive.timeout_s)


@extractor(
    "goals_ended",
    needs={},
    parts=("goals",),
    unit="",
    args={
        "status": one_of(
            "preempted, succeeded, aborted, rejected, recalled or lost; aborted unless given",
            *("preempted", "succeeded", "aborted", "rejected", "recalled", "lost"),
        ),
        **PER_GOAL,
    },
)
@divided
def goals_ended(mission: Mission, args: Args) -> Value:
    """Number of goals that the goal server answered with a status: aborted means that it gave up by itself."""
    status = str(args.get("status", "aborted")).upper()
    if status not in Status.__members__:
        return Unavailable(f"'{status.lower()}' is not a goal status", "use one of those that its arguments name")
    return float(sum(goal.status == Status[status] for goal in mission.shared(window).goals))


@extractor("goals_time", needs={}, parts=("goals",), unit="s")
def goals_time(mission: Mission, args: Args) -> Value:
    """Time from sending the first goal to the answer to the last."""
    return mission.end_s - mission.start_s


@extractor(
    "goal_time",
    needs={},
    parts=("goals",),
    unit="s",
    args={
        "index": numeric("number of the goal, from 1; all unless given"),
        "of": one_of(
            "mean or longest of all goals, or variation, the standard deviation of their logarithms; mean unless given",
            *("mean", "longest", "variation"),
        ),
        "per": one_of("metre: over the way to each goal; in all unless given", "metre"),
    },
)
def goal_time(mission: Mission, args: Args) -> Value:
    """Time that a goal took, reached or not."""
    goals = mission.shared(window).goals
    times = [goal.time_s for goal in goals]
    if args.get("per") == "metre":
        way = mission.shared(requested_way)
        if isinstance(way, Unavailable):
            return way
        times = [time / max(way_m, TOLERANCE_M) for time, way_m in zip(times, way.lengths.tolist(), strict=False)]
    if "index" in args:
        number = int(args["index"])
        if not 1 <= number <= len(goals):
            return Unavailable(f"goal {number} was not sent", f"{len(goals)} goals were")
        return times[number - 1]
    if args.get("of") == "variation":
        positive = np.log([time for time in times if time > 0])
        return float(np.std(positive, ddof=1)) if len(positive) > 1 else Unavailable("a single goal has no variation")
    return max(times) if args.get("of") == "longest" else sum(times) / len(times)


@measured("time_per_metre", _placed, unit="s/m")
def time_per_metre(drive: DriveWindow, odometry: ActiveOdometry, args: Args) -> Value:
    """Time with a goal per metre of way made towards the goals."""
    made_m = sum(_progress(odometry, drive.goals))
    if made_m < 0.1:
        return Unavailable("the robot came no closer to its goals", "see what it was commanded")
    return drive.active_s / made_m


@measured(
    "goals_approached", _ends, args={"within_m": numeric("how near counts, 0.6 m unless given")}, rests_on=arrivals
)
def goals_approached(drive: DriveWindow, left: _Ends, args: Args) -> Value:
    """Share of the mission's goals that the robot was near to when they ended, reached or not."""
    within_m = float(args.get("within_m", 0.6))
    return sum(distance <= within_m for distance, _ in left) / (len(drive.listed) or len(drive.goals))


@measured(
    "first_failure",
    _placed,
    args={
        "how": one_of("given_up, unsettled, crawling or stuck", "given_up", "unsettled", "crawling", "stuck"),
        "within_m": numeric("how near to the goal, 0.6 m unless given"),
    },
    rests_on=arrivals,
)
def first_failure(drive: DriveWindow, odometry: ActiveOdometry, args: Args) -> Value:
    """1 when the first goal that was not reached failed in this way, else 0: `given_up` by the stack; out of time
    `unsettled` near the goal, `crawling` (it still came nearer, a share of the way too slow), or `stuck` on the way."""
    number = next((i for i, goal in enumerate(drive.goals) if not goal.reached(drive.timeout_s)), None)
    return 0.0 if number is None else float(_way_of_failing(drive, odometry, number, args) == args.get("how"))


def _way_of_failing(drive: DriveWindow, odometry: ActiveOdometry, number: int, args: Args) -> str:
    goal = drive.goals[number]
    distance = _goal_distance(odometry, drive.goals)[odometry.goal == number]
    if goal.status in (Status.ABORTED, Status.REJECTED):
        return "given_up"
    if not len(distance) or distance[-1] <= float(args.get("within_m", 0.6)):
        return "unsettled"
    recent = distance[-max(2, len(distance) // 5) :]
    return "crawling" if recent[0] - recent[-1] >= _CRAWL_M else "stuck"


@extractor(
    "passages_passed",
    needs={},
    parts=("goals", "odometry"),
    unit="",
    args={"within_m": numeric("how near counts as passed, 0.6 m unless given")},
    rests_on=resting_on("odometry", bears=EXTREME),
)
def passages_passed(mission: Mission, args: Args) -> Value:
    """Share of the narrow passages listed in the profile's mission section that the robot came near to."""
    odometry = _placed(mission.shared(window))
    if isinstance(odometry, Unavailable):
        return odometry
    places = [(float(place[0]), float(place[1])) for place in mission.spec.get("passages", ())]
    if not places:
        return Unavailable("the profile lists no passages", "list them in its mission section")
    within_m = float(args.get("within_m", 0.6))
    near = [bool(np.hypot(odometry.x - x, odometry.y - y).min() <= within_m) for x, y in places]
    return sum(near) / len(places)


# Path


@measured("path_length", _odometry, unit="m", args=PER_METRE, bears=SUM)
def path_length(drive: DriveWindow, odometry: ActiveOdometry, args: Args) -> Value:
    """Length of the odometry's path."""
    return float(odometry.step_m.sum())


@measured("detour", _placed, unit="m", args=PER_METRE, bears=SUM)
def detour(drive: DriveWindow, odometry: ActiveOdometry, args: Args) -> Value:
    """Path driven beyond the way made towards the goals."""
    return float(odometry.step_m.sum()) - sum(_progress(odometry, drive.goals))


@measured("lateral_error", _placed, unit="m")
def lateral_error(drive: DriveWindow, odometry: ActiveOdometry, args: Args) -> Value:
    """Mean distance from the straight line between where a goal was sent and where it lies."""
    offsets = [_lateral(odometry, number, goal) for number, goal in enumerate(drive.goals)]
    joined = np.concatenate(offsets)
    return float(joined.mean()) if len(joined) else _TOO_SHORT


@measured("distance_left", _ends, unit="m", rests_on=arrivals)
def distance_left(drive: DriveWindow, left: _Ends, args: Args) -> Value:
    """Largest distance to a goal when it ended: the goal tolerance where all were reached, else where it got stuck."""
    return max(distance for distance, _ in left)


@measured("arrival_error", _arrivals, unit="m", rests_on=arrivals)
def arrival_error(drive: DriveWindow, left: _Ends, args: Args) -> Value:
    """Mean distance to the reached goals on arrival."""
    return float(np.mean([distance for distance, _ in left]))


@measured("heading_error", _arrivals, unit="rad", rests_on=arrivals)
def heading_error(drive: DriveWindow, left: _Ends, args: Args) -> Value:
    """Mean error of the heading on arrival at the reached goals."""
    return float(np.mean([angle for _, angle in left]))


@measured("settling_time", _placed, unit="s", args={"within_m": numeric("how near to the goal, 0.5 m unless given")})
def settling_time(drive: DriveWindow, odometry: ActiveOdometry, args: Args) -> Value:
    """Mean time near a goal before it ended: hunting for position and heading."""
    near = _goal_distance(odometry, drive.goals) <= float(args.get("within_m", 0.5))
    return float(odometry.dt[near].sum()) / len(drive.goals)


# Motion


@measured("drive_speed", _moving, unit="m/s")
def drive_speed(drive: DriveWindow, odometry: ActiveOdometry, args: Args) -> Value:
    """Mean forward speed while driving."""
    driving = np.abs(odometry.speed) >= STANDS_MPS
    return float(np.abs(odometry.speed[driving]).mean()) if driving.any() else 0.0


@measured("top_speed", _moving, unit="m/s")
def top_speed(drive: DriveWindow, odometry: ActiveOdometry, args: Args) -> Value:
    """95th percentile of the forward speed."""
    return quantile(np.abs(odometry.speed), 0.95)


@measured("top_turn_rate", _moving, unit="rad/s")
def top_turn_rate(drive: DriveWindow, odometry: ActiveOdometry, args: Args) -> Value:
    """95th percentile of the turn rate."""
    return quantile(np.abs(odometry.turn), 0.95)


@measured("drive_acceleration", _moving, unit="m/s^2")
def drive_acceleration(drive: DriveWindow, odometry: ActiveOdometry, args: Args) -> Value:
    """99th percentile of the change of forward speed."""
    step_s = np.diff(odometry.t)
    usable = (step_s > 0) & (step_s <= 1.0)
    if not usable.any():
        return _TOO_SHORT
    return quantile(np.abs(np.diff(odometry.speed)[usable] / step_s[usable]), 0.99)


@measured(
    "standstill",
    _moving,
    args={"of": one_of("share of the time, or longest in s; share unless given", "share", "longest")},
)
def standstill(drive: DriveWindow, odometry: ActiveOdometry, args: Args) -> Value:
    """Not moving while a goal is active: share of that time, or the longest stretch of it."""
    if args.get("of") == "longest":
        return longest(odometry.stands, odometry.dt)
    return share(odometry.stands, odometry.dt)


@measured("no_way_time", _moving, unit="s")
def no_way_time(drive: DriveWindow, odometry: ActiveOdometry, args: Args) -> Value:
    """Longest time without forward motion while a goal is active, turning on the spot included."""
    return longest(np.abs(odometry.speed) < STANDS_MPS, odometry.dt)


@measured("total_turn", _moving, unit="rad", args=PER_METRE, bears=SUM)
def total_turn(drive: DriveWindow, odometry: ActiveOdometry, args: Args) -> Value:
    """Sum of all turning, left and right alike."""
    return float((np.abs(odometry.turn) * odometry.dt).sum())


@measured("start_delay", _moving, unit="s")
def start_delay(drive: DriveWindow, odometry: ActiveOdometry, args: Args) -> Value:
    """Mean time from sending a goal to the first motion."""
    moving = ~odometry.stands
    delays = []
    for number, goal in enumerate(drive.goals):
        times = odometry.t[moving & (odometry.goal == number)]
        delays.append(float(times[0]) - goal.sent_s if len(times) else goal.time_s)
    return sum(delays) / len(delays)


# Commands


@measured("commanded_speed", _commands, parts=("goals", "commands"), unit="m/s")
def commanded_speed(drive: DriveWindow, commands: ActiveCommands, args: Args) -> Value:
    """Mean commanded forward speed among commands to drive."""
    driving = np.abs(commands.speed) >= STANDS_MPS
    return float(commands.speed[driving].mean()) if driving.any() else 0.0


@measured(
    "commanded_share",
    _commands,
    parts=("goals", "commands"),
    args={"order": one_of("stand, spot_turn or reverse; stand unless given", "stand", "spot_turn", "reverse")},
)
def commanded_share(drive: DriveWindow, commands: ActiveCommands, args: Args) -> Value:
    """Share of the time with a goal that the robot was commanded to stand, to turn on the spot, or to back up."""
    order = args.get("order", "stand")
    if order == "spot_turn":
        return share(commands.turns_on_spot, commands.dt)
    if order == "reverse":
        return share(np.asarray(commands.speed <= -STANDS_MPS), commands.dt)
    return share(commands.stands, commands.dt)


@measured("blocked_share", _moving, parts=("goals", "odometry", "commands"))
def blocked_share(drive: DriveWindow, odometry: ActiveOdometry, args: Args) -> Value:
    """Share of the time with a goal that forward motion was commanded and none came: contact, slip, a dead drive."""
    commands = _commands(drive)
    if isinstance(commands, Unavailable):
        return commands
    latest = np.clip(np.searchsorted(commands.t, odometry.t, side="right") - 1, 0, len(commands.t) - 1)
    ordered = np.abs(commands.speed[latest]) >= 2 * STANDS_MPS
    return share(np.asarray(ordered & (np.abs(odometry.speed) < STANDS_MPS)), odometry.dt)


@measured("turn_reversals", _commands, parts=("goals", "commands"), unit="1/min")
def turn_reversals(drive: DriveWindow, commands: ActiveCommands, args: Args) -> Value:
    """How often per minute the commanded turn changes side: a planner that cannot decide."""
    sides = np.sign(commands.turn[np.abs(commands.turn) >= STANDS_RADPS])
    total_s = float(commands.dt.sum())
    return float(np.count_nonzero(np.diff(sides))) / total_s * 60 if total_s > 0 else _TOO_SHORT


@measured(
    "command_interval",
    _commands,
    parts=("goals", "commands"),
    rests_on=_anything,
    unit="s",
    args={"percentile": numeric("0 to 100, 50 unless given")},
)
def command_interval(drive: DriveWindow, commands: ActiveCommands, args: Args) -> Value:
    """Time between commands while a goal is active: the controller's real period and, at the top, its stalls."""
    inside = [np.diff(commands.t[(commands.t >= goal.sent_s) & (commands.t <= goal.end_s)]) for goal in drive.goals]
    intervals = np.concatenate(inside)
    return quantile(intervals, float(args.get("percentile", 50)) / 100) if len(intervals) else _TOO_SHORT


# Recoveries and messages


@extractor(
    "recoveries",
    needs={},
    parts=("recoveries",),
    unit="",
    args={
        "behavior": "text in the behavior's name; all unless given",
        "absent": numeric(
            "value where the log lacks the topic, which is only published on a recovery; not known unless given"
        ),
        **PER_GOAL,
    },
)
@divided
def recoveries(mission: Mission, args: Args) -> Value:
    """Number of recovery behaviors that ran."""
    ran = goal_server(mission.spec).recoveries(mission)
    if isinstance(ran, Unavailable):
        return float(args["absent"]) if "absent" in args else ran
    wanted = str(args.get("behavior", "")).casefold()
    return float(sum(wanted in name.casefold() for _, name in ran))


@extractor(
    "rosout_count",
    needs=dict.fromkeys(ROSOUT_TOPICS, LOG_FIELDS),
    unit="",
    args={
        "text": "text in the message, ignoring case",
        "node": "text in the name of the node that said it, such as controller_server; any unless given",
        "level": numeric("lowest level that counts: 1 debug, 2 info, 4 warn, 8 error, 16 fatal; any unless given"),
    },
)
def rosout_count(mission: Mission, args: Args) -> Value:
    """Number of messages on /rosout with a text."""
    spoken = log_messages(mission)
    if spoken is None:
        return missing("/rosout")
    text, level = str(args.get("text", "")).casefold(), float(args.get("level", 0))
    node = str(args.get("node", "")).casefold()
    return float(
        sum(one.level >= level and node in one.node.casefold() and text in one.text.casefold() for one in spoken)
    )
