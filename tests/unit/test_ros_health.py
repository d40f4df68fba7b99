"""What is found in drives that have one known fault, in healthy ones, and in recordings that tell of no robot."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from numpy.typing import NDArray

from care_core.ecosystems.findings import Health, every_finding
from care_core.ecosystems.registry import run_model
from care_core.ecosystems.ros import ECOSYSTEM
from care_core.ecosystems.ros.checks import imu as felt
from care_core.ecosystems.ros.checks import messages, odometry, timing
from care_core.ecosystems.ros.checks.messages import gist, reported
from care_core.ecosystems.ros.messages import IMU, MESSAGES, type_of
from care_core.ecosystems.ros.motion import odometry_of
from care_core.ecosystems.ros.node_messages import LogMessage, Report
from care_core.logs.base import Channel, Table
from care_core.logs.opening import open_log
from care_core.logs.ros_log import RosLog
from tests.ros_drives import ABORTED, BATTERY, FAILS_AT_S, ODOMETRY, RAYS, SCAN, SUCCEEDED, TWIST, Drive
from tests.ros_samples import (
    ROS2,
    SECOND_NS,
    START_NS,
    McapFile,
    cdr,
    imu,
    make,
    random_message,
    stamp,
    write_db3,
    write_mcap,
)
from tests.whole import one_in

INFO, WARN, ERROR, FATAL = 20, 30, 40, 50


def looked_at(drive: Drive, tmp_path: Path) -> Health:
    return ECOSYSTEM.examine(run_model(open_log(drive.write(tmp_path / "drive.mcap"))))


@pytest.mark.parametrize(
    ("fault", "kind", "suspect"),
    [
        ("laser dead", "laser", "hardware"),
        ("laser stuck", "laser", "hardware"),
        ("laser noise", "laser", "hardware"),
        ("jump", "localisation", "hardware"),
        ("drift", "localisation", "hardware"),
        ("weak", "drive", "hardware"),
        ("pulls", "drive", "hardware"),
        ("pulls hard, stands", "drive", "hardware"),
        ("stall", "drive", "hardware"),
        ("loss", "commands", "hardware"),
        ("battery", "battery", "hardware"),
        ("blocked", "blocked", "world"),
        ("blocked, turning", "blocked", "world"),
    ],
)
def test_a_fault_is_the_first_finding_with_its_onset(fault: str, kind: str, suspect: str, tmp_path: Path) -> None:
    health = looked_at(Drive(fault, ABORTED), tmp_path)
    first = health.findings[0]
    assert (first.kind, first.suspect) == (kind, suspect)
    assert first.onset_s == pytest.approx(FAILS_AT_S, abs=3.0)
    assert first.probability > 0.5


@pytest.mark.parametrize("crawls", [False, True])
@pytest.mark.parametrize(
    ("fault", "title"),
    [("held", "something holds the robot"), ("stall", "the drive does not answer its commands")],
)
def test_current_tells_a_robot_that_is_held_from_a_drive_that_is_dead(
    fault: str, title: str, crawls: bool, tmp_path: Path
) -> None:
    first = looked_at(Drive(fault, ABORTED, waits_s=4.0, crawls=crawls), tmp_path).findings[0]
    assert first.title.startswith(title)


def frozen(message: Any) -> None:
    message.pose.pose.position.x = message.pose.pose.position.y = message.twist.twist.linear.x = 0.0


def without_position(message: Any) -> None:
    message.pose.pose.position.x = message.pose.pose.position.y = 0.0


def not_a_number(message: Any) -> None:
    message.pose.pose.position.x = float("nan")


def without_time(message: Any) -> None:
    message.header.stamp.sec = message.header.stamp.nanosec = 0


def half_as_fast(message: Any) -> None:
    time_ns = message.header.stamp.sec * SECOND_NS + message.header.stamp.nanosec
    message.header.stamp = stamp(ROS2, START_NS + (time_ns - START_NS) // 2)


def always_the_same(message: Any) -> None:
    message.voltage, message.current = 24.0, -2.0


@pytest.mark.parametrize(
    ("kind", "change", "title"),
    [
        (ODOMETRY, frozen, "never moved, but goals were reached"),
        (ODOMETRY, without_position, "has no position"),
        (ODOMETRY, not_a_number, "no numbers"),
        (ODOMETRY, without_time, "no time"),
        (ODOMETRY, half_as_fast, "stamps of /wheels/odom run at 0.5 of the recording's clock"),
        (BATTERY, always_the_same, "reports the same values throughout"),
    ],
)
def test_a_source_that_cannot_be_is_a_finding(
    kind: str, change: Callable[[Any], None], title: str, tmp_path: Path
) -> None:
    class Broken(Drive):
        def messages(self) -> Iterator[tuple[str, str, float, Any]]:
            for topic, name, time_s, message in super().messages():
                if name == kind:
                    change(message)
                yield topic, name, time_s, message

    found = looked_at(Broken(), tmp_path).findings
    assert [one for one in found if title in one.title], found
    assert all(one.severity in ("warning", "info") for one in found)


def test_the_gist_of_a_traceback_is_what_was_raised_and_where() -> None:
    text = "bad callback: <bound method Pursuit.on_fix of <__main__.Pursuit object at 0x7f>>\n" + (
        'Traceback (most recent call last):\n  File "/opt/ros/rospy/topics.py", line 750, in _invoke\n    cb(msg)\n'
        '  File "/home/me/src/pursuit.py", line 176, in on_fix\n    steer = int(angle)\n'
        "ValueError: cannot convert float NaN to integer\n"
    )
    assert gist(text) == "ValueError: cannot convert float NaN to integer (pursuit.py line 176, on_fix)"
    assert gist("laser is gone " * 20) == f"{'laser is gone ' * 5}laser..."


@pytest.mark.parametrize("outcome", [SUCCEEDED, ABORTED])
def test_a_healthy_drive_has_no_finding(outcome: int, tmp_path: Path) -> None:
    health = looked_at(Drive(outcome=outcome), tmp_path)
    assert health.findings == ()
    assert not health.too_little


def test_what_was_survived_is_no_more_than_a_warning(tmp_path: Path) -> None:
    survived = looked_at(Drive("laser dead", SUCCEEDED), tmp_path)
    lost = looked_at(Drive("laser dead", ABORTED), tmp_path)
    assert [one.severity for one in survived.findings] == ["warning"]
    assert lost.findings[0].severity == "critical"


def test_a_laser_of_which_few_scans_came_before_it_died_is_told(tmp_path: Path) -> None:
    class Thinned(Drive):
        def messages(self) -> Iterator[tuple[str, str, float, Any]]:
            everything = list(super().messages())
            scans = [one for one in everything if one[1] == SCAN and one[2] >= FAILS_AT_S - 6]
            yield from (one for one in everything if one[1] != SCAN)
            yield from scans[:: len(scans) // 6]

    titles = [one.title for one in looked_at(Thinned("laser dead"), tmp_path).findings]
    assert titles[0] == "the laser falls silent: /front/scan ends"


@pytest.mark.parametrize(("times", "is_noted"), [(19, False), (20, True)])
def test_a_warning_that_comes_again_and_again_is_noted(times: int, is_noted: bool, tmp_path: Path) -> None:
    said = [(5.0 + n / 10, WARN, "/relay", f"Dropping message {n}: the queue is full") for n in range(times)]
    found = looked_at(Drive(said=said), tmp_path).findings
    told = [("/relay: Dropping message 0: the queue is full", "info")] if is_noted else []
    assert [(one.title, one.severity) for one in found] == told


def test_consequences_fold_under_their_cause(tmp_path: Path) -> None:
    said = [(FAILS_AT_S + 4 + n, ERROR, "planner_server", "GridBased: failed to create plan") for n in range(12)]
    health = looked_at(Drive("laser dead", ABORTED, said), tmp_path)
    assert [one.kind for one in health.findings] == ["laser"]
    assert "planner" in [one.kind for one in health.findings[0].consequences]


@pytest.mark.parametrize(
    ("node", "text", "kind"),
    [
        ("controller_server", "Failed to make progress", "control"),
        ("controller_server", "Controller patience exceeded", "control"),
        ("bt_navigator", "Failed to get result for follow_path in node halt!", "control"),
        ("move_base", "DWA planner failed to produce path.", "control"),
        ("move_base", "Aborting because a valid control could not be found.",
         "control"),
        ("move_base", "Aborting because a valid plan could not be found.",
         "planner"),
        ("planner_server", "GridBased: failed to create plan with tolerance 0.50.", "planner"),
    ],
)  # fmt: skip
def test_who_finds_no_way_is_suspected_of_its_parameters(tmp_path: Path, node: str, text: str, kind: str) -> None:
    said = [(20.0 + n, ERROR, node, text) for n in range(12)]
    health = looked_at(Drive(outcome=ABORTED, said=said), tmp_path)
    assert [(one.kind, one.suspect) for one in health.findings] == [(kind, "parameter")]


@pytest.mark.parametrize(
    ("text", "title"),
    [
        ("Control loop missed its desired rate of 20.0000 Hz. Current loop rate is 2.0000 Hz.",
         "the control loop runs at 2 Hz, its rate is 20 Hz"),
        ("Control loop missed its desired rate of 20.0000Hz... the loop actually took 0.5000 seconds",
         "the control loop runs at 2 Hz, its rate is 20 Hz"),
        ("Control loop missed its desired rate of 20.0000 Hz. Current loop rate is 18.0000 Hz.", None),
        ("Map update loop missed its desired rate of 5.0000Hz... the loop actually took 2.0000 seconds", None),
    ],
)  # fmt: skip
def test_a_control_loop_at_a_tenth_of_its_rate_is_a_finding(tmp_path: Path, text: str, title: str | None) -> None:
    said = [(20.0 + n, WARN, "controller_server", text) for n in range(5)]
    findings = looked_at(Drive(outcome=ABORTED, said=said), tmp_path).findings
    serious = [one.title for one in findings if one.severity != "info"]
    assert serious == ([title] if title else [])


@pytest.mark.parametrize(("said", "found"), [([], 1), ([LogMessage(1.0, INFO, "/move_base", "Got new plan")], 0)])
def test_seldom_commands_tell_of_a_slow_loop_where_no_node_is_heard(said: list[LogMessage], found: int) -> None:
    """A loop that is late says so: where nodes are heard and none of them does, it is the recording that is thin."""
    drive = SimpleNamespace(
        log_messages=said,
        commands=SimpleNamespace(t=np.arange(0.0, 60.0, 2.0), topic="/cmd_vel"),
        settings={"/move_base/controller_frequency": (SimpleNamespace(value=5.0),)},
        goals=(SimpleNamespace(sent_s=0.0, end_s=60.0),),
        severity=lambda at: "critical",
    )
    told = [one.title for one in timing._slow_control(cast(Any, drive))]
    assert told == ["the control loop runs at 0.5 Hz, its rate is 5 Hz"] * found


def test_a_loop_is_slow_where_it_misses_its_rate_for_long(tmp_path: Path) -> None:
    text = "Control loop missed its desired rate of 20.0000 Hz. Current loop rate is {} Hz."
    kept = [(10.0 + n, WARN, "controller_server", text.format(rate)) for n, rate in enumerate(["20.0000", "inf"] * 8)]
    begins = [(20.0 + n / 10, WARN, "controller_server", text.format(rate)) for n, rate in enumerate((9.0, 5.0, 8.0))]
    lasts = [(20.0 + 2 * n, WARN, "controller_server", text.format(8.0 + n)) for n in range(8)]
    notes = {"none": kept, "a moment": [*kept, *begins], "long": [*kept, *lasts]}
    told = {name: looked_at(Drive(said=said), tmp_path) for name, said in notes.items()}
    found = {name: [one.evidence for one in health.findings] for name, health in told.items()}
    slow = "8 messages from controller_server of less than its rate, the lowest 8 of 20 Hz"
    assert found == {"none": [], "a moment": [], "long": [slow]}
    said = {name: [e.text for e in health.timeline if "Control loop" in e.text] for name, health in told.items()}
    assert said["none"] == []
    assert [text.partition("rate is ")[2] for text in said["a moment"]] == [
        "5.0 Hz. (3 times, until 20.2 s, this the lowest)"
    ]


def test_the_account_tells_goals_and_groups_messages(tmp_path: Path) -> None:
    said = [(10.0 + n, WARN, "local_costmap", f"Map update took {n}.5 seconds") for n in range(20)]
    health = looked_at(Drive(outcome=ABORTED, said=said), tmp_path)
    texts = [one.text for one in health.timeline]
    assert any(text.startswith("goal 1") and "aborted after 39 s" in text for text in texts)
    assert sum("Map update" in text for text in texts) == 1
    assert any("(20 times, until 29.0 s)" in text for text in texts)
    assert [one.time_s for one in health.timeline] == sorted(one.time_s for one in health.timeline)
    assert len(texts) <= 40


def test_qos_that_does_not_fit_is_no_broken_sensor(tmp_path: Path) -> None:
    text = "New publisher discovered on topic '/points', offering incompatible QoS. No messages will be sent to it."
    health = looked_at(Drive(said=[(1.5, WARN, "rosbag2_recorder", text)]), tmp_path)
    (finding,) = health.findings
    assert (finding.kind, finding.suspect, finding.onset_s) == ("topics", "operation", 1.5)
    assert "/points" in finding.title


def test_an_error_that_a_fatal_one_follows_leads_it(tmp_path: Path) -> None:
    said = [(30.0, ERROR, "/lidar", "Connection timeout"), (30.5, FATAL, "/monitor", "Watchdog timeout")]
    health = looked_at(Drive(outcome=ABORTED, said=said), tmp_path)
    assert [one.kind for one in health.findings] == ["laser"]
    assert [one.kind for one in health.findings[0].consequences] == ["software"]


@pytest.mark.parametrize(("node", "told"), [("/rviz_1537544825", 0), ("/robot/rqt_gui", 0), ("/driver", 1)])
def test_what_fails_in_a_display_fails_nothing_of_the_robot(tmp_path: Path, node: str, told: int) -> None:
    health = looked_at(Drive(said=[(5.0, ERROR, node, "poll failed with error Interrupted system call")]), tmp_path)
    assert len([one for one in health.findings if node in one.title]) == told
    assert any(node in one.text for one in health.timeline)


def test_recordings_that_tell_of_no_robot_say_so(tmp_path: Path) -> None:
    write_mcap(tmp_path / "imu.mcap")
    health = ECOSYSTEM.examine(run_model(open_log(tmp_path / "imu.mcap")))
    assert health.too_little
    assert health.findings == ()
    assert health.too_little.startswith("it holds inertial data, and nothing that tells how a robot did: no odometry")


def test_types_that_are_not_read_are_named(tmp_path: Path) -> None:
    kind = "std_msgs/msg/Float32"
    depths = [("/depth", kind, START_NS + n * SECOND_NS, make(ROS2, kind, float(n))) for n in range(20)]
    health = ECOSYSTEM.examine(run_model(open_log(write_db3(tmp_path / "floats", messages=depths))))
    assert health.too_little.startswith(
        "it holds std_msgs/Float32, which is not read, and nothing that tells how a robot did"
    )


def test_a_battery_that_says_nothing_plausible_is_not_said_to_be_missing(tmp_path: Path) -> None:
    messages = [
        (topic, kind, START_NS + round(t * 1e9), message)
        for topic, kind, t, message in Drive().messages()
        if kind == BATTERY
    ]
    dead = [(topic, kind, at, dataclasses.replace(message, voltage=0.9)) for topic, kind, at, message in messages]
    health = ECOSYSTEM.examine(run_model(open_log(write_db3(tmp_path / "bag", messages=dead))))
    assert health.too_little.endswith(
        "goals, commands, laser or messages, and too little or nothing plausible of battery"
    )


def test_an_empty_recording_is_said_to_be_empty(tmp_path: Path) -> None:
    with McapFile(tmp_path / "empty.mcap"):
        pass
    health = ECOSYSTEM.examine(run_model(open_log(tmp_path / "empty.mcap")))
    assert health.too_little
    assert any("nothing was recorded" in one.text for one in health.timeline)


def test_other_containers_are_looked_at_alike(tmp_path: Path) -> None:
    messages = [
        (topic, kind, START_NS + round(t * 1e9), message)
        for topic, kind, t, message in Drive("stall", ABORTED).messages()
    ]
    log = open_log(write_db3(tmp_path / "bag", messages=sorted(messages, key=lambda one: one[2])))
    assert [one.kind for one in ECOSYSTEM.examine(run_model(log)).findings][:1] == ["drive"]


def test_times_and_samples_of_a_recording(tmp_path: Path) -> None:
    log = open_log(Drive().write(tmp_path / "drive.mcap"))
    assert isinstance(log, RosLog)
    times = log.times()["/front/scan"]
    assert len(times) == 200
    assert times[1] - times[0] == pytest.approx(0.2)
    few = log.read({"/front/scan": ("range_max",)}, {"/front/scan": 50})["/front/scan"]
    assert few.t.tolist() == times[::4].tolist()


@pytest.mark.parametrize(("pace", "found"), [(1.0, []), (0.9, []), (0.4, ["cpu"])])
def test_a_simulation_that_lags_behind_real_time_is_noted(pace: float, found: list[str], tmp_path: Path) -> None:
    with McapFile(tmp_path / "slow.mcap") as log:
        for row in range(300):
            own_ns = int(row * 100_000_000 * pace)
            reading = imu(ROS2, row, own_ns)
            log.add("/imu", "sensor_msgs/msg/Imu", START_NS + row * 100_000_000, cdr(reading))
    health = ECOSYSTEM.examine(run_model(open_log(tmp_path / "slow.mcap")))
    assert [one.kind for one in health.findings if one.kind != "log"] == found
    assert all(one.severity == "info" for one in health.findings)


def test_renamed_files_of_a_bag_are_noted(tmp_path: Path) -> None:
    write_db3(tmp_path / "bag")
    (data,) = (tmp_path / "bag").glob("*.db3")
    data.rename(data.with_name("other.db3"))
    (note,) = (one for one in ECOSYSTEM.examine(run_model(open_log(tmp_path / "bag"))).findings if one.kind == "log")
    assert note.title == "metadata.yaml names other files than those beside it"
    assert "other.db3" in note.evidence


KINDS_READ = (
    "nav_msgs/msg/Odometry", "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped", "sensor_msgs/msg/LaserScan",
    "sensor_msgs/msg/BatteryState", "sensor_msgs/msg/Imu", "rcl_interfaces/msg/Log", "tf2_msgs/msg/TFMessage",
    "diagnostic_msgs/msg/DiagnosticArray", "action_msgs/msg/GoalStatusArray", "lifecycle_msgs/msg/TransitionEvent",
)  # fmt: skip


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize("seed", one_in(4, range(12)))
def test_whatever_messages_hold_a_look_at_them_succeeds(seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)
    with McapFile(tmp_path / "random.mcap") as log:
        for row in range(240):
            for kind in KINDS_READ:
                if rng.random() < 0.5:
                    topic = (
                        "/cmd_vel"
                        if kind.endswith("/Twist")
                        else "/a/_action/status"
                        if "Status" in kind
                        else f"/{kind}"
                    )
                    when = START_NS + row * 50_000_000 + int(rng.integers(0, 20_000_000))
                    log.add(topic, kind, when, cdr(random_message(ROS2, kind, rng)))
    health = ECOSYSTEM.examine(run_model(open_log(tmp_path / "random.mcap")))
    assert all(one.title and one.evidence for one in health.findings)
    assert len(health.timeline) <= 60


@pytest.mark.parametrize("wrong", [{"parent": 7}, {"x": "far"}, {"child": None}])
def test_a_transform_whose_fields_are_declared_as_what_they_are_not_says_nothing(wrong: dict[str, object]) -> None:
    good: dict[str, object] = {"parent": "/map", "child": "odom", "x": 1.0, "y": 2.0}

    def columns(*ones: dict[str, object]) -> list[NDArray[np.object_]]:
        made = [np.empty(len(ones), dtype=object) for _ in good]
        for column, name in zip(made, good, strict=True):
            column[:] = [[one[name]] for one in ones]
        return made

    t = np.array([0.0, 1.0])
    assert odometry._edges(t, *columns(good, good))["map -> odom"].tolist() == [[0.0, 1.0, 2.0], [1.0, 1.0, 2.0]]
    assert len(odometry._edges(t, *columns(good, good | wrong))["map -> odom"]) == 1
    scalars = [np.array([7, 7], dtype=object)] * 4
    assert not odometry._edges(t, *scalars)


def test_what_is_never_published_is_told_in_words() -> None:
    silent = Report(1.0, "/diagnostics", "ekf_node: odometry/filtered topic status", 2, "No events recorded.")
    assert reported(silent) == "diagnostics: ekf_node publishes nothing on odometry/filtered"
    slow = Report(1.0, "/diagnostics", "gps: fix topic status", 2, "Frequency too low.")
    assert reported(slow) == "diagnostics: gps: fix topic status: Frequency too low"


def severities(*reports: Report) -> dict[str, str]:
    """How grave the errors of diagnostics are in a drive that records nothing else."""
    drive = SimpleNamespace(reports=reports, duration_s=60.0, severity=lambda _at, most: most)
    return {one.title.rpartition(": ")[2]: one.severity for one in messages._diagnostics(cast(Any, drive))}


def test_no_receiver_of_satellites_from_first_to_last_leads_nowhere() -> None:
    none = Report(1.0, "/diagnostics", "mavros: GPS", 2, "No satellites")
    assert severities(none) == {"No satellites": "info"}
    assert severities(Report(0.5, "/diagnostics", "mavros: GPS", 0, "3D fix"), none) == {"No satellites": "critical"}


def test_a_device_that_another_node_has_open_is_there() -> None:
    closed = Report(1.0, "/diagnostics", "joystick_raw: Joystick Driver Status", 2, "Joystick not open.")
    opened = Report(1.0, "/diagnostics", "joy_node: Joystick Driver Status", 0, "OK")
    assert severities(closed) == {"Joystick not open": "critical"}
    assert severities(closed, opened) == {"Joystick not open": "warning"}


def test_a_node_that_says_its_mission_failed_leads(tmp_path: Path) -> None:
    said = [(5.0 + n, ERROR, "/bridge", f"stale {word}") for n, word in enumerate(("data", "clock", "map"))]
    health = looked_at(
        Drive(outcome=ABORTED, said=[*said, (20.0, ERROR, "/left_mission", "[ERROR] Mission failed!")]), tmp_path
    )
    (failed,) = [one for one in every_finding(health.findings) if "Mission failed" in one.title]
    assert failed.severity == "critical"


Change = Callable[[Any, float], None]


def changed(kind: str, change: Change) -> Drive:
    """A healthy drive of which messages of one kind are changed."""

    class Changed(Drive):
        def messages(self) -> Iterator[tuple[str, str, float, Any]]:
            for topic, name, time_s, message in super().messages():
                if name == kind:
                    change(message, time_s)
                yield topic, name, time_s, message

    return Changed()


def sees_nothing(scan: Any, time_s: float) -> None:
    scan.ranges[:] = np.inf


def in_spikes(odometry: Any, time_s: float) -> None:
    """Each third sample holds what a coarse encoder counted in three."""
    third = round(time_s / 0.2) % 3 == 0
    odometry.twist.twist.linear.x *= 3.0 if third else 0.0
    odometry.twist.twist.angular.z *= 3.0 if third else 0.0


def no_number(command: Any, time_s: float) -> None:
    if time_s > 39.0:
        command.linear.x = float("nan")


def one_step(odometry: Any, time_s: float) -> None:
    """The robot stands from half of the way on, and is then elsewhere by less than a jump of what drives."""
    odometry.pose.pose.position.x += 0.24 if time_s > 30.0 else 0.0


def test_a_laser_that_never_saw_anything_is_noted(tmp_path: Path) -> None:
    (finding,) = looked_at(changed(SCAN, sees_nothing), tmp_path).findings
    assert (finding.title, finding.severity) == ("the laser saw nothing in any scan", "info")


@pytest.mark.parametrize(
    ("kind", "change", "titles"),
    [
        (ODOMETRY, in_spikes, []),
        (TWIST, no_number, ["commands to the drive are no numbers"]),
        (ODOMETRY, one_step, []),
    ],
)
def test_what_looks_like_a_fault_and_is_none(kind: str, change: Change, titles: list[str], tmp_path: Path) -> None:
    assert [one.title for one in looked_at(changed(kind, change), tmp_path).findings] == titles


def test_a_drive_that_never_is_faster_whatever_is_commanded_has_its_limit(tmp_path: Path) -> None:
    class Limited(Drive):
        """Reaches 0.3 m/s; commands rise from that to three times as much."""

        def messages(self) -> Iterator[tuple[str, str, float, Any]]:
            for topic, name, time_s, message in super().messages():
                if name == TWIST:
                    message.linear.x = 0.3 + 0.02 * time_s
                yield topic, name, time_s, message

        def _move(self, speed: float, turn: float, *, onset: bool, failing: bool) -> None:
            super()._move(0.3, turn, onset=onset, failing=failing)

        def _odometry(self, t: float, speed: float, turn: float) -> Any:
            return super()._odometry(t, 0.6 * speed, turn)

    (finding,) = looked_at(Limited(), tmp_path).findings
    assert (finding.title, finding.severity) == ("commands are beyond what the drive reaches", "info")
    assert "never was faster than 0.30 m/s" in finding.evidence


def test_no_greatest_speed_is_told_that_is_less_than_it_went(tmp_path: Path) -> None:
    def slowly(message: Any, _time_s: float) -> None:
        message.twist.twist.linear.x *= 0.2

    (said,) = [one for one in looked_at(changed(ODOMETRY, slowly), tmp_path).timeline if "drove " in one.text]
    assert "at its fastest" not in said.text


def test_the_greatest_speed_that_is_told_lasted(tmp_path: Path) -> None:
    told = looked_at(changed(ODOMETRY, in_spikes), tmp_path).timeline
    (said,) = [one for one in told if "at its fastest" in one.text]
    assert "0.5" in said.text.partition(" m, ")[2]


@pytest.mark.parametrize(
    ("climbs_mps", "other_mps", "told"), [(-15.0, 0.01, True), (-15.0, -5.0, False), (-15.0, 0.0, False)]
)
def test_a_height_that_runs_away_is_told_by_another_odometry(
    climbs_mps: float, other_mps: float, told: bool, tmp_path: Path
) -> None:
    class Sinking(Drive):
        def messages(self) -> Iterator[tuple[str, str, float, Any]]:
            for topic, name, time_s, message in super().messages():
                if name == ODOMETRY:
                    yield "/odometry/gps", name, time_s, _at_height(message, other_mps * time_s)
                    yield topic, name, time_s, _at_height(message, climbs_mps * time_s)
                else:
                    yield topic, name, time_s, message

    titles = [one.title for one in looked_at(Sinking(), tmp_path).findings]
    assert any(title.startswith("the height of /wheels/odom runs away") for title in titles) is told


def _at_height(odometry: Any, height_m: float) -> Any:
    place = dataclasses.replace(odometry.pose.pose.position, z=height_m)
    pose = dataclasses.replace(odometry.pose, pose=dataclasses.replace(odometry.pose.pose, position=place))
    return dataclasses.replace(odometry, pose=pose)


@pytest.mark.parametrize(("ahead_s", "told"), [(20881.0, True), (-20881.0, False), (0.3, False)])
def test_stamps_of_the_future_are_of_another_clock(ahead_s: float, told: bool, tmp_path: Path) -> None:
    class Ahead(Drive):
        def messages(self) -> Iterator[tuple[str, str, float, Any]]:
            for topic, name, time_s, message in super().messages():
                if name == ODOMETRY:
                    made = stamp(ROS2, START_NS + round((time_s + ahead_s) * SECOND_NS))
                    message.header = dataclasses.replace(message.header, stamp=made)
                yield topic, name, time_s, message

    titles = [one.title for one in looked_at(Ahead(), tmp_path).findings]
    assert any("20881.0 s (5:48:01) ahead of the recording" in title for title in titles) is told


@pytest.mark.parametrize(("places", "told"), [((0.0, 1.5), "two sources publish map -> odom in turn"), ((0.0,), "")])
def test_two_sources_of_one_transform_are_told(places: tuple[float, ...], told: str) -> None:
    x = np.array([places[n % len(places)] + 0.001 * n for n in range(60)])
    steps = np.abs(np.diff(x))
    assert (odometry._in_turn(x, np.zeros(60), steps) is not None) is bool(told)


@pytest.mark.parametrize(("apart_m", "until", "told"), [(4.0, 300, True), (4.0, 60, False), (0.1, 300, False)])
def test_two_sources_of_where_the_base_is_are_told_though_one_sends_seldom(
    apart_m: float, until: int, told: bool
) -> None:
    number = np.arange(300)
    places = np.stack([0.1 * number, 0.02 * number + apart_m * (number % 11 == 5) * (number < until), 0.0 * number], 1)
    assert bool(len(odometry._aside(places))) is told


@pytest.mark.parametrize(
    ("parent", "child", "edge"),
    [("/map", "/odom", "map -> odom"), ("odom", "base_link", "odom -> base_link"), ("base_link", "odom", ""),
     ("r2/odom", "r2/base_footprint", "r2/odom -> r2/base_footprint"), ("odom", "wheel", "")],
)  # fmt: skip
def test_the_transforms_that_say_where_a_robot_is(parent: str, child: str, edge: str) -> None:
    x, y = np.array([[1.0]]), np.array([[2.0]])
    assert list(odometry._edges(np.zeros(1), np.array([[parent]]), np.array([[child]]), x, y)) == (
        [edge] if edge else []
    )


def test_a_laser_that_pauses_again_and_again_while_the_odometry_goes_on_drops_out(tmp_path: Path) -> None:
    class Pausing(Drive):
        def messages(self) -> Iterator[tuple[str, str, float, Any]]:
            gone = (SCAN, ODOMETRY) if self.fault == "link" else (SCAN,)
            for topic, name, time_s, message in super().messages():
                if name not in gone or not any(start < time_s < start + 1.5 for start in (8.0, 17.0, 25.0)):
                    yield topic, name, time_s, message

    (finding,) = looked_at(Pausing(), tmp_path).findings
    assert (finding.kind, finding.title) == ("laser", "the laser drops out: /front/scan pauses")
    assert finding.evidence.startswith("3 pauses of up to 1.6 s, one scan every 0.2 s else")
    assert not [one for one in looked_at(Pausing("link"), tmp_path).findings if "drops out" in one.title]


class Repeating(Drive):
    """Its drivers send faster than their data are new: each message of odometry and laser goes out three times."""

    again: int = 3

    def messages(self) -> Iterator[tuple[str, str, float, Any]]:
        for topic, name, time_s, message in super().messages():
            yield topic, name, time_s, message
            for number in range(1, self.again if name in (ODOMETRY, SCAN) else 1):
                yield topic, name, time_s + 0.06 * number, self._repeated(name, message, time_s + 0.06 * number)

    def _repeated(self, name: str, message: Any, time_s: float) -> Any:
        stamped = dataclasses.replace(message.header, stamp=stamp(ROS2, START_NS + round(time_s * SECOND_NS)))
        if name == SCAN:
            return dataclasses.replace(message, header=stamped)
        still = dataclasses.replace(message.twist, twist=dataclasses.replace(message.twist.twist, **RESTING))
        return dataclasses.replace(message, header=stamped, twist=still)


RESTING = {
    "linear": ROS2.types["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0),
    "angular": ROS2.types["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0),
}


@pytest.mark.parametrize("again", [2, 3])
def test_what_a_driver_sends_again_is_no_standstill_and_no_stuck_laser(again: int, tmp_path: Path) -> None:
    assert looked_at(Repeating(again=again), tmp_path).findings == ()


@pytest.mark.parametrize(("fault", "kind"), [("loss", "commands"), ("laser stuck", "laser")])
def test_it_still_is_seen_where_messages_are_sent_again(fault: str, kind: str, tmp_path: Path) -> None:
    first = looked_at(Repeating(fault, ABORTED), tmp_path).findings[0]
    assert (first.kind, first.suspect) == (kind, "hardware")


class Hits(Drive):
    """A contact is told when the fault begins: the robot tips over, is pushed along, or stays where it is."""

    def messages(self) -> Iterator[tuple[str, str, float, Any]]:
        for topic, name, time_s, message in super().messages():
            if name == ODOMETRY and self.fault == "tips" and time_s > FAILS_AT_S:
                message.pose.pose.orientation = TIPPED
                message.pose.pose.position.z = 0.2
            yield topic, name, time_s, message
        yield "/collision_event", "std_msgs/msg/Empty", FAILS_AT_S, EMPTY

    def _driven(self, t: float, speed: float, turn: float) -> tuple[float, float]:
        return (0.0, 0.0) if self.fault in ("tips", "held") else super()._driven(t, speed, turn)

    def _move(self, speed: float, turn: float, *, onset: bool, failing: bool) -> None:
        super()._move(speed, turn, onset=onset, failing=failing)
        pushed = failing and self.fault == "pushed" and self.off_x < 1.0
        self.off_x += 0.2 * speed * 0.04 if pushed else 0.0


TIPPED = ROS2.types["geometry_msgs/msg/Quaternion"](0.7071, 0.0, 0.0, 0.7071)
EMPTY = ROS2.types["std_msgs/msg/Empty"]()


@pytest.mark.parametrize("outcome", [ABORTED, SUCCEEDED])
def test_a_robot_that_tips_over_is_told_first_and_what_follows_from_it(outcome: int, tmp_path: Path) -> None:
    health = looked_at(Hits("tips", outcome), tmp_path)
    first = health.findings[0]
    assert (first.kind, first.title, first.severity) == ("crash", "the robot tips over", "critical")
    assert first.onset_s == pytest.approx(FAILS_AT_S, abs=0.5)
    assert "tilted by up to 90 deg" in first.evidence
    assert "and so to the end, its height changes by 0.2 m, a contact is told at 16.0 s" in first.evidence
    assert [one.kind for one in first.consequences] == ["drive"]
    assert any(one.text == "1 contact told by /collision_event: 16.0 s" for one in health.timeline)


def test_a_robot_that_falls_off_an_edge_is_told(tmp_path: Path) -> None:
    def falls(message: Any, time_s: float) -> None:
        message.pose.pose.position.z = -0.5 if time_s > FAILS_AT_S else 0.0
        if 0.0 < time_s - FAILS_AT_S < 0.5:
            message.pose.pose.orientation = LEANING

    first = looked_at(changed(ODOMETRY, falls), tmp_path).findings[0]
    assert (first.title, first.severity) == ("the robot falls or is thrown up", "critical")
    assert first.onset_s == pytest.approx(FAILS_AT_S, abs=1.0)


LEANING = ROS2.types["geometry_msgs/msg/Quaternion"](0.26, 0.0, 0.0, 0.9656)


def test_odometry_does_not_drift_while_something_pushes_the_robot(tmp_path: Path) -> None:
    assert [one for one in looked_at(Hits("pushed"), tmp_path).findings if "drifts" in one.title] == []


@pytest.mark.parametrize(("outcome", "told"), [(ABORTED, True), (SUCCEEDED, False)])
def test_a_robot_that_a_contact_holds_is_told(outcome: int, told: bool, tmp_path: Path) -> None:
    titles = [one.title for one in looked_at(Hits("held", outcome), tmp_path).findings]
    assert ("the robot hits something and gets no further" in titles) is told


def test_what_nobody_drives_does_not_tip_over(tmp_path: Path) -> None:
    class InAHand(Hits):
        def messages(self) -> Iterator[tuple[str, str, float, Any]]:
            yield from (one for one in super().messages() if one[1] == ODOMETRY)

    assert [one for one in looked_at(InAHand("tips"), tmp_path).findings if one.kind == "crash"] == []


class Saturating(Drive):
    """Whose wheels reach half of what is commanded while it is to turn as well, to `sides` one after the other."""

    sides: tuple[float, ...] = (1.0, -1.0)

    def _turn(self, t: float) -> float:
        return self.sides[int(t / 3.0) % len(self.sides)]

    def messages(self) -> Iterator[tuple[str, str, float, Any]]:
        for topic, name, time_s, message in super().messages():
            if name == TWIST and time_s >= FAILS_AT_S:
                message.angular.z = self._turn(time_s)
            yield topic, name, time_s, message

    def _driven(self, t: float, speed: float, turn: float) -> tuple[float, float]:
        share = 1.0 if self._turn(t) == 0.0 else 0.5
        return share * speed, share * self._turn(t)


@pytest.mark.parametrize("sides", [(1.0, -1.0), (1.0,), (1.0, 0.0, -1.0)])
def test_wheels_at_their_limit_in_a_turn_are_not_weak_and_pull_to_no_side(
    sides: tuple[float, ...], tmp_path: Path
) -> None:
    assert looked_at(Saturating(sides=sides), tmp_path).findings == ()


def test_a_drive_that_never_was_faster_on_one_command_may_be_at_its_limit(tmp_path: Path) -> None:
    class Slow(Drive):
        def _move(self, speed: float, turn: float, *, onset: bool, failing: bool) -> None:
            super()._move(0.6 * speed, turn, onset=onset, failing=failing)

        def _odometry(self, t: float, speed: float, turn: float) -> Any:
            return super()._odometry(t, 0.6 * speed, turn)

    (finding,) = looked_at(Slow(), tmp_path).findings
    assert (finding.title, finding.severity) == ("commands are beyond what the drive reaches", "info")


def far_too_fast(message: Any, time_s: float) -> None:
    if 19.9 < time_s < 20.7:
        message.twist.twist.linear.x, message.twist.twist.angular.z = 37.0, -70.0


def test_speeds_that_no_position_gives_are_told(tmp_path: Path) -> None:
    (finding,) = looked_at(changed(ODOMETRY, far_too_fast), tmp_path).findings
    assert (finding.title, finding.severity) == ("odometry tells impossible speeds", "warning")
    assert finding.onset_s == pytest.approx(20.0, abs=0.2)
    assert finding.evidence.startswith("4 of 200 messages: up to 37.0 m/s, its positions give 0.5 m/s at most, up to")


def test_a_single_impossible_speed_is_noted(tmp_path: Path) -> None:
    def once(message: Any, time_s: float) -> None:
        if 19.9 < time_s < 20.1:
            far_too_fast(message, time_s)

    (finding,) = looked_at(changed(ODOMETRY, once), tmp_path).findings
    assert (finding.severity, finding.evidence[:8]) == ("info", "1 of 200")


def in_turn(odometry: Any, time_s: float) -> None:
    """Each second message is another's, which starts somewhere else."""
    odometry.pose.pose.position.y += 0.2 if round(time_s / 0.2) % 2 else 0.0


