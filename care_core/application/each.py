"""Several logs, each triaged by itself: one that cannot be read is told and stops no other."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from care_core.application.case import Case, Request, open_case
from care_core.diagnose.verdict import RunStatus, verdict_of
from care_core.errors import LogError
from care_core.progress import Progress
from care_core.records import Record


class Answered(Record, eq=False):
    """What became of a log in a few words, and its case, None where it could not be read."""

    log: Path
    status: RunStatus
    says: str
    case: Case | None = None


def answer_of(request: Request, progress: Progress) -> Answered:
    """Triage a log. Raises CareError for what is wrong with the request, not with the log."""
    try:
        case = open_case(request, progress)
    except LogError as err:
        return Answered(request.log, "unreadable", err.message)
    verdict = verdict_of(case.diagnosis)
    return Answered(request.log, verdict.status, verdict.in_short, case)


def logs_of(named: Iterable[Path]) -> tuple[Path, ...]:
    """The logs that are named, and for a folder those below it, unless it is one recording or holds none."""
    from care_core.logs.finding import logs_below

    logs: dict[Path, None] = {}
    for path in named:
        below = logs_below(path) if path.is_dir() else []
        logs.update(dict.fromkeys(below if below and not _is_one_recording(path, below) else [path]))
    return tuple(logs)


def _is_one_recording(folder: Path, logs: Iterable[Path]) -> bool:
    """Whether all the logs in a folder are parts of one."""
    from care_core.logs.recording import recording_at

    try:
        parts = recording_at(folder).files
    except LogError:
        return False
    return {*logs} <= {folder, *parts}
