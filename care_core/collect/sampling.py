"""Which configurations a campaign drives, and in which order; same seed, same plan.

Points of the ranges come from scipy's quasi-Monte Carlo (Owen 1998 for the scrambled Sobol' points, McKay et al. 1979
for Latin hypercubes). Further dimensions say whether an option stays at its reference, and in how many a run leaves it,
which is as evenly spread. Where every run left it in about as many, nothing would be known of those that leave it in
few, which is how robots are driven, nor of the reference itself (`benchmarks.reference_odds`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Literal

import numpy as np

from care_core.collect.space import Config, Space
from care_core.errors import UsageError
from care_core.extras import install_hint
from care_core.numbers import Floats
from care_core.records import Record

Method = Literal["sobol", "latin_hypercube", "uniform", "one_at_a_time", "adaptive"]

_TRIES = 200
"""So many points may break a limit for each that keeps them all."""


class Planned(Record):
    """One run to be made: its number from 1, the seed that its command gets, and the run that it repeats."""

    number: int
    config: Config
    seed: int
    repeats: int | None = None


def points(
    space: Space, method: Method, count: int, at_reference: float, seed: int, *, alike: bool = False
) -> list[dict[str, float]]:
    """So many different configurations beside the reference, all within the limits.

    Args:
        method: `sobol`, `latin_hypercube` or `uniform`; `adaptive` begins as `sobol`.
        at_reference: share of the options that stay at their reference, over all configurations.
        alike: it is that share in each of them; else some leave the reference in few options, others in many.

    Raises:
        UsageError: the limits leave too little, or scipy is not installed.
    """
    found: list[dict[str, float]] = []
    seen = {_key(space, space.reference)}
    half = len(space.axes)
    for looked, row in enumerate(_unit_points(2 * half + (not alike), method, count, seed)):
        if len(found) == count:
            break
        if looked == _TRIES * count:
            raise UsageError(
                f"Only {len(found)} of {count} configurations were found that are new and keep all limits.",
                hint="Ask for fewer runs, or widen the ranges or the limits.",
            )
        kept = at_reference if alike else _share_kept(at_reference, row[-1])
        config = space.config(row[:half], [share < kept for share in row[half : 2 * half]])
        key = _key(space, config)
        if key not in seen and space.allows(config):
            seen.add(key)
            found.append(config)
    return found


def _share_kept(mean: float, place: float) -> float:
    """The share of one run: evenly from none or all of them to as far beyond the mean. place: 0 to 1."""
    return mean + min(mean, 1.0 - mean) * (2.0 * place - 1.0)


def one_at_a_time(space: Space, count: int) -> list[dict[str, float]]:
    """Each option over its range with all others at the reference: the ends first, then ever finer between."""
    found: list[dict[str, float]] = []
    seen = {_key(space, space.reference)}
    for share in _finer():
        for place, axis in enumerate(space.axes):
            shares = [0.0] * len(space.axes)
            shares[place] = share
            config = space.config(shares, [other is not axis for other in space.axes])
            key = _key(space, config)
            if key not in seen and space.allows(config) and len(found) < count:
                seen.add(key)
                found.append(config)
    return found  # options with few values may not have that many


_FINEST = 64


def _finer() -> Iterator[float]:
    """1, 0, 1/2, 1/4, 3/4, 1/8, ...: shares of a range, the ends and then halves of what is left."""
    yield from (1.0, 0.0)
    parts = 2
    while parts <= _FINEST:
        yield from (k / parts for k in range(1, parts, 2))
        parts *= 2


Kind = Literal["new", "repeat", "reference"]


def kind_of(number: int, repeats: float, reference: float) -> Kind:
    """What a run of a campaign is: a new configuration, a repeat of an earlier run, or the reference once more.

    Both are spread over the campaign: one that is cut short has its share of them too.
    """
    if number == 1:
        return "new"
    if _falls(number, repeats):
        return "repeat"
    return "reference" if _falls(number - int(number * repeats), reference / (1.0 - repeats)) else "new"


def _falls(number: int, share: float) -> bool:
    return int(number * share) > int((number - 1) * share)


def with_repeats(
    space: Space, configs: Sequence[Config], count: int, share: float, seed: int, reference: float = 0.0
) -> list[Planned]:
    """The plan: the reference first, then the configurations, with repeats of earlier runs in between.

    Args:
        count: runs in all.
        share: share of them that repeat an earlier one: the reference first, then the others from the beginning.
            Every other one of them meets the conditions of the run that it repeats once more.
        reference: share of them that drive the reference, each under conditions of its own.
    """
    planned: list[Planned] = []
    repeats = 0
    fresh, originals = iter((space.reference, *configs)), iter(range(1, count + 1))
    for number in range(1, count + 1):
        kind = kind_of(number, share, reference)
        if kind == "repeat":
            original = next(n for n in originals if planned[n - 1].repeats is None)
            planned.append(repeat_of(planned[original - 1], number, seed, before=repeats))
            repeats += 1
        elif kind == "reference":
            planned.append(at_reference(space, number, seed))
        elif (config := next(fresh, None)) is not None:
            planned.append(Planned(number, config, run_seed(seed, number)))
        else:
            break
    return planned


def new_among(count: int, share: float, reference: float = 0.0) -> int:
    """How many new configurations `with_repeats` takes for so many runs, the reference of the first not counted."""
    return sum(kind_of(number, share, reference) == "new" for number in range(2, count + 1))


def at_reference(space: Space, number: int, seed: int) -> Planned:
    """The reference, which the first run drives, under conditions of its own."""
    return Planned(number, space.reference, run_seed(seed, number), 1)


def repeat_of(run: Planned, number: int, seed: int, *, before: int) -> Planned:
    """An earlier run's configuration once more, `before` repeats having been planned: in turn under conditions of its
    own and under that run's, for what is promised of a repair is the next run under the same."""
    return Planned(number, run.config, run.seed if before % 2 else run_seed(seed, number), run.number)


