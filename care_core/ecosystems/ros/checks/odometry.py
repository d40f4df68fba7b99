"""Odometry and localisation: jumps, drift of the position against its own speed, dropouts, corrections of the map."""

from __future__ import annotations

from collections.abc import Iterator, Sized
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.plausible import STAMP
from care_core.ecosystems.ros.checks.drive import standstills
from care_core.ecosystems.ros.drive import STREAM_MESSAGES, Drive, way_through
from care_core.ecosystems.ros.messages import COMMANDS, GOALS, ODOMETRY, PLACED, TF, holds, reading
from care_core.ecosystems.ros.motion import IN_TURN_M as TURN_M
from care_core.ecosystems.ros.motion import STALE_S, Odometry, never_moved
from care_core.ecosystems.spans import Span, inside
from care_core.logs.base import Table
from care_core.numbers import Floats, median, quantile

LIMITS = Limits()
_HEALTHY = "301 healthy move_base missions"
_DRIFT = f"{_HEALTHY}: 97.5% stay below"
_WAY = "a drift shows over more than the noise of a step, or sooner where it is strong"
_SPIKES = "drivers that repeat a pose make up to 8 times the speed, 3 m/s, of the step that follows"
BEYOND = LIMITS.add("speed against the most that positions give", 10.0, "", _SPIKES)
JUMPS_MPS = LIMITS.add("speed beyond that", 3.0, "m/s", _SPIKES)
JUMPS_RADPS = LIMITS.add("turn beyond that", 8.0, "rad/s", "a choice: of a robot that turns by 1 rad/s")
_SINGLE = LIMITS.add("such messages that are only noted", 3, "", "a choice: a wheel that slips once misleads nothing")
_SINGLE_SHARE = LIMITS.add("and as a share of all", 0.01, "", "the same")
BUNCHED = LIMITS.add("step of stamps in a bunch, of the usual one", 0.05, "", "what is divided by it grows as much")
JUMP_M = LIMITS.add("step beyond what speed and time allow", 0.3, "m", f"{_HEALTHY}: at most 0.07 m")
JUMP_AT_REST_M = LIMITS.add("the same of a robot that stands", 0.15, "m", f"{_HEALTHY}: at most 0.07 m of any")
DRIFTS = (
    (
        LIMITS.add("short way of a drift", 1.5, "m", _WAY),
        LIMITS.add("drift over a short way", 0.08, "", f"{_DRIFT} 0.043, all below 0.075"),
    ),
    (
        LIMITS.add("long way of a drift", 4.0, "m", _WAY),
        LIMITS.add("drift over a long way", 0.04, "", f"{_DRIFT} 0.018, all below 0.03"),
    ),
)
"""Over so many metres the share by which the position advances further than the speed says."""
SHRINK = LIMITS.add("share by which it advances less far", 0.35, "", "thin sampling alone gives up to 0.33")
COVERED = LIMITS.add("share of the way that is compared", 0.8, "", "over less, noise is more than drift")
AGREED_M = LIMITS.add("way on which position and speed agreed", 0.7, "m", "else that odometry is made so")
CORRECTION_M = LIMITS.add("step of map -> odom", 0.5, "m", "amcl corrects below update_min_d (0.2 m) times its error")
IN_TURN_M = LIMITS.add("step of map -> odom there and back", 0.05, "m", "a localisation does not correct itself back")
IN_TURN = LIMITS.add(
    "share of the steps that are such", 0.25, "", "two sources of unlike rates send half or fewer in turn"
)
BACK = LIMITS.add("how near it is to where it was, in steps", 0.3, "", "while the robot moves, both change a little")
LIMITS.add("step of odometry there and back", TURN_M, "m", "noise at rest is a tenth of it")
OFTEN = LIMITS.add("steps of odom -> base there and back", 10, "", "odometry that leaps once or twice is of one source")
THROUGHOUT = LIMITS.add("share of the recording that they span", 0.5, "", "a choice: two sources run side by side")
PLACES = LIMITS.add("transforms of map -> odom", 3, "", "fewer show no step")
FOUND_S = LIMITS.add("time to find the robot on the map", 5.0, "s", "the first corrections are large")
PUSHED_S = LIMITS.add("time after a contact that is not compared", 10.0, "s", "a choice: it pushes, or backs off")
HELD_S = LIMITS.add("time that it stands against commands", 1.0, "s", "odometry that repeats itself stands for less")
ASIDE = LIMITS.add(
    "probability that a twist in the other frame costs the mission", 0.1, "", "a choice: few drive by it"
)
BEFORE_S = LIMITS.add("time before it that is not either", 1.0, "s", "a choice: who tells of it is late")
PAUSE_S = LIMITS.add("pause between samples", STALE_S, "s", "over a longer one the speed is not known")


