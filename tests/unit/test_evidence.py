"""What the log says, and what the run met that is no parameter: rules of the profile, causes, rivals, experiments."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_core.causal.model import Summary
from care_core.diagnose.circumstances import circumstances
from care_core.diagnose.judging import judge, query_of, read_and_judge
from care_core.diagnose.tell_more import experiment
from care_core.diagnose.triage import diagnose, triage
from care_core.ecosystems.findings import Finding, Health
from care_core.ecosystems.registry import run_model
from care_core.errors import ProfileError
from care_core.extract.select import choose_profile
from care_core.logs.opening import open_log
from care_core.profile.reading import read_schema
from care_core.profile.schema import EvidenceRule, Schema, Side
from care_core.profile.store import Profile, load_profile
from care_core.records import replace
from care_core.report.document import build_document
from care_core.report.markdown import to_markdown
from care_core.report.terminal import to_text
from care_core.run import Evidence, ProfileChoice, Run, Setting, Unavailable, gathered
from care_core.variables import Role, Threshold, Variable
from tests.planted import OPTIONS, SCHEMA, planted_run

CHOICE = ProfileChoice("planted", "1", "Simulated robot", "")
VARIABLES = {option.name: option for option in OPTIONS}
MINIMAL = """
schema_version: 1
name: made
version: "1"
platform: one
{extra}
variables:
  speed: {{role: option, range: [0, 1]}}
  wind: {{role: context}}
  done: {{role: objective, kind: functional}}
