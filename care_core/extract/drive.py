"""A drive along goals, analysed once for all extractors: legs, odometry, commands, battery.

Pure functions of a mission's tables. The mission section of the profile names the topics, see `topics`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from care_core.extract.registry import Args, Mission
from care_core.logs.base import Table

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

GOAL_TIMEOUT_S = 60.0
TOLERANCE_M = 0.3

MOVING_MPS = 0.02
TURNING_RADPS = 0.05
"""Below these a robot stands still, and a command asks it to."""

_MAX_GAP_S = 1.0
"""A sample speaks for at most this long after it, so a gap in a topic counts as nothing."""

_POSITION = "goal.target_pose.pose.position"
_ORIENTATION = "goal.target_pose.pose.orientation"
GOAL_FIELDS = (
    "goal_id.id",
    "goal.target_pose.header.frame_id",
    f"{_POSITION}.x",
    f"{_POSITION}.y",
    *(f"{_ORIENTATION}.{axis}" for axis in "xyzw"),
)
RESULT_FIELDS = ("status.goal_id.id", "status.status", "status.text")
ODOMETRY_FIELDS = (
    "header.frame_id",
    "pose.pose.position.x",
    "pose.pose.position.y",
    *(f"pose.pose.orientation.{axis}" for axis in "xyzw"),
    "twist.twist.linear.x",
    "twist.twist.angular.z",
)
COMMAND_FIELDS = ("linear.x", "angular.z")
BATTERY_FIELDS = ("voltage", "current", "charge")
RECOVERY_FIELDS = ("recovery_behavior_name",)
ROSOUT_FIELDS = ("level", "name", "msg")


class Status(IntEnum):
    """How a goal ended (actionlib_msgs/GoalStatus)."""

    PREEMPTED = 2
    SUCCEEDED = 3
    ABORTED = 4
    REJECTED = 5
    RECALLED = 8
    LOST = 9


@dataclass(frozen=True, slots=True)
class Topics:
    """Where a platform's log holds what."""

    goal: str
    result: str
    recovery: str
    odometry: str
    commands: str
    battery: str


def topics(spec: Args) -> Topics:
    """Topics of a mission section; ROS 1 names where it does not say otherwise."""
    action = str(spec.get("action", "/move_base"))
    return Topics(
        goal=f"{action}/goal",
        result=f"{action}/result",
        recovery=f"{action}/recovery_status",
        odometry=str(spec.get("odometry", "/odom")),
        commands=str(spec.get("commands", "/cmd_vel")),
        battery=str(spec.get("battery", "/battery_state")),
    )


@dataclass(frozen=True, slots=True)
class Leg:
    """One goal: where it lies (m, rad), when it was sent, when and how it ended (status None: no answer in the log)."""

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
    """The goals (x, y) that a mission consists of; empty when the profile does not say."""
    return tuple((float(goal[0]), float(goal[1])) for goal in spec.get("goals", ()))


def find_legs(tables: Mapping[str, Table], spec: Args, duration_s: float) -> tuple[Leg, ...]:
    """Every goal of a log, in the order they were sent. A goal sent twice under one id counts once."""
    names = topics(spec)
    goals, results = tables.get(names.goal), tables.get(names.result)
    if goals is None or not has(goals, GOAL_FIELDS):
        return ()
    ids = goals["goal_id.id"].tolist()
    first_rows = [row for row, one in enumerate(ids) if not one or one not in ids[:row]]
    yaws = _yaw(goals, _ORIENTATION)
    legs = []
    for place, row in enumerate(first_rows):
        sent_s = float(goals.t[row])
        next_sent_s = float(goals.t[first_rows[place + 1]]) if place + 1 < len(first_rows) else duration_s
        answer = _answer(results, ids[row], sent_s, next_sent_s)
        legs.append(
            Leg(
                x=float(goals[f"{_POSITION}.x"][row]),
                y=float(goals[f"{_POSITION}.y"][row]),
                yaw=float(yaws[row]),
                frame=str(goals["goal.target_pose.header.frame_id"][row]),
                sent_s=sent_s,
                # A goal that another one replaces is over when that one is sent, whenever its answer comes.
                end_s=next_sent_s if answer is None else min(float(answer[0]), max(next_sent_s, sent_s)),
                status=None if answer is None else answer[1],
                text="" if answer is None else answer[2],
            )
        )
    return tuple(legs)


