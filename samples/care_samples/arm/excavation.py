"""One excavation: unstow, go above the site, look for the surface with a guarded move, dig, retract. SI units.

The soil and where its surface really is differ from run to run and are in no log. Same seed, same mission.
"""

from __future__ import annotations

import math
import random
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

STEP_S = 0.1
SUCCEEDED, ABORTED = 3, 4
"""Codes of actionlib_msgs/GoalStatus."""
WANTED_CM3 = 150.0
"""The sample that the mission wants."""

DEFAULTS: Mapping[str, float] = {
    "predicted_surface": -0.2,
    "search_distance": 0.06,
    "force_threshold": 12.0,
    "torque_threshold": 20.0,
    "approach_speed": 0.02,
    "approach_height": 0.08,
    "settle_time": 1.0,
    "joint_speed": 0.2,
    "dig_depth": 0.02,
    "dig_length": 0.15,
    "dig_speed": 0.02,
    "dig_passes": 3,
    "retract_height": 0.15,
    "camera_rate": 2,
}
RANGES: Mapping[str, tuple[float, float]] = {
    "predicted_surface": (-0.26, -0.14),
    "search_distance": (0.01, 0.12),
    "force_threshold": (2.0, 80.0),
    "torque_threshold": (4.0, 60.0),
    "approach_speed": (0.005, 0.08),
    "approach_height": (0.03, 0.2),
    "settle_time": (0.0, 5.0),
    "joint_speed": (0.05, 0.6),
    "dig_depth": (0.005, 0.05),
    "dig_length": (0.05, 0.25),
    "dig_speed": (0.005, 0.06),
    "dig_passes": (1, 6),
    "retract_height": (0.05, 0.3),
    "camera_rate": (1, 10),
}
WHOLE = ("dig_passes", "camera_rate")

_WRIST_M = 0.35
"""Lever of the wrist's torque."""
_MOST_N = 140.0
"""The arm stops itself at this force."""
_SCOOP_M = 0.06
_JOINT_MOVES = ((0.0, 1.1, 1.4, -0.8, 0.3, 0.0, 0.0), (0.4, 0.9, 1.6, -0.6, 0.5, 0.2, 0.0))


@dataclass(frozen=True)
class Soil:
    """What one run meets."""

    surface: float
    """Height of the surface, m."""
    stiffness: float
    """Of the ground under the scoop, N/m."""
    strength: float
    """Force of digging per cross section, N/m^2."""
    shake: float
    """Noise of the force sensor on a moving arm, N per m/s."""
    seed: int

    @classmethod
    def of(cls, seed: int) -> Soil:
        rng = random.Random(f"soil {seed}")
        return cls(
            surface=-0.2 + rng.gauss(0.0, 0.008),
            stiffness=500.0 * math.exp(rng.gauss(0.0, 0.25)),
            strength=2.0e4 * math.exp(rng.gauss(0.0, 0.25)),
            shake=rng.uniform(60.0, 110.0),
            seed=seed,
        )


@dataclass(frozen=True)
class Command:
    """An action as it was sent and answered."""

    name: str
    sent_s: float
    ended_s: float
    status: int
    text: str
    height: float
    force: float
    torque: float
    angles: tuple[float, ...] = ()
    found: bool = False
    """Whether a guarded move was stopped by what it guards."""
    retracting: bool = False


@dataclass
class Story:
    """What happened, as it is recorded; every entry of a list begins with its time in s."""

    commands: list[Command] = field(default_factory=list)
    wrist: list[tuple[float, float, float, float]] = field(default_factory=list)
    """Height of the scoop, force, torque."""
    battery: list[tuple[float, float, float]] = field(default_factory=list)
    said: list[tuple[float, int, str]] = field(default_factory=list)
    sample_cm3: float = 0.0
    ended_s: float = 0.0

    @property
    def is_success(self) -> bool:
        return self.sample_cm3 >= WANTED_CM3 and all(one.status == SUCCEEDED for one in self.commands)


