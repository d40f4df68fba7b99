"""Filters of robot_localization and the node of SLAM toolbox: what they fuse, read and join."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.nav2_files import findings, node, told

ODOM = "[false, false, false, false, false, false, true, true, false, false, false, true, false, false, false]"
NONE = f"[{', '.join(['false'] * 15)}]"


def ekf(*lines: str) -> str:
    return node("ekf_filter_node", "frequency: 30.0", "odom0: /wheels", *lines)


def with_(*true: int) -> str:
    return f"[{', '.join('true' if place in true else 'false' for place in range(15))}]"


@pytest.mark.parametrize(
    ("lines", "rule", "says"),
    [
        ((f"odom0_config: {NONE}",), "cannot-work", "odom0 is not heard at all"),
        (("odom0_config: [true, true]",), "cannot-work", "2 entries instead of 15"),
        ((f"odom0_config: {with_(6, 12)}",), "dead-key", "asks for ax, and nav_msgs/Odometry holds no acceleration"),
        ((f"odom0_config: {ODOM}", "imu0: /imu", f"imu0_config: {with_(0, 5)}"), "dead-key", "asks for x, and sensor"),
        ((f"odom0_config: {ODOM}", "pose0: /p", f"pose0_config: {with_(0, 6)}"), "dead-key", "asks for vx"),
        ((f"odom0_config: {ODOM}", f"imu0_config: {with_(5)}"), "cannot-work", "no imu0 beside it"),
        ((f"odom0_config: {ODOM}", "odom0_differential: true", "odom0_relative: true"), "contradiction", "only the"),
        ((f"odom0_config: {ODOM}", "world_frame: world"), "contradiction", "neither map_frame nor odom_frame"),
        ((f"odom0_config: {ODOM}", "odom_frame: odom", "base_link_frame: odom"), "cannot-work", "are both odom"),
        ((f"odom0_config: {ODOM}", "process_noise_covariance: [0.1, 0.1]"), "cannot-work", "instead of 225"),
        ((f"odom0_config: {with_(0, 1, 5)}", "imu0: /imu", f"imu0_config: {with_(5)}"), "hinders", "give the heading"),
        ((f"odom0_config: {ODOM}", "two_dmode: true"), "unknown-key", "two_dmode"),
        ((f"odom0_config: {ODOM}", "odom0_relativity: true"), "unknown-key", "odom0_relativity"),
    ],
)
def test_what_a_filter_cannot_fuse_or_join(tmp_path: Path, lines: tuple[str, ...], rule: str, says: str) -> None:
    (found,) = findings(tmp_path, ekf(*lines))
    assert found.rule == rule
    assert says in found.text


def test_a_name_of_the_same_words_is_the_one_that_is_meant(tmp_path: Path) -> None:
    (found,) = findings(tmp_path, ekf(f"odom0_config: {ODOM}", "base_link_output_frame: base"))
    assert found.hint == "Did you mean base_link_frame_output?"


def test_headings_of_which_one_counts_from_the_start_do_not_clash(tmp_path: Path) -> None:
    imu = ("imu0: /imu", f"imu0_config: {with_(5)}", "imu0_relative: true")
    assert told(tmp_path, ekf(f"odom0_config: {with_(0, 1, 5)}", *imu)) == []


def test_a_filter_that_is_set_up_raises_nothing(tmp_path: Path) -> None:
    diagonal = f"[{', '.join(['0.05'] * 15)}]"
    text = ekf(f"odom0_config: {ODOM}", "imu0: imu", f"imu0_config: {with_(5, 11, 12)}", "world_frame: odom",
               f"process_noise_covariance: {diagonal}", "map_frame: map", "imu0_queue_size: 5", "mine: 3")  # fmt: skip
    assert told(tmp_path, text) == []


def test_topics_that_a_launch_file_names_are_a_note(tmp_path: Path) -> None:
    (found,) = findings(tmp_path, f"frequency: 30\nodom0_config: {ODOM}\n")
    assert (found.rule, found.severity.value) == ("cannot-work", "note")


@pytest.mark.parametrize(
    ("lines", "rule", "hint"),
    [
        (("magnetic_declination_radians: 12.9",), "wrong-unit", "0.2251 rad"),
        (("magnetic_declination_radians: 0.1", "yaw_offset: 90.0"), "wrong-unit", "1.571 rad"),
        (("magnetic_declination_radians: 0.1", "wait_for_datum: true"), "hinders", "Write datum"),
        (("magnetic_declination_radians: 0.1", "wait_for_datum: true", "datum: [50.0, 8.0, 0.0]"), "", ""),
        (("magnetic_declination_radians: 0.1", "zero_altitud: true"), "unknown-key", "zero_altitude"),
    ],
)
def test_navsat_transform_counts_in_radians(tmp_path: Path, lines: tuple[str, ...], rule: str, hint: str) -> None:
    found = findings(tmp_path, node("navsat_transform", *lines))
    assert [one.rule for one in found] == ([rule] if rule else [])
    assert all(hint in one.hint for one in found)


@pytest.mark.parametrize(
    ("line", "rule", "says"),
    [
        ("transform_publish_period: 0.0", "cannot-work", "where odom is on the map"),
        ("throttle_scans: 0", "", ""),
        ("mode: maping", "not-in-values", "maping"),
        ("map_file_name: maps/office.posegraph", "cannot-work", "ends in .posegraph"),
        ("map_file_name: maps/office.v2", "", ""),
        ("solver_plugin: solver_plugin::CeresSolver", "plugin-name", "the node exits"),
        ("max_laser_rang: 5.0", "unknown-key", "max_laser_rang"),
        ("map_update_interval: 5", "wrong-type", "an integer"),
        ("minimum_travel_heading: 30.0", "wrong-unit", "a whole turn"),
        ("base_frame: odom", "cannot-work", "odom_frame and base_frame are both odom"),
        ("solver_plugin: my_solvers::Fast", "", ""),
        ("resolution: 0.05", "", ""),
    ],
)
def test_what_keeps_slam_toolbox_from_its_work(tmp_path: Path, line: str, rule: str, says: str) -> None:
    found = findings(tmp_path, node("slam_toolbox", "odom_frame: odom", line))
    assert [one.rule for one in found] == ([rule] if rule else [])
    assert all(says in one.text for one in found)
