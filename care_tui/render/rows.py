"""care_core values -> rows of styled text. Pure: no widget, no file, no state.

Text that came from a log or a profile goes through `clean` and becomes `Content`, which never reads markup.
Colours are theme variables and always come with a word or a sign.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from rich.cells import cell_len, set_cell_size
from rich.segment import Segment
from textual.content import Content
from textual.css.styles import RulesMap
from textual.strip import Strip
from textual.style import Style
from textual.visual import RenderOptions, Visual

from care_core import text as words
from care_core.diagnose.verdict import STATUS_WORDS, RunStatus
from care_core.errors import CareError
from care_core.records import Record
from care_core.text import clean
from care_core.variables import ASSUMED, Threshold, Variable

LABEL_WIDTH = 14
PROGRESS_WIDTH = 40
_WORD = re.compile(r"\S*\d (?=[^\W\d]|[%°])\S+\s*|\S+\s*|\s+")
FEW_RESAMPLES = 0.5
"""Edges that fewer bootstrap resamples hold are flagged."""


class Glyphs(Record):
    """Every character outside ASCII that the app draws with, chosen here and nowhere else."""

    ok: str
    fault: str
    unknown: str
    here: str
    to: str
    root: str
    line: str
    down: str
    up: str
    done: str
    ahead: str
    more: str
    rule: str
    tee: str
    corner: str
    open: str
    shade: str


UNICODE = Glyphs(
    ok="✓",
    fault="✗",
    unknown="?",
    here="▸",
    to="→",
    root="●",
    line="│",
    down="▼",
    up="▲",
    done="█",
    ahead="░",
    more="…",
    rule="─",
    tee="├",
    corner="╰",
    open="▾",
    shade="·",
)
ASCII = Glyphs(
    ok="+",
    fault="x",
    unknown="?",
    here=">",
    to="->",
    root="*",
    line="|",
    down="v",
    up="^",
    done="#",
    ahead=".",
    more="~",
    rule="-",
    tee="|",
    corner="`",
    open="v",
    shade=":",
)

_COLOURS: dict[RunStatus, str] = {
    "ok": "$text-success",
    "fault": "bold $text-error",
    "not_evaluated": "$text-warning",
    "unreadable": "$text-warning",
}


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
    content = row.content
    if content.cell_length <= width:
        return [content]
    indent = min(row.indent, width // 2)
    breaks = _breaks(content.plain, width, width - indent)
    first, *rest = content.divide(breaks)
    return [first.rstrip(), *(line.rstrip().pad_left(indent) for line in rest)]


def _breaks(plain: str, first_width: int, width: int) -> list[int]:
    """Where a line has to end so that each fits; a number stays with its unit, a word too long for a line is cut."""
    breaks: list[int] = []
    start, room = 0, first_width
    for word in _WORD.finditer(plain):
        if cell_len(plain[start : word.end()].rstrip()) <= room:
            continue
        if word.start() > start and cell_len(word[0].rstrip()) <= width:
            start, room = word.start(), width
            breaks.append(start)
        while cell_len(plain[start : word.end()].rstrip()) > room:
            end = start + max(room // 2, 1)
            while end < word.end() and cell_len(plain[start : end + 1]) <= room:
                end += 1
            start, room = end, width
            breaks.append(start)
    return breaks


def text(value: str, style: str = "") -> Content:
    """Foreign text, cleaned, in one style."""
    return Content.styled(clean(value), style) if style else Content(clean(value))


def cut(line: Content, width: int, glyphs: Glyphs) -> Content:
    """The line where it fits, else its beginning with the sign for more."""
    return line if line.cell_length <= width else line.truncate(max(width - 1, 1)) + glyphs.more


def without_middle(name: str, width: int, glyphs: Glyphs) -> str:
    """A name where it fits, else without its middle: what tells files of one place apart is at their ends."""
    name = clean(name)
    if cell_len(name) <= width:
        return name
    head = width // 3
    tail = width - head - len(glyphs.more)
    return f"{set_cell_size(name, head).rstrip()}{glyphs.more}{_last_cells(name, tail)}"


def _last_cells(name: str, width: int) -> str:
    while cell_len(name) > width:
        name = name[1:]
    return name


def by_options(judged_with: str) -> str:
    """The names of the options that a verdict was judged with, to stand before it in a list."""
    names = dict.fromkeys(option.partition(" ")[0] for option in judged_with.split(", "))
    return f"(with {', '.join(names)}) " if judged_with else ""


def joined(parts: Iterable[Content], gap: str) -> Content:
    """The parts with a gap between them. `Content.join` counts a gap too many: what is shown by it leaves remains."""
    return Content.assemble(*(piece for part in parts for piece in (gap, part)))[len(gap) :]


def labelled(label: str, value: Content | str, style: str = "") -> Row:
    """A row `label  value` with the values in one column; a label that is wider than that has a colon."""
    body = text(value) if isinstance(value, str) else value
    head = f"{label:<{LABEL_WIDTH - 1}} " if len(label) < LABEL_WIDTH else f"{label}: "
    return Row(Content.assemble((head, style), body), LABEL_WIDTH)


def heading(value: str) -> Row:
    return Row(text(value, "bold"))


def folded(title: str, rows: Sequence[Row], glyphs: Glyphs, *, is_open: bool) -> list[Row]:
    """A part of a text that can be put away: `z` opens and closes those of a page."""
    if not rows:
        return []
    head = Content.assemble((f"{glyphs.open if is_open else glyphs.here} {title}", "bold"), ("  z", "dim"))
    return [Row(Content()), Row(head), *(rows if is_open else ())]


def warning(label: str, value: str) -> Row:
    return labelled(f"! {label}", value, "bold $text-warning")


def measure(value: float | None, unit: str) -> str:
    """A number with its unit, `unknown` where there is none."""
    return "unknown" if value is None else f"{value:.4g} {unit}".rstrip()


def setting(variable: Variable, value: float | None) -> str:
    """An option's value with its unit."""
    return f"{variable.show(value)} {variable.unit}".rstrip()


