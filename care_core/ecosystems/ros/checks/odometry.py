"""Odometry and localisation: jumps, drift of the position against its own speed, dropouts, corrections of the map."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sized
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from care_core.ecosystems.findings import Finding
from care_core.ecosystems.ros import plan
from care_core.ecosystems.ros.recording import STREAM_MESSAGES, Floats, Odometry, Recording
from care_core.logs.base import Table
from care_core.logs.plausible import STAMP, never_moved
from care_core.numbers import median, quantile

JUMP_M = 0.3
"""A position that steps further than speed and time allow. The largest such step of 301 healthy missions: 0.07 m."""
DRIFTS = ((1.5, 0.08), (4.0, 0.04))
"""Over so many metres the share by which the position advances further than the speed says. Of 301 healthy missions
97.5 % stay below 0.043 and 0.018, all below 0.075 and 0.03."""
SHRINK = 0.35
"""The share by which it advances less far: thin sampling alone gives up to 0.33."""
AGREED_M = 0.7
"""For so many metres position and speed must have agreed before they are said to disagree."""
CORRECTION_M = 0.5
"""A step of map -> odom: amcl's corrections are below update_min_d (0.2 m) times its error, far less than this."""
_PAUSE_S = 0.6
"""Over a longer pause the speed in between is not known."""


def check(recording: Recording) -> Iterator[Finding]:
    odometry = recording.odometry
    yield from _dead(recording)
    if odometry is not None and odometry.tells_speed and not odometry.stands_still:
        yield from _jumps(recording, odometry)
        yield from _drift(recording, odometry)
    yield from _corrections(recording)


def _dead(recording: Recording) -> Iterator[Finding]:
    """Odometry that cannot be: no numbers, no movement while goals were reached, no time."""
    tables = dict(recording.of(plan.ODOMETRY))
    if recording.odometry is None:
        rows = {topic: len(table) for topic, table in tables.items() if len(table) >= STREAM_MESSAGES}
        if rows and all(_is_nothing(tables[topic]) for topic in rows):
            topic = min(rows)
            yield _unusable(recording, topic, "odometry says no numbers", f"{rows[topic]} messages without a position")
        return
    odometry = recording.odometry
    path_m = float(np.sum(np.hypot(np.diff(odometry.x), np.diff(odometry.y))))
    way_m = _way_of_goals(recording)
    if odometry.stands_still:
        yield _unusable(
            recording, odometry.topic, "odometry tells no position",
            f"the same in all {len(odometry.t)} messages, while its own speed makes {odometry.way_m:.1f} m",
        )  # fmt: skip
    elif never_moved(path_m, len(odometry.t), way_m):
        yield _unusable(
            recording, odometry.topic, "odometry never moved, but goals were reached",
            f"{path_m:.2g} m in {len(odometry.t)} messages, goals and commands over {way_m:.1f} m",
        )  # fmt: skip
    stamp = np.asarray(tables[odometry.topic][STAMP], np.float64)
    known = stamp[np.isfinite(stamp)]
    if len(stamp) >= STREAM_MESSAGES and (not len(known) or (len(known) == len(stamp) and np.ptp(known) == 0)):
        yield _unusable(
            recording, odometry.topic, "odometry carries no time",
            f"its {len(stamp)} stamps {'are the same' if len(known) else 'were never set'}; transforms need them",
        )  # fmt: skip


def _is_nothing(table: Table) -> bool:
    columns = [table[name] for name in plan.FIELDS[plan.ODOMETRY][1:3] if name in table.columns]
    return len(columns) == 2 and not np.isfinite(np.hypot(*columns)).any()


def _unusable(recording: Recording, topic: str, title: str, evidence: str) -> Finding:
    return Finding(
        "localisation", title, 0.0, recording.duration_s, "warning", evidence, topic, probability=0.9
    )  # fmt: skip


def _way_of_goals(recording: Recording) -> float:
    """How far the robot must have gone, m: from reached goal to reached goal, or as it was commanded on the way to
    them."""
    reached = [goal for goal in recording.goals if goal.outcome == "reached"]
    apart = [math.dist((a.x, a.y), (b.x, b.y)) for a, b in pairwise(reached)]
    way_m = sum(one for one in apart if math.isfinite(one))
    if recording.commands is None:
        return way_m
    t = recording.commands.t
    ordered = np.hypot(recording.commands.speed, recording.commands.sideways)
    ordered = ordered * np.minimum(np.diff(t, append=t[-1:]), _PAUSE_S)
    return max(way_m, sum(float(ordered[(t >= one.sent_s) & (t <= one.end_s)].sum()) for one in reached))


def _steps(odometry: Odometry) -> tuple[Floats, Floats, Floats]:
    """Per sample how far the position went since the one before, and the least and most that the speeds allow, m."""
    went = np.hypot(np.diff(odometry.x, prepend=odometry.x[:1]), np.diff(odometry.y, prepend=odometry.y[:1]))
    speed = np.hypot(odometry.speed, odometry.sideways)
    before = np.concatenate([speed[:1], speed[:-1]])
    return went, np.minimum(speed, before) * odometry.dt, np.maximum(speed, before) * odometry.dt


