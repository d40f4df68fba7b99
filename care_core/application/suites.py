"""Logs as test suites: each is triaged by itself, and one that cannot be read is an error and stops no other."""

from __future__ import annotations

from typing import TYPE_CHECKING

from care_core.application.case import Case, Progress, Request, open_case
from care_core.diagnose.verdict import RunStatus
from care_core.errors import LogError
from care_core.records import Record

if TYPE_CHECKING:
    from care_core.application.sharing import Sharing
    from care_core.report.junit import Suite


class LogSuite(Record, eq=False):
    """A log as a suite, what became of it, and its case, None where it could not be read."""

    suite: Suite
    status: RunStatus
    case: Case | None = None


def suite_of_log(request: Request, sharing: Sharing | None, progress: Progress) -> LogSuite:
    """Triage a log. Raises CareError for what is wrong with the request, not with the log."""
    from care_core.application.sharing import Sharing
    from care_core.report.document import build_document
    from care_core.report.junit import suite_of, unreadable

    sharing = sharing or Sharing(positions=False)
    try:
        case = open_case(request, progress)
    except LogError as err:
        name = f"log{request.log.suffix}" if sharing.anonymous else request.log.name
        return LogSuite(unreadable(name, err.message), "unreadable")
    document = build_document(sharing.of(case).diagnosis)
    return LogSuite(suite_of(document), document.verdict.status, case)
