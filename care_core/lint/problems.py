"""What a file holds, line by line, and what is found in it."""

from __future__ import annotations

from collections.abc import Iterable
from enum import Enum
from pathlib import Path

from care_core.ecosystems.dialect import Dialect
from care_core.lint.rules import BY_ID
from care_core.records import Record


class Severity(str, Enum):
    """How bad a problem is. Only a note leaves the exit code at 0."""

    ERROR = "error"
    """The node or the ground station refuses the file or the value."""
    WARNING = "warning"
    """The file does not do what it says."""
    NOTE = "note"
    """Worth a look, and often meant."""


class Entry(Record):
    """A value in a file: the keys that lead to it, and where it stands, from 1."""

    keys: tuple[str, ...]
    value: float | str
    line: int
    column: int
    kind: str = ""
    """How the file writes it: int, float, bool, str or list."""

    @property
    def name(self) -> str:
        """The parameter as the file has it."""
        return "/".join(self.keys)

    @property
    def number(self) -> float | None:
        """The value, None where it is not a number."""
        return None if isinstance(self.value, str) else float(self.value)


class Problem(Record):
    """Something wrong at one place of a file."""

    rule: str
    severity: Severity
    path: Path
    line: int
    column: int
    parameter: str
    text: str
    hint: str
    source: str
    """Where the rule has it from."""
    others: tuple[str, ...] = ()
    """The other parameters that it takes to be wrong, as the file names them."""


class LintedFile(Record):
    """A configuration file, read as far as it can be."""

    path: Path
    format: Dialect
    text: str
    entries: tuple[Entry, ...]
    named: tuple[tuple[tuple[str, ...], str, str], ...] = ()
    """Plugins that a list of mappings names (ROS 1): the keys of the list, the name, the class."""
    namespace: str = ""

    def problem(
        self,
        rule: str,
        severity: Severity,
        entry: Entry,
        text: str,
        hint: str = "",
        source: str = "",
        others: Iterable[Entry] = (),
    ) -> Problem:
        """A problem at an entry; `source` where it is not the rule's own."""
        where = (self.path, entry.line, entry.column, entry.name)
        named = tuple(one.name for one in others)
        return Problem(rule, severity, *where, text, hint, source or BY_ID[rule].source, named)

    def error(
        self, rule: str, entry: Entry, text: str, hint: str = "", source: str = "", others: Iterable[Entry] = ()
    ) -> Problem:
        return self.problem(rule, Severity.ERROR, entry, text, hint, source, others)

    def warning(
        self, rule: str, entry: Entry, text: str, hint: str = "", source: str = "", others: Iterable[Entry] = ()
    ) -> Problem:
        return self.problem(rule, Severity.WARNING, entry, text, hint, source, others)

    def note(
        self, rule: str, entry: Entry, text: str, hint: str = "", source: str = "", others: Iterable[Entry] = ()
    ) -> Problem:
        return self.problem(rule, Severity.NOTE, entry, text, hint, source, others)
