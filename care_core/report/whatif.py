"""A what-if answer for other programs (`care.whatif/1`) and for people."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Final, Literal

from care_core.diagnose.verdict import chance, fit_text
from care_core.diagnose.whatif import Answer, Outlook, Over, Question
from care_core.numbers import six_digits
from care_core.records import field
from care_core.report.document import (
    ObjectiveEntry,
    PredictedObjective,
    ProfileEntry,
    estimate,
    objective_entry,
    plain_number,
    predicted_objective,
)
from care_core.report.published import Document, publish, publishable
from care_core.run import Fit
from care_core.text import clean, listed, percent, wrapped

SCHEMA_ID: Final = "care.whatif/1"


class AskedChange(Document, kw_only=True):
    option: str
    from_: int | float = field(name="from")
    to: int | float
    assumed: bool
    """Whether no source holds `from`."""
    notes: list[str]


class OutlookEntry(Document, kw_only=True):
    objective: ObjectiveEntry
    predicted: PredictedObjective | None
    p_ok: float | None
    p_ok_unchanged: float | None


class ValueEntry(Document, kw_only=True):
    """What one value of an option would bring."""

    value: int | float
    p_ok: float
    guess: bool
    objectives: dict[str, float | None]
    """Probability that each is met."""


class OverEntry(Document, kw_only=True):
    """What the values of one option would bring, from one end of its range to the other."""

    option: str
    unit: str
    current: int | float
    values: list[ValueEntry]


class WhatIfDocument(Document, kw_only=True):
    """The predicted outcome of this run under changed options, as `care whatif --json` prints it."""

    schema_: Literal["care.whatif/1"] = field(default=SCHEMA_ID, name="schema")
    fit: Fit
    profile: ProfileEntry
    log: str
    changes: list[AskedChange]
    objectives: list[OutlookEntry]
    p_ok: float
    guess: bool
    """Whether a value is one that no training run came near."""
    p_ok_unchanged: float
    lost_by: list[str] = field(default_factory=list)
    """What this run was lost by: the probabilities are those of a run that it does not happen to."""
    over: OverEntry | None = None
    """Of one option many values, beside the changes; None where that was not asked."""


def whatif_document(question: Question, answer: Answer, over: Over | None = None) -> WhatIfDocument:
    """The answer as a document, with that for the values of one option where it was asked."""
    return WhatIfDocument(
        fit=publish(Fit, question.profile.fit),
        profile=publish(ProfileEntry, question.profile),
        log=clean(question.run.log.path),
        changes=[
            AskedChange(
                option=change.option.name,
                from_=plain_number(change.current),
                to=plain_number(change.suggested),
                assumed=change.is_assumed,
                notes=publishable(change.notes),
            )
            for change in answer.changes
        ],
        objectives=[
            OutlookEntry(
                objective=objective_entry(outlook.objective),
                predicted=predicted_objective(outlook.predicted),
                p_ok=estimate(outlook.predicted.p_ok),
                p_ok_unchanged=estimate(outlook.now.p_ok),
            )
            for outlook in answer.outlooks
        ],
        p_ok=six_digits(answer.p_ok),
        guess=answer.is_guess,
        p_ok_unchanged=six_digits(answer.p_ok_now),
        lost_by=publishable(question.lost_by),
        over=None if over is None else _over_entry(over),
    )


def _over_entry(over: Over) -> OverEntry:
    entries = [
        ValueEntry(
            value=plain_number(value),
            p_ok=six_digits(answer.p_ok),
            guess=answer.is_guess,
            objectives={one.objective.variable.name: estimate(one.predicted.p_ok) for one in answer.outlooks},
        )
        for value, answer in over.answers
    ]
    option = over.option
    return OverEntry(option=option.name, unit=option.unit, current=plain_number(over.current), values=entries)


def whatif_text(question: Question, answer: Answer, over: Over | None = None) -> str:
    """The answer in lines: what is changed, then each objective, then the values of one option."""
    lines = [*_head(question)]
    lines += _predicted(question, answer) if answer.changes or over is None else ()
    lines += _over(over) if over is not None else ()
    return "\n".join(lines) + "\n"


def _over(over: Over) -> Iterator[str]:
    """A line for each value: the odds of all objectives, then of each."""
    option = over.option
    names = [one.objective.variable.name for one in over.answers[0][1].outlooks]
    shown = [option.show(value) for value, _ in over.answers]
    width = max(len(word) for word in (option.name, *shown))
    yield ""
    yield from wrapped(f"Odds by the value of {option.name}" + (f", in {option.unit}" if option.unit else ""))
    yield f"{option.name:>{width}}   all  {'  '.join(names)}"
    for word, (value, answer) in zip(shown, over.answers, strict=True):
        each = (
            f"{'?' if one.predicted.p_ok is None else percent(one.predicted.p_ok):>{len(name)}}"
            for name, one in zip(names, answer.outlooks, strict=True)
        )
        said = "  as driven" if value == over.current else "  a guess: no training run came near" * answer.is_guess
        yield f"{word:>{width}} {percent(answer.p_ok):>5}  {'  '.join(each)}{said}"


def _head(question: Question) -> Iterator[str]:
    yield from wrapped(fit_text(question.profile.title, question.profile.fit))
    log = Path(question.run.log.path).name
    yield from wrapped(f"{log}, profile {question.profile.name} {question.profile.version}", "Log  ")


def _predicted(question: Question, answer: Answer) -> Iterator[str]:
    yield ""
    for change in answer.changes:
        option = change.option
        values = f"{change.values} {option.unit}".rstrip()
        # Whoever reads the value must not miss what speaks against it.
        yield from wrapped("; ".join((f"{option.name}  {values}", *change.notes)), "", "  ")
    yield ""
    width = max((len(outlook.objective.variable.name) for outlook in answer.outlooks), default=0)
    for outlook in answer.outlooks:
        yield from wrapped(_outlook(outlook, answer.is_guess), f"{outlook.objective.variable.name:<{width}}  ")
    if any(o.objective.variable.kind == "functional" and o.predicted.status() == "fault" for o in answer.outlooks):
        yield from wrapped("The mission is likely to fail; the other values are those of one that succeeds.")
    yield ""
    yield from wrapped(
        f"{chance(answer.p_ok, answer.is_guess)} that all objectives are met with the change, "
        f"{percent(answer.p_ok_now)} without it"
        + (f", unless it happens again: {clean(listed(question.lost_by))}" if question.lost_by else "")
    )


def _outlook(outlook: Outlook, is_guess: bool) -> str:
    result, predicted = outlook.objective, outlook.predicted
    unit = result.variable.unit
    probability = "" if predicted.p_ok is None else chance(predicted.p_ok, is_guess)
    unchanged = "" if outlook.now.p_ok is None else f" ({percent(outlook.now.p_ok)} without the change)"
    if result.variable.kind == "functional":
        went = {"fault": "failed; would succeed", "ok": "succeeded; would again", "not_evaluated": "would succeed"}
        return f"{went[result.status]} with {probability}{unchanged}"
    here = "not evaluated" if result.value is None else f"{result.value:.4g}"
    span = f"{predicted.value:.4g} ({predicted.low:.4g} to {predicted.high:.4g}) {unit}".rstrip()
    bound = "" if result.threshold is None else f", wanted {result.wanted}, "
    return f"{here} in this run -> {span}{bound}{probability}{unchanged}"
