"""Changes and what they are predicted to bring."""

from __future__ import annotations

from collections.abc import Sequence

from textual.content import Content

from care_core.diagnose.records import Diagnosis, Fix, ObjectiveResult, Prediction
from care_core.diagnose.verdict import verdict_of
from care_core.records import Record
from care_core.run import Run
from care_core.text import clean, listed
from care_core.variables import Variable
from care_tui.basket import possible
from care_tui.render.odds import promise
from care_tui.render.rows import (
    Glyphs,
    Row,
    Rows,
    change_text,
    cut,
    heading,
    measure,
    padded,
    text,
    warning,
    without_middle,
)

BOX, BAR, PERCENT, SHORT, CHANGE, ODDS = 4, 6, 7, 22, 32, 26
"""Cells of the box, of the bar of the odds alone and of its figure, those that a short change and any take behind
the name, and all that the odds take with what they are of."""
NAME_WIDTH, SHORTEST_NAME = 26, 18
"""Cells of a name at most, and those below which it tells nothing."""
KNOWN_WIDTH = 11
"""Cells of what is known of a parameter before it is told."""


class OptionColumns(Record):
    """How the lines of the basket share their cells."""

    name: int
    odds_at: int
    """Where the odds begin."""
    is_told: bool
    """Whether there is room for what the odds are of."""

    @classmethod
    def sharing(cls, room: int, name: int, change: int) -> OptionColumns:
        """The columns in so many cells, of which the longest name and the longest change with odds take these; names
        are cut before odds are."""
        name, behind = min(name, NAME_WIDTH), max(SHORT, BOX + 2 + change + 2)
        if room >= name + behind + ODDS:
            return cls(name, min(name + max(CHANGE, behind), room - ODDS), is_told=True)
        at = room - BAR - PERCENT
        return cls(max(min(name, at - behind), min(name, SHORTEST_NAME)), at, is_told=False)


def option_change(
    option: Variable, current: float | None, is_assumed: bool, value: float | None, ticked: bool, glyphs: Glyphs
) -> Content:
    """From what to what an option is changed, and whether that needs a reboot."""
    change = change_text(option, current, is_assumed, value, glyphs)
    return change + Content.styled("  ! reboot", "$text-warning") if ticked and option.reboot_required else change


def option_item(
    option: Variable, change: Content, ticked: bool | None, alone: float | None, columns: OptionColumns, glyphs: Glyphs
) -> Content:
    """One option of the basket on one line: its box, its name, its change, and the odds of it alone.

    Args:
        ticked: None where there is nothing to tick.
    """
    box = "   " if ticked is None else "[x]" if ticked else "[ ]"
    name = without_middle(option.name, columns.name, glyphs)
    line = Content.assemble(f"{box} ", padded(name, columns.name + 2, "bold" if ticked else ""), change)
    if alone is None:
        return line
    line = cut(line, columns.odds_at - 1, glyphs)
    only_this = Content(" if only this" if columns.is_told else "")
    return line.pad_right(columns.odds_at - line.cell_length) + promise(alone, glyphs, BAR) + only_this


def outcome_rows(fix: Fix, objectives: Sequence[ObjectiveResult], glyphs: Glyphs) -> list[Row]:
    """What every objective should become, as bars of how likely each is kept."""
    if fix.changes and not fix.predicted:
        named = listed([clean(change.option.name) for change in fix.changes])
        known = " The odds are those of what explains this failure." if fix.p_fixed is not None else ""
        return [Row(Content(f"No values are predicted: the profile did not learn what {named} does.{known}"))]
    width = max((len(clean(result.variable.name)) for result in objectives), default=0)
    rows = []
    for result in objectives:
        predicted = fix.predicted.get(result.variable.name)
        outcome = (
            Content("no prediction")
            if predicted is None
            else prediction(result.variable, predicted, glyphs, is_guess=fix.is_guess)
        )
        line = Content.assemble(padded(result.variable.name, width + 2), outcome)
        if result.value is not None and result.variable.kind != "functional":
            line += Content.styled(f"  (now {measure(result.value, result.variable.unit)})", "dim")
        rows.append(Row(line, width + 2))
    return rows


def option_rows(option: Variable, notes: Sequence[str], glyphs: Glyphs) -> list[Row]:
    """What an operator has to know about the option under the cursor."""
    head = Content.assemble(text(option.name, "bold"), "  ", text(option.doc or "the profile says nothing about it"))
    rows = [Row(head, 2), Row(text(f"  {possible(option)}"), 2)]
    if option.parameters and option.parameters != (option.name,):
        rows.append(Row(text(f"  sets {', '.join(option.parameters)}"), 4))
    return rows + [warning("Caveat", note) for note in notes]


def about_rows(fix: Fix, diagnosis: Diagnosis, glyphs: Glyphs) -> list[Row]:
    """What a change is predicted to bring, and what is known of each parameter that it changes."""
    rows = [heading("Predicted with it (80% intervals)"), *outcome_rows(fix, diagnosis.objectives, glyphs)]
    for one in fix.changes:
        head, *known = known_rows(one.option, diagnosis.run)
        change = change_text(one.option, one.current, one.is_assumed, one.suggested, glyphs)
        rows += [Row(Content()), Row(Content.assemble(head.content, "  ", change), KNOWN_WIDTH), *known[:-1]]
    return rows


def known_rows(option: Variable, run: Run) -> list[Row]:
    """What is known of an option's parameter, with who says so, for the help."""
    from care_core.application.describing import known_of

    rows = [heading(option.name)]
    for one in known_of(option, run.settings, run.log.facts):
        source = text(f"  ({one.source})", "dim") if one.source else Content()
        rows.append(
            Row(Content.assemble(text(f"{one.what:<{KNOWN_WIDTH}}", "bold"), text(one.text), source), KNOWN_WIDTH)
        )
    return [*rows, Row(Content())]


def prediction(variable: Variable, predicted: Prediction, glyphs: Glyphs, *, is_guess: bool = False) -> Content:
    """`█████████░  91%  139, 131 to 150 s`: how likely the objective is kept, and the value with its interval."""
    odds = Content("odds not measured") if predicted.p_ok is None else promise(predicted.p_ok, glyphs)
    guess = Content.styled(" a guess" if is_guess else "", "$text-warning")
    if variable.kind == "functional":  # a yes-or-no objective has a probability, not a value
        return odds + guess
    span = f"  {predicted.value:.4g}, {predicted.low:.4g} to {measure(predicted.high, variable.unit)}"
    return odds + guess + text(span)


def no_fix_rows(diagnosis: Diagnosis) -> Rows:
    """Why there is no fix."""
    verdict = verdict_of(diagnosis)
    if verdict.advice.refusal:
        return Rows([Row(Content("No fix is suggested.")), warning("Reason", verdict.advice.refusal)])
    if diagnosis.faults:
        return Rows([Row(Content("No change of parameters is predicted to keep all thresholds."))])
    return Rows([Row(Content(verdict.headline)), Row(Content("No change is suggested."))])
