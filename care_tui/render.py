"""care_core values -> rows of styled text. Pure: no widget, no file, no state.

Text that came from a log or a profile goes through `clean` and becomes `Content`, which never reads markup.
Colours are theme variables and always come with a word or a sign.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from rich.segment import Segment
from textual.content import Content
from textual.css.styles import RulesMap
from textual.strip import Strip
from textual.style import Style
from textual.visual import RenderOptions, Visual

from care_core.diagnose.records import (
    Cause,
    Change,
    Diagnosis,
    Fix,
    ObjectiveResult,
    PathNode,
    Prediction,
    Status,
)
from care_core.errors import CareError
from care_core.run import Damage, Evidence
from care_core.text import clean
from care_core.variables import Threshold, Variable

LABEL_WIDTH = 14
PROGRESS_WIDTH = 40
FEW_RESAMPLES = 0.5
"""Edges that fewer bootstrap resamples hold are flagged."""


@dataclass(frozen=True, slots=True)
class Glyphs:
    """Every character outside ASCII that the app draws with, chosen here and nowhere else."""

    ok: str
    fault: str
    unknown: str
    here: str
    to: str
    root: str
    line: str
    down: str
    done: str
    ahead: str


UNICODE = Glyphs(ok="✓", fault="✗", unknown="?", here="▸", to="→", root="●", line="│", down="▼", done="█", ahead="░")
ASCII = Glyphs(ok="+", fault="x", unknown="?", here=">", to="->", root="*", line="|", down="v", done="#", ahead=".")

WORDS: dict[Status, str] = {"ok": "OK", "fault": "FAULT", "not_evaluated": "NOT EVALUATED"}
_COLOURS: dict[Status, str] = {"ok": "$text-success", "fault": "bold $text-error", "not_evaluated": "$text-warning"}


class Row(NamedTuple):
    """One line of text; where it is too long, the next lines start `indent` cells in."""

    content: Content
    indent: int = 0


class Rows(Visual):
    """Rows as Textual draws them, wrapped with a hanging indent."""

    def __init__(self, rows: Iterable[Row]) -> None:
        self.rows = tuple(rows)

    def wrap(self, width: int) -> list[Content]:
        """The rows as lines of at most `width` cells."""
        return [line for row in self.rows for line in _wrap(row, max(width, 10))]

    def render_strips(self, width: int, height: int | None, style: Style, options: RenderOptions) -> list[Strip]:
        lines = self.wrap(width)[:height]
        return [_lean(strip) for line in lines for strip in line.render_strips(width, 1, style, options)]

    def get_optimal_width(self, rules: RulesMap, container_width: int) -> int:
        return max((row.content.cell_length for row in self.rows), default=0)

    def get_minimal_width(self, rules: RulesMap) -> int:
        return 10

    def get_height(self, rules: RulesMap, width: int) -> int:
        return len(self.wrap(width))


def _lean(strip: Strip) -> Strip:
    """The strip without the marks for text selection, which keep neighbours of one style from being sent as one."""
    segments = [Segment(text, style and style.clear_meta_and_links()) for text, style, _ in strip]
    return Strip(segments, strip.cell_length)


def _wrap(row: Row, width: int) -> list[Content]:
    if row.content.cell_length <= width:
        return [row.content]
    first, *rest = row.content.wrap(width)
    if not rest:
        return [first]
    tail = row.content[len(first.plain) :]
    skipped = len(tail.plain) - len(tail.plain.lstrip())
    indent = min(row.indent, width // 2)
    return [first, *(line.pad_left(indent) for line in tail[skipped:].wrap(width - indent))]


def text(value: str, style: str = "") -> Content:
    """Foreign text, cleaned, in one style."""
    return Content.styled(clean(value), style) if style else Content(clean(value))


def labelled(label: str, value: Content | str, style: str = "") -> Row:
    """A row `label  value` with the values in one column."""
    body = text(value) if isinstance(value, str) else value
    return Row(Content.assemble((f"{label:<{LABEL_WIDTH}}", style), body), LABEL_WIDTH)


def heading(value: str) -> Row:
    return Row(text(value, "bold"))


def warning(label: str, value: str) -> Row:
    return labelled(f"! {label}", value, "bold $text-warning")


def percent(share: float) -> str:
    """A share as a percentage that never claims certainty it has not."""
    if 0.995 <= share < 1:
        return ">99 %"
    return "<1 %" if 0 < share < 0.005 else f"{share:.0%}".replace("%", " %")


def measure(value: float | None, unit: str) -> str:
    """A number with its unit, `unknown` where there is none."""
    return "unknown" if value is None else f"{value:.4g} {unit}".rstrip()


def setting(variable: Variable, value: float | None) -> str:
    """An option's value with its unit."""
    return f"{variable.show(value)} {variable.unit}".rstrip()


