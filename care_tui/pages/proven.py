"""A step whose figure is what proves what is under the cursor."""

from __future__ import annotations

from textual.content import Content

from care_core.application.proof import Subject
from care_tui.pages.diagnosis import DiagnosisPage
from care_tui.pages.figured import FiguredPage
from care_tui.pages.proofs import has_proof, proof_rows
from care_tui.render.rows import Row


class ProvenPage(FiguredPage, DiagnosisPage):
    """The figure is a signal over time, or a map of the way."""

    def figure(self, name: str, subject: Subject, around: int) -> list[Row]:
        """The proof of a subject in what room so many lines around it leave.

        Args:
            name: tells the subject from others of this page.
        """
        if not self.reader.has_room:  # it is asked again when there is some
            return []
        rows = proof_rows(self, name, subject, *self.room_of_figure(around))
        return [*rows, Row(Content())] if rows and not self.is_wide else rows

    def has_figure(self, name: str, subject: Subject) -> bool:
        """Whether a subject has a proof that can be drawn in the whole pane, or one may be found."""
        return self.reader.has_room and has_proof(self, name, subject, *self.room_of_figure())
