"""Goals of action servers: when they were sent and how they ended. actionlib of ROS 1, status topics of ROS 2."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from enum import IntEnum
from typing import Any, Literal

import numpy as np

from care_core.ecosystems.ros.messages import ACTION_RESULT, MESSAGES, STATUS, holds, yaw_of
from care_core.logs.base import Table
from care_core.records import Record, Struct, replace

Outcome = Literal["reached", "cancelled", "aborted", "rejected", "lost", "not reached", "replaced", ""]
"""How a goal ended; empty where the recording does not say."""

STATUS_TOPIC = "/_action/status"
"""How the topics end on which ROS 2 actions tell of their goals."""
_DRIVES = ("navigate", "move_base")
"""Part of the name of an action that drives."""


class Status(IntEnum):
    """How a goal ended, in the codes of actionlib_msgs/GoalStatus, and one for what no action tells."""

    PREEMPTED = 2
    SUCCEEDED = 3
    ABORTED = 4
    REJECTED = 5
    RECALLED = 8
    LOST = 9
    NOT_REACHED = 100
    """By where the robot is."""


_OUTCOMES: Mapping[int, Outcome] = {
    Status.PREEMPTED: "cancelled",
    Status.SUCCEEDED: "reached",
    Status.ABORTED: "aborted",
    Status.REJECTED: "rejected",
    Status.RECALLED: "cancelled",
    Status.LOST: "lost",
    Status.NOT_REACHED: "not reached",
}
FAILED = (Status.ABORTED, Status.REJECTED, Status.LOST, Status.NOT_REACHED)
"""How goals end that the robot did not reach though nobody took them back."""
_SAME_M = 0.05
"""Goals that lie no farther apart are the same place."""
_ROS2 = {4: Status.SUCCEEDED, 5: Status.PREEMPTED, 6: Status.ABORTED}
"""Final codes of action_msgs/GoalStatus (1 accepted, 2 executing, 3 canceling)."""


class Goal(Record):
    """A goal of an action: when it was sent, when and how it ended, and where it lies (m, rad; nan where the recording
    does not say)."""

    action: str
    sent_s: float
    end_s: float
    status: int | None
    """None where the recording holds no answer."""
    text: str = ""
    x: float = math.nan
    y: float = math.nan
    yaw: float = math.nan
    frame: str = ""
    is_replaced: bool = False
    """Whether another goal was sent before this one had ended, which ends it."""

    @property
    def time_s(self) -> float:
        return self.end_s - self.sent_s

    @property
    def outcome(self) -> Outcome:
        if self.is_replaced:
            return "replaced"
        return "" if self.status is None else _OUTCOMES.get(self.status, "")

    @property
    def failed(self) -> bool:
        return self.outcome not in ("reached", "replaced", "")

    @property
    def drives(self) -> bool:
        """Whether it is a place to drive to."""
        return not math.isnan(self.x) or any(word in self.action for word in _DRIVES)

    def reached(self, timeout_s: float) -> bool:
        """Succeeded, and within its time."""
        return self.status == Status.SUCCEEDED and self.time_s <= timeout_s

    def offset(self, x: float, y: float) -> float:
        """Distance to a point, m."""
        return math.hypot(self.x - x, self.y - y)


def actionlib_goals(action: str, sent: Table, results: Table | None, until_s: float) -> tuple[Goal, ...]:
    """Every goal of a ROS 1 action, in the order they were sent; one sent twice under one id counts once.

    Args:
        until_s: the end of the recording.
    """
    if "goal_id.id" not in sent.columns:
        return ()
    ids = [str(name) for name in sent["goal_id.id"]]
    first = {name: row for row, name in reversed(list(enumerate(ids)))}
    rows = [row for row, name in enumerate(ids) if not name or first[name] == row]
    places = tuple(_places(sent))
    goals = []
    for number, row in enumerate(rows):
        sent_s, is_last = float(sent.t[row]), number + 1 == len(rows)
        next_s = until_s if is_last else float(sent.t[rows[number + 1]])
        answer = _answer(results, ids[row], sent_s, next_s)
        replaced = not is_last and (answer is None or answer[0] > next_s)
        # A goal that another one replaces is over when that one is sent, whenever its answer comes.
        end_s = next_s if answer is None else min(answer[0], max(next_s, sent_s))
        _, status, text = answer or (end_s, None, "")
        goals.append(Goal(action, sent_s, end_s, status, text, *places[row], is_replaced=replaced))
    return tuple(goals)


def sent_again(goals: Sequence[Goal]) -> tuple[Goal, ...]:
    """The goals, where those that were sent anew to the same place while they were under way are one, from when it was
    first sent."""
    merged: list[Goal] = []
    for goal in goals:
        last = merged[-1] if merged else None
        if (
            last is not None
            and last.is_replaced
            and last.frame == goal.frame
            and last.offset(goal.x, goal.y) <= _SAME_M
        ):
            merged[-1] = replace(goal, sent_s=last.sent_s)
        else:
            merged.append(goal)
    return tuple(merged)


def _places(sent: Table) -> Iterator[tuple[float, float, float, str]]:
    """Where each goal lies: m, rad, frame."""
    target = "goal.target_pose"
    x, y = (sent.columns.get(f"{target}.pose.position.{axis}") for axis in "xy")
    if x is None or y is None:
        yield from [(math.nan, math.nan, math.nan, "")] * len(sent)
        return
    turned = all(f"{target}.pose.orientation.{axis}" in sent.columns for axis in "xyzw")
    yaws = yaw_of(sent, f"{target}.pose.orientation") if turned else np.full(len(sent), np.nan)
    frames = sent.columns.get(f"{target}.header.frame_id", [""] * len(sent))
    for row in range(len(sent)):
        yield float(x[row]), float(y[row]), float(yaws[row]), str(frames[row])


def _answer(results: Table | None, goal_id: str, sent_s: float, next_s: float) -> tuple[float, int, str] | None:
    """Time, status and text of a goal's result: the one of its id, or without an id the next in time."""
    if results is None or not holds(results, ACTION_RESULT):
        return None
    ids, codes, texts = (results[name] for name in MESSAGES[ACTION_RESULT].reads)
    for row in np.flatnonzero(results.t >= sent_s):
        if (ids[row] == goal_id if goal_id else results.t[row] <= next_s) and _is_code(codes[row]):
            return float(results.t[row]), int(codes[row]), str(texts[row])
    return None


