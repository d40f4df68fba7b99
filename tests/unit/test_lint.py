"""What is wrong with configuration files, without a log."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Literal

import jsonschema
import pytest

from care_core.errors import UsageError
from care_core.lint.linting import lint
from care_core.lint.problems import Problem
from care_core.lint.rules import ROS1_RENAMED, ROS2_RENAMED, RULES, Renamed
from care_core.metadata import navigation
from care_core.report.linting import LintDocument, lint_document, lint_sarif, lint_text
from tests.conftest import Care


def findings(tmp_path: Path, name: str, text: str, target: str = "") -> tuple[Problem, ...]:
    path = tmp_path / name
    path.write_text(text)
    (linted,) = lint([str(path)], target)
    return linted.problems


def told(tmp_path: Path, name: str, text: str, target: str = "") -> list[tuple[int, str, str]]:
    return [(one.line, one.rule, one.severity.value) for one in findings(tmp_path, name, text, target)]


HUSKY = """controller_frequency: 5.0
recovery_behaviour_enabled: true
DWAPlannerROS:
  acc_lim_x: 2.5
  acc_lim_th: 3.2
  max_vel_trans: 0.5
  max_vel_rot: 1.0
  min_vel_rot: 0.2
  yaw_goal_tolerance: 0.1
"""


def test_the_dead_keys_of_a_planner_are_found_with_what_is_meant(tmp_path: Path) -> None:
    found = findings(tmp_path, "planner.yaml", HUSKY)
    assert [(one.line, one.column, one.hint) for one in found] == [
        (2, 1, "Did you mean recovery_behavior_enabled?"),
        (5, 3, "Did you mean acc_lim_theta?"),
        (7, 3, "Did you mean max_vel_theta?"),
        (8, 3, "Did you mean min_vel_theta?"),
    ]
    assert {one.rule for one in found} == {"unknown-key"}
    assert all("ros-planning/navigation" in one.source for one in found)


def test_a_key_renamed_between_distributions_is_a_note_until_one_is_named(tmp_path: Path) -> None:
    text = "DWAPlannerROS:\n  max_trans_vel: 0.5\n  max_vel_x: 0.5\n  acc_lim_theta: 3.2\n"
    assert told(tmp_path, "a.yaml", text, "kinetic") == []
    assert told(tmp_path, "a.yaml", text, "noetic") == [(2, "renamed", "warning")]
    rpp = """controller_server:
  ros__parameters:
    controller_plugins: ["FollowPath"]
    FollowPath:
      plugin: "nav2_regulated_pure_pursuit_controller::RegulatedPurePursuitController"
      desired_linear_vel: 0.5
"""
    assert told(tmp_path, "b.yaml", rpp, "jazzy") == []
    assert told(tmp_path, "b.yaml", rpp, "rolling") == [(6, "renamed", "warning")]


@pytest.mark.parametrize(
    ("key", "target", "found"),
    [
        ("acc_lim_th", "", [("renamed", "note")]),
        ("acc_lim_th", "indigo", []),
        ("acc_lim_th", "kinetic", [("renamed", "warning")]),
        ("acc_lim_theta", "", []),
        ("acc_lim_theta: 3.2\n  acc_lim_th", "", []),
    ],
)
def test_a_new_name_that_older_releases_read_as_well_is_told_whatever_the_file_is_for(
    tmp_path: Path, key: str, target: str, found: list[tuple[str, str]]
) -> None:
    text = f"TrajectoryPlannerROS:\n  max_vel_x: 0.45\n  min_in_place_rotational_vel: 0.4\n  {key}: 3.2\n"
    assert [(rule, severity) for _, rule, severity in told(tmp_path, "a.yaml", text, target)] == found


def test_a_key_that_another_plugin_reads_is_misplaced(tmp_path: Path) -> None:
    text = "global_costmap:\n  update_frequency: 5.0\n  meter_scoring: true\n"
    (found,) = findings(tmp_path, "a.yaml", text)
    assert (found.line, found.rule) == (3, "misplaced-key")
    assert "TrajectoryPlannerROS" in found.text


BEFORE_HYDRO = """observation_sources: front rear
obstacle_range: 2.5
robot_radius: 0.3
inflation_radius: 0.6
front: {{sensor_frame: laser, data_type: LaserScan, topic: scan, marking: true, clearing: true, {}: 0.5}}
rear: {{data_type: LaserScan, topic: rear, marking: true, clearing: true, expected_update_rate: 0.4}}
"""


def test_sources_that_a_costmap_itself_names_are_read_by_its_obstacle_layer(tmp_path: Path) -> None:
    assert findings(tmp_path, "costmap_common.yaml", BEFORE_HYDRO.format("observation_persistence")) == ()
    (found,) = findings(tmp_path, "costmap_common.yaml", BEFORE_HYDRO.format("observation_persistance"))
    assert (found.line, found.rule, found.hint) == (5, "unknown-key", "Did you mean observation_persistence?")
    assert "observation_persistance is not a parameter of ObstacleLayer" in found.text


DUMP = """!!python/object/new:dynamic_reconfigure.encoding.Config
dictitems:
  acc_lim_x: 2.5
  acc_lim_theta: 3.2
  dt_ref: 0.3
  weight_obstacle: 50.0
  groups: !!python/object/new:dynamic_reconfigure.encoding.Config
    dictitems: {acc_lim_x: 2.5, acc_lim_theta: 3.2, weight_obstacle: 50.0, id: 0, name: Default, parent: 0, type: ''}
    state: []
