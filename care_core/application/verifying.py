"""What a report promised, held against a run that was opened after it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from care_core.application.open_run import OpenRun
from care_core.errors import ProfileError

if TYPE_CHECKING:
    from care_core.profile.store import Profile
    from care_core.report.document import TriageDocument
    from care_core.report.verification import VerifyDocument


def held_against(
    promised: TriageDocument,
    path: Path,
    case: OpenRun,
    thresholds: Mapping[str, float],
    chosen: Profile | None = None,
) -> VerifyDocument:
    """What became of a report's promise in the run of a case.

    Args:
        path: where the report is from, for errors.
        thresholds: bounds of the operator's own that the run was judged by.
        chosen: the profile that its parameters are of, by default that which the report names.

    Raises:
        CareError: the report suggests no change, or one of no parameter of its profile; no such profile is installed;
            the run was judged by another.
    """
    from care_core.diagnose.verify import verify
    from care_core.report.suggested import report_profile
    from care_core.report.verification import promise_of, verify_document

    profile = chosen or report_profile(promised, path)
    schema, judged = profile.schema, case.reading.profile.schema if case.reading else None
    if judged is not None and judged.name != schema.name:
        raise ProfileError(
            f"The report is of profile '{schema.name}', and this run was judged by '{judged.name}'.",
            hint="Hold it against a later run of the robot that it is of.",
        )
    promise = promise_of(promised, schema, path)
    return verify_document(promised, case.diagnosis.run, verify(promise, case.diagnosis, judged or schema, thresholds))
