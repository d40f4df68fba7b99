"""The drive: does it do what is asked? It stands, it stops and goes, it is too slow, it pulls to one side."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from care_core.ecosystems.findings import Finding
from care_core.ecosystems.ros.following import Following, following
from care_core.ecosystems.ros.recording import Battery, Bools, Floats, Recording
from care_core.numbers import known_median, median

STANDS_S = 5.0
"""A drive that stands so long against its commands has failed or is held. In 301 healthy missions: 1.5 s at most."""
SLOW_S, SLOW = 5.0, 0.7
"""So long below this share of the speed asked for. The longest of 301 healthy missions: 1.9 s."""
STOPS, STOPS_IN_S, STOPPED_S = 4, 20.0, 4.0
"""So many standstills within this time, together so long. 97.5 % of healthy missions: at most 4, and 1.6 s in all."""
PULL_RADPM, PULL_SAMPLES, PULL_AGREE = 0.12, 25, 0.8
"""Turn per metre beyond what was asked, over so many samples with steady commands, of which this share agree. So none
of 301 healthy missions pulls; with 20 samples one does, with 15 five."""
PULL_BEFORE = 10
"""So many samples before it in which the drive did not pull."""
SPACED_S = 0.2
SLOWER = 0.97
"""A side that turns too slowly makes the robot slower too."""
LOST_S = 3.0
"""Over a longer pause between samples nobody knows whether the robot stood."""
_STANDING = 0.2
"""A drive that does less than this share of what is asked stands."""
_STEADY_MPS, _STEADY_RADPS = 0.15, 0.3
_LOAD = 0.5
"""Current that stays above idle by this share of what driving draws: the wheels turn or push."""

_SOURCE = "{odometry} against {commands}; limits: 97.5 % of healthy move_base missions stay far below them"


def check(recording: Recording) -> Iterator[Finding]:
    asked = following(recording)
    if asked is None or recording.commands is None:
        return
    source = _SOURCE.format(odometry=asked.odometry.topic, commands=recording.commands.topic)
    stood = _stood(asked)
    still = _unbroken(asked.odometry.t[asked.to_move], stood[asked.to_move])
    long = [(start, end) for start, end in still if end - start >= STANDS_S]
    if long:
        yield _standing(recording, asked, long, source)
    yield from _stopping(recording, [one for one in still if one not in long], source)
    slow = list(_slow(recording, asked, stood, source))
    yield from slow
    if not slow:  # a drive that does less than asked turns otherwise than asked too
        yield from _pulling(recording, asked, source)


def obeys(recording: Recording, since_s: float) -> bool:
    """Whether the drive has followed its commands since then, as far as that can be seen."""
    asked = following(recording)
    if asked is None:
        return False
    later = (asked.odometry.t > since_s) & asked.to_move
    return bool(np.count_nonzero(later) >= 10) and float(_stood(asked)[later].mean()) < 0.1


def _stood(asked: Following) -> Bools:
    """Samples in which the robot stands though every command of the last second asked for motion."""
    odometry = asked.odometry
    speed, turn = np.hypot(odometry.speed, odometry.sideways), np.abs(odometry.turn)
    wanted, wanted_turn = np.abs(asked.wanted_speed), np.abs(asked.wanted_turn)
    stands = (speed < np.maximum(_STANDING * wanted, 0.02)) & (turn < np.maximum(_STANDING * wanted_turn, 0.02))
    # A robot asked to drive a curve that only turns does not drive either.
    return asked.to_move & (stands | ((wanted >= 0.08) & (speed < _STANDING * wanted)))


def _standing(recording: Recording, asked: Following, long: list[tuple[float, float]], source: str) -> Finding:
    start, end = long[0][0], long[-1][1]
    total_s = sum(stop - begin for begin, stop in long)
    inside = (asked.odometry.t >= start) & (asked.odometry.t <= long[0][1])
    wanted = float(median(np.abs(asked.wanted_speed[inside])))
    told = f"commanded {wanted:.2f} m/s" if wanted > 0 else "commanded to turn"
    evidence = f"{told} for {total_s:.0f} s, odometry stands"
    pushing = next((one for battery in recording.batteries if (one := _pushes(battery, asked, long)) is not None), None)
    severity = recording.severity(start, "critical")
    if pushing is None:
        return Finding("drive", "the robot does not move though commanded", start, end, severity, evidence, source,
                       probability=0.9)  # fmt: skip
    drawn, idle, driving = pushing
    load = f"; current {drawn:.1f} A, idle {idle:.1f} A, driving {driving:.1f} A"
    if drawn - idle > _LOAD * (driving - idle):
        return Finding("blocked", "something holds the robot: its motors push, it does not move", start, end, severity,
                       evidence + load, source, "world", 0.85)  # fmt: skip
    return Finding("drive", "the drive does not answer its commands", start, end, severity, evidence + load, source,
                   probability=0.9)  # fmt: skip


def _pushes(battery: Battery, asked: Following, long: list[tuple[float, float]]) -> tuple[float, float, float] | None:
    """Current while held, while idle and while driving, A; None where the recording does not tell them apart."""
    odometry = asked.odometry
    held = np.zeros(len(battery.t), bool)
    for start, end in long:
        held |= (battery.t >= start + 1.0) & (battery.t <= end)
    speed = np.interp(battery.t, odometry.t, np.abs(odometry.speed))
    turn = np.interp(battery.t, odometry.t, np.abs(odometry.turn))
    drives, idles = (speed > 0.1) & ~held, (speed < 0.01) & (turn < 0.01) & ~held
    if min(np.count_nonzero(one) for one in (held, drives, idles)) < 3:
        return None
    drawn, idle, driving = (known_median(battery.current[one]) for one in (held, idles, drives))
    return (drawn, idle, driving) if driving > 1.2 * idle > 0 else None


def _unbroken(t: Floats, stood: Bools) -> list[tuple[float, float]]:
    """First and last time of each stretch in which every sample stands."""
    edges = np.flatnonzero(np.diff(stood.astype(int)) | (np.diff(t) > LOST_S)) + 1
    bounds = [0, *edges.tolist(), len(t)]
    spans = [(first, last - 1) for first, last in pairwise(bounds) if last - first > 1 and stood[first]]
    return [(float(t[first]), float(t[last])) for first, last in spans]


def _stopping(recording: Recording, still: list[tuple[float, float]], source: str) -> Iterator[Finding]:
    """Many short standstills close together."""
    starts = np.array([start for start, _ in still])
    stood_s = np.array([end - start for start, end in still])
    for start in starts.tolist():
        near = (starts >= start) & (starts < start + STOPS_IN_S)
        if np.count_nonzero(near) >= STOPS and float(stood_s[near].sum()) >= STOPPED_S:
            later = starts >= start
            evidence = (f"{np.count_nonzero(later)} standstills of {median(stood_s[later]):.1f} s"
                        " while commands to move go on")  # fmt: skip
            yield Finding("commands", "commands reach the drive only now and then", start, still[-1][1],
                          recording.severity(start), evidence, source, probability=0.9)  # fmt: skip
            return


def _slow(recording: Recording, asked: Following, stood: Bools, source: str) -> Iterator[Finding]:
    """Moves, but slower than every command of the last second."""
    odometry, wanted = asked.odometry, asked.wanted_speed
    asks = np.abs(wanted) >= 0.08
    share = np.divide(odometry.speed, wanted, out=np.ones(len(wanted)), where=asks)
    slow = (share < SLOW)[asks]
    t = odometry.t[asks]
    begin = 0
    found: list[tuple[int, int]] = []
    for row in range(len(t) + 1):
        if row == len(t) or not slow[row] or (row and t[row] - t[row - 1] > 2.0):
            if row > begin and t[row - 1] - t[begin] >= SLOW_S and not stood[asks][begin:row].mean() > 0.5:
                found.append((begin, row))
            begin = row + 1 if row < len(t) and not slow[row] else row
    if not found:
        return
    rows = np.concatenate([np.arange(first, last) for first, last in found])
    speeds, demands = np.abs(odometry.speed[asks]), np.abs(wanted[asks])
    reached, demanded = float(median(speeds[rows])), float(median(demands[rows]))
    # It was weak since it last was clearly faster, though before a higher speed was asked for nobody could see.
    faster = np.flatnonzero(speeds[: found[0][0]] > 1.3 * reached)
    lasting = slow & np.append(slow[1:], False) & (demands > 1.3 * reached)
    since = np.flatnonzero(lasting & (np.arange(len(t)) > (faster[-1] if len(faster) else -1)))
    start, end = float(t[min(*since[:1], found[0][0])]), float(t[found[-1][1] - 1])
    evidence = f"reaches {reached:.2f} m/s of {demanded:.2f} m/s commanded, for {len(rows)} samples"
    yield Finding("drive", "the drive is weak: slower than commanded", start, end, recording.severity(start), evidence,
                  source, probability=0.9)  # fmt: skip


def _pulling(recording: Recording, asked: Following, source: str) -> Iterator[Finding]:
    """Turns to one side more than asked, in proportion to its speed, and is slower than asked."""
    odometry = asked.odometry
    steady = asked.asked & (np.abs(asked.wanted_speed) > 0.1) & (np.abs(odometry.speed) > 0.05)
    steady &= (asked.speed_high - asked.speed_low < _STEADY_MPS) & (asked.turn_high - asked.turn_low < _STEADY_RADPS)
    rows = _spaced(odometry.t, np.flatnonzero(steady))
    if len(rows) < PULL_BEFORE + PULL_SAMPLES:
        return
    t, speed = odometry.t[rows], odometry.speed[rows]
    pull: Floats = (odometry.turn[rows] - (asked.turn_high + asked.turn_low)[rows] / 2) / speed
    windows = sliding_window_view(pull, PULL_SAMPLES)[PULL_BEFORE:]
    shares = sliding_window_view(speed / asked.wanted_speed[rows], PULL_SAMPLES)[PULL_BEFORE:]
    middles = median(windows, axis=1)
    agrees = np.mean(np.sign(windows) == np.sign(middles)[:, None], axis=1)
    fits = (np.abs(middles) >= PULL_RADPM) & (agrees >= PULL_AGREE) & (median(shares, axis=1) < SLOWER)
    for number in np.flatnonzero(fits).tolist():
        first, middle = number + PULL_BEFORE, float(middles[number])
        if float(median(pull[:first])) * np.sign(middle) < PULL_RADPM / 2:
            # It began where the sum of what is beyond half of it turns upwards.
            above = np.cumsum(pull[: first + PULL_SAMPLES] * np.sign(middle) - abs(middle) / 2)
            start = float(t[int(np.argmin(above))])
            side = "left" if middle > 0 else "right"
            evidence = (
                f"turns {abs(middle):.2f} rad per metre beyond its commands, {agrees[number]:.0%} of samples agree"
            )
            yield Finding("drive", f"the drive pulls to the {side}", start, float(t[-1]), recording.severity(start),
                          evidence, source, probability=0.8)  # fmt: skip
            return


def _spaced(t: Floats, rows: NDArray[np.intp]) -> NDArray[np.intp]:
    """The first row of every fifth of a second: what comes faster says the same again."""
    _, first = np.unique(np.floor(t[rows] / SPACED_S), return_index=True)
    spaced: NDArray[np.intp] = rows[first]
    return spaced
