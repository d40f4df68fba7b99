"""The model of a drive: decoded once, thinned for health alone, and its goals however a robot tells of them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from care_core.ecosystems.registry import run_model
from care_core.ecosystems.ros import ECOSYSTEM
from care_core.ecosystems.ros.checks import CHECKS
from care_core.ecosystems.ros.drive import Drive
from care_core.ecosystems.ros.goals import Status, actionlib_goals
from care_core.ecosystems.ros.messages import ACTION_GOAL, ACTION_RESULT, MESSAGES, SCAN
from care_core.ecosystems.ros.node_messages import Level, level_of, level_word
from care_core.logs.base import Log, Table, Wanted
from care_core.logs.opening import open_log
from care_core.logs.ros_log import RosLog
from care_core.records import replace
from tests.ros_drives import ABORTED, SUCCEEDED
from tests.ros_drives import Drive as Driven
from tests.ros_samples import ROS2, START_NS, McapFile, cdr
from tests.whole import one_in

TOPIC = "/front/scan"
FAULTS = ("laser dead", "laser stuck", "laser noise", "jump", "drift", "weak", "pulls", "stall", "loss", "battery",
          "blocked")  # fmt: skip


def drive_in(log: Log) -> Drive:
    model = run_model(log)
    assert isinstance(model, Drive)
    return model


def drive_of(path: Path) -> Drive:
    return drive_in(open_log(path))


@pytest.fixture
def reads(monkeypatch: pytest.MonkeyPatch) -> list[Wanted]:
    """What is asked of recordings, pass by pass."""
    passes: list[Wanted] = []
    read = RosLog.read

    def counted(log: RosLog, wanted: Wanted, at_most: Mapping[str, int] | None = None) -> Mapping[str, Table]:
        passes.append(wanted)
        return read(log, wanted, at_most)

    monkeypatch.setattr(RosLog, "read", counted)
    return passes


def test_health_and_measures_decode_a_recording_once(reads: list[Wanted], tmp_path: Path) -> None:
    drive = drive_of(Driven("stall", ABORTED).write(tmp_path / "drive.mcap"))
    plan = {TOPIC: MESSAGES[SCAN].reads, "/navigate_to_pose/_action/feedback": ("feedback.current_pose.pose",)}
    drive.expect(plan)
    ECOSYSTEM.examine(drive)
    assert len(drive.tables(plan)[TOPIC]) == 200
    assert drive.odometry_on("/wheels/odom") is not None, "its frame was not read for health"
    assert [TOPIC in wanted for wanted in reads] == [True, False]


def test_measures_alone_decode_nothing_for_health(reads: list[Wanted], tmp_path: Path) -> None:
    drive = drive_of(Driven().write(tmp_path / "drive.mcap"))
    drive.tables({TOPIC: ("range_max",)})
    assert reads == [{TOPIC: ("range_max",)}]


def test_health_sees_the_same_samples_whoever_else_reads(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setitem(MESSAGES, SCAN, replace(MESSAGES[SCAN], at_most=50))
    path = Driven().write(tmp_path / "drive.mcap")
    alone, shared = drive_of(path), drive_of(path)
    shared.expect({TOPIC: MESSAGES[SCAN].reads})
    for drive in (alone, shared):
        drive.look_at([SCAN])
    samples = [dict(drive.of(SCAN))[TOPIC] for drive in (alone, shared)]
    assert samples[0].t.tolist() == samples[1].t.tolist() == alone.times[TOPIC][::4].tolist()
    assert len(shared.tables({TOPIC: MESSAGES[SCAN].reads})[TOPIC]) == 200


@pytest.mark.parametrize("fault", one_in(2, FAULTS))
def test_a_check_reads_what_it_says_that_it_reads(fault: str, tmp_path: Path) -> None:
    log = open_log(Driven(fault, ABORTED).write(tmp_path / "drive.mcap"))
    whole = drive_in(log)
    ECOSYSTEM.examine(whole)
    for check in CHECKS:
        alone = drive_in(log)
        alone.look_at(check.reads)
        assert list(check.find(alone)) == list(check.find(whole)), check.name


def test_every_limit_of_a_check_has_a_name_and_a_source() -> None:
    for check in CHECKS:
        assert check.limits, check.name
        assert all(limit.name and limit.source for limit in check.limits)


def table(t: Sequence[float], type: str, rows: Sequence[Sequence[Any]]) -> Table:
    columns = {}
    for number, name in enumerate(MESSAGES[type].reads):
        column = np.empty(len(rows), np.float64 if rows and isinstance(rows[0][number], float) else object)
        column[:] = [row[number] for row in rows]
        columns[name] = column
    return Table(np.array(t, np.float64), columns)


def sent(*goals: tuple[float, str]) -> Table:
    rows = [(name, "map", time_s, 0.0, 0.0, 0.0, 0.0, 1.0) for time_s, name in goals]
    return table([time_s for time_s, _ in goals], ACTION_GOAL, rows)


def answered(*results: tuple[float, str, int]) -> Table:
    rows = [(name, float(status), "why") for _, name, status in results]
    return table([time_s for time_s, *_ in results], ACTION_RESULT, rows)


@pytest.mark.parametrize(
    ("goals", "results", "ends"),
    [
        ([(1, "a"), (5, "b")], [(4, "a", 3), (9, "b", 4)], [(4, "reached"), (9, "aborted")]),
        ([(1, "a"), (1.5, "a")], [(4, "a", 3)], [(4, "reached")]),
        ([(1, ""), (5, "")], [(4, "", 3), (9, "", 5)], [(4, "reached"), (9, "rejected")]),
        ([(1, "a"), (5, "b")], [(5.2, "a", 2), (9, "b", 3)], [(5, "replaced"), (9, "reached")]),
        ([(1, "a"), (5, "b")], [(9, "b", 8)], [(5, "replaced"), (9, "cancelled")]),
        ([(1, "a")], [], [(20, "")]),
        ([(1, "a")], [(4, "a", math.nan)], [(20, "")]),
    ],
    ids=["answered", "sent twice", "without ids", "answered late", "never answered", "open", "no status"],
)
def test_how_goals_of_actionlib_end(goals: Any, results: Any, ends: list[tuple[float, str]]) -> None:
    found = actionlib_goals("/move_base", sent(*goals), answered(*results), 20.0)
    assert [(goal.end_s, goal.outcome) for goal in found] == ends
    assert [goal.failed for goal in found] == [end in ("aborted", "rejected", "cancelled") for _, end in ends]
    assert found[0].reached(60.0) is (found[0].status == Status.SUCCEEDED)


def test_a_goal_of_nav2_drives_though_its_place_is_not_recorded(tmp_path: Path) -> None:
    drive = drive_of(Driven(outcome=SUCCEEDED).write(tmp_path / "drive.mcap"))
    ECOSYSTEM.examine(drive)
    (goal,) = drive.goals
    assert math.isnan(goal.x)
    assert goal.sent_s == pytest.approx(0.5)
    assert goal.drives
    assert goal.outcome == "reached"


def test_levels_of_every_ros_are_one_scale() -> None:
    assert [level_of(code) for code in (10, 20, 30, 40, 50)] == list(Level)
    assert [level_of(code) for code in Level] == list(Level)
    assert [level_word(level_of(code, "foxglove.Log")) for code in range(6)] == [
        "info", "debug", "info", "WARN", "ERROR", "FATAL",
    ]  # fmt: skip
    assert level_word(7) == "7"


@pytest.mark.parametrize(
    ("nodes", "topics", "told"),
    [
        ({"/front/scan": "/a", "/wheels/odom": "/a"}, ("/front/scan", "/wheels/odom"), False),
        ({"/front/scan": "/a", "/wheels/odom": "/b"}, ("/front/scan", "/wheels/odom"), True),
        ({}, ("/front/scan", "/wheels/odom"), True),
        ({}, ("/front/scan",), False),
    ],
)
def test_topics_come_from_several_nodes_by_name_or_by_kind(
    nodes: Mapping[str, str], topics: Sequence[str], told: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = open_log(Driven().write(tmp_path / "drive.mcap"))
    assert isinstance(log, RosLog)
    monkeypatch.setattr(log, "publishers", lambda: {topic: frozenset({node}) for topic, node in nodes.items()})
    assert Drive(log).have_several_sources(topics) is told


@pytest.mark.parametrize(
    ("topic", "times", "told"),
    [
        ("/collision_event", [5.0, 5.2, 9.0], [5.0, 9.0]),
        ("/bumper", [0.1, 7.0], [7.0]),
        ("/collision_monitor_state", [5.0], []),
        ("/bumper", [0.1 * number for number in range(100)], []),
    ],
)
def test_contacts_are_told_by_topics_that_speak_only_then(
    topic: str, times: Sequence[float], told: Sequence[float], tmp_path: Path
) -> None:
    empty = ROS2.types["std_msgs/msg/Empty"]()
    with McapFile(tmp_path / "contacts.mcap") as log:
        for time_s in (0.0, *times):
            log.add("/begin" if time_s == 0 else topic, empty.__msgtype__, START_NS + round(time_s * 1e9), cdr(empty))
    model = run_model(open_log(tmp_path / "contacts.mcap"))
    assert isinstance(model, Drive)
    assert model.contacts_s.tolist() == pytest.approx(list(told))
