"""Whether what a log says can be: before anything is computed from a source it is alive, and its values are possible.

DataFlash records carry no checksum, so a flipped bit is read as a flight to the moon: rows that say the impossible are
left out. A sensor that says the same throughout measures nothing, and a clock that stands still or runs a thousand
times too fast turns a failed flight into one of 0 s and 0 Wh. What is merely bad stays.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from care_core.ecosystems.dictionary import Dictionary, Message, find_message, instance_field
from care_core.logs.base import Table
from care_core.logs.clock import PACE
from care_core.numbers import Bools, Floats, distinct, median
from care_core.text import log_time

STAMP = "header.stamp"
"""The time at which a ROS robot made a message, by its own clock."""

ANY_FASTEST_HZ = 2_000.0
"""Of a message without an entry: robots publish odometry and lasers at up to some 100 Hz, joints at 1 kHz."""
_GPS_STEP_S = 60.0
"""A longer step of the satellites' time is of a new week, or of a receiver that found it."""
_SET_S = 5.0
"""A step of a clock by less costs no mission its time; most recorders stall for less."""
APART, _STAMPED_S, _QUARTERS, _MOSTLY = 1.25, 10.0, 4, 0.9
"""By what factor stamps that a robot makes may run from the recording's clock, over so many seconds. A real clock is
right to 0.01%; one that was set is off in one quarter of the time, one that runs wrong in each."""
_SIMULATED_S = 1e9
"""A simulation's time begins at 0: stamps so far behind the recording's have a pace of their own."""
_PLACE, _AT_ZERO_DEG, _ELSEWHERE_DEG = ("Lat", "Lng"), 1e-6, 0.1
_ANY = Message({})
_ENOUGH = 20
"""Samples that must agree before a source is called dead or a clock wrong."""


def sound(dictionary: Dictionary, name: str, table: Table) -> Table | None:
    """A table without the rows in which a field is beyond its range, steps back in time, or leaps away for one sample;
    None where its source is dead."""
    known = find_message(dictionary, name)
    if known is None:
        return table
    return None if _is_dead(known, table) else _cleaned(known, table)


def dead_sources(dictionary: Dictionary, tables: Mapping[str, Table]) -> dict[str, str]:
    """Tables of something that moves, but whose values never change, each with the reason in words."""
    return {
        name: f"{name} says the same throughout the log, so it measures nothing"
        for name, known in dictionary.items()
        if name in tables and _is_dead(known, tables[name])
    }


def _is_dead(known: Message, table: Table) -> bool:
    are_recorded = known.moving and len(table) >= _ENOUGH and set(known.moving) <= table.columns.keys()
    return bool(are_recorded) and not any(is_alive(table[field]) for field in known.moving)


def is_alive(values: Floats) -> bool:
    """Whether samples of a sensor, shape (n,), are numbers that differ; a few may be equal by chance."""
    known = values[np.isfinite(values)]
    return len(known) > 0 and (len(known) < _ENOUGH or bool(np.ptp(known) > 0))


def clock_doubt(dictionary: Dictionary, tables: Mapping[str, Table], start_s: float, end_s: float) -> str:
    """Why the times of a mission cannot be right, in words; empty where they can.

    Time must go on, and no sensor may say more, or less, in a second than any does.
    """
    if not end_s > start_s:
        return "the log's clock does not advance during the mission"
    for name, table in tables.items():
        known = dictionary.get(name, _ANY)
        inside = table.t[(table.t >= start_s) & (table.t <= end_s)]
        if len(inside) < _ENOUGH or known.in_bursts:
            continue
        sensors = len(_instances(known, table)) if known.fastest_hz else 1
        rate_hz = (len(inside) - 1) / max(float(inside[-1] - inside[0]), 1e-9) / sensors
        if rate_hz > (known.fastest_hz or ANY_FASTEST_HZ):
            return f"the log's clock is too slow or stands still: it has {name} {rate_hz:.3g} times a second"
        if known.slowest_s and 1 / rate_hz > known.slowest_s:
            return f"the log's clock is too fast: it has {name} only every {1 / rate_hz:.3g} s"
        stands = _longest_stand(inside) if known.moving else 0
        if stands >= _ENOUGH:
            return f"the log's clock stands still: {stands} {name} messages in a row have the same time"
    if why := _was_set(dictionary, tables, start_s, end_s):
        return why
    pace = _satellites_pace(dictionary, tables.get("GPS"), start_s, end_s)
    if not 1 / PACE < pace < PACE:
        return f"the log's clock goes wrong: by the satellites' time {pace:.3g} s pass in each of its seconds"
    return _stamps_doubt(tables, start_s, end_s)