def limit(threshold: Threshold | None, unit: str) -> str:
    return "no threshold" if threshold is None else f"limit {threshold} {unit}".rstrip()


def status(value: Status, glyphs: Glyphs) -> Content:
    """Sign and word of a status, such as `✗ FAULT`."""
    sign = {"ok": glyphs.ok, "fault": glyphs.fault, "not_evaluated": glyphs.unknown}[value]
    return Content.styled(f"{sign} {WORDS[value]}", _COLOURS[value])


# Step 1: objectives


def headline(diagnosis: Diagnosis, glyphs: Glyphs) -> Content:
    """The verdict on the run in one line; it counts all three states, so it never reads as a false all-clear."""
    statuses = [objective.status for objective in diagnosis.objectives]
    faults, unknown = statuses.count("fault"), statuses.count("not_evaluated")
    worst: Status = "fault" if faults else "not_evaluated" if unknown or not statuses else "ok"
    counts = f"  {faults} outside, {statuses.count('ok')} within their thresholds, {unknown} not evaluated"
    return status(worst, glyphs) + Content(counts)


def objective_rows(result: ObjectiveResult, width: int, glyphs: Glyphs) -> Rows:
    """One objective: status, name padded to `width`, value, threshold; below it the reason or how unusual it is."""
    variable = result.variable
    line = Content.assemble(
        status(result.status, glyphs).pad_right(16 - len(WORDS[result.status]) - 2),
        text(variable.name, "bold").pad_right(width - len(clean(variable.name)) + 2),
        f"{clean(measure(result.value, variable.unit)):<12}",
        text(limit(result.threshold, variable.unit)),
    )
    rows = [Row(line, 16)]
    if result.reason:
        rows.append(Row(Content(" " * 16) + text(result.reason), 16))
    elif result.status == "fault" and result.percentile is not None:
        usual = f"percentile {100 * result.percentile:.3g} of the training runs"
        rows.append(Row(Content.styled(" " * 16 + usual, "dim"), 16))
    return Rows(rows)


def run_rows(diagnosis: Diagnosis) -> Rows:
    """Where the run came from, which profile judged it, and everything that limits the answer."""
    log, mission, profile = diagnosis.run.log, diagnosis.run.mission, diagnosis.profile
    start = log.start or "no wall clock"
    which = f"{mission.index} of {mission.count}, from {mission.start_s:.1f} s to {mission.end_s:.1f} s of the log"
    rows = [
        heading("This run"),
        labelled("Log", log.path),
        labelled("", f"{log.format}, {start}, {log.duration_s:.0f} s"),
        labelled("Mission", which),
        labelled("Profile", f"{profile.name} {profile.version} ({profile.platform})"),
        labelled("", profile.reason),
    ]
    if diagnosis.abstained:
        rows.append(warning("No cause", diagnosis.abstained))
    if not mission.ended:
        rows.append(warning("Mission", "the log stops before the mission does"))
    if mission.mismatch:
        rows.append(warning("Mission", mission.mismatch))
    rows += [warning("Profile", line) for line in profile.warnings]
    rows += [warning("Damage", damage(part)) for part in log.damage]
    rows += [warning("Note", line) for line in diagnosis.notes]
    rows += [labelled(key.capitalize(), value) for key, value in log.facts.items()]
    if diagnosis.run.evidence:
        rows += [heading("The log says"), *(evidence_row(part) for part in diagnosis.run.evidence)]
    return Rows(rows)


def damage(part: Damage) -> str:
    byte = "" if part.byte is None else f" at byte {part.byte}"
    time = "" if part.time_s is None else f" at {part.time_s:.1f} s"
    return f"{part.what}{byte}{time}"


def evidence_row(part: Evidence, option: str = "") -> Row:
    """A message of the log; marked where it points at `option`."""
    points = option and option in part.options
    head = f"{part.time_s:8.1f} s  {clean(part.kind):<9} "
    tail = "  (points at this option)" if points else ""
    return Row(Content.assemble(head, text(part.text), (tail, "bold")), len(head))


# Step 2: causes


