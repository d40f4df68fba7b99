"""The plot that proves what is under the cursor, as part of a page's text."""

from __future__ import annotations

from textual.content import Content

from care_core.application.case import Case
from care_core.application.proof import Proof, Subject, meanings, proof_of
from care_core.application.signals import Signal, signals_of, trace_of, whole_of
from care_core.errors import CareError
from care_core.report.marks import marks_of
from care_tui.pages.page import Page
from care_tui.render.plot import AXIS, Figure, dots_across
from care_tui.render.rows import ASCII, Row
from care_tui.session import Session


def signals_in(session: Session, case: Case) -> list[Signal]:
    """The signals of the log, looked up once."""
    if session.signals is None:
        session.signals = signals_of(case)
    return session.signals


def figure_of(case: Case, signal: Signal, proof: Proof, span: tuple[float, float], columns: int) -> Figure:
    """A signal over a span of the log. Raises CareError where it has no value there."""
    return Figure(
        signal,
        meanings(case)(signal.channel, signal.field),
        trace_of(case, signal, span, columns),
        tuple(marks_of(case.diagnosis)),
        proof.start_s,
        proof.end_s,
    )


def proof_rows(page: Page, name: str, subject: Subject, width: int, height: int) -> list[Row]:
    """The figure that proves a subject, drawn when a thread has read it; nothing where no signal shows it.

    Args:
        name: tells the subject from others of this page.
    """
    case, session = page.session.case, page.session
    if case is None or case.log is None or height < 6:
        return []
    columns = dots_across(max(width - AXIS, 10), ascii=page.glyphs is ASCII)

    def work() -> Figure | None:
        proof = proof_of(case, subject, signals_in(session, case))
        for signal in proof.signals[:3]:
            try:
                return figure_of(case, signal, proof, proof.around(whole_of(case)), columns)
            except CareError:  # it has no value in the mission: the next one may
                continue
        return None

    question = f"proof {name} {columns}"
    answer = page.fetched(question, work)
    if isinstance(answer, Figure):
        return [*answer.rows(width, height, page.glyphs), Row(Content())]
    return [] if page.has_answer(question) else [Row(Content("Looking for the signal that shows it..."))]
