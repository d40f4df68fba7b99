"""Extractors of a drive along goals, whichever goal server was asked: goals and time, path, motion, commands, messages.

A planner says little about why it fails, so beside counts of messages and recoveries these measure what a failure
looks like: commands to stand or to turn on the spot, reversals of the turn command, standstill, distance left.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import wraps
from typing import TypeVar

import numpy as np

from care_core.ecosystems.measures import Args, Mission, extractor, missing, numeric, one_of
from care_core.ecosystems.ros.measures.drive import (
    MOVING_MPS,
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
    goal_server,
    longest,
    no_odometry,
    share,
)
from care_core.ecosystems.ros.measures.goals import ROSOUT, rosout
from care_core.ecosystems.ros.measures.requested import PER_GOAL, PER_METRE, divided, goals_asked
from care_core.numbers import quantile
from care_core.run import Unavailable, Value

_CRAWL_M = 0.3
"""How much nearer a goal must have come in the last fifth of its time to count as under way."""

T = TypeVar("T")
_Ends = list[tuple[float, float]]

_TOO_SHORT = Unavailable("too few messages while a goal was active", "record the whole mission")


# Parts of a drive, and what is measured on one


def _odometry(drive: Drive) -> Odometry | Unavailable:
    return no_odometry(drive) if drive.odometry is None else drive.odometry


def _moving(drive: Drive) -> Odometry | Unavailable:
    """Odometry that says how fast the robot is."""
    if drive.odometry is not None and not drive.odometry.tells_speed:
        return Unavailable(
            f"by its twist {drive.topics.odometry} stood, by its position it went", "have the driver fill in its twist"
        )
    return _odometry(drive)


def _placed(drive: Drive) -> Odometry | Unavailable:
    """Odometry in the frame of the goals, to measure distances to them."""
    odometry = drive.placed or drive.odometry
    if odometry is None:
        return no_odometry(drive)
    if any(math.isnan(leg.x) for leg in drive.legs):
        return Unavailable("the log does not say where the goals lie", "ros2 bag record /goal_pose /plan")
    frames = {leg.frame.strip("/") for leg in drive.legs} - {""}
    own = odometry.frame.strip("/")
    if own and frames - {own}:
        other = ", ".join(sorted(frames))
        hint = "name in the mission section a topic of nav_msgs/Odometry in the goals' frame"
        return Unavailable(f"goals are in frame {other}, odometry is in {own}", hint)
    return odometry


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


def _ends(drive: Drive, *, only_reached: bool = False) -> _Ends | Unavailable:
    """Distance (m) and heading error (rad) at the end of each leg, never an empty list."""
    odometry = _placed(drive)
    if isinstance(odometry, Unavailable):
        return odometry
    ends = []
    for number, leg in enumerate(drive.legs):
        rows = np.flatnonzero(odometry.leg == number)
        if len(rows) and (leg.reached(drive.timeout_s) or not only_reached):
            last = rows[-1]
            offset = leg.offset(float(odometry.x[last]), float(odometry.y[last]))
            ends.append((offset, angle_between(leg.yaw, float(odometry.yaw[last]))))
    return ends or Unavailable("no goal was reached", "see why its goals failed")


def _arrivals(drive: Drive) -> _Ends | Unavailable:
    """The same of the legs whose goal was reached."""
    return _ends(drive, only_reached=True)


def of_drive(
    part: Callable[[Drive], T | Unavailable],
) -> Callable[[Callable[[Drive, T, Args], Value]], Callable[[Mission, Args], Value]]:
    """Make an extractor of what is measured on a part of the drive; where the part is missing, that is the answer."""

    def wrap(measure: Callable[[Drive, T, Args], Value]) -> Callable[[Mission, Args], Value]:
        @wraps(measure)
        def extract(mission: Mission, args: Args) -> Value:
            drive = mission.shared(analyse)
            found = part(drive)
            return found if isinstance(found, Unavailable) else measure(drive, found, args)

        return extract

    return wrap


# Goals and time


@extractor("goals_sent", needs={}, parts=("goals",), unit="")
def goals_sent(mission: Mission, args: Args) -> Value:
    """Number of goals that were sent."""
    return float(len(mission.shared(analyse).legs))


@extractor("goals_reached", needs={}, parts=("goals",), unit="", args=PER_GOAL)
@divided
def goals_reached(mission: Mission, args: Args) -> Value:
    """Number of goals that ended in success, late ones included."""
    return float(sum(leg.status == Status.SUCCEEDED for leg in mission.shared(analyse).legs))


@extractor("goals_success", needs={}, parts=("goals",), unit="")
def goals_success(mission: Mission, args: Args) -> Value:
    """1 when every goal of the mission's list was reached within its time, else 0."""
    drive = mission.shared(analyse)
    wanted = len(drive.goals) or len(drive.legs)
    answered = [leg for leg in drive.legs if leg.status is not None or leg.time_s > drive.timeout_s]
    if all(leg.reached(drive.timeout_s) for leg in answered) and not mission.ended:
        return Unavailable("the log ends before the mission does", "record until the mission has ended")
    return float(len(drive.reached) == wanted and len(drive.legs) == wanted)


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
        return Unavailable(f"'{status.lower()}' is no goal status", "use one of those that its arguments name")
    return float(sum(leg.status == Status[status] for leg in mission.shared(analyse).legs))


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
    legs = mission.shared(analyse).legs
    times = [leg.time_s for leg in legs]
    if args.get("per") == "metre":
        found = mission.shared(goals_asked)
        if isinstance(found, Unavailable):
            return found
        times = [time / max(way_m, TOLERANCE_M) for time, way_m in zip(times, found[0].lengths.tolist(), strict=False)]
    if "index" in args:
        number = int(args["index"])
        if not 1 <= number <= len(legs):
            return Unavailable(f"goal {number} was not sent", f"{len(legs)} goals were")
        return times[number - 1]
    if args.get("of") == "variation":
        positive = np.log([time for time in times if time > 0])
        return float(np.std(positive, ddof=1)) if len(positive) > 1 else Unavailable("one goal varies from no other")
    return max(times) if args.get("of") == "longest" else sum(times) / len(times)


