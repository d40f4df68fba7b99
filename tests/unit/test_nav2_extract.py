"""Nav2 missions on tables made up here: goals by their states, where they lie, recoveries, what nodes said."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_core.ecosystems.measures import MISSION_KINDS, Mission, find_extractor
from care_core.ecosystems.ros.drive import Drive
from care_core.ecosystems.ros.goals import Goal, Status
from care_core.ecosystems.ros.measures.nav2 import FEEDBACK_FIELDS, goals
from care_core.ecosystems.ros.messages import FRAME, MESSAGES, TREE, TWIST_STAMPED
from care_core.ecosystems.ros.messages import STATUS as STATES
from care_core.ecosystems.ros.posed_goals import PLAN_FIELDS, POSE_FIELDS
from care_core.logs.base import Table
from care_core.logs.formats import ROS2_DB3
from care_core.run import Unavailable, Value
from tests.tables import no_model, read

KIND = MISSION_KINDS["nav2_goals"]
DURATION_S = 100.0
POSE = ("pose.pose.position.x", "pose.pose.position.y", *(f"pose.pose.orientation.{axis}" for axis in "xyzw"))
ODOMETRY_FIELDS = (FRAME, *POSE, "twist.twist.linear.x", "twist.twist.linear.y", "twist.twist.angular.z")
ROSOUT_FIELDS = ("level", "name", "msg")
SPEC: dict[str, Any] = {"kind": "nav2_goals", "goals": [[2.0, 0.0], [4.0, 0.0]], "goal_timeout_s": 60}
STATUS = "/navigate_to_pose/_action/status"
ACCEPTED, EXECUTING, SUCCEEDED, CANCELED, ABORTED = 1, 2, 4, 5, 6


def table(t: Sequence[float], fields: Sequence[str], rows: Sequence[Sequence[Any]]) -> Table:
    columns = {}
    for place, name in enumerate(fields):
        values = [row[place] for row in rows]
        column = np.empty(len(rows), np.float64 if values and isinstance(values[0], float) else object)
        for number, value in enumerate(values):
            column[number] = value
        columns[name] = column
    return Table(np.array(t, np.float64), columns)


def uuid(number: int) -> Any:
    return np.full(16, number, np.uint8)


def states(*told: tuple[float, Sequence[tuple[int, int]]]) -> Table:
    """What the server told: (time, [(goal, code)]), all goals that it remembers each time."""
    rows = [([uuid(goal) for goal, _ in goals], [code for _, code in goals]) for _, goals in told]
    return table([t for t, _ in told], MESSAGES[STATES].reads, rows)


def plan(t: float, *points: tuple[float, float], frame: str = "odom") -> tuple[float, Sequence[Any]]:
    x, y = [p[0] for p in points], [p[1] for p in points]
    return t, (frame, x, y, [0.0] * len(x), [1.0] * len(x))


def plans(*made: tuple[float, Sequence[Any]]) -> Table:
    return table([t for t, _ in made], PLAN_FIELDS, [row for _, row in made])


def drive(**changed: Table | None) -> dict[str, Table]:
    """Goal 1 accepted at 10 s, there at 20 s; goal 2 accepted at 21 s, there at 31 s; an older goal is remembered."""
    t = np.arange(0.0, DURATION_S, 0.1)
    x = np.interp(t, [0, 10, 20, 21, 31], [0, 0, 2, 2, 4])
    rows = [("odom", one, 0.0, 0.0, 0.0, 0.0, 1.0, v, 0.0, 0.0) for one, v in zip(x, np.gradient(x, t), strict=True)]
    tables: dict[str, Table | None] = {
        STATUS: states(
            (0.5, [(9, SUCCEEDED)]),
            (10, [(9, SUCCEEDED), (1, ACCEPTED)]),
            (10.1, [(1, EXECUTING)]),
            (20, [(1, SUCCEEDED)]),
            (21, [(1, SUCCEEDED), (2, EXECUTING)]),
            (31, [(1, SUCCEEDED), (2, SUCCEEDED)]),
        ),
        "/plan": plans(plan(10.5, (0.0, 0.0), (2.0, 0.0)), plan(15.0, (1.0, 0.0), (2.0, 0.0)),
                       plan(21.5, (2.0, 0.0), (4.0, 0.0))),
        "/odom": table(t.tolist(), ODOMETRY_FIELDS, rows),
        "/cmd_vel": table(t.tolist(), MESSAGES[TWIST_STAMPED].reads, [(0.2, 0.0, 0.0)] * len(t)),
    }  # fmt: skip
    tables |= {"/" + name.replace("__", "/"): one for name, one in changed.items()}
    return {name: one for name, one in tables.items() if one is not None}


def mission(tables: dict[str, Table], spec: dict[str, Any] = SPEC) -> Mission:
    (one,) = KIND.missions(*read(tables, DURATION_S, ROS2_DB3), spec)
    return one


def sent(tables: dict[str, Table]) -> tuple[Goal, ...]:
    model, _ = read(tables, DURATION_S, ROS2_DB3)
    assert isinstance(model, Drive)
    return goals(model, SPEC)


def value(name: str, one: Mission, **args: Any) -> Value:
    return find_extractor(name).compute(one, args)


def test_a_good_drive() -> None:
    one = mission(drive())
    assert (one.start_s, one.end_s, one.ended) == (10.0, 31.0, True)
    assert KIND.mismatch(one) == ""
    assert KIND.evidence(one) == ()
    expected = {
        "goals_sent": 2, "goals_reached": 2, "goals_success": 1, "goals_time": 21, "path_length": 4, "distance_left": 0,
        "commanded_speed": 0.2, "plans": 3, "plan_length": 4, "detour": 0, "drive_speed": 0.2,
    }  # fmt: skip
    assert {name: value(name, one) for name in expected} == pytest.approx(expected, rel=0.02, abs=0.02)


def test_how_goals_end() -> None:
    told = states(
        (5, [(1, EXECUTING)]),
        (9, [(1, ABORTED)]),
        (10, [(2, EXECUTING)]),
        (14, [(2, CANCELED)]),
        (20, [(3, EXECUTING)]),
        (25, [(3, EXECUTING), (4, ACCEPTED)]),
        (25.1, [(3, ABORTED), (4, EXECUTING)]),
    )
    found = sent({STATUS: told})
    ends = [(Status.ABORTED, 9.0), (Status.PREEMPTED, 14.0), (Status.PREEMPTED, 25.0), (None, 100.0)]
    assert [(goal.status, goal.end_s) for goal in found] == ends
    one = mission({STATUS: told}, {"kind": "nav2_goals"})
    assert [e.kind for e in KIND.evidence(one)] == ["abort", "cancel", "cancel", "timeout"]
    assert value("goals_ended", one, status="aborted") == 1.0
    assert value("goals_success", one) == 0.0


def test_a_goal_of_which_only_the_end_was_heard_is_one() -> None:
    told = states((5, [(9, SUCCEEDED)]), (10, [(9, SUCCEEDED), (1, SUCCEEDED)]), (20, [(1, SUCCEEDED), (2, ABORTED)]))
    found = [(goal.sent_s, goal.end_s, goal.status) for goal in sent({STATUS: told})]
    assert found == [(5.0, 10.0, Status.SUCCEEDED), (10.0, 20.0, Status.ABORTED)]


def test_goals_between_which_states_were_lost_are_not_judged_as_one() -> None:
    told = states((5, [(1, EXECUTING)]), (40, [(1, SUCCEEDED), (2, SUCCEEDED)]))
    assert isinstance(value("goals_success", mission({STATUS: told}, {"kind": "nav2_goals"})), Unavailable)


def test_a_goal_of_rviz_lies_where_it_was_clicked() -> None:
    pose = table([20.7], POSE_FIELDS, [("map", 7.0, 1.0, 0.0, 0.0, math.sin(0.5), math.cos(0.5))])
    found = sent(drive(goal_pose=pose))
    assert [(goal.x, goal.frame) for goal in found] == [(2.0, "odom"), (7.0, "map")]
    assert found[1].yaw == pytest.approx(1.0)
    left = value("distance_left", mission(drive(goal_pose=pose)))
    assert isinstance(left, Unavailable)
    assert "frame map, odom" in left.reason
    assert value("path_length", mission(drive(goal_pose=pose))) == pytest.approx(4.0, abs=0.01)


def test_without_a_plan_nobody_knows_where_the_goal_lies() -> None:
    one = mission(drive(plan=None))
    assert KIND.mismatch(one) == "the log does not say where goal 1 lies"
    left, made = value("distance_left", one), value("plan_length", one)
    assert isinstance(left, Unavailable)
    assert "ros2 bag record" in left.hint
    assert isinstance(made, Unavailable)
    assert value("goals_success", one) == 1.0


def test_goals_on_the_map_are_measured_by_where_the_navigator_says_the_robot_is() -> None:
    """The map lies 10 m beside the odometry and is turned by a quarter."""
    quarter = math.sqrt(0.5)
    on_map = plans(plan(10.5, (10.0, 0.0), (10.0, 2.0), frame="map"), plan(21.5, (10.0, 2.0), (10.0, 4.0), frame="map"))
    told = [10.2, 15.0, 20.0, 25.0, 31.0]
    way = np.interp(told, [10, 20, 21, 31], [0, 2, 2, 4])
    feedback = table(told, FEEDBACK_FIELDS, [("map", 10.0, one, 0.0, 0.0, quarter, quarter) for one in way.tolist()])
    without = mission(drive(plan=on_map))
    assert isinstance(value("distance_left", without), Unavailable)
    one = mission({**drive(plan=on_map), "/navigate_to_pose/_action/feedback": feedback})
    assert value("distance_left", one) == pytest.approx(0.0, abs=0.05)
    assert value("detour", one) == pytest.approx(0.0, abs=0.05)
    assert value("goals_asked", one, what="path_length") == pytest.approx(4.0, abs=0.1)
    assert value("path_length", one) == pytest.approx(4.0, abs=0.05)
    assert value("plan_length", one, per="metre") == pytest.approx(1.0, abs=0.03)


def test_recoveries_and_failures_of_the_behavior_tree() -> None:
    tree = table(
        [12.0, 13.0, 14.0],
        MESSAGES[TREE].reads,
        [
            (["ComputePathToPose", "FollowPath"], ["RUNNING", "RUNNING"], ["SUCCESS", "FAILURE"]),
            (
                ["RecoveryFallback", "ClearLocalCostmap-Context", "Spin"],
                ["IDLE"] * 3,
                ["RUNNING", "SUCCESS", "RUNNING"],
            ),
            (["Spin", "BackUp"], ["RUNNING", "IDLE"], ["SUCCESS", "RUNNING"]),
        ],
    )
    one = mission(drive(behavior_tree_log=tree))
    assert value("recoveries", one) == 3.0
    assert value("recoveries", one, behavior="spin") == 1.0
    assert value("tree_count", one, node="FollowPath") == 1.0
    assert value("tree_count", one, node="ComputePathToPose") == 0.0
    assert [e.text for e in KIND.evidence(one)] == [
        "recovery ClearLocalCostmap-Context", "recovery Spin", "recovery BackUp",
    ]  # fmt: skip
    unknown = value("recoveries", mission(drive()))
    assert isinstance(unknown, Unavailable)
    assert unknown.hint.endswith("ros2 bag record /behavior_tree_log")
    assert value("recoveries", mission(drive()), absent=0) == 0.0


def test_what_nodes_of_ros_2_said() -> None:
    said = table(
        [12.0, 13.0, 14.0],
        ROSOUT_FIELDS,
        [
            (20.0, "controller_server", "Passing new path to controller."),
            (40.0, "controller_server", "Failed to make progress"),
            (30.0, "planner_server", "GridBased: failed to create plan with tolerance 0.50."),
        ],
    )
    one = mission(drive(rosout=said))
    assert value("rosout_count", one, node="controller_server") == 2.0
    assert value("rosout_count", one, node="controller_server", level=8) == 1.0
    assert value("rosout_count", one, level=4) == 2.0
    assert [(e.kind, e.text) for e in KIND.evidence(one)] == [
        ("planner", "controller_server: Failed to make progress"),
        ("planner", "planner_server: GridBased: failed to create plan with tolerance 0.50."),
    ]


def test_a_loop_that_kept_its_rate_by_its_own_clock_did_not_miss_it() -> None:
    missed = "Control loop missed its desired rate of 10.0000 Hz. Current loop rate is {} Hz."
    rows = [(30.0, "controller_server", missed.format(rate)) for rate in ("10.0000", "9.8765", "6.6667")]
    one = mission(drive(rosout=table([12.0, 13.0, 14.0], ROSOUT_FIELDS, rows)))
    assert [(e.time_s, e.kind) for e in KIND.evidence(one)] == [(14.0, "timing")]


def test_a_log_without_goals_holds_no_mission() -> None:
    assert KIND.missions(*read({}, DURATION_S, ROS2_DB3), SPEC) == ()
    assert KIND.missions(*read({STATUS: states()}, DURATION_S, ROS2_DB3), SPEC) == ()
    over = states((0.0, [(1, SUCCEEDED)]), (5.0, [(1, SUCCEEDED)]))
    assert KIND.missions(*read({STATUS: over}, DURATION_S, ROS2_DB3), SPEC) == ()


@given(
    st.lists(
        st.tuples(st.floats(0, 99), st.lists(st.tuples(st.integers(0, 5), st.integers(0, 7)), max_size=4)), max_size=12
    )
)
def test_any_states_make_goals_in_order(told: list[tuple[float, list[tuple[int, int]]]]) -> None:
    tables = {STATUS: states(*sorted(told, key=lambda one: one[0]))}
    found = sent(tables)
    assert [goal.sent_s for goal in found] == sorted(goal.sent_s for goal in found)
    assert all(goal.sent_s <= goal.end_s <= DURATION_S for goal in found)
    for one in KIND.missions(*read(tables, DURATION_S, ROS2_DB3), SPEC):
        assert one.start_s <= one.end_s
        KIND.evidence(one)
        KIND.mismatch(one)


def test_the_kind_reads_the_hidden_topic() -> None:
    assert STATUS in KIND.needs(SPEC)
    assert "/move_base/goal" not in KIND.needs(SPEC)


@pytest.mark.parametrize(
    ("settings", "radius"),
    [({"/l.radius": 0.22, "/g.radius": 0.3}, 0.3), ({"/g.radius": 0.22}, 0.22), ({"/l.radius": "x"}, None), ({}, None)],
)
def test_what_parameters_say_of_a_robot_is_the_largest_of_them(
    settings: dict[str, float | str], radius: float | None
) -> None:
    mission = Mission(no_model(), {}, 0.0, DURATION_S, ended=True, spec=SPEC, settings=settings)
    found = find_extractor("parameter").compute(mission, {"names": ["/l.radius", "/g.radius"]})
    assert found == radius if radius is not None else isinstance(found, Unavailable)
