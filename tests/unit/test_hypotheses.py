"""Parameters, hardware, what was met and chance in one ranking that adds up to 1."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_core.diagnose.hypotheses import unasked, weigh
from care_core.diagnose.records import Hypothesis
from care_core.ecosystems.findings import Finding, Severity, SuspectKind
from care_core.records import replace
from care_core.run import Evidence


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


def lead(found: tuple[Hypothesis, ...]) -> tuple[str, str]:
    return found[0].what, found[0].name


@given(
    st.dictionaries(st.sampled_from(["a", "b", "c"]), st.floats(0, 1)),
    st.floats(0, 1),
    st.lists(st.builds(finding, st.floats(0, 1), st.sampled_from(["info", "warning", "critical"]))),
    st.sampled_from(["fits", "partly", "no"]),
)
def test_probabilities_add_up_to_one(options: dict[str, float], chance: float, findings: list[Finding], v: str) -> None:
    found = weigh(options, chance, findings, v)  # type: ignore[arg-type]
    assert sum(one.probability for one in found) == pytest.approx(1.0)
    assert [one.probability for one in found] == sorted((one.probability for one in found), reverse=True)


def test_a_configuration_that_fails_leads_where_no_part_speaks() -> None:
    assert lead(weigh({"LAND_SPEED": 0.9, "RTL_ALT": 0.05}, 0.02, [], "fits")) == ("parameter", "LAND_SPEED")


def test_a_part_that_surely_failed_leads_over_a_doubtful_parameter() -> None:
    found = weigh({"LAND_SPEED": 0.3}, 0.02, [finding(0.9)], "fits")
    assert lead(found) == ("hardware", "motor 2 lost thrust")
    assert weigh({"LAND_SPEED": 0.03}, 0.02, [finding(0.9)], "fits")[0].probability > 0.8


def test_a_part_that_surely_failed_and_that_missions_survive_does_not_lead_over_a_likely_parameter() -> None:
    few = replace(finding(0.95, "warning"), mission_lost=0.15)
    assert lead(weigh({"LAND_SPEED": 0.4}, 0.02, [few], "fits")) == ("parameter", "LAND_SPEED")
    assert lead(weigh({"LAND_SPEED": 0.02}, 0.02, [few], "fits")) == ("hardware", "motor 2 lost thrust")


def test_a_part_that_failed_after_the_run_was_failing_explains_little() -> None:
    stuck = Finding("planner", "the controller is stuck", 20.0, 70.0, "critical", "", "", "parameter", 0.6)
    assert lead(weigh({"occdist_scale": 0.6}, 0.3, [stuck, finding(0.98)], "fits")) == ("parameter", "occdist_scale")
    sooner = replace(stuck, onset_s=60.0)
    assert lead(weigh({"occdist_scale": 0.6}, 0.3, [sooner, finding(0.98)], "fits"))[0] == "hardware"


def test_a_sensor_that_failed_after_the_run_was_failing_keeps_its_weight() -> None:
    swings = Finding("tuning", "roll oscillates", 20.0, 70.0, "critical", "", "", "parameter", 0.85)
    late = replace(finding(0.97), onset_s=60.0)
    share = {kind: weigh({"D": 0.6}, 0.05, [swings, replace(late, kind=kind)], "fits") for kind in ("motor", "compass")}
    of_part = {kind: next(one.probability for one in found if one.what == "hardware") for kind, found in share.items()}
    assert of_part["compass"] > 5 * of_part["motor"]


def test_a_doubtful_sign_of_how_it_was_set_takes_nothing_from_a_part_that_surely_failed() -> None:
    swings = Finding("tuning", "pitch oscillates", 20.0, 70.0, "warning", "", "", "parameter", 0.2)
    assert lead(weigh({"a": 0.3}, 0.1, [swings, finding(0.85)], "fits"))[0] == "hardware"


def test_a_finding_that_speaks_of_how_it_was_set_raises_the_options() -> None:
    stuck = Finding("planner", "the controller is stuck", 20.0, 70.0, "critical", "", "", "parameter", 0.6)
    assert lead(weigh({"a": 0.2, "b": 0.1}, 0.3, [], "fits"))[0] == "chance"
    assert lead(weigh({"a": 0.2, "b": 0.1}, 0.3, [stuck], "fits")) == ("parameter", "a")
    assert lead(weigh({"a": 0.01}, 0.3, [stuck], "fits"))[0] == "chance"


def test_what_comes_after_the_impact_explains_nothing() -> None:
    assert lead(weigh({"LAND_SPEED": 0.6}, 0.02, [finding(0.95, after_impact=True)], "fits"))[0] == "parameter"


def test_where_no_profile_fits_no_parameter_is_named() -> None:
    found = weigh({"LAND_SPEED": 0.9}, 0.1, [finding(0.6)], "no")
    assert not [one for one in found if one.what == "parameter"]
    assert lead(found)[0] == "hardware"


def test_without_a_model_only_a_failure_is_explained() -> None:
    assert unasked([finding(0.9, "warning")]) == ()
    assert lead(unasked([finding(0.9, "warning")], failed=True))[0] == "hardware"
    assert lead(unasked([finding(0.9)])) == ("hardware", "motor 2 lost thrust")


def test_a_critical_finding_names_its_options_where_no_objective_has_a_value() -> None:
    swings = Finding("tuning", "the steering oscillates", 30.0, 220.0, "critical", "", "", "parameter", 0.85)
    shown = {swings.title: Evidence(30.0, "the steering oscillates", "found", options=("P", "FF"))}
    found = unasked([swings], shown=shown, verdict="fits")
    assert {one.name for one in found[:2]} == {"P", "FF"}
    assert found[0].probability == pytest.approx(found[1].probability)
    assert found[0].probability > 0.35
    assert lead(unasked([swings]))[0] != "parameter", "without the rule it names none"
    assert unasked([replace(swings, severity="warning")], shown=shown, verdict="fits") == ()


def test_what_the_operator_did_counts_as_met() -> None:
    assert lead(weigh({}, 0.0, [finding(0.9, suspect="operation")], "no"))[0] == "world"


def test_what_left_no_signal_weighs_as_much_as_chance_and_thrice_where_the_profile_fits_in_part() -> None:
    for verdict, times in (("fits", 1.0), ("partly", 3.0)):
        found = {one.what: one.probability for one in weigh({}, 0.0, (), verdict)}  # type: ignore[arg-type]
        assert found["hardware"] / found["chance"] == pytest.approx(times)
        assert found["world"] / found["chance"] == pytest.approx(times)


def test_what_left_no_trace_weighs_alike_and_more_where_the_profile_fits_in_part() -> None:
    fits = {one.what: one.probability for one in weigh({}, 0.0, (), "fits")}
    assert fits == pytest.approx({"chance": 1 / 3, "hardware": 1 / 3, "world": 1 / 3})
    partly = {one.what: one.probability for one in weigh({}, 0.0, (), "partly")}
    assert partly == pytest.approx({"chance": 1 / 7, "hardware": 3 / 7, "world": 3 / 7})
