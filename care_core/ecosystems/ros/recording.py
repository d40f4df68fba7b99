"""A recording as the checks look at it: odometry, commands, laser scans, goals and messages, each prepared once."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from care_core.ecosystems.findings import Severity
from care_core.ecosystems.ros import plan
from care_core.ecosystems.ros.action_goals import Goal, goals_of
from care_core.logs.base import Channel, Table
from care_core.logs.ros_log import RosLog
from care_core.numbers import median, quantile
from care_core.records import Record
from care_core.run import Damage, Setting

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

WARN, ERROR, FATAL = 4, 8, 16
"""Levels of rosgraph_msgs/Log."""
_ROS2_LEVELS = {10: 1, 20: 2, 30: WARN, 40: ERROR, 50: FATAL}
"""Levels of rcl_interfaces/Log in those of ROS 1."""
_VIEWER_LEVELS = {0: 2, 1: 1, 2: 2, 3: WARN, 4: ERROR, 5: FATAL}
"""Levels of foxglove.Log (its schema: unknown, debug, info, warning, error, fatal) in those of ROS 1."""
_LEVELS = (
    (_ROS2_LEVELS, tuple(kind for kind in plan.ROSOUT if kind not in plan.VIEWER_LOG)),
    (_VIEWER_LEVELS, plan.VIEWER_LOG),
)

OPEN_S = 30.0
"""A goal without an answer for longer than this at the end of a recording was not being reached."""

FAR_M, FAST, VOLTS = 1e7, 1e3, 1e4
"""Positions (UTM northings reach 1e7 m), speeds in m/s and rad/s, volts and amperes beyond which none are."""

STREAM_MESSAGES, STEADY = 10, 3.0
"""A stream has so many messages, and nine in ten of its pauses are below so many times the usual one."""

PUNCTUAL_S, MOSTLY = 0.25, 0.6
"""Where this share of messages is recorded so soon after it was made, both clocks run alike."""


_STILL_M = 2.0
"""Way by its speed that no noise of a speed makes while a position stays the same to the last digit."""


class Odometry(Record, eq=False):
    """What odometry says: s, m, rad, m/s, rad/s, each of shape (n,), in order of time."""

    topic: str
    t: Floats
    dt: Floats
    """Time since the sample before by the robot's own clock, which a slow simulation slows; 0 for the first."""
    x: Floats
    y: Floats
    yaw: Floats
    speed: Floats
    """Forward, negative backwards."""
    sideways: Floats
    turn: Floats

    @property
    def tells_speed(self) -> bool:
        """Whether its twist is filled in: some drivers leave it zero."""
        return bool(np.any(np.abs(self.speed) > 0.01) or np.any(np.abs(self.turn) > 0.01))

    @property
    def way_m(self) -> float:
        """How far it went by its speed."""
        return float(np.sum(np.hypot(self.speed, self.sideways) * self.dt))

    @property
    def stands_still(self) -> bool:
        """Whether its position is not filled in: the same to the last digit while its speed makes metres of way."""
        return not np.ptp(self.x) and not np.ptp(self.y) and self.way_m > _STILL_M


class Commands(Record, eq=False):
    """Velocity commands: s, m/s, rad/s, each of shape (n,), in order of time."""

    topic: str
    t: Floats
    speed: Floats
    sideways: Floats
    turn: Floats


class Scans(Record, eq=False):
    """Scans of one laser. `ranges` has shape (n, rays), m, nan where nothing came back; `angles` (rays,), rad."""

    topic: str
    t: Floats
    ranges: NDArray[np.float32]
    angles: Floats
    raw: NDArray[Any]
    """As recorded, shape (n,) of arrays."""
    range_max: float


class Battery(Record, eq=False):
    """A battery: s, V, A (positive: drawn; nan where it is not measured), each of shape (n,)."""

    topic: str
    t: Floats
    voltage: Floats
    current: Floats


class Said(Record):
    """A message of a node: `level` as ROS 1 has them."""

    time_s: float
    level: int
    node: str
    text: str


