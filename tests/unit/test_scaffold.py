"""What becomes of parameters, signals and missions in a first profile."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_core import plain_yaml
from care_core.errors import UsageError
from care_core.logs import formats
from care_core.metadata.navigation import fact_of
from care_core.records import field
from care_core.run import Setting
from care_core.scaffold.excluded import reason_to_exclude
from care_core.scaffold.inputs import InputLog, open_input
from care_core.scaffold.measures import Measure
from care_core.scaffold.options import Options, find_options
from care_core.scaffold.scaffold import scaffold
from care_core.scaffold.thresholds import RATIO, proposed_thresholds
from care_core.scaffold.writing import comment, scalar
from care_core.variables import Role, Threshold, Variable
from tests.courier import EVENT, event
from tests.made import MadeLog
from tests.ros_samples import ROS2, SECOND_NS, START_NS, McapFile, cdr, make


class SetLog(MadeLog, eq=False):
    """A made log that holds parameters."""

    parameters: Mapping[str, Any] = field(default_factory=dict)
    defaults: Mapping[str, float] = field(default_factory=dict)

    def settings(self) -> Mapping[str, tuple[Setting, ...]]:
        return {
            name: (Setting(name, value, "PARM", self.defaults.get(name)),) for name, value in self.parameters.items()
        }


def seen(parameters: Mapping[str, Any], *, ros: str = "", defaults: Mapping[str, float] | None = None) -> InputLog:
    log = SetLog(
        tables={},
        path=Path("a.mcap" if ros else "a.BIN"),
        format=formats.MCAP if ros else formats.DATAFLASH_BIN,
        facts={"ros": ros} if ros else {"firmware": "ArduPlane V4.5.0"},
        parameters=parameters,
        defaults=defaults or {},
    )
    return InputLog(log.path, log, log.settings(), {})


def recorded_speed(path: Path, parameter: str) -> InputLog:
    """A ROS 2 recording of a number and of one parameter of the node /controller_server."""
    kind = "std_msgs/msg/Float64"
    with McapFile(path) as log:
        log.add("/parameter_events", EVENT, START_NS, cdr(event({f"/controller_server.{parameter}": 1.0})))
        for second in range(20):
            log.add("/speed", kind, START_NS + second * SECOND_NS, cdr(make(ROS2, kind, 1.0 + second % 3)))
    return open_input(path)


def options(*logs: InputLog, known: Mapping[str, Variable] | None = None) -> Options:
    return find_options(logs, known or {}, ())


@pytest.mark.parametrize(
    "name", ["SIM_WIND_SPD", "STAT_RUNTIME", "INS_ACCOFFS_X", "INS_GYR2OFFS_Z", "COMPASS_OFS_X", "SERIAL1_BAUD"]
)
def test_what_nobody_chose_is_never_an_option(name: str) -> None:
    found = options(seen({name: 3.0}, defaults={name: 0.0}), seen({name: 5.0}, defaults={name: 0.0}))
    assert found.chosen == []
    assert found.left == {reason_to_exclude("ardupilot", name): [name]}


@pytest.mark.parametrize(
    "name",
    [
        "/controller_server./bond_disable_heartbeat_timeout", "/controller_server.bond_heartbeat_period",
        "/lifecycle_manager_navigation.autostart", "/controller_server.autostart_node", "/amcl.use_sim_time",
        "/controller_server.qos_overrides./tf.subscription.depth", "/controller_server.enable_stamped_cmd_vel",
        "/bt_navigator.navigate_to_pose.groot_server_port", "/controller_server.FollowPath.publish_evaluation",
        "/controller_server.FollowPath.TrajectoryVisualizer.trajectory_step", "/planner_server.introspection_mode",
        "/bt_navigator_navigate_to_pose_rclcpp_node.bt_loop_duration", "/amcl.initial_pose.x",
    ],
)  # fmt: skip
def test_what_nobody_tunes_of_nav2_is_never_an_option(name: str) -> None:
    found = options(seen({name: 3.0}, ros="2"), seen({name: 5.0}, ros="2"))
    assert found.chosen == []
    assert found.left == {reason_to_exclude("ros2", name): [name]}


def test_what_a_bundled_profile_sets_as_one_is_one_option_with_one_range() -> None:
    speed = Variable("speed", Role.OPTION, unit="m/s", range=(0.1, 0.9), parameters=("/c.max_vel_x", "/c.max_speed_xy"))
    known = dict.fromkeys(speed.parameters, speed)
    both = {"/c.max_vel_x": 0.5, "/c.max_speed_xy": 0.5}
    (option,) = options(seen(both, ros="2"), known=known).chosen
    assert (option.variable.name, option.variable.range) == ("speed", (0.1, 0.9))
    assert option.variable.parameters == ("/c.max_vel_x", "/c.max_speed_xy")
    apart = options(seen({**both, "/c.max_speed_xy": 0.7}, ros="2"), known=known).chosen
    assert [one.variable.parameters for one in apart] == [("/c.max_speed_xy",), ("/c.max_vel_x",)]


def test_a_parameter_at_its_default_is_left_out_unless_a_profile_knows_it() -> None:
    log = seen({"TECS_CLMB_MAX": 5.0, "NAVL1_PERIOD": 22.0}, defaults={"TECS_CLMB_MAX": 5.0, "NAVL1_PERIOD": 17.0})
    (option,) = options(log).chosen
    assert option.variable.name == "NAVL1_PERIOD"
    assert (option.variable.range, option.variable.default) == ((8.0, 44.0), 17.0)
    assert "firmware default (log)" in option.remark
    known = Variable("climb", Role.OPTION, unit="m/s", range=(1.0, 10.0), parameters=("TECS_CLMB_MAX",))
    names = {one.variable.name: one.variable.range for one in options(log, known={"TECS_CLMB_MAX": known}).chosen}
    assert names == {"NAVL1_PERIOD": (8.0, 44.0), "climb": (1.0, 10.0)}


def test_five_values_driven_are_the_range() -> None:
    logs = [seen({"/planner.speed": value}, ros="2") for value in (0.2, 0.4, 0.5, 0.5, 0.7, 0.9)]
    (option,) = options(*logs).chosen
    assert (option.variable.range, option.variable.default, option.variable.type) == ((0.2, 0.9), 0.5, "float")


def test_types_of_ros_are_those_of_the_log() -> None:
    log = seen({"/n.count": 4, "/n.rate": 4.0, "/n.fast": "true", "/n.frame": "map", "/n.zero": 0.0}, ros="2")
    found = options(log)
    assert {one.variable.name: one.variable.type for one in found.chosen} == {
        "count": "int", "rate": "float", "fast": "bool"
    }  # fmt: skip
    left = {name for names in found.left.values() for name in names}
    assert left == {"/n.frame", "/n.zero"}


def test_a_parameter_that_a_log_lacks_is_left_out_with_its_reason() -> None:
    found = options(seen({"/n.a": 1.0, "/n.b": 2.0}, ros="2"), seen({"/n.a": 1.5}, ros="2"))
    assert [one.variable.name for one in found.chosen] == ["a"]
    assert found.left == {"not every log holds them (an option needs a value in all 2)": ["/n.b"]}


def test_names_are_as_long_as_tells_them_apart() -> None:
    log = seen({"/move/local/inflation/radius": 1.0, "/move/global/inflation/radius": 2.0, "/move/speed": 3.0}, ros="1")
    assert [one.variable.name for one in options(log).chosen] == [
        "global_inflation_radius", "local_inflation_radius", "speed"
    ]  # fmt: skip


def test_failsafes_are_safety_options() -> None:
    found = options(seen({"FS_CRASH_ANGLE": 20.0}, defaults={"FS_CRASH_ANGLE": 30.0}))
    assert found.chosen[0].variable.safety


def test_the_table_knows_a_parameter_by_its_owner() -> None:
    dwa = fact_of("ros1", "/move_base/DWAPlannerROS/sim_time")
    assert dwa is not None
    assert (dwa.type, dwa.default_number, dwa.low) == ("float", 1.7, 0.0)
    layer = fact_of("ros1", "/move_base/global_costmap/obstacles_laser/combination_method")
    assert layer is not None
    assert dict(layer.values)[1.0] == "Maximum"
    assert fact_of("ros2", "/somebody.else") is None
    assert fact_of("ros1", "/stranger/sim_time") is None


def test_a_parameter_of_a_plugin_is_told_by_the_class_that_reads_it() -> None:
    follow = "/controller_server.FollowPath"
    mppi = {
        f"{follow}.plugin": "nav2_mppi_controller::MPPIController", f"{follow}.critics": "[ConstraintCritic]",
        f"{follow}.ConstraintCritic.cost_weight": 4.0, f"{follow}.time_steps": 56, f"{follow}.batch_size": 2000,
    }  # fmt: skip
    found = options(seen(mppi, ros="2"))
    assert [one.variable.name for one in found.chosen] == ["batch_size"]
    assert found.left["at their default in every log"] == [
        f"{follow}.ConstraintCritic.cost_weight", f"{follow}.time_steps"
    ]  # fmt: skip


def test_a_robot_of_no_known_kind_gets_signals_and_the_whole_recording(tmp_path: Path) -> None:
    made = scaffold([recorded_speed(tmp_path / "a.mcap", "gain")], "mine", [])
    assert made.schema.mission == {"kind": "recording"}
    assert [metric.name for metric in made.schema.metrics] == ["speed_mean", "speed_max"]
    assert [objective.name for objective in made.schema.objectives] == ["mission_time"]


def test_logs_of_two_ecosystems_make_no_profile() -> None:
    with pytest.raises(UsageError, match="different robots"):
        scaffold([seen({"/n.a": 1.0}, ros="2"), seen({"NAVL1_PERIOD": 22.0})], "mine", [])


def test_limits_come_from_good_runs_of_one_mission() -> None:
    time = Variable("time", Role.OBJECTIVE, kind="non-functional")
    measure = Measure(time, (10.0, 11.0, 90.0))
    assert proposed_thresholds([measure], (0, 1), alike=True)["time"].bound == Threshold("<=", 14.3)
    assert proposed_thresholds([measure], (0, 1), alike=False)["time"].bound == Threshold("<=", ratio=RATIO)
    assert proposed_thresholds([measure], (), alike=True)["time"].bound == Threshold("<=", ratio=RATIO)
    many = proposed_thresholds([Measure(time, (10.0, 10.1, 9.9, 10.2, 9.8, 10.0))], range(6), alike=True)["time"].bound
    assert many.value is not None
    assert 10.2 < many.value < 11.0


@given(st.text(max_size=40))
def test_any_text_is_written_so_that_it_reads_back(text: str) -> None:
    read = plain_yaml.load(f"key: {scalar(text)}\n")
    assert isinstance(read["key"], str)
    if text.isascii() and text.isprintable():
        assert read["key"] == text


@given(st.text(max_size=300))
def test_a_comment_is_nothing_but_a_comment(text: str) -> None:
    assert all(line.startswith("  # ") for line in comment(text, 2))
    assert plain_yaml.load("\n".join(comment(text, 2))) is None


def test_hostile_names_of_parameters_become_no_options(tmp_path: Path) -> None:
    hostile = 'a\n  evil: {role: option}\x1b[31m"'
    made = scaffold([recorded_speed(tmp_path / "a.mcap", hostile)], "mine", [])
    assert set(made.schema.variables) == {"speed_mean", "speed_max", "mission_time"}
    assert "\x1b" not in made.text
