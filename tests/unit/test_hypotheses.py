"""Parameters, hardware, what was met and chance in one ranking that adds up to 1."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_core.diagnose.estimates import UNMODELLED
from care_core.diagnose.hypotheses import (
    UNTOLD_BY_FIT,
    Arming,
    failure_of,
    hypotheses_of,
    hypotheses_without_model,
    with_findings,
)
from care_core.diagnose.noisy_or import CHANCE, UNKNOWN, NoisyOr
from care_core.diagnose.parts import OUTLASTED
from care_core.diagnose.records import Hypothesis, ObjectiveResult
from care_core.ecosystems.findings import SAGS, UNCHARGED, Finding, FindingKind, Severity, SuspectKind
from care_core.profile.store import Profile
from care_core.records import replace
from care_core.run import Evidence
from care_core.variables import Role, Threshold, Variable
from tests.planted import BOUNDS, CALM, TIME, planted_run, query_of


def finding(
    probability: float,
    severity: Severity = "critical",
    suspect: SuspectKind = "hardware",
    *,
    after_impact: bool = False,
) -> Finding:
    return Finding(
        "motor",
        "motor 2 lost thrust",
        61.0,
        70.0,
        severity,
        "",
        "RCOU",
        suspect,
        probability,
        after_impact=after_impact,
    )


def weigh(options: Mapping[str, float], chance: float, findings: Sequence[Finding]) -> tuple[Hypothesis, ...]:
    causes = with_findings({("parameter", name): share for name, share in options.items()}, findings)
    return hypotheses_of(NoisyOr({CHANCE: chance, UNKNOWN: UNMODELLED.value, **causes}))


@pytest.mark.parametrize(("probability", "outlasts", "share"), [(0.1, False, 0.1), (0.1, True, 0.01), (0.9, True, 0.9)])
@pytest.mark.parametrize("kind", ["battery", "log"])
def test_what_ends_a_run_that_took_too_much_is_doubted_unless_it_shows(
    kind: FindingKind, probability: float, outlasts: bool, share: float
) -> None:
    pack = replace(finding(probability, "warning"), kind=kind, mission_lost=1.0)
    causes = with_findings({}, [pack], outlasts=outlasts)
    assert causes["hardware", pack.title] == pytest.approx(share)


def lead(found: tuple[Hypothesis, ...]) -> tuple[str, str]:
    return found[0].what, found[0].name


@given(
    st.dictionaries(st.sampled_from(["a", "b", "c"]), st.floats(0, 1)),
    st.floats(0, 1),
    st.lists(st.builds(finding, st.floats(0, 1), st.sampled_from(["info", "warning", "critical"]))),
)
def test_probabilities_add_up_to_one(options: dict[str, float], chance: float, findings: list[Finding]) -> None:
    found = weigh(options, chance, findings)
    assert all(one.probability <= one.acts <= 1.0 for one in found if one.what != "chance")
    assert sum(one.probability for one in found) == pytest.approx(1.0, abs=1e-5)
    assert [one.probability for one in found] == sorted((one.probability for one in found), reverse=True)


def test_a_configuration_that_fails_leads_where_no_part_speaks() -> None:
    assert lead(weigh({"LAND_SPEED": 0.9, "RTL_ALT": 0.05}, 0.02, [])) == ("parameter", "LAND_SPEED")


def test_a_part_that_surely_failed_leads_over_a_doubtful_parameter() -> None:
    found = weigh({"LAND_SPEED": 0.3}, 0.02, [finding(0.9)])
    assert lead(found) == ("hardware", "motor 2 lost thrust")
    assert weigh({"LAND_SPEED": 0.03}, 0.02, [finding(0.9)])[0].probability > 0.8


def test_an_option_with_which_this_run_failed_counts_for_more_than_in_any_mission(planted: Profile) -> None:
    """At 3.2 m/s half of the missions are too slow; this one planned anew too often, and faster it would have kept."""
    run = planted_run({**CALM, "replans": 3.0}, speed=3.2)
    missed = ObjectiveResult(TIME, 183.7, BOUNDS["time"], "fault")

    def loses(observed: Mapping[str, object] | None) -> float:
        query = query_of(planted, run, observed)
        failure = failure_of(query, [missed], {}, Arming(frozenset(), frozenset()), (), {})
        return failure.loses["parameter", "speed"]

    in_any, in_this = loses({}), loses(None)
    assert in_any + 0.1 < in_this < 0.9


def test_two_causes_may_both_have_acted() -> None:
    first, second = weigh({"LAND_SPEED": 0.95}, 0.02, [finding(0.9)])[:2]
    assert first.name == "LAND_SPEED"
    assert first.acts > 0.9
    assert second.probability < 0.1
    assert second.acts == pytest.approx(0.9 * 0.95, abs=0.02)


def test_a_part_that_surely_failed_and_that_missions_survive_does_not_lead_over_a_likely_parameter() -> None:
    few = replace(finding(0.95, "warning"), mission_lost=0.15)
    assert lead(weigh({"LAND_SPEED": 0.4}, 0.02, [few])) == ("parameter", "LAND_SPEED")
    assert lead(weigh({"LAND_SPEED": 0.02}, 0.02, [few])) == ("hardware", "motor 2 lost thrust")


def test_a_part_that_failed_after_the_run_was_failing_explains_little() -> None:
    stuck = Finding("planner", "the controller is stuck", 20.0, 70.0, "critical", "", "", "parameter", 0.6)
    assert lead(weigh({"occdist_scale": 0.6}, 0.3, [stuck, finding(0.98)])) == ("parameter", "occdist_scale")
    sooner = replace(stuck, onset_s=60.0)
    assert lead(weigh({"occdist_scale": 0.6}, 0.3, [sooner, finding(0.98)]))[0] == "hardware"


def test_a_sensor_that_failed_after_the_run_was_failing_keeps_its_weight() -> None:
    swings = Finding("tuning", "roll oscillates", 20.0, 70.0, "critical", "", "", "parameter", 0.85)
    late = replace(finding(0.97), onset_s=60.0)
    share = {kind: weigh({"D": 0.6}, 0.05, [swings, replace(late, kind=kind)]) for kind in ("motor", "compass")}
    of_part = {kind: next(one.acts for one in found if one.what == "hardware") for kind, found in share.items()}
    assert of_part["compass"] > 5 * of_part["motor"]


def test_a_doubtful_sign_of_how_it_was_set_takes_nothing_from_a_part_that_surely_failed() -> None:
    swings = Finding("tuning", "pitch oscillates", 20.0, 70.0, "warning", "", "", "parameter", 0.2)
    assert lead(weigh({"a": 0.3}, 0.1, [swings, finding(0.85)]))[0] == "hardware"


def test_a_finding_that_names_a_parameter_raises_it() -> None:
    stuck = Finding("planner", "the controller is stuck", 20.0, 70.0, "critical", "", "", "parameter", 0.6)
    assert lead(weigh({"a": 0.2, "b": 0.1}, 0.3, []))[0] == "chance"
    assert lead(weigh({"a": 0.2, "b": 0.1}, 0.3, [replace(stuck, parameters=("b",))])) == ("parameter", "b")


def test_a_vehicle_that_never_armed_failed_by_what_refused_it() -> None:
    refused = Finding(
        "prearm", "arming was refused", 1.7, 96.0, "critical", "", "", "parameter", 0.4, parameters=("RNGFND6_TYPE",)
    )
    creeps = Finding("drive", "it drives", 0.0, 96.0, "critical", "", "", "parameter", 0.9, parameters=("SERVO3_TRIM",))
    poor = Finding("gps", "only 5 satellites", 0.0, 96.0, "critical", "", "", probability=0.9)
    both = weigh({}, 0.01, [creeps, refused])
    assert lead(both) == ("parameter", "RNGFND6_TYPE")
    assert "SERVO3_TRIM" not in {one.name for one in both}
    assert lead(weigh({}, 0.01, [creeps])) == ("parameter", "SERVO3_TRIM")
    estimated = replace(refused, title="arming was refused: AHRS: not using configured AHRS type")
    assert lead(weigh({}, 0.01, [creeps, estimated])) == ("parameter", "SERVO3_TRIM"), "what moves aligns no estimator"
    assert lead(weigh({}, 0.01, [poor, refused])) == ("hardware", poor.title), "it may have refused it"


def test_what_comes_after_the_impact_explains_nothing() -> None:
    assert lead(weigh({"LAND_SPEED": 0.6}, 0.02, [finding(0.95, after_impact=True)]))[0] == "parameter"


def missed(name: str = "no_crash", reason: str = "") -> ObjectiveResult:
    check = Variable(name, Role.OBJECTIVE, "bool", kind="functional", threshold=Threshold("==", 1))
    return ObjectiveResult(check, 0.0, check.threshold, "fault", reason)


def test_a_pack_that_a_flight_outlasts_needs_no_part_that_failed() -> None:
    failsafe, compass = (
        missed("no_failsafe", "battery failsafe at 234.6 s"),
        replace(finding(0.9, "warning"), kind="compass", title="compass 2 is disturbed"),
    )
    assert lead(hypotheses_without_model([compass], missed=(failsafe,))) == ("world", OUTLASTED)
    assert lead(hypotheses_without_model([compass], missed=(failsafe, missed())))[0] == "hardware"
    motor = finding(0.9)
    assert lead(hypotheses_without_model([motor], missed=(failsafe,)))[0] == "hardware"
    sags = replace(finding(0.25), kind="battery", title=SAGS)
    assert lead(hypotheses_without_model([sags, compass], missed=(failsafe,))) == ("world", OUTLASTED)
    drained = replace(finding(0.9), kind="battery", title=UNCHARGED)
    assert lead(hypotheses_without_model([drained, compass], missed=(failsafe,))) == ("hardware", UNCHARGED)


def test_without_a_model_only_a_failure_is_explained() -> None:
    assert hypotheses_without_model([finding(0.9, "warning")]) == ()
    assert lead(hypotheses_without_model([finding(0.9, "warning")], missed=(missed(),)))[0] == "hardware"
    assert lead(hypotheses_without_model([finding(0.9)])) == ("hardware", "motor 2 lost thrust")


def test_where_nothing_else_failed_a_critical_finding_is_explained_by_what_may_have_brought_it_about() -> None:
    sags = replace(finding(0.4), kind="battery", title=SAGS)
    shaken = replace(finding(0.9, "warning"), kind="vibration", title="strong vibration")
    assert lead(hypotheses_without_model([sags, shaken])) == ("hardware", SAGS)
    failed_imu = replace(finding(0.4), kind="imu", title="gyro 1 failed")
    assert lead(hypotheses_without_model([failed_imu, shaken])) == ("hardware", shaken.title)


def test_a_critical_finding_names_its_options_where_no_objective_has_a_value() -> None:
    swings = Finding("tuning", "the steering oscillates", 30.0, 220.0, "critical", "", "", "parameter", 0.85)
    shown = {swings.title: Evidence(30.0, "the steering oscillates", "found", options=("P", "FF"))}
    found = hypotheses_without_model([swings], shown=shown, verdict="fits")
    assert {one.name for one in found[:2]} == {"P", "FF"}
    assert found[0].acts == pytest.approx(found[1].acts)
    assert found[0].probability > 0.35
    assert lead(hypotheses_without_model([swings]))[0] != "parameter", "without the rule it names none"
    assert hypotheses_without_model([replace(swings, severity="warning")], shown=shown, verdict="fits") == ()


def test_what_the_operator_did_counts_as_met() -> None:
    assert lead(weigh({}, 0.0, [finding(0.9, suspect="operation")]))[0] == "world"


def test_what_no_signal_shows_has_a_share_of_its_own() -> None:
    found = {(one.what, one.name): one.probability for one in weigh({"a": 0.5}, 0.1, ())}
    assert found["parameter", ""] > 0.01
    for verdict, share in UNTOLD_BY_FIT.items():
        shown = hypotheses_without_model([finding(0.9)], verdict=verdict)
        rest = next(one for one in shown if one.what == "chance")
        assert rest.name == "chance, or what no log shows"
        assert 0.1 * share < rest.probability < share