def limit(threshold: Threshold | None, unit: str) -> str:
    return "no threshold" if threshold is None else f"limit {threshold} {unit}".rstrip()


def status(value: RunStatus, glyphs: Glyphs) -> Content:
    """Sign and word of a status, such as `✗ FAULT`."""
    return sign_of_status(value, glyphs, f" {STATUS_WORDS[value]}")


def sign_of_status(value: RunStatus, glyphs: Glyphs, word: str = "") -> Content:
    """The sign of a status, alone or with its word."""
    sign = {"ok": glyphs.ok, "fault": glyphs.fault}.get(value, glyphs.unknown)
    return Content.styled(f"{sign}{word}", _COLOURS[value])


def change_text(
    option: Variable, current: float | None, is_assumed: bool, suggested: float | None, glyphs: Glyphs
) -> Content:
    """`16 → 50 cm/s`, or the current value alone where nothing is suggested."""
    if suggested is None:
        return text(f"{setting(option, current)}{ASSUMED if is_assumed else ''}")
    return text(f"{option.driven(current, is_assumed)} {glyphs.to} {setting(option, suggested)}")


_DIFF_STYLES = {"+": "$text-success", "-": "$text-error", "@": "$text-accent"}


def diff_rows(diff: str) -> Rows:
    """A unified diff, line by line; the signs stay, the colours come on top."""
    return Rows(Row(text(line, _DIFF_STYLES.get(line[:1], "")), 2) for line in diff.splitlines())


def command_rows(commands: Sequence[str]) -> list[Row]:
    """The commands that make a change."""
    if not commands:
        return []
    return [Row(Content()), heading("Commands that do it"), *(Row(text(f"  {command}"), 4) for command in commands)]


def plain_rows(document: str) -> Rows:
    """A document as it is, line by line."""
    return Rows(Row(text(line), len(line) - len(line.lstrip()) + 2) for line in document.splitlines())


def progress_bar(fraction: float, glyphs: Glyphs) -> Content:
    """How much of the work is done; drawn when the engine reports, never on a timer."""
    done = round(PROGRESS_WIDTH * min(max(fraction, 0.0), 1.0))
    bar = glyphs.done * done + glyphs.ahead * (PROGRESS_WIDTH - done)
    return Content(f"{bar} {words.percent(done / PROGRESS_WIDTH)}")


def error_rows(error: CareError) -> Rows:
    """What is wrong, where, and what to do."""
    rows = [labelled("Problem", error.message, "bold $text-error")]
    if error.where:
        rows.append(labelled("Where", error.where))
    if error.hint:
        rows.append(labelled("What to do", error.hint))
    return Rows(rows)


def padded(value: str, width: int, style: str = "") -> Content:
    """Foreign text, cleaned, filled up to a column; a longer one still keeps its distance from what follows."""
    content = text(value, style)
    return content.pad_right(max(width - content.cell_length, 1))