def test_odometry_of_two_publishers_is_told_and_not_added_up(tmp_path: Path) -> None:
    health = looked_at(changed(ODOMETRY, in_turn), tmp_path)
    (finding,) = health.findings
    assert (finding.title, finding.suspect) == ("two sources publish /wheels/odom in turn", "operation")
    assert "its odometry comes from two sources: how far it went is not known" in [one.text for one in health.timeline]


def test_the_largest_jump_is_named(tmp_path: Path) -> None:
    def twice(odometry: Any, time_s: float) -> None:
        odometry.pose.pose.position.y += 1.0 * (time_s > 15.0) + 6.0 * (time_s > 25.0)

    (finding,) = looked_at(changed(ODOMETRY, twice), tmp_path).findings
    assert finding.title == "odometry jumps by up to 6 m"
    assert finding.evidence.startswith("first 1.0")


@pytest.mark.parametrize(("until_s", "titles"), [(24.0, ["/front/scan comes up to 4.0 s late, in bursts"]), (21.0, [])])
def test_a_sensor_whose_messages_are_held_back_is_late(until_s: float, titles: list[str], tmp_path: Path) -> None:
    class HeldBack(Drive):
        def messages(self) -> Iterator[tuple[str, str, float, Any]]:
            for topic, name, time_s, message in super().messages():
                is_held = name == SCAN and 20.0 <= time_s < until_s
                yield topic, name, until_s + time_s / 1000 if is_held else time_s, message

    assert [one.title for one in looked_at(HeldBack(), tmp_path).findings] == titles


