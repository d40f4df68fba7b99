"""Thresholds that are a multiple of what the reference needs, and whose the reference is."""

from __future__ import annotations

from typing import cast

import pytest

from care_core.diagnose.implied import implied
from care_core.diagnose.judging import judge
from care_core.diagnose.limits import limit
from care_core.diagnose.records import Need
from care_core.diagnose.reference import Good
from care_core.profile.store import Profile
from care_core.records import replace
from care_core.run import Run, Setting
from care_core.variables import Threshold
from tests.planted import DEFAULTS, SCHEMA, TIME, planted_run, with_variable

RATIO = Threshold("<=", ratio=1.3)
TRAVELLING = with_variable(SCHEMA, replace(TIME, threshold=RATIO))


def driven(run: Run, default: float) -> Run:
    """The run, with the default of its speed that its log records."""
    return replace(run, settings={"SPEED": Setting("SPEED", run.config["speed"], "PARM", default=default)})


def test_the_bound_is_a_multiple_of_what_the_reference_needs(planted: Profile) -> None:
    slow = judge(planted_run(speed=0.4), TRAVELLING, planted.model).results[1]
    assert slow.need is not None
    assert slow.threshold == RATIO.for_need(slow.need.value)
    assert slow.need.low < slow.need.value < slow.need.high
    fine = judge(planted_run(), TRAVELLING, planted.model).results[1]
    assert (slow.status, fine.status) == ("fault", "ok")
    assert fine.need is not None
    assert fine.need.value == pytest.approx(fine.value, rel=0.1)
    assert "1.3 x the" in slow.wanted
    assert slow.is_sure


def test_what_a_mission_needs_is_known_before_the_run(planted: Profile) -> None:
    run = planted_run()
    slow = replace(run, objectives={**run.objectives, "time": 10 * cast("float", run.objectives["time"])})
    unknown = replace(slow, config={})
    needs = [judge(one, TRAVELLING, planted.model).results[1].need for one in (run, slow, unknown)]
    assert needs[0] == needs[1] is not None
    assert needs[2] is not None
    assert needs[0] == replace(needs[2], is_own=True)


def test_what_one_in_ten_runs_of_the_reference_exceeds_is_no_fault() -> None:
    sure, unsure = Need(10.0, 9.0, 11.0), Need(10.0, 6.0, 16.0)
    assert limit(RATIO, sure) == Threshold("<=", 13.0)
    assert limit(RATIO, unsure) == Threshold("<=", 16.0)
    assert limit(replace(RATIO, source="site.yaml"), unsure) == Threshold("<=", 13.0)
    assert limit(Threshold(">=", ratio=0.8), unsure) == Threshold(">=", 6.0)


def test_what_was_driven_as_the_reference_has_what_one_in_fifty_of_its_runs_takes() -> None:
    own = Need(10.0, 6.0, 16.0, is_own=True)
    assert limit(RATIO, own).value == pytest.approx(10.0 * 1.6 ** (2.054 / 1.282), rel=1e-3)
    assert limit(Threshold(">=", ratio=0.8), own).value == pytest.approx(10.0 * 0.6 ** (2.054 / 1.282), rel=1e-3)
    assert limit(replace(RATIO, source="site.yaml"), own) == Threshold("<=", 13.0)
    assert limit(RATIO, Need(10.0, 9.5, 10.5, is_own=True)) == Threshold("<=", 13.0)


def test_the_speed_of_a_robot_that_nothing_tells_gives_no_limit(planted: Profile) -> None:
    own = with_variable(TRAVELLING, replace(SCHEMA.variables["speed"], parameters=("SPEED",), ceiling=True))
    run = planted_run(speed=0.4)
    result = judge(replace(run, config={"accel": 1.5}), own, planted.model).results[1]
    assert result.status == "not_evaluated"
    assert "nothing gives SPEED" in result.reason


def test_a_robot_that_is_slower_is_judged_by_its_own_speed_unless_its_operator_says_otherwise(planted: Profile) -> None:
    own = with_variable(TRAVELLING, replace(SCHEMA.variables["speed"], parameters=("SPEED",), ceiling=True))
    slow = judge(planted_run(speed=0.4), own, planted.model)
    assert (slow.results[1].status, slow.reference.config["speed"]) == ("ok", 0.4)
    assert "speed as low as this robot's" in slow.reference.source
    fast = judge(planted_run(speed=DEFAULTS["speed"] + 0.1), own, planted.model)
    assert fast.reference.config["speed"] == DEFAULTS["speed"]
    good = Good({"SPEED": Setting("SPEED", DEFAULTS["speed"], "good.param")}, "good.param")
    assert judge(planted_run(speed=0.4), own, planted.model, good=good).results[1].status == "fault"


def test_a_value_within_the_interval_of_the_bound_is_not_sure(planted: Profile) -> None:
    result = judge(planted_run(speed=0.4), TRAVELLING, planted.model).results[1]
    assert result.need is not None
    assert result.threshold is not None
    near = replace(result, value=result.threshold.bound * 1.001)
    assert not near.is_sure


def test_an_operators_bound_wins(planted: Profile) -> None:
    result = judge(planted_run(), TRAVELLING, planted.model, {"time": 50.0}).results[1]
    assert result.threshold == Threshold("<=", 50.0)
    assert result.need is None
    assert result.wanted == "<= 50 s"


def test_without_a_model_nothing_is_judged_by_a_need() -> None:
    assert judge(planted_run(), TRAVELLING, None).results[1].status == "not_evaluated"


