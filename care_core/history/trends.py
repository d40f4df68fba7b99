"""Is it getting worse, on which robot, since which change: runs of one robot on one mission, in order, by their ranks.

Tests by ranks ask nothing of how values are spread and are not moved by one odd run: that of Mann and Kendall for a
trend (Mann 1945, Kendall 1975), that of Pettitt (1979) for a change at one run. Both take runs to be independent but
for what they look for. Up to eight runs the probability is counted over all orders, above it is the papers'
approximation, and of all tests made it is Holm's (1979), so that many robots make no false alarm likely.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from itertools import pairwise, permutations
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from care_core.configs.driven import same_value
from care_core.history.store import Triaged
from care_core.numbers import Floats
from care_core.records import Record, replace
from care_core.run import Robot
from care_core.variables import asks_alike

Direction = Literal["worse", "better", "none", "constant", "too few"]

ALPHA = 0.05
LEAST_RUNS = 5
"""With four runs in perfect order the probability is 2 / 4! = 0.08: fewer can show nothing."""
_COUNTED, _DRAWN = 7, 9999
"""Up to so many runs all orders are counted (7! = 5040); of more so many are drawn, always the same."""


class Changed(Record):
    """A parameter, or the firmware, that differs from the run before."""

    name: str
    before: float | str
    after: float | str


class Since(Record):
    """The run from which on an objective is different: medians before and from then on (of yes and no the shares), and
    what changed at this run."""

    run: Triaged
    before: float
    after: float
    p: float
    changed: tuple[Changed, ...]


class Trend(Record):
    """How an objective went over runs, oldest first. `tau` is Kendall's, -1 to 1; `p` of the trend, None where there is
    no test."""

    objective: str
    unit: str
    """The objective's, or "x" where values are multiples of what the reference configuration needs."""
    values: tuple[float, ...]
    direction: Direction
    tau: float | None = None
    p: float | None = None
    since: Since | None = None


class MissionRuns(Record):
    """Runs of one robot that were asked the same, judged by one profile, oldest first."""

    profile: str
    runs: tuple[Triaged, ...]
    trends: tuple[Trend, ...]


class RobotRuns(Record):
    """All runs of one robot (None: nothing says whose they are), oldest first; `faults` is the trend of having one."""

    robot: Robot | None
    runs: tuple[Triaged, ...]
    faulty: int
    faults: Trend
    missions: tuple[MissionRuns, ...]


def by_robot(triages: Iterable[Triaged], is_faulty: Mapping[int, bool]) -> tuple[RobotRuns, ...]:
    """The past by robot and mission with its trends; `is_faulty` holds, by the place in `triages`, who had a fault."""
    told = list(triages)
    faulty = {id(run): is_faulty[place] for place, run in enumerate(told)}
    groups: dict[str, list[Triaged]] = {}
    for run in told:
        groups.setdefault(run.robot.id if run.robot else "", []).append(run)
    found = [_of_robot(runs, faulty) for _, runs in sorted(groups.items())]
    return _corrected(found)


def _of_robot(told: Sequence[Triaged], faulty: Mapping[int, bool]) -> RobotRuns:
    runs = in_order(told)
    flags = [float(faulty[id(run)]) for run in runs]
    missions = []
    for profile in dict.fromkeys(_profile(run) for run in runs):
        for alike in _missions([run for run in runs if _profile(run) == profile]):
            missions.append(MissionRuns(profile, tuple(alike), tuple(_trends(alike))))
    return RobotRuns(
        runs[-1].robot, tuple(runs), int(sum(flags)), _trend("faults", "", flags, runs, worse=1), tuple(missions)
    )


def in_order(told: Iterable[Triaged]) -> list[Triaged]:
    """Runs as they were made, oldest first: by the clock of their logs where all have one, else as they were triaged.
    Of a log that was judged before it was whole, the last stands."""
    newest: dict[tuple[Any, ...], Triaged] = {}
    for run in told:
        start = run.document["log"].get("start")
        key = (run.log_path, start, run.mission, _profile(run)) if start else (id(run),)
        newest.setdefault(key, run)  # the latest come first
    runs = list(reversed(newest.values()))
    starts = [run.document["log"].get("start") for run in runs]
    if all(starts):
        return [run for _, run in sorted(zip(starts, runs, strict=True), key=lambda pair: str(pair[0]))]
    return runs