def find(drive: Drive) -> Iterator[Finding]:
    """Odometry that cannot be, that jumps, drifts or comes from two publishers, and a localisation that jumps."""
    odometry = drive.odometry
    yield from _unusable(drive)
    if odometry is not None and odometry.is_of_parent:
        yield _of_parent(drive, odometry)
    if odometry is not None and not odometry.stands_still:
        yield from _impossible(drive, odometry)
    if odometry is not None and len(odometry.in_turn):
        yield _two_publishers(drive, odometry)
    elif odometry is not None and odometry.tells_speed and not odometry.stands_still:
        yield from _jumps(drive, odometry)
        yield from _drift(drive, odometry)
    yield from _corrections(drive)


def _of_parent(drive: Drive, odometry: Odometry) -> Finding:
    """A twist along the axes of the map: what drives by it believes that the robot slides sideways, and slows down."""
    return Finding(
        kind="localisation",
        title="odometry tells its speed in the frame of its position, not in the robot's",
        onset_s=0.0,
        end_s=drive.duration_s,
        severity="warning",
        evidence=(
            "its twist along x and y is what its position does along x and y, whichever way the robot looks; "
            "nav_msgs/Odometry has it in child_frame_id"
        ),
        source=odometry.topic,
        suspect="parameter",
        probability=0.9,
        mission_lost=ASIDE,
    )


def _unusable(drive: Drive) -> Iterator[Finding]:
    """Odometry that cannot be: no numbers, no movement while goals were reached, no time."""
    for topic, title, evidence in _doubts(drive):
        yield Finding(
            kind="localisation",
            title=title,
            onset_s=0.0,
            end_s=drive.duration_s,
            severity="warning",
            evidence=evidence,
            source=topic,
            probability=0.9,
        )


def _doubts(drive: Drive) -> Iterator[tuple[str, str, str]]:
    """Topic, title and evidence of each."""
    tables = dict(drive.of(ODOMETRY))
    odometry = drive.odometry
    if odometry is None:
        rows = {topic: len(table) for topic, table in tables.items() if len(table) >= STREAM_MESSAGES}
        if rows and all(_is_nothing(tables[topic]) for topic in rows):
            topic = min(rows)
            yield topic, "odometry has no numbers", f"{rows[topic]} messages without a position"
        return
    topic, count, path_m = odometry.topic, len(odometry.t), odometry.path_m()
    way_m = way_through(drive.goals, drive.commands)
    if odometry.stands_still:
        evidence = f"the same in all {count} messages, while its own speed makes {odometry.way_by_speed_m:.1f} m"
        yield topic, "odometry has no position", evidence
    elif never_moved(path_m, count, way_m):
        evidence = f"{path_m:.2g} m in {count} messages, goals and commands over {way_m:.1f} m"
        yield topic, "odometry never moved, but goals were reached", evidence
    stamp = np.asarray(tables[topic].columns.get(STAMP, ()), np.float64)
    known = stamp[np.isfinite(stamp)]
    if len(stamp) >= STREAM_MESSAGES and (not len(known) or (len(known) == len(stamp) and np.ptp(known) == 0)):
        stamps = "are the same" if len(known) else "were never set"
        yield topic, "odometry has no time stamps", f"its {len(stamp)} stamps {stamps}; transforms need them"


