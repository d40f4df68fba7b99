"""The timeline of an ArduPilot flight: what happened, in order of time, said once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pytest

from care_core.ecosystems.ardupilot.checks import battery as battery_check
from care_core.ecosystems.ardupilot.timeline import timelines
from care_core.ecosystems.findings import Event
from care_core.ecosystems.timeline import MOST
from care_core.logs.base import Table
from care_core.run import Damage, Setting
from tests.flights import flight_of

COPTER = {"firmware": "ArduCopter V4.5.4 (fd1bcc61)", "vehicle": "multicopter"}
OLD_COPTER = {"firmware": "ArduCopter V3.1 (5c6503e2)", "vehicle": "multicopter"}
ROVER = {"firmware": "ArduRover V4.5.4 (fd1bcc61)", "vehicle": "rover"}
QUAD_X = {"FRAME_CLASS": 1.0, "FRAME_TYPE": 1.0, **{f"SERVO{n}_FUNCTION": 32.0 + n for n in range(1, 5)}}


def rows(*values: tuple[float | str, ...], names: Sequence[str]) -> Table:
    """A table of rows whose first value is the time."""
    columns = list(zip(*values, strict=True))
    kinds = [object if isinstance(column[0], str) else np.float64 for column in columns[1:]]
    return Table(
        np.array(columns[0], dtype=np.float64),
        {name: np.array(column, dtype=kind) for name, column, kind in zip(names, columns[1:], kinds, strict=True)},
    )


def said(*texts: tuple[float, str]) -> Table:
    return rows(*texts, names=("Message",))


def height_of(*corners: tuple[float, float]) -> Table:
    """A track by its corners, ten positions a second."""
    t = np.arange(corners[0][0], corners[-1][0], 0.1)
    height = np.interp(t, [at for at, _ in corners], [metres for _, metres in corners])
    return Table(t, {"Lat": 47.0 + 1e-7 * t, "Lng": np.full(len(t), 8.0), "RelHomeAlt": height})


def told(
    tables: Mapping[str, Table], *, facts: Mapping[str, str] = COPTER, end_s: float = 100.0,
    settings: Mapping[str, tuple[Setting, ...]] | None = None, damage: Sequence[Damage] = (),
) -> list[Event]:  # fmt: skip
    known = {name: (Setting(name, value, "PARM"),) for name, value in QUAD_X.items()} | dict(settings or {})
    return list(next(timelines(flight_of(tables, known, facts, end_s, damage), tables.values())))


def texts(events: Sequence[Event], kind: str = "") -> list[str]:
    return [event.text for event in events if not kind or event.kind == kind]


ARMED = rows((10.0, 1.0, 0.0, 1.0), (60.0, 0.0, 0.0, 13.0), names=("ArmState", "Forced", "Method"))


def test_a_flight_is_told_in_order_of_time() -> None:
    events = told({
        "ARM": ARMED,
        "MODE": rows((0.0, 0, 1), (20.0, 5, 1), (50.0, 6, 3), names=("ModeNum", "Rsn")),
        "EV": rows((10.0, 10), (12.0, 28), (59.0, 18), (60.0, 11), names=("Id",)),
        "POS": height_of((0, 0), (12, 0), (20, 15), (50, 15), (59, 0), (100, 0)),
        "ERR": rows((50.0, 5, 1), (53.5, 5, 0), names=("Subsys", "ECode")),
    })  # fmt: skip
    assert texts(events) == [
        "ArduCopter V4.5.4, quad X", "mode Stabilize (by the pilot)", "armed by the ground station", "took off",
        "mode Loiter (by the pilot)", "highest point, 15.0 m", "radio failsafe, over after 3.5 s",
        "mode RTL (radio failsafe)", "landed", "disarmed after landing, armed for 50 s",
    ]  # fmt: skip
    assert [event.time_s for event in events] == sorted(event.time_s for event in events)


def test_modes_are_named_by_the_vehicle() -> None:
    modes = {"MODE": rows((0.0, 4, 2), (5.0, 10, 2), names=("ModeNum", "Rsn"))}
    assert texts(told(modes), "mode") == [
        "mode Guided (by the ground station)",
        "mode OF_Loiter (by the ground station)",
    ]
    assert texts(told(modes, facts=ROVER), "mode") == [
        "mode Hold (by the ground station)", "mode Auto (by the ground station)",
    ]  # fmt: skip


def test_old_firmware_names_its_modes_and_gives_no_reason() -> None:
    modes = rows((0.0, "STABILIZE", 1.0), (5.0, "OF_LOITER", 1.0), names=("Mode", "ThrCrs"))
    assert texts(told({"MODE": modes}, facts=OLD_COPTER), "mode") == ["mode Stabilize", "mode OF_Loiter"]


def test_a_mode_that_flickers_is_told_once() -> None:
    flicker = [(30.0 + 0.01 * n, float(6 * (n % 2)), 0.0) for n in range(100)]
    assert texts(told({"MODE": rows(*flicker, names=("ModeNum", "Rsn"))}), "mode") == [
        "mode changed 100 times at once: Stabilize, RTL",
    ]  # fmt: skip


def test_a_vehicle_that_never_armed_says_why() -> None:
    complaints = [(5.0 + 30 * n, "PreArm: Compass not calibrated") for n in range(3)]
    events = told({"MSG": said(*complaints, (80.0, "Arm: Compass not calibrated"), (80.0, "Arm: Throttle too high"))})
    assert texts(events, "arming") == [
        "Arm: Compass not calibrated (4 times until 80 s)",
        "it never armed: Compass not calibrated; Throttle too high (5 refusals)", "Arm: Throttle too high",
    ]  # fmt: skip


def test_refusals_before_an_arming_are_told_and_no_more() -> None:
    events = told({"ARM": ARMED, "MSG": said((4.0, "PreArm: Need 3D Fix"))})
    assert texts(events, "arming")[0] == "PreArm: Need 3D Fix"
    assert not any("never armed" in text for text in texts(events))


def test_a_crash_is_told_once_and_before_the_disarming() -> None:
    events = told({
        "ARM": rows((10.0, 1.0, 0.0, 1.0), (60.0, 0.0, 0.0, 12.0), names=("ArmState", "Forced", "Method")),
        "MSG": said((60.0, "Crash: Disarming: AngErr=118>30, Accel=2.5<3.0")),
        "ERR": rows((60.0, 12, 1), names=("Subsys", "ECode")),
    })  # fmt: skip
    assert texts(events)[-2:] == [
        "Crash: Disarming: AngErr=118>30, Accel=2.5<3.0", "disarmed by the crash check, armed for 50 s",
    ]  # fmt: skip
    assert len(texts(events, "crash")) == 1


def test_a_disarming_by_force_in_the_air_is_no_landing() -> None:
    events = told({
        "ARM": rows((10.0, 1.0, 0.0, 1.0), (60.0, 0.0, 1.0, 1.0), names=("ArmState", "Forced", "Method")),
        "EV": rows((12.0, 28), (60.0, 18), names=("Id",)),
        "POS": height_of((0, 0), (12, 0), (20, 15), (100, 15)),
    })  # fmt: skip
    assert "disarmed by the ground station, by force, armed for 50 s" in texts(events)
    assert "landed" not in texts(events)


def test_repeats_are_one_line_with_their_count() -> None:
    errors = [(20.0 + n, 25.0, 1.0) for n in range(30)]
    events = told({"ARM": ARMED, "ERR": rows(*errors, names=("Subsys", "ECode"))})
    assert texts(events, "error") == ["potential thrust loss (30 times until 49 s)"]


def test_lanes_that_switch_to_and_fro_are_one_line() -> None:
    lanes = [(20.0 + n, 24.0, float(n % 2)) for n in range(10)]
    spoken = said((20.0, "EKF primary changed:0"), (21.0, "EKF3 lane switch 1"))
    events = told({"ARM": ARMED, "ERR": rows(*lanes, names=("Subsys", "ECode")), "MSG": spoken})
    assert texts(events, "error") == ["estimator switched to lane 0, and 9 more switches until 29 s"]
    assert not texts(events, "message")


def test_what_every_start_says_is_left_out() -> None:
    routine = ["ArduCopter V4.5.4 (fd1bcc61)", "8d32d262f99643f8bc05a2fed25403d6", "Param space used: 200/4096",
               "EKF3 IMU0 initialised", "EKF3 IMU1 tilt alignment complete", "Frame: QUAD/X", "RC Protocol: SBUS",
               "GPS 1: detected as u-blox at 115200 baud", "Barometer 1 calibration complete", "ChibiOS: cb42c858",
               "ArduPilot Ready", "AHRS: EKF3 active"]  # fmt: skip
    assert texts(told({"MSG": said(*((float(n), text) for n, text in enumerate(routine)))})) == [
        "ArduCopter V4.5.4, quad X",
    ]  # fmt: skip


def test_what_may_have_gone_wrong_is_repeated() -> None:
    spoken = said((20.0, "EKF3 IMU0 emergency yaw reset"), (30.0, "Battery 1 is low 10.42V used 2312 mAh"))
    assert texts(told({"ARM": ARMED, "MSG": spoken}), "message") == [
        "EKF3 IMU0 emergency yaw reset", "Battery 1 is low 10.42V used 2312 mAh",
    ]  # fmt: skip


def test_a_mission_is_one_line_an_arming() -> None:
    spoken = said((15.0, "Mission: 1 Takeoff"), (20.0, "Mission: 2 WP"), (30.0, "Reached command #2"),
                  (30.0, "Mission: 3 WP"), (44.0, "Reached command #3"), (44.0, "Mission: 4 RTL"))  # fmt: skip
    assert texts(told({"ARM": ARMED, "MSG": spoken}), "mission") == ["mission: items 1 to 4 until 44 s, reached 2 to 3"]


def test_parameters_changed_in_flight_are_told_one_by_one() -> None:
    history = {
        "ATC_RAT_RLL_P": (Setting("ATC_RAT_RLL_P", 0.135, "PARM"),
                          Setting("ATC_RAT_RLL_P", 0.3, "PARM", changed_at_s=30.0)),
        "RTL_ALT": (Setting("RTL_ALT", 1500.0, "PARM"), Setting("RTL_ALT", 3000.0, "PARM", changed_at_s=4.0)),
        "MOT_THST_HOVER": (Setting("MOT_THST_HOVER", 0.2, "PARM"),
                           Setting("MOT_THST_HOVER", 0.3, "PARM", changed_at_s=35.0)),
    }  # fmt: skip
    assert texts(told({"ARM": ARMED}, settings=history), "parameter") == [
        "parameter changed while disarmed: RTL_ALT from 1500 to 3000",
        "ATC_RAT_RLL_P changed from 0.135 to 0.3 while armed",
    ]  # fmt: skip


def test_battery_and_satellites_in_brief() -> None:
    t = np.arange(0.0, 100.0, 1.0)
    volts = np.where((t > 30) & (t < 35), 10.1, 12.4)
    events = told({
        "ARM": ARMED,
        "BAT": Table(t, {"Volt": volts, "Curr": np.where(volts < 11, 45.0, 10.0)}),
        "GPS": Table(t, {"Status": np.where(t == 40, 1.0, 3.0), "NSats": np.where(t == 40, 4.0, 14.0),
                         "HDop": np.full(100, 0.7)}),
    })  # fmt: skip
    assert texts(events, "battery") == [
        "battery at 12.4 V (3 cells)", "battery at its lowest while armed: 10.1 V at 45 A",
    ]  # fmt: skip
    assert texts(events, "gps") == [
        "GPS: 3D fix, 14 satellites, HDop 0.7", "GPS lost its 3D fix while armed", "fewest satellites while armed: 4",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("volts", "count"),
    [(12.6, 3), (11.1, 3), (16.8, 4), (22.2, 6), (25.2, 6), (8.4, 2), (50.4, None), (5.0, None)],
)
def test_cells_are_told_where_one_number_of_them_fits(volts: float, count: int | None) -> None:
    pack = rows(*((float(t), volts - 0.001 * t) for t in range(100)), names=("Volt",))
    (battery,) = flight_of({"BAT": pack, "ARM": ARMED}, {}, COPTER).batteries
    assert (battery.cells if battery.are_cells_known else None) == count


def test_a_report_names_one_count_of_cells() -> None:
    """12.5 V are three full cells or four drained ones; the parameter of a full pack decides for all who ask."""
    pack = rows(*((float(t), 12.5 - 0.001 * t) for t in range(100)), names=("Volt",))
    full = {"MOT_BAT_VOLT_MAX": (Setting("MOT_BAT_VOLT_MAX", 16.8, "PARM"),)}
    flight = flight_of({"BAT": pack, "ARM": ARMED}, full, COPTER)
    assert "battery at 12.5 V (4 cells)" in texts(next(timelines(flight, [])), "battery")
    assert any("each of 4 cells" in finding.evidence for finding in battery_check.find(flight))


def test_a_log_that_ends_in_the_air_says_so() -> None:
    cut = {"ARM": rows((10.0, 1.0, 0.0, 1.0), names=("ArmState", "Forced", "Method")),
           "POS": height_of((0, 0), (12, 0), (20, 30), (100, 30))}  # fmt: skip
    last = told(cut, damage=[Damage("the log breaks off inside a record, its last 12 bytes", 999, 100.0)])[-2:]
    assert texts(last) == [
        "the log breaks off inside a record, its last 12 bytes",
        "the log ends in the air, 30 m up with the vehicle armed: power lost, or the recording stopped",
    ]  # fmt: skip


def test_gaps_count_while_armed_but_not_where_recording_pauses_with_the_motors() -> None:
    beats = np.concatenate([np.arange(0.0, 30.0, 0.1), np.arange(37.0, 60.0, 0.1), np.arange(80.0, 100.0, 0.1)])
    events = told({"ARM": ARMED, "ATT": Table(beats, {"Roll": np.zeros(len(beats)), "Pitch": np.zeros(len(beats))})})
    assert texts(events, "log") == ["nothing is recorded for 7.1 s while armed"]


def test_a_long_timeline_keeps_what_tells_most() -> None:
    names = [f"{a}{b}" for a in "abcdefghij" for b in "klmnopqrst"]
    chatter = [(10.5 + n / 10, f"a script says {name}") for n, name in enumerate(names)]
    events = told({"ARM": ARMED, "MSG": said(*chatter, (40.0, "Internal error 0x1000"), (41.0, "Crash: Disarming"))})
    assert len(events) == MOST
    assert {"Internal error 0x1000", "Crash: Disarming", "armed by the ground station"} <= set(texts(events))
    assert events[-1].text.startswith("and ")
    assert events[-1].time_s == events[-2].time_s


def test_a_vehicle_that_says_nothing_is_not_called_a_copter() -> None:
    assert texts(told({}, facts={}, settings={})) == ["unknown vehicle"]
    assert texts(told({}, facts={"vehicle": "rover"})) == [
        "rover, neither ArduPilot nor PX4 by what it says of itself",
    ]  # fmt: skip


def test_terrain_that_is_missing_before_arming_is_every_start() -> None:
    missing = rows((7.5, 21, 2), names=("Subsys", "ECode"))
    assert not texts(told({"ARM": ARMED, "ERR": missing}), "error")
    flown = rows((30.0, 21, 2), names=("Subsys", "ECode"))
    assert texts(told({"ARM": ARMED, "ERR": flown}), "error") == ["terrain data missing"]


def test_a_failsafe_of_the_heartbeat_alone_is_told() -> None:
    beats = rows(*((float(t), 1.0, 5.0 if t > 20 else 4.0) for t in range(100)), names=("Armed", "State"))
    assert texts(told({"STAT": beats}), "failsafe") == ["failsafe told by the heartbeat, until 99.0 s"]
    assert texts(told({"STAT": beats}), "arming") == ["armed: the log records no arming, by its status"]
    spoken = told({"STAT": beats, "MSG": said((22.0, "Battery Failsafe"))})
    assert texts(spoken, "failsafe") == ["Battery Failsafe"]


def test_the_highest_point_of_an_estimate_that_runs_away_is_the_barometers() -> None:
    t = np.arange(0.0, 100.0, 0.1)
    heard = np.interp(t, [12, 15, 55, 58], [0.0, 3.0, 3.0, 0.0])
    controls = Table(t, {"ThO": np.where((t > 12) & (t < 58), 0.4, 0.0), "Alt": heard + 2.0 * t, "BAlt": heard})
    assert texts(told({"ARM": ARMED, "CTUN": controls}), "flight") == ["highest point, 3.0 m"]


def test_the_highest_point_is_found_in_records_that_come_in_bursts() -> None:
    t = np.sort(np.concatenate([np.arange(0.0, 100.0, 1.2) + step * 0.007 for step in range(5)]))
    height = np.interp(t, [12, 20, 50, 52, 56, 70], [0.0, 36.0, 36.0, 56.0, 36.0, 0.0])
    throttle = np.where((t > 12) & (t < 70), 0.4, 0.0)
    events = texts(told({"ARM": ARMED, "CTUN": Table(t, {"ThO": throttle, "Alt": height})}), "flight")
    assert float(events[0].split()[2]) > 50.0


def test_texts_of_numbers_alone_are_left_out() -> None:
    events = told({"MSG": said((1.0, " 0.35 -0.42 -29.93"), (2.0, "GPS Attack Started"), (3.0, "  "))})
    assert texts(events, "message") == ["GPS Attack Started"]
