"""The robot itself: a body on driven wheels in a world, one step after the other. SI units; the same seed and the same
commands give the same drive."""

from __future__ import annotations

import math

import numpy as np

from nav2_robot import laser
from nav2_robot.battery import Battery
from nav2_robot.failures import Failing, Failure
from nav2_robot.world import Conditions, Floats, Pose

STEP_S = 0.05
RADIUS = 0.3
TOP_SPEED, TOP_TURN = 1.0, 1.8
ACCELERATION, TURN_ACCELERATION = 1.5, 3.0
COMMAND_TIMEOUT_S = 0.6
"""Without commands the drive stops."""

_SLIP_LASTS_S = 0.5
_SCRUB = 0.15
"""Share of a turn that skid steering loses to scrubbing tyres; a gyroscope sees what is left."""
_GYRO = 0.003
"""Noise of the gyroscope, rad per square root of s."""
_WALL_THERE_M = 0.1
"""Half a wall, with some of the floor behind it."""


class Robot:
    """Obeys the last command, and knows the truth that its odometry does not."""

    def __init__(self, conditions: Conditions, failure: Failure | None = None, skid: bool = False) -> None:
        self.conditions, self.skid = conditions, skid
        self.world = conditions.world
        self.failing = Failing(failure)
        self.battery = Battery(conditions.charge)
        self.rng = np.random.default_rng(conditions.seed)
        self.now_s = 0.0
        self.pose: Pose = self.world.start
        self.odometry: Pose = self.world.start
        """Where the robot believes it is."""
        self.speed = self.turn = 0.0
        """Of the wheels."""
        self.measured = (0.0, 0.0)
        """Speed and turn rate as odometry tells them."""
        self.distance = 0.0
        self.collisions = 0
        self.passed = 0
        self._wanted, self._commanded_s = (0.0, 0.0), -math.inf
        self._first_command_s: float | None = None
        self._slip = (0.0, 0.0)
        self._touching = False

    def command(self, speed: float, turn: float) -> None:
        """What the drive shall do; not a number is no command."""
        if not (math.isfinite(speed) and math.isfinite(turn)):
            return
        self._wanted = max(-TOP_SPEED, min(TOP_SPEED, speed)), max(-TOP_TURN, min(TOP_TURN, turn))
        self._commanded_s = self.now_s
        if self._first_command_s is None and (speed or turn):
            self._first_command_s = self.now_s

    def step(self) -> None:
        """One step of `STEP_S`."""
        self.now_s += STEP_S
        self._fail()
        before = abs(self.speed)
        self._turn_wheels()
        self._slip = (self._slipping(self._slip[0]), self._slipping(self._slip[1]))
        self._move()
        self.battery.draw(self.speed, self.turn, (abs(self.speed) - before) / STEP_S, STEP_S)

    def scan(self) -> Floats | None:
        """What the laser sends now: ranges in m, None where it is silent."""
        ranges = laser.scan(self.world, self.pose, self.conditions.range_noise, self.rng)
        return self.failing.measured(ranges, self.rng)

    def _fail(self) -> None:
        """What begins to fail begins here."""
        since = None if self._first_command_s is None else self.now_s - self._first_command_s
        if not self.failing.watch(since, self.now_s):
            return
        if self.failing.is_on("battery"):
            self.battery.lost_v = self.failing.size
        if self.failing.is_on("odom_jump"):
            x, y, yaw = self.odometry
            aside = self.rng.uniform(-1, 1, 2)
            size = self.failing.size
            self.odometry = x + size * float(aside[0]), y + size, yaw + 0.3 * size * float(aside[1])
        if self.failing.is_on("blocked"):
            ahead = [gap for gap in self.world.passages if gap.x > self.pose[0] + RADIUS + _WALL_THERE_M]
            if ahead:
                self.world = self.world.blocked(ahead[0])

    def _turn_wheels(self) -> None:
        fresh = self.now_s - self._commanded_s < COMMAND_TIMEOUT_S
        speed, turn = self.failing.driven(*self._wanted, self.now_s) if fresh else (0.0, 0.0)
        self.speed = _towards(self.speed, speed, ACCELERATION * STEP_S)
        self.turn = _towards(self.turn, turn, TURN_ACCELERATION * STEP_S)
        if self.battery.is_out:
            self.speed = self.turn = 0.0

    def _slipping(self, value: float) -> float:
        """Slip comes and goes: an Ornstein-Uhlenbeck process with a standard deviation of 1."""
        share = STEP_S / _SLIP_LASTS_S
        return value * (1 - share) + math.sqrt(2 * share) * float(self.rng.standard_normal())

    def _move(self) -> None:
        slip = self.conditions.slip
        grip = (1 - _SCRUB) if self.skid else 1.0
        speed = self.speed * (1 + slip * self._slip[0])
        turn = self.turn * grip * (1 + 2 * slip * self._slip[1]) + 0.4 * slip * self._slip[1] * abs(self.speed)
        after = _moved(self.pose, speed, turn)
        measured = self.speed
        if (speed or turn) and self.world.touches(after[0], after[1], RADIUS):
            self.collisions += not self._touching
            self._touching = True
            measured = speed = turn = 0.0
        else:
            self._touching = self._touching and not (speed or turn)
            self.distance += abs(speed) * STEP_S
            self.pose = after
        x = self.pose[0] - RADIUS - _WALL_THERE_M
        self.passed = max(self.passed, sum(x > gap.x for gap in self.world.passages))
        # Encoders count what the wheels turn, slip included; the gyroscope sees what the body turns.
        seen = turn + (_GYRO * float(self.rng.standard_normal()) / math.sqrt(STEP_S) if turn else 0.0)
        self.measured = measured, seen
        dx, dy, dyaw = self.failing.odometry_error(speed, self.odometry[2], STEP_S)
        x, y, yaw = _moved(self.odometry, measured, seen)
        self.odometry = x + dx, y + dy, yaw + dyaw


def _moved(pose: Pose, speed: float, turn: float) -> Pose:
    x, y, yaw = pose
    middle = yaw + turn * STEP_S / 2
    return x + speed * math.cos(middle) * STEP_S, y + speed * math.sin(middle) * STEP_S, yaw + turn * STEP_S


def _towards(value: float, target: float, step: float) -> float:
    return value + max(-step, min(step, target - value))