def test_a_floor_holds_where_the_reference_needs_little() -> None:
    floored = Threshold("<=", ratio=1.3, at_least=2.0)
    assert floored.for_need(1.0) == Threshold("<=", 2.0)
    assert floored.for_need(3.0) == Threshold("<=", 3.9)


def test_the_reference_is_the_operators_then_the_logs_then_the_profiles(planted: Profile) -> None:
    schema = with_variable(SCHEMA, replace(SCHEMA.variables["speed"], parameters=("SPEED",)))
    run = planted_run(speed=1.5)
    ours = judge(run, schema, planted.model).reference
    assert (ours.config["speed"], ours.source) == (DEFAULTS["speed"], "the profile's reference")
    logged = judge(driven(run, 1.2), schema, planted.model).reference
    assert (logged.config["speed"], logged.source) == (1.2, "the firmware defaults stored in the log")
    good = Good({"SPEED": Setting("SPEED", 1.4, "good.param")}, "the configuration of good.param")
    named = judge(driven(run, 1.2), schema, planted.model, good=good).reference
    assert (named.config["speed"], named.source) == (1.4, "the configuration of good.param")
    unacceptable = judge(driven(run, 99.0), schema, planted.model).reference
    assert unacceptable.config["speed"] == DEFAULTS["speed"]


def test_the_default_of_a_ros_node_is_no_reference(planted: Profile) -> None:
    run = planted_run(radius=0.9)
    described = Setting("/a/radius", 0.9, "/a/parameter_updates", default=0.6)
    reference = judge(replace(run, settings={"/a/radius": described}), SCHEMA, planted.model).reference
    assert (reference.config["radius"], reference.source) == (DEFAULTS["radius"], "the profile's reference")


def test_what_a_reference_file_lacks_is_at_the_defaults_of_the_log(planted: Profile) -> None:
    schema = with_variable(SCHEMA, replace(SCHEMA.variables["speed"], parameters=("SPEED",)))
    schema = with_variable(schema, replace(schema.variables["accel"], parameters=("ACCEL",)))
    run = planted_run(speed=1.5, accel=2.0)
    settings = {
        "SPEED": Setting("SPEED", 1.5, "PARM", default=1.2),
        "ACCEL": Setting("ACCEL", 2.0, "PARM", default=1.1),
    }
    good = Good({"SPEED": Setting("SPEED", 1.4, "good.param")}, "the configuration of good.param")
    found = judge(replace(run, settings=settings), schema, planted.model, good=good).reference
    assert (found.config["speed"], found.config["accel"]) == (1.4, 1.1)
    assert (
        found.source
        == "the configuration of good.param and, for what it lacks (1), the firmware defaults stored in the log"
    )
    empty = judge(replace(run, settings=settings), schema, planted.model, good=Good({}, "x.param")).reference
    assert empty.config["speed"] == 1.2
    assert empty.source == "the firmware defaults stored in the log, as x.param holds no option"


def test_a_tuned_value_beyond_the_range_is_not_off_a_reference_that_has_it(planted: Profile) -> None:
    schema = with_variable(SCHEMA, replace(SCHEMA.variables["speed"], parameters=("SPEED",)))
    good = Good({"SPEED": Setting("SPEED", 99.0, "good.param")}, "the configuration of good.param")
    run = planted_run(speed=99.0)
    assert judge(run, schema, planted.model, good=good).reference.config["speed"] == 99.0
    other = judge(planted_run(speed=1.5), schema, planted.model, good=good).reference
    assert other.config["speed"] == DEFAULTS["speed"]


def test_a_parameter_that_the_log_lacks_is_read_off_what_it_alone_moves(planted: Profile) -> None:
    slow = planted_run(speed=1.5)
    lacking = replace(slow, config={name: value for name, value in slow.config.items() if name != "speed"})
    (spoken,) = implied(lacking, SCHEMA, planted.model, DEFAULTS).values()
    assert spoken.option.name == "speed"
    assert spoken.value == pytest.approx(1.5, rel=0.25)
    assert str(spoken).startswith("speed is not in the log: mean_speed ")
    assert not implied(slow, SCHEMA, planted.model, DEFAULTS)
    usual = planted_run()
    assert not implied(replace(usual, config=lacking.config), SCHEMA, planted.model, DEFAULTS)
    assert not implied(replace(slow, config={}), SCHEMA, planted.model, DEFAULTS)


@pytest.mark.parametrize(("default", "reference"), [(1200.0, 50.0), (0.0, 50.0), (35.0, 35.0), (50.0, 50.0)])
def test_a_default_that_no_release_of_the_firmware_has_is_the_vendors(
    planted: Profile, default: float, reference: float
) -> None:
    option = replace(SCHEMA.variables["speed"], parameters=("LAND_SPEED",), range=(0.0, 2000.0))
    own = with_variable(TRAVELLING, option)
    setting = Setting("LAND_SPEED", default, "PARM", default=default)
    run = replace(planted_run(), config={**planted_run().config, "speed": default}, settings={"LAND_SPEED": setting})
    run = replace(run, log=replace(run.log, facts={"firmware": "ArduCopter V4.5.4"}))
    found = judge(run, own, planted.model).reference
    assert found.config["speed"] == reference
    said = f"not what a vendor made the default, speed {default:g} (the firmware's 50)"
    assert (said in found.source) is (reference != default)
    strange = judge(replace(run, log=replace(run.log, facts={})), own, planted.model).reference
    assert strange.config["speed"] == default
    named = Good({"LAND_SPEED": replace(setting, value=70.0)}, "good.param")
    vouched = judge(run, own, planted.model, good=named).reference
    assert (vouched.config["speed"], "vendor" in vouched.source) == (70.0, False)