class Arm:
    """Digs with a set of parameters in the soil of a run."""

    def __init__(self, parameters: Mapping[str, float], soil: Soil) -> None:
        self.p = {**DEFAULTS, **parameters}
        self.soil = soil
        self.rng = random.Random(f"arm {soil.seed}")
        self.story = Story()
        self.t, self.height, self.drawn_j = 0.0, 0.3, 0.0
        self.speed = 0.0
        self.force = 0.0

    def run(self) -> Story:
        """The whole mission; the first command that fails ends it, the arm stopped in place."""
        self.story.said.append((self.t, 2, "excavation begins"))
        for works in (self._unstow, self._above, self._search, self._dig, self._retract):
            if not works():
                break
        self._wait(1.0)
        self.story.ended_s = self.t
        self.story.said.append((self.t, 2, f"excavation ends with {self.story.sample_cm3:.0f} cm3"))
        return self.story

    def _unstow(self) -> bool:
        return self._joints("ARM_MOVE_JOINTS", _JOINT_MOVES[0], 2.2, guarded=False)

    def _above(self) -> bool:
        works = self._joints("ARM_MOVE_JOINTS_GUARDED", _JOINT_MOVES[1], 0.9, guarded=True)
        self.height = self.p["predicted_surface"] + self.p["approach_height"]
        return works

    def _joints(self, name: str, angles: tuple[float, ...], turn: float, *, guarded: bool) -> bool:
        """Move the joints; a guarded move takes the arm's own shaking for contact where its limits are low."""
        sent_s, speed = self.t, self.p["joint_speed"]
        for _ in range(max(1, round(turn / speed / STEP_S))):
            self._step(0.0, 25.0 * speed * self.rng.uniform(0.5, 1.0))
            if guarded and (self.force > self.p["force_threshold"] * 2 or self._torque > self.p["torque_threshold"]):
                return self._answer(
                    name, sent_s, ABORTED, "ARM_GOAL_ERROR: contact before the goal", angles, found=True
                )
        return self._answer(name, sent_s, SUCCEEDED, "", angles)

    def _search(self) -> bool:
        """Go down until force or torque says that the surface is there; the arm gives up at the end of its search."""
        self._wait(self.p["settle_time"])
        name, sent_s, speed = "ARM_MOVE_CARTESIAN_GUARDED", self.t, self.p["approach_speed"]
        lowest = self.p["predicted_surface"] - self.p["search_distance"]
        # Right after a joint move the arm still swings.
        swing = 3.0 * self.p["joint_speed"] / 0.2 * math.exp(-self.p["settle_time"])
        while self.height > lowest:
            self.height -= speed * STEP_S
            shaken = abs(self.rng.gauss(0.0, 0.25 + 0.012 * self.soil.shake * speed / 0.02)) + swing
            self._step(speed, shaken + self.soil.stiffness * max(0.0, self.soil.surface - self.height))
            swing *= 0.9
            if self.force >= _MOST_N:
                return self._answer(name, sent_s, ABORTED, "ARM_GOAL_ERROR: force limit of the arm")
            if self.force >= self.p["force_threshold"] or self._torque >= self.p["torque_threshold"]:
                return self._answer(name, sent_s, SUCCEEDED, "", found=True)
        self.story.said.append((self.t, 8, "surface not found: no contact down to the end of the search"))
        return self._answer(name, sent_s, ABORTED, "ARM_GOAL_ERROR: surface not found")

    def _dig(self) -> bool:
        name, sent_s, ground = "ARM_MOVE_CARTESIAN", self.t, self.height
        for number in range(int(self.p["dig_passes"])):
            self.height = ground - self.p["dig_depth"] * (number + 1) / self.p["dig_passes"] - 0.004 * number
            below = max(0.0, self.soil.surface - self.height)
            steps = max(1, round(self.p["dig_length"] / self.p["dig_speed"] / STEP_S))
            load = self.soil.strength * below * _SCOOP_M * (1 + 6 * self.p["dig_speed"])
            for _ in range(steps):
                self._step(self.p["dig_speed"], load * self.rng.uniform(0.85, 1.15))
                if self.force >= _MOST_N:
                    self.story.said.append((self.t, 8, "force limit of the arm while digging"))
                    return self._answer(name, sent_s, ABORTED, "ARM_GOAL_ERROR: force limit of the arm")
            self.story.sample_cm3 += 1e6 * 0.28 * below * _SCOOP_M * self.p["dig_length"]
        return self._answer(name, sent_s, SUCCEEDED, "")

    def _retract(self) -> bool:
        name, sent_s = "ARM_MOVE_CARTESIAN_GUARDED", self.t
        target = self.height + self.p["retract_height"]
        while self.height < target:
            self.height += self.p["approach_speed"] * 2 * STEP_S
            self._step(self.p["approach_speed"] * 2, abs(self.rng.gauss(0.0, 0.3)))
        return self._answer(name, sent_s, SUCCEEDED, "", retracting=True)

    @property
    def _torque(self) -> float:
        return self.force * _WRIST_M

    def _wait(self, time_s: float) -> None:
        for _ in range(round(time_s / STEP_S)):
            self._step(0.0, 0.0)

    def _step(self, speed: float, load: float) -> None:
        """Feel the ground and what else loads the wrist, draw power, and record."""
        self.force = load + abs(self.rng.gauss(0.0, 0.15))
        watts = 18.0 + 220.0 * speed + 30.0 * self.p["joint_speed"] * (speed == 0.0 and load > 0.0) + 0.25 * self.force
        self.drawn_j += watts * STEP_S
        volts = 28.4 - self.drawn_j / 40_000.0 - 0.02 * watts / 28.0
        self.story.wrist.append((self.t, self.height, self.force, self._torque))
        if round(self.t / STEP_S) % 10 == 0:
            self.story.battery.append((self.t, volts + self.rng.gauss(0.0, 0.005), -watts / volts))
        self.t = round(self.t + STEP_S, 6)

    def _answer(
        self, name: str, sent_s: float, status: int, text: str, angles: tuple[float, ...] = (), *, found: bool = False,
        retracting: bool = False,
    ) -> bool:  # fmt: skip
        ended = Command(
            name, sent_s, self.t, status, text, self.height, self.force, self._torque, angles, found, retracting
        )
        self.story.commands.append(ended)
        return status == SUCCEEDED


def commands_in_words(story: Story) -> Iterator[str]:
    """A line a command, for people."""
    for one in story.commands:
        yield f"{one.sent_s:6.1f} s  {one.name}  {one.text or 'done'}"
