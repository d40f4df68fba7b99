"""The report in the formats that files have."""

from __future__ import annotations

from io import StringIO
from typing import Any

from care_core.diagnose.records import Status, overall
from care_core.report.document import Report, TriageDocument
from care_core.report.published import to_json as written
from care_core.report.wording import fit_text, said_without_profile

STATUS_WORDS = {"ok": "OK", "fault": "FAULT", "not_evaluated": "NOT EVALUATED"}

_UNPUBLISHED = set(Report.__struct_fields__) - set(TriageDocument.__struct_fields__)
_YAML_WIDTH = 100


def to_json(report: Report) -> str:
    """The document `care.triage/1`, one object."""
    return written(published(report))


def published(report: Report) -> dict[str, Any]:
    """The document `care.triage/1` as plain values."""
    return {key: value for key, value in report.plain().items() if key not in _UNPUBLISHED}


def to_yaml(report: Report) -> str:
    """The document with the unified diff and the commands that apply it, below how well the profile fits."""
    from ruamel.yaml import YAML
    from ruamel.yaml.scalarstring import LiteralScalarString

    data = report.plain()
    if report.diff:
        data["diff"] = LiteralScalarString(report.diff)
    yaml = YAML()
    yaml.width = _YAML_WIDTH
    stream = StringIO()
    yaml.dump(data, stream)
    return f"# {fit_text(report.profile.name if report.profile else '', report.fit)}\n{stream.getvalue()}"


def plain_verdict(report: Report) -> tuple[Status, str]:
    """The verdict of a document on a run that no profile fits, and what it says."""
    severities = {one.severity for one in report.findings}
    status = overall({one.status for one in report.objectives}, severities, report.fit.verdict)
    worst = [one.title for one in report.findings if one.severity == "critical" and not one.after_impact]
    return status, said_without_profile(status, report.objectives, worst, report.findings)
