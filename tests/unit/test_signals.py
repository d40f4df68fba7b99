"""Signals to be drawn: what was wanted beside what came of it, squeezed into columns."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_core.application.case import Case
from care_core.application.proof import meanings
from care_core.application.signals import Signal, lines_of, shown_lines, signals_of, trace_of, whole_of
from care_core.application.viewing import messages_of
from care_core.errors import CareError
from care_core.logs import formats
from care_core.records import replace
from care_tui.render.plot import plot
from tests.made import MadeLog, T
from tests.tui import sample_diagnosis as sample


def case_of(log: MadeLog) -> Case:
    return Case(sample.unfitting(), log=log)


def test_without_a_profile_the_signals_that_are_known_come_with_what_they_were_to_follow() -> None:
    log = MadeLog({"ATT": {"Pitch": T, "Roll": T, "DesRoll": T}, "VIBE": {"VibeZ": T}, "XYZ": {"Q": T}})
    found = [(one.name, one.wanted_name) for one in signals_of(case_of(log))]
    assert found == [("ATT Roll", "DesRoll"), ("ATT Pitch", ""), ("VIBE VibeZ", "")]


def test_a_vehicles_signals_are_shown_in_the_units_that_people_read() -> None:
    log = MadeLog({"ATTITUDE": {"roll": T, "pitch": T}, "SYS_STATUS": {"voltage_battery": T}})
    case, span = case_of(replace(log, format=formats.MAVLINK_TLOG)), (0.0, 100.0)
    roll, volts = ("ATTITUDE", "roll"), ("SYS_STATUS", "voltage_battery")
    raw, shown = lines_of(case, (roll, volts), span), shown_lines(case, (roll, volts), span)
    for source, factor, unit in ((roll, math.degrees(1.0), "deg"), (volts, 1e-3, "V")):
        before, after = raw[source], shown[source]
        assert before is not None
        assert after is not None
        assert after[1].tolist() == pytest.approx((before[1] * factor).tolist())
        assert meanings(case)(*source).unit == unit


def test_odometry_is_drawn_over_the_velocity_command_by_the_types_of_the_topics() -> None:
    types = {
        "/r1/odom": "nav_msgs/msg/Odometry",
        "/r1/cmd_vel": "geometry_msgs/msg/Twist",
        "/joy_vel": "geometry_msgs/msg/Twist",
    }
    log = MadeLog({name: {} for name in types}, types)
    wanted = {one.name: one.wanted for one in signals_of(case_of(log))}
    assert wanted["/r1/odom twist.twist.linear.x"] == ("/r1/cmd_vel", "linear.x")
    assert wanted["/r1/odom pose.pose.position.x"] is None
    assert "/r1/cmd_vel linear.x" not in wanted, "it is drawn with the odometry"
    assert "/joy_vel linear.x" in wanted


def test_a_trace_holds_both_lines_on_one_axis_of_time() -> None:
    log = MadeLog({"ATT": {"Roll": np.where(T < 50, 0.0, 30.0), "DesRoll": np.full_like(T, -5.0)}})
    trace = trace_of(case_of(log), Signal("ATT", "Roll", ("ATT", "DesRoll")), (0.0, 100.0), 10)
    assert trace.columns == ((0.0, 0.0),) * 5 + ((30.0, 30.0),) * 5
    assert trace.wanted == ((-5.0, -5.0),) * 10
    assert (trace.low, trace.high, trace.count) == (-5.0, 30.0, 201)
    late = trace_of(case_of(log), Signal("ATT", "Roll", ("ATT", "DesRoll")), (90.0, 134.0), 4)
    assert late.columns == ((30.0, 30.0), None, None, None), "nothing is drawn where nothing was recorded"


def test_of_several_sensors_the_first_is_drawn() -> None:
    log = MadeLog({"BAT": {"Volt": np.where(np.arange(len(T)) % 2, 3.0, 12.0), "Inst": np.arange(len(T)) % 2}})
    trace = trace_of(case_of(log), Signal("BAT", "Volt"), (0.0, 100.0), 5)
    assert (trace.low, trace.high) == (12.0, 12.0)


def test_what_the_robot_said_is_in_the_words_of_its_vehicle() -> None:
    t = np.array(["1", "2", "3"] + [""] * (len(T) - 3), dtype=object)
    flight = MadeLog({
        "MSG": {"Message": t},
        "ERR": {"Subsys": np.full_like(T, 5.0), "ECode": np.where(T < 50, 1.0, 0.0)},
        "EV": {"Id": np.full_like(T, 11.0)},
    })  # fmt: skip
    said = {(one.kind, one.text) for one in messages_of(case_of(flight))}
    assert {("message", "1"), ("ERR", "radio failsafe"), ("over", "radio failsafe over"), ("event", "disarmed")} <= said
    words, levels = np.full(len(T), "gyro 0 failed", dtype=object), np.full(len(T), "ERROR", dtype=object)
    px4 = MadeLog({"logged_messages": {"message": words, "level": levels}}, format=formats.PX4_ULG)
    assert ("ERROR", "gyro 0 failed") in {(one.kind, one.text) for one in messages_of(case_of(px4))}


def test_what_cannot_be_drawn_is_said() -> None:
    log = MadeLog({"GPS": {"Spd": np.full_like(T, np.nan), "Name": np.array(["a"] * len(T), dtype=object)}})
    for signal, says in ((Signal("GPS", "Spd"), "no value from"), (Signal("GPS", "Name"), "no numbers"),
                         (Signal("IMU", "AccX"), "no numbers")):  # fmt: skip
        with pytest.raises(CareError, match=says):
            trace_of(case_of(log), signal, (0.0, 100.0), 10)
    with pytest.raises(CareError, match="no log"):
        signals_of(Case(sample.unfitting()))


def test_the_mission_is_drawn_at_first_and_the_whole_log_where_there_is_none() -> None:
    case = case_of(MadeLog({}))
    assert whole_of(case) == (12.4, 199.65)
    run = sample.RUN
    nowhere = replace(run, mission=replace(run.mission, start_s=0.0, end_s=0.0))
    assert whole_of(replace(case, diagnosis=replace(case.diagnosis, run=nowhere))) == (0.0, 100.0)


def test_what_was_wanted_is_told_from_what_came_without_colours() -> None:
    flat: list[tuple[float, float] | None] = [(0.0, 0.0)] * 8
    high: list[tuple[float, float] | None] = [(1.0, 1.0)] * 8
    stars = [line.plain for line in plot(flat, 0.0, 1.0, 3, ascii=True, wanted=high, cursor=2)]
    assert stars == ["........", "  |     ", "********"]
    dots = [line.plain for line in plot(flat, 0.0, 1.0, 3, ascii=False, wanted=high, cursor=1, rule="│")]
    assert dots == ["⠁│⠁ ", " │  ", "⣀⣀⣀⣀"], "a dot in four"
    assert plot(flat, 0.0, 1.0, 1, ascii=False, wanted=high)[0].plain == "⣁⣀⣁⣀", "one cell holds both"


@given(st.lists(st.none() | st.tuples(st.floats(0, 9), st.floats(0, 9)).map(lambda p: (min(p), max(p))), max_size=40),
       st.booleans(), st.integers(1, 6))  # fmt: skip
def test_every_line_of_a_plot_is_as_wide_as_its_columns(
    columns: list[tuple[float, float] | None], ascii: bool, height: int
) -> None:
    lines = plot(columns, 0.0, 9.0, height, ascii=ascii, wanted=columns[::-1])
    assert [line.cell_length for line in lines] == [len(columns) if ascii else (len(columns) + 1) // 2] * height
