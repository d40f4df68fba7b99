"""Goals of action servers and how they ended: actionlib of ROS 1, the hidden status topics of ROS 2."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Literal

import numpy as np

from care_core.ecosystems.ros import plan
from care_core.logs.base import Table
from care_core.records import Record

Outcome = Literal["reached", "cancelled", "aborted", "rejected", "lost", "replaced", ""]
"""How a goal ended; empty where the recording does not say."""
Of = Callable[..., Iterator[tuple[str, Table]]]

_ROS1: dict[int, Outcome] = {2: "cancelled", 3: "reached", 4: "aborted", 5: "rejected", 8: "cancelled", 9: "lost"}
"""Final codes of actionlib_msgs/GoalStatus."""
_ROS2: dict[int, Outcome] = {4: "reached", 5: "cancelled", 6: "aborted"}
"""Final codes of action_msgs/GoalStatus."""

_STATUS_TOPIC = "/_action/status"


class Goal(Record):
    """A goal of an action: when it was sent, when and how it ended; where it lies, m, nan where that is not said."""

    action: str
    sent_s: float
    end_s: float
    outcome: Outcome
    text: str = ""
    x: float = float("nan")
    y: float = float("nan")

    @property
    def failed(self) -> bool:
        return self.outcome not in ("reached", "replaced", "")


def goals_of(of: Of, duration_s: float) -> tuple[Goal, ...]:
    """Every goal of the recording's driving actions, in the order sent; of all its actions where none drives."""
    found = [*_actionlib(of, duration_s), *_ros2(of, duration_s)]
    driving = [goal for goal in found if _drives(goal)]
    return tuple(sorted(driving or found, key=lambda goal: goal.sent_s))


def _drives(goal: Goal) -> bool:
    return not np.isnan(goal.x) or "navigate" in goal.action or "move_base" in goal.action


def _actionlib(of: Of, duration_s: float) -> Iterator[Goal]:
    results = {topic.rpartition("/")[0]: table for topic, table in of(plan.ACTION_RESULT)}
    for topic, table in of(plan.ACTION_GOAL):
        if "goal_id.id" not in table.columns:
            continue
        action = topic.rpartition("/")[0]
        answers = _answers(results.get(action))
        places = [table.columns.get(name) for name in plan.FIELDS[plan.ACTION_GOAL][1:]]
        seen: dict[str, None] = {}
        rows = [i for i, one in enumerate(table["goal_id.id"]) if not (one in seen or seen.setdefault(str(one)))]
        for number, row in enumerate(rows):
            sent_s = float(table.t[row])
            next_s = float(table.t[rows[number + 1]]) if number + 1 < len(rows) else None
            end_s, outcome, text = answers.get(str(table["goal_id.id"][row]), (duration_s, "", ""))
            if next_s is not None and end_s > next_s:
                end_s, outcome = next_s, "replaced"
            x, y = (float("nan") if one is None else float(one[row]) for one in places)
            yield Goal(action, sent_s, end_s, outcome, text, x, y)


def _answers(table: Table | None) -> dict[str, tuple[float, Outcome, str]]:
    if table is None or not set(plan.FIELDS[plan.ACTION_RESULT]) <= set(table.columns):
        return {}
    rows = zip(table.t.tolist(), *(table[name] for name in plan.FIELDS[plan.ACTION_RESULT]), strict=True)
    return {str(one): (t, _ROS1.get(int(status), ""), str(text)) for t, one, status, text in rows}


def _ros2(of: Of, duration_s: float) -> Iterator[Goal]:
    for topic, table in of(plan.STATUS):
        if not topic.endswith(_STATUS_TOPIC) or not set(plan.FIELDS[plan.STATUS]) <= set(table.columns):
            continue
        action = topic.removesuffix(_STATUS_TOPIC)
        began: dict[bytes, float] = {}
        ended: dict[bytes, tuple[float, Outcome]] = {}
        for t, ids, codes in zip(table.t.tolist(), *(table[name] for name in plan.FIELDS[plan.STATUS]), strict=True):
            for uuid, code in zip(ids, codes, strict=True):
                key, outcome = bytes(bytearray(uuid)), _ROS2.get(int(code), "")
                if key in ended:
                    continue
                if outcome:
                    ended[key] = (t, outcome)
                else:
                    began.setdefault(key, t)
        starts = sorted(began.items(), key=lambda one: one[1])
        for number, (key, sent_s) in enumerate(starts):
            next_s = starts[number + 1][1] if number + 1 < len(starts) else None
            end_s, outcome = ended.get(key, (duration_s, ""))
            if next_s is not None and end_s >= next_s:
                end_s, outcome = next_s, "replaced"  # Nav2 calls a goal aborted when another one takes its place
            yield Goal(action, sent_s, end_s, outcome)