@extractor("time_per_metre", needs={}, parts=("goals", "odometry"), unit="s/m")
@of_drive(_placed)
def time_per_metre(drive: Drive, odometry: Odometry, args: Args) -> Value:
    """Time with a goal per metre of way made towards the goals."""
    made_m = sum(_progress(odometry, drive.legs))
    if made_m < 0.1:
        return Unavailable("the robot made no way towards its goals", "see what it was commanded")
    return drive.active_s / made_m


@extractor(
    "goals_approached",
    needs={},
    parts=("goals", "odometry"),
    unit="",
    args={"within_m": numeric("how near counts, 0.6 m unless given")},
)
@of_drive(_ends)
def goals_approached(drive: Drive, left: _Ends, args: Args) -> Value:
    """Share of the mission's goals that the robot was near to when they ended, reached or not."""
    within_m = float(args.get("within_m", 0.6))
    return sum(distance <= within_m for distance, _ in left) / (len(drive.goals) or len(drive.legs))


@extractor(
    "first_failure",
    needs={},
    parts=("goals", "odometry"),
    unit="",
    args={
        "how": one_of("given_up, unsettled, crawling or stuck", "given_up", "unsettled", "crawling", "stuck"),
        "within_m": numeric("how near to the goal, 0.6 m unless given"),
    },
)
@of_drive(_placed)
def first_failure(drive: Drive, odometry: Odometry, args: Args) -> Value:
    """1 when the first goal that was not reached failed in this way, else 0: `given_up` by the stack; out of time
    `unsettled` near the goal, `crawling` (it still came nearer, a share of the way too slow), or `stuck` on the way."""
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


@extractor(
    "passages_passed",
    needs={},
    parts=("goals", "odometry"),
    unit="",
    args={"within_m": numeric("how near counts as passed, 0.6 m unless given")},
)
def passages_passed(mission: Mission, args: Args) -> Value:
    """Share of the narrow passages listed in the profile's mission section that the robot came near to."""
    odometry = _placed(mission.shared(analyse))
    if isinstance(odometry, Unavailable):
        return odometry
    places = [(float(place[0]), float(place[1])) for place in mission.spec.get("passages", ())]
    if not places:
        return Unavailable("the profile lists no passages", "list them in its mission section")
    within_m = float(args.get("within_m", 0.6))
    near = [bool(np.hypot(odometry.x - x, odometry.y - y).min() <= within_m) for x, y in places]
    return sum(near) / len(places)


# Path


@extractor("path_length", needs={}, parts=("goals", "odometry"), unit="m", args=PER_METRE)
@divided
@of_drive(_odometry)
def path_length(drive: Drive, odometry: Odometry, args: Args) -> Value:
    """Length of the odometry's path."""
    return float(odometry.step_m.sum())


@extractor("detour", needs={}, parts=("goals", "odometry"), unit="m", args=PER_METRE)
@divided
@of_drive(_placed)
def detour(drive: Drive, odometry: Odometry, args: Args) -> Value:
    """Path driven beyond the way made towards the goals."""
    return float(odometry.step_m.sum()) - sum(_progress(odometry, drive.legs))


