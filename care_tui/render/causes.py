"""Ranked causes, and the causal path of one of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

from textual.content import Content

from care_core.diagnose.records import Cause, Diagnosis, Hypothesis, ObjectiveResult, OutsideSuspect, PathNode
from care_core.diagnose.verdict import hypothesis_text
from care_core.ecosystems.findings import Finding
from care_core.run import gathered, shown
from care_core.text import clean, percent, seconds
from care_core.variables import Variable
from care_tui.render.fix import prediction
from care_tui.render.objectives import meaning
from care_tui.render.odds import bar, promise
from care_tui.render.rows import (
    FEW_RESAMPLES,
    Glyphs,
    Row,
    Rows,
    change_text,
    heading,
    joined,
    labelled,
    limit,
    measure,
    setting,
    status,
    text,
    warning,
)

if TYPE_CHECKING:  # reading models is not needed for the first frame
    from care_core.causal.model import EffectRecord

BAR = 8
"""Cells of the bar of a probability."""
ROOMY = 90
"""Cells from which on a line has room for how sure it is."""


def cause_item(cause: Cause, share: float | None, dismissed: str | None, glyphs: Glyphs, width: int) -> Content:
    """One cause of the ranked list on a line: how likely it is, the option with its change, and what weakens it.

    Args:
        share: its probability beside whatever else may explain the failure, None where nothing else was weighed.
    """
    option = cause.option
    change = change_text(option, cause.current, cause.is_assumed, cause.suggested, glyphs)
    line = Content.assemble(
        _share(share, glyphs), text(option.name, "bold" if dismissed is None else "dim"), "  ", change
    )
    if dismissed is not None:
        return line + text(f"  set aside: {dismissed}", "dim")
    if cause.is_lead:
        return line + Content("  not ruled out")
    sure = f"  {cause.confidence} confidence" if share is None or width > ROOMY else ""
    notes = caveats_of(cause)
    return line + Content(sure) + (Content.styled(f"  ! {clean(notes[0])}", "$text-warning") if notes else Content())


def hypothesis_item(
    one: Hypothesis, finding: Finding | None, outside: Sequence[OutsideSuspect], glyphs: Glyphs
) -> Content:
    """An explanation that is no cause of the list on a line: how likely it is, what it is, and when it began."""
    when = "" if finding is None else f"  from {seconds(finding.onset_s)}"
    suspect = next((s for s in outside if s.name == one.name), None)
    if suspect is not None:
        when = f"  {shown(suspect.value)}, {suspect.back_in_words}"
    words = hypothesis_text(one, [finding] if finding else ())
    return Content.assemble(_share(one.probability, glyphs), text(words, "bold" if one.name else ""), text(when))


def _share(share: float | None, glyphs: Glyphs) -> Content:
    """The probability as a number and a bar, or as much room."""
    if share is None:
        return Content(" " * (BAR + 7))
    return Content.assemble((f"{percent(share):>4} ", "bold"), bar(share, glyphs, BAR), "  ")


def lowers(cause: Cause) -> str:
    """What the option's value does to the run's odds."""
    points = percent(cause.contribution).removesuffix("%")
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
            rows.append(Row(line, width + 4))
    return rows


def node_value(node: PathNode, option: Variable | None) -> str:
    """This run's value and the expected one; an option's codes and switches by their names."""
    if option is not None and option.name == node.name:
        return f"{setting(option, node.value)}  (expected {option.show(node.expected)})"
    expected = "unknown" if node.expected is None else f"{node.expected:.4g}"
    return f"{measure(node.value, node.unit)}  (expected {expected})"


def evidence_rows(cause: Cause, diagnosis: Diagnosis, dismissed: Mapping[str, str]) -> list[Row]:
    """What this run shows of a cause: the parameter, what it leads to, what the log says, and what weakens it."""
    option = cause.option
    rows = [warning("Set aside", dismissed[option.name])] if option.name in dismissed else []
    first, *others = cause.path
    told = [Content.assemble(text(first.name, "bold"), " ", text(setting(option, first.value)))]
    told += [Content.assemble(text(node.name, "bold"), " ", text(node_value(node, None))) for node in others[:-1]]
    rows.append(labelled("This run", joined(told, ", ")))
    said = gathered(part for part in diagnosis.run.evidence if option.name in part.options)
    rows += [labelled("" if i else "The log says", f"{part.text}{meaning(part)}, at {seconds(part.time_s)}")
             for i, part in enumerate(said)]  # fmt: skip
    return rows + [warning("Caveat", note) for note in caveats_of(cause)]


def worth_rows(cause: Cause, result: ObjectiveResult, without: float | None, glyphs: Glyphs) -> list[Row]:
    """What a change of the option alone is predicted to bring, and how sure the cause is."""
    option = cause.option
    rows = []
    if cause.suggested is not None:
        change = change_text(option, cause.current, cause.is_assumed, cause.suggested, glyphs)
        rows.append(labelled("Change", Content.assemble(text(option.name, "bold"), " ", change)))
    if cause.p_fixed is not None:
        beside = "" if without is None else f"  without {percent(without)}"
        rows.append(labelled("Odds of it", promise(cause.p_fixed, glyphs) + Content.styled(beside, "dim")))
    if cause.predicted is not None and cause.suggested is not None:
        rows.append(
            labelled(
                "Brings",
                Content.assemble(text(f"{result.name} "), prediction(result.variable, cause.predicted, glyphs)),
            )
        )
    rows.append(labelled("Confidence", cause.confidence))
    if option.parameters and option.parameters != (option.name,):
        rows.append(labelled("Parameter", ", ".join(option.parameters)))
    return rows + ([labelled("About", option.doc)] if option.doc else [])


def statistics_rows(cause: Cause, rivals: Sequence[Cause], effect: EffectRecord | None, glyphs: Glyphs) -> list[Row]:
    """How the training runs bear a cause out."""
    rows = []
    for node, after in pairwise(cause.path):
        rows.append(Row(Content.assemble(text(f"{node.name} {glyphs.to} {after.name}  "), edge_line(node)), 4))
    if not cause.is_lead:
        rows.append(labelled("Contribution", f"{lowers(cause)} of a run without a fault"))
        rows += _runner_up(cause, rivals)
    is_learned = cause.path[0].support is not None
    return [*rows, labelled("Usual effect", _effect(cause, effect))] if is_learned else rows


def edge_line(node: PathNode) -> Content:
    if node.support is None:
        return Content("by physics")
    effect = "effect unknown" if node.effect is None else f"effect {node.effect:+.2f} sd"
    line = Content(f"{effect}, in {percent(node.support)} of resamples")
    return line + Content.styled("  ! few", "$text-warning") if node.support < FEW_RESAMPLES else line


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
