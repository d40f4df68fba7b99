"""The formats of the fix report: a row each. A new one is a module that writes it, and a row here.

The writers are imported when they are asked for: a triage that prints text reads no template and no XML.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from care_core.errors import UsageError, nearest
from care_core.files import format_by_ending
from care_core.records import Record
from care_core.text import listed

if TYPE_CHECKING:
    from care_core.diagnose.records import Diagnosis
    from care_core.report.document import Report
    from care_core.report.plots import Drawing


class Answer(Record, eq=False, dict=True):
    """What a writer may use: the diagnosis, its document, and the signals of the run drawn."""

    diagnosis: Diagnosis
    draw: Callable[[], Drawing]

    @cached_property
    def report(self) -> Report:
        from care_core.report.document import build_document

        return build_document(self.diagnosis)


class Format(Record):
    """One format of the report."""

    name: str
    label: str
    """What people call it."""
    suffixes: tuple[str, ...]
    """Of files that hold it, the usual one first; none where no file is taken to hold it."""
    write: Callable[[Answer], str]
    is_sent: bool = False
    """Whether it is made to be sent: without positions, unless they are asked for."""


def _text(answer: Answer) -> str:
    from care_core.report.terminal import to_text

    return to_text(answer.diagnosis)


def _yaml(answer: Answer) -> str:
    from care_core.report.writers import to_yaml

    return to_yaml(answer.report)


def _markdown(answer: Answer) -> str:
    from care_core.report.markdown import to_markdown

    return to_markdown(answer.report)


def _html(answer: Answer) -> str:
    from care_core.report.html import to_html

    return to_html(answer.report, answer.draw())


def _json(answer: Answer) -> str:
    from care_core.report.writers import to_json

    return to_json(answer.report)


def _junit(answer: Answer) -> str:
    from care_core.report.junit import suite_of, to_junit

    return to_junit([suite_of(answer.report)])


def _patch(answer: Answer) -> str:
    return answer.report.diff


FORMATS = {
    row.name: row
    for row in (
        Format("text", "text", (), _text),
        Format("yaml", "YAML", (".yaml", ".yml"), _yaml),
        Format("markdown", "Markdown", (".md",), _markdown, is_sent=True),
        Format("html", "HTML", (".html", ".htm"), _html, is_sent=True),
        Format("json", "JSON", (".json",), _json),
        Format("junit", "JUnit", (".xml",), _junit, is_sent=True),
        Format("patch", "patch", (".patch", ".diff"), _patch),
    )
}
"""By name."""
FILE_FORMATS = tuple(row for row in FORMATS.values() if row.suffixes)
"""Those that a file's name can choose."""
ENDINGS = {row.name: row.suffixes for row in FILE_FORMATS}
"""By name, the endings of files that hold each."""


def format_named(name: str) -> Format:
    """The format of this name. Raises UsageError."""
    try:
        return FORMATS[name]
    except KeyError:
        hint = nearest(name, FORMATS) or f"There are {', '.join(FORMATS)}."
        raise UsageError(f"There is no report format '{name}'.", hint=hint) from None


def format_of(path: Path) -> Format:
    """The format that the suffix of a file stands for. Raises UsageError where it stands for none."""
    return FORMATS[format_by_ending(path, ENDINGS)]


def suffixes_text() -> str:
    """The usual suffixes, as they are listed in a sentence."""
    return listed([row.suffixes[0] for row in FILE_FORMATS], "or")
