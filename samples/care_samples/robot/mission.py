"""One mission: the robot drives to its goals one after the other. SI units; the same seed gives the same mission."""

from __future__ import annotations

import math
import random
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from care_samples.robot.planner import Map, Point
from care_samples.robot.world import GOALS, RADIUS, START, Conditions, clearance, shelves

STEP_S = 0.05
GOAL_LIMIT_S = 40.0
SEES_M = 2.5
"""Clutter is seen from this near."""

_RECOVERIES = 3
"""So many recoveries, and a goal is given up."""
_BACK_S, _BACK_MPS = 1.5, -0.2
_LOW_S = 1.0
"""The battery must be low for so long before the robot stops."""

Outcome = Literal["succeeded", "aborted", "preempted"]

DEFAULTS: Mapping[str, float] = {
    "controller/max_speed": 0.6,
    "controller/max_turn_rate": 1.5,
    "controller/acceleration": 0.8,
    "controller/lookahead": 0.5,
    "controller/frequency": 10,
    "controller/slow_distance": 0.4,
    "controller/stop_margin": 0.1,
    "controller/rotate_first_angle": 0.8,
    "controller/goal_tolerance": 0.2,
    "controller/patience": 3.0,
    "planner/replan_period": 2.0,
    "planner/inflation_radius": 0.5,
    "planner/obstacle_weight": 4.0,
    "planner/footprint_padding": 0.05,
    "planner/publish_frequency": 2,
    "battery/low_voltage_stop": 10.8,
}


@dataclass
class Story:
    """What happened, as it is recorded; every entry begins with its time in s."""

    odometry: list[tuple[float, float, float, float, float, float]] = field(default_factory=list)
    """x, y, yaw, speed, turn rate."""
    commands: list[tuple[float, float, float]] = field(default_factory=list)
    battery: list[tuple[float, float, float]] = field(default_factory=list)
    """Voltage, current (negative: drawn)."""
    goals: list[tuple[float, int]] = field(default_factory=list)
    results: list[tuple[float, int, Outcome, str]] = field(default_factory=list)
    recoveries: list[tuple[float, str]] = field(default_factory=list)
    plans: list[tuple[float, list[Point]]] = field(default_factory=list)
    said: list[tuple[float, int, str]] = field(default_factory=list)
    """Level (2 info, 4 warning, 8 error) and text."""

    @property
    def reached(self) -> int:
        return sum(outcome == "succeeded" for _, _, outcome, _ in self.results)


