"""`care.verify/1`: what became of a report's promise, for other programs and for people."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Final, Literal

from care_core.diagnose.records import ObjectiveResult
from care_core.diagnose.verdict import STATUS_WORDS, beside
from care_core.diagnose.verify import (
    NOT_HELD,
    Made,
    MadeChange,
    ObjectiveCheck,
    Outcome,
    PromisedSet,
    ReportedObjective,
    ReportedPromise,
    Verification,
    VerifyVerdict,
)
from care_core.errors import ExitCode, UsageError
from care_core.metadata.causal_map import FROM_FLIGHTS, OF_THIS_VEHICLE
from care_core.profile.schema import Schema
from care_core.records import field
from care_core.report.document import (
    ObjectiveEntry,
    ProfileEntry,
    TriageDocument,
    known_number,
    number_shown,
    objective_entry,
    plain_number,
)
from care_core.report.published import Document, publish, publishable
from care_core.report.reading import profile_of
from care_core.report.suggested import fix_sets, suggested_changes
from care_core.run import Run
from care_core.text import WIDTH, clean, percent, wrapped
from care_core.variables import Threshold

SCHEMA_ID: Final = "care.verify/1"

EXIT_CODES: Mapping[VerifyVerdict, ExitCode] = {
    "fixed_as_promised": ExitCode.OK,
    "fixed_although": ExitCode.OK,
    "not_fixed": ExitCode.FAULT,
    "change_not_made": ExitCode.FAULT,
    "cannot_tell": ExitCode.NOT_EVALUATED,
}

_MADE_WORDS: Mapping[Made, str] = {
    "made": "made",
    "not_made": "NOT MADE",
    "other_value": "OTHER VALUE",
    "unknown": "NOT IN THE LOG",
}


class VerifiedLog(Document, kw_only=True):
    path: str
    sha256: str
    start: str | None


class CheckedChange(Document, kw_only=True):
    """`driven` is the next run's value, null where the log does not hold it."""

    option: str
    from_: int | float | None = field(name="from")
    """None where the vehicle had what is not a number."""
    to: int | float
    driven: int | float | None
    made: Made
    note: str


class OtherChangeEntry(Document, kw_only=True):
    option: str
    from_: int | float = field(name="from")
    to: int | float


class Interval(Document, kw_only=True):
    low: float
    high: float


class CheckedObjective(Document, kw_only=True):
    """An objective in both runs; `inside` says whether the outcome lies in the promised 80% interval."""

    before: ObjectiveEntry
    after: ObjectiveEntry
    outcome: Outcome
    promised: Interval | None
    inside: bool | None


class VerifyDocument(Document, kw_only=True):
    """Whether the fix of a report did what it promised, as `care verify --json` prints it."""

    schema_: Literal["care.verify/1"] = field(default=SCHEMA_ID, name="schema")
    profile: ProfileEntry
    report_log: VerifiedLog
    log: VerifiedLog
    verdict: VerifyVerdict
    sentence: str
    triage: str
    """What `care triage` says of the run."""
    alternative: int
    """0: the suggested set of changes; else the number of the alternative that was made instead."""
    p_fixed: float | None
    """Null where the report gave no odds."""
    odds_as_driven: float | None = None
    """What the report gave the same run without the change."""
    worked: bool | None
    """Whether the promised change repaired the run; null where it was not made, or nobody can tell."""
    changes: list[CheckedChange]
    other_changes: list[OtherChangeEntry]
    objectives: list[CheckedObjective]
    notes: list[str]


def promise_of(report: TriageDocument, schema: Schema, path: Path) -> ReportedPromise:
    """What a report said and promised of the parameters of its profile.

    Raises:
        UsageError: it suggests no change.
        ConfigError: what it suggests is of no parameter of the profile.
    """
    if report.fix is None:
        why = report.abstained or "every objective was within its threshold"
        raise UsageError(f"The report suggests no change, so nothing was promised: {clean(why)}.")
    return ReportedPromise(
        sha256=report.log.sha256,
        start=report.log.start,
        version=profile_of(report).version,
        config={name: float(value) for name, value in report.config.items()},
        objectives={
            one.name: ReportedObjective(
                one.value,
                one.status,
                Threshold(one.threshold.op, one.threshold.value) if one.threshold else None,
                one.needs.value if one.needs else None,
            )
            for one in report.objectives
        },
        sets=tuple(
            PromisedSet(
                {
                    one.option.name: (one.before, one.value)
                    for one in suggested_changes(fix, schema, path, key, FROM_FLIGHTS | OF_THIS_VEHICLE)
                },
                fix.odds,
                {name: (predicted.low, predicted.high) for name, predicted in fix.predicted.items()},
            )
            for key, fix in fix_sets(report.fix)
        ),
        format=report.log.format,
        frame=report.log.frame,
        robot=report.log.robot,
        context={name: value for name, value in report.context.items() if value is not None},
    )


