"""Where a log ends with its vehicle in the air, and how fast that falls."""

from __future__ import annotations

from typing import NamedTuple

from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.vehicles import flies
from care_core.numbers import Floats, median

_HIGH_M, _RECENT_S = 2.0, 5.0
"""More than any estimate drifts in a flight; and a height is recorded once a second."""
_FALL_M, _FALLS_S = 10.0, 2.0
"""A landing sinks by 2 m/s at most, and drift less, in a time longer than a step of the height as it touches down."""
_SPEED_S = 0.5
"""What falls is ten times as fast a second later: its speed is that of its last moment."""
_LIFTING = 0.2
"""Armed motors idle below this throttle."""
FALLS_MS = 8.0
"""No copter is told to come down so fast: WPNAV_SPEED_DN and PILOT_SPEED_DN are at most 5 m/s."""


class Aloft(NamedTuple):
    """Where a log ends in the air."""

    height_m: float
    fell_m: float
    """How far it came down in the last seconds."""
    fell_ms: float
    """How fast, as the log ends."""

    @property
    def is_falling(self) -> bool:
        return self.fell_m >= _FALL_M

    def __str__(self) -> str:
        """As it is told: "12 m up", or "falling at 9 m/s"."""
        return f"falling at {self.fell_ms:.0f} m/s" if self.is_falling else f"{self.height_m:.0f} m up"


def ends_aloft(flight: Flight) -> Aloft | None:
    """How high it is at the last record; None where it lies on the ground there, crashed, or nothing tells. A copter's
    estimate that runs away is told by its barometer, and one whose motors lift nothing is up only where it falls."""
    known = [flight.height, flight.barometer if flight.is_copter else None]
    heights = [one for one in known if one is not None and len(one[0]) and one[0][-1] > flight.end_s - _RECENT_S]
    if not flies(flight.kind) or not heights or flight.impact_s is not None:
        return None
    told = [Aloft(float(median(m[-3:])), *_fell((t, m))) for t, m in heights]
    aloft = told[-1] if told[0].height_m - told[-1].height_m > _HIGH_M / 2 else told[0]
    throttle = flight.throttle if flight.is_copter else None
    lifts = throttle is None or float(median(throttle[1][-3:])) > _LIFTING
    return aloft if (aloft.height_m > _HIGH_M and lifts) or aloft.is_falling else None


def _fell(height: tuple[Floats, Floats]) -> tuple[float, float]:
    """How far it came down in the last seconds of the log, and how fast in the last moment."""
    t, known = height
    before = known[(t <= t[-1] - _FALLS_S) & (t > t[-1] - 2 * _FALLS_S)]
    if not len(before):
        return 0.0, 0.0
    since = int((t < t[-1] - _SPEED_S).sum()) - 1  # the record before that moment
    return float(before[-1] - median(known[-3:])), float((known[since] - known[-1]) / (t[-1] - t[since]))
