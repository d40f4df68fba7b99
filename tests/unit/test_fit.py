"""Whether a profile fits a log, by what the log says runs on the robot; and how to record what it misses."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from care_core.extract.coverage import cover, try_on
from care_core.extract.fit import fit_of
from care_core.extract.select import choose_profile
from care_core.files import bundled
from care_core.logs.opening import open_log
from care_core.profile.store import load_profile
from care_core.records import replace
from care_core.run import Setting
from tests.courier import TOLERANCE, USUAL, deliver

PLUGIN = "/controller_server.FollowPath.plugin"


@pytest.fixture(scope="module")
def log_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return deliver(tmp_path_factory.mktemp("fit") / "a.mcap", {**USUAL, TOLERANCE: 0.25}, np.random.default_rng(3))


def test_another_part_of_the_stack_does_not_fit(log_path: Path) -> None:
    log, schema = open_log(log_path), load_profile("nav2").schema
    named = next(name for name in log.settings() if name.endswith("xy_goal_tolerance"))
    own = str(log.settings()[named][0].value)
    fits = fit_of(log, cover(log, replace(schema, plugins={named: (own,), PLUGIN: ("NavFn", "DWB")})))
    other = fit_of(log, cover(log, replace(schema, plugins={named: ("MPPI",)})))
    assert fits.verdict != "no"
    assert other.verdict == "no"
    assert f"{named} is {own}, the profile was learned with MPPI" in other.reasons


def test_a_profile_of_another_stack_does_not_stand_in_for_one_whose_controller_is_another(log_path: Path) -> None:
    log, nav2, husky = open_log(log_path), load_profile("nav2"), load_profile("husky")
    named = next(name for name in log.settings() if name.endswith("xy_goal_tolerance"))
    other = replace(nav2, schema=replace(nav2.schema, plugins={named: ("MPPI",)}))
    assert choose_profile(log, [husky])[0] is husky
    assert choose_profile(log, [husky, other])[0] is None
    (reason,) = choose_profile(log, [husky, other])[1].fit.reasons
    assert reason.endswith("the profile was learned with MPPI")


TEB, DWA = "teb_local_planner/TebLocalPlannerROS", "dwa_local_planner/DWAPlannerROS"


@pytest.mark.parametrize(("planner", "fits"), [(TEB, False), (DWA, True)])
@pytest.mark.parametrize("name", ["move_base", "husky", "husky-care", "turtlebot3"])
def test_a_robot_with_another_local_planner_is_none_of_move_base(name: str, planner: str, fits: bool) -> None:
    log, schema, named = (
        open_log(bundled("samples", "move_base_drive.bag")),
        load_profile(name).schema,
        "base_local_planner",
    )
    known = {**log.settings(), f"/move_base/{named}": (Setting(f"/move_base/{named}", planner, "a file"),)}
    fit = fit_of(log, cover(log, schema), known)
    assert (fit.verdict != "no") is fits
    assert not any("nothing says" in reason for reason in fit.reasons)


def test_what_ros_2_misses_is_recorded_on_the_topic_of_all_nodes(log_path: Path) -> None:
    hints = {one.variable.name: one.hint for one in try_on(open_log(log_path), load_profile("nav2").schema).missed}
    assert "record /parameter_events, or " in hints["inflation_radius_global"]
    assert not any("parameter_updates" in hint for hint in hints.values())


@pytest.mark.parametrize(("count", "verb"), [(1, "is"), (2, "are")])
def test_few_messages_are_counted_as_one_speaks(log_path: Path, count: int, verb: str) -> None:
    log, schema = open_log(log_path), load_profile("nav2").schema
    few = replace(cover(log, schema), sources=count, sources_wanted=10)
    assert f"only {count} of the 10 messages that it reads {verb} in the log" in fit_of(log, few).reasons