@pytest.mark.parametrize(("times", "titles"), [(40, ["commands come without a pause: a loop has no rate"]), (4, [])])
def test_commands_of_a_loop_without_a_rate_are_told(times: int, titles: list[str], tmp_path: Path) -> None:
    class Flooding(Drive):
        def messages(self) -> Iterator[tuple[str, str, float, Any]]:
            for topic, name, time_s, message in super().messages():
                for number in range(times * 5 if name == TWIST else 1):
                    yield topic, name, time_s + number / (times * 25), message

    found = looked_at(Flooding(), tmp_path).findings
    assert [(one.title, one.severity) for one in found] == [(title, "info") for title in titles]


class Shown(Drive):
    """A robot that tips over, which its transforms alone show: odometry is flat, and there is no IMU."""

    parent: str = "odom"

    def messages(self) -> Iterator[tuple[str, str, float, Any]]:
        yield from super().messages()
        for tick in range(400):
            t = tick / 10
            angle = np.radians(np.clip((t - FAILS_AT_S) * 60.0, 0.0, 80.0))
            turn = make(
                ROS2, "geometry_msgs/msg/Quaternion", float(np.sin(angle / 2)), 0.0, 0.0, float(np.cos(angle / 2))
            )
            move = make(
                ROS2, "geometry_msgs/msg/Transform", make(ROS2, "geometry_msgs/msg/Vector3", 0.0, 0.0, 0.0), turn
            )
            header = make(ROS2, "std_msgs/msg/Header", stamp(ROS2, START_NS + round(t * SECOND_NS)), self.parent)
            one = make(ROS2, "geometry_msgs/msg/TransformStamped", header, "robot1/base_link", move)
            yield "/tf", "tf2_msgs/msg/TFMessage", t, make(ROS2, "tf2_msgs/msg/TFMessage", [one])


