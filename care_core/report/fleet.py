"""A fleet for other programs (`care.fleet/1`, a table) and the sentences about it for people."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from datetime import datetime
from pathlib import Path, PurePosixPath
from typing import Any, Final, Literal

from care_core.diagnose.noisy_or import What
from care_core.diagnose.records import Confidence
from care_core.diagnose.verdict import RunStatus
from care_core.ecosystems.findings import FindingKind, Severity
from care_core.errors import UsageError
from care_core.extras import install_hint
from care_core.fleet.fleet_report import Fleet
from care_core.fleet.rows import Explained, Row, copies_of, distinct
from care_core.fleet.shared import FEWEST, Kind, Pattern, Since, Trait, Unit
from care_core.fleet.suggest import Effect, Outlook, Silence, Suggestion
from care_core.numbers import six_digits
from care_core.outputs import REMOVE_HINT, check_replaceable
from care_core.records import field
from care_core.report.document import estimate, parameter_names, plain_number
from care_core.report.published import Document, publish
from care_core.run import FitVerdict
from care_core.tables import parquet
from care_core.text import clean, first_of, listed, percent, wrapped

SCHEMA_ID: Final = "care.fleet/1"
NAMED = 8
"""Robots that a sentence names."""
PATTERNS = 8
"""Things shared that are told in words; the document holds all."""
_LONGEST_NAME = 24
_SHORT = 30
"""Letters in brackets that stand on one line with the name before them."""


class ExplainedEntry(Document, kw_only=True):
    what: What
    name: str
    probability: float
    kind: FindingKind | None


class CauseEntry(Document, kw_only=True):
    option: str
    confidence: Confidence
    current: int | float
    suggested: int | float | None


class SeenEntry(Document, kw_only=True):
    kind: FindingKind
    title: str
    severity: Severity


class RowEntry(Document, kw_only=True):
    """One log. `robot` is null where the log names none, `called` is what people call it; `copy_of` names the log whose
    copy it is; `off` holds the options that are off their reference, with what they are."""

    log: str
    robot: str | None
    called: str
    status: RunStatus
    reason: str
    copy_of: str | None
    start: str | None
    duration_s: float
    sha256: str
    mission: int
    kind: str
    firmware: str
    frame: str
    profile: str
    version: str
    fit: FitVerdict
    objectives: dict[str, float]
    breaches: list[str]
    explained: list[ExplainedEntry]
    causes: list[CauseEntry]
    findings: list[SeenEntry]
    change: dict[str, int | float]
    p_fixed: float | None
    off: dict[str, int | float]


class TraitEntry(Document, kw_only=True):
    """What all affected have; of the `others` so many have it too. `chance`: that some trait of the `compared` sets so
    many apart by chance."""

    name: str
    value: str
    others_with: int
    others: int
    instead: list[str]
    chance: float
    compared: int


class SinceEntry(Document, kw_only=True):
    """`earlier` runs before `start` were without it, of the `later` ones so many had it. `chance`: that all runs
    without it come first if the order says nothing."""

    start: str
    earlier: int
    later_with: int
    later: int
    chance: float


class PatternEntry(Document, kw_only=True):
    kind: Kind
    what: str
    name: str
    sort: str
    unit: Unit
    affected: list[str]
    others: list[str]
    runs: int
    of_runs: int
    values: tuple[float, float] | None
    others_values: tuple[float, float] | None
    since: SinceEntry | None
    traits: list[TraitEntry]


class OutlookEntry(Document, kw_only=True):
    name: str
    effect: Effect
    fails_now: bool
    p_ok_now: float | None
    p_ok_then: float | None
    why: str


class ChangeEntry(Document, kw_only=True):
    option: str
    parameter: str | list[str]
    to: int | float
    unit: Unit
    outlooks: list[OutlookEntry]


class SuggestionEntry(Document, kw_only=True):
    """`change` is null where none is suggested, and `reason` says why; `best` is the best that was found then."""

    profile: str
    change: ChangeEntry | None
    reason: str
    best: ChangeEntry | None


class FleetDocument(Document, kw_only=True):
    """What `care fleet --json` prints."""

    schema_: Literal["care.fleet/1"] = field(default=SCHEMA_ID, name="schema")
    rows: list[RowEntry]
    shared: list[PatternEntry]
    suggestions: list[SuggestionEntry]


def fleet_document(fleet: Fleet) -> FleetDocument:
    """The fleet as a document."""
    return FleetDocument(
        rows=_row_entries(fleet.rows),
        shared=[_pattern_entry(one) for one in fleet.shared],
        suggestions=[_suggestion_entry(one) for one in fleet.suggestions],
    )


def _row_entries(rows: Sequence[Row]) -> list[RowEntry]:
    copies = copies_of(rows)
    return [_row_entry(row, copies.get(place)) for place, row in enumerate(rows)]


def _row_entry(row: Row, copy_of: str | None) -> RowEntry:
    explained = [publish(ExplainedEntry, one, probability=six_digits(one.probability)) for one in row.explained]
    causes = [
        publish(
            CauseEntry,
            one,
            current=plain_number(one.current),
            suggested=None if one.suggested is None else plain_number(one.suggested),
        )
        for one in row.causes
    ]
    return publish(
        RowEntry,
        row,
        copy_of=copy_of,
        explained=explained,
        causes=causes,
        findings=[publish(SeenEntry, one) for one in row.findings],
        change={name: plain_number(value) for name, value in row.change.items()},
        p_fixed=estimate(row.p_fixed),
        off={} if row.asked is None else {name: plain_number(row.asked.config[name]) for name in row.off},
    )


def _pattern_entry(one: Pattern) -> PatternEntry:
    return publish(
        PatternEntry,
        one,
        values=one.values,
        others_values=one.others_values,
        since=one.since and publish(SinceEntry, one.since),
        traits=[publish(TraitEntry, trait) for trait in one.traits],
    )


def _suggestion_entry(one: Suggestion | Silence) -> SuggestionEntry:
    if isinstance(one, Suggestion):
        return SuggestionEntry(profile=one.profile, change=_change_entry(one), reason="", best=None)
    best = None if one.best is None else _change_entry(one.best)
    return SuggestionEntry(profile=one.profile, change=None, reason=one.reason, best=best)


def _change_entry(one: Suggestion) -> ChangeEntry:
    return ChangeEntry(
        option=one.option.name,
        parameter=parameter_names(one.option.parameters),
        to=plain_number(one.value),
        unit=one.unit,
        outlooks=[
            OutlookEntry(
                name=each.name,
                effect=each.effect,
                fails_now=each.is_failing,
                p_ok_now=estimate(each.now),
                p_ok_then=estimate(each.then),
                why=each.why,
            )
            for each in one.outlooks
        ],
    )


KIND = "fleet"
"""What `outputs` calls such a table."""


def check_parquet_path(path: Path) -> None:
    """Refuse, before any log is read, a table that could not be written. Raises UsageError."""
    check_replaceable(path, kind=KIND, hint=REMOVE_HINT)
    if path.suffix.lower() != parquet.SUFFIX:
        raise UsageError("The table's name ends in .parquet.", hint="Rename it.", where=str(path))
    if not path.parent.is_dir():
        raise UsageError("The folder does not exist.", hint="Make it first.", where=str(path.parent))
    parquet.check_parquet(f"{install_hint('fleet')}.")


def write_parquet(path: Path, fleet: Fleet) -> None:
    """The rows as a table, whole or not at all: the columns of the document's rows, lists as lists of texts, a column
    `objective.NAME` and `option.NAME` for each. Raises UsageError."""
    rows = [_flat(entry, row) for entry, row in zip(_row_entries(fleet.rows), fleet.rows, strict=True)]
    parquet.write_parquet(path, rows, dict.fromkeys(name for row in rows for name in row), KIND)


_NESTED = {"objectives", "explained", "causes", "findings", "change", "off"}


def _flat(entry: RowEntry, row: Row) -> dict[str, Any]:
    main = row.main
    flat = {key: value for key, value in entry.plain().items() if key not in _NESTED}
    config = {} if row.asked is None else row.asked.config
    return {
        **flat,
        "cause": None if main is None else main.name,
        "cause_what": None if main is None else main.what,
        "cause_probability": None if main is None else six_digits(main.probability),
        "causes": [one.option for one in row.causes],
        "findings": [one.title for one in row.findings],
        "change": [f"{name}={value:g}" for name, value in row.change.items()],
        "off_reference": list(row.off),
        **{f"objective.{name}": value for name, value in row.objectives.items()},
        **{f"option.{name}": float(value) for name, value in config.items()},
    }


def short_names(rows: Sequence[Row]) -> dict[str, str]:
    """What to call each robot: as people do, where that tells all apart and is short; else by number."""
    called = {row.robot: row.called or row.robot for row in rows if row.robot}
    if len(set(called.values())) == len(called) and all(len(name) <= _LONGEST_NAME for name in called.values()):
        return called
    return {robot: f"robot {number}" for number, robot in enumerate(called, start=1)}


def run_name(log: str) -> str:
    """The name of a log without its folder."""
    return PurePosixPath(log).name if "://" in log else Path(log).name


def counted(fleet: Fleet) -> str:
    """How many logs, runs and robots there are, and how they went."""
    rows, runs = fleet.rows, [row for row in distinct(fleet.rows) if row.status != "unreadable"]
    robots = {row.robot for row in runs if row.robot}
    nameless = sum(row.robot is None for row in runs)
    went = [("fault", "with a fault"), ("ok", "fine"), ("not_evaluated", "not evaluated"), ("unreadable", "unreadable")]
    told = [f"{n} {words}" for status, words in went if (n := sum(row.status == status for row in rows))]
    of = [f"{len(robots)} robot{'s' if len(robots) != 1 else ''}"] if robots else []
    of += [f"{nameless} without a robot's name"] if nameless else []
    copies = len(copies_of(rows))
    told += [f"{copies} cop{'ies' if copies > 1 else 'y'} counted once"] if copies else []
    logs = f"{len(rows)} log{'s' if len(rows) != 1 else ''}"
    return clean(f"{logs}{f' of {listed(of)}' if of else ''}: {', '.join(told)}")


def shared_lines(fleet: Fleet, short: Mapping[str, str]) -> Iterator[str]:
    """What the rows share, in sentences of counts."""
    if not fleet.shared:
        yield f"Nothing is shared: no cause, finding or breach is on {FEWEST} robots or more."
        return
    yield "What they share"
    for one in fleet.shared[:PATTERNS]:
        yield from wrapped(_headline(one, short), "  ")
        for line in _details(one):
            yield from wrapped(line, "    ")
    if len(fleet.shared) > PATTERNS:
        yield f"  and {len(fleet.shared) - PATTERNS} more, on fewer: --json holds all"
    if any(one.others and not one.traits for one in fleet.shared[:PATTERNS]):
        yield "  Where no more is said, nothing that the logs tell sets the affected apart."


def _headline(one: Pattern, short: Mapping[str, str]) -> str:
    words = {"cause": "explains failures", "finding": "is found", "breach": "is outside its limit"}[one.kind]
    name = {"parameter": f"the parameter {one.name}"}.get(one.what, one.name) if one.kind == "cause" else one.name
    runs = f" ({one.runs} of {one.of_runs} runs)" if one.unit == "robot" and one.of_runs > one.of else ""
    on = f"on {len(one.affected)} of {one.of} {one.unit}s{runs}, {one.sort}"
    return f"{name} {words} {on}: {_names(one.affected, short)}"


def _names(names: Sequence[str], short: Mapping[str, str]) -> str:
    return first_of([_on_one_line(short.get(name, run_name(name))) for name in names], NAMED)


def _details(one: Pattern) -> Iterator[str]:
    if one.values is not None:
        others = "" if one.others_values is None else f", on the others {_range(one.others_values)}"
        yield f"it is {_range(one.values)} there{others}"
    if one.since is not None:
        yield _since(one.since)
    for trait in one.traits:
        yield _trait(trait, len(one.affected))


def _range(values: tuple[float, float]) -> str:
    low, high = values
    return f"{low:.6g}" if low == high else f"{low:.6g} to {high:.6g}"


def _since(since: Since) -> str:
    day = _day(since.start)
    if not since.earlier:
        return f"it is there from the first run with a date on, {day}"
    after = f"in {since.later_with} of {since.later} runs from then on"
    runs = f"the {since.earlier} runs" if since.earlier > 1 else "the run"
    word = "since" if since.is_sure else "first seen on"
    return f"{word} {day}: {after}, in none of {runs} before{'' if since.is_sure else _maybe(since.chance)}"


def _trait(trait: Trait, affected: int) -> str:
    others = f"of the {trait.others} others {trait.others_with or 'none'}"
    instead = f" ({', '.join(trait.instead[:3])}{', ...' if len(trait.instead) > 3 else ''})" if trait.instead else ""
    doubt = "" if trait.is_sure else _maybe(trait.chance)
    everyone = "both" if affected == FEWEST else f"all {affected}"
    return f"{everyone} have {trait.name} {trait.value}, {others}{instead}{doubt}"


def _maybe(chance: float) -> str:
    return f"; may be chance, it happens so in {chance:.0%} of such fleets"


def _day(start: str) -> str:
    found = datetime.fromisoformat(start)
    return f"{found.day} {found:%B %Y %H:%M} UTC"


def suggestion_lines(fleet: Fleet, short: Mapping[str, str]) -> Iterator[str]:
    """What is suggested to the robots of each profile, or why nothing is."""
    for one in fleet.suggestions:
        yield ""
        if isinstance(one, Silence):
            yield from wrapped(f"No change for the fleet ({one.profile}): {one.reason}")
            if one.best is not None and one.best.having("helped"):
                yield from _outlook_lines(one.best, short, ("would help", "would harm"))
            continue
        helped, unit = len(one.having("helped")), one.unit
        value = f"{one.option.show(one.value)} {one.option.unit}".rstrip()
        yield from wrapped(
            f"One change for the fleet: set {one.option.name} to {value} ({one.profile}). It would help {helped} of "
            f"the {one.failing} {unit}s that fail, and harms none that does well."
        )
        yield from _outlook_lines(one, short)


def _outlook_lines(one: Suggestion, short: Mapping[str, str], only: Collection[str] = ()) -> Iterator[str]:
    groups: tuple[tuple[str, tuple[Outlook, ...]], ...] = (
        ("would help", one.having("helped")),
        ("would not help", tuple(each for each in one.having("not helped", "has it", "unknown") if each.is_failing)),
        ("would harm", one.having("harmed")),
        ("do well, and would", one.having("unharmed")),
        ("do well with it", tuple(each for each in one.having("has it") if not each.is_failing)),
        ("do well, not known", tuple(each for each in one.having("unknown") if not each.is_failing)),
    )
    for title, outlooks in groups:
        if outlooks and (not only or title in only):
            told = [_outlook(each, short) for each in outlooks[:NAMED]]
            more = [f"{len(outlooks) - NAMED} more"] if len(outlooks) > NAMED else []
            yield from wrapped(", ".join(told + more), f"  {title:<19} ")


def _outlook(one: Outlook, short: Mapping[str, str]) -> str:
    name = _on_one_line(short.get(one.name, run_name(one.name)))
    odds = "" if one.now is None or one.then is None else f"{percent(one.now)} -> {percent(one.then)}"
    if one.effect == "has it":
        odds = "" if one.now is None else percent(one.now)
    inside = "; ".join(filter(None, (odds, one.why)))
    if not inside:
        return name
    return f"{name}\u00a0({_on_one_line(inside)})" if len(inside) < _SHORT else f"{name} ({inside})"


def _on_one_line(text: str) -> str:
    return text.replace(" ", "\u00a0")


def main_words(explained: Explained) -> str:
    """An explanation with its probability, as the table has it."""
    return f"{explained.name} ({explained.probability:.0%})"
