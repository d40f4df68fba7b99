"""What the runs of a fleet have in common. Every sentence is a count of robots, and what could be chance is called so.

Robots are the units: ten runs of one robot are no ten witnesses. Where the logs name no robots, runs are counted. Only
robots of one sort are compared: a rover cannot lose a motor of four.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import datetime, timezone
from math import comb
from typing import Literal

from care_core.configs.driven import same_value
from care_core.fleet.rows import Row, distinct
from care_core.records import Record, replace

FEWEST = 2
"""What one robot has is not shared."""
SURE, MAYBE = 0.05, 0.25
"""A trait that would set the affected apart by chance more often than `SURE` is called a maybe; above `MAYBE`, where
some trait or other is to be expected, it is not told."""
MOST_TRAITS = 3

Unit = Literal["robot", "run"]
Kind = Literal["cause", "finding", "breach"]


class Trait(Record):
    """Something that all affected have and not all others: "firmware" "ArduCopter V4.5.4", or an option's value."""

    name: str
    value: str
    others_with: int
    others: int
    instead: tuple[str, ...]
    """What the others have."""
    chance: float
    """Probability that some trait of some pattern sets so many apart by chance alone (hypergeometric, times the number
    of traits that differ within the fleet, times that of patterns; Bonferroni)."""
    compared: int

    @property
    def is_sure(self) -> bool:
        return self.chance <= SURE


class Since(Record):
    """When it was first there. `earlier`: runs before that were without it; `chance`: that so many come first for some
    pattern if the order says nothing."""

    start: str
    earlier: int
    later_with: int
    later: int
    chance: float

    @property
    def is_sure(self) -> bool:
        return self.chance <= SURE


class Pattern(Record):
    """One thing on several robots."""

    kind: Kind
    what: str
    """`parameter`, `hardware` or `world` of a cause; the finding's kind or `objective` of others."""
    name: str
    """The option, objective, or title; of titles that differ, the kind and the most frequent one."""
    sort: str
    """Which sort of robot was counted."""
    unit: Unit
    affected: tuple[str, ...]
    others: tuple[str, ...]
    """Those of the same sort whose runs are known and that never had it."""
    runs: int
    of_runs: int
    values: tuple[float, float] | None = None
    """Of an option: what the affected runs had."""
    others_values: tuple[float, float] | None = None
    since: Since | None = None
    traits: tuple[Trait, ...] = ()

    @property
    def of(self) -> int:
        return len(self.affected) + len(self.others)


def shared(rows: Sequence[Row]) -> tuple[Pattern, ...]:
    """What at least two robots (or runs) have in common: causes first, those on most robots first."""
    known = [row for row in distinct(rows) if row.status != "unreadable"]
    found: list[Pattern] = []
    for sort in dict.fromkeys(row.kind for row in known):
        patterns = list(_patterns(sort, [row for row in known if row.kind == sort]))
        found += [_corrected(one, len(patterns)) for one in patterns]
    rank = {"cause": 0, "finding": 1, "breach": 2}
    return tuple(sorted(found, key=lambda one: (rank[one.kind], -len(one.affected), -one.runs, one.name)))


def unit_of(rows: Sequence[Row]) -> Unit:
    """What can be counted: robots where every log names its own."""
    return "robot" if all(row.robot for row in rows) else "run"


def name_of(row: Row, unit: Unit) -> str:
    """The robot of a row, or its run where runs are counted."""
    return row.robot if unit == "robot" and row.robot else row.log


def _patterns(sort: str, rows: Sequence[Row]) -> Iterator[Pattern]:
    """The patterns among robots of one sort; one that says no more than an earlier one is left out."""
    told: set[frozenset[str]] = set()
    for option in dict.fromkeys(one.name for row in rows if (one := row.main) and one.what == "parameter"):
        # Only runs that the same profile judged can have it.
        profiles = {row.profile for row in rows if _is_cause(row, "parameter", option)}
        same = [row for row in rows if row.profile in profiles and row.is_judged]
        yield from _new_pattern(_pattern("cause", "parameter", option, sort, same, _causes("parameter", option)), told)
    for what, kind in dict.fromkeys((one.what, one.kind or one.name) for row in rows if (one := row.main)):
        if what != "parameter":
            yield from _new_pattern(_pattern("cause", what, kind, sort, rows, _causes(what, kind)), told)
    for kind in dict.fromkeys(one.kind for row in rows for one in row.findings):
        yield from _new_pattern(_pattern("finding", kind, kind, sort, rows, _sees(kind)), told)
    for objective in dict.fromkeys(name for row in rows for name in row.breaches):
        judged = [row for row in rows if row.is_judged]
        yield from _new_pattern(_pattern("breach", "objective", objective, sort, judged, _breaks(objective)), told)


def _corrected(one: Pattern, patterns: int) -> Pattern:
    """The pattern with its chances those of finding as much in any of so many; what is to be expected is left out."""
    traits = [replace(trait, chance=min(1.0, trait.chance * patterns)) for trait in one.traits]
    since = one.since and replace(one.since, chance=min(1.0, one.since.chance * patterns))
    if since is not None and since.earlier and since.chance > MAYBE:
        since = None
    told = sorted((trait for trait in traits if trait.chance <= MAYBE), key=lambda trait: (trait.chance, trait.name))
    return replace(one, traits=tuple(told[:MOST_TRAITS]), since=since)


