"""A drive that failed, with a parameter of its own or of a file off: what is named first, and with what."""

from __future__ import annotations

from pathlib import Path

import pytest

from care_core.application.case import Request, open_case
from care_core.diagnose.records import Diagnosis
from care_core.ecosystems.findings import every_finding
from tests.ros_drives import ABORTED, Drive
from tests.wrong_parameters import START, Wrong, drive, rewritten

LOCAL, CONTROLLER = "/local_costmap/local_costmap", "/controller_server"
TRANSFORMS = (("map", "odom"), ("odom", "base_link"))
LATE = "Costmap2DROS transform timeout. Current time: {now:.4f}, global_pose stamp: {earlier:.4f}, tolerance: 0.0500"
HUSKY = Path(__file__).parents[2] / "samples" / "move_base_drive.bag"


def diagnosed(log: Path, *configs: Path, since: Path | None = None) -> Diagnosis:
    return open_case(Request(log, configs=configs, since=since), lambda _step, _share: None).diagnosis


def named(diagnosis: Diagnosis) -> list[str]:
    """Every parameter that a finding names."""
    return [name for one in every_finding(diagnosis.health.findings) for name in one.parameters]


@pytest.mark.parametrize(
    ("wrong", "first"),
    [
        ((CONTROLLER, "FollowPath.acc_lim_theta", 0.0), "acc_lim_theta"),
        ((CONTROLLER, "progress_checker.required_movement_radius", 8.0), "required_movement_radius"),
        (("/velocity_smoother", "max_velocity", [0.0, 0.0, 1.5]), "/velocity_smoother.max_velocity"),
        ((LOCAL, "rolling_window", False), f"{LOCAL}.rolling_window"),
        ((LOCAL, "obstacle_layer.scan.topic", "/scann"), f"{LOCAL}.obstacle_layer.scan.topic"),
    ],
)
def test_a_parameter_that_no_drive_succeeds_with_leads(tmp_path: Path, wrong: Wrong, first: str) -> None:
    leading = diagnosed(drive(tmp_path / "drive.mcap", wrong)).hypotheses[0]
    assert (leading.what, leading.name) == ("parameter", first)
    assert leading.probability > 0.5


def test_a_failed_drive_with_sound_parameters_names_none(tmp_path: Path) -> None:
    diagnosis = diagnosed(drive(tmp_path / "drive.mcap", frames=TRANSFORMS))
    assert diagnosis.hypotheses
    assert named(diagnosis) == []


def test_a_drive_that_succeeds_is_fine_whatever_its_parameters(tmp_path: Path) -> None:
    wrong = (LOCAL, "obstacle_layer.scan.topic", "/scann"), (CONTROLLER, "FollowPath.acc_lim_theta", 0.0)
    diagnosis = diagnosed(drive(tmp_path / "drive.mcap", *wrong, moves=True))
    assert diagnosis.hypotheses == ()
    assert named(diagnosis) == []


def test_a_frame_that_no_transform_has_is_named(tmp_path: Path) -> None:
    log = drive(tmp_path / "drive.mcap", (LOCAL, "robot_base_frame", "base_footprint"), frames=TRANSFORMS)
    diagnosis = diagnosed(log)
    assert diagnosis.hypotheses[0].name == f"{LOCAL}.robot_base_frame"
    (finding,) = (one for one in diagnosis.health.findings if one.parameters)
    assert "base_link, map, odom" in finding.evidence


def test_a_tolerance_below_the_delay_that_nodes_measure_gets_the_value_that_would_do(tmp_path: Path) -> None:
    log = drive(tmp_path / "drive.mcap", (LOCAL, "transform_tolerance", 0.05), complaints=[LATE])
    diagnosis = diagnosed(log)
    assert diagnosis.hypotheses[0].name == "transform_tolerance_local"
    (finding,) = (one for one in diagnosis.health.findings if one.parameters)
    assert finding.wanted == (("transform_tolerance_local", 0.6),)


