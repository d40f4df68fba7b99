"""A drive along goals, analysed once for all extractors: legs, odometry, commands.

Pure functions of a mission's tables. The mission section of the profile names the topics, see `topics`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from enum import IntEnum
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from care_core.ecosystems.measures import Args, Mission, missing
from care_core.logs.base import Table, Wanted
from care_core.logs.plausible import APART, STAMP, is_simulated, never_moved, stamps_pace
from care_core.records import Record, replace
from care_core.run import Unavailable

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

GOAL_TIMEOUT_S = 60.0
TOLERANCE_M = 0.3

MOVING_MPS = 0.02
TURNING_RADPS = 0.05
"""Below these a robot stands still, and a command asks it to."""

_WENT_M = 1.0
"""Who went so far was not standing all the time."""

_MAX_GAP_S = 1.0
"""A sample speaks for at most this long after it, so a gap in a topic counts as nothing."""

ODOMETRY_FIELDS = (
    "header.frame_id",
    "pose.pose.position.x",
    "pose.pose.position.y",
    *(f"pose.pose.orientation.{axis}" for axis in "xyzw"),
    "twist.twist.linear.x",
    "twist.twist.angular.z",
)
COMMAND_FIELDS = ("linear.x", "angular.z")
STAMPED_COMMAND_FIELDS = tuple(f"twist.{name}" for name in COMMAND_FIELDS)
"""Of geometry_msgs/TwistStamped, which newer ROS 2 stacks publish."""
STAMPED_FIELDS = (STAMP,)
"""By whose clock the messages above and below were made: what tells that a clock runs wrong."""
BATTERY_FIELDS = ("voltage", "current", "charge")
ROSOUT_FIELDS = ("level", "name", "msg")


class Status(IntEnum):
    """How a goal ended, in the codes of actionlib_msgs/GoalStatus."""

    PREEMPTED = 2
    SUCCEEDED = 3
    ABORTED = 4
    REJECTED = 5
    RECALLED = 8
    LOST = 9


class Topics(Record):
    """Where a platform's log holds what is not the goal server's own."""

    odometry: str
    commands: str
    battery: str


def topics(spec: Args) -> Topics:
    """Topics of a mission section; the usual names where it does not say otherwise."""
    return Topics(
        odometry=str(spec.get("odometry", "/odom")),
        commands=str(spec.get("commands", "/cmd_vel")),
        battery=str(spec.get("battery", "/battery_state")),
    )


class Leg(Record):
    """One goal: where it lies (m, rad; nan where the log does not say), when it was sent, when and how it ended.

    `status` is None where the log holds no answer.
    """

    x: float
    y: float
    yaw: float
    frame: str
    sent_s: float
    end_s: float
    status: int | None
    text: str = ""

    @property
    def time_s(self) -> float:
        return self.end_s - self.sent_s

    def reached(self, timeout_s: float) -> bool:
        """Succeeded, and within its time."""
        return self.status == Status.SUCCEEDED and self.time_s <= timeout_s

    def offset(self, x: float, y: float) -> float:
        """Distance to a point, m."""
        return math.hypot(self.x - x, self.y - y)


def timeout_s(spec: Args) -> float:
    """How long a goal may take."""
    return float(spec.get("goal_timeout_s", GOAL_TIMEOUT_S))


def listed_goals(spec: Args) -> tuple[tuple[float, float], ...]:
    """The goals (x, y) of the profile's own mission; empty when it does not say."""
    return tuple((float(goal[0]), float(goal[1])) for goal in spec.get("goals", ()))


def listed_headings(spec: Args) -> tuple[float, ...]:
    """The headings asked for at them, rad; nan where the profile does not say."""
    return tuple(float(goal[2]) if len(goal) > 2 else math.nan for goal in spec.get("goals", ()))