"""


def written(tmp_path: Path, extra: str) -> Schema:
    path = tmp_path / "profile.yaml"
    path.write_text(MINIMAL.format(extra=extra), encoding="utf-8")
    return read_schema(path)


@pytest.mark.parametrize(
    ("extra", "words"),
    [
        ("evidence: [{text: a, options: [sped]}]", r"'sped'.*Did you mean 'speed'"),
        ("evidence: [{text: a, options: {wind: {op: '<', value: 1}}}]", "names the option 'wind'"),
        ("evidence: [{text: '(', options: [speed]}]", "not a regular expression"),
        ("evidence: [{text: a, circumstance: wnd}]\ncircumstances: {wind: {wind: high}}", "Did you mean 'wind'"),
        ("circumstances: {wind: {speed: high}}", "names the context or metric 'speed'"),
        ("circumstances: {wind: {wind: up}}", "circumstances"),
        ("evidence: [{text: a, option: [speed]}]", "Unknown key"),
    ],
)
def test_a_rule_that_names_what_is_not_declared_is_refused(tmp_path: Path, extra: str, words: str) -> None:
    with pytest.raises(ProfileError, match=words):
        written(tmp_path, extra)


def test_rules_do_not_touch_what_a_model_was_learned_for(tmp_path: Path) -> None:
    plain = written(tmp_path, "")
    ruled = written(
        tmp_path,
        "evidence: [{text: slow, options: {speed: {op: '<', value: 0.5}}, says: too slow}]\n"
        "circumstances: {wind: {wind: high}}",
    )
    assert ruled.digest == plain.digest
    assert ruled.evidence[0].says == "too slow"
    assert ruled.circumstances == {"wind": {"wind": "high"}}


@given(st.floats(0, 12), st.floats(0, 12))
def test_a_bounded_rule_points_only_where_the_value_sets_the_check_off(value: float, bound: float) -> None:
    rule = EvidenceRule("x", {"speed": Threshold("<", bound), "accel": None})
    pointed = rule.points_at(VARIABLES, {"speed": value, "accel": 1.5})
    assert pointed == (("speed",) if value < bound else ())
    assert rule.points_at(VARIABLES, {"accel": 2.0}) == ("speed", "accel")


def refused_run(**options: float) -> Run:
    return replace(
        planted_run(**options), evidence=(Evidence(3.0, "Arm: too few satellites", "refusal", ("min_sats",)),)
    )


def test_a_refusing_check_puts_its_option_first_and_is_quoted(planted: Profile) -> None:
    run = refused_run(min_sats=14, speed=8.0)
    diagnosis = diagnose(judge(run, SCHEMA, planted.model), planted, CHOICE)
    (fault,) = diagnosis.faults
    assert run.refused_by == {"min_sats"}
    assert fault.causes[0].option.name == "min_sats"
    assert any("too few satellites" in note.text for note in fault.causes[0].notes)


def test_a_refusing_check_names_an_option_that_the_model_knows_nothing_of(planted: Profile) -> None:
    run = planted_run(min_sats=14, inert=0.9)
    run = replace(run, evidence=(Evidence(3.0, "Arm: inert", "refusal", ("inert",)),))
    cause = diagnose(judge(run, SCHEMA, planted.model), planted, CHOICE).faults[0].causes[0]
    assert cause.option.name == "inert"
    assert not cause.is_lead


def test_what_hardly_costs_a_run_is_not_looked_at_where_it_never_armed(planted: Profile) -> None:
    refused = Finding("prearm", "arming was refused: not ready", 1.0, 9.0, "critical", "", "MSG")
    run = planted_run(speed=6.0, inert=0.9)
    run = replace(run, objectives={**run.objectives, "success": 0.0})

    def told(*findings: Finding) -> set[str]:
        health = Health("", (), findings)
        (fault,) = diagnose(judge(run, SCHEMA, planted.model), planted, CHOICE, health=health).faults
        return {cause.option.name for cause in fault.causes}

    assert told() == {"speed", "inert"}
    assert told(refused) == {"inert"}


def test_a_message_in_flight_is_a_note_and_no_proof(planted: Profile) -> None:
    run = replace(refused_run(min_sats=14), evidence=(Evidence(3.0, "tracking", "failsafe", ("speed",)),))
    assert run.refused_by == frozenset()
    assert diagnose(judge(run, SCHEMA, planted.model), planted, CHOICE).faults[0].causes[0].option.name == "min_sats"


def circumstances_of(profile: Profile, run: Run, sides: Mapping[str, Side]) -> list[str]:
    schema = replace(profile.schema, circumstances={"battery": sides})
    query = query_of(judge(run, schema, profile.model), profile)
    return [one.variable for one in circumstances(run, query, schema)]


def test_a_metric_beyond_what_the_configuration_explains_is_a_circumstance(planted: Profile) -> None:
    ordinary = planted_run(accel=3.5)
    sagging = replace(ordinary, metrics={**ordinary.metrics, "sag": 2.5})
    assert circumstances_of(planted, ordinary, {"sag": "high"}) == []
    assert circumstances_of(planted, sagging, {"sag": "high"}) == ["sag"]
    assert circumstances_of(planted, sagging, {"sag": "low"}) == []
    gone = replace(ordinary, metrics={**ordinary.metrics, "sag": Unavailable("no battery")})
    assert circumstances_of(planted, gone, {"sag": "high"}) == []


def test_a_context_is_judged_by_where_training_saw_it(planted: Profile) -> None:
    wind = Variable("wind", Role.CONTEXT, unit="m/s", doc="wind")
    model = replace(planted.model, summaries={**planted.model.summaries, "wind": _summary(0.0, 10.0)})
    schema = replace(SCHEMA, variables={**SCHEMA.variables, "wind": wind}, circumstances={"wind": {"wind": "high"}})
    for value, expected in ((5.0, []), (9.9, ["wind"]), (12.0, ["wind"]), (0.1, [])):
        run = replace(planted_run(), context={"wind": value})
        query = replace(query_of(judge(run, SCHEMA, planted.model), planted), model=model)
        found = circumstances(run, query, schema)
        assert [one.name for one in found][: len(expected)] == expected
        assert all(str(one.value)[:2] in one.text for one in found)


@pytest.mark.parametrize(("side", "share"), [("low", 0.01), ("high", 0.99)], ids=["low", "high"])
def test_a_circumstance_says_how_many_runs_met_more(planted: Profile, side: Side, share: float) -> None:
    wind = Variable("wind", Role.CONTEXT, unit="m/s", doc="wind")
    model = replace(planted.model, summaries={**planted.model.summaries, "wind": _summary(0.0, 10.0)})
    schema = replace(SCHEMA, variables={**SCHEMA.variables, "wind": wind}, circumstances={"wind": {"wind": side}})
    run = replace(planted_run(), context={"wind": 10.0 * share})
    (found,) = circumstances(run, replace(query_of(judge(run, SCHEMA, None), planted), model=model), schema)
    assert found.share == pytest.approx(0.01, abs=1e-6)


@pytest.mark.parametrize(
    ("support", "confidence"), [(0.45, "low"), (0.55, "medium"), (0.75, "medium"), (0.85, "high")], ids=str
)
def test_confidence_follows_how_many_resamples_have_a_path(planted: Profile, support: float, confidence: str) -> None:
    effects = {key: replace(effect, support=support) for key, effect in planted.model.effects.items()}
    profile = Profile(planted.path, SCHEMA)
    profile.__dict__["model"] = replace(planted.model, effects=effects)
    judged = judge(planted_run(speed=1.5), SCHEMA, planted.model)
    cause = diagnose(judged, profile, CHOICE).faults[0].causes[0]
    assert (cause.option.name, cause.confidence) == ("speed", confidence)
    assert any("of resamples" in note.text for note in cause.notes) is (support < 0.5)


def _summary(low: float, high: float) -> Summary:
    return Summary(count=100, mean=5.0, sd=3.0, quantiles=tuple(low + (high - low) * i / 20 for i in range(21)))


def test_the_experiment_separates_the_two_leading_causes(planted: Profile) -> None:
    run = planted_run(speed=3.0, planner=2.0)
    judged = judge(run, SCHEMA, planted.model, {"time": 183.0})
    diagnosis = diagnose(judged, planted, CHOICE)
    (fault,) = diagnosis.faults
    found = experiment(query_of(judged, planted), fault)
    assert found is not None
    (first, p_first), (second, p_second) = found.if_cause
    assert {first, second} <= {cause.option.name for cause in fault.causes} | {"something in the environment"}
    assert abs(p_first - p_second) >= 0.15
    assert found.option.name in (first, second)
    assert experiment(query_of(judged, planted, (first, second)), fault) is None


def test_where_nothing_is_off_its_reference_a_repeat_is_advised(planted: Profile) -> None:
    run = planted_run()
    slow = replace(run, objectives={**run.objectives, "time": 300.0})
    diagnosis = diagnose(judge(slow, SCHEMA, planted.model), planted, CHOICE)
    assert diagnosis.abstained is not None
    assert any("same configuration again" in advice for advice in diagnosis.tell_more)
    report = build_document(diagnosis)
    assert report.tell_more
    assert "How to find out more" in to_text(diagnosis)
    assert "## How to find out more" in to_markdown(report)


def test_a_sure_cause_has_no_rivals(planted: Profile) -> None:
    diagnosis = diagnose(judge(planted_run(speed=1.5), SCHEMA, planted.model), planted, CHOICE)
    if all(fault.causes[0].confidence == "high" for fault in diagnosis.faults):
        assert diagnosis.rivals == ()
        assert diagnosis.tell_more == ()


REFUSED = {
    "ACRO_BAL": ("ATC_ANG_RLL_P", "ATC_ANG_PIT_P"),
    "ANGLE_MAX": ("ANGLE_MAX",),
    "waiting for home": ("EK3_VELNE_M_NSE",),
}


@pytest.mark.long
def test_every_recorded_refusal_names_the_option_that_set_its_check_off(recorded: Path) -> None:
    profile = load_profile("arducopter")
    seen: list[str] = []
    for path in sorted((recorded / "data/arducopter/faults").glob("*.BIN")):
        log = open_log(path)
        judged = read_and_judge(run_model(log), profile)
        if not any(
            e.kind == "refusal" for e in judged.run.evidence
        ):  # explaining the others would take most of the time
            continue
        diagnosis = triage(judged, profile, choose_profile(log, [profile])[1])
        refusals = [e for e in diagnosis.run.evidence if e.kind == "refusal"]
        for evidence in refusals:
            check = next(check for check in REFUSED if check in evidence.text)
            assert set(evidence.options) <= set(REFUSED[check])
            assert evidence.options
            assert diagnosis.faults[0].causes[0].option.name in diagnosis.run.refused_by
            seen.append(check)
    assert seen


def test_messages_that_differ_in_numbers_alone_are_told_once_with_their_count() -> None:
    again = [Evidence(at, f"Potential Thrust Loss ({1 + at % 2:.0f})", "message", ("size",)) for at in (3.0, 5.0, 9.0)]
    other = Evidence(4.0, "Crash: Disarming", "crash")
    assert [one.text for one in gathered([*again, other])] == [
        "Potential Thrust Loss (2) (3 times until 9 s)", "Crash: Disarming",
    ]  # fmt: skip


def test_what_a_run_says_stands_in_order_of_time() -> None:
    late, early = Evidence(9.0, "late", "message"), Evidence(2.0, "early", "found")
    assert replace(planted_run(), evidence=(late,)).with_evidence(early).evidence == (early, late)


def test_how_many_parameters_differ_is_told_of_the_options_alone(planted: Profile) -> None:
    notes = triage(judge(planted_run(min_sats=14), SCHEMA, planted.model), planted, CHOICE).notes
    assert any(f"1 of the profile's {len(SCHEMA.options)} parameters differs" in note for note in notes)


def test_a_refusal_that_is_cleared_tells_what_else_the_mission_waits_for(planted: Profile) -> None:
    """No motor of a vehicle that was refused has turned: what its options do to the mission is still to come."""
    refused = Finding(
        "prearm", "arming was refused: no motor 4", 1.0, 9.0, "critical", "", "MSG", "parameter", 0.97,
        parameters=("SERVO4_FUNCTION",), wanted=(("SERVO4_FUNCTION", 36.0),),
    )  # fmt: skip
    run = planted_run(min_sats=14)
    run = replace(
        run,
        log=replace(run.log, facts={"firmware": "ArduCopter V4.5.4"}),
        settings={"SERVO4_FUNCTION": Setting("SERVO4_FUNCTION", 109.0, "PARM", default=0.0)},
        metrics=dict.fromkeys(run.metrics, Unavailable("it never armed")),
        objectives={name: 0.0 if name == "success" else Unavailable("it never armed") for name in run.objectives},
    )
    health = Health("", (), (refused,))
    diagnosis = diagnose(judge(run, SCHEMA, planted.model), planted, CHOICE, health=health)
    assert diagnosis.fix is not None
    assert [one.option.name for one in diagnosis.fix.changes] == ["SERVO4_FUNCTION"]
    (other,) = diagnosis.alternatives
    assert {one.option.name for one in other.changes} == {"SERVO4_FUNCTION", "min_sats"}
    assert other.p_fixed is not None
    assert diagnosis.fix.p_fixed is not None
    assert other.p_fixed > diagnosis.fix.p_fixed + 0.1
