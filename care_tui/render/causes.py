"""Ranked causes, and the causal path of one of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from textual.content import Content

from care_core.diagnose.records import Cause, Diagnosis, ObjectiveResult, PathNode
from care_core.text import clean
from care_core.variables import Variable
from care_tui.render.fix import prediction
from care_tui.render.objectives import evidence_row, meaning
from care_tui.render.rows import (
    Glyphs,
    Row,
    Rows,
    change_text,
    heading,
    labelled,
    limit,
    measure,
    percent,
    setting,
    status,
    text,
    warning,
)

if TYPE_CHECKING:  # reading models is not needed for the first frame
    from care_core.causal.model import EffectRecord

FEW_RESAMPLES = 0.5
"""Edges that fewer bootstrap resamples hold are flagged."""


def cause_item(
    cause: Cause, share: float | None, dismissed: str | None, glyphs: Glyphs, as_driven: float | None = None
) -> tuple[Content, Content]:
    """One cause of the ranked list: the option with its change, then what it is worth, with its caveats beside it.

    Args:
        share: its probability beside whatever else may explain the failure, None where nothing else was weighed.
        as_driven: the odds that stand beside what its change promises.
    """
    option = cause.option
    head = Content.assemble(
        f"{cause.rank:>2} " if share is None else f"{percent(share):>5} ",
        text(option.name, "bold"),
        "  ",
        change_text(option, cause.current, cause.is_assumed, cause.suggested, glyphs),
    )
    below = " " * (3 if share is None else 6)
    if dismissed is not None:
        return head, Content(f"{below}set aside: " + clean(dismissed))
    worth = ["not ruled out" if cause.is_lead else f"{cause.confidence} confidence"]
    if cause.p_fixed is not None:
        without = "" if as_driven is None else f" (as driven {percent(as_driven)})"
        worth.append(f"{percent(cause.p_fixed)} if only this is changed{without}")
    caveats = "" if cause.is_lead else "".join(f"  ! {clean(note)}" for note in caveats_of(cause))
    return head, Content(below + ", ".join(worth) + caveats)


def lowers(cause: Cause) -> str:
    """What the option's value does to the run's odds."""
    points = percent(cause.contribution).removesuffix(" %")
    return f"lowers the odds by {points} point{'' if points == '1' else 's'}"


def caveats_of(cause: Cause) -> tuple[str, ...]:
    """What weakens a cause; a value outside the training support is always said, what the log says stands apart."""
    notes = tuple(note for note in cause.notes if note.kind != "in_the_log")
    texts = tuple(note.text for note in notes)
    is_said = any(note.kind == "outside_training" for note in notes)
    return texts if cause.in_support or is_said else ("outside the training support", *texts)


def path_rows(cause: Cause, objective: ObjectiveResult, glyphs: Glyphs) -> list[Row]:
    """The causal path as a vertical chain: nodes with this run's and the expected value, edges with their effect."""
    width = max(len(clean(node.name)) for node in cause.path)
    last = len(cause.path) - 1
    rows: list[Row] = []
    for place, node in enumerate(cause.path):
        sign = glyphs.down if place else glyphs.root
        line = Content.assemble(f"{sign} ", text(node.name, "bold").pad_right(width - len(clean(node.name)) + 2))
        line += text(node_value(node, cause.option if place == 0 else None))
        if place == last:
            verdict = Content.assemble("  ", status(objective.status, glyphs), "  ")
            rows += [Row(line, width + 4), Row(verdict + text(limit(objective.threshold, node.unit)), 4)]
        else:
            rows += [Row(line, width + 4), Row(edge_line(node, glyphs), 4)]
    return rows


def node_value(node: PathNode, option: Variable | None) -> str:
    """This run's value and the expected one; an option's codes and switches by their names."""
    if option is not None and option.name == node.name:
        return f"{setting(option, node.value)}  (expected {option.show(node.expected)})"
    expected = "unknown" if node.expected is None else f"{node.expected:.4g}"
    return f"{measure(node.value, node.unit)}  (expected {expected})"


def edge_line(node: PathNode, glyphs: Glyphs) -> Content:
    effect = "effect unknown" if node.effect is None else f"effect {node.effect:+.2f} sd"
    if node.support is None:
        return Content.styled(f"{glyphs.line} {effect}", "dim")
    line = Content.styled(f"{glyphs.line} {effect}, in {percent(node.support)} of resamples", "dim")
    return line + Content.styled("  ! few", "$text-warning") if node.support < FEW_RESAMPLES else line