def _impossible(drive: Drive, odometry: Odometry) -> Iterator[Finding]:
    """Speeds that are many times what its positions ever give over a second."""
    table = dict(drive.of(ODOMETRY))[odometry.topic]
    names = [f"twist.twist.{name}" for name in ("linear.x", "linear.y", "angular.z")]
    forward, aside, turn = (np.asarray(table[name], np.float64) for name in names)
    with np.errstate(over="ignore", invalid="ignore"):
        told = ((np.hypot(forward, aside), JUMPS_MPS, "m/s"), (np.abs(turn), JUMPS_RADPS, "rad/s"))
        most = odometry.most_by_position
        rolls = ~inside(_pushed(drive), table.t)
        bad = [
            rolls & (speeds > np.maximum(BEYOND * known, known + extra))
            for (speeds, extra, _), known in zip(told, most, strict=True)
        ]
    rows = np.flatnonzero(bad[0] | bad[1])
    if not len(rows):
        return
    words = [
        f"up to {speeds[where].max():.1f} {unit}, its positions give {known:.1f} {unit} at most"
        for (speeds, _, unit), known, where in zip(told, most, bad, strict=True)
        if where.any()
    ]
    is_single = len(rows) <= min(_SINGLE, _SINGLE_SHARE * len(table))
    bunched = "; its stamps come in bunches" if _in_bunches(odometry) else ""
    yield Finding(
        kind="localisation",
        title="odometry tells impossible speeds",
        onset_s=float(table.t[rows[0]]),
        end_s=float(table.t[rows[-1]]),
        severity="info" if is_single else "warning",
        evidence=f"{len(rows)} of {len(table)} messages: {', '.join(words)}{bunched}",
        source=f"{odometry.topic}: twist against position",
        probability=0.9,
    )


def _in_bunches(odometry: Odometry) -> bool:
    steps = np.diff(odometry.clock)
    return len(steps) > STREAM_MESSAGES and quantile(steps, 0.02) < BUNCHED * float(median(steps))


def _is_nothing(table: Table) -> bool:
    names = ("pose.pose.position.x", "pose.pose.position.y")
    return set(names) <= set(table.columns) and not np.isfinite(np.hypot(*(table[name] for name in names))).any()


def _steps(odometry: Odometry) -> tuple[Floats, Floats, Floats]:
    """Per sample how far the position went since the one before, and the least and most that the speeds allow, m."""
    went, most = odometry.steps_m
    speed = np.hypot(odometry.speed, odometry.sideways)
    return went, np.minimum(speed, np.concatenate([speed[:1], speed[:-1]])) * odometry.dt, most


def _jumps(drive: Drive, odometry: Odometry) -> Iterator[Finding]:
    went, _, most = _steps(odometry)
    dt = odometry.dt
    top = quantile(np.hypot(odometry.speed, odometry.sideways), 0.99)
    excess = went - np.maximum(most, np.where(dt > PAUSE_S, top * dt, 0.0))
    rows = np.flatnonzero(excess > np.where(most > 0.0, JUMP_M, JUMP_AT_REST_M))
    if not len(rows):
        return
    at, far, largest = float(odometry.t[rows[0]]), float(went[rows[0]]), float(went[rows].max())
    words, more = f"{far:.2f} m", f"; {len(rows)} such jumps" if len(rows) > 1 else ""
    words = f"first {words}" if largest > far else words
    yield Finding(
        kind="localisation",
        title=f"odometry jumps by {'up to ' * (largest > far)}{largest:.2g} m",
        onset_s=at,
        end_s=float(odometry.t[rows[-1]]),
        severity=drive.severity(at),
        evidence=f"{words} within {dt[rows[0]]:.2f} s, its speed explains {most[rows[0]]:.2f} m{more}",
        source=f"{odometry.topic}: position against its own speed",
        probability=0.9,
    )


