"""The order in which findings are told: causes first, what they explain folded under them."""

from __future__ import annotations

from collections.abc import Iterable

from hypothesis import given
from hypothesis import strategies as st

from care_core.ecosystems.explains import OF_ROVERS, Explains
from care_core.ecosystems.findings import NO_BATTERY, OWN_SUPPLY, UNCHARGED, Finding, FindingKind, Severity
from care_core.ecosystems.ranking import OVER_S, SLACK_S, UNLINKED_S, lost_by, rank_findings
from care_core.records import replace
from care_core.report.health import finding_lines

EXPLAINS: Explains = {
    "laser": frozenset({"planner"}),
    "planner": frozenset({"control"}),
    "battery": frozenset({"drive"}),
}
KINDS: tuple[FindingKind, ...] = ("laser", "planner", "control", "battery", "drive")
SEVERITIES: tuple[Severity, ...] = ("critical", "warning", "info")


def finding(kind: FindingKind, onset_s: float, severity: Severity = "critical") -> Finding:
    return Finding(kind, kind, onset_s, onset_s + 1, severity, "", "")


def ranked(findings: Iterable[Finding], impact_s: float | None = None) -> tuple[Finding, ...]:
    return rank_findings(findings, impact_s, EXPLAINS)


def test_what_a_cause_leads_to_by_several_steps_folds_under_it() -> None:
    (root,) = ranked([finding("control", 9.0), finding("laser", 1.0), finding("planner", 5.0)])
    assert (root.kind, [one.kind for one in root.consequences]) == ("laser", ["planner", "control"])


def test_a_cause_seen_just_after_its_consequence_is_told_first_and_did_not_lead_to_it() -> None:
    (root,) = ranked([finding("planner", 5.0), finding("laser", 5.0 + SLACK_S)])
    assert (root.kind, root.consequences, [one.kind for one in root.followed_by]) == ("laser", (), ["planner"])
    assert [words for words, _ in root.links] == ["seen just before it"]
    late = ranked([finding("planner", 5.0), finding("laser", 5.1 + SLACK_S)])
    assert [one.kind for one in late] == ["planner", "laser"]


def test_a_step_that_is_missing_leads_to_nothing() -> None:
    """A laser stops a controller through the planner; where the planner did well, it is only followed by it."""
    (root,) = ranked([finding("laser", 1.0), finding("control", 9.0)])
    assert root.consequences == ()
    assert [(words, [one.kind for one in below]) for words, below in root.links] == [("followed by", ["control"])]


def test_without_that_step_what_comes_much_later_is_a_course_of_its_own() -> None:
    later_s = 2.0 + UNLINKED_S
    told = ranked([finding("laser", 1.0), finding("control", later_s + 1.0)])
    assert [(one.kind, one.followed_by) for one in told] == [("laser", ()), ("control", ())]
    (root,) = ranked([finding("laser", 1.0), finding("planner", later_s), finding("control", later_s + 1.0)])
    assert [one.kind for one in root.consequences] == ["planner", "control"]


@given(st.permutations([("laser", 3.0), ("planner", 2.0), ("control", 4.0)]))
def test_a_step_backwards_in_time_leads_to_nothing(given_ones: list[tuple[FindingKind, float]]) -> None:
    (root,) = ranked([finding(*one) for one in given_ones])
    assert root.consequences == ()
    assert [one.kind for one in root.followed_by] == ["planner", "control"]


def test_a_compass_loses_no_fix() -> None:
    """By the table of the program itself: through a lost attitude alone, whose antenna looks down."""
    (root,) = rank_findings([finding("compass", 1.0), finding("gps", 9.0)])
    assert [words for words, _ in root.links] == ["followed by"]
    (root,) = rank_findings([finding("compass", 1.0), finding("attitude", 5.0), finding("gps", 9.0)])
    assert [(words, len(below)) for words, below in root.links] == [("led to", 2)]


def test_what_was_over_long_before_brings_nothing_about() -> None:
    soon, late = finding("planner", 2.0 + OVER_S), finding("planner", 2.1 + OVER_S)
    assert len(ranked([finding("laser", 1.0), soon])) == 1
    assert len(ranked([finding("laser", 1.0), late])) == 2


def test_a_lesser_finding_explains_no_worse_one() -> None:
    assert [one.kind for one in ranked([finding("laser", 1.0, "warning"), finding("planner", 5.0)])] == [
        "planner",
        "laser",
    ]


def test_what_is_likely_is_told_before_suspicions_and_is_no_consequence_of_one() -> None:
    suspected = replace(finding("laser", 1.0), probability=0.2)
    likely = replace(finding("planner", 5.0), probability=0.9)
    assert [one.kind for one in ranked([suspected, likely])] == ["planner", "laser"]


def test_a_part_that_surely_failed_is_not_what_a_setting_led_to() -> None:
    by_setting = replace(finding("laser", 1.0), probability=0.8, suspect="parameter")
    part = replace(finding("planner", 5.0), probability=0.6)
    assert [one.kind for one in ranked([by_setting, part])] == ["laser", "planner"]
    (root,) = ranked([by_setting, replace(part, probability=0.3)])
    assert root.kind == "laser"