def _new_pattern(pattern: Pattern | None, told: set[frozenset[str]]) -> Iterator[Pattern]:
    if pattern is None or (pattern.kind != "cause" and frozenset(pattern.affected) in told):
        return
    told.add(frozenset(pattern.affected))
    yield pattern


def _is_cause(row: Row, what: str, name: str) -> bool:
    main = row.main
    return main is not None and main.what == what and name in (main.name, main.kind)


def _causes(what: str, name: str) -> Callable[[Row], bool]:
    return lambda row: _is_cause(row, what, name)


def _sees(kind: str) -> Callable[[Row], bool]:
    return lambda row: any(one.kind == kind for one in row.findings)


def _breaks(objective: str) -> Callable[[Row], bool]:
    return lambda row: objective in row.breaches


def _pattern(
    kind: Kind, what: str, name: str, sort: str, rows: Sequence[Row], has: Callable[[Row], bool]
) -> Pattern | None:
    unit = unit_of(rows)
    with_it = [row for row in rows if has(row)]
    affected = tuple(dict.fromkeys(name_of(row, unit) for row in with_it))
    if len(affected) < FEWEST:
        return None
    others = tuple(dict.fromkeys(n for row in rows if (n := name_of(row, unit)) not in affected))
    rest = [row for row in rows if name_of(row, unit) in others]
    is_option = what == "parameter"
    return Pattern(
        kind,
        what,
        _title(kind, what, name, with_it),
        sort,
        unit,
        affected,
        others,
        len(with_it),
        len(rows),
        _span(with_it, name) if is_option else None,
        _span(rest, name) if is_option else None,
        _since(rows, has),
        _traits(with_it, rest, unit, name if is_option else ""),
    )


def _title(kind: Kind, what: str, name: str, with_it: Sequence[Row]) -> str:
    """The title that all of them have, else the kind with the most frequent one."""
    if kind == "cause" and what != "parameter":
        titles = Counter(row.main.name for row in with_it if row.main)
    elif kind == "finding":
        titles = Counter(one.title for row in with_it for one in row.findings if one.kind == name)
    else:
        return name
    (title, _), *others = titles.most_common()
    return f"{name} (such as: {title})" if others else title


def _span(rows: Sequence[Row], option: str) -> tuple[float, float] | None:
    values = [row.asked.config[option] for row in rows if row.asked and option in row.asked.config]
    return (min(values), max(values)) if values else None


def _since(rows: Sequence[Row], has: Callable[[Row], bool]) -> Since | None:
    """When it was first there; None where a run that has it does not say when it was."""
    if any(row.start is None for row in rows if has(row)):
        return None
    dated = sorted(((_time(row.start), has(row), row.start) for row in rows if row.start), key=lambda one: one[0])
    first = next(i for i, (_, with_it, _) in enumerate(dated) if with_it)
    later = dated[first:]
    count = sum(with_it for _, with_it, _ in later)
    chance = comb(len(later), count) / comb(len(dated), count)
    return Since(str(later[0][2]), first, count, len(later), chance)


def _time(start: str) -> datetime:
    found = datetime.fromisoformat(start)
    return found if found.tzinfo else found.replace(tzinfo=timezone.utc)


def _traits(with_it: Sequence[Row], rest: Sequence[Row], unit: Unit, option: str) -> tuple[Trait, ...]:
    """What all affected have and not all others.

    An affected robot has a trait if all its affected runs do, another one if any of its runs does: both make it harder
    for a trait to set them apart.

    Args:
        option: is the cause itself, so that its value is no news.
    """
    everyone = [*with_it, *rest]
    names = [name for name in _trait_names(everyone) if name != option and _varies(everyone, name)]
    found = []
    for name in names:
        values = {_value(row, name) for row in with_it}
        value = values.pop()
        if values or value is None:
            continue
        others: dict[str, set[str]] = {}
        for row in rest:
            others.setdefault(name_of(row, unit), set()).add(_value(row, name) or "")
        if any("" in one for one in others.values()):
            continue  # who does not say may have it too
        having = sum(value in one for one in others.values())
        affected = len({name_of(row, unit) for row in with_it})
        chance = comb(affected + having, affected) / comb(affected + len(others), affected)
        instead = tuple(sorted({one for several in others.values() for one in several} - {value}))
        if having < len(others):
            found.append(Trait(name, value, having, len(others), instead, min(1.0, chance * len(names)), len(names)))
    return tuple(found)


def _trait_names(rows: Sequence[Row]) -> list[str]:
    return [*_FACTS, *dict.fromkeys(option for row in rows for option in row.off)]


_FACTS: Mapping[str, Callable[[Row], str]] = {
    "firmware": lambda row: row.firmware,
    "frame": lambda row: row.frame,
    "profile": lambda row: f"{row.profile} {row.version}" if row.profile else "",
}


def _value(row: Row, name: str) -> str | None:
    """A trait of a run as it is written, None where the run does not say."""
    if name in _FACTS:
        return _FACTS[name](row) or None
    if row.asked is None or name not in row.asked.config:
        return None
    value = row.asked.config[name]
    reference = row.off.get(name)
    # A value that is the reference's to seven digits is written as the reference is.
    return f"{value if reference is None or not same_value(value, reference) else reference:.6g}"


def _varies(rows: Sequence[Row], name: str) -> bool:
    return len({_value(row, name) for row in rows} - {None}) > 1