state: []
"""


def test_the_groups_of_a_dump_of_dynamic_reconfigure_are_no_parameters(tmp_path: Path) -> None:
    assert findings(tmp_path, "teb.yaml", DUMP) == ()
    (found,) = findings(tmp_path, "teb.yaml", DUMP.replace("dt_ref: 0.3", "dt_reff: 0.3"))
    assert found.hint == "Did you mean dt_ref?"


COSTMAP = """local_costmap:
  local_costmap:
    ros__parameters:
      update_frequency: {rate}
      footprint: "[[0.3, 0.2], [0.3, -0.2], [-0.3, -0.2], [-0.3, 0.2]]"
      plugins: ["inflation_layer"]
      inflation_layer:
        plugin: "nav2_costmap_2d::InflationLayer"
        inflation_radius: {radius}
      obstacle_layer:
        plugin: "nav2_costmap_2d::ObstacleLayer"
        enabled: true
"""


def test_inflation_is_weighed_against_the_footprint_and_types_against_what_is_declared(tmp_path: Path) -> None:
    not_loaded = (11, "not-loaded", "note")
    assert told(tmp_path, "a.yaml", COSTMAP.format(rate="5.0", radius="0.55")) == [not_loaded]
    assert told(tmp_path, "a.yaml", COSTMAP.format(rate="5.0", radius="0.15")) == [
        (9, "clearance", "warning"),
        not_loaded,
    ]
    assert told(tmp_path, "a.yaml", COSTMAP.format(rate="5", radius="0.55")) == [(4, "wrong-type", "error"), not_loaded]


def test_values_out_of_range_of_no_value_and_in_another_unit(tmp_path: Path) -> None:
    text = """DWAPlannerROS:
  sim_time: 1.7
  max_vel_x: 0.2
  min_vel_x: 0.5
  yaw_goal_tolerance: 10.0
  acc_lim_x: 90.0
  max_vel_theta: fast
"""
    assert told(tmp_path, "a.yaml", text) == [
        (4, "contradiction", "warning"),
        (5, "wrong-unit", "warning"),
        (6, "out-of-range", "warning"),
        (7, "wrong-type", "warning"),
    ]
    layer = "obstacle_layer:\n  enabled: true\n  observation_sources: scan\n  combination_method: 7\n"
    assert told(tmp_path, "b.yaml", f"global_costmap:\n  {layer.replace(chr(10), chr(10) + '  ')}\n") == [
        (5, "not-in-values", "warning")
    ]


def test_the_parameters_of_a_vehicle(tmp_path: Path) -> None:
    text = """# Vehicle: Copter
