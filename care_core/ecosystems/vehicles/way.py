"""The way that a vehicle was asked to fly or drive, and the track that it took, in metres north and east of home."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np

from care_core.numbers import Floats, distinct, median
from care_core.records import Record
from care_core.run import Unavailable, Value

AIRBORNE_M = 2.0
"""Height above home from which a vehicle counts as airborne."""
FILL_S = 0.05
"""Spacing to which a thinned track is filled in before distances are taken from it."""
FILLABLE_S = 0.6
"""Median spacing above which a corner between two positions could be anything, and nothing is filled in."""

Ending = Literal["return", "land", "open"]

_SHARP_DEG = 60.0
"""Corners from which a vehicle that turns on the spot stops and does so (AR_PivotTurn.cpp: WP_PIVOT_ANGLE)."""
_AT_HEIGHT_M = 0.5
_LEVEL_M = 0.5
"""Height difference below which a leg is level."""


class RequestedMission(Record, eq=False):
    """A mission in metres from home. Legs begin above home, at the height of the take-off."""

    points: Floats
    """Shape (legs + 1, 3): north, east and height of the corners, the first above home."""
    holds_s: Floats
    """Shape (legs,): seconds to wait at the end of each leg."""
    speeds: Floats
    """Shape (legs,): commanded speed in m/s, 0 where the vehicle's own parameter rules."""
    ending: Ending
    """Whether it returns to home, lands where the last leg ends, or says neither."""

    @property
    def lengths(self) -> Floats:
        """Horizontal length of each leg in metres."""
        step = np.diff(self.points[:, :2], axis=0)
        return np.asarray(np.hypot(step[:, 0], step[:, 1]))

    @property
    def rises(self) -> Floats:
        """How far each leg leads up, in metres."""
        return np.asarray(np.diff(self.points[:, 2]))

    @property
    def turns_deg(self) -> Floats:
        """Change of course, 0 to 180 degrees, at each corner."""
        step = np.diff(self.points[:, :2], axis=0)
        course = np.degrees(np.arctan2(step[:, 1], step[:, 0]))
        return np.asarray(np.abs((np.diff(course) + 180.0) % 360.0 - 180.0))

    @property
    def corners_deg(self) -> Floats:
        """Change of course at each corner that is flown through without a wait."""
        return np.asarray(self.turns_deg[self.holds_s[:-1] == 0])

    @property
    def commanded_speed(self) -> float:
        """The speed that is commanded over most of the way, 0 where that is none."""
        chosen = {speed: self.lengths[self.speeds == speed].sum() for speed in dict.fromkeys(self.speeds.tolist())}
        return float(max(chosen, key=lambda speed: float(chosen[speed]), default=0.0))


NUMBERS: Mapping[str, Callable[[RequestedMission], float]] = {
    "path_length": lambda a: float(a.lengths.sum()),
    "legs": lambda a: float(len(a.lengths)),
    "leg_variation": lambda a: float(a.lengths.std() / max(a.lengths.mean(), 1e-9)),
    "climb": lambda a: float(np.maximum(a.rises, 0).sum()),
    "climbing_legs": lambda a: float((a.rises > _LEVEL_M).sum()),
    "descent": lambda a: float(np.maximum(-a.rises, 0).sum()),
    "descending_legs": lambda a: float((a.rises < -_LEVEL_M).sum()),
    "flown_corners": lambda a: float(len(a.corners_deg)),
    "corner_turn": lambda a: float(a.corners_deg.mean()) if len(a.corners_deg) else 0.0,
    "sharp_corners": lambda a: float((a.corners_deg > _SHARP_DEG).sum()),
    "sharp_turns": lambda a: float(a.turns_deg[a.turns_deg > _SHARP_DEG].sum()),
    "hold_time": lambda a: float(a.holds_s.sum()),
    "stops": lambda a: float((a.holds_s > 0).sum()),
    "commanded_speed": lambda a: a.commanded_speed,
    "takeoff_height": lambda a: float(a.points[0, 2]),
    "end_height": lambda a: float(a.points[-1, 2]),
    "return_distance": lambda a: math.hypot(*a.points[-1, :2]) if a.ending == "return" else 0.0,
    "returns": lambda a: float(a.ending == "return"),
}
"""What a mission is in numbers: lengths and heights in m, times in s, turns in degrees, speeds in m/s."""


class Phase(NamedTuple):
    """A part of the flight that was completed, in seconds of the log."""

    start_s: float
    end_s: float

    @property
    def duration_s(self) -> float:
        return self.end_s - self.start_s


class Track(Record, eq=False):
    """Where the vehicle was: arrays of shape (n,), seconds of the log and metres from home."""

    t: Floats
    north: Floats
    east: Floats
    height: Floats

    def between(self, start_s: float, end_s: float) -> Track | None:
        """The track from the position before a time to the one after another; None where there are not two."""
        first = max(int(np.searchsorted(self.t, start_s, side="right")) - 1, 0)
        part = slice(first, int(np.searchsorted(self.t, end_s, side="left")) + 1)
        if len(self.t[part]) < 2:
            return None
        return Track(self.t[part], self.north[part], self.east[part], self.height[part])

    def filled_in(self) -> Track:
        """The same track at `FILL_S` or closer: cubic Hermite between positions, velocities by central differences."""
        steps = np.diff(self.t)
        if len(steps) < 2 or not FILL_S < median(steps) <= FILLABLE_S or (steps <= 0).any():
            return self
        t = distinct(np.concatenate((self.t, np.arange(self.t[0], self.t[-1], FILL_S))))
        return Track(
            t, _hermite(t, self.t, self.north), _hermite(t, self.t, self.east), np.interp(t, self.t, self.height)
        )


