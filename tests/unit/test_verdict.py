"""One verdict a run: every format says its status, sentence and odds; the exit code is that of the status."""

from __future__ import annotations

import json
from html import unescape
from xml.etree import ElementTree

import pytest

import care_core
from care_core.application.case import Case
from care_core.diagnose.verdict import STATUS_WORDS, Verdict, exit_code, verdict_of
from care_core.errors import ExitCode, UsageError
from care_core.files import bundled
from care_core.report.document import remembered_verdict
from care_core.report.formats import FORMATS
from care_core.report.reading import document_of

SAMPLES = (
    "arducopter_failed.BIN", "arducopter_motor.BIN", "ardurover_failed.BIN", "move_base_drive.bag", "owlat_failed.bag",
)  # fmt: skip
WITHOUT_SENTENCE = {"patch": "a diff alone", "json": "its keys are fixed: what they say is composed again when read"}


@pytest.fixture(scope="module", params=SAMPLES)
def case(request: pytest.FixtureRequest) -> Case:
    return care_core.triage(bundled("samples", request.param))


def flat(text: str) -> str:
    """The text as it is read: without line breaks, marks of markup and comments."""
    for sign, plain in (("<strong>", ""), ("</strong>", ""), ("\\", ""), ("**", ""), ("\u00a0", " ")):
        text = text.replace(sign, plain)
    return " ".join(unescape(text).split())


def test_every_format_says_the_verdict(case: Case) -> None:
    verdict = verdict_of(case.diagnosis)
    for name in FORMATS.keys() - WITHOUT_SENTENCE.keys():
        text = flat(case.report(name))
        assert flat(verdict.headline) in text, name
        assert flat(str(verdict.advice)) in text, name
        assert name == "yaml" or all(flat(reason.text) in text for reason in verdict.reasons[:3]), name


def test_no_other_status_stands_in_front(case: Case) -> None:
    verdict = verdict_of(case.diagnosis)
    word = STATUS_WORDS[verdict.status]
    assert case.report("text").splitlines()[1].startswith(f"{word}: ") or verdict.fit.count(" ") > 10
    assert f'<p class="verdict {verdict.status}"><strong>{word}</strong>' in case.report("html")
    assert f"**{word}**: " in case.report("markdown")
    suite = ElementTree.fromstring(case.report("junit"))[0]
    assert (int(suite.get("failures", "0")) > 0) == (verdict.status == "fault")


def test_what_is_remembered_has_the_same_verdict(case: Case) -> None:
    verdict = verdict_of(case.diagnosis)
    again = remembered_verdict(document_of(json.loads(case.report("json"))))
    for part in ("fit", "status", "failed", "next_step"):
        assert getattr(again, part) == getattr(verdict, part)
    assert again.advice.refusal == verdict.advice.refusal
    assert again.advice.odds == pytest.approx(verdict.advice.odds, rel=1e-5)
    assert [(one.text, one.name) for one in again.reasons] == [(one.text, one.name) for one in verdict.reasons]


def test_the_exit_code_is_that_of_the_gravest_status() -> None:
    assert exit_code("ok") == ExitCode.OK
    assert exit_code("ok", "not_evaluated") == ExitCode.NOT_EVALUATED
    assert exit_code("not_evaluated", "unreadable") == ExitCode.UNREADABLE
    assert exit_code("unreadable", "fault", "ok") == ExitCode.FAULT


def test_advice_names_the_odds_as_driven() -> None:
    verdict: Verdict = verdict_of(care_core.triage(bundled("samples", SAMPLES[0])).diagnosis)
    assert verdict.advice.odds_as_driven is not None
    assert verdict.advice.odds_as_driven < verdict.advice.odds
    assert f"({verdict.advice.odds_as_driven:.0%} without the change)" in str(verdict.advice)


def test_an_unknown_format_is_refused_with_the_nearest() -> None:
    case = care_core.triage(bundled("samples", SAMPLES[0]))
    with pytest.raises(UsageError, match="markdown"):
        case.report("markdwon")