# Version: 4.6
BATT_LOW_VOLT,10.5
BATT_CRT_VOLT,11
WPNAV_SPEEED,500
WPNAV_ACCEL,250
PSC_POSXY_P,1
PSC_POSXY_P,1.2
FLTMODE1,77
RTL_ALT_M,15
"""
    assert told(tmp_path, "a.param", text) == [
        (4, "contradiction", "warning"),
        (5, "unknown-key", "warning"),
        (8, "duplicate", "warning"),
        (9, "not-in-values", "warning"),
        (10, "renamed", "warning"),
    ]
    found = findings(tmp_path, "a.param", text)
    assert found[1].hint == "Did you mean WPNAV_SPEED?"
    assert found[4].hint == "Write RTL_ALT, and its value times 100."
    assert told(tmp_path, "a.param", "WPNAV_SPEED,50000\nWPNAV_ACCEL,250\nRTL_ALT,1500\n") == [
        (1, "wrong-unit", "warning")
    ]


def test_a_line_that_cannot_be_read_is_a_finding_and_the_rest_is_still_read(tmp_path: Path) -> None:
    text = "RTL_ALT,1500\nonly\nWPNAV_SPEED,fast\nLAND_SPEED,50\n"
    assert told(tmp_path, "a.param", text) == [(2, "syntax", "error"), (3, "syntax", "error")]
    assert told(tmp_path, "a.yaml", "a: [1\nb: 2\n")[0][1:] == ("syntax", "error")


@pytest.mark.parametrize(
    "text",
    [
        "my_own_node:\n  gain: 3\n  nested: {a: 1}\n",
        "/**:\n  ros__parameters:\n    anything: 3\n",
        "amcl:\n  ros__parameters:\n    use_sim_time: $(var sim)\n    scan_topic: scan\n",
        "bt_navigator:\n  ros__parameters:\n    what_my_plugin_reads: 3\n",
        "costmap_common: {}\n",
    ],
)
def test_what_nobody_knows_is_let_be(tmp_path: Path, text: str) -> None:
    assert told(tmp_path, "a.yaml", text) == []


@pytest.mark.parametrize(("name", "text"), [("a.yaml", ""), ("a.param", "# saved\n\n")])
def test_a_file_without_a_parameter_is_a_fault(tmp_path: Path, name: str, text: str) -> None:
    assert told(tmp_path, name, text) == [(1, "empty", "warning")]


def test_the_profile_adds_its_own_range(tmp_path: Path, care: Care) -> None:
    path = tmp_path / "a.param"
    path.write_text("WPNAV_SPEED,1900\n")
    result = care("lint", str(path), "--profile", "arducopter")
    assert "outside-profile" in result.stdout
    assert result.code == 0


def test_documents_follow_their_schemas(tmp_path: Path, care: Care) -> None:
    path = tmp_path / "planner.yaml"
    path.write_text(HUSKY)
    linted = lint([str(path)])
    document = json.loads(lint_document(linted, "").to_json())
    jsonschema.validate(document, LintDocument.json_schema())
    sarif = lint_sarif(linted, "1")
    results = sarif["runs"][0]["results"]
    assert [one["locations"][0]["physicalLocation"]["region"]["startLine"] for one in results] == [2, 5, 7, 8]
    assert [RULES[one["ruleIndex"]].id for one in results] == [one["ruleId"] for one in results]
    assert f"{path}:2:1: warning [unknown-key]" in lint_text(linted)

    result = care("lint", str(path), "--sarif")
    assert result.code == 1
    assert json.loads(result.stdout)["version"] == "2.1.0"
    assert care("lint", str(path), "--target", "notic").code == 2
    with pytest.raises(UsageError, match="notic"):
        lint([str(path)], "notic")


def test_recorded_configurations_have_the_findings_that_were_looked_at_by_hand(recorded: Path) -> None:
    """Errors and warnings of each file, all of them checked against the sources; any more is a false alarm."""
    wanted = {
        "aion_r1_rover.param": 1, "solo_copter36.param": 2, "linorobot2_navigation.yaml": 2,
        "tb3_humble_burger.yaml": 1, "tb3_jazzy_burger.yaml": 1, "husky/planner.yaml": 5,
        "jackal/base_local_planner_params.yaml": 1,
        "jackal/costmap_common_params.yaml": 6, "jackal/map_nav_params_global_costmap_params.yaml": 1,
        "amcl_params.yaml": 1, "carlike_teb_local_planner_params.yaml": 2, "diff_drive_costmap_common_params.yaml": 1,
        "diff_drive_teb_local_planner_params.yaml": 2, "dwa_local_planner_params.yaml": 1,
        "turtlebot2/global_costmap_params.yaml": 1, "turtlebot2/local_costmap_params.yaml": 1,
    }  # fmt: skip
    for path in sorted((recorded / "logs" / "configs").rglob("*")):
        if path.is_file():
            (linted,) = lint([str(path)])
            count = sum(one.severity.value != "note" for one in linted.problems)
            expected = next((n for name, n in wanted.items() if str(path).endswith(name)), 0)
            assert count == expected, (path.name, linted.problems)


@pytest.mark.parametrize(
    "distribution", ["foxy", "galactic", "humble", "iron", "jazzy", "kilted", "lyrical", "rolling"]
)
def test_what_every_distribution_reads_raises_nothing_in_any(tmp_path: Path, distribution: str) -> None:
    text = """amcl:
  ros__parameters: {alpha1: 0.2, max_particles: 2000, laser_model_type: "likelihood_field", scan_topic: scan}
