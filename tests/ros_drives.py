"""A robot that drives down a corridor after its commands, as a ROS 2 recording; one thing fails on the way."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from care_core.numbers import Floats
from care_core.records import Struct, field
from tests.ros_samples import ROS2, SECOND_NS, START_NS, McapFile, cdr, make, stamp

FAILS_AT_S, ENDS_S = 16.0, 40.0
STEP_S = 0.04
RAYS = 181
WIDE_M, LONG_M = 1.5, 40.0
CRAWL_MPS = 0.1
ODOMETRY, TWIST, SCAN = "nav_msgs/msg/Odometry", "geometry_msgs/msg/Twist", "sensor_msgs/msg/LaserScan"
BATTERY, STATUS, LOG = "sensor_msgs/msg/BatteryState", "action_msgs/msg/GoalStatusArray", "rcl_interfaces/msg/Log"
SUCCEEDED, ABORTED = 4, 6


class Drive(Struct, eq=False):
    """What the robot does: `fault` begins at `FAILS_AT_S`; `outcome` is how its only goal ends (a Nav2 code)."""

    fault: str = ""
    outcome: int = SUCCEEDED
    said: list[tuple[float, int, str, str]] = field(default_factory=list)
    """Time, level, node and text of messages."""
    waits_s: float = 0.0
    """It stands, without a command, until then."""
    crawls: bool = False
    """It is told to crawl from `FAILS_AT_S` on."""
    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0
    off_x: float = 0.0

    def write(self, path: Path) -> Path:
        with McapFile(path) as log:
            for topic, kind, time_s, message in sorted(self.messages(), key=lambda one: one[2]):
                log.add(topic, kind, START_NS + round(time_s * SECOND_NS), cdr(message))
        return path

    def messages(self) -> Iterator[tuple[str, str, float, Any]]:
        rng = np.random.default_rng(1)
        frozen: NDArray[np.float32] | None = None
        yield "/navigate_to_pose/_action/status", STATUS, 0.5, _status(2)
        yield "/navigate_to_pose/_action/status", STATUS, ENDS_S - 0.5, _status(self.outcome)
        for time_s, level, node, text in self.said:
            yield "/rosout", LOG, time_s, make(ROS2, LOG, stamp(ROS2, START_NS), level, node, text, "", "", 0)
        for tick in range(round(ENDS_S / STEP_S)):
            t = tick * STEP_S
            failing = t >= FAILS_AT_S
            wanted = (CRAWL_MPS, 0.0) if failing and self.crawls else (0.5, 0.2 * np.cos(t))
            wanted = (0.0, 0.0) if t < self.waits_s else wanted
            speed, turn = self._driven(t, *wanted) if failing else wanted
            self._move(speed, turn, onset=abs(t - FAILS_AT_S) < STEP_S / 2, failing=failing)
            if tick % 5 == 0:
                yield "/cmd_vel", TWIST, t, _twist(*wanted)
            if tick % 5 == 0:
                noise = 1 + 0.01 * rng.normal()
                yield "/wheels/odom", ODOMETRY, t, self._odometry(t, speed * noise, turn)
            if tick % 5 == 0 and not (failing and self.fault == "laser dead"):
                scatter = 0.3 if failing and self.fault == "laser noise" else 0.01
                ranges = (self._ranges(failing) + scatter * rng.normal(size=RAYS)).astype(np.float32)
                if failing and self.fault == "laser stuck":
                    ranges = frozen = ranges if frozen is None else frozen
                yield "/front/scan", SCAN, t, _scan(t, ranges)
            if tick % 25 == 0:
                low = 4.0 if failing and self.fault == "battery" else 0.0
                pushes = self.fault in ("blocked", "held") and failing
                amps = 2.0 + (4.0 * abs(wanted[0] if pushes else speed))
                yield "/power", BATTERY, t, _battery(25.0 - 0.001 * t - 0.05 * amps - low, -amps)

    def _driven(self, t: float, speed: float, turn: float) -> tuple[float, float]:
        """What the drive makes of its commands."""
        ways = {
            "weak": (0.15, turn),
            "pulls": (0.8 * speed, turn + 0.4 * speed),
            "stall": (0.0, 0.0),
            "loss": (0.0, 0.0) if t % 2 < 1.4 else (speed, turn),
            "blocked": (0.0, 0.0),
            "blocked, turning": (0.0, 0.3),
            "held": (0.0, 0.0),
            "pulls hard, stands": (0.8 * speed, turn + 0.6 * speed) if t < FAILS_AT_S + 3.2 else (0.0, 0.0),
        }
        return ways.get(self.fault, (speed, turn))

    def _move(self, speed: float, turn: float, *, onset: bool, failing: bool) -> None:
        self.x += speed * np.cos(self.yaw) * STEP_S
        self.y += speed * np.sin(self.yaw) * STEP_S
        self.yaw += turn * STEP_S
        self.off_x += 1.2 if onset and self.fault == "jump" else 0.0
        self.off_x += 0.2 * speed * STEP_S if failing and self.fault == "drift" else 0.0

    def _odometry(self, t: float, speed: float, turn: float) -> Any:
        place = make(ROS2, "geometry_msgs/msg/Point", self.x + self.off_x, self.y, 0.0)
        pose = make(ROS2, "geometry_msgs/msg/Pose", place, _quaternion(self.yaw))
        zeros = np.zeros(36)
        covered = make(ROS2, "geometry_msgs/msg/PoseWithCovariance", pose, zeros)
        moving = make(ROS2, "geometry_msgs/msg/TwistWithCovariance", _twist(speed, turn), zeros)
        return make(ROS2, ODOMETRY, _header(t), "base_link", covered, moving)

    def _ranges(self, failing: bool) -> Floats:
        """Distances to the walls of a corridor, and to what appeared in it."""
        angles = self.yaw + np.linspace(-np.pi / 2, np.pi / 2, RAYS)
        ends = [LONG_M] + ([self.x + 1.0] if failing and self.fault.startswith("blocked") else [])
        aside = np.where(np.sin(angles) > 0, WIDE_M - self.y, -WIDE_M - self.y)
        with np.errstate(divide="ignore"):
            ahead = [np.where(np.cos(angles) > 1e-6, (end - self.x) / np.cos(angles), np.inf) for end in ends]
            walls = np.where(np.abs(np.sin(angles)) > 1e-6, aside / np.sin(angles), np.inf)
        ranges: Floats = np.minimum(np.minimum.reduce([walls, *ahead]), 29.0)
        return ranges


def _header(t: float) -> Any:
    return make(ROS2, "std_msgs/msg/Header", stamp(ROS2, START_NS + round(t * SECOND_NS)), "odom")


def _quaternion(yaw: float) -> Any:
    return make(ROS2, "geometry_msgs/msg/Quaternion", 0.0, 0.0, float(np.sin(yaw / 2)), float(np.cos(yaw / 2)))


def _twist(speed: float, turn: float) -> Any:
    linear = make(ROS2, "geometry_msgs/msg/Vector3", float(speed), 0.0, 0.0)
    return make(ROS2, TWIST, linear, make(ROS2, "geometry_msgs/msg/Vector3", 0.0, 0.0, float(turn)))


def _scan(t: float, ranges: NDArray[np.float32]) -> Any:
    half, step = float(np.pi / 2), float(np.pi / (RAYS - 1))
    return make(ROS2, SCAN, _header(t), -half, half, step, 0.0, 0.2, 0.05, 30.0, ranges, np.empty(0, np.float32))


def _battery(voltage: float, current: float) -> Any:
    nan, none = float("nan"), np.empty(0, np.float32)
    measured = float(voltage), nan, float(current), nan, nan, nan, 0.5
    return make(ROS2, BATTERY, _header(0.0), *measured, 2, 1, 0, True, none, none, "", "")


def _status(code: int) -> Any:
    uuid = make(ROS2, "unique_identifier_msgs/msg/UUID", np.arange(16, dtype=np.uint8))
    info = make(ROS2, "action_msgs/msg/GoalInfo", uuid, stamp(ROS2, START_NS))
    return make(ROS2, STATUS, [make(ROS2, "action_msgs/msg/GoalStatus", info, code)])
