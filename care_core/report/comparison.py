"""Two runs side by side, `care.compare/1`: for other programs, for a terminal, for a ticket and as a page."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Final, Literal

from care_core.diagnose.comparison import Comparison, Departure, EventPair, start_s
from care_core.diagnose.records import Diagnosis
from care_core.diagnose.verdict import STATUS_WORDS, RunStatus, verdict_of
from care_core.ecosystems.findings import Severity
from care_core.numbers import six_digits
from care_core.records import field
from care_core.report.document import ObjectiveEntry, ParameterChangeEntry, objective_entry
from care_core.report.markdown import escaped
from care_core.report.published import Document, publish, publishable
from care_core.report.wording import SEVERITY_WORDS
from care_core.run import shown
from care_core.text import WIDTH, clean, figures, log_time, wrapped

SCHEMA_ID: Final = "care.compare/1"
PARAMETERS_SHOWN, MEASURES_SHOWN, EVENTS_SHOWN, FINDINGS_SHOWN = 20, 12, 24, 12
"""Rows of a table for people; the document holds all."""
_NOTHING = "-"


class SideEntry(Document, kw_only=True):
    """One of the two runs. `start_s` of its log is the second 0 of the comparison."""

    log: str
    format: str
    profile: str | None
    start_s: float
    duration_s: float
    status: RunStatus
    headline: str


class ObjectivePairEntry(Document, kw_only=True):
    """An objective in both runs, null in one that has no such objective."""

    name: str
    a: ObjectiveEntry | None
    b: ObjectiveEntry | None


class MeasurePairEntry(Document, kw_only=True):
    name: str
    role: Literal["context", "metric"]
    unit: str
    a: float
    b: float
    distance: float | None
    """How far apart, in standard deviations of the profile's training runs; null where there are none."""


class EventPairEntry(Document, kw_only=True):
    """Something that happened, in seconds from the start of each run's mission, null in a run where it did not."""

    what: str
    a_s: float | None
    b_s: float | None
    differs: bool


class FindingPairEntry(Document, kw_only=True):
    title: str
    severity: Severity
    a_s: float | None
    b_s: float | None


class DepartureEntry(Document, kw_only=True):
    """A signal that goes apart from `time_s` on, for two seconds at least by a third of what it ranges over."""

    signal: str
    unit: str
    time_s: float
    a: float
    b: float


class CompareDocument(Document, kw_only=True):
    """Two runs side by side, as `care compare --json` prints them; A is the one to compare with."""

    schema_: Literal["care.compare/1"] = field(default=SCHEMA_ID, name="schema")
    a: SideEntry
    b: SideEntry
    warnings: list[str]
    """Why they may not be comparable."""
    first: str
    """What differs first after the start, in a sentence; empty where nothing does."""
    parameters: list[ParameterChangeEntry]
    """From A to B, options of the profile first."""
    objectives: list[ObjectivePairEntry]
    departures: list[DepartureEntry]
    events: list[EventPairEntry]
    measures: list[MeasurePairEntry]
    """The most different first."""
    findings: list[FindingPairEntry]


def compare_document(found: Comparison) -> CompareDocument:
    """The document of a comparison. Texts are cleaned."""
    return CompareDocument(
        a=_side(found.a),
        b=_side(found.b),
        warnings=publishable(found.warnings),
        first=_first(found.events, found.departures),
        parameters=[
            ParameterChangeEntry(
                parameter=clean(one.parameter),
                option=None if one.option is None else one.option.name,
                from_=publishable(one.before),
                to=publishable(one.after),
            )
            for one in found.parameters
        ],
        objectives=[
            ObjectivePairEntry(
                name=one.variable.name,
                a=None if one.a is None else objective_entry(one.a),
                b=None if one.b is None else objective_entry(one.b),
            )
            for one in found.objectives
        ],
        departures=[publish(DepartureEntry, one) for one in found.departures],
        events=[publish(EventPairEntry, one, differs=one.differs) for one in found.events],
        measures=[
            MeasurePairEntry(
                name=one.variable.name,
                role="context" if one.variable.role == "context" else "metric",
                unit=one.variable.unit,
                a=six_digits(one.a),
                b=six_digits(one.b),
                distance=None if one.distance is None else six_digits(one.distance),
            )
            for one in found.measures
        ],
        findings=[publish(FindingPairEntry, one) for one in found.findings],
    )


def _side(diagnosis: Diagnosis) -> SideEntry:
    run, verdict = diagnosis.run, verdict_of(diagnosis)
    mission = run.mission
    lasted_s = mission.end_s - mission.start_s if mission.end_s > mission.start_s else run.log.duration_s
    return SideEntry(
        log=clean(run.log.path),
        format=run.log.format,
        profile=diagnosis.profile.name or None,
        start_s=start_s(run),
        duration_s=lasted_s,
        status=verdict.status,
        headline=verdict.headline,
    )


def _first(events: Sequence[EventPair], departures: Sequence[Departure]) -> str:
    """What differs first: an event, or a signal that goes apart."""
    event = next((one for one in events if one.differs), None)
    signal = next(iter(departures), None)
    if signal is not None and (event is None or signal.time_s <= event.at_s):
        one, other = (f"{figures(value)} {signal.unit}".rstrip() for value in (signal.a, signal.b))
        return clean(f"at {log_time(signal.time_s)} {signal.signal} goes apart: {one} in A, {other} in B")
    if event is None:
        return ""
    if event.a_s is None or event.b_s is None:
        return clean(f"at {log_time(event.at_s)} only {'B' if event.a_s is None else 'A'}: {event.what}")
    return clean(f"{event.what}: at {log_time(event.a_s)} in A, at {log_time(event.b_s)} in B")