controller_server:
  ros__parameters: {controller_frequency: 20.0, controller_plugins: ["FollowPath"]}
planner_server:
  ros__parameters: {expected_planner_frequency: 20.0, planner_plugins: ["GridBased"]}
loopback_simulator:
  ros__parameters: {update_duration: 0.02}
"""
    assert told(tmp_path, "a.yaml", text, distribution) == []


@pytest.mark.parametrize(("ros", "renamed"), [("ros1", ROS1_RENAMED), ("ros2", ROS2_RENAMED)])
def test_the_new_name_of_every_renamed_key_is_read_by_its_owner_since_then(
    ros: Literal["ros1", "ros2"], renamed: tuple[Renamed, ...]
) -> None:
    for one in renamed:
        facts = navigation.known(ros, one.owner, one.new)
        assert any(one.since in navigation.distributions(fact, ros) for fact in facts), one


@pytest.mark.parametrize("number", ["9" * 400, "-" + "9" * 400, "0x" + "f" * 5000], ids=len)
@pytest.mark.parametrize(
    ("name", "text"), [("a.yaml", "/a: {{ros__parameters: {{x: {}}}}}"), ("a.param", "ANGLE_MAX,{}")]
)
def test_a_number_of_hundreds_of_digits_is_a_problem_of_its_line(
    tmp_path: Path, name: str, text: str, number: str
) -> None:
    assert (1, "error") in [(line, kind) for line, _, kind in told(tmp_path, name, f"{text.format(number)}\n")]


MOVE_BASE = {"max_vel_x": 0.5, "acc_lim_x": 2.5, "acc_lim_theta": 3.2, "sim_time": 1.7, "xy_goal_tolerance": 0.2}


def planner(controller_frequency: float = 10.0, **values: float) -> str:
    lines = [f"  {name}: {value}" for name, value in {**MOVE_BASE, **values}.items()]
    return "\n".join([f"controller_frequency: {controller_frequency}", "DWAPlannerROS:", *lines, ""])


@pytest.mark.parametrize(
    ("text", "rule", "key"),
    [
        (planner(), "", ""),
        (planner(max_vel_x=0.0), "cannot-work", "max_vel_x"),
        (planner(acc_lim_theta=0.0), "cannot-work", "acc_lim_theta"),
        (planner(controller_frequency=0.0), "cannot-work", "controller_frequency"),
        (planner(sim_time=0.05), "contradiction", "sim_time"),
        (planner(min_vel_trans=0.6), "contradiction", "min_vel_trans"),
        (planner(min_vel_theta=0.4, yaw_goal_tolerance=0.01), "contradiction", "yaw_goal_tolerance"),
        (planner(acc_lim_x=0.5, acc_lim_theta=1.0, min_vel_trans=0.1, min_vel_theta=0.4), "contradiction", "acc_lim_x"),
        (f"oscillation_timeout: 0.5\noscillation_distance: 0.5\n{planner()}", "contradiction", "oscillation_timeout"),
        (f"recovery_behavior_enabled: false\n{planner()}", "hinders", "recovery_behavior_enabled"),
        ("local_costmap:\n  update_frequency: 0.0\n", "cannot-work", "update_frequency"),
        ("local_costmap:\n  width: 1.0\n  height: 3.0\n  robot_radius: 0.6\n", "hinders", "width"),
        ("local_costmap:\n  resolution: 0.5\n  robot_radius: 0.3\n", "hinders", "resolution"),
        ("local_costmap:\n  rolling_window: false\n", "cannot-work", "rolling_window"),
        (
            "local_costmap:\n  robot_radius: 0.3\nglobal_costmap:\n  robot_radius: 0.9\n",
            "contradiction",
            "robot_radius",
        ),
        ("amcl:\n  tf_broadcast: false\n", "cannot-work", "tf_broadcast"),
    ],
)
def test_values_with_which_a_robot_cannot_work_are_found(tmp_path: Path, text: str, rule: str, key: str) -> None:
    found = [(one.rule, one.parameter.rpartition("/")[2]) for one in findings(tmp_path, "a.yaml", text)]
    assert found == ([(rule, key)] if rule else [])


def test_a_file_does_not_show_that_nobody_else_publishes_a_transform(tmp_path: Path) -> None:
    (found,) = findings(tmp_path, "a.yaml", "amcl:\n  tf_broadcast: false\n")
    assert found.text == "tf_broadcast of amcl is off: it does not tell where odom is on the map."
    assert found.hint == "Switch it on, unless another node publishes that transform."


MAPPED = "\n      static_layer: {{plugin: 'nav2_costmap_2d::StaticLayer', map_subscribe_transient_local: {}}}"
LAYERED = """local_costmap:
  local_costmap:
    ros__parameters:
      plugins: [obstacle_layer]
      obstacle_layer:
        plugin: nav2_costmap_2d::ObstacleLayer
        enabled: true
        observation_sources: scan
        scan: {topic: /scan, max_obstacle_height: 2.0,
               marking: true, clearing: true, obstacle_max_range: 2.5, raytrace_max_range: 3.0}
