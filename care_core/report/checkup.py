"""`care.doctor/1`: what works on this computer, for other programs and for people."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final, Literal

from care_core.records import field
from care_core.report.published import Document
from care_core.text import clean, wrapped

SCHEMA_ID: Final = "care.doctor/1"
_WIDTH = 16


class CheckEntry(Document, kw_only=True):
    """`do` is empty where nothing is to be done."""

    name: str
    status: Literal["ok", "warn", "fail"]
    says: str
    do: str


class DoctorDocument(Document, kw_only=True):
    """What `care doctor --json` prints; `status` is the worst of the checks."""

    schema_: Literal["care.doctor/1"] = field(default=SCHEMA_ID, name="schema")
    version: str
    status: Literal["ok", "warn", "fail"]
    checks: list[CheckEntry]


def doctor_document(version: str, checks: Sequence[CheckEntry]) -> DoctorDocument:
    """The document of what was looked at."""
    statuses = {check.status for check in checks}
    worst: Literal["ok", "warn", "fail"] = "fail" if "fail" in statuses else "warn" if "warn" in statuses else "ok"
    return DoctorDocument(version=version, status=worst, checks=list(checks))


def _things(count: int) -> str:
    return f"{count} thing{'' if count == 1 else 's'}"


def doctor_text(document: DoctorDocument) -> str:
    """The check-up in lines: what is so, and below it what to do."""
    return "\n".join(_lines(document)) + "\n"


def _lines(document: DoctorDocument) -> Iterator[str]:
    for check in document.checks:
        name = clean(check.name)
        yield from wrapped(check.says, first=f"{check.status:<5} {name:<{_WIDTH}} ", rest=" " * (_WIDTH + 7))
        if check.do:
            yield from wrapped(check.do, first=f"{'':<{_WIDTH + 7}}-> ")
    counts = {status: sum(check.status == status for check in document.checks) for status in ("warn", "fail")}
    yield ""
    if document.status == "fail":
        yield f"{counts['fail']} to repair, {_things(counts['warn'])} to know"
    else:
        yield f"care {document.version} works here" + (f", {_things(counts['warn'])} to know" if counts["warn"] else "")