def test_a_node_on_the_wrong_clock_is_named(tmp_path: Path) -> None:
    diagnosis = diagnosed(drive(tmp_path / "drive.mcap", (CONTROLLER, "use_sim_time", False), ticks=True))
    assert diagnosis.hypotheses[0].name == f"{CONTROLLER}.use_sim_time"


def test_a_file_counts_where_the_log_holds_no_value_and_is_named_with_its_line(tmp_path: Path) -> None:
    log = drive(tmp_path / "drive.mcap", recorded=False)
    text = START.read_text().replace("smoothing_frequency: 20.0", "smoothing_frequency: 0.0")
    file = tmp_path / "nav2.yaml"
    file.write_text(text)
    line = 1 + [row.strip() for row in text.splitlines()].index("smoothing_frequency: 0.0")
    (finding,) = (one for one in diagnosed(log, file).health.findings if one.parameters)
    assert f"({file}:{line})" in finding.evidence
    assert "care lint [cannot-work]" in finding.evidence
    held = drive(tmp_path / "held.mcap")
    assert named(diagnosed(held, file)) == []


def test_a_value_that_a_good_run_had_as_well_is_no_cause(tmp_path: Path) -> None:
    wrong = (LOCAL, "obstacle_layer.scan.raytrace_max_range", 1.0)
    failed = drive(tmp_path / "drive.mcap", wrong)
    good = drive(tmp_path / "good.mcap", wrong, moves=True)
    assert f"{LOCAL}.obstacle_layer.scan.raytrace_max_range" in named(diagnosed(failed))
    assert named(diagnosed(failed, since=good)) == []


def test_of_two_that_contradict_each_other_the_one_far_from_its_default_is_named(tmp_path: Path) -> None:
    wrong: dict[str, float | str] = {"/move_base/DWAPlannerROS/min_vel_x": 0.9, "/move_base/controller_patience": 0.0}
    names = named(diagnosed(rewritten(tmp_path / "drive.bag", HUSKY, wrong)))
    assert "min_vel_x" in names
    assert "/move_base/DWAPlannerROS/max_vel_x" not in names
    assert "/move_base/controller_patience" in names


COSTMAP = """local_costmap:
  local_costmap:
    ros__parameters:
      robot_radius: 0.3
      plugins: [inflation_layer]
      inflation_layer: {{plugin: "nav2_costmap_2d::InflationLayer", inflation_radius: {radius}}}
"""


@pytest.mark.parametrize(("radius", "lead"), [(0.12, "parameter"), (0.55, "world")])
def test_what_a_robot_is_caught_on_follows_from_plans_that_may_touch_it(
    tmp_path: Path, radius: float, lead: str
) -> None:
    file = tmp_path / "nav2.yaml"
    file.write_text(COSTMAP.format(radius=radius))
    diagnosis = diagnosed(Drive(fault="blocked", outcome=ABORTED).write(tmp_path / "drive.mcap"), file)
    assert diagnosis.hypotheses[0].what == lead
    (held,) = (one for one in every_finding(diagnosis.health.findings) if one.kind == "blocked")
    clear = [one for one in diagnosis.health.findings if one.kind == "clearance"]
    assert [held in one.consequences for one in clear] == ([True] if lead == "parameter" else [])


UNANSWERED = "Timed out while waiting for action server to acknowledge goal request for follow_path"
WAIT = "/bt_navigator.default_server_timeout"


def test_a_wait_for_an_answer_that_is_too_short_is_made_longer(tmp_path: Path) -> None:
    log = drive(tmp_path / "drive.mcap", ("/bt_navigator", "default_server_timeout", 20), complaints=[UNANSWERED])
    diagnosis = diagnosed(log)
    assert diagnosis.hypotheses[0].name == WAIT
    assert diagnosis.fix is not None
    assert [(change.option.name, change.suggested) for change in diagnosis.fix.changes] == [(WAIT, 1000.0)]


def test_a_server_that_is_late_for_a_long_wait_is_the_computers_fault(tmp_path: Path) -> None:
    diagnosis = diagnosed(drive(tmp_path / "drive.mcap", complaints=[UNANSWERED]))
    assert diagnosis.hypotheses[0].name.startswith("the computer is too busy: follow_path did not answer")
    assert diagnosis.fix is None
