"""Goals that are poses on a topic, such as RViz's /goal_pose, where no action topic is recorded that tells how they
ended: whether the robot arrived is judged by where it is."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from care_core.ecosystems.ros.falls import fall_of
from care_core.ecosystems.ros.goals import Goal, Status
from care_core.ecosystems.ros.messages import (
    ACTION_GOAL,
    FRAME,
    LOCALISED,
    MESSAGES,
    ODOMETRY,
    PATH,
    PLACED,
    POSE,
    STATUS,
    TF,
    TWIST,
    TWIST_STAMPED,
    plainness,
    type_of,
    yaw_of,
)
from care_core.ecosystems.ros.motion import STANDS_MPS, STANDS_RADPS, Commands, Odometry, Poses, moved_to
from care_core.logs.base import Channel, Table, Wanted
from care_core.numbers import Bools, Floats
from care_core.records import Record, replace
from care_core.run import Setting

if TYPE_CHECKING:
    from care_core.logs.ros_log import RosLog

KIND = "posed_goals"
_NAMES = ("goal_pose", "move_base_simple/goal", "current_goal", "goal")
"""How the topics end on which goals are sent: RViz's, and what move_base made of them."""
_PLANS = ("plan",)
"""How the topics end on which a planner tells its way to the goal."""
_FOUND = re.compile(r"initial", re.IGNORECASE)
"""In the name of a topic on which a person says where the robot is."""

POSE_FIELDS = (
    FRAME,
    "pose.position.x",
    "pose.position.y",
    *(f"pose.orientation.{axis}" for axis in "xyzw"),
)
_PATH = "poses.pose"
PLAN_FIELDS = (
    FRAME,
    f"{_PATH}.position.x",
    f"{_PATH}.position.y",
    f"{_PATH}.orientation.z",
    f"{_PATH}.orientation.w",
)
_ROTATION = "transforms.transform.rotation"
TF_FIELDS = (*PLACED, f"{_ROTATION}.z", f"{_ROTATION}.w")
_PLACE_FIELDS = (FRAME, *MESSAGES[LOCALISED].reads)
_MOST_TRANSFORMS = 10_000

ARRIVED_M = 0.5
"""Who stands so near is there: Nav2's goal checkers allow 0.25 m, and a localisation is as far off."""
_RESTS_S, _RESTS_M = 0.5, 0.02
"""It stands when it has stood for so long, where odometry tells no speed within so much."""
_SAME_M, _SAME_END_M = 0.05, 0.5
"""Poses that lie no farther apart are one goal; the ends of plans, which planners move to where they find a way."""
_STUCK_S, _STUCK_M = 10.0, 0.5
"""As Nav2's progress checker: movement_time_allowance and required_movement_radius."""
_UNTOLD_S = 2.0
"""Without a command for so long nothing drives it any more."""
_MOST_GOALS, _LASTS_S = 50, 3.0
"""More goals than these, or such as last no longer, are a target that moves."""


class Driven(Protocol):
    """What is asked of the model of a recording."""

    @property
    def log(self) -> RosLog: ...
    @property
    def duration_s(self) -> float: ...
    @property
    def channels(self) -> Sequence[Channel]: ...
    @property
    def parameters(self) -> Mapping[str, Setting]: ...
    def tables(self, wanted: Wanted) -> Mapping[str, Table]: ...
    def odometry_on(self, topic: str) -> Odometry | None: ...
    def commands_on(self, topic: str) -> Commands | None: ...


def section_of(channels: Sequence[Channel]) -> Mapping[str, Any] | None:
    """Where a recording without action topics tells its goals, as a mission section; None where it tells none."""
    there = [one for one in channels if one.count]
    if any(type_of(one) in (ACTION_GOAL, STATUS) for one in there):
        return None
    topic = _named(there, POSE, _NAMES) or _named(there, PATH, _PLANS)
    if topic is None:
        return None
    plainest = {
        "odometry": _plainest(there, (ODOMETRY,), "odom"),
        "commands": _plainest(there, (TWIST, TWIST_STAMPED), "cmd_vel"),
        "poses": next((one.name for one in there if type_of(one) == LOCALISED and not _FOUND.search(one.name)), None),
    }
    return {"kind": KIND, "topic": topic, **{part: name for part, name in plainest.items() if name}}


def _named(channels: Iterable[Channel], type: str, endings: Sequence[str]) -> str | None:
    names = sorted(one.name for one in channels if type_of(one) == type)
    return next((name for end in endings for name in names if name.endswith(f"/{end}")), None)


def _plainest(channels: Iterable[Channel], types: Sequence[str], name: str) -> str | None:
    found = (one.name for one in channels if type_of(one) in types)
    return min(found, key=lambda topic: plainness(topic, name), default=None)