def runs_before(told: Iterable[Triaged]) -> dict[int, Triaged]:
    """The run before, of the same robot and judged by the same profile, of each run that has one, by its `id`. What no
    log tells the robot of may be of several."""
    groups: dict[tuple[str, str], list[Triaged]] = {}
    for run in told:
        if run.robot is not None:
            groups.setdefault((run.robot.id, _profile(run)), []).append(run)
    return {id(after): before for runs in groups.values() for before, after in pairwise(in_order(runs))}


def _profile(run: Triaged) -> str:
    return run.document["profile"]["name"] if run.document["profile"] else ""


def _missions(runs: Iterable[Triaged]) -> list[list[Triaged]]:
    """The runs by what they were asked."""
    found: list[list[Triaged]] = []
    for run in runs:
        alike = next((group for group in found if _same(group[0].asked, run.asked)), None)
        if alike is None:
            found.append([run])
        else:
            alike.append(run)
    return found


def _same(a: Mapping[str, float], b: Mapping[str, float]) -> bool:
    return a.keys() == b.keys() and all(asks_alike(a[name], b[name]) for name in a)


def _trends(runs: Sequence[Triaged]) -> Iterator[Trend]:
    entries = [{entry["name"]: entry for entry in run.document["objectives"]} for run in runs]
    for name in dict.fromkeys(name for one in entries for name in one):
        known = [(run, one[name]) for run, one in zip(runs, entries, strict=True) if _is_known(one.get(name))]
        if not known:
            continue
        is_share = all(entry.get("needs") and entry["needs"]["value"] > 0 for _, entry in known)
        values = [entry["value"] / (entry["needs"]["value"] if is_share else 1.0) for _, entry in known]
        limits = [entry["threshold"]["op"] for _, entry in known if entry.get("threshold")]
        worse = 1 if limits and limits[-1].startswith("<") else -1 if limits or known[-1][1]["unit"] == "" else 1
        yield _trend(name, "x" if is_share else known[-1][1]["unit"], values, [run for run, _ in known], worse)


def _is_known(entry: Mapping[str, Any] | None) -> bool:
    value = None if entry is None else entry.get("value")
    return isinstance(value, (int, float)) and math.isfinite(value)


def _trend(name: str, unit: str, values: Sequence[float], runs: Sequence[Triaged], worse: int) -> Trend:
    """The trend of an objective whose larger values are worse (1) or better (-1)."""
    x = np.array(values, float)
    if len(x) < LEAST_RUNS:
        return Trend(name, unit, tuple(values), "too few")
    if np.ptp(x) == 0:
        return Trend(name, unit, tuple(values), "constant")
    tau, p = kendall(x)
    direction: Direction = "worse" if tau * worse > 0 else "better"
    at, p_change = pettitt(x)
    middle = np.mean if set(values) <= {0.0, 1.0} else np.median  # of yes and no the share
    before, after = float(middle(x[:at])), float(middle(x[at:]))
    since = Since(runs[at], before, after, p_change, changed(runs[at - 1], runs[at]))
    return Trend(name, unit, tuple(values), direction, tau, p, since)


def changed(before: Triaged, after: Triaged) -> tuple[Changed, ...]:
    """What differs between two runs of what somebody sets: parameters that both logs hold, and the firmware."""
    found = []
    if before.firmware and after.firmware and before.firmware != after.firmware:
        found.append(Changed("firmware", before.firmware, after.firmware))
    old, new = (run.settings or run.document["config"] for run in (before, after))
    found += [Changed(name, old[name], new[name]) for name in sorted(old.keys() & new.keys())
              if not same_value(old[name], new[name])]  # fmt: skip
    return tuple(found)