@pytest.mark.parametrize(("parent", "titles"), [("odom", ["the robot tips over"]), ("camera", [])])
def test_a_fall_that_transforms_alone_show_is_told(parent: str, titles: list[str], tmp_path: Path) -> None:
    findings = looked_at(Shown(parent=parent), tmp_path).findings
    assert [one.title for one in findings] == titles
    assert all(one.onset_s == pytest.approx(FAILS_AT_S + 0.4, abs=0.5) for one in findings)


class Silenced(Drive):
    """Of which topics end, or pause, in a time: (topic's type, from, to)."""

    silent: tuple[tuple[str, float, float], ...] = ()

    def messages(self) -> Iterator[tuple[str, str, float, Any]]:
        for topic, name, time_s, message in super().messages():
            if not any(name == kind and start <= time_s < end for kind, start, end in self.silent):
                yield topic, name, time_s, message


@pytest.mark.parametrize(("last_s", "told"), [(39.0, []), (30.0, ["it drives on without commands"])])
def test_a_robot_that_drives_on_after_its_last_command_is_told(last_s: float, told: list[str], tmp_path: Path) -> None:
    findings = looked_at(Silenced(silent=((TWIST, last_s, 99.0),)), tmp_path).findings
    assert [one.title for one in findings] == told
    assert all("it goes on for 10.0 s and 5.0 m, to the end of the recording" in one.evidence for one in findings)


