"""Which time stamps of a log can be believed, and one steady clock through those that can.

Stamps have no checksum: a flipped bit moves a record by years. Clocks also restart (the vehicle rebooted) or are set
while they run (the ground station found its time server). The first is damage, the second is taken out.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from care_core.numbers import Bools, Floats, median
from care_core.records import Record, Struct
from care_core.run import Damage

Offsets = NDArray[np.integer[Any]]

BACK_S = 1.0
"""How far a record may lie before the one written ahead of it: several tasks write into one log."""
STEP_S = 5.0
"""A longer step forward is looked at; most are pauses of the recording."""
PAUSE_S = 86_400.0
"""A longer step forward is a clock that was set, no pause."""
PACE = 1.2
"""How far two clocks of one flight may run apart: in 24 logs of four firmwares they agree to 0.3%."""
_PIECE_S, _PIECES, _NOTHING_S = 10.0, 3, 1e-6
"""Seconds in which their paces are compared, fewest such pieces, and a clock that stands."""
_STANDS = 1e3
"""Seconds of a vehicle in one of a clock that stands, or nearly so."""
_RESTARTS = 5
"""Of one vehicle in one log; of two that speak under one name each message seems to be one."""
_STEADY = 20  # records in a row that agree with each other say what the clock is


class Clock(Record, eq=False):
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


class OwnClock(Record, eq=False):
    """What records say by a clock of the robot itself, beside the stamps of who recorded them: a step that this one did
    not make is no pause, the recorder's clock was set."""

    places: Offsets
    """The bytes of the records that say it, shape (k,), ascending."""
    seconds: Floats
    stamps_s: Floats
    """When the recorder got them, by its clock."""

    def set_s(self, place: int) -> float:
        """By how much the recorder's clock was set forward at a byte; 0 where this one started again or stood still.
        What was held up on its way comes late as well, but not all that follows it."""
        row = int(np.searchsorted(self.places, place))
        before = slice(max(row - _STEADY, 0), row)
        if not 0 < row < len(self.places) or np.ptp(self.seconds[before]) == 0:
            return 0.0
        if self.seconds[row] < self.seconds[row - 1] - BACK_S:
            return 0.0
        late_s = self.stamps_s - self.seconds
        return float(late_s[row:].min() - median(late_s[before]))


class VehicleTime(Record, eq=False):
    """The vehicle's own time, where the clock of who recorded it cannot be believed: seconds since its first message,
    by the bytes of the records that tell it, both of shape (k,) and ascending."""

    places: Offsets
    seconds: Floats
    pace: float
    """Seconds of the vehicle in one of the recorder's clock."""

    def __str__(self) -> str:
        how = f"{self.pace:.2g} s of it pass in one of" if self.pace < _STANDS else "nothing passes by"
        return f"the vehicle's own: {how} the ground station's clock"

    @property
    def duration_s(self) -> float:
        return float(self.seconds[-1])

    def at(self, places: Offsets) -> Floats:
        """The time of records at these bytes: of one that tells none, between its neighbours'."""
        return np.asarray(np.interp(places, self.places, self.seconds), np.float64)


def since_start(own_s: Floats) -> Floats:
    """What a vehicle says of the time since it was started, going on where it was started again."""
    restarts = np.append(0.0, np.maximum(own_s[:-1] - own_s[1:], 0.0))
    going_on: Floats = np.maximum.accumulate(own_s + np.cumsum(np.where(restarts > BACK_S, restarts, 0.0)))
    return going_on


def vehicle_time(own: OwnClock, clock: Clock) -> VehicleTime | None:
    """The vehicle's own time where the recorder's clock runs too fast or slow against it, or stands; None where the two
    agree. A simulator runs at its own pace, and a station's clock is set; what the vehicle says is of neither."""
    restarts = np.count_nonzero(np.diff(own.seconds) < -BACK_S)
    if len(own.places) < _STEADY or restarts > _RESTARTS:
        return None
    true_s, said_s = since_start(own.seconds), clock.seconds(own.stamps_s, own.places)
    edges = np.unique(np.searchsorted(true_s, np.arange(true_s[0], true_s[-1], _PIECE_S)))
    true, said = np.diff(true_s[edges]), np.diff(said_s[edges])
    steady = true < 2 * _PIECE_S  # a simulator that is halted leaps ahead, and is none the slower else
    if np.count_nonzero(steady) < _PIECES:
        return None
    pace = median(true[steady] / np.maximum(said[steady], _NOTHING_S))
    return None if 1 / PACE < pace < PACE else VehicleTime(own.places, true_s - true_s[0], float(pace))


