"""Reports as JUnit XML, for a CI that runs simulations: a log is a test suite, an objective a test case.

It keeps to what two schemas have in common, those of Apache Ant (JUnit.xsd) and of Jenkins' xUnit plugin
(junit-10.xsd); GitLab reads a part of it. Not evaluated is skipped, a limit that is broken fails with its cause and the
change that is suggested, a log that cannot be read is an error.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Literal
from xml.etree import ElementTree

from care_core.records import Record
from care_core.report.document import FaultEntry, ObjectiveEntry, Report
from care_core.report.health import finding_sentence
from care_core.report.wording import noted
from care_core.text import clean, log_times

Outcome = Literal["passed", "failure", "error", "skipped"]

_NO_CLOCK = "1970-01-01T00:00:00"
"""The schema of Ant wants a time of every suite; this one stands for a log without a clock."""
_HOST = "localhost"
"""Likewise a host; whose computer it was is nobody's business."""


class JUnitCase(Record):
    """An objective, with what is to be said of it where it did not pass."""

    name: str
    outcome: Outcome = "passed"
    message: str = ""
    text: str = ""


class Suite(Record):
    """A log."""

    name: str
    cases: tuple[JUnitCase, ...]
    properties: tuple[tuple[str, str], ...] = ()
    seconds: float = 0.0
    timestamp: str = _NO_CLOCK
    out: str = ""

    def count(self, outcome: Outcome) -> int:
        return sum(case.outcome == outcome for case in self.cases)


def suite_of(report: Report) -> Suite:
    """The suite of one triage."""
    log = report.log
    cases = [_case(one, report) for one in report.objectives]
    worst = [one for one in noted(report.findings) if one.severity == "critical" and not one.after_impact]
    if worst:
        told = "\n".join(finding_sentence(one) for one in worst)
        cases.append(JUnitCase("findings", "failure", "; ".join(one.title for one in worst), told))
    if not cases:
        cases.append(JUnitCase("run", "skipped", report.verdict.failed))
    robot = next((one.text for one in report.account if one.kind == "vehicle"), "")
    firmware = (("robot", robot),) if robot else ()
    times = log_times([one.time_s for one in report.account])
    return Suite(
        name=Path(log.path).name,
        cases=tuple(cases),
        properties=(
            ("profile", report.verdict.fit),
            ("verdict", report.verdict.headline),
            ("log format", log.format),
            *((("log sha256", log.sha256),) if log.sha256 else ()),
            *firmware,
        ),
        seconds=log.duration_s,
        timestamp=_timestamp(log.start),
        out="\n".join(map("  ".join, zip(times, (one.text for one in report.account), strict=True))),
    )


def unreadable(log: str, reason: str) -> Suite:
    """The suite of a log that could not be read."""
    return Suite(Path(log).name, (JUnitCase("log", "error", reason, reason),))


def _case(one: ObjectiveEntry, report: Report) -> JUnitCase:
    if one.status == "ok":
        return JUnitCase(one.name)
    if one.status == "not_evaluated":
        return JUnitCase(one.name, "skipped", one.reason or "not evaluated")
    fault = next((fault for fault in report.faults if fault.objective == one.name), None)
    return JUnitCase(one.name, "failure", one.sentence, "\n".join(_why(one, fault, report)))


def _why(one: ObjectiveEntry, fault: FaultEntry | None, report: Report) -> list[str]:
    """What is known of a failure, cause and suggestion first."""
    lines = [f"because: {one.reason}"] if one.reason else []
    for cause in fault.causes[:3] if fault else ():
        to = "" if cause.suggested is None else f", suggested {cause.suggested:g}"
        path = " -> ".join(cause.path)
        lines.append(f"cause {cause.rank}: {path} (driven {cause.current:g}{to}; {cause.confidence} confidence)")
    verdict = report.verdict
    lines += [str(verdict.advice)] if str(verdict.advice) else []
    lines += [*report.apply, *map(str, verdict.reasons)]
    return [line.replace("\u00a0", " ") for line in lines]


def to_junit(suites: Sequence[Suite]) -> str:
    """The suites as one document."""
    root = ElementTree.Element("testsuites")
    for number, suite in enumerate(suites):
        root.append(_suite(suite, number))
    ElementTree.indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ElementTree.tostring(root, encoding="unicode")}\n'


def _suite(suite: Suite, number: int) -> ElementTree.Element:
    element = ElementTree.Element(
        "testsuite",
        {
            "name": clean(suite.name),
            "package": "care",
            "id": str(number),
            "tests": str(len(suite.cases)),
            "failures": str(suite.count("failure")),
            "errors": str(suite.count("error")),
            "skipped": str(suite.count("skipped")),
            "time": f"{suite.seconds:.3f}",
            "timestamp": suite.timestamp,
            "hostname": _HOST,
        },
    )
    properties = ElementTree.SubElement(element, "properties")
    for name, value in suite.properties:
        ElementTree.SubElement(properties, "property", {"name": name, "value": clean(value)})
    for case in suite.cases:
        attributes = {"name": clean(case.name), "classname": _classname(suite.name), "time": "0"}
        place = ElementTree.SubElement(element, "testcase", attributes)
        if case.outcome == "skipped":
            ElementTree.SubElement(place, "skipped", {"message": clean(case.message)})
        elif case.outcome != "passed":
            told = ElementTree.SubElement(
                place, case.outcome, {"message": clean(case.message), "type": f"care.{case.outcome}"}
            )
            told.text = "\n".join(map(clean, case.text.splitlines()))
    ElementTree.SubElement(element, "system-out").text = "\n".join(map(clean, suite.out.splitlines()))
    ElementTree.SubElement(element, "system-err").text = ""
    return element


def _classname(log: str) -> str:
    """What CI groups cases by: the log without its ending, without the points that would nest it."""
    return f"care.{clean(Path(log).stem).replace('.', '_')}"


def _timestamp(start: str | None) -> str:
    """The start of a log as the schema of Ant has it: to the second, without a zone; it is UTC."""
    found = re.match(r"\d{4}-\d{2}-\d{2}T\d{2}:\d{2}:\d{2}", start or "")
    return found[0] if found else _NO_CLOCK