def test_a_robot_that_is_commanded_once_and_waits_drives_on_in_its_rhythm(tmp_path: Path) -> None:
    """Each pause of its commands is as long as the one in which the recording ends."""

    class Seldom(Drive):
        def messages(self) -> Iterator[tuple[str, str, float, Any]]:
            for topic, name, time_s, message in super().messages():
                if name != TWIST or time_s % 4.0 < 0.05:
                    yield topic, name, time_s, message

    assert [one.title for one in looked_at(Seldom(), tmp_path).findings] == []


def test_a_robot_that_stops_after_its_last_command_is_fine(tmp_path: Path) -> None:
    class Stops(Silenced):
        def _driven(self, t: float, speed: float, turn: float) -> tuple[float, float]:
            return (speed, turn) if t < FAILS_AT_S + 0.6 else (0.0, 0.0)

    assert looked_at(Stops(silent=((TWIST, FAILS_AT_S, 99.0),)), tmp_path).findings == ()


class Beside(Silenced):
    """With a topic that a node of its own derives."""

    def messages(self) -> Iterator[tuple[str, str, float, Any]]:
        for topic, name, time_s, message in super().messages():
            yield topic, name, time_s, message
            if name == SCAN:
                yield "/front/scan_filtered", name, time_s + 0.01, message


