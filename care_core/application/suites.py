"""A log's answer as a test suite; one that cannot be read is an error."""

from __future__ import annotations

from typing import TYPE_CHECKING

from care_core.application.each import Answered

if TYPE_CHECKING:
    from care_core.application.sharing import Sharing
    from care_core.report.junit import Suite


def suite_of_log(answered: Answered, sharing: Sharing | None) -> Suite:
    """The suite of a log that was triaged, with what of it goes to others."""
    from care_core.application.sharing import Sharing
    from care_core.report.document import build_document
    from care_core.report.junit import suite_of, unreadable

    sharing = sharing or Sharing(positions=False)
    if answered.case is None:
        name = f"log{answered.log.suffix}" if sharing.anonymous else answered.log.name
        return unreadable(name, answered.says)
    return suite_of(build_document(sharing.of(answered.case).diagnosis))