def _satellites_pace(dictionary: Dictionary, gps: Table | None, start_s: float, end_s: float) -> float:
    """Seconds by the satellites' time (`GMS`, ms of the week) in one of the log's; 1 where nothing tells."""
    said, true = _satellites(dictionary, gps, start_s, end_s)
    fresh = np.append(True, np.diff(true) != 0) if len(true) else np.empty(0, dtype=bool)
    # A receiver without a fix may repeat its time, and has caught up with the next that is another.
    true_s, said_s = np.diff(true[fresh]), np.diff(said[fresh])
    steady = (true_s > 0) & (true_s < _GPS_STEP_S)  # a new week, a receiver that found the time
    if steady.sum() < _ENOUGH or said_s[steady].sum() <= 0:
        return 1.0
    return float(true_s[steady].sum() / said_s[steady].sum())


def _satellites(dictionary: Dictionary, gps: Table | None, start_s: float, end_s: float) -> tuple[Floats, Floats]:
    """The log's time and the satellites' time of the first receiver, in s, both of shape (n,)."""
    if gps is None or "GMS" not in gps.columns:
        return np.empty(0), np.empty(0)
    inside = gps.between(start_s, end_s)
    first = inside.where(_instances(dictionary.get("GPS", _ANY), inside)[0]) if len(inside) else inside
    timed = first.where(first["GMS"] > 0)
    return timed.t, timed["GMS"] / 1e3


def _was_set(dictionary: Dictionary, tables: Mapping[str, Table], start_s: float, end_s: float) -> str:
    """Where the log's clock was set forward under way, as all that have their own say; "" where it was not."""
    stamped = (table.between(start_s, end_s) for table in tables.values() if STAMP in table.columns)
    clocks = [(one.t, one[STAMP]) for one in stamped if not is_simulated(one.t, one[STAMP])]
    steps = [
        set_forward(said, own)
        for said, own in (_satellites(dictionary, tables.get("GPS"), start_s, end_s), *clocks)
        if len(said) >= 2 * _ENOUGH
    ]
    if not steps or None in steps:
        return ""
    at_s, by_s = min(one for one in steps if one is not None)
    return f"the log's clock was set forward by {by_s:.0f} s at {log_time(at_s)}, so no time across that is known"


def set_forward(said: Floats, own: Floats) -> tuple[float, float] | None:
    """When a clock, `said`, was set forward and by how much, as another, `own`, tells; both of shape (n,), in s.

    What was held up on its way comes late as well, but not all that follows it.
    """
    known = np.isfinite(said) & np.isfinite(own)
    said, own = said[known], own[known]
    went, passed = np.diff(said), np.diff(own)
    for row in np.flatnonzero((went > _SET_S) & (passed >= 0) & (went - passed > _SET_S)).tolist():
        before, after = (said - own)[max(row + 1 - _ENOUGH, 0) : row + 1], (said - own)[row + 1 :]
        if min(len(before), len(after)) >= _ENOUGH and (by_s := float(after.min() - median(before))) > _SET_S:
            return float(said[row]), by_s
    return None


def _stamps_doubt(tables: Mapping[str, Table], start_s: float, end_s: float) -> str:
    """Whether all stamps of a robot's messages say that the recording's clock runs wrong."""
    paces = {}
    for name, table in tables.items():
        if STAMP in table.columns:
            inside = table.between(start_s, end_s)
            if not is_simulated(inside.t, inside[STAMP]) and (pace := stamps_pace(inside.t, inside[STAMP])) is not None:
                paces[name] = pace
    if not paces or any(1 / APART <= pace <= APART for pace in paces.values()):
        return ""
    pace = float(median(list(paces.values())))
    names = " and ".join(sorted(paces))
    return f"the log's clock or the robot's is wrong: by the stamps of {names} {pace:.3g} s pass in each of its seconds"