def difference(legs: Sequence[Leg], spec: Args) -> str:
    """What tells a mission from the profile's own, empty where nothing does. One that was given up is still its own."""
    goals = listed_goals(spec)
    tolerance_m = float(spec.get("tolerance_m", TOLERANCE_M))
    for number, leg in enumerate(legs if goals else (), start=1):
        if number > len(goals):
            return f"{len(legs)} goals were sent, the profile's mission has {len(goals)}"
        off_m = leg.offset(*goals[number - 1])
        if math.isnan(off_m):
            return f"the log does not say where goal {number} lies"
        if off_m > tolerance_m:
            return f"goal {number} lies {off_m:.1f} m from the profile's"
    return ""


def own_goals(legs: Sequence[Leg], spec: Args) -> tuple[tuple[float, float], ...]:
    """The goals of the profile's own mission where this is it; empty where the goals are others."""
    return () if difference(legs, spec) else listed_goals(spec)


def time_limit_s(legs: Sequence[Leg], spec: Args) -> float:
    """How long each goal may take. The profile says it of its own goals; where others lie farther apart, longer."""
    goals = listed_goals(spec)
    if len(goals) < 2 or not difference(legs, spec):
        return timeout_s(spec)
    listed_m = max(math.dist(a, b) for a, b in pairwise(goals))
    apart_m = [math.dist((a.x, a.y), (b.x, b.y)) for a, b in pairwise(legs)]
    return timeout_s(spec) * max([1.0, *(one / listed_m for one in apart_m if math.isfinite(one))])


Recoveries = Sequence[tuple[float, str]]
"""Time and name of each recovery behavior that ran."""


class Poses(Record, eq=False):
    """Poses of the robot in a frame: s, m, rad, all shape (n,)."""

    t: Floats
    x: Floats
    y: Floats
    yaw: Floats
    frame: str


class GoalServer(Record):
    """How the log of a kind of goal server tells its goals: one a mission kind, see `actionlib` and `nav2`."""

    needs: Callable[[Args], Wanted]
    legs: Callable[[Mapping[str, Table], Args, float], tuple[Leg, ...]]
    """Every goal of a log of that duration (s), in the order they were sent."""
    recoveries: Callable[[Mission], Recoveries | Unavailable]
    poses: Callable[[Mission], Poses | None] = lambda _: None
    """Where the server said that the robot was, in the frame of the goals."""


GOAL_SERVERS: dict[str, GoalServer] = {}
"""By the `kind` of the mission section."""


def goal_server(spec: Args) -> GoalServer:
    """The goal server of a mission section."""
    return GOAL_SERVERS[str(spec.get("kind", "actionlib_goals"))]


class Odometry(Record, eq=False):
    """Odometry while a goal is active: m, rad, m/s, rad/s; `dt` is what each sample speaks for. All shape (n,)."""

    t: Floats
    dt: Floats
    x: Floats
    y: Floats
    yaw: Floats
    speed: Floats
    turn: Floats
    leg: NDArray[np.intp]
    frame: str

    @property
    def stands(self) -> Bools:
        return np.asarray((np.abs(self.speed) < MOVING_MPS) & (np.abs(self.turn) < TURNING_RADPS))

    @property
    def tells_speed(self) -> bool:
        """Whether its twist is filled in: some drivers leave it zero, while the position goes on."""
        return not self.stands.all() or float(self.step_m.sum()) < _WENT_M

    @property
    def step_m(self) -> Floats:
        """Distance from the sample before, shape (n,), 0 for the first."""
        return np.hypot(np.diff(self.x, prepend=self.x[:1]), np.diff(self.y, prepend=self.y[:1]))


class Commands(Record, eq=False):
    """Velocity commands while a goal is active: m/s, rad/s; `dt` is how long each was in force. All shape (n,)."""

    t: Floats
    dt: Floats
    speed: Floats
    turn: Floats

    @property
    def stands(self) -> Bools:
        return np.asarray((np.abs(self.speed) < MOVING_MPS) & (np.abs(self.turn) < TURNING_RADPS))

    @property
    def turns_on_spot(self) -> Bools:
        return np.asarray((np.abs(self.speed) < MOVING_MPS) & (np.abs(self.turn) >= TURNING_RADPS))