class Robot:
    """Drives a mission with a set of parameters under the conditions of a run."""

    def __init__(self, parameters: Mapping[str, float], conditions: Conditions) -> None:
        self.p = {name.partition("/")[2]: value for name, value in {**DEFAULTS, **parameters}.items()}
        self.conditions = conditions
        self.map = Map(self.p["footprint_padding"], self.p["inflation_radius"], self.p["obstacle_weight"])
        self.rng = random.Random(f"noise {conditions.seed}")
        self.story = Story()
        self.t = 0.0
        self.x, self.y, self.yaw = START
        self.speed = self.turn = 0.0
        self.wanted = (0.0, 0.0)
        self.drawn_j = 0.0
        self.low_since: float | None = None
        self.rects = shelves()
        self.unseen = list(conditions.clutter)

    def run(self) -> Story:
        """The whole mission; a goal that is given up ends it, as does a battery that is too low."""
        self.story.said.append((0.0, 2, f"{len(GOALS)} goals"))
        self._rest(2.0)
        for number, goal in enumerate(GOALS):
            self.story.goals.append((self.t, number))
            outcome, text = self._go(goal)
            self.story.results.append((self.t, number, outcome, text))
            if outcome != "succeeded":
                self.story.said.append((self.t, 8, f"goal {number + 1} {outcome}: {text}"))
                break
            self._rest(0.5)
        self._rest(2.0)
        return self.story

    def _rest(self, time_s: float) -> None:
        self.wanted = (0.0, 0.0)
        for _ in range(round(time_s / STEP_S)):
            self._step()

    def _go(self, goal: Point) -> tuple[Outcome, str]:
        until, recovered = self.t + GOAL_LIMIT_S, 0
        way, planned_at, control_at, blocked_since = [(self.x, self.y)], -math.inf, self.t, -1.0
        while self.t < until:
            if self.low_since is not None and self.t - self.low_since > _LOW_S:
                return "aborted", "battery low"
            if math.dist((self.x, self.y), goal) <= self.p["goal_tolerance"]:
                return "succeeded", ""
            if self._look() or self.t - planned_at >= self.p["replan_period"]:
                way, planned_at = self.map.way((self.x, self.y), goal), self.t
                self.story.plans.append((self.t, way))
                if not way:
                    self.story.said.append((self.t, 4, "Failed to find a way to the goal"))
            if self.t >= control_at:
                control_at += 1.0 / max(self.p["frequency"], 0.5)
                self.wanted = self._command(way, goal)
                self.story.commands.append((self.t, *self.wanted))
                makes_way = abs(self.wanted[0]) > 0.01 or abs(self.wanted[1]) > 0.05
                blocked_since = -1.0 if makes_way else self.t if blocked_since < 0 else blocked_since
            self._step()
            if blocked_since >= 0 and self.t - blocked_since > self.p["patience"]:
                if recovered == _RECOVERIES:
                    return "aborted", "no way to the goal after all recoveries"
                recovered += 1
                self._recover(recovered)
                planned_at, control_at, blocked_since = -math.inf, self.t, -1.0
        return "preempted", f"not reached within {GOAL_LIMIT_S:g} s"

    def _look(self) -> bool:
        """Whether clutter came into sight."""
        seen = [disc for disc in self.unseen if math.dist((self.x, self.y), disc[:2]) < SEES_M]
        for disc in seen:
            self.unseen.remove(disc)
            self.map.see(disc)
        return bool(seen)

    def _command(self, way: list[Point], goal: Point) -> tuple[float, float]:
        """Pure pursuit of the way, slower near obstacles and before the goal; turning on the spot where it is aside."""
        if not way:
            return 0.0, 0.0
        aim = self._aim(way)
        off = _wrapped(math.atan2(aim[1] - self.y, aim[0] - self.x) - self.yaw)
        most = self.p["max_turn_rate"]
        if abs(off) > self.p["rotate_first_angle"]:
            return 0.0, max(-most, min(most, 2.0 * off))
        free = self._ahead() - RADIUS
        if free < self.p["stop_margin"]:
            # Aside of the obstacle there may be a way: turn to it, if it lies aside.
            return 0.0, max(-most, min(most, 2.0 * off)) if abs(off) > 0.15 else 0.0
        left = math.dist((self.x, self.y), goal)
        speed = min(self.p["max_speed"], math.sqrt(2 * self.p["acceleration"] * left), 0.05 + left)
        aside = clearance(self.x, self.y, self.map.discs, self.rects) - RADIUS
        if aside < self.p["slow_distance"]:
            speed *= max(0.15, aside / self.p["slow_distance"])
        distance = max(math.dist((self.x, self.y), aim), 0.05)
        turn = max(-most, min(most, 2 * speed * math.sin(off) / distance))
        return speed, turn

    def _aim(self, way: list[Point]) -> Point:
        """The point of the way that is the lookahead away, from where the robot is nearest to it."""
        here = (self.x, self.y)
        nearest = min(range(len(way)), key=lambda i: math.dist(here, way[i]))
        ahead = (point for point in way[nearest:] if math.dist(here, point) >= self.p["lookahead"])
        return next(ahead, way[-1])

    def _ahead(self) -> float:
        """Distance to what lies in front: measured at the places the robot would soon be."""
        nearest = math.inf
        for reach in (0.15, 0.3, 0.45):
            x, y = self.x + reach * math.cos(self.yaw), self.y + reach * math.sin(self.yaw)
            nearest = min(nearest, clearance(x, y, self.map.discs, self.rects) + 0.5 * reach)
        return nearest

    def _recover(self, number: int) -> None:
        self.story.recoveries.append((self.t, "back_up"))
        self.story.said.append((self.t, 4, f"Recovery {number}: no way was made, backing up"))
        self.wanted = (_BACK_MPS, self.rng.choice((-0.6, 0.6)))
        self.story.commands.append((self.t, *self.wanted))
        for _ in range(round(_BACK_S / STEP_S)):
            self._step()

    def _step(self) -> None:
        """Drive, collide and draw current for one step, and record."""
        rate = self.p["acceleration"] * STEP_S
        before = self.speed
        self.speed += max(-2 * rate, min(rate, self.wanted[0] - self.speed))
        self.turn += max(-4 * STEP_S, min(4 * STEP_S, self.wanted[1] - self.turn))
        grip = 1.0 - self.conditions.slip
        real_turn = self.turn + self.conditions.bias * self.speed + self.rng.gauss(0.0, 0.01)
        self.yaw = _wrapped(self.yaw + real_turn * STEP_S)
        real = self.speed * grip
        x, y = self.x + real * math.cos(self.yaw) * STEP_S, self.y + real * math.sin(self.yaw) * STEP_S
        if clearance(x, y, self.conditions.clutter, self.rects) >= RADIUS:
            self.x, self.y = x, y
        else:
            if self.speed > 0.05:
                self.story.said.append((self.t, 4, "Bumper pressed"))
            self.speed = real = 0.0
        self._draw(before)
        tick = round(self.t / STEP_S)
        if tick % 2 == 0:
            self.story.odometry.append((self.t, self.x, self.y, self.yaw, real, real_turn))
        self.t = (tick + 1) * STEP_S

    def _draw(self, before: float) -> None:
        push = max(0.0, self.speed - before) / STEP_S
        watts = 14.0 + 30.0 * abs(self.speed) + 6.0 * abs(self.turn) + 40.0 * push * abs(self.speed)
        self.drawn_j += watts * STEP_S
        rest = self.conditions.volts - self.drawn_j / 6000.0
        amps = watts / rest
        volts = rest - self.conditions.ohms * amps
        is_low = volts < self.p["low_voltage_stop"]
        self.low_since = (self.t if self.low_since is None else self.low_since) if is_low else None
        if round(self.t / STEP_S) % 10 == 0:
            self.story.battery.append((self.t, volts + self.rng.gauss(0.0, 0.01), -amps))


def _wrapped(angle: float) -> float:
    return (angle + math.pi) % (2 * math.pi) - math.pi
