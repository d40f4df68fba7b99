"""What is wrong with configuration files, for other programs (`care.lint/1`, SARIF 2.1.0) and for people."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Final, Literal

from care_core.lint.linting import Linted
from care_core.lint.problems import Problem, Severity
from care_core.lint.rules import RULES
from care_core.records import field
from care_core.report.published import Document
from care_core.text import clean, wrapped

SCHEMA_ID: Final = "care.lint/1"
_SARIF_SCHEMA = "https://json.schemastore.org/sarif-2.1.0.json"
_INDENT = "    "


class FindingEntry(Document, kw_only=True):
    """Something wrong at one place of a file; line and column from 1."""

    rule: str
    severity: Literal["error", "warning", "note"]
    file: str
    line: int
    column: int
    parameter: str
    text: str
    hint: str
    source: str


class FileEntry(Document, kw_only=True):
    """A file that was read, with how many values it has."""

    file: str
    format: str
    values: int


class LintDocument(Document, kw_only=True):
    """What is wrong with configuration files, as `care lint --json` prints it."""

    schema_: Literal["care.lint/1"] = field(default=SCHEMA_ID, name="schema")
    target: str
    files: list[FileEntry]
    findings: list[FindingEntry]


def lint_schema() -> dict[str, Any]:
    """The JSON Schema of the lint document."""
    return LintDocument.json_schema()


def lint_document(linted: Sequence[Linted], target: str) -> LintDocument:
    """The findings as a document."""
    return LintDocument(
        target=target,
        files=[
            FileEntry(file=str(one.file.path), format=one.file.format.name, values=len(one.file.entries))
            for one in linted
        ],
        findings=[_entry(problem) for one in linted for problem in one.problems],
    )


def _entry(problem: Problem) -> FindingEntry:
    return FindingEntry(
        rule=problem.rule,
        severity=problem.severity.value,
        file=str(problem.path),
        line=problem.line,
        column=problem.column,
        parameter=clean(problem.parameter),
        text=clean(problem.text),
        hint=clean(problem.hint),
        source=problem.source,
    )


def lint_text(linted: Sequence[Linted]) -> str:
    """One paragraph a problem: where, how bad, what, what to do, and the source."""
    return "".join(f"{line}\n" for one in linted for problem in one.problems for line in _lines(problem))


def _lines(problem: Problem) -> Iterator[str]:
    yield clean(f"{problem.path}:{problem.line}:{problem.column}: {problem.severity.value} [{problem.rule}]")
    yield from wrapped(f"{problem.text} {problem.hint}".strip(), _INDENT)
    yield from wrapped(f"source: {problem.source}", _INDENT)


def counted(linted: Sequence[Linted]) -> str:
    """How many findings of each severity in how many files."""
    findings = [problem for one in linted for problem in one.problems]
    parts = []
    for severity in Severity:
        count = sum(problem.severity is severity for problem in findings)
        if count:
            parts.append(f"{count} {severity.value}{'' if count == 1 else 's'}")
    files = f"{len(linted)} file{'' if len(linted) == 1 else 's'}"
    return f"{', '.join(parts) or 'nothing found'} in {files}"


def lint_sarif(linted: Sequence[Linted], version: str) -> dict[str, Any]:
    """The findings as SARIF 2.1.0, which code hosts and editors show at the line."""
    rules = [{"id": rule.id, "shortDescription": {"text": rule.about}, "help": {"text": rule.source}} for rule in RULES]
    order = {rule.id: index for index, rule in enumerate(RULES)}
    driver = {"name": "care lint", "version": version, "rules": rules}
    results = [_result(problem, order[problem.rule]) for one in linted for problem in one.problems]
    return {
        "$schema": _SARIF_SCHEMA,
        "version": "2.1.0",
        "runs": [{"tool": {"driver": driver}, "columnKind": "unicodeCodePoints", "results": results}],
    }


def _result(problem: Problem, index: int) -> dict[str, Any]:
    entry = _entry(problem)
    place = {
        "artifactLocation": {"uri": problem.path.as_posix()},
        "region": {"startLine": problem.line, "startColumn": problem.column},
    }
    return {
        "ruleId": entry.rule,
        "ruleIndex": index,
        "level": entry.severity,
        "message": {"text": f"{entry.text} {entry.hint} (source: {entry.source})"},
        "locations": [{"physicalLocation": place}],
    }