def verify_document(report: TriageDocument, run: Run, found: Verification) -> VerifyDocument:
    """The document of a report and what became of its promise in a later run."""
    before = {one.name: one for one in report.objectives}
    return VerifyDocument(
        profile=profile_of(report),
        report_log=publish(VerifiedLog, report.log),
        log=publish(VerifiedLog, run.log),
        verdict=found.verdict,
        sentence=clean(found.sentence),
        alternative=found.chosen,
        p_fixed=found.p_fixed,
        odds_as_driven=report.odds_as_driven,
        worked=found.worked,
        triage=found.headline,
        changes=[_change(change) for change in found.changes],
        other_changes=[
            OtherChangeEntry(option=o.option.name, from_=plain_number(o.before), to=plain_number(o.driven))
            for o in found.others
        ],
        objectives=[_objective(check, before.get(check.variable.name)) for check in found.objectives],
        notes=publishable(found.notes),
    )


def _change(change: MadeChange) -> CheckedChange:
    return CheckedChange(
        option=change.option.name,
        from_=known_number(change.before),
        to=plain_number(change.wanted),
        driven=None if change.driven is None else plain_number(change.driven),
        made=change.made,
        note=clean(change.note),
    )


def _objective(check: ObjectiveCheck, before: ObjectiveEntry | None) -> CheckedObjective:
    if before is None:
        reason = "the report does not name it"
        before = objective_entry(ObjectiveResult(check.variable, None, None, NOT_HELD.status, reason))
    interval = None if check.interval is None else Interval(low=check.interval[0], high=check.interval[1])
    return CheckedObjective(
        before=before,
        after=objective_entry(check.after),
        outcome=check.outcome,
        promised=interval,
        inside=check.inside,
    )


def verify_text(document: VerifyDocument, width: int = WIDTH) -> str:
    """The verification in lines of at most `width` columns: the verdict, the changes, the objectives."""
    head = [("", document.sentence), ("", ""), *_head(document), ("", "")]
    lines = [line for first, text in head for line in wrapped(text, first, width=width) or [""]]
    lines += [_changes_title(document)]
    for text in (*map(_change_line, document.changes), *map(_other_line, document.other_changes)):
        lines += wrapped(text, "  ", " " * 18, width)
    lines += ["", "Objectives"]
    names = max((len(one.after.name) for one in document.objectives), default=0)
    for one in document.objectives:
        shown = f"{STATUS_WORDS[one.after.status]:<13}  {one.after.name:<{names}}  {_outcome(one)}"
        lines += wrapped(shown, "  ", " " * 17, width)
        lines += wrapped(one.after.reason, " " * 17, width=width) if one.after.reason else []
    return "\n".join(lines) + "\n"


def _head(document: VerifyDocument) -> Iterator[tuple[str, str]]:
    yield "Report  ", f"{Path(document.report_log.path).name}, profile {document.profile.name}"
    yield "Log     ", Path(document.log.path).name
    yield "Triage  ", document.triage
    yield from (("  ! ", note) for note in document.notes)


def _changes_title(document: VerifyDocument) -> str:
    which = f" of alternative {document.alternative}" if document.alternative else ""
    odds = document.p_fixed
    promised = "odds not measured" if odds is None else f"promised at {percent(odds)}{beside(document.odds_as_driven)}"
    return f"Changes{which} ({promised})"


def _change_line(change: CheckedChange) -> str:
    driven = "" if change.driven is None or change.made == "made" else f" ({change.driven:g} was driven)"
    note = f"; {change.note}" if change.note else ""
    return (
        f"{_MADE_WORDS[change.made]:<14}  {change.option}  {number_shown(change.from_)} -> {change.to:g}{driven}{note}"
    )


def _other_line(other: OtherChangeEntry) -> str:
    return f"also changed    {other.option}  {other.from_:g} -> {other.to:g}"


def _outcome(one: CheckedObjective) -> str:
    unit = one.after.unit
    values = " -> ".join("-" if value is None else f"{value:.4g}" for value in (one.before.value, one.after.value))
    parts = [f"{values} {unit}".rstrip(), one.outcome]
    if one.promised is not None and one.after.kind == "non-functional":
        where = {True: "inside", False: "outside", None: "promised"}[one.inside]
        parts.append(f"{where} {one.promised.low:.4g} to {one.promised.high:.4g} {unit}".rstrip())
    return ", ".join(parts)