def cause_detail(
    cause: Cause,
    rivals: Sequence[Cause],
    objective: ObjectiveResult,
    effect: EffectRecord | None,
    diagnosis: Diagnosis,
    dismissed: Mapping[str, str],
    glyphs: Glyphs,
) -> Rows:
    """Everything about one cause: its path, what the log says, what it is worth, its caveats, the runner-up.

    Where it is no more than a lead, the answer is that no cause was found: that, and what would tell more, come first.
    """
    option, evidence = cause.option, diagnosis.run.evidence
    doubt = doubt_rows(diagnosis)
    rows = [*doubt, Row(Content())] if cause.is_lead and doubt else []
    rows += [*path_rows(cause, objective, glyphs), Row(Content())]
    if option.name in dismissed:
        rows.append(warning("Set aside", dismissed[option.name]))
    alone = "" if cause.p_fixed is None else percent(cause.p_fixed)
    gain = f"; {alone} probability of no fault if only this is changed" if alone else ""
    rows.append(labelled("Confidence", f"{cause.confidence}{gain}"))
    said = [part.text + meaning(part) for part in evidence if option.name in part.options]
    rows += [labelled("" if place else "The log says", line) for place, line in enumerate(said)]
    rows += [warning("Caveat", note) for note in caveats_of(cause)]
    if not cause.is_lead:
        rows.append(labelled("Contribution", f"{lowers(cause)} of a run without a fault"))
        rows += _runner_up(cause, rivals)
    if cause.predicted is not None and cause.suggested is not None:
        change = change_text(option, cause.current, cause.is_assumed, cause.suggested, glyphs)
        rows.append(labelled("With", change + Content(": ") + prediction(objective.variable, cause.predicted, glyphs)))
    rows.append(labelled("Usual effect", _effect(cause, effect)))
    if option.parameters and option.parameters != (option.name,):
        rows.append(labelled("Parameter", ", ".join(option.parameters)))
    if option.doc:
        rows.append(labelled("About", option.doc))
    if not cause.is_lead and doubt:
        rows += [Row(Content()), *doubt]
    if evidence:
        rows += [
            Row(Content()),
            heading("Messages of this run"),
            *(evidence_row(part, option.name) for part in evidence),
        ]
    return Rows(rows)


def _runner_up(cause: Cause, rivals: Sequence[Cause]) -> list[Row]:
    other = next((rival for rival in rivals if rival.rank != cause.rank), None)
    if other is None:
        return [labelled("Runner-up", "no other parameter is under suspicion")]
    label = "Runner-up" if cause.rank == 1 else "First is"
    return [labelled(label, f"{other.option.name}, {lowers(other)}")]


def _effect(cause: Cause, effect: EffectRecord | None) -> str:
    interval = "" if effect is None else f" ({effect.low:.2f} to {effect.high:.2f})"
    return f"{cause.total_effect:.2f}{interval} standard deviations over all runs, {cause.path_ace:.2f} along this path"


def no_cause_rows(diagnosis: Diagnosis, objective: ObjectiveResult | None) -> Rows:
    """Why there is nothing to rank."""
    if objective is None:
        return Rows([labelled("No objective", "the profile declares none, so nothing can be at fault")])
    if objective.status == "ok":
        return Rows([Row(Content("Within its threshold: there is nothing to explain."))])
    if objective.status == "not_evaluated":
        return Rows([Row(Content("Not evaluated, so no cause is known.")), warning("Reason", objective.reason)])
    head = Row(Content("Outside its threshold, but no cause is named."))
    return Rows(
        [head, *(doubt_rows(diagnosis) or [warning("Reason", "no parameter of the profile explains this objective")])]
    )


def doubt_rows(diagnosis: Diagnosis) -> list[Row]:
    """Why there is no answer, what the run met that may be the cause instead, and what would tell more."""
    rows = [] if diagnosis.abstained is None else [warning("No change advised", diagnosis.abstained)]
    for title, lines in (
        ("It may not be a parameter", [f"{rival.name}: {rival.text}" for rival in diagnosis.rivals]),
        ("How to find out more", diagnosis.tell_more),
    ):
        if lines:
            rows += [heading(title), *(Row(text(f"- {line}"), 2) for line in lines)]
    return rows