Row = tuple[str, ...]


class Section(Document, kw_only=True):
    """A table of the comparison as people read it. Without rows it says nothing."""

    title: str
    header: Row
    rows: list[Row]
    more: int = 0
    """Rows that are left out."""


def sections_of(document: CompareDocument) -> list[Section]:
    """The tables, in the order told; none that is empty."""
    found = [
        _section("Parameters that differ", ("", "A", "B"), _parameters(document), PARAMETERS_SHOWN),
        _section("Objectives", ("", "A", "B"), _objectives(document), PARAMETERS_SHOWN),
        _section("Signals that diverge", ("", "at", "A", "B"), _departures(document), PARAMETERS_SHOWN),
        _section("What happened, seconds from the start", ("", "A", "B"), _events(document), EVENTS_SHOWN),
        _section("Measures, the most different first", ("", "A", "B", "apart"), _measures(document), MEASURES_SHOWN),
        _section("Findings", ("", "A", "B"), _findings(document), FINDINGS_SHOWN),
    ]
    return [section for section in found if section.rows]


def _section(title: str, header: Row, rows: Iterable[Row], most: int) -> Section:
    found = list(rows)
    return Section(title=title, header=header, rows=found[:most], more=max(len(found) - most, 0))


def _parameters(document: CompareDocument) -> Iterator[Row]:
    for one in document.parameters:
        name = f"{one.parameter} ({one.option})" if one.option and one.option != one.parameter else one.parameter
        yield name, shown(one.from_), shown(one.to)


def _objectives(document: CompareDocument) -> Iterator[Row]:
    for one in document.objectives:
        yield one.name, _judged(one.a), _judged(one.b)


def _judged(one: ObjectiveEntry | None) -> str:
    if one is None:
        return _NOTHING
    value = "" if one.value is None or one.kind == "functional" else f" {one.measured}"
    return f"{STATUS_WORDS[one.status]}{value}"


def _departures(document: CompareDocument) -> Iterator[Row]:
    for one in document.departures:
        yield one.signal, log_time(one.time_s), figures(one.a), f"{figures(one.b)} {one.unit}".rstrip()


def _events(document: CompareDocument) -> Iterator[Row]:
    for one in document.events:
        yield one.what, _time(one.a_s), _time(one.b_s)


def _time(time_s: float | None) -> str:
    return _NOTHING if time_s is None else log_time(time_s)


def _measures(document: CompareDocument) -> Iterator[Row]:
    for one in document.measures:
        apart = "" if one.distance is None else f"{one.distance:.1f} sd"
        yield one.name, figures(one.a), f"{figures(one.b)} {one.unit}".rstrip(), apart


def _findings(document: CompareDocument) -> Iterator[Row]:
    for one in document.findings:
        yield f"{SEVERITY_WORDS[one.severity]}: {one.title}", _time(one.a_s), _time(one.b_s)


def head_of(document: CompareDocument) -> Iterator[tuple[str, str]]:
    """Which runs, how they went, and what differs first: a word and a sentence each."""
    for name, side in (("A", document.a), ("B", document.b)):
        yield name, f"{Path(side.log).name}, {log_time(side.duration_s)}: {side.headline}"
    if document.first:
        yield "First", document.first
    for warning in document.warnings:
        yield "Note", warning


def comparison_text(document: CompareDocument, width: int = WIDTH) -> str:
    """Lines of at most `width` columns."""
    lines = [line for word, text in head_of(document) for line in wrapped(text, f"{word:<7}", width=width)]
    for section in sections_of(document):
        lines += ["", section.title, *_columns(section, width)]
    return "\n".join(lines) + "\n"


_NARROW = 14
"""Least columns of a value beside a name."""


def _columns(section: Section, columns: int) -> Iterator[str]:
    """A table in text: names that are too long go on below, values stand under each other."""
    values = [max(len(row[i]) for row in (section.header, *section.rows)) for i in range(1, len(section.header))]
    room = max(columns - 2 - sum(values) - 2 * len(values), _NARROW)
    width = min(max(len(row[0]) for row in section.rows), room)
    for row in (section.header, *section.rows):
        first, *rest = wrapped(row[0], "  ", "    ", width + 2) or ["  "]
        cells = "  ".join(f"{cell:<{wide}}" for cell, wide in zip(row[1:], values, strict=True))
        yield f"{first:<{width + 2}}  {cells}".rstrip()
        yield from rest
    if section.more:
        yield f"  and {section.more} more"


def comparison_markdown(document: CompareDocument) -> str:
    """A post for a ticket or a forum: short tables, nothing of a log is markup."""
    lines = [f"# Comparison of {escaped(Path(document.a.log).name)} and {escaped(Path(document.b.log).name)}", ""]
    lines += [f"- **{word}** {escaped(text)}" for word, text in head_of(document)]
    for section in sections_of(document):
        lines += ["", f"## {section.title}", "", _line(section.header), _line(("---",) * len(section.header))]
        lines += [_line(map(escaped, row)) for row in section.rows]
        if section.more:
            lines += ["", f"and {section.more} more"]
    return "\n".join(lines) + "\n"


def _line(cells: Iterable[str]) -> str:
    return f"| {' | '.join(cells)} |"


WRITERS: dict[str, Callable[[CompareDocument], str]] = {
    "text": comparison_text,
    "json": CompareDocument.to_json,
    "markdown": comparison_markdown,
}
"""The formats that need nothing drawn."""