def kendall(x: Floats) -> tuple[float, float]:
    """Kendall's tau-b of values with their order, and its two-sided probability where there is no trend.

    `x` has shape (n,), 5 values and more, not all equal.
    """
    n = len(x)
    upper = np.triu_indices(n, 1)
    signs = np.sign(x[upper[1]] - x[upper[0]])
    score, untied = float(signs.sum()), float(np.abs(signs).sum())
    tau = score / math.sqrt(untied * n * (n - 1) / 2)
    if n <= _COUNTED:
        every = _orders(n)
        scores = np.sign(x[every[:, upper[1]]] - x[every[:, upper[0]]]).sum(axis=1)
        return tau, float(np.mean(np.abs(scores) >= abs(score) - 0.5))
    _, ties = np.unique(x, return_counts=True)
    variance = (n * (n - 1) * (2 * n + 5) - float(np.sum(ties * (ties - 1) * (2 * ties + 5)))) / 18
    z = max(abs(score) - 1.0, 0.0) / math.sqrt(variance)
    return tau, math.erfc(z / math.sqrt(2))


def pettitt(x: Floats) -> tuple[int, float]:
    """The place of the first value after the likeliest change, and the probability of one as clear where there is
    none."""
    n = len(x)
    _, places, ties = np.unique(x, return_inverse=True, return_counts=True)
    ranks = (np.cumsum(ties) - (ties - 1) / 2)[places]  # equal values share the middle of theirs
    score = _split_scores(ranks)
    at_least = int(np.sum(_split_scores(ranks[_orders(n)]).max(axis=1) >= score.max() - 0.25))
    p = at_least / math.factorial(n) if n <= _COUNTED else (at_least + 1) / (_DRAWN + 1)
    return int(np.argmax(score)) + 1, p


def _split_scores(ranks: Floats) -> Floats:
    """|U_t| of Pettitt for each split, by ranks, shape (..., n): U_t = 2 (r_1 + ... + r_t) - t (n + 1)."""
    n = ranks.shape[-1]
    return np.asarray(np.abs(2 * np.cumsum(ranks, axis=-1) - np.arange(1, n + 1) * (n + 1))[..., :-1])


@lru_cache
def _orders(n: int) -> NDArray[np.int64]:
    """All orders of n things; of many those that are drawn."""
    if n <= _COUNTED:
        return np.array(list(permutations(range(n))))
    return np.random.default_rng(0).permuted(np.tile(np.arange(n), (_DRAWN, 1)), axis=1)


def _corrected(found: Sequence[RobotRuns]) -> tuple[RobotRuns, ...]:
    """The trends with Holm's correction over all tests of all robots; what is not sure then is none."""
    trends = [trend for robot in found for trend in (robot.faults, *(t for m in robot.missions for t in m.trends))]
    tested = [p for trend in trends for p in (trend.p, trend.since.p if trend.since else None) if p is not None]
    adjusted = iter(_holm(tested))
    made = iter([_judged(trend, adjusted) for trend in trends])
    return tuple(
        replace(
            robot,
            faults=next(made),
            missions=tuple(replace(m, trends=tuple(next(made) for _ in m.trends)) for m in robot.missions),
        )
        for robot in found
    )


def _judged(trend: Trend, adjusted: Iterator[float]) -> Trend:
    if trend.p is None or trend.since is None:
        return trend
    p, p_change = next(adjusted), next(adjusted)
    since = replace(trend.since, p=p_change) if p_change < ALPHA else None
    direction = trend.direction if p < ALPHA or since is not None else "none"
    return replace(trend, p=p, since=since, direction=direction)


def _holm(ps: Sequence[float]) -> list[float]:
    """Each probability corrected for that so many were looked at, in their order."""
    order = sorted(range(len(ps)), key=lambda place: ps[place])
    corrected, largest = [0.0] * len(ps), 0.0
    for rank, place in enumerate(order):
        largest = max(largest, min(ps[place] * (len(ps) - rank), 1.0))
        corrected[place] = largest
    return corrected