def is_simulated(t: Floats, stamp: Floats) -> bool:
    """Whether messages recorded at `t` were stamped, `stamp`, by the clock of a simulation, both of shape (n,) in s."""
    behind = t - stamp
    known = behind[np.isfinite(behind)]
    return len(known) > 0 and float(median(known)) > _SIMULATED_S


def stamps_pace(t: Floats, stamp: Floats) -> float | None:
    """Seconds of stamps, shape (n,), in one of the recording, whose times are `t`; None where nothing tells."""
    told = np.isfinite(stamp)
    stamp, t = stamp[told], t[told]
    if len(t) < _ENOUGH or t[-1] - t[0] < _STAMPED_S or np.mean(np.diff(stamp) > 0) < _MOSTLY:
        return None
    edges = np.searchsorted(t, np.linspace(t[0], t[-1], _QUARTERS + 1)).clip(0, len(t) - 1)
    took, passed = np.diff(stamp[edges]), np.diff(t[edges])
    is_slow, is_fast = np.all((took > 0) & (took < passed / APART)), np.all((passed > 0) & (took > passed * APART))
    return float((stamp[-1] - stamp[0]) / (t[-1] - t[0])) if is_slow or is_fast else 1.0


def _longest_stand(t: Floats) -> int:
    """The most samples in a row with one time."""
    changes = np.flatnonzero(np.diff(t) != 0)
    return int(np.diff(np.concatenate(([-1], changes, [len(t) - 1]))).max())


def _cleaned(known: Message, table: Table) -> Table:
    ranges = {name: field.plausible for name, field in known.fields.items() if field.plausible is not None}
    keep = np.ones(len(table), dtype=bool)
    if ranges and (np.diff(table.t) < 0).any():
        keep = table.t >= np.maximum.accumulate(table.t)
    for field, (low, high) in ranges.items():
        if field in table.columns:
            column = table[field]
            keep &= np.isnan(column) | ((column >= low) & (column <= high))
    keep &= ~_nowhere(known, table)
    if not keep.all():
        table = table.where(keep)
    steps = {name: field.step for name, field in known.fields.items() if field.step is not None}
    keep = np.ones(len(table), dtype=bool)
    for rows in _instances(known, table) if steps else ():
        for field, step in steps.items():
            if field in table.columns:
                keep[rows] &= ~_leaps(table[field][rows], step)
    return table if keep.all() else table.where(keep)


def _nowhere(known: Message, table: Table) -> Bools:
    """Rows at 0 degrees north and 0 east, of a track that is elsewhere: an estimator without a position says that."""
    if not set(_PLACE) <= set(known.moving) & table.columns.keys():
        return np.zeros(len(table), dtype=bool)
    off = np.abs(table["Lat"]) + np.abs(table["Lng"])
    known_off = off[off > _AT_ZERO_DEG]
    return np.asarray((off <= _AT_ZERO_DEG) & (len(known_off) > 0 and float(median(known_off)) > _ELSEWHERE_DEG))


def _instances(known: Message, table: Table) -> list[Bools]:
    """The rows of each sensor: samples of two batteries alternate without leaping."""
    name = instance_field(known, table.columns)
    if name is None:
        return [np.ones(len(table), dtype=bool)]
    return [np.asarray(table[name] == number) for number in distinct(table[name])]


def _leaps(column: Floats, step: float) -> Bools:
    """Samples that lie further than `step` from both neighbours, which lie close to each other."""
    leaps = np.zeros(len(column), dtype=bool)
    if len(column) > 2:
        before, here, after = column[:-2], column[1:-1], column[2:]
        leaps[1:-1] = (
            (np.abs(here - before) > step) & (np.abs(here - after) > step) & (np.abs(after - before) <= step / 2)
        )
    return leaps
