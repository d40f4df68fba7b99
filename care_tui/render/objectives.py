"""The verdict on a run: its objectives, and where the run came from."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from textual.content import Content

from care_core.diagnose.records import Diagnosis, ObjectiveResult
from care_core.diagnose.verdict import STATUS_WORDS
from care_core.run import Damage, Evidence, gathered, is_known, place_of_damage
from care_core.text import clean, percent, seconds
from care_tui.render.rows import (
    LABEL_WIDTH,
    Glyphs,
    Row,
    Rows,
    heading,
    labelled,
    measure,
    padded,
    status,
    text,
    warning,
)

if TYPE_CHECKING:  # reading models is not needed for the first frame
    from care_core.causal.model import Summary

STATUS_WIDTH = 17
VALUE_WIDTH = 11
BOUND_WIDTH = 12
STRIP_WIDTH = 42
"""Cells of the ruler at most."""
SHORTEST_REASON = 12
"""Cells below which the beginning of a reason tells nothing; it stands below in full."""


def counted(results: Sequence[ObjectiveResult]) -> str:
    """How many of all three states, so that it never reads as a false all-clear."""
    statuses = [objective.status for objective in results]
    faults, unknown = statuses.count("fault"), statuses.count("not_evaluated")
    return f"{faults} outside, {statuses.count('ok')} within, {unknown} not evaluated"


def objective_item(result: ObjectiveResult, width: int, glyphs: Glyphs, room: int, *, is_mine: bool = False) -> Content:
    """One objective on one line: status, name padded to `width`, value, threshold, whose limit it is; why, where that
    much of it has room that it tells anything."""
    variable, bound = result.variable, result.threshold
    wanted = "no threshold" if bound is None else f"{bound} {variable.unit}".rstrip()
    if result.value is None and result.need is not None:
        wanted = ""  # made for a mission that was not flown, or not to its end
    line = Content.assemble(
        status(result.status, glyphs).pad_right(STATUS_WIDTH - len(STATUS_WORDS[result.status]) - 2),
        padded(variable.name, width + 2, "bold"),
        padded("" if result.value is None else measure(result.value, variable.unit), VALUE_WIDTH),
        padded(wanted, BOUND_WIDTH),
        ("mine  " if is_mine else "", "bold $text-accent"),
    )
    return line + text(result.reason, "dim") if room - line.cell_length >= SHORTEST_REASON else line


def objective_detail(result: ObjectiveResult, summary: Summary | None, glyphs: Glyphs, room: int) -> list[Row]:
    """Why it was not evaluated, or where its value lies among the training runs, as a ruler that fits the room."""
    variable = result.variable
    rows = [labelled("About", variable.doc)] if variable.doc else []
    if result.basis:
        rows.append(labelled("Threshold", result.basis))
    if result.reason:
        rows.append(warning("Reason", result.reason))
    if result.value is None or variable.kind == "functional":
        return rows
    if summary is None:
        return [*rows, labelled("Distribution", "the profile holds none for this objective")]
    rows.append(labelled("", _strip(result, summary, glyphs, max(1, min(STRIP_WIDTH, room - LABEL_WIDTH)))))
    below = percent(summary.percentile(result.value))
    middle = measure(summary.quantiles[len(summary.quantiles) // 2], variable.unit)
    rows.append(labelled("Distribution", f"{below} of {summary.count} training runs are lower; the middle is {middle}"))
    signs = f"{glyphs.root} this run, {glyphs.line} threshold, {glyphs.done} middle half of the runs"
    return [*rows, Row(Content.styled(" " * 14 + signs, "dim"), 14)]


def _strip(result: ObjectiveResult, summary: Summary, glyphs: Glyphs, width: int) -> Content:
    """The training runs from least to most as a line, with this run's value and the threshold on it."""
    assert result.value is not None
    quantiles, bound = summary.quantiles, result.threshold
    marks = [result.value] if bound is None else [result.value, bound.bound]
    low, high = min(quantiles[0], *marks), max(quantiles[-1], *marks)

    def place(value: float) -> int:
        return round((value - low) / ((high - low) or 1.0) * (width - 1))

    cells = [" "] * width
    for start, end, sign in ((0, -1, glyphs.rule), (len(quantiles) // 4, 3 * len(quantiles) // 4, glyphs.done)):
        first, last = place(quantiles[start]), place(quantiles[end])
        cells[first : last + 1] = sign * (last + 1 - first)
    if bound is not None:
        cells[place(bound.bound)] = glyphs.line
    cells[place(result.value)] = glyphs.root
    return Content("".join(cells))


def run_rows(diagnosis: Diagnosis) -> Rows:
    """Where the run came from, which profile judged it, and everything that limits the answer."""
    log, mission, profile = diagnosis.run.log, diagnosis.run.mission, diagnosis.profile
    start = log.start or "no wall clock"
    rows = [
        heading("This run"),
        labelled("Log", log.path),
        labelled("", f"{log.format}, {start}, {seconds(log.duration_s)}"),
    ]
    if mission.count:
        span = f"from {seconds(mission.start_s)} to {seconds(mission.end_s)} of the log"
        rows.append(labelled(diagnosis.run.noun.capitalize(), f"{mission.index} of {mission.count}, {span}"))
    if profile.name:
        rows.append(labelled("Profile", f"{profile.title} {profile.version} ({profile.platform})"))
        rows.append(labelled("", profile.reason))
    if diagnosis.abstained:
        rows.append(warning("No change advised", diagnosis.abstained))
    if not mission.ended:
        rows.append(warning("Mission", "the log stops before the mission does"))
    if mission.mismatch:
        rows.append(warning("Mission", mission.mismatch))
    if profile.fit.verdict != "no":  # then it stands above, on the pane of what happened
        rows += [warning("Profile", line) for line in profile.fit.reasons]
    rows += [warning("Damage", damage(part)) for part in log.damage]
    rows += [warning("Note", line) for line in diagnosis.notes]
    rows += [labelled("ROS" if key == "ros" else key.capitalize(), value) for key, value in log.facts.items()]
    context = {name: value for name, value in diagnosis.run.context.items() if is_known(value)}
    if context:
        rows.append(labelled("Met", ", ".join(f"{name} {value:.4g}" for name, value in context.items())))
    if diagnosis.run.evidence:
        rows += [heading("Messages of this run"), *map(evidence_row, gathered(diagnosis.run.evidence))]
    return Rows(rows)


def damage(part: Damage) -> str:
    """What is broken, and where."""
    return part.what + place_of_damage(part.what, part.byte, part.time_s, seconds)


def evidence_row(part: Evidence) -> Row:
    """A message of the log."""
    head = f"{seconds(part.time_s):>9}  {clean(part.kind):<9} "
    return Row(Content.assemble(head, text(part.text + meaning(part))), len(head))


def meaning(part: Evidence) -> str:
    """What the profile says that a message means."""
    return f" ({part.says})" if part.says else ""