def find_clock(stamps_s: Floats, places: Offsets, own: OwnClock | None = None) -> tuple[Clock, Bools, list[Damage]]:
    """The clock of a log, the records whose stamp is impossible (a mask), and where the clock jumped.

    Args:
        stamps_s: shape (n,), the stamps in seconds, in the order of the file.
        places: shape (n,), the byte at which each record begins.
        own: what tells a pause from a clock that was set forward.
    """
    clock, spans, jumps = clock_of([(stamps_s, places)], own)
    impossible = ~np.isfinite(stamps_s)
    for first, last in spans:
        impossible[np.searchsorted(places, first) : np.searchsorted(places, last, side="right")] = True
    return clock, impossible, jumps


def clock_of(
    pieces: Iterable[tuple[Floats, Offsets]], own: OwnClock | None = None
) -> tuple[Clock, list[tuple[int, int]], list[Damage]]:
    """As `find_clock`, of stamps that come piece by piece, as a large log is read: none is held. In place of a mask the
    bytes of the first and last of records in a row whose stamps are impossible."""
    runs, spans = _runs(pieces)
    if not runs:
        return Clock(0.0, 0.0, np.empty(0, dtype=np.int64), np.empty(0)), spans, []
    steady = min(_STEADY, max(run.count for run in runs))
    shift, now, first_s = 0.0, -np.inf, np.nan
    shifts: list[tuple[int, float]] = []
    jumps = []
    for run, following in zip(runs, _next_start(runs, steady), strict=True):
        begins, ends = run.begins_s - shift, run.ends_s - shift
        if run.count < steady:
            if not _fits(begins, ends, now, following - shift):
                spans.append((run.first, run.last))
                continue
        elif now > -np.inf and (jump_s := _jump(begins - now, run.first, own)):
            what = f"the clock of the log jumps by {jump_s:+.0f} s"
            jumps.append(Damage(what, run.first, now - first_s, is_jump=True))
            shift += jump_s
            shifts.append((run.first, shift))
            ends -= jump_s
        first_s = begins if np.isnan(first_s) else first_s
        now = max(now, ends)
    changes = np.array([place for place, _ in shifts], dtype=np.int64)
    clock = Clock(first_s, now, changes, np.array([amount for _, amount in shifts]))
    return clock, sorted(spans), jumps


def _jump(step_s: float, place: int, own: OwnClock | None) -> float:
    """By how much a clock was set at a record that is stamped so much later than what was written before; 0 where it
    went on."""
    if not -BACK_S <= step_s <= PAUSE_S:
        return step_s
    set_s = 0.0 if own is None or step_s <= STEP_S else own.set_s(place)
    return set_s if set_s > STEP_S else 0.0


class _Run(Struct, eq=False):
    """Records in a row in which each stamp follows from the one before: how many, the bytes of the first and the last,
    and their stamps."""

    count: int
    first: int
    last: int
    begins_s: float
    ends_s: float


def _runs(pieces: Iterable[tuple[Floats, Offsets]]) -> tuple[list[_Run], list[tuple[int, int]]]:
    """The runs of the records whose stamps are numbers, and the places of the others, each twice."""
    runs: list[_Run] = []
    unknown: list[int] = []
    for said_s, said_at in pieces:
        finite = np.isfinite(said_s)
        unknown += said_at[~finite].tolist()
        stamps_s, places = said_s[finite], said_at[finite]
        if not len(stamps_s):
            continue
        steps = np.diff(stamps_s, prepend=runs[-1].ends_s if runs else np.nan)
        bounds = [*np.flatnonzero(~((steps >= -BACK_S) & (steps <= STEP_S))).tolist(), len(stamps_s)]
        if bounds[0]:  # those ahead of the first break go on with the run of the piece before
            end = bounds[0]
            runs[-1].count += end
            runs[-1].last, runs[-1].ends_s = int(places[end - 1]), float(stamps_s[end - 1])
        for start, end in pairwise(bounds):
            first, last = int(places[start]), int(places[end - 1])
            runs.append(_Run(end - start, first, last, float(stamps_s[start]), float(stamps_s[end - 1])))
    return runs, [(place, place) for place in unknown]


def _next_start(runs: Sequence[_Run], steady: int) -> list[float]:
    """For each run the first stamp of the next steady one, of the next at all where none is, infinity at the end."""
    upcoming, following, is_steady = [], np.inf, False
    for run in reversed(runs):
        upcoming.append(following)
        if run.count >= steady or not is_steady:
            following, is_steady = run.begins_s, run.count >= steady
    return upcoming[::-1]


def _fits(begins: float, ends: float, now: float, following: float) -> bool:
    """Whether a few records belong between what was written before and after them."""
    after = now == -np.inf or -BACK_S <= begins - now <= PAUSE_S
    if not following >= now - BACK_S:  # the clock starts again there, or that stamp is the wrong one
        following = np.inf
    before = following == np.inf or -BACK_S <= following - ends <= PAUSE_S
    return after and before
