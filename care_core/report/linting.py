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
_FEW, _NAMED = 3, 12
"""Problems up to which each has its own paragraph, and how many of the others of one are named."""


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
    """One paragraph a problem: where, how bad, what, what to do, and the source. Problems of one file that differ in
    nothing but the parameter share a paragraph where they are several."""
    return "".join(f"{line}\n" for one in linted for problems in _alike(one) for line in _lines(*problems))


def _alike(linted: Linted) -> Iterator[tuple[Problem, ...]]:
    """The problems in their order, those that say the same with the first of them."""
    same: dict[tuple[str, ...], list[Problem]] = {}
    for problem in linted.problems:
        text = problem.text.replace(problem.parameter, "") if problem.parameter else problem.text
        same.setdefault((problem.rule, problem.severity.value, text, problem.hint, problem.source), []).append(problem)
    groups = [group for several in same.values() for group in ([several] if several[_FEW:] else zip(several))]
    yield from sorted((tuple(group) for group in groups), key=lambda group: linted.problems.index(group[0]))


def _lines(problem: Problem, *others: Problem) -> Iterator[str]:
    yield clean(f"{problem.path}:{problem.line}:{problem.column}: {problem.severity.value} [{problem.rule}]")
    yield from wrapped(f"{problem.text} {problem.hint}".strip(), _INDENT)
    if others:
        named = "; ".join(f"{clean(one.parameter)}, line {one.line}".lstrip(", ") for one in others[:_NAMED])
        more = f"; and {len(others) - _NAMED} more" if others[_NAMED:] else ""
        yield from wrapped(f"The same holds of {len(others)} more: {named}{more}.", _INDENT)
    yield from wrapped(f"source: {problem.source}", _INDENT)


def counted(linted: Sequence[Linted]) -> str:
    """How many findings of each severity in how many files, and whether most of what these hold is not judged."""
    findings = [problem for one in linted for problem in one.problems]
    parts = []
    for severity in Severity:
        count = sum(problem.severity is severity for problem in findings)
        if count:
            parts.append(f"{count} {severity.value}{'' if count == 1 else 's'}")
    files = f"{len(linted)} file{'' if len(linted) == 1 else 's'}"
    strange = [one for one in linted if 2 * one.unknown > len(one.file.entries)]
    more = ""
    if strange:
        of_some = f"; of {len(strange)} of them care does not know most keys"
        more = ", most of whose keys care does not know" if len(strange) == len(linted) else of_some
    return f"{', '.join(parts) or 'nothing found'} in {files}{more}"


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
