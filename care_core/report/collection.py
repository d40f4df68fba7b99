"""What `care collect` says at its end: for other programs (`care.collect/1`) and for people."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final, Literal

from care_core.records import field
from care_core.report.published import Document
from care_core.text import clean, number_of, wrapped

SCHEMA_ID: Final = "care.collect/1"

_MOST_FAILURES = 10


class VariedOption(Document, kw_only=True):
    option: str
    low: float
    high: float
    reference: float


class LeftOutOption(Document, kw_only=True):
    option: str
    reason: str


class CollectedRun(Document, kw_only=True):
    run: int
    repeats: int | None
    """The run whose configuration it repeats."""
    status: Literal["done", "failed", "planned"]
    attempts: int
    time_s: float
    logs: list[str]
    missions: int
    reason: str
    """Why it failed, else ''."""
    unread: list[str]
    ignored: list[str]
    """Options that the log says were driven otherwise than asked."""


class CollectDocument(Document, kw_only=True):
    """A campaign as it stands, as `care collect --json` prints it."""

    schema_: Literal["care.collect/1"] = field(default=SCHEMA_ID, name="schema")
    campaign: str
    profile: str
    sampling: str
    seed: int
    planned: int
    done: int
    failed: int
    resumed: int
    """Runs that an earlier call had made."""
    stopped: str
    """Why it stopped before its end, else ''."""
    table: str | None
    missions: int
    missed: dict[str, int]
    """Per objective with a fixed threshold, the missions that missed it."""
    options: list[VariedOption]
    left_out: list[LeftOutOption]
    limits: list[str]
    runs: list[CollectedRun]


def collect_text(document: CollectDocument) -> str:
    """The campaign in lines."""
    return "\n".join(line for part in _lines(document) for line in part) + "\n"


def _lines(document: CollectDocument) -> Iterator[Sequence[str]]:
    resumed = f", {document.resumed} of them before" if document.resumed else ""
    runs = f"{document.done} of {document.planned} runs have a log that could be read{resumed}"
    failed = f", {document.failed} failed" if document.failed else ""
    yield tuple(wrapped(f"{runs}{failed}", "Runs      ", "          "))
    repeats = sum(run.repeats is not None and run.status == "done" for run in document.runs)
    yield tuple(wrapped(f"{document.missions}, {repeats} of them repeat a configuration", "Missions  "))
    if document.missions:
        for name, count in document.missed.items():
            yield (f"Missed    {name} in {count} ({count / document.missions:.0%})",)
    if document.stopped:
        yield tuple(wrapped(document.stopped, "Stopped   ", "          "))
    failures = [run for run in document.runs if run.status == "failed"]
    for run in failures[:_MOST_FAILURES]:
        yield tuple(wrapped(f"run {run.run}: {run.reason}", "Failed    ", "          "))
    if len(failures) > _MOST_FAILURES:
        yield (f"          and {len(failures) - _MOST_FAILURES} more, see --json",)
    ignored = sorted({name for run in document.runs for name in run.ignored})
    if ignored:
        count = sum(bool(run.ignored) for run in document.runs)
        told = f"{', '.join(ignored)}: not driven as asked in {number_of(count, 'run')}; the table has what was driven"
        yield tuple(wrapped(told, "Ignored   ", "          "))
    for reason in [reason for run in document.runs for reason in run.unread][:_MOST_FAILURES]:
        yield tuple(wrapped(clean(reason), "Unread    ", "          "))
    if document.table is not None:
        yield (f"Table     {clean(document.table)}",)
