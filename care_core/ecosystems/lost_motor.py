"""Which motor gave way as a multicopter was upset, by what was asked of each just before: any firmware, any frame.

A motor that gives too little lets its corner sink, and the controller asks for more of it, alone, while the vehicle
turns on towards it: it is driven hardest before the lean passes what is control, and the first near its limit. In all
of seven such flights under PX4 it is. What turns about its yaw axis has a pair up, what lacks thrust has all of them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from care_core.ecosystems.base import Limits
from care_core.ecosystems.vehicles import Motor
from care_core.numbers import Bools, Floats, median
from care_core.records import Record
from care_core.text import listed, log_time

LIMITS = Limits()
_BEFORE_S = LIMITS.add("time before the upset", 0.15, "s", "7 of 7 flights with a motor cut: hardest driven in 0.3 s")
_SLOW_S = LIMITS.add(
    "the same, of a log with no record in it", 0.5, "s", "a choice: outputs are logged at 10 Hz, or less"
)
_EXACT_S = LIMITS.add("time after which a record still tells of it", 0.05, "s", "a choice: topics have own times")
_NEAR_LIMIT = LIMITS.add("output near its limit", 0.8, "of the range", "7 of 7: the first above 1800 us")
_SOON_S = LIMITS.add("time around the upset in which it comes near", 1.0, "s", "a choice: then it tumbles")
_CLEARLY = LIMITS.add("output above the next motor's", 0.08, "of the range", "7 of 7: 0.12 and more; a yaw has pairs")
_ROSE = LIMITS.add("rise of that output", 0.15, "of the range", "7 of 7: 0.28 and more")
_CALM_S = LIMITS.add(
    "start of the calm before", 3.0, "s", "a choice: long enough for a mean, and short enough for the same manoeuvre"
)
_CROWDED = LIMITS.add("output of the others", 0.7, "of the range", "a choice: above it all have too little")
_TOWARDS = LIMITS.add("cosine between its arm and the fall", 0.3, "", "a choice: it lies on that side")
_ARM_DEG = LIMITS.add("angle between motors on one arm", 5.0, "deg", "a choice: Y6 and octaquads stack two")
_WINDOW_S = LIMITS.add("window of a motor that works harder and flies on", 4.0, "s", "a choice: a turn is over sooner")
_ALONE = LIMITS.add(
    "its output above the middle of the others", 0.08, "of the range",
    "in nine of ten healthy training flights under ArduPilot none is 0.02 above",
)  # fmt: skip
_NEXT = LIMITS.add("share of that excess that the next motor may have", 0.6, "", "a choice: one motor, not a pair")
_BEFORE = LIMITS.add("share of that which it may have had before", 1 / 3, "", "a choice: then it was even")
_FAR = LIMITS.add("its output above them where nothing was flown before", 0.16, "of the range", "twice the former")
_EVEN = LIMITS.add("share of that within which the others are alike", 0.25, "", "a choice: a load tips one across")
_STAYS = LIMITS.add("share of the flight after it", 0.7, "", "a choice: a weak motor stays weak")
PROBABILITY = LIMITS.add("probability that it gave way", 0.85, "", "as where it fell towards a motor")


class Commands(Record, eq=False):
    """What was asked of each motor."""

    t: Floats
    share: Floats
    """Shape (motors, n): 0 idle, 1 the most that it may give."""
    numbers: tuple[int, ...]
    """The motors' numbers, in the order of the rows."""


class Hardest(Record):
    """The motor that was driven hardest."""

    number: int
    twins: tuple[int, ...]
    """The others on its arm that were driven about as hard: which of them gave way, commands do not tell."""
    share: float
    others: float
    """Middle of the other motors."""
    near_s: float
    """When it came near its limit, the first of all."""

    @property
    def evidence(self) -> str:
        """What shows it, in a clause."""
        return (
            f"as the vehicle tipped it was driven hardest, at {self.share:.0%} where the others were at "
            f"{self.others:.0%}, and was the first above {_NEAR_LIMIT:.0%} ({log_time(self.near_s)}), yet its side "
            "fell: the motor, its controller or its propeller"
        )

    def title(self, motors: Iterable[Motor]) -> str:
        """The motor by its number and place, with those that it cannot be told from."""
        places = {motor.number: motor.place for motor in motors if motor.place}
        place = f" ({places[self.number]})" if self.number in places else ""
        several = listed([f"motor {n}" for n in (self.number, *self.twins)], "or")
        return f"{several}{place} gave too little thrust"