SENT = (ODOMETRY, SCAN, BATTERY)


def test_a_robot_that_is_heard_no_more_while_commands_go_on_is_one_event(tmp_path: Path) -> None:
    findings = looked_at(Beside(silent=tuple((kind, 30.0, 99.0) for kind in SENT)), tmp_path).findings
    (finding,) = findings
    assert finding.title == "the link to the robot is lost: all that it sends ends"
    assert finding.onset_s == pytest.approx(29.8, abs=1.0)
    assert "/front/scan, /front/scan_filtered, /power, /wheels/odom end at" in finding.evidence
    assert finding.consequences == ()


def test_a_time_in_which_nothing_is_recorded_is_told(tmp_path: Path) -> None:
    (finding,) = looked_at(Silenced(silent=tuple((kind, 20.0, 26.0) for kind in (*SENT, TWIST))), tmp_path).findings
    assert finding.title == "nothing at all is recorded for 6.2 s"
    assert finding.onset_s == pytest.approx(19.8, abs=0.1)


def test_a_clock_that_was_set_forward_is_no_silence(tmp_path: Path) -> None:
    class Set(Drive):
        def messages(self) -> Iterator[tuple[str, str, float, Any]]:
            for topic, name, time_s, message in super().messages():
                yield topic, name, time_s + (100.0 if time_s > 20.0 else 0.0), message

    assert [one.title for one in looked_at(Set(), tmp_path).findings if one.kind == "radio"] == []