def _drift(drive: Drive, odometry: Odometry) -> Iterator[Finding]:
    """The position agreed with the speed, and from some moment on it does not.

    One that never did is how that odometry is made: wheels of another size, a twist that is filtered.
    """
    went, least, most = _steps(odometry)
    beyond = np.where(went > most, went - most, np.where(went < least, went - least, 0.0))
    usable = (odometry.dt < PAUSE_S) & (np.abs(beyond) < JUMP_M) & ~inside(_pushed(drive), odometry.t)
    extra = np.cumsum(np.where(usable, beyond, 0.0))
    way = np.cumsum(np.where(usable, (least + most) / 2, 0.0))
    for over_m, most_share in DRIFTS:
        first = np.searchsorted(way, way - over_m)
        length = way - way[first]
        share = np.divide(extra - extra[first], length, out=np.zeros(len(way)), where=length > COVERED * over_m)
        rows = np.flatnonzero((share > most_share) | (share < -SHRINK))
        if len(rows):
            yield from _drifting(drive, odometry, extra, way, share, rows, most_share)
            return


def _pushed(drive: Drive) -> list[Span]:
    """When something else than its wheels moved or held the robot: contacts, a fall, standing against commands."""
    spans = [(at - BEFORE_S, at + PUSHED_S) for at in drive.contacts_s.tolist()]
    spans += [] if drive.fall is None else [(drive.fall.start_s - BEFORE_S, np.inf)]
    held = [(start, end) for start, end in standstills(drive) if end - start >= HELD_S]
    return spans + [(start - BEFORE_S, end + BEFORE_S) for start, end in held]