def _answer(results: Table | None, goal_id: str, sent_s: float, next_sent_s: float) -> tuple[float, int, str] | None:
    """Time, status and text of a goal's result: the one of its id, or without an id the next in time."""
    if results is None or not has(results, RESULT_FIELDS):
        return None
    for row in np.flatnonzero(results.t >= sent_s):
        same = results["status.goal_id.id"][row] == goal_id if goal_id else results.t[row] <= next_sent_s
        if same:
            return float(results.t[row]), int(results["status.status"][row]), str(results["status.text"][row])
    return None


@dataclass(frozen=True, slots=True, eq=False)
class Odometry:
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
    def step_m(self) -> Floats:
        """Distance from the sample before, shape (n,), 0 for the first."""
        return np.hypot(np.diff(self.x, prepend=self.x[:1]), np.diff(self.y, prepend=self.y[:1]))


@dataclass(frozen=True, slots=True, eq=False)
class Commands:
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


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """What extractors share. `odometry` and `commands` are None where the log lacks them."""

    legs: tuple[Leg, ...]
    timeout_s: float
    goals: tuple[tuple[float, float], ...]
    odometry: Odometry | None
    commands: Commands | None
    topics: Topics

    @property
    def reached(self) -> tuple[Leg, ...]:
        return tuple(leg for leg in self.legs if leg.reached(self.timeout_s))

    @property
    def active_s(self) -> float:
        return sum(leg.time_s for leg in self.legs)


def analyse(mission: Mission) -> Drive:
    """The drive of a mission; use through `mission.shared`."""
    # The end as the end of the log: legs of later missions are cut off by the window.
    every = find_legs(mission.tables, mission.spec, mission.end_s)
    legs = tuple(leg for leg in every if mission.start_s <= leg.sent_s <= mission.end_s)
    names = topics(mission.spec)
    return Drive(
        legs=legs,
        timeout_s=timeout_s(mission.spec),
        goals=listed_goals(mission.spec),
        odometry=_odometry(mission.table(names.odometry), legs),
        commands=_commands(mission.table(names.commands), legs),
        topics=names,
    )


def _odometry(table: Table | None, legs: Sequence[Leg]) -> Odometry | None:
    if table is None or not has(table, ODOMETRY_FIELDS):
        return None
    leg, dt = _active(table.t, legs)
    active = leg >= 0
    if np.count_nonzero(active) < 2:
        return None
    return Odometry(
        t=table.t[active],
        dt=dt[active],
        x=table["pose.pose.position.x"][active],
        y=table["pose.pose.position.y"][active],
        yaw=_yaw(table, "pose.pose.orientation")[active],
        speed=table["twist.twist.linear.x"][active],
        turn=table["twist.twist.angular.z"][active],
        leg=leg[active],
        frame=str(table["header.frame_id"][active][0]),
    )


def _commands(table: Table | None, legs: Sequence[Leg]) -> Commands | None:
    if table is None or not has(table, COMMAND_FIELDS):
        return None
    leg, dt = _active(table.t, legs)
    active = leg >= 0
    if np.count_nonzero(active) < 2:
        return None
    return Commands(table.t[active], dt[active], table["linear.x"][active], table["angular.z"][active])


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


def _yaw(table: Table, prefix: str) -> Floats:
    """Heading of a quaternion, rad."""
    x, y, z, w = (np.asarray(table[f"{prefix}.{axis}"], np.float64) for axis in "xyzw")
    yaw: Floats = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return yaw
