"""Limits from good runs of the planted robot, which missions were flown and which runs are refused."""

from __future__ import annotations

import pytest

from care_core.diagnose.baseline import differing, for_any_mission, missions, propose, refusal
from care_core.diagnose.judging import Judged, judge
from care_core.ecosystems.findings import NOTHING_SEEN, Finding
from care_core.profile.schema import Schema
from care_core.profile.store import Profile
from care_core.records import replace
from care_core.run import Evidence, OutcomeCheck, Run
from care_core.variables import Role, Threshold, Variable
from tests.planted import SCHEMA, TIME, planted_run, with_variable

RATIO = Threshold("<=", ratio=1.3)
TRAVELLING = with_variable(SCHEMA, replace(TIME, threshold=RATIO))
LENGTH = Variable("length", Role.CONTEXT, unit="m", about="mission")
ASKED = with_variable(SCHEMA, LENGTH)


def judged(run: Run, planted: Profile, schema: Schema = TRAVELLING) -> Judged:
    return judge(run, for_any_mission(schema), planted.model)


def good(planted: Profile, schema: Schema = TRAVELLING, count: int = 8) -> list[Judged]:
    """Runs of one configuration that took a few per cent more or less."""
    runs = []
    for n in range(count):
        run = planted_run()
        time = run.objectives["time"]
        assert isinstance(time, float)
        runs.append(judged(replace(run, objectives={**run.objectives, "time": time * (1 + 0.01 * n)}), planted, schema))
    return runs


def test_a_relative_limit_is_a_ratio_to_what_the_reference_needs(planted: Profile) -> None:
    profile = Profile(planted.path, TRAVELLING)
    time, energy = propose(good(planted), profile)
    assert time.relative
    assert time.limit is not None
    assert len(time.seen) == 8
    assert time.seen[-1] < time.limit < 2
    assert time.low is not None
    assert time.high is not None
    assert time.low < time.high <= time.limit
    assert not energy.relative
    assert energy.limit is not None
    assert energy.limit > energy.seen[-1]


def test_a_profile_with_a_limit_for_its_own_mission_too_proposes_ratios(planted: Profile) -> None:
    assert TIME.threshold is not None
    both = with_variable(SCHEMA, replace(TIME, threshold=replace(RATIO, value=TIME.threshold.value)))
    runs = good(planted, both)
    without = propose(good(planted), Profile(planted.path, TRAVELLING))[0]
    assert without.limit is not None
    assert propose(runs, Profile(planted.path, both))[0].limit == without.limit
    assert "limit of" not in "".join(result.wanted for run in runs for result in run.results)


def test_one_run_is_judged_by_how_much_training_runs_differ(planted: Profile) -> None:
    one = propose(good(planted, count=1), Profile(planted.path, TRAVELLING))[0]
    many = propose(good(planted, count=8), Profile(planted.path, TRAVELLING))[0]
    assert one.limit is not None
    assert many.limit is not None
    assert "training" in one.method
    assert one.limit / one.seen[0] > 1


def test_a_fixed_limit_is_for_one_mission(planted: Profile) -> None:
    profile = Profile(planted.path, ASKED)
    run = planted_run()
    near = [judged(replace(run, context={**run.context, "length": 100.0 + n}), planted, ASKED) for n in range(5)]
    assert missions(near, ASKED) == 1
    energy = next(p for p in propose(near, profile) if p.objective.name == "energy")
    assert energy.mission == {"length": 100.0}
    far = [*near, judged(replace(run, context={**run.context, "length": 300.0}), planted, ASKED)]
    assert missions(far, ASKED) == 2
    assert all(p.limit is None and "2 missions" in p.reason for p in propose(far, profile))


def test_a_run_of_another_mission_than_the_profiles_counts(planted: Profile) -> None:
    run = planted_run()
    other = replace(run, mission=replace(run.mission, fits=False, mismatch="it has 3 waypoints, not 5"))
    assert judged(other, planted).run.objectives["time"] == run.objectives["time"]


def test_what_is_no_good_run_is_refused_with_its_reason(planted: Profile) -> None:
    run = planted_run()
    assert refusal(judged(run, planted), NOTHING_SEEN) == ""
    said = Evidence(12.0, "Crash: Disarming", "crash")
    failed = replace(run, objectives={**run.objectives, "success": 0.0}, evidence=(said,))
    assert refusal(judged(failed, planted), NOTHING_SEEN) == "success was not met: Crash: Disarming"
    cut = replace(run, mission=replace(run.mission, ended=False))
    assert "ends before" in refusal(judged(cut, planted), NOTHING_SEEN)
    plain = replace(run, checks=(OutcomeCheck("armed", 1.0, "it armed"),))
    assert refusal(judged(plain, planted), NOTHING_SEEN) == "no mission was flown"
    finding = Finding("motor", "motor 1 gave too little thrust", 3.0, 9.0, "critical", "seen", "RCOU")
    assert "motor 1" in refusal(judged(run, planted), replace(NOTHING_SEEN, findings=(finding,)))


def test_a_slow_run_is_no_failed_one(planted: Profile) -> None:
    slow = judged(planted_run(speed=0.4), planted)
    assert slow.broken
    assert refusal(slow, NOTHING_SEEN) == ""
    assert differing([slow, judged(planted_run(), planted)]) == ("speed",)


@pytest.mark.parametrize(("length", "known"), [(102.0, True), (130.0, False), (None, False)])
def test_an_own_limit_knows_its_mission(length: float | None, known: bool) -> None:
    context = {} if length is None else {"length": length}
    assert (Threshold("<=", 9.0, source="site.yaml", mission={"length": 100.0}).mismatch(context) == "") is known