@extractor("lateral_error", needs={}, parts=("goals", "odometry"), unit="m")
@of_drive(_placed)
def lateral_error(drive: Drive, odometry: Odometry, args: Args) -> Value:
    """Mean distance from the straight line between where a goal was sent and where it lies."""
    offsets = [_lateral(odometry, number, leg) for number, leg in enumerate(drive.legs)]
    joined = np.concatenate(offsets)
    return float(joined.mean()) if len(joined) else _TOO_SHORT


@extractor("distance_left", needs={}, parts=("goals", "odometry"), unit="m")
@of_drive(_ends)
def distance_left(drive: Drive, left: _Ends, args: Args) -> Value:
    """Largest distance to a goal when it ended: the goal tolerance where all were reached, else where it got stuck."""
    return max(distance for distance, _ in left)


@extractor("arrival_error", needs={}, parts=("goals", "odometry"), unit="m")
@of_drive(_arrivals)
def arrival_error(drive: Drive, left: _Ends, args: Args) -> Value:
    """Mean distance to the reached goals on arrival."""
    return float(np.mean([distance for distance, _ in left]))


@extractor("heading_error", needs={}, parts=("goals", "odometry"), unit="rad")
@of_drive(_arrivals)
def heading_error(drive: Drive, left: _Ends, args: Args) -> Value:
    """Mean error of the heading on arrival at the reached goals."""
    return float(np.mean([angle for _, angle in left]))


@extractor(
    "settling_time",
    needs={},
    parts=("goals", "odometry"),
    unit="s",
    args={"within_m": numeric("how near to the goal, 0.5 m unless given")},
)
@of_drive(_placed)
def settling_time(drive: Drive, odometry: Odometry, args: Args) -> Value:
    """Mean time near a goal before it ended: hunting for position and heading."""
    near = _goal_distance(odometry, drive.legs) <= float(args.get("within_m", 0.5))
    return float(odometry.dt[near].sum()) / len(drive.legs)


# Motion


@extractor("drive_speed", needs={}, parts=("goals", "odometry"), unit="m/s")
@of_drive(_moving)
def drive_speed(drive: Drive, odometry: Odometry, args: Args) -> Value:
    """Mean forward speed while driving."""
    driving = np.abs(odometry.speed) >= MOVING_MPS
    return float(np.abs(odometry.speed[driving]).mean()) if driving.any() else 0.0


@extractor("top_speed", needs={}, parts=("goals", "odometry"), unit="m/s")
@of_drive(_moving)
def top_speed(drive: Drive, odometry: Odometry, args: Args) -> Value:
    """95th percentile of the forward speed."""
    return quantile(np.abs(odometry.speed), 0.95)


@extractor("top_turn_rate", needs={}, parts=("goals", "odometry"), unit="rad/s")
@of_drive(_moving)
def top_turn_rate(drive: Drive, odometry: Odometry, args: Args) -> Value:
    """95th percentile of the turn rate."""
    return quantile(np.abs(odometry.turn), 0.95)


@extractor("drive_acceleration", needs={}, parts=("goals", "odometry"), unit="m/s^2")
@of_drive(_moving)
def drive_acceleration(drive: Drive, odometry: Odometry, args: Args) -> Value:
    """99th percentile of the change of forward speed."""
    step_s = np.diff(odometry.t)
    usable = (step_s > 0) & (step_s <= 1.0)
    if not usable.any():
        return _TOO_SHORT
    return quantile(np.abs(np.diff(odometry.speed)[usable] / step_s[usable]), 0.99)


@extractor(
    "standstill",
    needs={},
    parts=("goals", "odometry"),
    unit="",
    args={"of": one_of("share of the time, or longest in s; share unless given", "share", "longest")},
)
@of_drive(_moving)
def standstill(drive: Drive, odometry: Odometry, args: Args) -> Value:
    """Not moving while a goal is active: share of that time, or the longest stretch of it."""
    if args.get("of") == "longest":
        return longest(odometry.stands, odometry.dt)
    return share(odometry.stands, odometry.dt)


@extractor("no_way_time", needs={}, parts=("goals", "odometry"), unit="s")
@of_drive(_moving)
def no_way_time(drive: Drive, odometry: Odometry, args: Args) -> Value:
    """Longest time without forward motion while a goal is active, turning on the spot included."""
    return longest(np.abs(odometry.speed) < MOVING_MPS, odometry.dt)


