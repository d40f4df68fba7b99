"""Flights are judged by what was flown: by their own modes, and by checks of their own where no mission was."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from care_core.causal.model import Model
from care_core.diagnose.judging import judge, unread_options, verdict
from care_core.diagnose.limits import beyond_training
from care_core.ecosystems.ardupilot.measures.modes import mode_names
from care_core.ecosystems.measures import Mission
from care_core.profile.reading import read_schema
from care_core.records import replace
from care_core.report.terminal import to_text
from care_core.run import MissionInfo, OutcomeCheck, Unavailable, Value, is_known
from tests.made import made_diagnosis, made_run
from tests.tables import read
from tests.unit.test_ardupilot_extract import HOME, KIND, METRES, flight, north, table, value

PROFILE = Path(__file__).parents[2] / "profiles" / "arducopter" / "profile.yaml"
COPTER = {"firmware": "ArduCopter V4.5.4 (fd1bcc61)", "vehicle": "multicopter"}
ROVER = {"firmware": "ArduRover V4.5.4 (fd1bcc61)", "vehicle": "rover"}
PLANE = {"firmware": "ArduPlane V4.4.0", "vehicle": "fixed wing"}


def flown(facts: Mapping[str, str] = COPTER, *, mode: int = 5, **replaced: Any) -> Mission:
    """The flight of `tests/unit/test_ardupilot_extract.py`, in one mode."""
    tables = flight(MODE=table([(0.0, mode)], "ModeNum"), **replaced)
    (mission,) = KIND.missions(*read(tables, 75.0, facts=facts), {})
    return mission


def checks(mission: Mission) -> dict[str, Value]:
    return {check.name: check.value for check in KIND.checks(mission)}


def test_a_flight_in_loiter_is_no_mission_and_has_checks_of_its_own() -> None:
    mission = flown(mode=5)
    found = value(mission, "mission_success")
    assert isinstance(found, Unavailable)
    assert found.reason == "no mission was flown"
    assert checks(mission) == {
        "armed": 1.0, "took_off": 1.0, "no_crash": 1.0, "no_failsafe": 1.0, "landed": 1.0, "disarmed": 1.0,
    }  # fmt: skip


def test_a_rover_of_another_firmware_is_not_asked_whether_it_landed() -> None:
    found = checks(flown({"vehicle": "rover"}, mode=0))
    assert "took_off" not in found
    assert "landed" not in found
    assert found["disarmed"] == 1.0


def test_a_flown_mission_has_none() -> None:
    mission = flown(mode=3)
    assert value(mission, "mission_success") == 1.0
    assert KIND.checks(mission) == ()


@pytest.mark.parametrize(
    ("facts", "mode", "is_mission"),
    [(COPTER, 3, True), (COPTER, 10, False), (ROVER, 10, True), (ROVER, 3, False), (PLANE, 10, True), ({}, 3, True)],
)
def test_auto_is_the_vehicles_own(facts: Mapping[str, str], mode: int, *, is_mission: bool) -> None:
    assert (KIND.checks(flown(facts, mode=mode)) == ()) == is_mission


def test_a_rover_neither_takes_off_nor_lands() -> None:
    assert checks(flown(ROVER, mode=0)).keys() == {"armed", "no_crash", "no_failsafe", "disarmed"}


def test_a_crash_in_stabilize_is_a_crash_and_no_failed_mission() -> None:
    mission = flown(mode=0, ERR=table([(69.9, 12, 1)], "Subsys", "ECode"))
    assert checks(mission)["no_crash"] == 0.0
    assert not is_known(value(mission, "mission_success"))


def test_a_crash_that_is_said_after_it_disarmed_belongs_to_its_flight() -> None:
    said = table([(70.3, "Crash: Disarming")], "Message")
    assert checks(flown(mode=0, MSG=said))["no_crash"] == 0.0
    later = table([(74.0, "Crash: Disarming")], "Message")
    assert checks(flown(mode=0, MSG=later))["no_crash"] == 1.0


CUT = table([(10.0, 1, 0)], "ArmState", "Forced")


def test_a_failure_counts_before_the_log_ends() -> None:
    """What made a mission fail for good decides it, though the log ends before the vehicle disarmed."""
    failed = flown(mode=3, ARM=CUT, ERR=table([(40.0, 6, 1)], "Subsys", "ECode"))
    assert not failed.ended
    assert KIND.is_decided(failed)
    assert value(failed, "mission_success") == 0.0
    going_on = flown(mode=3, ARM=CUT)
    assert not KIND.is_decided(going_on)
    assert not is_known(value(going_on, "mission_success"))


def test_a_flight_without_a_mission_that_is_cut_off_has_no_landing() -> None:
    found = checks(flown(mode=5, ARM=CUT))
    assert found["took_off"] == found["no_crash"] == 1.0
    assert not is_known(found["landed"])
    assert not is_known(found["disarmed"])


def test_a_disarming_by_force_in_the_air_fails() -> None:
    at = np.arange(0.0, 75.0, 0.5)
    level = HOME[1] + 1e-7 * np.sin(at)
    up = {"Lat": np.full_like(at, north(0)), "Lng": level, "RelHomeAlt": np.where(at > 12, 20.0, 0.0)}
    forced = table([(10.0, 1, 0), (70.0, 0, 1)], "ArmState", "Forced")
    found = checks(flown(mode=5, ARM=forced, POS=replace(flight()["POS"], times=at, columns=up)))
    assert found["landed"] == found["disarmed"] == 0.0


def test_armed_on_the_ground_alone_is_neither_good_nor_bad() -> None:
    at = np.arange(0.0, 75.0, 0.5)
    still = {"Lat": np.full_like(at, north(0)), "Lng": HOME[1] + 1e-7 * np.sin(at), "RelHomeAlt": 0.01 * np.sin(at)}
    found = checks(flown(mode=0, POS=replace(flight()["POS"], times=at, columns=still)))
    assert not is_known(found["took_off"])
    assert not is_known(found["landed"])


def test_old_logs_tell_heights_otherwise_and_modes_by_name() -> None:
    at = np.arange(0.0, 75.0, 0.5)
    height = np.interp(at, [10, 20, 60, 70], [0, 30, 30, 0])
    barometer = replace(flight()["POS"], times=at, columns={"BarAlt": 412.0 + height})
    named = table([(0.0, "STABILIZE")], "Mode")
    tables = flight(MODE=named, POS=None, CTUN=barometer)
    (mission,) = KIND.missions(*read(tables, 75.0, facts={"firmware": "ArduCopter V3.1"}), {})
    assert mode_names(mission) == ("Stabilize",)
    assert checks(mission)["took_off"] == checks(mission)["landed"] == 1.0


def test_without_heights_the_land_detector_is_believed() -> None:
    events = table([(10.0, 10), (12.0, 28), (69.0, 18), (70.0, 11)], "Id")
    assert checks(flown(mode=0, POS=None, EV=events))["took_off"] == 1.0
    assert checks(flown(mode=0, POS=None, EV=events))["landed"] == 1.0
    assert not is_known(checks(flown(mode=0, POS=None))["took_off"])


@pytest.mark.parametrize(("state", "said"), [(4, "it rose no higher than 0.7 m"), (3, "it never left the ground")])
def test_a_low_hover_is_told_by_the_heartbeat(state: int, said: str) -> None:
    at = np.arange(0.0, 75.0, 0.5)
    height = np.interp(at, [10, 20, 60, 70], [0, 0.7, 0.7, 0])
    low = {"Lat": np.full_like(at, north(0)), "Lng": HOME[1] + 1e-7 * np.sin(at), "RelHomeAlt": height}
    beats = table([(t, 1.0, state if 12 < t < 68 else 3.0) for t in np.arange(0.0, 70.0, 1.0)], "Armed", "State")
    driven = replace(flight()["POS"], times=at, columns={"ThO": np.where(height > 0.1, 0.4, 0.1), "Alt": height})
    hover = flown(mode=5, POS=replace(flight()["POS"], times=at, columns=low), STAT=beats, CTUN=driven)
    told = checks(hover)["took_off"]
    assert isinstance(told, Unavailable)
    assert told.reason.startswith(said)


def test_home_is_no_waypoint() -> None:
    """A real vehicle writes its home, with coordinates, as item 0."""
    items = [(0.0, 0, 16, HOME[0], HOME[1], 584.0), (0.0, 1, 22, 0.0, 0.0, 20.0),
             (0.0, 2, 16, HOME[0] + 100 / METRES, HOME[1], 20.0), (0.0, 3, 20, 0.0, 0.0, 0.0)]  # fmt: skip
    mission = flown(mode=3, CMD=table(items, "CNum", "CId", "Lat", "Lng", "Alt"))
    assert value(mission, "mission_success") == 1.0


def test_motors_are_those_of_the_vehicle() -> None:
    """A hexacopter has six; its fifth at the limit is saturation, which four columns do not show."""
    at = np.arange(0.0, 75.0, 0.5)
    outputs = {f"C{n}": np.full_like(at, 1500.0) for n in range(1, 9)} | {"C5": np.full_like(at, 1960.0)}
    tables = flight(RCOU=replace(flight()["POS"], times=at, columns=outputs))
    (mission,) = KIND.missions(*read(tables, 75.0), {})
    assert value(mission, "motor_saturation") == 0.0
    hexa = {f"SERVO{n}_FUNCTION": 32.0 + n for n in range(1, 7)}
    assert value(replace(mission, settings=hexa, cache={}), "motor_saturation") == 1.0


def test_an_option_is_no_suspect_where_no_mode_read_it() -> None:
    schema = read_schema(PROFILE)
    run = made_run()
    assert unread_options(schema, run) == frozenset()
    landing = replace(run, modes=("Stabilize", "Land"))
    unread = unread_options(schema, landing)
    assert {"WPNAV_SPEED", "RTL_ALT"} <= unread
    assert not {"LAND_SPEED", "WPNAV_SPEED_DN", "ATC_RAT_RLL_P"} & unread
    assert not unread_options(schema, replace(run, modes=("Auto",)))


def test_checks_are_judged_and_withhold_what_a_mission_would_mean() -> None:
    schema = read_schema(PROFILE)
    plain = (OutcomeCheck("no_crash", 0.0, "no crash"), OutcomeCheck("landed", Unavailable("the log ends"), "landed"))
    objectives: dict[str, Value] = {
        "mission_success": Unavailable("no mission was flown"), "mission_time": 61.0, "energy": 3.0,
    }  # fmt: skip
    judged = judge(replace(made_run(), objectives=objectives, checks=plain), schema, None)
    assert [(one.variable.name, one.status) for one in judged.checks] == [
        ("no_crash", "fault"), ("landed", "not_evaluated"),
    ]  # fmt: skip
    assert not judged.broken
    assert "no mission was flown" in next(r.reason for r in judged.results if r.variable.name == "mission_time")
    assert (verdict(judged).status, verdict(judged).reason) == ("fault", "no_crash not met")


def test_several_missions_are_listed_with_their_verdicts() -> None:
    schema = read_schema(PROFILE)
    run = made_run()
    missions = []
    unflown: dict[str, Value] = {one.name: Unavailable("no mission was flown") for one in schema.objectives}
    for index, crashed in enumerate((1.0, 0.0), start=1):
        one = replace(run, mission=MissionInfo(index, 2, 100.0 * index, 100.0 * index + 50, ended=True, fits=True),
                      checks=(OutcomeCheck("no_crash", crashed, ""),), objectives=unflown)  # fmt: skip
        missions.append(verdict(judge(one, schema, None)))
    shown = to_text(replace(made_diagnosis(), missions=tuple(missions)))
    assert "   1  NOT EVALUATED, 100 s (1:40) to 150 s (2:30): no mission was flown" in shown, "as its own report"
    assert "   2  FAULT, 200 s (3:20) to 250 s (4:10): no_crash" in shown
    assert "Missions of this log" not in to_text(made_diagnosis())


@pytest.mark.parametrize(
    ("text", "acts"),
    [
        ("Battery 1 is low 9.80V used 500 mAh", True),
        ("Radio Failsafe", True),
        ("EKF Failsafe: changed to LAND Mode", True),
        ("Failsafe. Short event on: type=1/reason=3", True),
        ("PrecLand: Failsafe Measures", False),
        ("Throttle failsafe off", False),
        ("EKF Failsafe Cleared", False),
    ],
)
def test_what_is_over_or_a_landing_without_its_target_is_no_failsafe(text: str, *, acts: bool) -> None:
    said = table([(40.0, text)], "Message")
    assert checks(flown(mode=0, MSG=said))["no_failsafe"] == 1.0 - acts


def test_a_land_detector_is_believed_over_a_barometer_that_drifted() -> None:
    position = flight()["POS"]
    end_s = flown(mode=0).end_s
    drifted = np.interp(position.t, [end_s - 20.0, end_s - 10.0], [0.0, 5.0])
    columns = {**position.columns, "RelHomeAlt": position["RelHomeAlt"] + drifted}

    def landed(detected_s: float, number: int = 18) -> Value:
        events = table([(detected_s, number)], "Id")
        return checks(flown(mode=0, POS=replace(position, columns=columns), EV=events))["landed"]

    assert landed(0.0, 99) == 0.0
    assert landed(end_s - 1.0) == 1.0
    assert landed(end_s) == 0.0  # disarming says so itself


@pytest.mark.parametrize(("idles_s", "falls", "landed"), [(3.0, False, 1.0), (3.0, True, 0.0), (0.2, False, 0.0)])
def test_a_copter_whose_motors_lift_nothing_and_that_does_not_fall_stands(
    idles_s: float, landed: float, *, falls: bool
) -> None:
    end_s = flown(mode=0).end_s
    at = np.arange(0.0, 75.0, 0.1)
    idle = np.clip(at - (end_s - idles_s), 0.0, idles_s)
    height = np.interp(at, [10.0, 20.0, 30.0, 40.0], [0.0, 60.0, 60.0, 50.0])
    height += -4.9 * idle**2 if falls else 0.3 * idle  # the air of the propellers no longer presses on the barometer
    driven = {"ThO": np.where((at > 10.0) & (idle == 0.0), 0.4, 0.0), "Alt": height}
    barometer = replace(flight()["POS"], times=at, columns=driven)
    assert checks(flown(mode=0, POS=None, CTUN=barometer))["landed"] == landed


@pytest.mark.parametrize(
    ("length_m", "is_unlike"),
    [(201.0, False), (500.0, False), (1200.0, False), (3300.0, True), (60.0, False), (3, True)],
)
def test_what_a_mission_unlike_all_of_the_training_may_need_is_not_known(length_m: float, *, is_unlike: bool) -> None:
    model = cast("Model", SimpleNamespace(summaries={"path_length": SimpleNamespace(low=201.0, high=810.0)}))
    run = replace(made_run(), context={"path_length": length_m})
    assert bool(beyond_training(run, read_schema(PROFILE), model)) == is_unlike


@pytest.mark.parametrize(("throttle", "has_flown"), [(0.4, True), (0.0, False)])
def test_a_height_without_thrust_is_no_flight(throttle: float, *, has_flown: bool) -> None:
    at = np.arange(0.0, 75.0, 0.5)
    height = np.interp(at, [10, 20, 60, 70], [0, 30, 30, 0])
    driven = np.where((at > 10.5) & (at < 69.5), throttle, 0.0)
    controls = replace(flight()["POS"], times=at, columns={"ThO": driven, "Alt": height})
    assert is_known(checks(flown(mode=0, CTUN=controls))["took_off"]) is has_flown


@pytest.mark.parametrize(("sinks_m", "has_flown"), [(200.0, True), (5.0, False)])
def test_a_plane_whose_log_begins_in_the_air_flew_though_it_only_sank(sinks_m: float, *, has_flown: bool) -> None:
    position = flight()["POS"]
    at = np.arange(0.0, 75.0, 0.5)
    columns = {**position.columns, "RelHomeAlt": -np.linspace(0.0, sinks_m, len(position.t))}
    falling = flown(
        PLANE,
        mode=0,
        POS=replace(position, columns=columns),
        GPS=replace(position, times=at, columns={"Spd": 20 + 0 * at}),
    )
    assert (checks(falling)["took_off"] == 1.0) is has_flown


@pytest.mark.parametrize(("height_m", "has_flown"), [(30.0, True), (5.0, False)])
def test_what_flies_above_its_home_all_along_took_off_before_the_log_begins(
    height_m: float, *, has_flown: bool
) -> None:
    position, at = flight()["POS"], np.arange(0.0, 75.0, 0.5)
    level = {**position.columns, "RelHomeAlt": np.full(len(position.t), height_m)}
    driven = replace(position, times=at, columns={"ThO": np.full_like(at, 0.4)})
    events = table([(10.0, 15)], "Id")
    begun = flown(
        {**COPTER, "vehicle": "fixed wing"},
        mode=0,
        ARM=None,
        EV=events,
        CTUN=driven,
        POS=replace(position, columns=level),
        GPS=replace(position, times=at, columns={"Spd": 14 + 0 * at}),
    )
    assert (checks(begun)["took_off"] == 1.0) is has_flown


@pytest.mark.parametrize(
    ("said_s", "said", "state", "named"),
    [
        (5.0, "PreArm: Radio failsafe on", 5.0, "it was armed with a radio failsafe on"),
        (5.0, "", 5.0, "failsafe told by the heartbeat at 10.0 s"),
        (5.0, "Internal Errors 0x100000", 5.0, ""),
        (12.0, "Low battery", 4.0, "battery failsafe at 12.0 s"),
        (5.0, "", 4.0, ""),
    ],
)
def test_a_failsafe_that_the_heartbeat_tells_of_is_one(said_s: float, said: str, state: float, named: str) -> None:
    beats = table([(float(t), float(10 <= t < 70), state) for t in range(75)], "Armed", "State")
    mission = flown(mode=5, STAT=beats, MSG=table([(said_s, said)], "Message"))
    checked = {check.name: check for check in KIND.checks(mission)}["no_failsafe"]
    assert checked.value == float(not named)
    assert checked.otherwise == named


@pytest.mark.parametrize(
    ("over_s", "named"), [(9.0, "EKF failsafe at 11.0 s"), (None, "it was armed with an EKF failsafe on")]
)
def test_a_failsafe_that_had_passed_at_arming_began_anew(over_s: float | None, named: str) -> None:
    records = [(3.0, 17.0, 1.0), *([] if over_s is None else [(over_s, 17.0, 0.0)]), (11.0, 17.0, 1.0)]
    mission = flown(mode=5, ERR=table(records, "Subsys", "ECode"))
    assert {check.name: check for check in KIND.checks(mission)}["no_failsafe"].otherwise == named


def test_a_failsafe_that_ends_as_it_is_armed_did_nothing() -> None:
    beats = table([(float(t), float(10 <= t < 70), 5.0 if t < 12 else 4.0) for t in range(75)], "Armed", "State")
    assert checks(flown(mode=5, STAT=beats))["no_failsafe"] == 1.0
