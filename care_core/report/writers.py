"""The report in the formats that files have."""

from __future__ import annotations

from io import StringIO
from typing import Any

from care_core.report.document import Report, TriageDocument
from care_core.report.published import to_json as written

_UNPUBLISHED = set(Report.__struct_fields__) - set(TriageDocument.__struct_fields__)
_YAML_WIDTH = 100


def to_json(report: Report) -> str:
    """The document `care.triage/1`, one object."""
    return written(published(report))


def published(report: Report) -> dict[str, Any]:
    """The document `care.triage/1` as plain values."""
    return {key: value for key, value in report.plain().items() if key not in _UNPUBLISHED}


def to_yaml(report: Report) -> str:
    """The document with the unified diff and the commands that apply it; the verdict stands above, as comments."""
    from ruamel.yaml import YAML
    from ruamel.yaml.scalarstring import LiteralScalarString

    data = {key: value for key, value in report.plain().items() if key != "verdict"}
    if report.diff:
        data["diff"] = LiteralScalarString(report.diff)
    yaml = YAML()
    yaml.width = _YAML_WIDTH
    stream = StringIO()
    yaml.dump(data, stream)
    return "".join(f"# {line}\n" for line in report.verdict.lines) + stream.getvalue()
