"""Missions, metrics and evidence of goal navigation, on drives made up here with known answers and on recorded ones."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from care_core.ecosystems.measures import EXTRACTORS, MISSION_KINDS, Mission, find_extractor
from care_core.ecosystems.registry import run_model
from care_core.ecosystems.ros.measures import battery as battery_extractors
from care_core.ecosystems.ros.measures import navigation
from care_core.ecosystems.ros.measures.window import angle_between
from care_core.ecosystems.ros.messages import ACTION_GOAL, ACTION_RESULT, FRAME, MESSAGES, RECOVERY, TWIST
from care_core.extract.read import read_run
from care_core.logs.base import Table
from care_core.logs.formats import ROS1_BAG
from care_core.logs.opening import open_log
from care_core.profile.reading import read_schema
from care_core.records import replace
from care_core.run import Unavailable, Value, is_known
from tests.tables import read

KIND = MISSION_KINDS["actionlib_goals"]
PROFILE = Path(__file__).resolve().parents[2] / "profiles" / "move_base" / "profile.yaml"
GOALS = ((2.0, 0.0), (4.0, 0.0))
SPEC: dict[str, Any] = {"goals": [list(goal) for goal in GOALS], "goal_timeout_s": 60, "tolerance_m": 0.3}
MODULES = (navigation.__name__, battery_extractors.__name__)
OWN = [name for name, one in EXTRACTORS.items() if one.compute.__module__ in MODULES]
DURATION_S = 100.0
POSE = ("pose.pose.position.x", "pose.pose.position.y", *(f"pose.pose.orientation.{axis}" for axis in "xyzw"))
ODOMETRY_FIELDS = (FRAME, *POSE, "twist.twist.linear.x", "twist.twist.linear.y", "twist.twist.angular.z")
BATTERY_FIELDS = ("voltage", "current", "charge")
ROSOUT_FIELDS = ("level", "name", "msg")


def table(t: Sequence[float], fields: Sequence[str], rows: Sequence[Sequence[Any]]) -> Table:
    """A table; a column of numbers is float64, any other object."""
    columns = {}
    for place, name in enumerate(fields):
        values = [row[place] for row in rows]
        is_text = any(isinstance(value, str) for value in values)
        columns[name] = np.array(values, object if is_text else np.float64)
    return Table(np.array(t, np.float64), columns)


def goals(*sent: tuple[float, float, float], frame: str = "odom") -> Table:
    """Goals (time, x, y), heading 0."""
    rows = [(f"goal-{n}", frame, x, y, 0.0, 0.0, 0.0, 1.0) for n, (_, x, y) in enumerate(sent)]
    return table([t for t, *_ in sent], MESSAGES[ACTION_GOAL].reads, rows)


def results(*ended: tuple[float, int, int]) -> Table:
    """Results (time, number of the goal, status)."""
    return table(
        [t for t, *_ in ended],
        MESSAGES[ACTION_RESULT].reads,
        [(f"goal-{n}", float(s), "said why") for _, n, s in ended],
    )


def odometry(way: Mapping[float, float], frame: str = "odom") -> Table:
    """Odometry at 10 Hz along x through the points (time: x)."""
    t = np.arange(0.0, DURATION_S, 0.1)
    x = np.interp(t, list(way), list(way.values()))
    speed = np.gradient(x, t)
    rows = [(frame, one, 0.0, 0.0, 0.0, 0.0, 1.0, v, 0.0, 0.0) for one, v in zip(x, speed, strict=True)]
    return table(t.tolist(), ODOMETRY_FIELDS, rows)


def commands(speed: float, turn: Sequence[float]) -> Table:
    """Commands at 5 Hz with one forward speed, turns taken in rotation."""
    t = np.arange(0.0, DURATION_S, 0.2)
    return table(t.tolist(), MESSAGES[TWIST].reads, [(speed, 0.0, turn[n % len(turn)]) for n in range(len(t))])


def battery(current: float, charge: float = math.nan) -> Table:
    t = np.arange(0.0, DURATION_S, 1.0)
    rows = [(24.0, current + 1e-9 * one, charge - 0.001 * one) for one in t]
    return table(t.tolist(), BATTERY_FIELDS, rows)


def drive(**changed: Table) -> dict[str, Table]:
    """Goal 1 sent at 10 s and reached at 20 s, goal 2 sent at 21 s and reached at 31 s."""
    tables = {
        "/move_base/goal": goals((10, 2, 0), (21, 4, 0)),
        "/move_base/result": results((20, 0, 3), (31, 1, 3)),
        "/odom": odometry({0: 0, 10: 0, 20: 2, 21: 2, 31: 4}),
        "/cmd_vel": commands(0.2, [0.0]),
        "/battery_state": battery(-3.0),
    }
    return tables | {"/" + name.replace("__", "/"): one for name, one in changed.items()}


def mission(tables: Mapping[str, Table], spec: Mapping[str, Any] = SPEC) -> Mission:
    (one,) = KIND.missions(*read(tables, DURATION_S, ROS1_BAG), spec)
    return one


def value(name: str, one: Mission, **args: Any) -> Value:
    return find_extractor(name).compute(one, args)


def test_a_good_drive() -> None:
    one = mission(drive())
    assert (one.start_s, one.end_s, one.ended) == (10.0, 31.0, True)
    assert KIND.mismatch(one) == ""
    assert KIND.evidence(one) == ()
    expected = {
        "goals_sent": 2, "goals_reached": 2, "goals_success": 1, "goals_time": 21, "goal_time": 10, "path_length": 4,
        "goals_approached": 1, "lateral_error": 0, "drive_speed": 0.2, "commanded_speed": 0.2, "turn_reversals": 0,
        "heading_error": 0, "commanded_share": 0, "blocked_share": 0, "battery_power": 72, "time_per_metre": 5,
    }  # fmt: skip
    assert {name: value(name, one) for name in expected} == pytest.approx(expected, rel=0.02, abs=0.02)


@pytest.mark.parametrize("current", [-3.0, 3.0])
def test_energy_whatever_the_sign_of_the_current(current: float) -> None:
    assert value("battery_energy", mission(drive(battery_state=battery(current)))) == pytest.approx(24 * 3 * 21 / 3600)


def test_energy_from_charge_without_a_current() -> None:
    one = mission(drive(battery_state=battery(math.nan, charge=1.0)))
    assert value("battery_energy", one) == pytest.approx(0.021 * 24)


def test_energy_needs_the_whole_mission() -> None:
    short = battery(-3.0).between(0, 18)
    assert isinstance(value("battery_energy", mission(drive(battery_state=short))), Unavailable)


def test_late_success_is_no_success() -> None:
    late = drive(move_base__goal=goals((10, 2, 0), (72, 4, 0)), move_base__result=results((71, 0, 3), (80, 1, 3)))
    one = mission(late)
    assert value("goals_reached", one) == 2
    assert value("goals_success", one) == 0
    assert "not reached within 60 s" in KIND.evidence(one)[0].text


def test_giving_up_after_a_failure_ends_the_mission() -> None:
    given_up = drive(move_base__goal=goals((10, 2, 0)), move_base__result=results((98, 0, 4)))
    one = mission(given_up)
    assert one.ended
    assert value("goals_success", one) == 0
    assert value("goals_ended", one, status="aborted") == 1
    assert "goal 1 aborted after 88 s: said why" in [evidence.text for evidence in KIND.evidence(one)]


def test_a_log_that_stops_on_the_way() -> None:
    waiting = drive(move_base__goal=goals((10, 2, 0), (90, 4, 0)), move_base__result=results((20, 0, 3)))
    one = mission(waiting)
    assert not one.ended
    assert isinstance(value("goals_success", one), Unavailable)


def test_a_log_that_stops_between_two_goals() -> None:
    between = drive(move_base__goal=goals((70, 2, 0)), move_base__result=results((90, 0, 3)))
    assert not mission(between).ended
    assert isinstance(value("goals_success", mission(between)), Unavailable)


def test_a_goal_replaced_in_its_time_is_no_failure_and_no_success() -> None:
    sent, ended = goals((10, 2, 0), (21, 4, 0), (25, 6, 0)), results((20, 0, 3), (25.1, 1, 2), (35, 2, 3))
    replaced = drive(move_base__goal=sent, move_base__result=ended, odom=odometry({10: 0, 20: 2, 21: 2, 35: 6}))
    found = value("goals_success", mission(replaced))
    assert isinstance(found, Unavailable)
    assert found.reason == "goal 2 was replaced by another under way, at 25 s"
    aborted = replaced | {"/move_base/result": results((20, 0, 4), (25.1, 1, 2), (35, 2, 3))}
    assert value("goals_success", mission(aborted)) == 0


def test_a_goal_sent_again_to_the_same_place_is_one_goal() -> None:
    again = drive(
        move_base__goal=goals((10, 2, 0), (21, 4, 0), (25, 4, 0)),
        move_base__result=results((20, 0, 3), (25.1, 1, 2), (31, 2, 3)),
    )
    one = mission(again)
    assert (value("goals_sent", one), value("goals_success", one)) == (2, 1)
    assert value("goals_time", one) == pytest.approx(value("goals_time", mission(drive())))


def test_a_robot_that_drives_on_after_its_last_known_goal_is_not_evaluated_unless_a_person_drives() -> None:
    on = drive(odom=odometry({0: 0, 10: 0, 20: 2, 21: 2, 31: 4, 60: 9}))
    found = value("goals_success", mission(on))
    assert isinstance(found, Unavailable)
    assert found.reason == "the recording tells of no goal after 31 s, though the robot drives on"
    piloted = on | {"/joy": table([50.0, 70.0], ("axes",), [(1.0,), (1.0,)])}
    assert value("goals_success", mission(piloted)) == 1
    shaken = drive(odom=odometry({0: 0, 10: 0, 20: 2, 21: 2, 31: 4, **{40 + n: 4 + 0.01 * (n % 2) for n in range(50)}}))
    assert value("goals_success", mission(shaken)) == 1


def test_no_answer_within_the_time_is_an_end() -> None:
    silent = drive(move_base__goal=goals((10, 2, 0)), move_base__result=results((5, 9, 3)))
    assert mission(silent).ended
    assert value("goals_success", mission(silent)) == 0


def test_the_list_starting_again_is_a_new_mission() -> None:
    twice = drive(
        move_base__goal=goals((10, 2, 0), (21, 4, 0), (40, 2, 0), (51, 4, 0)),
        move_base__result=results((20, 0, 3), (31, 1, 3), (50, 2, 3), (61, 3, 4)),
    )
    first, second = KIND.missions(*read(twice, DURATION_S, ROS1_BAG), SPEC)
    assert (first.start_s, first.end_s, second.start_s, second.end_s) == (10, 31, 40, 61)
    assert [value("goals_success", one) for one in (first, second)] == [1, 0]
    assert [value("goals_sent", one) for one in (first, second)] == [2, 2]


def test_no_goals_no_mission() -> None:
    assert KIND.missions(*read({}, DURATION_S, ROS1_BAG), SPEC) == ()


@pytest.mark.parametrize(
    ("sent", "says"),
    [
        (((10, 2, 0), (21, 9, 0)), "goal 2 lies 5.0 m"),
        (((10, 2, 0), (21, 4, 0), (32, 6, 0)), "3 goals were sent"),
        (((10, 2.1, 0),), ""),
    ],
)
def test_mismatch(sent: tuple[tuple[float, float, float], ...], says: str) -> None:
    found = KIND.mismatch(mission(drive(move_base__goal=goals(*sent))))
    assert says in found
    assert bool(found) == bool(says)


def test_positions_of_another_frame_are_not_compared() -> None:
    one = mission(drive(move_base__goal=goals((10, 2, 0), (21, 4, 0), frame="map")))
    answer = value("distance_left", one)
    assert isinstance(answer, Unavailable)
    assert "frame map" in answer.reason
    assert value("goals_success", one) == 1


def test_a_robot_that_swings_on_the_spot() -> None:
    """Known failure without one message in the log: turning left and right, commanded by the planner."""
    stuck = drive(
        move_base__goal=goals((10, 2, 0)),
        move_base__result=results((71, 0, 2)),
        odom=odometry({0: 0, 10: 0, 12: 0.5}),
        cmd_vel=commands(0.0, [0.3, -0.3]),
    )
    one = mission(stuck)
    assert value("commanded_share", one, order="spot_turn") == pytest.approx(1)
    assert value("turn_reversals", one) == pytest.approx(300, rel=0.02)
    assert value("no_way_time", one) == pytest.approx(59, abs=0.5)
    assert value("distance_left", one) == pytest.approx(1.5, abs=0.05)
    assert [evidence.kind for evidence in KIND.evidence(one)] == ["timeout", "stuck"]
    assert "to turn on the spot 100%" in KIND.evidence(one)[1].text


@pytest.mark.parametrize(
    ("speed", "turn", "order"),
    [(-0.3, 0.0, "reverse"), (0.3, 0.0, None), (0.0, 0.4, "spot_turn"), (0.0, 0.0, "stand")],
    ids=["back", "on", "round", "still"],
)
def test_what_was_commanded_is_one_thing_at_a_time(speed: float, turn: float, order: str | None) -> None:
    one = mission(drive(cmd_vel=commands(speed, [turn])))
    shares = {name: value("commanded_share", one, order=name) for name in ("stand", "spot_turn", "reverse")}
    assert shares == {name: pytest.approx(float(name == order)) for name in shares}


def test_a_robot_that_is_held() -> None:
    held = drive(
        odom=odometry({0: 0, 100: 0}), cmd_vel=commands(0.3, [0.0]), move_base__result=results((20, 0, 4), (31, 1, 4))
    )
    assert value("blocked_share", mission(held)) == pytest.approx(1)


def with_columns(source: Table, **columns: Any) -> Table:
    found = {name.replace("__", "."): np.broadcast_to(one, len(source)).copy() for name, one in columns.items()}
    return Table(source.t, {**source.columns, **found})


def test_odometry_that_cannot_be_is_not_measured_on() -> None:
    moves = odometry({0: 0, 10: 0, 20: 2, 21: 2, 31: 4})
    broken = {
        "never moved": odometry({0: 0, 100: 0}),
        "no numbers": with_columns(moves, pose__pose__position__x=np.nan),
        "stamps of /odom run at 0.5 of": with_columns(moves, header__stamp=moves.t / 2),
        "stamps of /odom run at 2 of": with_columns(moves, header__stamp=moves.t * 2),
    }
    for reason, odom in broken.items():
        one = mission(drive(odom=odom))
        for name in ("path_length", "drive_speed", "distance_left", "standstill", "time_per_metre"):
            found = value(name, one)
            assert isinstance(found, Unavailable), (reason, name, found)
            assert reason in found.reason
        assert value("goals_success", one) == 1
    simulated = with_columns(moves, header__stamp=moves.t / 2 - 1.7e9)
    assert value("path_length", mission(drive(odom=simulated))) == pytest.approx(4)
    one = mission(drive(odom=with_columns(moves, twist__twist__linear__x=0.0)))
    assert isinstance(value("drive_speed", one), Unavailable)
    assert value("path_length", one) == pytest.approx(4)


def test_messages_are_counted_and_condensed() -> None:
    said = [(11 + n, (4.0, "/move_base", f"DWA planner failed to produce path ({n}).")) for n in range(9)]
    said += [(30, (2.0, "/move_base", "Got new plan"))]
    one = mission(drive(rosout=table([t for t, _ in said], ROSOUT_FIELDS, [row for _, row in said])))
    assert value("rosout_count", one, text="dwa PLANNER failed") == 9
    assert value("rosout_count", one, text="got new plan", level=4) == 0
    (evidence,) = KIND.evidence(one)
    assert evidence.text == "DWA planner failed to produce path (0). (9 times)"
    assert (evidence.kind, evidence.time_s) == ("planner", 11)


def test_what_a_damaged_definition_reads_is_said_by_nobody() -> None:
    failed = "DWA planner failed to produce path."
    rows: list[tuple[object, ...]] = [
        (4.0, "/move_base", 7.5),
        (4.0, 1.0, failed),
        (math.nan, "/move_base", failed),
        (4.0, "/move_base", failed.encode()),
        (4.0, "/move_base", failed),
    ]
    one = mission(drive(rosout=table([11, 12, 13, 14, 15], ROSOUT_FIELDS, rows)))
    assert value("rosout_count", one, text="planner failed") == 1
    assert [(evidence.time_s, evidence.text) for evidence in KIND.evidence(one)] == [(15, failed)]


def test_commands_that_are_no_numbers_go_no_way() -> None:
    some = drive()["/cmd_vel"]
    column = next(name for name in some.columns if name.endswith("linear.x"))
    speeds = some[column].copy()
    speeds[::2] = math.inf
    damaged = drive(cmd_vel=with_columns(some, **{column: speeds}))
    assert value("commanded_speed", mission(damaged)) == pytest.approx(0.2)


def test_recoveries() -> None:
    names = ("conservative_reset", "rotate_recovery", "rotate_recovery")
    ran = table([12, 13, 14], MESSAGES[RECOVERY].reads, [(name,) for name in names])
    one = mission(drive(move_base__recovery_status=ran))
    assert value("recoveries", one, behavior="rotate") == 2
    assert value("recoveries", one) == 3
    assert [evidence.kind for evidence in KIND.evidence(one)] == ["recovery", "recovery"]
    without = mission(drive())
    assert value("recoveries", without, absent=0) == 0
    assert isinstance(value("recoveries", without), Unavailable)


@pytest.mark.parametrize("name", OWN)
def test_poor_data_never_raises(name: str) -> None:
    whole = drive()
    for kept in range(1, len(whole) + 1):
        tables = dict(list(whole.items())[:kept])
        answer = value(name, mission(tables))
        assert isinstance(answer, (float, int, Unavailable))
    empty = {channel: replace(one).between(-2, -1) for channel, one in whole.items()}
    answer = value(name, mission(empty | {"/move_base/goal": whole["/move_base/goal"]}))
    assert isinstance(answer, (float, int, Unavailable))


@given(a=st.floats(-20, 20), b=st.floats(-20, 20))
@settings(deadline=None)
def test_angle_between(a: float, b: float) -> None:
    angle = angle_between(a, b)
    assert 0 <= angle <= math.pi + 1e-9
    assert angle == pytest.approx(angle_between(b, a), abs=1e-9)
    assert math.cos(angle) == pytest.approx(math.cos(a - b), abs=1e-9)


def test_recorded_faults(recorded: Path) -> None:
    schema = read_schema(PROFILE)
    folder = recorded / "data" / "move_base" / "faults"
    lines = (folder / "truth.jsonl").read_text(encoding="utf-8").splitlines()
    for truth in [json.loads(line) for line in lines][::3]:
        run = read_run(run_model(open_log(folder / f"{truth['tag']}.bag")), schema)
        assert run.config == pytest.approx(truth["config"])
        assert run.mission.fits
        assert run.mission.ended
        assert run.objectives["mission_success"] == truth["objectives"]["mission_success"]
        assert run.metrics["goals_reached"] == pytest.approx(truth["objectives"]["goals_reached"] / 5)
        assert run.metrics["goals_approached"] == pytest.approx(truth["objectives"]["rns"])
        assert all(is_known(one) for one in run.metrics.values())
        if not truth["objectives"]["mission_success"]:
            assert run.evidence