class Recording(Record, eq=False, dict=True):
    """A recording, read once.

    `times` holds the record times of every topic, `tables` what was decoded, both by topic.
    """

    channels: tuple[Channel, ...]
    times: Mapping[str, Floats]
    tables: Mapping[str, Table]
    settings: Mapping[str, tuple[Setting, ...]]
    facts: Mapping[str, str]
    damage: tuple[Damage, ...]
    duration_s: float

    @classmethod
    def read(cls, log: RosLog) -> Recording:
        """Read what the checks look at. A message that cannot be decoded is damage of the log, no error."""
        channels = log.channels()
        tables = log.read(plan.needs(channels), plan.limits(channels))
        damage = log.damage
        return cls(channels, log.times(), tables, log.settings(), log.facts, damage, log.duration_s)

    def of(self, *kinds: str) -> Iterator[tuple[str, Table]]:
        """Topic and messages of every channel of these kinds that has messages, see `plan.kind_of`."""
        for channel in self.channels:
            if plan.kind_of(channel) in kinds and len(self.tables.get(channel.name, ())):
                yield channel.name, self.tables[channel.name]

    @cached_property
    def streams(self) -> Mapping[str, float]:
        """Topics that come steadily, so that silence means something, with their usual period, s."""
        found = {}
        for topic, times in self.times.items():
            if len(times) < STREAM_MESSAGES:
                continue
            pauses = np.diff(times)
            usual = float(median(pauses))
            if usual > 0 and quantile(pauses, 0.9) <= STEADY * usual:
                found[topic] = usual
        return found

    @cached_property
    def goals(self) -> tuple[Goal, ...]:
        return goals_of(self.of, self.duration_s)

    @cached_property
    def odometry(self) -> Odometry | None:
        """The odometry of the base: of several the one named so, which others are made from."""
        found = [one for topic, table in self.of(plan.ODOMETRY) if (one := _odometry(topic, table)) is not None]
        return min(found, key=lambda one: (not one.tells_speed, *_plainness(one.topic, "odom")), default=None)

    @cached_property
    def commands(self) -> Commands | None:
        """The commands to the base: the topic named `cmd_vel`, else the only one; None where it cannot be told."""
        found = [_commands(topic, table) for topic, table in self.of(plan.TWIST, plan.TWIST_STAMPED)]
        known = [one for one in found if one is not None]
        named = [one for one in known if one.topic.rpartition("/")[2] == "cmd_vel"] or known
        ranked = sorted(named, key=lambda one: _plainness(one.topic, "cmd_vel"))
        alike = (
            len(ranked) > 1 and _plainness(ranked[0].topic, "cmd_vel")[:2] == _plainness(ranked[1].topic, "cmd_vel")[:2]
        )
        return None if alike or not ranked else ranked[0]

    @cached_property
    def scans(self) -> tuple[Scans, ...]:
        return tuple(one for topic, table in self.of(plan.SCAN) if (one := _scans(topic, table)) is not None)

    @cached_property
    def batteries(self) -> tuple[Battery, ...]:
        return tuple(one for topic, table in self.of(plan.BATTERY) if (one := _battery(topic, table)) is not None)

    @cached_property
    def said(self) -> tuple[Said, ...]:
        """What nodes said, in order of time; where it was recorded twice (`/rosout_agg`), once."""
        spoken = [_said(table, levels) for levels, kinds in _LEVELS for _, table in self.of(*kinds)]
        return max(spoken, key=len, default=())

    def severity(self, onset_s: float, otherwise: Severity = "warning") -> Severity:
        """How much something that began then matters: critical where a goal failed afterwards, or is left open at the
        end; a warning where every later goal was reached; `otherwise` where the robot was given no goal."""
        if not self.goals:
            return otherwise
        after = [goal for goal in self.goals if goal.end_s >= onset_s]
        stopped = any(goal.failed or (not goal.outcome and goal.end_s - goal.sent_s > OPEN_S) for goal in after)
        return "critical" if stopped else "warning"

    def moved_between(self, start_s: float, end_s: float) -> float:
        """Distance that odometry went in a time, m; nan where there is none."""
        if self.odometry is None:
            return float("nan")
        inside = (self.odometry.t >= start_s) & (self.odometry.t <= end_s)
        return float(np.sum(np.hypot(np.diff(self.odometry.x[inside]), np.diff(self.odometry.y[inside]))))


def _plainness(topic: str, name: str) -> tuple[bool, int, str]:
    """Ranks topics: `/odom` before `/robot/odom` before `/odometry/filtered`."""
    return topic.rpartition("/")[2] != name, topic.count("/"), topic


def believable(column: NDArray[Any], most: float) -> Floats:
    """A column of numbers with nan for what is larger than anything of its kind can be: a damaged one."""
    values = np.asarray(column, np.float64)
    with np.errstate(invalid="ignore"):
        return np.where(np.abs(values) <= most, values, np.nan)


def yaw_of(table: Table, prefix: str) -> Floats:
    """Heading of a unit quaternion, rad."""
    x, y, z, w = (believable(table[f"{prefix}.{axis}"], 2.0) for axis in "xyzw")
    yaw: Floats = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return yaw


def _said(table: Table, levels: Mapping[int, int]) -> tuple[Said, ...]:
    """The messages of one topic; `levels` gives the codes of its type in those of ROS 1."""
    text = next((name for name in ("msg", "message") if name in table.columns), None)
    if text is None or "level" not in table.columns:
        return ()
    names = table["name"] if "name" in table.columns else [""] * len(table)
    rows = zip(table.t.tolist(), table["level"], names, table[text], strict=True)
    return tuple(
        Said(t, levels.get(int(level), int(level)), str(name), str(words))
        for t, level, name, words in rows
        if np.isfinite(level)
    )


