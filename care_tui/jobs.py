"""What runs in worker threads. The bodies call care_core and touch no widget."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from care_core.application.case import Case, Progress, Request, open_case, predict
from care_core.application.configuring import DiffSide, commands_of, diff_of
from care_core.application.history_writing import remember_triage
from care_core.application.reporting import report_of
from care_core.errors import CareError
from care_core.records import Record

if TYPE_CHECKING:
    from care_core.diagnose.records import Diagnosis, Fix

T = TypeVar("T")


class CancelledError(BaseException):
    """The operator took the work back. Not an Exception: no reader may mistake it for damage and go on."""


class Job:
    """Work in a thread of its own that nobody waits for: not the operator who stops it, nor the end of the program.

    A thread cannot be stopped from outside without leaving locks behind (that of an import, for one), so one that is
    cancelled ends at its next `check`; whatever it answers is dropped.
    """

    def __init__(self) -> None:
        self.cancelled = False
        self.done = False

    def start(self, work: Callable[[Job], T], receive: Callable[[T | CareError], None]) -> None:
        """Run `work`; its answer, or its error, goes to `receive`, in that thread."""
        threading.Thread(target=self._run, args=(work, receive), daemon=True).start()

    def _run(self, work: Callable[[Job], T], receive: Callable[[T | CareError], None]) -> None:
        try:
            answer: T | CareError = work(self)
        except CancelledError:
            return
        except Exception as err:
            answer = as_care_error(err)
        if not self.cancelled:
            receive(answer)

    def check(self) -> None:
        """Raise CancelledError when the work is not wanted any more."""
        if self.cancelled:
            raise CancelledError


CAUSES = 10
"""Most causes per fault in the app: more than a report shows, for here they scroll."""


def open_and_warm(request: Request, progress: Progress) -> Case:
    """The case with its question made, so that the first key in the fix waits for nothing. Raises CareError."""
    case = open_case(request, progress)
    if case.reading is not None and not case.diagnosis.run.checks:
        _ = case.reading.question
    return case


def comparison_of(a: Request, b: Request, progress: Progress) -> str:
    """Two logs side by side, A the one to compare with, in lines for a terminal. Raises CareError."""
    from care_core.application.comparing import compare

    return compare(a, b, progress).report()


def save_text(path: Path, text: str) -> None:
    """Write a file; it is whole or not there at all. Of one that is there the operator was asked; a log is kept."""
    from care_core.outputs import write_output

    write_output(path, text, force=True)


class Engine(Record):
    """Everything the walk asks of care_core."""

    diagnose: Callable[[Request, Progress], Case] = open_and_warm
    predict: Callable[[Case, Mapping[str, float]], Fix] = predict
    diff: Callable[[Case, Fix, DiffSide], str] = diff_of
    report: Callable[[Case, str], str] = report_of
    commands: Callable[[Diagnosis], list[str]] = commands_of
    save: Callable[[Path, str], None] = save_text
    remember: Callable[[Diagnosis, Request], CareError | None] = remember_triage
    compare: Callable[[Request, Request, Progress], str] = comparison_of


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