def cause_rows(cause: Cause, glyphs: Glyphs) -> Rows:
    """One cause of the ranked list: the option with its change, then what it is worth, with its caveats beside it."""
    option = cause.option
    head = Content.assemble(
        f"{cause.rank:>2} ",
        text(option.name, "bold"),
        "  ",
        change_text(option, cause.current, cause.suggested, glyphs),
    )
    worth = [f"{cause.confidence} confidence"]
    if cause.p_fixed is not None:
        worth.append(f"odds of a fix {percent(cause.p_fixed)}")
    caveats = "".join(f"  ! {clean(note)}" for note in caveats_of(cause))
    return Rows([Row(head, 3), Row(Content("   " + ", ".join(worth) + caveats), 3)])


def change_text(option: Variable, current: float, suggested: float | None, glyphs: Glyphs) -> Content:
    """`16 → 50 cm/s`, or the current value alone where nothing is suggested."""
    if suggested is None:
        return text(setting(option, current))
    return text(f"{option.show(current)} {glyphs.to} {setting(option, suggested)}")


def caveats_of(cause: Cause) -> tuple[str, ...]:
    """What weakens a cause; a value outside the training support is always said."""
    if cause.in_support or any("support" in note for note in cause.notes):
        return cause.notes
    return ("outside the training support", *cause.notes)


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
            line += Content.assemble("  ", status(objective.status, glyphs), "  ")
            rows.append(Row(line + text(limit(objective.threshold, node.unit)), width + 4))
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
    effect = "effect unknown" if node.effect is None else f"effect {node.effect:+.2f}"
    if node.support is None:
        return Content.styled(f"{glyphs.line} {effect}", "dim")
    line = Content.styled(f"{glyphs.line} {effect}, in {percent(node.support)} of resamples", "dim")
    return line + Content.styled("  ! few", "$text-warning") if node.support < FEW_RESAMPLES else line


def cause_detail(cause: Cause, objective: ObjectiveResult, evidence: Sequence[Evidence], glyphs: Glyphs) -> Rows:
    """Everything about one cause: its path, what it is worth, its caveats, what the log says."""
    option = cause.option
    gain = "" if cause.p_fixed is None else f", odds that it keeps all thresholds {percent(cause.p_fixed)}"
    rows = [*path_rows(cause, objective, glyphs), Row(Content())]
    rows.append(labelled("Confidence", f"{cause.confidence}{gain}"))
    rows += [warning("Caveat", note) for note in caveats_of(cause)]
    rows.append(labelled("Contribution", f"costs {percent(cause.contribution)} of this run's odds of no fault"))
    if cause.suggested is not None:
        rows.append(labelled("Suggested", change_text(option, cause.current, cause.suggested, glyphs)))
    if cause.predicted is not None:
        rows.append(labelled("Predicted", prediction(objective.variable, cause.predicted, glyphs)))
    rows.append(labelled("Effect", f"{cause.total_effect:+.2f} in all; path {cause.path_ace:.2f}, over the platform"))
    if option.parameters:
        rows.append(labelled("Parameter", ", ".join(option.parameters)))
    if option.doc:
        rows.append(labelled("About", option.doc))
    if evidence:
        rows += [Row(Content()), heading("The log says"), *(evidence_row(part, option.name) for part in evidence)]
    return Rows(rows)


def no_cause_rows(diagnosis: Diagnosis, objective: ObjectiveResult | None) -> Rows:
    """Why there is nothing to rank."""
    if objective is None:
        return Rows([labelled("No objective", "the profile declares none, so nothing can be at fault")])
    if objective.status == "ok":
        return Rows([Row(Content("Within its threshold: there is nothing to explain."))])
    if objective.status == "not_evaluated":
        return Rows([Row(Content("Not evaluated, so no cause is known.")), warning("Reason", objective.reason)])
    reason = diagnosis.abstained or "no option of the profile explains this objective"
    return Rows([Row(Content("Outside its threshold, but no cause is named.")), warning("Reason", reason)])


# Step 3: fix


def fix_rows(fix: Fix, place: int, glyphs: Glyphs) -> Rows:
    """One fix of the list: suggested or alternative, its odds, its changes."""
    label = "Suggested" if place == 0 else f"Alternative {place}"
    head = Content.assemble((f"{label:<15}", "bold"), f"odds of keeping all thresholds {percent(fix.p_fixed)}")
    changes = [
        Row(
            Content.assemble(
                "  ",
                text(change.option.name),
                "  ",
                change_text(change.option, change.current, change.suggested, glyphs),
            ),
            4,
        )
        for change in fix.changes
    ]
    return Rows([Row(head, 4), *changes])


