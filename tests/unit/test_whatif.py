"""What another configuration would have given: predictions, warnings, and what an operator types."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from care_core.diagnose.judging import judge
from care_core.diagnose.whatif import Question, ask_over, parse_change, question
from care_core.ecosystems.findings import Finding, Health
from care_core.errors import UsageError
from care_core.profile.store import Profile
from care_core.records import replace
from care_core.report.whatif import whatif_document, whatif_text
from care_core.run import ProfileChoice
from care_core.variables import Role, Variable
from tests.conftest import Care
from tests.planted import CALM, DEFAULTS, SCHEMA, fly, planted_run
from tests.whole import examples

CHOICE = ProfileChoice("planted", "1", "Simulated robot", "")


@pytest.fixture(scope="module")
def slow(planted: Profile) -> Question:
    return question(judge(planted_run(speed=2.0), SCHEMA, planted.model), planted, CHOICE)


def test_a_faster_robot_is_predicted_to_meet_its_time(slow: Question) -> None:
    answer = slow.ask({"speed": 5.0})
    time = next(outlook for outlook in answer.outlooks if outlook.objective.variable.name == "time")
    flown = fly({**DEFAULTS, "speed": 5.0}, CALM)
    assert time.objective.status == "fault"
    assert time.predicted.low <= flown["time"] <= time.predicted.high
    assert answer.p_ok > answer.p_ok_now


@settings(deadline=None, max_examples=examples(30))
@given(speed=st.floats(1, 10), accel=st.floats(0.5, 4))
def test_probabilities_are_probabilities_and_an_answer_repeats(slow: Question, speed: float, accel: float) -> None:
    answer = slow.ask({"speed": speed, "accel": accel})
    assert 0 <= answer.p_ok <= 1
    assert answer == slow.ask({"speed": speed, "accel": accel})
    for outlook in answer.outlooks:
        assert outlook.predicted.low <= outlook.predicted.high


def test_asking_for_no_change_gives_the_run_again(slow: Question) -> None:
    answer = slow.ask({})
    assert answer.p_ok == answer.p_ok_now
    assert answer.changes == ()


def test_over_an_options_range_each_value_has_the_odds_that_it_has_alone(slow: Question) -> None:
    over = ask_over(slow, "speed", {"accel": 2.0, "speed": 9.0})
    values = [value for value, _ in over.answers]
    assert values == sorted(values)
    assert (values[0], values[-1]) == slow.schema.variables["speed"].range
    assert {over.current, DEFAULTS["speed"]} <= set(values)
    assert over.current == 2.0
    for value, answer in over.answers[::6]:
        assert answer == slow.ask({"accel": 2.0, "speed": value})
    text = whatif_text(slow, slow.ask({}), over)
    assert re.search(r"^ +2 .*as driven$", text, re.MULTILINE)
    assert "with the change" not in text  # nothing was changed
    entry = whatif_document(slow, slow.ask({}), over).over
    assert entry is not None
    assert [one.p_ok for one in entry.values] == [pytest.approx(answer.p_ok, abs=1e-6) for _, answer in over.answers]


def test_an_enum_has_each_of_its_codes_and_what_is_unbounded_nothing(slow: Question) -> None:
    planner = slow.schema.variables["planner"]
    assert [value for value, _ in ask_over(slow, "planner", {}).answers] == [code for code, _ in planner.labels]
    free = replace(slow.schema.variables["speed"], range=None)
    unbound = replace(slow, schema=replace(slow.schema, variables={**slow.schema.variables, "speed": free}))
    with pytest.raises(UsageError, match="between which values speed may be"):
        ask_over(unbound, "speed", {})


@given(low=st.floats(-5, 5), span=st.floats(0.01, 100), count=st.integers(2, 30))
def test_values_across_a_range_ascend_from_end_to_end(low: float, span: float, count: int) -> None:
    option = Variable("x", Role.OPTION, range=(low, low + span))
    values = option.across(count)
    assert list(values) == sorted(set(values))
    assert len(values) <= count
    assert (values[0], values[-1]) == (option.snap(low), option.snap(low + span))


def test_what_speaks_against_a_value_is_said_beside_it(slow: Question) -> None:
    answer = slow.ask({"speed": 40.0, "planner": 7.0})
    notes = {change.option.name: " ".join(change.notes) for change in answer.changes}
    assert "outside the acceptable values (1 to 10 m/s)" in notes["speed"]
    assert "outside the training runs" in notes["speed"]
    assert "0 (straight)" in notes["planner"]
    line = next(line for line in whatif_text(slow, answer).splitlines() if line.startswith("speed"))
    assert "outside the acceptable values" in line
    assert whatif_document(slow, answer).changes[0].notes


def test_what_the_training_runs_cannot_tell_is_said_beside_a_value(slow: Question) -> None:
    chosen = replace(slow, schema=replace(slow.schema, observational=True))
    assert slow.warnings("speed", 5.0) == ()
    assert any(text.startswith("operators chose it in training") for text in chosen.warnings("speed", 5.0))
    effects = dict(slow.query.model.effects)
    effects["speed", "time"] = replace(effects["speed", "time"], identified=False)
    blind = replace(slow, query=replace(slow.query, model=replace(slow.query.model, effects=effects)))
    assert blind.warnings("speed", 5.0) == ("the training runs cannot tell what it does to time",)


def test_a_run_without_a_fault_can_be_asked(planted: Profile) -> None:
    asked = question(judge(planted_run(), SCHEMA, planted.model), planted, CHOICE)
    assert all(result.status == "ok" for result in asked.objectives)
    assert asked.ask({"speed": 1.2}).p_ok < asked.ask({}).p_ok


def test_odds_are_told_with_what_lost_the_run_and_no_prediction_knows_of(planted: Profile) -> None:
    motor = Finding("motor", "motor 2 lost thrust", 5.0, 9.0, "critical", "", "")
    asked = question(judge(planted_run(), SCHEMA, planted.model), planted, CHOICE, Health("", (), (motor,)))
    answer = asked.ask({"speed": 2.0})
    assert "unless it happens again: motor 2 lost thrust" in " ".join(whatif_text(asked, answer).split())
    assert whatif_document(asked, answer).lost_by == ["motor 2 lost thrust"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("sped=3", "Did you mean 'speed'"),
        ("SPEED=3", "Did you mean 'speed'"),
        ("speed", "sets no value"),
        ("speed=fast", "acceptable are 1 to 10 m/s"),
        ("speed=nan", "sets no value"),
        ("speed=inf", "sets no value"),
        ("sag=1", "measured, not set"),
        ("=3", "no parameter ''"),
    ],
)
def test_what_cannot_be_set_is_refused(text: str, words: str) -> None:
    with pytest.raises(UsageError) as caught:
        parse_change(text, SCHEMA)
    assert words in str(caught.value)


def test_labels_and_parameters_name_values_and_options() -> None:
    assert parse_change("planner = greedy", SCHEMA) == ("planner", 2.0)
    assert parse_change("filter=false", SCHEMA) == ("filter", 0.0)
    assert parse_change("/b/radius=0.3", SCHEMA) == ("radius", 0.3)


SAMPLE = Path(__file__).parents[2] / "samples/arducopter_failed.BIN"


def test_the_command_asks_the_sample(care: Care) -> None:
    code, out, _ = care("whatif", SAMPLE, "--set", "LAND_SPEED=40")
    assert code == 0
    assert "mission_time" in out
    assert "without the change" in out


def test_the_command_answers_its_published_json(care: Care) -> None:
    from json import loads

    import jsonschema

    code, out, _ = care("whatif", SAMPLE, "--set", "LAND_SPEED=40", "--json")
    _, schema, _ = care("schema", "whatif")
    assert code == 0
    jsonschema.validate(loads(out), loads(schema))


def test_the_command_refuses_what_it_does_not_know(care: Care) -> None:
    assert care("whatif", SAMPLE, "--set", "LAND_SPED=40").code == 2
    assert care("whatif", SAMPLE).code == 2
    assert care("whatif", "nothing.BIN", "--set", "LAND_SPEED=40").code == 4