class Drive(Record, eq=False):
    """What extractors share. `odometry` and `commands` are None where the log lacks them, odometry also where it cannot
    be right: `doubt` says why."""

    legs: tuple[Leg, ...]
    timeout_s: float
    goals: tuple[tuple[float, float], ...]
    odometry: Odometry | None
    commands: Commands | None
    topics: Topics
    doubt: str = ""
    placed: Odometry | None = None
    """The odometry in the frame of the goals, where the goal server says where the robot is; its steps are not those of
    the wheels: a localization corrects itself."""

    @property
    def reached(self) -> tuple[Leg, ...]:
        return tuple(leg for leg in self.legs if leg.reached(self.timeout_s))

    @property
    def active_s(self) -> float:
        return sum(leg.time_s for leg in self.legs)


def analyse(mission: Mission) -> Drive:
    """The drive of a mission; use through `mission.shared`."""
    # The end as the end of the log: legs of later missions are cut off by the window.
    every = goal_server(mission.spec).legs(mission.tables, mission.spec, mission.end_s)
    legs = tuple(leg for leg in every if mission.start_s <= leg.sent_s <= mission.end_s)
    names = topics(mission.spec)
    table = mission.table(names.odometry)
    odometry, commands = _odometry(table, legs), _commands(mission.table(names.commands), legs)
    doubt = _odometry_doubt(names.odometry, table, odometry, commands, legs)
    return Drive(
        legs=legs,
        timeout_s=time_limit_s(legs, mission.spec),
        goals=own_goals(legs, mission.spec),
        odometry=None if doubt else odometry,
        commands=commands,
        topics=names,
        doubt=doubt,
        placed=None if doubt or odometry is None else _placed(odometry, goal_server(mission.spec).poses(mission)),
    )


def no_odometry(drive: Drive) -> Unavailable:
    """Why a drive has no odometry."""
    if drive.doubt:
        return Unavailable(drive.doubt, "check the odometry's source and its driver")
    return missing(drive.topics.odometry)


def _odometry(table: Table | None, legs: Sequence[Leg]) -> Odometry | None:
    if table is None or not has(table, ODOMETRY_FIELDS):
        return None
    leg, dt = _active(table.t, legs)
    numbers = sum(np.asarray(table[name], np.float64) for name in (*ODOMETRY_FIELDS[1:3], *ODOMETRY_FIELDS[-2:]))
    active = (leg >= 0) & np.isfinite(numbers)
    if np.count_nonzero(active) < 2:
        return None
    return Odometry(
        t=table.t[active],
        dt=dt[active],
        x=table["pose.pose.position.x"][active],
        y=table["pose.pose.position.y"][active],
        yaw=heading(table, "pose.pose.orientation")[active],
        speed=table["twist.twist.linear.x"][active],
        turn=table["twist.twist.angular.z"][active],
        leg=leg[active],
        frame=str(table["header.frame_id"][active][0]),
    )


def _placed(odometry: Odometry, poses: Poses | None) -> Odometry | None:
    """The odometry moved to the last pose that was told before each sample, the first one before it."""
    if poses is None or poses.frame.strip("/") == odometry.frame.strip("/"):
        return None
    told = np.interp(poses.t, odometry.t, np.arange(len(odometry.t))).round().astype(np.intp)
    at = np.clip(np.searchsorted(poses.t, odometry.t, side="right") - 1, 0, None)
    off = poses.yaw[at] - odometry.yaw[told[at]]
    dx, dy = odometry.x - odometry.x[told[at]], odometry.y - odometry.y[told[at]]
    return replace(
        odometry,
        x=poses.x[at] + np.cos(off) * dx - np.sin(off) * dy,
        y=poses.y[at] + np.sin(off) * dx + np.cos(off) * dy,
        yaw=odometry.yaw + off,
        frame=poses.frame,
    )