def needs(spec: Mapping[str, Any]) -> Wanted:
    """What is read beside odometry and commands."""
    topic = str(spec.get("topic", f"/{_NAMES[0]}"))
    places = {str(spec["poses"]): _PLACE_FIELDS} if "poses" in spec else {}
    return {topic: (*POSE_FIELDS, *PLAN_FIELDS[1:]), **places}


def posed_goals(drive: Driven, spec: Mapping[str, Any]) -> tuple[Goal, ...]:
    """Every goal of a topic, in the order sent, with how it ended as far as the robot's place tells.

    Why it does not tell stands in the text of a goal.
    """
    topic = str(spec.get("topic", f"/{_NAMES[0]}"))
    table = drive.tables(needs(spec)).get(topic)
    sent = [] if table is None else list(_sent(topic, table))
    lasts = np.diff([*(goal.sent_s for goal in sent), drive.duration_s])
    if not sent or len(sent) > _MOST_GOALS or float(np.median(lasts)) < _LASTS_S:
        return ()
    found = _track(drive, spec, sent[-1].frame)
    until = [*(goal.sent_s for goal in sent[1:]), drive.duration_s]
    ended = []
    for number, (goal, end_s) in enumerate(zip(sent, until, strict=True)):
        is_last = number + 1 == len(sent)
        if isinstance(found, str):
            ended.append(replace(goal, end_s=end_s, text=found, is_replaced=not is_last))
        else:
            ended.append(_ended(drive, spec, goal, found, end_s, is_last=is_last))
    return tuple(ended)


def _sent(topic: str, table: Table) -> Iterator[Goal]:
    """Poses in the order sent, those that were sent again once."""
    last: Goal | None = None
    is_plan = PLAN_FIELDS[1] in table.columns
    for t, frame, x, y, yaw in _ends_of_plans(table) if is_plan else _poses(table):
        goal = Goal(topic, t, t, None, "", x, y, yaw, frame)
        if last is None or frame != last.frame or last.offset(x, y) > (_SAME_END_M if is_plan else _SAME_M):
            last = goal
            yield goal


def _poses(table: Table) -> Iterator[tuple[float, str, float, float, float]]:
    if not set(POSE_FIELDS) <= set(table.columns):
        return
    x, y = (np.asarray(table[f"pose.position.{axis}"], np.float64) for axis in "xy")
    yaw = yaw_of(table, "pose.orientation")
    for row in np.flatnonzero(np.isfinite(x + y)).tolist():
        yield float(table.t[row]), str(table[FRAME][row]).strip("/"), float(x[row]), float(y[row]), float(yaw[row])


def _ends_of_plans(table: Table) -> Iterator[tuple[float, str, float, float, float]]:
    if not set(PLAN_FIELDS) <= set(table.columns):
        return
    for row, t in enumerate(table.t.tolist()):
        if len(table[PLAN_FIELDS[1]][row]):
            x, y, z, w = (float(table[name][row][-1]) for name in PLAN_FIELDS[1:])
            yield t, str(table[FRAME][row]).strip("/"), x, y, 2 * math.atan2(z, w)


class _Track(Record, eq=False):
    """The robot in the frame of its goals: s, m, shape (n,); `rests` where it stands."""

    t: Floats
    x: Floats
    y: Floats
    rests: Bools
    odometry: Odometry


def _track(drive: Driven, spec: Mapping[str, Any], frame: str) -> _Track | str:
    """Where the robot was; in words why nobody knows."""
    whole = drive.odometry_on(str(spec["odometry"])) if "odometry" in spec else None
    odometry = None if whole is None else whole.advancing()
    if odometry is None:
        return "no odometry is recorded that tells where the robot is"
    own = odometry.frame.strip("/")
    if frame and own == frame:
        return _Track(odometry.t, odometry.x, odometry.y, _rests(odometry), odometry)
    poses = _localised(drive, spec, frame)
    if poses is None:
        poses = _corrected(drive, odometry, frame)
    if poses is None:
        return f"goals are in frame {frame or 'map'}, and where the robot is in it is not recorded"
    x, y, _ = moved_to(poses, odometry.t, odometry.x, odometry.y, odometry.yaw)
    return _Track(odometry.t, x, y, _rests(odometry), odometry)


def _rests(odometry: Odometry) -> Bools:
    if odometry.tells_speed:
        speed = np.hypot(odometry.speed, odometry.sideways)
        return np.asarray((speed < STANDS_MPS) & (np.abs(odometry.turn) < STANDS_RADPS))
    later = np.minimum(np.searchsorted(odometry.t, odometry.t + _RESTS_S), len(odometry.t) - 1)
    went = np.hypot(odometry.x[later] - odometry.x, odometry.y[later] - odometry.y)
    return np.asarray(went < _RESTS_M)


