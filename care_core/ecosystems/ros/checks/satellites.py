"""Positions of satellite receivers: none at all, lost for a while, or leaping."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.ros.drive import STREAM_MESSAGES, Drive
from care_core.ecosystems.ros.messages import FIX, GOALS, holds, reading
from care_core.ecosystems.spans import stretches
from care_core.geodesy import offset_m
from care_core.logs.base import Table
from care_core.numbers import Bools, Floats, median
from care_core.records import replace

LIMITS = Limits()
LOST_S = LIMITS.add("time without a position", 5.0, "s", "wheels and gyro bridge less: a metre or two")
JUMP_M = LIMITS.add("step beyond the way it went", 10.0, "m", "a receiver without corrections wanders by 2 to 5 m")
STEP_S = LIMITS.add("time between positions that are compared", 1.5, "s", "over longer ones a car may have turned")
LIKE = int(LIMITS.add("steps that tell how it went", 5, "", "a choice: five seconds of a slow receiver"))
SETTLES_S = LIMITS.add("time until a receiver has settled", 10.0, "s", "its first positions are of few satellites")
_NO_FIX = 0
"""NavSatStatus: below it there is no position."""


def find(drive: Drive) -> Iterator[Finding]:
    """What a receiver says of itself, and positions that nothing can have gone."""
    for topic, table in drive.of(FIX):
        if not holds(table, FIX) or len(table) < STREAM_MESSAGES:
            continue
        known = _known(table)
        if not known.any():  # not connected, or indoors: that is told, and leads nowhere
            none = _finding(drive, topic, "the satellite receiver has no position", (0.0, drive.duration_s), "")
            yield replace(none, severity="info", evidence=f"none of {len(table)} messages has one")
            continue
        yield from _lost(drive, topic, table, known)
        yield from _leaps(drive, topic, table, known)


def _known(table: Table) -> Bools:
    status, latitude, longitude = (np.asarray(table[name], np.float64) for name in ("status.status", *_PLACE))
    is_somewhere = (np.abs(latitude) <= 90.0) & (np.abs(longitude) <= 180.0) & ((latitude != 0.0) | (longitude != 0.0))
    return np.asarray((status >= _NO_FIX) & is_somewhere)


_PLACE = ("latitude", "longitude")


def _lost(drive: Drive, topic: str, table: Table, known: Bools) -> Iterator[Finding]:
    """Positions that it had before, gone for a while."""
    had = int(np.argmax(known))
    usual_s = float(median(np.diff(table.t)))
    gone = [span for span in stretches(table.t[had:], ~known[had:], 2 * usual_s) if span[1] - span[0] >= LOST_S]
    if gone:
        longest = max(end - start for start, end in gone)
        more = f", {len(gone)} times" if len(gone) > 1 else ""
        evidence = f"for {longest:.0f} s{more}"
        yield _finding(drive, topic, "the satellite receiver loses its position", (gone[0][0], gone[-1][1]), evidence)


def _leaps(drive: Drive, topic: str, table: Table, known: Bools) -> Iterator[Finding]:
    """Steps to where it did not go by the steps before."""
    t = table.t[known]
    latitude, longitude = (np.asarray(table[name], np.float64)[known] for name in _PLACE)
    if len(t) < LIKE + 2:
        return
    north, east = offset_m((latitude[0], longitude[0]), latitude, longitude)
    off = _beyond(t, east, north)
    rows = np.flatnonzero((off > JUMP_M) & (t > t[0] + SETTLES_S))
    if len(rows):
        more = f", {len(rows)} such steps" if len(rows) > 1 else ""
        evidence = f"a step of {off[rows[0]]:.0f} m beyond the way before{more}"
        title = f"satellite positions leap by {'up to ' * (len(rows) > 1)}{off[rows].max():.0f} m"
        yield _finding(drive, topic, title, (float(t[rows[0]]), float(t[rows[-1]])), evidence)


def _beyond(t: Floats, east: Floats, north: Floats) -> Floats:
    """Per position how far it is from where the steps before lead, m; 0 where a pause lies before it, or too few."""
    steps = np.diff(t)
    found = np.zeros(len(t))
    with np.errstate(divide="ignore", invalid="ignore"):
        speeds = np.stack([np.diff(east), np.diff(north)]) / steps
    for row in range(LIKE, len(steps)):
        before = speeds[:, row - LIKE : row]
        if not 0 < steps[row] <= STEP_S or not np.isfinite(before).all():
            continue
        way = np.median(before, axis=1) * steps[row]
        found[row + 1] = float(np.hypot(east[row + 1] - east[row] - way[0], north[row + 1] - north[row] - way[1]))
    return found


def _finding(drive: Drive, topic: str, title: str, span: tuple[float, float], evidence: str) -> Finding:
    return Finding(
        kind="gps",
        title=title,
        onset_s=span[0],
        end_s=span[1],
        severity=drive.severity(span[0]),
        evidence=evidence,
        source=topic,
        probability=0.7,
    )


CHECK = Check("satellites", "receivers without a position, that lose it or leap", reading(FIX, *GOALS), LIMITS, find)
