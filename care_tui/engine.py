"""Everything the app asks of care_core, in worker threads: the functions touch no widget."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from care_core.application.case import Case, Request, open_case
from care_core.application.configuring import DiffSide, apply_to_files, commands_of, diff_of, doubts_of
from care_core.application.deciding import predict
from care_core.application.history_writing import remember, remember_triage
from care_core.application.reporting import report_of
from care_core.application.responses import odds_over
from care_core.errors import CareError
from care_core.progress import Progress
from care_core.records import Record
from care_core.report.formats import FORMATS, Format

if TYPE_CHECKING:
    from care_core.diagnose.records import Diagnosis, Fix, Odds
    from care_core.report.document import TriageDocument
    from care_core.variables import Variable

_ESCAPES = re.compile(r"\\([!-/:-@\[-`{-~])")
"""A sign that Markdown is told to leave as it is."""
CAUSES = 10
"""Most causes per fault in the app: more than a report shows, for here they scroll."""


class CancelledError(BaseException):
    """The operator took the work back. Not an Exception: no reader may mistake it for damage and go on."""


def open_and_warm(request: Request, progress: Progress) -> Case:
    """The case with its question made, so that the first key in the fix waits for nothing. Raises CareError."""
    case = open_case(request, progress)
    if case.reading is not None and not case.diagnosis.run.checks:
        _ = case.reading.question
    return case


def comparison_of(a: Request, b: Request, progress: Progress) -> Callable[[int], str]:
    """Two logs side by side, A the one to compare with, in lines of whatever width is asked for. Raises CareError."""
    from care_core.application.comparing import compare
    from care_core.report.comparison import comparison_text

    document = compare(a, b, progress).document()
    return lambda width: comparison_text(document, width)


def verification_of(case: Case, report: TriageDocument, thresholds: Mapping[str, float]) -> Callable[[int], str]:
    """What became in this run of what an earlier report promised, in lines of whatever width is asked for; it is
    remembered as by `care verify`. Raises CareError."""
    from care_core.application.verifying import held_against
    from care_core.report.verification import verify_text

    document = held_against(report, Path(report.log.path), case, thresholds)
    verified = document.plain()
    remember(lambda history: history.add_verification(verified))
    return lambda width: verify_text(document, width)


def preview_of(case: Case, format: Format) -> str:
    """The report as it will be written; of a page for a browser what it says, in lines that are wrapped where they are
    shown. Raises CareError."""
    if format is FORMATS["html"]:
        return _ESCAPES.sub(r"\1", report_of(case, "markdown"))
    return report_of(case, format.name)


def save_text(path: Path, text: str) -> None:
    """Write a file; it is whole or not there at all. Of one that is there the operator was asked; a log is kept."""
    from care_core.outputs import write_output

    write_output(path, text, force=True)


class Engine(Record):
    """The questions. Tests give answers of their own."""

    diagnose: Callable[[Request, Progress], Case] = open_and_warm
    predict: Callable[[Case, Mapping[str, float]], Fix] = predict
    odds_over: Callable[[Case, Variable, Mapping[str, float]], Iterator[Odds]] = odds_over
    diff: Callable[[Case, Fix, DiffSide], str] = diff_of
    report: Callable[[Case, str], str] = report_of
    preview: Callable[[Case, Format], str] = preview_of
    commands: Callable[[Diagnosis], list[str]] = commands_of
    save: Callable[[Path, str], None] = save_text
    remember: Callable[[Diagnosis, Request], CareError | None] = remember_triage
    compare: Callable[[Request, Request, Progress], Callable[[int], str]] = comparison_of
    verify: Callable[[Case, TriageDocument, Mapping[str, float]], Callable[[int], str]] = verification_of
    apply: Callable[[Case, Fix], list[tuple[Path, Path]]] = apply_to_files
    doubts: Callable[[Case, Fix], tuple[str, ...]] = doubts_of


def as_care_error(err: Exception) -> CareError:
    """Any error as one that can be shown: message, hint, where."""
    if isinstance(err, CareError):
        return err
    import logging

    logging.getLogger(__name__).error("unexpected error", exc_info=err)
    return CareError(
        f"Unexpected error: {type(err).__name__}: {err}",
        hint="This is a defect of care, not of your robot: please report it with the log.",
    )