def _jumps(recording: Recording, odometry: Odometry) -> Iterator[Finding]:
    went, _, most = _steps(odometry)
    top = quantile(np.hypot(odometry.speed, odometry.sideways), 0.99)
    excess = went - np.maximum(most, np.where(odometry.dt > _PAUSE_S, top * odometry.dt, 0.0))
    rows = np.flatnonzero(excess > JUMP_M)
    if not len(rows):
        return
    at, far = float(odometry.t[rows[0]]), float(went[rows[0]])
    more = f"; {len(rows)} such jumps" if len(rows) > 1 else ""
    yield Finding(
        "localisation", f"odometry jumps by {far:.1f} m", at, float(odometry.t[rows[-1]]), recording.severity(at),
        f"{far:.2f} m within {odometry.dt[rows[0]]:.2f} s, its speed explains {most[rows[0]]:.2f} m{more}",
        f"{odometry.topic}: position against its own speed", probability=0.9,
    )  # fmt: skip


def _drift(recording: Recording, odometry: Odometry) -> Iterator[Finding]:
    """The position agreed with the speed, and from some moment on it does not.

    One that never did is how that odometry is made: wheels of another size, a twist that is filtered.
    """
    went, least, most = _steps(odometry)
    beyond = np.where(went > most, went - most, np.where(went < least, went - least, 0.0))
    usable = (odometry.dt < _PAUSE_S) & (np.abs(beyond) < JUMP_M)
    extra = np.cumsum(np.where(usable, beyond, 0.0))
    way = np.cumsum(np.where(usable, (least + most) / 2, 0.0))
    for over_m, most_share in DRIFTS:
        first = np.searchsorted(way, way - over_m)
        length = way - way[first]
        share = np.divide(extra - extra[first], length, out=np.zeros(len(way)), where=length > 0.8 * over_m)
        rows = np.flatnonzero((share > most_share) | (share < -SHRINK))
        if len(rows):
            yield from _drifting(recording, odometry, extra, way, share, rows, most_share)
            return


def _drifting(
    recording: Recording,
    odometry: Odometry,
    extra: Floats,
    way: Floats,
    share: Floats,
    rows: NDArray[np.intp],
    most_share: float,
) -> Iterator[Finding]:
    """The drift that some rows show, if position and speed agreed before it and disagree to the end."""
    typical = float(median(share[rows]))
    bend = _bend(extra, way, typical, rows[0])
    agreed = way[bend] >= AGREED_M and abs(extra[bend]) < most_share / 2 * way[bend]
    later = extra[-1] - extra[bend]
    if not agreed or abs(later) < abs(typical) / 2 * (way[-1] - way[bend]):
        return
    start = float(odometry.t[bend])
    word = "further" if typical > 0 else "less far"
    yield Finding(
        "localisation", "odometry drifts: its position and its speed disagree", start, float(odometry.t[rows[-1]]),
        recording.severity(start),
        f"the position advances {abs(typical):.0%} {word} than the speed says, and agreed before",
        f"{odometry.topic}: position against its own speed; healthy move_base missions stay below 4 %", probability=0.9,
    )  # fmt: skip


def _bend(extra: Floats, way: Floats, slope: float, before: int) -> int:
    """The row at which the excess begins to grow with the way: where it lies lowest under half its slope."""
    under = ((extra - slope / 2 * way) * np.sign(slope))[: before + 1]
    return int(np.flatnonzero(under <= under.min() + 1e-3)[0])


def _corrections(recording: Recording) -> Iterator[Finding]:
    """Steps of map -> odom in tf: the localisation found itself elsewhere."""
    for topic, table in recording.of(*plan.TF):
        if not set(plan.FIELDS[plan.TF[0]]) <= set(table.columns):
            continue
        places = _map_to_odom(table.t, *(table[name] for name in plan.FIELDS[plan.TF[0]]))
        if len(places) < 3:
            continue
        t, x, y = places.T
        steps = np.hypot(np.diff(x), np.diff(y))
        rows = np.flatnonzero(steps > CORRECTION_M)
        # The first corrections find the robot on the map, from wherever it was said to be.
        rows = rows[t[rows + 1] > t[0] + 5.0]
        if len(rows):
            at, far, most = float(t[rows[0] + 1]), float(steps[rows[0]]), float(steps[rows].max())
            more = f", {len(rows)} such steps of up to {most:.2f} m" if len(rows) > 1 else ""
            yield Finding(
                "localisation", f"localisation jumps by {'up to ' * (most > far)}{most:.1f} m", at,
                float(t[rows[-1] + 1]), recording.severity(at), f"map -> odom steps by {far:.2f} m{more}", topic,
                probability=0.7,
            )  # fmt: skip
            return


def _map_to_odom(t: Floats, *columns: NDArray[Any]) -> Floats:
    """Time, x and y of each map -> odom transform, shape (n, 3). The log itself says of what type its fields are: names
    that are no text name nothing."""
    rows = []
    for time_s, *fields in zip(t.tolist(), *columns, strict=True):
        if not all(isinstance(field, Sized) for field in fields):
            continue
        for parent, child, x, y in zip(*fields, strict=False):
            if str(parent).strip("/") == "map" and str(child).strip("/").endswith("odom") and _is_number(x, y):
                rows.append((time_s, x, y))
    return np.array(rows, np.float64).reshape(-1, 3)


def _is_number(*values: object) -> bool:
    return all(isinstance(value, (int, float, np.number)) for value in values)