def test_an_outage_names_all_that_pauses(tmp_path: Path) -> None:
    silent = ((ODOMETRY, 20.0, 27.0), (SCAN, 20.5, 27.0), (BATTERY, 20.0, 27.0))
    findings = looked_at(Beside(silent=silent), tmp_path).findings
    (outage,) = [one for one in findings if one.title.startswith("outage")]
    assert outage.evidence.startswith("/front/scan, /front/scan_filtered, /wheels/odom pause for 7 to 7 s")


def test_what_one_node_sends_is_no_outage_of_the_link(tmp_path: Path) -> None:
    silent = ((SCAN, 20.0, 27.0),)
    titles = [one.title for one in looked_at(Beside(silent=silent), tmp_path).findings]
    assert not [title for title in titles if title.startswith("outage")]


@pytest.mark.parametrize(
    ("topic", "kind"),
    [
        ("/goal_pose", "geometry_msgs/msg/PoseStamped"),
        ("/plan", "nav_msgs/msg/Path"),
        ("/rviz/marker/feedback", "visualization_msgs/msg/InteractiveMarkerFeedback"),
        ("/beeps", "std_msgs/msg/Empty"),
    ],
)
def test_that_a_topic_of_events_ends_is_no_finding(topic: str, kind: str, tmp_path: Path) -> None:
    class WithEvents(Drive):
        def messages(self) -> Iterator[tuple[str, str, float, Any]]:
            yield from super().messages()
            message = random_message(ROS2, kind, np.random.default_rng(1))
            yield from ((topic, kind, 0.5 * number, message) for number in range(20))

    health = looked_at(WithEvents(), tmp_path)
    assert [one.title for one in health.findings] == []
    assert not [one for one in health.timeline if one.kind == "topic" and topic in one.text]


