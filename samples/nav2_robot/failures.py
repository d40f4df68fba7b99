"""What fails on the way: hardware or the world, a truth that no topic tells."""

from __future__ import annotations

import math
import random
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from nav2_robot.laser import limited
from nav2_robot.world import Floats

KINDS: Mapping[str, tuple[float, float]] = {
    "laser_dead": (0, 0),
    "laser_noise": (0.15, 0.6),
    "laser_stuck": (0, 0),
    "odom_jump": (0.4, 1.5),
    "odom_drift": (0.05, 0.25),
    "drive_weak": (0.05, 0.2),
    "drive_one_side": (0.2, 0.6),
    "stall": (30, 70),
    "blocked": (0, 0),
    "battery": (3.5, 5),
    "command_loss": (0.4, 0.8),
}
"""Sizes that are drawn: m (noise, jump), share of the way (drift), m/s (weak), share of the speed that turns
(one side), s (stall), V (battery), share of the commands (loss)."""

_LOSS_PERIOD_S = 2.0
"""Lost commands come in bursts, as a bad radio loses them."""


@dataclass(frozen=True)
class Failure:
    """What fails, how long after the first command, and how badly."""

    kind: str
    at_s: float
    size: float

    @classmethod
    def drawn(cls, rng: random.Random, kind: str = "") -> Failure:
        name = kind or rng.choice(sorted(KINDS))
        return cls(name, round(rng.uniform(3, 20), 1), round(rng.uniform(*KINDS[name]), 3))

    @classmethod
    def parse(cls, text: str) -> Failure:
        """`KIND:AT:SIZE`.

        Raises:
            ValueError: no such kind, or no numbers.
        """
        kind, at, size = (*text.split(":"), "0", "0")[:3]
        if kind not in KINDS:
            raise ValueError(f"nothing fails as {kind!r}; known: {', '.join(sorted(KINDS))}")
        if text.count(":") > 2 or not (math.isfinite(float(at)) and math.isfinite(float(size))):
            raise ValueError("a failure is KIND:AT:SIZE")
        return cls(kind, float(at), float(size))


@dataclass
class Failing:
    """A failure while a mission runs; before it begins, and without one, everything passes as it is."""

    failure: Failure | None
    began_s: float | None = None
    _frozen: Floats | None = field(default=None, repr=False)

    def watch(self, since_first_command_s: float | None, now_s: float) -> bool:
        """Whether the failure begins now."""
        waits = self.failure is not None and self.began_s is None and since_first_command_s is not None
        if not waits or self.failure is None or (since_first_command_s or 0.0) < self.failure.at_s:
            return False
        self.began_s = now_s
        return True

    def is_on(self, kind: str) -> bool:
        return self.began_s is not None and self.failure is not None and self.failure.kind == kind

    @property
    def size(self) -> float:
        return self.failure.size if self.failure is not None else 0.0

    def driven(self, speed: float, turn: float, now_s: float) -> tuple[float, float]:
        """What the wheels make of a command."""
        if self.is_on("drive_weak"):
            speed = max(-self.size, min(self.size, speed))
        if self.is_on("drive_one_side"):
            speed, turn = speed * (1 - self.size / 2), turn + self.size * speed
        stalled = self.is_on("stall") and now_s - (self.began_s or 0.0) < self.size
        lost = self.is_on("command_loss") and now_s % _LOSS_PERIOD_S < _LOSS_PERIOD_S * self.size
        return (0.0, 0.0) if stalled or lost else (speed, turn)

    def measured(self, ranges: Floats, rng: np.random.Generator) -> Floats | None:
        """What the laser sends of its ranges; None where it sends nothing."""
        if self.is_on("laser_dead"):
            return None
        if self.is_on("laser_noise"):
            return limited(ranges + self.size * rng.standard_normal(len(ranges)))
        if self.is_on("laser_stuck"):
            if self._frozen is None:
                self._frozen = ranges
            return self._frozen
        return ranges

    def odometry_error(self, speed: float, yaw: float, dt: float) -> tuple[float, float, float]:
        """By how much a step of the odometry is wrong: m, m, rad."""
        if not self.is_on("odom_drift"):
            return 0.0, 0.0, 0.0
        gone = self.size * speed * dt
        return gone * math.cos(yaw), gone * math.sin(yaw), 0.3 * self.size * abs(speed) * dt