def _odometry(topic: str, table: Table) -> Odometry | None:
    if not set(plan.FIELDS[plan.ODOMETRY]) <= set(table.columns) or len(table) < 3:
        return None
    x, y = (believable(table[f"pose.pose.position.{axis}"], FAR_M) for axis in "xy")
    speed, sideways = (believable(table[f"twist.twist.linear.{axis}"], FAST) for axis in "xy")
    turn, yaw = believable(table["twist.twist.angular.z"], FAST), yaw_of(table, "pose.pose.orientation")
    t = _when(table)
    good = np.isfinite(x + y + speed + sideways + turn + yaw + t)
    good[1:] &= np.diff(t) > 0
    if np.count_nonzero(good) < 3:
        return None
    own = _clock(table)
    step = np.diff((t if own is None else own)[good], prepend=np.nan)
    dt = np.where(step > 0, step, 0.0)
    return Odometry(topic, t[good], dt, *(np.asarray(one[good]) for one in (x, y, yaw, speed, sideways, turn)))


def _clock(table: Table) -> Floats | None:
    """The stamps of messages, where they are set and run forward."""
    stamp = np.asarray(table["header.stamp"], np.float64)
    return stamp if np.isfinite(stamp).all() and stamp[-1] > stamp[0] and np.all(np.diff(stamp) >= 0) else None


def _when(table: Table) -> Floats:
    """When messages were made, in the recorder's time: by their stamps where that clock runs as the recorder's does.

    What a link held back was recorded later than it was made, and comes in a burst.
    """
    stamp = _clock(table)
    if stamp is None:
        return table.t
    late: Floats = table.t - stamp
    usual = quantile(late, 0.1)
    return stamp + usual if float(np.mean(late - usual < PUNCTUAL_S)) >= MOSTLY else table.t


def _commands(topic: str, table: Table) -> Commands | None:
    prefix = "twist." if "twist.linear.x" in table.columns else ""
    names = [f"{prefix}{name}" for name in plan.FIELDS[plan.TWIST]]
    if not set(names) <= set(table.columns):
        return None
    columns = [believable(table[name], FAST) for name in names]
    good = np.isfinite(sum(columns))
    return Commands(topic, table.t[good], *(column[good] for column in columns)) if good.any() else None


def _scans(topic: str, table: Table) -> Scans | None:
    """Scans with as many rays as most have."""
    if not set(plan.FIELDS[plan.SCAN]) <= set(table.columns):
        return None
    sizes = np.array([len(one) for one in table["ranges"]])
    rays = int(median(sizes))
    good = sizes == rays
    if rays < 2 or not good.any():
        return None
    raw = table["ranges"][good]
    ranges = np.stack(list(raw)).astype(np.float32)
    low, high = float(median(table["range_min"])), float(median(table["range_max"]))
    with np.errstate(invalid="ignore", over="ignore"):
        # A range beyond its limits is none (REP 117); some drivers give the highest one for no return.
        ranges[~((ranges >= low) & (ranges < high * (1 - 1e-6)))] = np.nan
    first, step = (float(believable(table[name], FAR_M)[good][0]) for name in ("angle_min", "angle_increment"))
    if not np.isfinite(first + step):
        return None
    angles: Floats = first + np.arange(rays, dtype=np.float64) * step
    return Scans(topic, _when(table)[good], ranges, angles, raw, high)


def _battery(topic: str, table: Table) -> Battery | None:
    """A battery whose voltage is one: finite, positive and not ever the same."""
    if not {"voltage", "current"} <= set(table.columns):
        return None
    voltage, current = believable(table["voltage"], VOLTS), believable(table["current"], VOLTS)
    good = np.isfinite(voltage)
    alive = np.count_nonzero(good) >= 5 and float(voltage[good].min()) >= 0 and float(voltage[good].max()) > 2
    if not alive or np.ptp(voltage[good]) == 0:
        return None
    drawn = current[good]
    # sensor_msgs/BatteryState says negative when discharging; many drivers give the magnitude.
    measured = drawn[np.isfinite(drawn)]
    drawn = -drawn if len(measured) and median(measured) < 0 else drawn
    return Battery(topic, table.t[good], voltage[good], drawn)


def stretches(t: Floats, holds: Bools, gap_s: float) -> list[tuple[float, float]]:
    """First and last time of each stretch in which a condition holds, breaks shorter than `gap_s` bridged."""
    found: list[tuple[float, float]] = []
    for time_s in t[holds].tolist():
        if found and time_s - found[-1][1] < gap_s:
            found[-1] = (found[-1][0], time_s)
        else:
            found.append((time_s, time_s))
    return found
