"""The plot or the map that proves what is under the cursor, as part of a page's text."""

from __future__ import annotations

from textual.content import Content

from care_core.application.case import Case
from care_core.application.proof import Proof, Subject, meanings, proof_of
from care_core.application.signals import Signal, signals_of, trace_of, whole_of
from care_core.application.track import Way, way_of
from care_core.diagnose.records import Diagnosis
from care_core.errors import CareError
from care_core.report.marks import Mark, marks_of
from care_tui.pages.page import Page
from care_tui.render.map import map_rows
from care_tui.render.plot import AXIS, Figure, dots_across
from care_tui.render.rows import ASCII, Row
from care_tui.session import Session

LEAST, LEAST_MAP = 6, 10
"""Lines below which a plot shows nothing, and a map."""
WAY = "way"
"""The question where the robot went."""


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


def has_proof(page: Page, name: str, subject: Subject, width: int, height: int) -> bool:
    """Whether something proves a subject, or may: it is still looked for. Arguments as for `proof_rows`."""
    found, is_open = _proof(page, name, subject, width, height)
    return found is not None or is_open


def proof_rows(page: Page, name: str, subject: Subject, width: int, height: int) -> list[Row]:
    """What proves a subject, drawn when a thread has read it: the way where it is a matter of the way, else a signal
    over time; nothing where neither shows it.

    Args:
        name: tells the subject from others of this page.
    """
    found, is_open = _proof(page, name, subject, width, height)
    if isinstance(found, Way):
        return _drawn(page, found, width, height)
    if found is not None:
        return found.rows(width, height, page.glyphs)
    return [Row(Content("Looking for what shows it..."))] if is_open else []


def _proof(page: Page, name: str, subject: Subject, width: int, height: int) -> tuple[Figure | Way | None, bool]:
    """What proves a subject, and whether it is still looked for."""
    case, session = page.session.case, page.session
    if case is None or case.log is None or height < LEAST:
        return None, False
    columns = dots_across(max(width - AXIS, 10), ascii=page.glyphs is ASCII)

    def work() -> Figure | Way | None:
        proof = proof_of(case, subject, signals_in(session, case))
        if proof.is_way and height >= LEAST_MAP:
            try:
                return way_of(case)
            except CareError:  # it says no place in both directions
                pass
        for signal in proof.signals[:3]:
            try:
                return figure_of(case, signal, proof, proof.around(whole_of(case)), columns)
            except CareError:  # it has no value in the mission: the next one may
                continue
        return None

    question = f"proof {name} {columns} {height >= LEAST_MAP}"
    answer = page.fetched(question, work)
    found = None if isinstance(answer, CareError) else answer
    return found, not page.has_answer(question)


def place_rows(page: Page, moment_s: float, width: int, height: int) -> list[Row]:
    """Where the robot was at a moment, on the map of its way; nothing where the log does not say."""
    case = page.session.case
    if case is None or case.log is None or height < LEAST_MAP:
        return []
    way = page.fetched(WAY, lambda: way_of(case))
    return _drawn(page, way, width, height, moment_s) if isinstance(way, Way) else []


def _drawn(page: Page, way: Way, width: int, height: int, here_s: float | None = None) -> list[Row]:
    return map_rows(way, grave_marks(page.session.diagnosis), width, height, page.glyphs, here_s)


def grave_marks(diagnosis: Diagnosis) -> list[Mark]:
    """What a map marks: a sign for each moment would cover the way."""
    return [mark for mark in marks_of(diagnosis) if mark.severity != "info"]