def test_a_part_that_fails_long_after_a_setting_began_to_tell_is_told_by_itself() -> None:
    """A lack of thrust that a limit makes all along, and accelerometers that begin to shake: nothing leads from one to
    the other but an attitude that was held."""
    limited = replace(finding("laser", 7.0), suspect="parameter", parameters=("LIMIT",), end_s=160.0, probability=0.9)
    shaken = replace(finding("control", 8.0 + UNLINKED_S), probability=0.9)
    assert len(ranked([limited, shaken])) == 2
    assert len(ranked([limited, replace(shaken, onset_s=9.0)])) == 1
    assert len(ranked([replace(limited, suspect="hardware"), shaken])) == 1


def test_of_findings_at_one_instant_the_cause_comes_first() -> None:
    (root,) = ranked([finding("planner", 5.0), finding("laser", 5.0)])
    assert root.kind == "laser"


def test_a_symptom_is_told_after_a_cause_of_its_weight() -> None:
    assert [one.kind for one in rank_findings([finding("attitude", 1.0), finding("battery", 9.0)], explains={})] == [
        "battery",
        "attitude",
    ]


def test_what_comes_after_the_impact_is_told_last() -> None:
    first, last = ranked([finding("laser", 8.0), finding("drive", 2.0, "warning")], 5.0)
    assert (first.kind, first.after_impact, last.kind, last.after_impact) == ("drive", False, "laser", True)


@given(st.lists(st.tuples(st.sampled_from(KINDS), st.floats(0, 20), st.sampled_from(SEVERITIES)), max_size=8))
def test_every_finding_is_told_once(given_ones: list[tuple[FindingKind, float, Severity]]) -> None:
    findings = [finding(*one) for one in given_ones]
    said = [(one.kind, one.onset_s) for root in ranked(findings) for one in (root, *root.below)]
    assert sorted(said) == sorted((one.kind, one.onset_s) for one in findings)


def test_predictions_know_of_a_broken_objective_and_of_no_part() -> None:
    seen = [
        finding("motor", 5.0),
        finding("crash", 6.0),
        replace(finding("tuning", 7.0), suspect="parameter"),
        finding("gps", 8.0, "warning"),
        replace(finding("battery", 9.0), after_impact=True),
    ]
    assert lost_by(seen, is_judged=True) == ("motor",)
    assert lost_by(seen, is_judged=False) == ("motor", "crash", "tuning")


def test_of_many_consequences_the_critical_ones_are_printed() -> None:
    below = [finding("planner", 2.0 + n, "warning") for n in range(5)]
    crash = replace(finding("drive", 9.0), title="it crashed")
    lines = "\n".join(finding_lines([replace(finding("laser", 1.0), consequences=(*below, crash))]))
    assert "it crashed (9.0 s) and 2 more" in " ".join(lines.split())


def test_what_is_much_surer_brought_about_what_either_may_have() -> None:
    drifts, torn, crash = finding("barometer", 17.0), finding("surface", 164.0), finding("crash", 192.0)
    drifts, torn = replace(drifts, probability=0.6, end_s=200.0), replace(torn, probability=0.9, end_s=166.0)
    told = rank_findings([drifts, torn, crash])
    assert [(one.kind, [below.kind for below in one.consequences]) for one in told] == [
        ("surface", ["crash"]),
        ("barometer", []),
    ]
    earlier, *_ = rank_findings([replace(drifts, probability=0.8), torn, crash])
    assert earlier.kind == "barometer", "about as sure, and first"


def test_a_pack_that_was_not_charged_weakens_no_single_motor() -> None:
    empty = replace(finding("battery", 0.0, "warning"), title=UNCHARGED, end_s=80.0)
    motor, weak = finding("motor", 18.0, "warning"), finding("thrust", 20.0, "warning")
    roots = rank_findings([empty, motor, weak])
    assert "motor" not in [one.kind for root in roots if root.kind == "battery" for one in root.below]
    assert "motor" in [root.kind for root in roots]


def test_a_battery_makes_no_inertial_sensor_wrong_and_a_monitor_loads_no_processor() -> None:
    apart: tuple[tuple[str, FindingKind], ...] = ((UNCHARGED, "imu"), (NO_BATTERY, "cpu"), (NO_BATTERY, "motor"))
    for title, kind in apart:
        battery = replace(finding("battery", 1.0), title=title)
        assert len(rank_findings([battery, finding(kind, 5.0, "warning")])) == 2
    supply = replace(finding("battery", 1.0), title=f"{OWN_SUPPLY} dips")
    assert len(rank_findings([supply, finding("attitude", 3.0), finding("imu", 5.0, "warning")])) == 1


def test_what_drives_while_it_is_disarmed_aligns_no_compass_and_is_refused() -> None:
    drives = replace(finding("drive", 0.0), suspect="parameter", parameters=("SERVO3_TRIM",))
    drives = replace(drives, probability=0.95, end_s=100.0)
    compass = replace(finding("compass", 1.9), probability=0.9)
    refused = [
        replace(finding("prearm", 80.0), title=f"arming was refused: {why}", suspect="parameter")
        for why in ("AHRS: DCM Roll/Pitch inconsistent", "RC not found")
    ]
    told = rank_findings([compass, *refused, drives], explains=OF_ROVERS)
    assert [one.kind for one in told[0].consequences] == ["compass", "prearm"]
    assert [one.title for one in told[1:]] == ["arming was refused: RC not found"]
