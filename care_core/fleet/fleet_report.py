"""The rows of a fleet with what they say together."""

from __future__ import annotations

from collections.abc import Sequence

from care_core.diagnose.verdict import exit_code
from care_core.errors import ExitCode
from care_core.fleet.rows import Row
from care_core.fleet.shared import Pattern, shared
from care_core.fleet.suggest import Silence, Suggestion, suggest
from care_core.records import Record


class Fleet(Record):
    """The rows in the order of their logs, what they share, and for each profile what is suggested."""

    rows: tuple[Row, ...]
    shared: tuple[Pattern, ...]
    suggestions: tuple[Suggestion | Silence, ...]

    @property
    def exit_code(self) -> ExitCode:
        """What one log's code would be: a fault anywhere, else something not evaluated; unreadable where all are."""
        statuses = {row.status for row in self.rows}
        if statuses != {"unreadable"}:  # a log that cannot be read was not evaluated, beside others that were
            statuses = {"not_evaluated" if status == "unreadable" else status for status in statuses}
        return exit_code(*statuses)


def together(rows: Sequence[Row]) -> Fleet:
    """What these rows say together."""
    return Fleet(tuple(rows), shared(rows), suggest(rows))
