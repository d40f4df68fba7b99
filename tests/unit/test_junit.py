"""JUnit XML as Jenkins and GitLab take it: what two published schemas have in common, rule by rule."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree

import pytest

from care_core.application.case import Request
from care_core.application.each import answer_of
from care_core.application.suites import suite_of_log
from care_core.diagnose.records import Diagnosis
from care_core.ecosystems.findings import NOTHING_SEEN
from care_core.files import bundled
from care_core.records import replace
from care_core.report.document import build_document
from care_core.report.junit import suite_of, to_junit, unreadable
from tests.made import HOSTILE, made_diagnosis

SUITE = {
    "name", "package", "id", "tests", "failures", "errors", "skipped", "time", "timestamp", "hostname",
}  # fmt: skip
OUTCOMES = {"failure": {"message", "type"}, "error": {"message", "type"}, "skipped": {"message"}}


def checked(text: str) -> list[ElementTree.Element]:
    """The suites of a document that keeps both schemas: Ant's (order, required attributes) and Jenkins' (no others)."""
    root = ElementTree.fromstring(text.encode())
    assert (root.tag, root.attrib) == ("testsuites", {})
    for number, suite in enumerate(root):
        assert (suite.tag, set(suite.attrib), suite.get("id")) == ("testsuite", SUITE, str(number))
        assert re.fullmatch(r"\d{4}-\d{2}-\d{2}T\d{2}:\d{2}:\d{2}", suite.get("timestamp", ""))
        assert re.fullmatch(r"\d+\.\d+", suite.get("time", ""))
        tags = [child.tag for child in suite]
        cases = suite.findall("testcase")
        assert tags == ["properties", *["testcase"] * len(cases), "system-out", "system-err"]
        assert all(set(one.attrib) == {"name", "value"} for one in suite[0])
        assert suite.get("tests") == str(len(cases))
        for tag, attribute in (("failure", "failures"), ("error", "errors"), ("skipped", "skipped")):
            assert suite.get(attribute) == str(len(suite.findall(f"testcase/{tag}")))
        for case in cases:
            assert set(case.attrib) == {"name", "classname", "time"}
            assert len(case) <= 1
            assert all(set(one.attrib) == OUTCOMES[one.tag] for one in case)
    return list(root)


def suite(diagnosis: Diagnosis) -> ElementTree.Element:
    return checked(to_junit([suite_of(build_document(diagnosis))]))[0]


def test_an_objective_is_a_case_and_a_broken_limit_fails_with_cause_and_suggestion() -> None:
    found = suite(replace(made_diagnosis(), health=NOTHING_SEEN))
    cases = {case.get("name"): case for case in found.findall("testcase")}
    assert list(cases) == ["success", "mission_time", "energy"]
    assert len(cases["success"]) == 0
    failure = cases["mission_time"].find("failure")
    assert failure is not None
    assert failure.get("message") == "too slow: 190 s, limit 150 s"
    told = failure.text or ""
    assert "land_speed -> land_time -> mission_time" in told
    assert "Change land_speed 16 -> 50 (70% the cause): 90% probability that all objectives are met" in told
    assert "param set LAND_SPEED 50" in told
    skipped = cases["energy"].find("skipped")
    assert skipped is not None
    assert skipped.get("message") == "no BAT in the log"


def test_a_critical_finding_fails_though_every_limit_was_kept() -> None:
    made = made_diagnosis()
    found = suite(replace(made, objectives=made.objectives[:1], faults=(), fix=None))
    assert [(case.get("name"), len(case)) for case in found.findall("testcase")] == [("success", 0), ("findings", 1)]


def test_a_run_that_nothing_judges_is_skipped_and_never_green() -> None:
    found = suite(replace(made_diagnosis(), objectives=(), faults=(), fix=None, health=NOTHING_SEEN))
    assert [case[0].tag for case in found.findall("testcase")] == ["skipped"]


def test_text_of_a_log_breaks_no_xml() -> None:
    made = made_diagnosis()
    nasty = f"]]></failure>{HOSTILE}\x00\ufffe\ud800&<"
    log = replace(made.run.log, path=f"/x/{nasty}.BIN", facts={}, start="nonsense")
    text = to_junit([suite_of(build_document(replace(made, run=replace(made.run, log=log)))), unreadable(nasty, nasty)])
    suites = checked(text)
    assert not set(text) & {"\x1b", "\x00", "\u202e", "\ufffe"}
    assert suites[1][1][0].tag == "error"


def test_each_log_is_a_suite_and_one_that_cannot_be_read_an_error(tmp_path: Path) -> None:
    broken = tmp_path / "broken.BIN"
    broken.write_bytes(b"\xa3\x95")
    found = [answer_of(Request(path), lambda *_: None) for path in (bundled("samples", "ardurover_failed.BIN"), broken)]
    suites = checked(to_junit([suite_of_log(one, None) for one in found]))
    assert [one.get("name") for one in suites] == ["ardurover_failed.BIN", "broken.BIN"]
    assert [one.get("errors") for one in suites] == ["0", "1"]
    assert suites[0].get("timestamp") != suites[1].get("timestamp") == "1970-01-01T00:00:00"
    assert [one.status for one in found] == ["fault", "unreadable"]


@pytest.mark.parametrize("start", [None, "", "2026-11-22T00:42:33.123+00:00"])
def test_a_suite_has_a_time_whatever_the_log_says(start: str | None) -> None:
    made = made_diagnosis()
    found = suite(replace(made, run=replace(made.run, log=replace(made.run.log, start=start))))
    assert found.get("timestamp") == ("2026-11-22T00:42:33" if start else "1970-01-01T00:00:00")