"""


@pytest.mark.parametrize(
    ("old", "new", "rule"),
    [
        ("marking: true", "marking: false", "hinders"),
        ("clearing: true", "clearing: false", "hinders"),
        ("enabled: true", "enabled: false", "hinders"),
        ("raytrace_max_range: 3.0", "raytrace_max_range: 2.0", "hinders"),
        ("obstacle_max_range: 2.5", "obstacle_max_range: 0.0", "cannot-work"),
        ("[obstacle_layer]", f"[static_layer, obstacle_layer]{MAPPED.format('false')}", "hinders"),
        ("[obstacle_layer]", f"[static_layer, obstacle_layer]{MAPPED.format('true')}", ""),
        ("max_range: 3.0}", "max_range: 3.0}\n      use_sim_time: true\namcl: {ros__parameters: {use_sim_time: false}}",
         "contradiction"),
        ("marking: true", "marking: true", ""),
    ],
)  # fmt: skip
def test_costmaps_that_see_nothing_or_forget_nothing_are_found(tmp_path: Path, old: str, new: str, rule: str) -> None:
    text = LAYERED.replace(old, new)
    assert [one.rule for one in findings(tmp_path, "a.yaml", text)] == ([rule] if rule else [])


@pytest.mark.parametrize("above", ["", "robot1", "<robot_namespace>"])
def test_a_costmap_is_called_by_its_own_name_whatever_it_stands_below(tmp_path: Path, above: str) -> None:
    text = LAYERED.replace("clearing: true", "clearing: false")
    if above:
        text = "\n".join([f'"{above}":', *(f"  {line}" for line in text.splitlines()), ""])
    (found,) = findings(tmp_path, "a.yaml", text)
    assert found.text == "No source of local_costmap takes obstacles out of it."