def _odometry_doubt(
    topic: str, table: Table | None, odometry: Odometry | None, commands: Commands | None, legs: Sequence[Leg]
) -> str:
    """Why what odometry says cannot be, in words; empty where it can, and where there is none."""
    if table is None or not has(table, ODOMETRY_FIELDS):
        return ""
    active = int(np.count_nonzero(_active(table.t, legs)[0] >= 0))
    if 2 * (0 if odometry is None else len(odometry.t)) < active:
        return f"{topic} says no numbers in most of its messages"
    if odometry is not None and never_moved(float(odometry.step_m.sum()), len(odometry.t), _way_m(commands, legs)):
        return f"{topic} says that the robot never moved, but it reached its goals"
    if STAMP in table.columns and not is_simulated(table.t, table[STAMP]):
        pace = stamps_pace(table.t, table[STAMP])
        if pace is not None and not 1 / APART <= pace <= APART:
            return f"the stamps of {topic} run at {pace:.2g} of the recording's clock"
    return ""


def _way_m(commands: Commands | None, legs: Sequence[Leg]) -> float:
    """How far the robot must have gone, m: from reached goal to reached goal, or as it was commanded to reach them."""
    reached = [leg for leg in legs if leg.status == Status.SUCCEEDED]
    way_m = sum(one for a, b in pairwise(reached) if math.isfinite(one := math.dist((a.x, a.y), (b.x, b.y))))
    if commands is None:
        return way_m
    under = (_active(commands.t, reached)[0] >= 0) & np.isfinite(commands.speed) & np.isfinite(commands.dt)
    return max(way_m, float((np.abs(commands.speed[under]) * commands.dt[under]).sum()))


def _commands(table: Table | None, legs: Sequence[Leg]) -> Commands | None:
    if table is None:
        return None
    fields = next((fields for fields in (COMMAND_FIELDS, STAMPED_COMMAND_FIELDS) if has(table, fields)), None)
    leg, dt = _active(table.t, legs)
    active = leg >= 0
    if fields is None or np.count_nonzero(active) < 2:
        return None
    forward, turn = (table[name][active] for name in fields)
    return Commands(table.t[active], dt[active], forward, turn)


def _active(t: Floats, legs: Sequence[Leg]) -> tuple[NDArray[np.intp], Floats]:
    """Per sample the number of the active leg (-1: none), and the time it speaks for."""
    leg = np.full(len(t), -1, np.intp)
    for number, one in enumerate(legs):
        leg[(t >= one.sent_s) & (t <= one.end_s)] = number
    dt = np.minimum(np.diff(t, append=t[-1:]), _MAX_GAP_S)
    return leg, dt


def has(table: Table, fields: Sequence[str]) -> bool:
    """Whether a table holds all the fields, and a message at all."""
    return len(table) > 0 and all(name in table.columns for name in fields)


def share(where: Bools, weight: Floats) -> float:
    """Share of the time, 0 to 1, that a condition held."""
    total = float(weight.sum())
    return float(weight[where].sum()) / total if total > 0 else 0.0


def longest(where: Bools, dt: Floats) -> float:
    """The longest unbroken time that a condition held, s."""
    best = current = 0.0
    for held, time_s in zip(where.tolist(), dt.tolist(), strict=True):
        current = current + time_s if held else 0.0
        best = max(best, current)
    return best


def angle_between(a: float, b: float) -> float:
    """The smaller angle between two headings, rad, 0 to pi."""
    return abs((a - b + math.pi) % (2 * math.pi) - math.pi)


def heading(table: Table, prefix: str) -> Floats:
    """Heading of a unit quaternion, rad; a part beyond 1 is a damaged one."""
    x, y, z, w = (np.clip(np.asarray(table[f"{prefix}.{axis}"], np.float64), -1.0, 1.0) for axis in "xyzw")
    yaw: Floats = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return yaw