def _is_code(value: Any) -> bool:
    return isinstance(value, (int, float)) and math.isfinite(value)


class _States(Struct, eq=False):
    """A goal as the states of its action tell it."""

    action: str
    sent_s: float
    ended_s: float | None = None
    status: Status | None = None


def nav2_goals(states: Mapping[str, Table], until_s: float) -> tuple[Goal, ...]:
    """Every goal of ROS 2 actions of which one server works on one goal at a time, in the order they were accepted.

    A goal that was over before the log began (its last state is repeated to every new listener) is none of them. One
    that another replaces is over when that one is accepted; Nav2 calls it aborted then, though nobody gave up.

    Args:
        states: messages of the status topic by action.
        until_s: the end of the recording.
    """
    accepted = sorted(
        (goal for action, table in states.items() for goal in _states(action, table)), key=lambda goal: goal.sent_s
    )
    goals = []
    for number, goal in enumerate(accepted):
        is_last = number + 1 == len(accepted)
        next_s = until_s if is_last else accepted[number + 1].sent_s
        ended_s, status = goal.ended_s, goal.status
        is_over = ended_s is not None and (ended_s < next_s or (ended_s == next_s and status == Status.SUCCEEDED))
        replaced = not is_last and not is_over
        if replaced:
            ended_s, status = next_s, status and Status.PREEMPTED
        end_s = next_s if ended_s is None else ended_s
        goals.append(Goal(goal.action, goal.sent_s, end_s, status, is_replaced=replaced))
    return tuple(goals)


def _states(action: str, table: Table) -> list[_States]:
    """Goals by their id: when a state was first told, and the final one."""
    if not holds(table, STATUS):
        return []
    goals: dict[bytes, _States] = {}
    over_before: set[bytes] = set()
    columns = (table[name] for name in MESSAGES[STATUS].reads)
    last_s = -math.inf
    for time_s, ids, codes in zip(table.t.tolist(), *columns, strict=True):
        for uuid, code in zip(ids, codes, strict=True):
            key, end = bytes(bytearray(uuid)), _ROS2.get(int(code))
            if key not in goals and (key in over_before or (end is not None and last_s < 0)):
                over_before.add(key)
                continue
            # What is told of for the first time when it is over was accepted since the last word, which was lost.
            goal = goals.setdefault(key, _States(action, time_s if end is None else last_s))
            if end is not None and goal.status is None:
                goal.ended_s, goal.status = time_s, end
        last_s = time_s
    return list(goals.values())