def run_seed(seed: int, number: int) -> int:
    """The seed that the command of a run gets, which draws the conditions that it meets."""
    return seed * 100_000 + number


def _key(space: Space, config: Config) -> tuple[float, ...]:
    return tuple(config[axis.name] for axis in space.axes)


def _unit_points(dimensions: int, method: Method, count: int, seed: int) -> Iterator[Floats]:
    """Points of the unit cube without end: further sets with other seeds where limits refused too many."""
    block = 0
    while True:
        rng = np.random.default_rng([seed, block])
        yield from _block(dimensions, method, count, rng)
        block += 1


def _block(dimensions: int, method: Method, count: int, rng: np.random.Generator) -> Floats:
    if method == "uniform":
        return rng.random((count, dimensions))
    qmc = quasi_monte_carlo()
    if method == "latin_hypercube":
        return np.asarray(qmc.LatinHypercube(d=dimensions, **_seeded(qmc, rng)).random(count))
    # Sobol' points are balanced in powers of two.
    power = max(int(np.ceil(np.log2(max(count, 2)))), 1)
    return np.asarray(qmc.Sobol(d=dimensions, scramble=True, **_seeded(qmc, rng)).random_base2(power))


def _seeded(qmc: Any, rng: np.random.Generator) -> dict[str, Any]:
    """scipy 1.15 renamed the argument."""
    from inspect import signature

    return {"rng" if "rng" in signature(qmc.Sobol.__init__).parameters else "seed": rng}


def quasi_monte_carlo() -> Any:
    """scipy's `stats.qmc`. Raises UsageError where it is not installed."""
    try:
        from scipy.stats import qmc
    except ModuleNotFoundError as err:
        message = f"Planning a campaign needs {err.name}, which is not installed."
        raise UsageError(message, hint=f"{install_hint('learn')}.") from err
    return qmc