def test_topics_that_end_together_are_one_finding_and_lead_to_none(tmp_path: Path) -> None:
    class Ending(Drive):
        def messages(self) -> Iterator[tuple[str, str, float, Any]]:
            yield from super().messages()
            for number in range(60):
                for topic, until_s in (("/a", 20.0), ("/b", 20.4), ("/c", 27.0)):
                    if number / 2 < until_s:
                        yield topic, "std_msgs/msg/Float64", number / 2, FLOAT

    findings = looked_at(Ending(), tmp_path).findings
    assert [(one.title, one.below) for one in findings] == [("/a, /b end early", ()), ("/c ends early", ())]


FLOAT = ROS2.types["std_msgs/msg/Float64"](1.0)


def test_a_position_that_moves_has_moved_though_no_speed_is_told(tmp_path: Path) -> None:
    def without_speed(message: Any, time_s: float) -> None:
        message.twist.twist.linear.x = message.twist.twist.angular.z = 0.0

    texts = [one.text for one in looked_at(changed(ODOMETRY, without_speed), tmp_path).timeline]
    assert "the robot moves for the first time" in texts
    (told,) = [text for text in texts if text.startswith("its positions lie within")]
    assert told.endswith("its odometry tells no speed")
    assert "the robot never moved" not in texts


@pytest.mark.parametrize(
    ("rest", "is_in_g"), [((0.0, 0.05, 1.03), True), ((0.0, 0.5, 9.8), False), ((0.0, 0.0, 0.0), False)]
)
def test_an_acceleration_in_g_is_told(rest: tuple[float, float, float], *, is_in_g: bool) -> None:
    """Of an IMU on a robot that shakes: in g, in m/s^2, and in m/s^2 with gravity taken off."""
    rng, t = np.random.default_rng(0), np.arange(0.0, 20.0, 0.1)
    columns = dict.fromkeys(MESSAGES[IMU].reads, 0 * t)
    for axis, level in zip("xyz", rest, strict=True):
        columns[f"linear_acceleration.{axis}"] = level + rng.normal(0.0, 0.3, len(t))
    drive = SimpleNamespace(of=lambda _type: [("/imu", Table(t, columns))], duration_s=20.0, odometry=None)
    assert [one.title for one in felt.find(cast(Any, drive))] == (
        ["the IMU tells its acceleration in g, not in m/s^2"] if is_in_g else []
    )


@pytest.mark.parametrize("is_of_parent", [True, False])
def test_a_twist_along_the_axes_of_the_map_is_told_and_turned(is_of_parent: bool) -> None:
    t = np.arange(0.0, 40.0, 0.1)
    yaw = 0.1 * t
    east, north = np.sin(yaw) * 5.0, (1 - np.cos(yaw)) * 5.0
    ahead, aside = (0.5 * np.cos(yaw), 0.5 * np.sin(yaw)) if is_of_parent else (np.full_like(t, 0.5), 0 * t)
    table = Table(t, {
        "pose.pose.position.x": east, "pose.pose.position.y": north, "pose.pose.orientation.x": 0 * t,
        "pose.pose.orientation.y": 0 * t, "pose.pose.orientation.z": np.sin(yaw / 2),
        "pose.pose.orientation.w": np.cos(yaw / 2), "twist.twist.linear.x": ahead, "twist.twist.linear.y": aside,
        "twist.twist.angular.z": np.full_like(t, 0.1),
    })  # fmt: skip
    told = odometry_of("/odom", table)
    assert told is not None
    assert told.is_of_parent is is_of_parent
    np.testing.assert_allclose(told.speed, 0.5, atol=1e-6)
    np.testing.assert_allclose(told.sideways, 0.0, atol=1e-6)


@pytest.mark.parametrize(
    ("nearest_m", "since_s", "told"),
    [
        (0.12, FAILS_AT_S, True),
        (0.12, 0.0, False),  # what the laser sees of its own robot
        (0.4, FAILS_AT_S, False),
    ],
)
def test_a_robot_that_drives_on_against_what_stands_before_it(
    tmp_path: Path, nearest_m: float, since_s: float, told: bool
) -> None:
    def against(scan: Any, time_s: float) -> None:
        if time_s >= since_s:
            scan.ranges[RAYS // 2 - 8 : RAYS // 2 + 8] = nearest_m

    titles = [one.title for one in every_finding(looked_at(changed(SCAN, against), tmp_path).findings)]
    assert ("it is told to drive on against what stands before it" in titles) is told


@pytest.mark.parametrize(
    ("topic", "is_place"),
    [
        ("/odom", True), ("/bluerov2/pose_gt", True), ("/preferred/odom", True), ("/mpc/reference", False),
        ("/bluerov2/ekf/disturbance", False), ("/set_point/odom", False), ("/mpc/error", False),
    ],
)  # fmt: skip
def test_what_is_asked_for_and_forces_are_no_odometry(topic: str, is_place: bool) -> None:
    assert (type_of(Channel(topic, "nav_msgs/msg/Odometry", 1)) == "nav_msgs/Odometry") is is_place