class Flown(Protocol):
    """What was flown of a mission, of whatever firmware."""

    @property
    def track(self) -> Track | None: ...

    @property
    def end(self) -> tuple[float, float] | None:
        """North and east of where the mission ends; None where it does not say, or did not come there."""

    @property
    def phases(self) -> Mapping[tuple[str, int], Phase]: ...


def phases_home(
    track: Track, homeward_s: float, end_s: float, slow_below_m: float, *, returns: bool
) -> dict[str, Phase]:
    """The way home by height: the climb to the return height, the flight at it, the descent, the last metres.

    Args:
        homeward_s: when the vehicle set out for home. end_s: when it was disarmed.
        slow_below_m: height above home from which a landing is slow.
        returns: whether it flies home, or lands where it is.
    """
    after = track.t >= homeward_s
    t, height = track.t[after], track.height[after]
    if len(t) < 3 or height.max() < AIRBORNE_M:
        return {}
    high = np.flatnonzero(height >= height.max() - _AT_HEIGHT_M)
    top_s, leave_s = float(t[high[0]]), float(t[high[-1]])
    phases = {"return_climb": Phase(homeward_s, top_s)}
    if height[-1] > AIRBORNE_M:
        return phases
    phases["return_cruise"] = Phase(top_s, leave_s)
    if returns:
        phases["return"] = Phase(homeward_s, leave_s)
    low = np.flatnonzero((t >= leave_s) & (height <= slow_below_m))
    if not len(low):  # a height that no landing ends below
        return phases
    slow_s = float(t[low[0]])
    if height.max() > slow_below_m + 1.0:
        phases["descent"] = Phase(leave_s, slow_s)
    phases["touchdown"] = Phase(slow_s, end_s)
    return phases


def number_asked(asked: RequestedMission | Unavailable, what: str) -> Value:
    """One of the `NUMBERS` of a mission."""
    measure = NUMBERS.get(what)
    if measure is None:
        return Unavailable(f"there is no '{what}' of a mission", f"use one of {', '.join(NUMBERS)}")
    return asked if isinstance(asked, Unavailable) else measure(asked)


def span_in(phases: Mapping[tuple[str, int], Phase], args: Mapping[str, Any]) -> tuple[float, float] | Unavailable:
    """Start and end in the log of the part of the flight that the arguments of an extractor name."""
    name, index = str(args.get("phase", "")), int(args.get("index", 0))
    phase = phases.get((name, index))
    if phase is None:
        return Unavailable(f"the flight did not complete '{name}{f' {index}' if index else ''}'")
    return phase.start_s, phase.end_s


def landing_error(flown: Flown | Unavailable, no_track: Unavailable, no_end: str) -> Value:
    """Horizontal distance at the end of the flight from where the mission ends."""
    if isinstance(flown, Unavailable):
        return flown
    if flown.track is None:
        return no_track
    if flown.end is None:
        return Unavailable(no_end)
    return math.hypot(flown.track.north[-1] - flown.end[0], flown.track.east[-1] - flown.end[1])


def return_height(flown: Flown | Unavailable, no_track: Unavailable) -> Value:
    """The greatest height above home since the vehicle set out for it."""
    if isinstance(flown, Unavailable):
        return flown
    climb = span_in(flown.phases, {"phase": "return_climb"})
    if isinstance(climb, Unavailable):
        return climb
    if flown.track is None:
        return no_track
    return float(flown.track.height[flown.track.t >= climb[0]].max())


def distance_to_legs(points: Floats, corners: Floats) -> Floats:
    """Distance of each point, shape (n, 2), from the nearest of the legs between `corners`, shape (legs + 1, 2)."""
    if len(corners) < 2 or not len(points):
        return np.empty(0)
    nearest = np.full(len(points), np.inf)
    for start, end in pairwise(corners):  # leg by leg, since a log holds many points
        leg, along = end - start, points - start
        share = np.clip((along * leg).sum(axis=1) / max(float((leg**2).sum()), 1e-9), 0.0, 1.0)
        off = along - share[:, None] * leg
        nearest = np.minimum(nearest, np.hypot(off[:, 0], off[:, 1]))
    return nearest


def _hermite(t: Floats, known_t: Floats, known: Floats) -> Floats:
    """Cubic Hermite interpolation with central-difference slopes."""
    slope = np.gradient(known, known_t)
    i = np.clip(np.searchsorted(known_t, t, side="right") - 1, 0, len(known_t) - 2)
    width = known_t[i + 1] - known_t[i]
    u = (t - known_t[i]) / width
    from_left = (1 + 2 * u) * (1 - u) ** 2 * known[i] + u * (1 - u) ** 2 * width * slope[i]
    from_right = u**2 * (3 - 2 * u) * known[i + 1] + u**2 * (u - 1) * width * slope[i + 1]
    return np.asarray(from_left + from_right)