@extractor("total_turn", needs={}, parts=("goals", "odometry"), unit="rad", args=PER_METRE)
@divided
@of_drive(_moving)
def total_turn(drive: Drive, odometry: Odometry, args: Args) -> Value:
    """Sum of all turning, left and right alike."""
    return float((np.abs(odometry.turn) * odometry.dt).sum())


@extractor("start_delay", needs={}, parts=("goals", "odometry"), unit="s")
@of_drive(_moving)
def start_delay(drive: Drive, odometry: Odometry, args: Args) -> Value:
    """Mean time from sending a goal to the first motion."""
    moving = ~odometry.stands
    delays = []
    for number, leg in enumerate(drive.legs):
        times = odometry.t[moving & (odometry.leg == number)]
        delays.append(float(times[0]) - leg.sent_s if len(times) else leg.time_s)
    return sum(delays) / len(delays)


# Commands


@extractor("commanded_speed", needs={}, parts=("goals", "commands"), unit="m/s")
@of_drive(_commands)
def commanded_speed(drive: Drive, commands: Commands, args: Args) -> Value:
    """Mean commanded forward speed among commands to drive."""
    driving = np.isfinite(commands.speed) & (np.abs(commands.speed) >= MOVING_MPS)
    return float(commands.speed[driving].mean()) if driving.any() else 0.0


@extractor(
    "commanded_share",
    needs={},
    parts=("goals", "commands"),
    unit="",
    args={"order": one_of("stand, spot_turn or reverse; stand unless given", "stand", "spot_turn", "reverse")},
)
@of_drive(_commands)
def commanded_share(drive: Drive, commands: Commands, args: Args) -> Value:
    """Share of the time with a goal that the robot was commanded to stand, to turn on the spot, or to back up."""
    order = args.get("order", "stand")
    if order == "spot_turn":
        return share(commands.turns_on_spot, commands.dt)
    if order == "reverse":
        return share(np.asarray(commands.speed <= -MOVING_MPS), commands.dt)
    return share(commands.stands, commands.dt)


@extractor("blocked_share", needs={}, parts=("goals", "odometry", "commands"), unit="")
@of_drive(_moving)
def blocked_share(drive: Drive, odometry: Odometry, args: Args) -> Value:
    """Share of the time with a goal that forward motion was commanded and none came: contact, slip, a dead drive."""
    commands = _commands(drive)
    if isinstance(commands, Unavailable):
        return commands
    latest = np.clip(np.searchsorted(commands.t, odometry.t, side="right") - 1, 0, len(commands.t) - 1)
    ordered = np.abs(commands.speed[latest]) >= 2 * MOVING_MPS
    return share(np.asarray(ordered & (np.abs(odometry.speed) < MOVING_MPS)), odometry.dt)


@extractor("turn_reversals", needs={}, parts=("goals", "commands"), unit="1/min")
@of_drive(_commands)
def turn_reversals(drive: Drive, commands: Commands, args: Args) -> Value:
    """How often per minute the commanded turn changes side: a planner that cannot decide."""
    sides = np.sign(commands.turn[np.abs(commands.turn) >= TURNING_RADPS])
    total_s = float(commands.dt.sum())
    return float(np.count_nonzero(np.diff(sides))) / total_s * 60 if total_s > 0 else _TOO_SHORT


@extractor(
    "command_interval",
    needs={},
    parts=("goals", "commands"),
    unit="s",
    args={"percentile": numeric("0 to 100, 50 unless given")},
)
@of_drive(_commands)
def command_interval(drive: Drive, commands: Commands, args: Args) -> Value:
    """Time between commands while a goal is active: the controller's real period and, at the top, its stalls."""
    inside = [np.diff(commands.t[(commands.t >= leg.sent_s) & (commands.t <= leg.end_s)]) for leg in drive.legs]
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
    needs=dict.fromkeys(ROSOUT, ROSOUT_FIELDS),
    unit="",
    args={
        "text": "text in the message, ignoring case",
        "node": "text in the name of the node that said it, such as controller_server; any unless given",
        "level": numeric("lowest level that counts: 1 debug, 2 info, 4 warn, 8 error, 16 fatal; any unless given"),
    },
)
def rosout_count(mission: Mission, args: Args) -> Value:
    """Number of messages on /rosout with a text."""
    table = rosout(mission)
    if table is None:
        return missing("/rosout")
    text, level = str(args.get("text", "")).casefold(), float(args.get("level", 0))
    node = str(args.get("node", "")).casefold()
    said = zip(table["level"].tolist(), table["name"].tolist(), table["msg"].tolist(), strict=True)
    return float(sum(one >= level and node in name.casefold() and text in msg.casefold() for one, name, msg in said))