def _drifting(
    drive: Drive,
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
    later, steps = extra[-1] - extra[bend], np.diff(extra[bend:])
    alone = float(steps[np.argmax(np.abs(steps))]) if len(steps) else 0.0  # one step is no drift
    if not agreed or (later - alone) * np.sign(typical) < abs(typical) / 2 * (way[-1] - way[bend]):
        return
    start = float(odometry.t[bend])
    word = "further" if typical > 0 else "less far"
    yield Finding(
        kind="localisation",
        title="odometry drifts: its position and its speed disagree",
        onset_s=start,
        end_s=float(odometry.t[rows[-1]]),
        severity=drive.severity(start),
        evidence=f"the position advances {abs(typical):.0%} {word} than the speed says, and agreed before",
        source=f"{odometry.topic}: position against its own speed; healthy move_base missions stay below 4%",
        probability=0.9,
    )


def _bend(extra: Floats, way: Floats, slope: float, before: int) -> int:
    """The row at which the excess begins to grow with the way: where it lies lowest under half its slope."""
    under = ((extra - slope / 2 * way) * np.sign(slope))[: before + 1]
    return int(np.flatnonzero(under <= under.min() + 1e-3)[0])


def _corrections(drive: Drive) -> Iterator[Finding]:
    """Steps of map -> odom in tf: the localisation found itself elsewhere."""
    for topic, table in drive.of(*TF):
        if not holds(table, TF[0]):
            continue
        edges = _edges(table.t, *(table[name] for name in PLACED))
        driven = ((edge, places.T[0], _aside(places)) for edge, places in edges.items() if edge != _MAP_TO_ODOM)
        yield from (_two_sources(drive, topic, *one) for one in driven if len(one[2]))
        places = edges.get(_MAP_TO_ODOM, np.empty((0, 3)))
        if len(places) < PLACES:
            continue
        t, x, y = places.T
        steps = np.hypot(np.diff(x), np.diff(y))
        if (turns := _in_turn(x, y, steps)) is not None:
            yield _two_sources(drive, topic, _MAP_TO_ODOM, t, turns)
            return
        rows = np.flatnonzero(steps > CORRECTION_M)
        rows = rows[t[rows + 1] > t[0] + FOUND_S]
        if len(rows):
            at, far, most = float(t[rows[0] + 1]), float(steps[rows[0]]), float(steps[rows].max())
            more = f", {len(rows)} such steps of up to {most:.2f} m" if len(rows) > 1 else ""
            yield Finding(
                kind="localisation",
                title=f"localisation jumps by {'up to ' * (most > far)}{most:.1f} m",
                onset_s=at,
                end_s=float(t[rows[-1] + 1]),
                severity=drive.severity(at),
                evidence=f"map -> odom steps by {far:.2f} m{more}",
                source=topic,
                probability=0.7,
            )
            return


def _in_turn(x: Floats, y: Floats, steps: Floats) -> NDArray[np.intp] | None:
    """The steps after which the next transform is back where the one before was; None where those are few."""
    back = np.hypot(x[2:] - x[:-2], y[2:] - y[:-2])
    turns = np.flatnonzero((steps[:-1] > IN_TURN_M) & (back < BACK * steps[:-1]))
    return turns if len(turns) >= IN_TURN * len(steps) and len(turns) > PLACES else None


def _aside(places: Floats) -> NDArray[np.intp]:
    """The steps to elsewhere, far and back, that go on from one end of the recording to the other: of a robot that
    drives, where both sources move on, and one may send seldom."""
    t, x, y = places.T
    steps, back = np.hypot(np.diff(x), np.diff(y)), np.hypot(x[2:] - x[:-2], y[2:] - y[:-2])
    turns = np.flatnonzero((steps[:-1] > JUMP_M) & (back < BACK * steps[:-1]))
    is_often = len(turns) >= OFTEN and t[turns[-1]] - t[turns[0]] > THROUGHOUT * (t[-1] - t[0])
    return turns if is_often else turns[:0]


def _two_publishers(drive: Drive, odometry: Odometry) -> Finding:
    """A driver and a filter, or two robots of one network: who listens takes the robot to leap at each message."""
    rows = odometry.in_turn
    at, far = float(odometry.t[rows[0]]), float(median(odometry.steps_m[0][rows]))
    return Finding(
        kind="localisation",
        title=f"two sources publish {odometry.topic} in turn",
        onset_s=at,
        end_s=float(odometry.t[rows[-1]]),
        severity=drive.severity(at),
        evidence=f"{len(rows)} of {len(odometry.t)} messages step by {far:.2g} m beyond its speed, the next goes back",
        source=odometry.topic,
        suspect="operation",
        probability=0.9,
    )


def _two_sources(drive: Drive, topic: str, edge: str, t: Floats, turns: NDArray[np.intp]) -> Finding:
    return Finding(
        kind="localisation",
        title=f"two sources publish {edge} in turn",
        onset_s=float(t[turns[0]]),
        end_s=float(t[turns[-1] + 1]),
        severity=drive.severity(float(t[turns[0]])),
        evidence=f"it steps to another place and back {len(turns)} times in {len(t)} transforms",
        source=topic,
        suspect="operation",
        probability=0.9,
    )


def _edges(t: Floats, *columns: NDArray[Any]) -> dict[str, Floats]:
    """Time, x and y of each transform of map -> odom, which stands for all such, and of each from an odom to a base,
    shape (n, 3). The log itself says of what type its fields are: names that are no text name nothing."""
    rows: dict[str, list[tuple[float, float, float]]] = {}
    for time_s, *fields in zip(t.tolist(), *columns, strict=True):
        if not all(isinstance(field, Sized) for field in fields):
            continue
        for parent, child, x, y in zip(*fields, strict=False):
            edge = _edge(str(parent).strip("/"), str(child).strip("/"))
            if edge and _is_number(x, y):
                rows.setdefault(edge, []).append((time_s, x, y))
    return {edge: np.array(found, np.float64) for edge, found in rows.items()}


_MAP_TO_ODOM = "map -> odom"


@lru_cache(maxsize=1_000)
def _edge(parent: str, child: str) -> str:
    """The name of a transform that says where a robot is; "" of any other."""
    if parent == "map" and child.endswith("odom"):
        return _MAP_TO_ODOM
    is_base = parent.endswith("odom") and child.rpartition("/")[2].startswith("base")
    return f"{parent} -> {child}" if is_base else ""


def _is_number(*values: object) -> bool:
    return all(isinstance(value, (int, float, np.number)) for value in values)


READS = reading(ODOMETRY, *TF, *COMMANDS, *GOALS)
CHECK = Check(
    "odometry",
    "odometry without numbers, that jumps, drifts or has two sources, and the same of a localisation",
    READS,
    LIMITS,
    find,
)
