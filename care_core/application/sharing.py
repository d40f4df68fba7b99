"""What goes to strangers: a diagnosis without places, or without anything that says whose robot it was."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from care_core.application.open_run import OpenRun
from care_core.records import Record, replace

R = TypeVar("R", bound=OpenRun)


class Sharing(Record):
    """What of a run may go to strangers.

    Its patterns take 50 ms to compile, which most reports can do without.
    """

    positions: bool = True
    anonymous: bool = False

    def of(self, case: R) -> R:
        """The case with the rest left out of its diagnosis. Its log stays what it is."""
        if self == EVERYTHING:
            return case
        from care_core.application.redaction import diagnosis_without_places, redactor_of

        if self.anonymous:
            shared = redactor_of(case, positions=self.positions).diagnosis(case.diagnosis)
        else:
            shared = diagnosis_without_places(case.diagnosis)
        return replace(case, diagnosis=shared)

    def text(self, case: OpenRun) -> Callable[[str], str]:
        """How a text of the case is to be written."""
        if self == EVERYTHING:
            return str
        from care_core.application.redaction import redactor_of, without_places

        return redactor_of(case, positions=self.positions).text if self.anonymous else without_places


EVERYTHING = Sharing()