def _localised(drive: Driven, spec: Mapping[str, Any], frame: str) -> Poses | None:
    """Where a localisation found the robot, in the frame of the goals."""
    if "poses" not in spec:
        return None
    table = drive.tables({str(spec["poses"]): _PLACE_FIELDS}).get(str(spec["poses"]))
    if table is None or not len(table) or not set(_PLACE_FIELDS) <= set(table.columns):
        return None
    x, y = (np.asarray(table[f"pose.pose.position.{axis}"], np.float64) for axis in "xy")
    yaw = yaw_of(table, "pose.pose.orientation")
    known = np.isfinite(x + y + yaw)
    frames = {str(one).strip("/") for one in table[FRAME][known]}
    return Poses(table.t[known], x[known], y[known], yaw[known], frame) if frames == {frame or "map"} else None


def _corrected(drive: Driven, odometry: Odometry, frame: str) -> Poses | None:
    """The same by the transforms between the frames of goals and odometry."""
    topic = next((one.name for one in drive.channels if type_of(one) in TF and one.count), None)
    if topic is None:
        return None
    table = drive.log.read({topic: TF_FIELDS}, {topic: _MOST_TRANSFORMS}).get(topic)
    if table is None or not set(TF_FIELDS) <= set(table.columns):
        return None
    own = odometry.frame.strip("/") or "odom"
    rows = []
    for t, *fields in zip(table.t.tolist(), *(table[name] for name in TF_FIELDS), strict=True):
        for parent, child, x, y, z, w in zip(*fields, strict=False):
            if str(parent).strip("/") == (frame or "map") and str(child).strip("/") == own:
                rows.append((t, x, y, 2 * math.atan2(z, w)))
    if not rows:
        return None
    t, x, y, yaw = np.array(rows, np.float64).T
    at = np.clip(np.searchsorted(t, odometry.t, side="right") - 1, 0, None)
    cos, sin = np.cos(yaw[at]), np.sin(yaw[at])
    placed_x, placed_y = (
        x[at] + cos * odometry.x - sin * odometry.y,
        y[at] + sin * odometry.x + cos * odometry.y,
    )
    return Poses(odometry.t, placed_x, placed_y, odometry.yaw + yaw[at], frame)


def _ended(drive: Driven, spec: Mapping[str, Any], goal: Goal, track: _Track, end_s: float, *, is_last: bool) -> Goal:
    """The goal with how it ended: the robot stood there, another was sent, or it was on its way no more."""
    inside = (track.t >= goal.sent_s) & (track.t <= end_s)
    t, off = track.t[inside], np.hypot(track.x - goal.x, track.y - goal.y)[inside]
    there = track.rests[inside] & (off <= max(ARRIVED_M, _tolerance_m(drive)))
    for row in np.flatnonzero(there).tolist():
        stays = slice(row, int(np.searchsorted(t, t[row] + _RESTS_S)) + 1)
        if there[stays].all() and t[stays][-1] - t[row] >= _RESTS_S:
            return replace(goal, end_s=float(t[row]), status=Status.SUCCEEDED)
    if not is_last:
        return replace(goal, end_s=end_s, is_replaced=True)
    why = _given_up(drive, spec, goal, track) if len(off) else ""
    if not why:
        return replace(goal, end_s=end_s)
    return replace(goal, end_s=end_s, status=Status.NOT_REACHED, text=f"{off[-1]:.1f} m from it at the end, {why}")


def _tolerance_m(drive: Driven) -> float:
    """What the goal checker allows, as far as the recording says."""
    values = [one.value for name, one in drive.parameters.items() if name.endswith("xy_goal_tolerance")]
    return max((float(value) for value in values if isinstance(value, (int, float))), default=0.0)


def _given_up(drive: Driven, spec: Mapping[str, Any], goal: Goal, track: _Track) -> str:
    """Why the robot was on its way no more when the recording ended; empty where it may have been."""
    odometry, last_s = track.odometry, float(track.t[-1])
    fall = fall_of(odometry.topic, odometry.t, odometry.tilt, odometry.z, odometry.path_m)
    if fall is not None and fall.stays and fall.start_s >= goal.sent_s:
        return "it has tipped over"
    if last_s - goal.sent_s >= _STUCK_S and odometry.spread_m(last_s - _STUCK_S) < _STUCK_M:
        return f"less than {_STUCK_M} m of way in the last {_STUCK_S:.0f} s"
    commands = drive.commands_on(str(spec["commands"])) if "commands" in spec else None
    if commands is not None and track.rests[-1] and (silent_s := last_s - float(commands.t[-1])) >= _UNTOLD_S:
        return f"it stands, without a command for the last {silent_s:.0f} s"
    return ""