def driven_hardest(
    commands: Commands, upset_s: float, fall: tuple[float, float], arms_deg: Mapping[int, float]
) -> Hardest | None:
    """The motor that was driven hardest, alone, just before an upset, and was the first near its limit.

    Args:
        upset_s: when the lean passed what is control.
        fall: forward and right parts of where it leaned then, off its demand; of any length.
        arms_deg: clockwise from the nose, where each motor sits; empty where nobody knows.
    """
    t = commands.t
    window = _last_rows(t, upset_s)
    calm = (t >= upset_s - _CALM_S) & (t <= upset_s - _SOON_S)
    if not window.any() or not calm.any() or len(commands.numbers) < 3:
        return None
    asked = commands.share[:, window].mean(axis=1)
    row = int(np.argmax(asked))
    number = commands.numbers[row]
    twins = [n for n, other in enumerate(commands.numbers) if n != row and _share_an_arm(arms_deg, number, other)]
    alike = [n for n in twins if asked[row] - asked[n] < _CLEARLY]
    others = np.delete(asked, [row, *twins])
    rise = asked[row] - float(median(commands.share[row, calm]))
    if asked[row] - others.max() < _CLEARLY or rise < _ROSE or float(median(others)) > _CROWDED:
        return None
    near_s = _first_near(commands, [row, *twins], upset_s)
    if near_s is None or not _is_that_side(arms_deg.get(number), fall):
        return None
    named = tuple(commands.numbers[n] for n in alike)
    return Hardest(number, named, float(asked[row]), float(median(others)), near_s)


class Weakened(Record):
    """A motor that came to be driven harder than all others, in level flight."""

    number: int
    since_s: float
    until_s: float
    share: float
    others: float


def weakened(commands: Commands, flown: Bools) -> Weakened | None:
    """The motor that was even with the others and then, alone and to the end, was driven harder.

    Args:
        flown: the records in the air, before control was lost.
    """
    t, share = commands.t[flown], commands.share[:, flown]
    width = int(_WINDOW_S * len(t) / (t[-1] - t[0])) if len(t) > 2 and t[-1] > t[0] else 0
    if width < 3 or len(t) < 4 * width or len(share) < 4:
        return None
    rows = np.arange(len(share))
    excess = np.array([_mean(share[n] - median(share[rows != n], axis=0), width) for n in rows])
    at = t[width - 1 :]
    order = np.sort(excess, axis=0)
    alone = (order[-1] > _ALONE) & (order[-2] < _NEXT * order[-1])
    row = int(np.bincount(np.argmax(excess, axis=0)[alone]).argmax()) if alone.any() else 0
    mine = alone & (np.argmax(excess, axis=0) == row)
    first = int(np.argmax(mine))
    before = excess[row][at < at[first] - _WINDOW_S]
    after = excess[row][first:]
    if not mine.any() or mine[first:].mean() < _STAYS or at[-1] - at[first] < _WINDOW_S / 2:
        return None
    if 2 * len(before) >= width:
        came = float(np.max(before)) < _BEFORE * float(median(after))
    else:
        came = _others_are_even(share[:, t >= at[first] - _WINDOW_S / 2], row)
    if not came:
        return None
    since_s = float(at[first] - _WINDOW_S / 2)
    late = t >= since_s + _WINDOW_S / 2
    asked = median(share[:, late], axis=1)
    return Weakened(
        commands.numbers[row], since_s, float(t[-1]), float(asked[row]), float(median(np.delete(asked, row)))
    )


def _others_are_even(share: Floats, row: int) -> bool:
    """Whether one motor is driven far harder and the others alike, as where it gives too little: a load that sits
    towards it would have the one across driven less."""
    asked = median(share, axis=1)
    others = np.delete(asked, row)
    excess = float(asked[row] - median(others))
    return excess > _FAR and float(np.ptp(others)) < _EVEN * excess


def _mean(values: Floats, width: int) -> Floats:
    """Running means of so many records, each of the last ones."""
    sums = np.concatenate(([0.0], np.cumsum(values)))
    return np.asarray((sums[width:] - sums[:-width]) / width)


def _share_an_arm(arms_deg: Mapping[int, float], one: int, other: int) -> bool:
    return one in arms_deg and other in arms_deg and abs((arms_deg[one] - arms_deg[other] + 180) % 360 - 180) < _ARM_DEG


def _last_rows(t: Floats, upset_s: float) -> Bools:
    """The records just before an upset; of a slow log the nearest one."""
    window = (t >= upset_s - _BEFORE_S) & (t <= upset_s + _EXACT_S)
    if not window.any():
        window[np.argmin(np.abs(t - upset_s))] = bool(np.min(np.abs(t - upset_s)) < _SLOW_S)
    return window


def _first_near(commands: Commands, rows: list[int], upset_s: float) -> float | None:
    """When the first of these motors came near its limit, None where it did not, or any other did as soon."""
    around = np.abs(commands.t - upset_s) <= _SOON_S
    near = commands.share[:, around] > _NEAR_LIMIT
    some = np.flatnonzero(near.any(axis=0))
    if not len(some) or not set(np.flatnonzero(near[:, some[0]]).tolist()) <= set(rows):
        return None
    return float(commands.t[around][some[0]])


def _is_that_side(arm_deg: float | None, fall: tuple[float, float]) -> bool:
    length = float(np.hypot(*fall))
    if arm_deg is None or not length:
        return True
    angle = np.radians(arm_deg)
    return float(np.cos(angle) * fall[0] + np.sin(angle) * fall[1]) / length > _TOWARDS
