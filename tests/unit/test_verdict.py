"""One verdict a run: every format says its status, sentence and odds; the exit code is that of the status."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Sequence
from html import unescape
from xml.etree import ElementTree

import pytest

import care_core
from care_core.application.case import Case
from care_core.diagnose.records import Hypothesis, MissionVerdict, ObjectiveResult
from care_core.diagnose.verdict import (
    STATUS_WORDS,
    UNKNOWN_PARAMETER,
    Advice,
    Reason,
    Verdict,
    alone_of,
    compose,
    exit_code,
    fit_line,
    hypothesis_text,
    verdict_of,
)
from care_core.ecosystems.findings import STEERED, Finding, Health
from care_core.errors import ExitCode, UsageError
from care_core.files import bundled
from care_core.records import replace
from care_core.report.document import build_document, remembered_verdict
from care_core.report.formats import FORMATS
from care_core.report.health import REASONS_SHOWN, reason_lines
from care_core.report.reading import document_of
from care_core.report.terminal import to_text
from care_core.report.writers import to_json
from care_core.run import FITS, Fit
from care_core.text import wrapped
from tests.made import SUCCESS, made_diagnosis

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
    assert case.report("text").splitlines()[0].startswith(f"{word}: ")
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
    odds, as_driven = verdict.advice.odds, verdict.advice.odds_as_driven
    assert odds is not None
    assert as_driven is not None
    assert as_driven < odds
    assert f"{odds:.0%} probability that all objectives are met; as driven {as_driven:.0%}" in flat(str(verdict.advice))


def test_an_unknown_format_is_refused_with_the_nearest() -> None:
    case = care_core.triage(bundled("samples", SAMPLES[0]))
    with pytest.raises(UsageError, match="markdown"):
        case.report("markdwon")


def verdict_on(
    objectives: Sequence[ObjectiveResult], findings: Sequence[Finding] = (), fit: Fit = FITS, profile: str = "copter"
) -> Verdict:
    return compose(profile, fit, objectives, findings, (), Advice(), "")


MET = ObjectiveResult(SUCCESS, 1.0, SUCCESS.threshold, "ok")
HOW = "2 of 3 waypoints were reached; battery failsafe at 273.0 s; disarmed by force at 300.0 s"
LASER = Finding("laser", "the laser falls silent: /scan ends", 35.9, 60.0, "warning", "", "", probability=0.9)
DRIFTS = Finding("barometer", "the barometer drifts", 166.1, 170.0, "critical", "", "")


def test_a_fault_says_what_failed() -> None:
    failed = ObjectiveResult(SUCCESS, 0.0, SUCCESS.threshold, "fault", HOW)
    assert verdict_on([failed]).headline == f"FAULT: {HOW}"
    assert verdict_on([replace(failed, reason="")], [LASER]).failed == f"success not met; {LASER.title} at 35.9 s"


def test_the_first_cause_is_told_before_what_followed_and_no_headline_is_longer_than_two_lines() -> None:
    failed = ObjectiveResult(SUCCESS, 0.0, SUCCESS.threshold, "fault", HOW)
    said = verdict_on([failed], [DRIFTS, replace(DRIFTS, title="a very long finding " * 4)]).headline
    assert said.startswith(
        "FAULT: 2 of 3 waypoints were reached; the barometer drifts at 166.1 s (2:46); battery failsafe"
    )
    assert len(wrapped(said)) <= 2


def test_what_a_headline_tells_first_happened_first() -> None:
    failed = ObjectiveResult(
        SUCCESS, 0.0, SUCCESS.threshold, "fault", "2 of 3 reached; battery failsafe at 252.9 s (4:13)"
    )
    sags = Finding("battery", "the battery sags under its load", 331.6, 350.0, "critical", "", "")
    told = "2 of 3 reached; battery failsafe at 252.9 s (4:13); the battery sags under its load at 331.6 s (5:32)"
    assert verdict_on([failed], [sags]).failed == told


def test_how_it_came_down_is_told_once() -> None:
    short = "1 of 3 waypoints were reached; it hit the ground at 27.3 s; battery failsafe at 27.3 s"
    failed = ObjectiveResult(SUCCESS, 0.0, SUCCESS.threshold, "fault", short)
    steered = Finding("crash", STEERED, 27.3, 27.3, "critical", "", "")
    assert verdict_on([failed], [steered]).failed == (
        f"1 of 3 waypoints were reached; {steered.title} at 27.3 s; battery failsafe at 27.3 s"
    )
    assert "it hit the ground at 27.3 s" in verdict_on([failed], [replace(steered, onset_s=20.0)]).failed
    fast = [
        ObjectiveResult(SUCCESS, 0.0, SUCCESS.threshold, "fault", said)
        for said in ("it hit the ground at 10.2 m/s", "it hit the ground at 10.2 m/s at 27.3 s")
    ]
    assert verdict_on(fast, []).failed == "it hit the ground at 10.2 m/s at 27.3 s"


@pytest.mark.parametrize(
    ("acts", "told"),
    [
        (0.87, "the parameter LOW; 87% that it acted as well, so put it right too"),
        (0.3, "the parameter LOW; 30% that it acted as well"),
        (0.1, "the parameter LOW"),
    ],
)
def test_what_likely_acted_beside_the_first_is_put_right_too(acts: float, told: str) -> None:
    assert hypothesis_text(Hypothesis("parameter", "LOW", 0.05, acts)) == told


@pytest.mark.parametrize(("title", "is_shown"), [(STEERED, True), ("it crashed", False)])
def test_the_log_shows_why_what_was_steered_down_crashed(title: str, is_shown: bool) -> None:
    crash = Finding("crash", title, 27.3, 27.3, "critical", "", "")
    text = hypothesis_text(Hypothesis("world", title, 0.9, 0.9), [crash])
    assert text == (title if is_shown else f"{title}; the log does not show why")


def test_a_critical_finding_of_a_run_that_met_its_objectives_is_a_fault_that_says_both() -> None:
    assert verdict_on([MET], [DRIFTS]).headline == (
        "FAULT: the barometer drifts at 166.1 s (2:46); every objective was met"
    )


def test_a_run_that_only_armed_has_no_objectives_to_meet() -> None:
    armed = replace(MET, variable=replace(MET.variable, name="armed"))
    assert verdict_on([armed], [DRIFTS]).headline == "FAULT: the barometer drifts at 166.1 s (2:46)"


def test_an_ok_names_the_part_that_surely_failed() -> None:
    verdict = verdict_on([MET], [LASER])
    assert verdict.headline == "OK, but the laser falls silent: /scan ends at 35.9 s"
    assert verdict.exit_code == ExitCode.OK
    assert verdict.in_short == "but the laser falls silent: /scan ends at 35.9 s"
    assert verdict_on([MET], [replace(LASER, probability=0.3)]).headline.startswith("OK: all objectives")
    assert verdict_on([MET], [replace(LASER, suspect="parameter")]).headline.startswith("OK: all objectives")


def test_a_refusal_to_arm_is_told_once() -> None:
    refused = ObjectiveResult(SUCCESS, 0.0, SUCCESS.threshold, "fault", "arming was refused: Compass not healthy")
    finding = Finding("prearm", "arming was refused: Compass not healthy (2)", 2.0, 9.0, "critical", "", "")
    assert verdict_on([refused], [finding]).headline == "FAULT: arming was refused: Compass not healthy"


def test_what_the_headline_says_is_not_said_again_beside_the_change() -> None:
    why = "arming was refused: Compass not healthy"
    refused = [ObjectiveResult(SUCCESS, 0.0, SUCCESS.threshold, "fault", why)]
    first = Advice(refusal=f"check first COMPASS_TYPEMASK 3 (default 0): {why}")
    assert compose("copter", FITS, refused, (), (), first, "").advice.refusal.endswith("COMPASS_TYPEMASK 3 (default 0)")
    px4 = Advice(refusal="check first CAL_ACC0_ZSCALE 3: not ready to fly: Compass not healthy")
    assert compose("px4", FITS, refused, (), (), px4, "").advice.refusal == "check first CAL_ACC0_ZSCALE 3"
    changed = Advice("A 1 -> 0", 0.8, 0.1, cause=0.97, why=why)
    told = str(compose("copter", FITS, refused, (), (), changed, "").advice)
    assert told == "Change A 1 -> 0 (97% the cause): 80% probability that all objectives are met; as driven 10%"
    shown = replace(changed, why=f"this run shows it: {why}")
    assert str(compose("copter", FITS, refused, (), (), shown, "").advice).endswith("; this run shows it")


def test_one_reason_for_all_that_could_not_be_judged_is_the_first_line() -> None:
    def unknown(reason: str) -> ObjectiveResult:
        return ObjectiveResult(SUCCESS, None, SUCCESS.threshold, "not_evaluated", reason)

    why = "the vehicle never armed, and nobody asked it to; it would refuse: RC not found"
    never = [unknown(why), unknown("the vehicle never armed (see why arming was refused)")]
    assert verdict_on(never).headline == f"NOT EVALUATED: {why}"
    assert verdict_on([*never, MET]).headline == f"NOT EVALUATED: success, success: {why}; no fault was found"


def test_whose_a_reason_is_is_told_where_it_is_not_that_of_many() -> None:
    def unknown(name: str, reason: str) -> ObjectiveResult:
        return ObjectiveResult(replace(SUCCESS, name=name), None, SUCCESS.threshold, "not_evaluated", reason)

    none = [unknown(name, "no mission was flown") for name in ("mission_success", "mission_time", "energy")]
    grounded = unknown("took_off", "it never left the ground")
    told = "NOT EVALUATED: no mission was flown; it never left the ground; no fault was found"
    assert verdict_on([*none, grounded, MET]).headline == told
    assert verdict_on([unknown("energy", ""), MET]).headline == (
        "NOT EVALUATED: energy could not be evaluated; no fault was found"
    )
    long = [unknown(f"o{n}", f"the topic that tells of number {n} is not in this log") for n in range(9)]
    assert len(wrapped(verdict_on(long).headline)) <= 2


def test_the_fit_comes_last_in_two_lines_at_most_and_names_no_profile_that_does_not_matter() -> None:
    reasons = ("the log does not say what vehicle it is of, the profile is for a copter", "old firmware", "few topics")
    verdict = verdict_on([MET], fit=Fit("partly", reasons))
    assert verdict.lines[-1] == verdict.fit
    assert len(textwrap.wrap(verdict.fit, 80)) <= 2
    assert verdict.fit.startswith("Profile copter partly fits: the log does not say what vehicle")
    assert verdict.fit.endswith("(and 2 more)")
    assert len(fit_line("copter", Fit("partly", reasons))) <= 80
    assert len(fit_line("copter", Fit("partly", reasons))) < len(fit_line("copter", Fit("partly", reasons), line=118))
    none = verdict_on([], fit=Fit("no", ("arducopter: it is for a copter, this is a plane",)), profile="").fit
    assert none == "No profile fits this log: no limits for time and energy, no causes by parameters"


def test_a_change_whose_odds_were_not_measured_says_so() -> None:
    made = made_diagnosis()
    assert made.fix is not None
    shown = replace(made, fix=replace(made.fix, shown_by="pitch oscillates", predicted={}), odds_as_driven=0.05)
    assert str(verdict_of(shown).advice).endswith(": odds not measured; this run shows it: pitch oscillates")
    document = build_document(shown)
    assert document.fix is not None
    assert document.fix.odds is None
    again = remembered_verdict(document_of(json.loads(to_json(document))))
    assert str(again.advice) == str(verdict_of(shown).advice)
    assert "odds not measured: this run shows it (pitch oscillates), training says too little of it" in flat(
        to_text(shown)
    )


def test_a_good_mission_that_was_flown_last_hides_none_that_failed() -> None:
    good = replace(made_diagnosis(), objectives=(), faults=(), fix=None)
    failed = MissionVerdict(replace(good.run.mission, index=2, count=2), "fault", "success")
    fine = replace(failed, status="ok", reason="")
    verdict = verdict_of(replace(good, missions=(fine, failed)))
    assert verdict.others == "In the same log: FAULT in mission 2 (success); look at it with --mission 2"
    assert verdict.lines[1] == verdict.others
    assert verdict_of(replace(good, missions=(fine, replace(failed, mission=good.run.mission)))).others == ""
    document = build_document(replace(good, missions=(fine, failed)))
    assert remembered_verdict(document).others == verdict.others
    unknown = ObjectiveResult(SUCCESS, None, SUCCESS.threshold, "not_evaluated", "no BAT in the log")
    beside = verdict_of(replace(good, objectives=(unknown, MET), missions=(fine, failed), health=Health("", (), ())))
    assert beside.headline.endswith("no fault was found in this run")


def test_what_is_less_likely_is_named_where_nothing_has_a_name() -> None:
    leading = [Reason(0.3, "the parameter a", "a", True)] * REASONS_SHOWN
    rest = [Reason(0.05, "", "", True), Reason(0.04, "bad luck", ""), Reason(0.03, "the parameter b", "b", True)]
    assert list(reason_lines([*leading, *rest]))[-1] == f"{' ' * 8}less likely: {UNKNOWN_PARAMETER}, b"


def test_of_several_changes_the_one_that_explains_it_is_named_as_the_cause() -> None:
    lean = Hypothesis("parameter", "ANGLE_MAX", 0.97, 0.97)
    speed = Hypothesis("parameter", "WPNAV_SPEED", 0.01, 0.6)
    changed = {"ANGLE_MAX", "WPNAV_SPEED"}
    assert alone_of(changed, [lean]) == "ANGLE_MAX"
    assert alone_of(changed, [lean, speed]) == ""
    assert alone_of({"ANGLE_MAX"}, [lean]) == ""
    change = "ANGLE_MAX 969 -> 3000, WPNAV_SPEED 485 -> 1000"
    both = Advice(change, 0.84, 0.0, cause=0.97, alone="ANGLE_MAX", confidence="high")
    assert "(ANGLE_MAX 97% the cause)" in str(both)
    assert "(97% the cause together)" in str(replace(both, alone=""))