def fix_detail(fix: Fix, objectives: Sequence[ObjectiveResult], glyphs: Glyphs) -> Rows:
    """The changes with their parameters and caveats, and what every objective should become."""
    rows = [heading("Change")]
    for change in fix.changes:
        rows += change_rows(change, glyphs)
    rows += [Row(Content()), heading("Predicted outcome, 80 % interval")]
    width = max((len(clean(result.variable.name)) for result in objectives), default=0)
    for result in objectives:
        predicted = fix.predicted.get(result.variable.name)
        name = text(result.variable.name).pad_right(width - len(clean(result.variable.name)) + 2)
        if predicted is None:
            outcome = status("not_evaluated", glyphs) + Content("  no prediction")
        else:
            outcome = prediction(result.variable, predicted, glyphs)
        now = f"  (now {measure(result.value, result.variable.unit)})"
        rows.append(Row(Content.assemble("  ", name, outcome, (clean(now), "dim")), width + 4))
    return Rows(rows)


def change_rows(change: Change, glyphs: Glyphs) -> list[Row]:
    option = change.option
    line = Content.assemble(
        "  ", text(option.name, "bold"), "  ", change_text(option, change.current, change.suggested, glyphs)
    )
    if option.reboot_required:
        line += Content.styled("  ! reboot needed", "$text-warning")
    rows = [Row(line, 4)]
    keys = tuple(key for key in option.parameters if key != option.name)
    if keys:
        rows.append(Row(Content.styled(f"    sets {clean(', '.join(keys))}", "dim"), 6))
    rows += [Row(Content.styled(f"    ! {clean(note)}", "$text-warning"), 6) for note in change.notes]
    return rows


def prediction(variable: Variable, predicted: Prediction, glyphs: Glyphs) -> Content:
    """`✓ OK  139, 131 to 150 s, odds 91 %`."""
    odds = "" if predicted.p_ok is None else f", odds {percent(predicted.p_ok)}"
    if variable.kind == "functional":  # a yes-or-no objective has odds, not a value
        return status(predicted.status(), glyphs) + text(odds.replace(",", " ", 1))
    span = f"  {predicted.value:.4g}, {predicted.low:.4g} to {measure(predicted.high, variable.unit)}"
    return status(predicted.status(), glyphs) + text(f"{span}{odds}")


def no_fix_rows(diagnosis: Diagnosis) -> Rows:
    """Why there is no fix."""
    if diagnosis.abstained:
        return Rows([Row(Content("No fix is suggested.")), warning("Reason", diagnosis.abstained)])
    if diagnosis.faults:
        return Rows([Row(Content("No change of options is predicted to keep all thresholds."))])
    if all(objective.status == "ok" for objective in diagnosis.objectives):
        return Rows([Row(Content("No fault was found: there is nothing to change."))])
    return Rows([Row(Content("No fault was found, but not everything could be evaluated: no change is suggested."))])


# Steps 4 and 5: diff and report

_DIFF_STYLES = {"+": "$text-success", "-": "$text-error", "@": "$text-accent"}


def diff_rows(diff: str) -> Rows:
    """A unified diff, line by line; the signs stay, the colours come on top."""
    return Rows(Row(text(line, _DIFF_STYLES.get(line[:1], "")), 2) for line in diff.splitlines())


def plain_rows(document: str) -> Rows:
    """A document as it is, line by line."""
    return Rows(Row(text(line), len(line) - len(line.lstrip()) + 2) for line in document.splitlines())


def progress_bar(fraction: float, glyphs: Glyphs) -> Content:
    """How much of the work is done; drawn when the engine reports, never on a timer."""
    done = round(PROGRESS_WIDTH * min(max(fraction, 0.0), 1.0))
    bar = glyphs.done * done + glyphs.ahead * (PROGRESS_WIDTH - done)
    return Content(f"{bar} {percent(done / PROGRESS_WIDTH)}")


def error_rows(error: CareError) -> Rows:
    """What is wrong, where, and what to do."""
    rows = [labelled("Problem", error.message, "bold $text-error")]
    if error.where:
        rows.append(labelled("Where", error.where))
    if error.hint:
        rows.append(labelled("What to do", error.hint))
    return Rows(rows)
