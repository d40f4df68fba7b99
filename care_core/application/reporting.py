"""A run as a report: what of it may be shared, the signals drawn, and the format that writes it."""

from __future__ import annotations

from care_core.application.open_run import OpenRun
from care_core.application.sharing import EVERYTHING, Sharing
from care_core.report.formats import Answer, format_named
from care_core.report.plots import Drawing


def report_of(case: OpenRun, format: str, sharing: Sharing | None = None) -> str:
    """The fix report in one of its formats; a page draws the signals of the log. Raises UsageError."""
    row = format_named(format)
    if sharing is None and not row.is_sent:
        return row.write(Answer(case.diagnosis, lambda: _drawn(case, EVERYTHING)))
    sharing = sharing or Sharing(positions=False)
    shared = sharing.of(case)
    return row.write(Answer(shared.diagnosis, lambda: _drawn(shared, sharing)))


def fragment_of(case: OpenRun) -> str:
    """The answer in short as HTML for a page of others, with what goes to others."""
    from care_core.report.document import build_document
    from care_core.report.html import to_fragment

    return to_fragment(build_document(Sharing(positions=False).of(case).diagnosis))


def _drawn(case: OpenRun, sharing: Sharing) -> Drawing:
    from care_core.application.plotting import drawn_of

    return drawn_of(case, sharing)
