"""The true heading of a copter, from how it speeds up where it leans.

A copter speeds up to where it leans; the receiver tells how it speeds up over the ground. Leans that are turned by a
heading which is off by some angle explain that speeding up but for this angle. No compass and no estimator enters.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.spans import during
from care_core.geodesy import GRAVITY
from care_core.numbers import Floats, median

_OVER_S, _LATE_S, _FEWEST, _HOLE_S = 1.0, 0.2, 30, 3.0
"""Speeds are compared over a second; a receiver tells them a fifth late."""


class Course(NamedTuple):
    """How the leans explain the speeding up over the ground."""

    off_deg: float
    """By how much the heading is less than the true one."""
    explained: float
    """Share of the variance that they explain, 0 to 1."""


class Leans:
    """The leans of a copter in the air beside how it sped up; `against` asks for a heading."""

    def __init__(self, t: Floats, lean: Floats, ends: tuple[Floats, Floats], gained: Floats, speed: Floats) -> None:
        self._t, self._lean, self._ends, self._gained, self._speed = t, lean, ends, gained, speed

    @classmethod
    def of(cls, flight: Flight) -> Leans | None:
        """None where the log does not tell both, or too little of them."""
        attitude, moved = flight.living_attitude("Roll", "Pitch"), flight.one("GPS", "Spd", "GCrs")
        if attitude is None or moved is None or not flight.is_copter or len(moved) < _FEWEST:
            return None
        attitude = attitude.where(np.isfinite(attitude["Roll"]) & np.isfinite(attitude["Pitch"]))
        moved = moved.where(np.isfinite(moved["Spd"]) & np.isfinite(moved["GCrs"]))
        t, speed = moved.t, moved["Spd"] * np.exp(1j * np.radians(moved["GCrs"]))
        step = max(round(_OVER_S / max(float(median(np.diff(t))), 1e-3)), 1) if len(t) > _FEWEST else 0
        if not step:
            return None
        begin, end = t[:-step], t[step:]
        flying = during(flight.flown, begin) & during(flight.flown, end) & (end - begin < _HOLE_S) & (end > begin)
        if flying.sum() < _FEWEST or len(attitude) < _FEWEST:
            return None
        roll, pitch = np.radians(attitude["Roll"]), np.radians(attitude["Pitch"])
        lean = GRAVITY * (-np.tan(pitch) + 1j * np.tan(roll) / np.cos(pitch))
        gained = ((speed[step:] - speed[:-step])[flying]) / (end - begin)[flying]
        middle = 0.5 * (speed[step:] + speed[:-step])[flying]
        return cls(attitude.t, lean, (begin[flying], end[flying]), gained, middle)

    @property
    def strength(self) -> float:
        """How much it sped up and slowed down, m/s^2."""
        return float(np.sqrt(np.mean(np.abs(self._gained) ** 2)))

    def against(self, t: Floats, heading: Floats) -> Course:
        """How a heading (radians, at times t) turns the leans to the speeding up, beside drag and wind."""
        told = np.isfinite(heading)
        if not told.any():
            return Course(0.0, 0.0)
        turned = self._lean * np.exp(1j * np.interp(self._t, t[told], np.unwrap(heading[told])))
        push = np.concatenate(([0.0], np.cumsum(0.5 * (turned[1:] + turned[:-1]) * np.diff(self._t))))
        begin, end = (np.interp(one - _LATE_S, self._t, push) for one in self._ends)
        mean = (end - begin) / (self._ends[1] - self._ends[0])
        known = np.stack((mean, -self._speed, np.ones(len(mean))), axis=1)
        found = np.linalg.lstsq(known, self._gained, rcond=None)[0]
        rest = self._gained - known @ found
        spread = float(np.sum(np.abs(self._gained - self._gained.mean()) ** 2))
        return Course(float(np.degrees(np.angle(found[0]))), 1.0 - float(np.sum(np.abs(rest) ** 2)) / max(spread, 1e-9))
