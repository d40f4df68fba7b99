"""Which time stamps of a log can be believed, and one steady clock through those that can.

Stamps have no checksum: a flipped bit moves a record by years. Clocks also restart (the vehicle rebooted) or are set
while they run (the ground station found its time server). The first is damage, the second is taken out.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from care_core.frozen import dataclass
from care_core.run import Damage

Floats = NDArray[np.float64]
Offsets = NDArray[np.integer[Any]]

BACK_S = 1.0
"""How far a record may lie before the one written ahead of it: several tasks write into one log."""
STEP_S = 5.0
"""A longer step forward is looked at; most are pauses of the recording."""
PAUSE_S = 86_400.0
"""A longer step forward is a clock that was set, no pause."""
_STEADY = 20  # records in a row that agree with each other say what the clock is

_PIECE = 1 << 18


@dataclass(frozen=True, slots=True, eq=False)
class Clock:
    """Seconds since the start of a log. `places` are the bytes from which on `shifts` are taken off the stamps."""

    first_s: float
    last_s: float
    places: Offsets
    shifts: Floats

    @property
    def duration_s(self) -> float:
        return max(self.last_s - self.first_s, 0.0)

    def seconds(self, stamps_s: Floats, places: Offsets) -> Floats:
        """Time in the log of the stamps of records at these bytes, both of shape (n,)."""
        if not len(self.places):
            return stamps_s - self.first_s
        shifts = np.concatenate(([0.0], self.shifts))
        return stamps_s - shifts[np.searchsorted(self.places, places, side="right")] - self.first_s


def find_clock(stamps_s: Floats, places: Offsets) -> tuple[Clock, NDArray[np.bool_], list[Damage]]:
    """The clock of a log, the records whose stamp is impossible (a mask), and where the clock jumped.

    Args:
        stamps_s: shape (n,), the stamps in seconds, in the order of the file.
        places: shape (n,), the byte at which each record begins.
    """
    finite = np.isfinite(stamps_s)
    impossible = ~finite
    if impossible.any():
        clock, beyond, jumps = find_clock(stamps_s[finite], places[finite])
        impossible[np.flatnonzero(finite)[beyond]] = True
        return clock, impossible, jumps
    if not len(stamps_s):
        return Clock(0.0, 0.0, np.empty(0, dtype=np.int64), np.empty(0)), impossible, []
    runs = _runs(stamps_s)
    steady = min(_STEADY, max(end - start for start, end in runs))
    upcoming = _next_start(stamps_s, runs, steady)
    shift, now, first_s = 0.0, -np.inf, np.nan
    shifts: list[tuple[int, float]] = []
    jumps = []
    for (start, end), following in zip(runs, upcoming, strict=True):
        begins, ends = float(stamps_s[start]) - shift, float(stamps_s[end - 1]) - shift
        if end - start < steady:
            if not _fits(begins, ends, now, following - shift):
                impossible[start:end] = True
                continue
        elif now > -np.inf and not -BACK_S <= begins - now <= PAUSE_S:
            jump_s = begins - now
            what = f"the clock of the log jumps by {jump_s:+.0f} s"
            jumps.append(Damage(what, int(places[start]), now - first_s, is_jump=True))
            shift += jump_s
            shifts.append((int(places[start]), shift))
            ends -= jump_s
        first_s = begins if np.isnan(first_s) else first_s
        now = max(now, ends)
    changes = np.array([place for place, _ in shifts], dtype=np.int64)
    clock = Clock(first_s, now, changes, np.array([amount for _, amount in shifts]))
    return clock, impossible, jumps


def _runs(stamps_s: Floats) -> list[tuple[int, int]]:
    """Stretches of the file, first and one past the last record, in which each stamp follows from the one before."""
    cuts: list[int] = []
    for low in range(0, len(stamps_s), _PIECE):
        steps = np.diff(stamps_s[low : low + _PIECE + 1])
        cuts += (np.flatnonzero((steps < -BACK_S) | (steps > STEP_S)) + (low + 1)).tolist()
    bounds = [0, *cuts, len(stamps_s)]
    return list(pairwise(bounds))


def _next_start(stamps_s: Floats, runs: list[tuple[int, int]], steady: int) -> list[float]:
    """For each run the first stamp of the next steady one, of the next at all where none is, infinity at the end."""
    upcoming, following, is_steady = [], np.inf, False
    for start, end in reversed(runs):
        upcoming.append(following)
        if end - start >= steady or not is_steady:
            following, is_steady = float(stamps_s[start]), end - start >= steady
    return upcoming[::-1]


def _fits(begins: float, ends: float, now: float, following: float) -> bool:
    """Whether a few records belong between what was written before and after them."""
    after = now == -np.inf or -BACK_S <= begins - now <= PAUSE_S
    if not following >= now - BACK_S:  # the clock starts again there, or that stamp is the wrong one
        following = np.inf
    before = following == np.inf or -BACK_S <= following - ends <= PAUSE_S
    return after and before
