"""Settings of a vehicle that do not go together: what they are, and files that have them right."""

from __future__ import annotations

from pathlib import Path

import pytest

from care_core.lint.linting import Linted, lint
from care_core.lint.problems import Problem, Severity
from care_core.report.linting import lint_text

COPTER = {
    "FRAME_CLASS": 1, "MOT_SPIN_ARM": 0.1, "MOT_SPIN_MIN": 0.15, "ATC_RAT_RLL_P": 0.135, "FS_THR_ENABLE": 1,
    "RCMAP_ROLL": 1, "RCMAP_PITCH": 2, "RCMAP_THROTTLE": 3, "RCMAP_YAW": 4, "FLTMODE_CH": 5, "AHRS_EKF_TYPE": 3,
    "EK3_ENABLE": 1, "EK3_SRC1_POSXY": 3, "EK3_SRC1_YAW": 1, "GPS_TYPE": 1, "GPS_TYPE2": 0, "COMPASS_USE": 1,
    "SERIAL1_PROTOCOL": 2, "SERIAL2_PROTOCOL": 2, "SERIAL3_PROTOCOL": 5, "SERVO1_FUNCTION": 33,
    "SERVO2_FUNCTION": 34, "SERVO3_FUNCTION": 35, "SERVO4_FUNCTION": 36,
}  # fmt: skip
ROVER = {
    "CRUISE_SPEED": 2, "CRUISE_THROTTLE": 50, "ATC_STR_RAT_P": 0.2, "ATC_STR_RAT_I": 0.2, "TURN_RADIUS": 0.9,
    "SERVO1_FUNCTION": 26, "SERVO3_FUNCTION": 70,
}  # fmt: skip
PX4 = {
    "MC_ROLLRATE_P": 0.15, "MC_PITCHRATE_P": 0.15, "MPC_XY_VEL_MAX": 12, "NAV_ACC_RAD": 2, "COM_DISARM_LAND": 2,
    "CA_ROTOR_COUNT": 4, "PWM_MAIN_FUNC1": 101, "PWM_MAIN_FUNC2": 102, "PWM_MAIN_FUNC3": 103, "PWM_MAIN_FUNC4": 104,
    "RC_MAP_ROLL": 1, "RC_MAP_PITCH": 2, "RC_MAP_THROTTLE": 3, "RC_MAP_YAW": 4,
}  # fmt: skip
PLANE = {
    "TRIM_THROTTLE": 45, "LIM_ROLL_CD": 4500, "STALL_PREVENTION": 1, "TECS_CLMB_MAX": 5, "THR_FAILSAFE": 1,
    "FS_LONG_TIMEOUT": 5, "FS_SHORT_TIMEOUT": 1.5,
}  # fmt: skip
RULES = ("contradiction", "cannot-work", "hinders", "wrong-unit")


def rotors(*places: tuple[float, float]) -> dict[str, float]:
    """Where rotors stand, forwards and to the right."""
    held = {
        f"CA_ROTOR{number}_P{axis}": at
        for number, place in enumerate(places)
        for axis, at in zip("XY", place, strict=True)
    }
    return {"CA_ROTOR_COUNT": len(places), **held}


def found(tmp_path: Path, values: dict[str, float]) -> list[Problem]:
    path = tmp_path / "a.param"
    path.write_text("".join(f"{name},{value}\n" for name, value in values.items()))
    (linted,) = lint([str(path)])
    return [one for one in linted.problems if one.rule in RULES]


@pytest.mark.parametrize("values", [COPTER, PLANE, ROVER, PX4, PX4 | rotors((1, 1), (-1, -1), (1, -1), (-1, 1))])
def test_a_vehicle_that_has_them_right_is_left_alone(tmp_path: Path, values: dict[str, float]) -> None:
    assert found(tmp_path, values) == []


@pytest.mark.parametrize(
    ("base", "values", "rule", "parameter", "says"),
    [
        (COPTER, {"FS_THR_ENABLE": 0}, "hinders", "FS_THR_ENABLE", "nothing is done when the radio is lost"),
        (COPTER, {"MOT_SPIN_MIN": 0.4}, "cannot-work", "MOT_SPIN_MIN", "refuses to arm above 0.3"),
        (COPTER, {"MOT_THST_HOVER": 35}, "wrong-unit", "MOT_THST_HOVER", "0.35, not 35"),
        (COPTER, {"BATT2_MONITOR": 4, "BATT2_VOLT_MULT": 0}, "cannot-work", "BATT2_VOLT_MULT", "every voltage reads 0"),
        (COPTER, {"RCMAP_YAW": 1}, "contradiction", "RCMAP_YAW", "both channel 1"),
        (COPTER, {"RC7_OPTION": 41, "RC9_OPTION": 41}, "contradiction", "RC9_OPTION", "it refuses to arm"),
        (COPTER, {"RC5_OPTION": 41}, "contradiction", "RC5_OPTION", "FLTMODE_CH chooses the mode"),
        (COPTER, {"SERVO4_FUNCTION": 35}, "contradiction", "SERVO4_FUNCTION", "no output drives motor 4"),
        (COPTER, {"EK3_ENABLE": 0}, "contradiction", "EK3_ENABLE", "AHRS_EKF_TYPE asks for EKF3"),
        (COPTER, {"GPS_TYPE": 0}, "contradiction", "GPS_TYPE", "no GPS is on"),
        (COPTER, {"SERIAL3_PROTOCOL": 2}, "contradiction", "GPS_TYPE", "no port listens to it"),
        (COPTER, {"SERVO9_FUNCTION": 7, "SERVO9_MIN": 1600, "SERVO9_TRIM": 1500}, "cannot-work", "SERVO9_MIN", "above"),
        (COPTER, {"RC2_MAX": 1400, "RC2_TRIM": 1500}, "cannot-work", "RC2_MAX", "Calibrate the radio"),
        (
            COPTER, {"FENCE_ENABLE": 1, "FENCE_TYPE": 7, "FENCE_ALT_MAX": 20, "RTL_ALT": 3000},
            "contradiction", "RTL_ALT", "30 m, above the fence",
        ),
        (
            COPTER, {"INS_HNTCH_ENABLE": 1, "INS_HNTCH_MODE": 1, "INS_HNTCH_FREQ": 80, "INS_HNTCH_BW": 160},
            "contradiction", "INS_HNTCH_BW", "moves the notch up",
        ),
        (
            COPTER, {"INS_HNTCH_ENABLE": 1, "INS_HNTCH_MODE": 3, "INS_HNTCH_REF": 0, "INS_HNTCH_FREQ": 80,
                     "INS_HNTCH_BW": 40},
            "contradiction", "INS_HNTCH_REF", "stays at INS_HNTCH_FREQ",
        ),
        (
            COPTER, {"BATT_LOW_VOLT": 13.2, "BATT_CRT_VOLT": 13.2, "BATT_FS_LOW_ACT": 2},
            "contradiction", "BATT_LOW_VOLT", "equals BATT_CRT_VOLT (13.2 V)",
        ),
        (COPTER, {"PSC_ACCZ_P": 0}, "cannot-work", "PSC_ACCZ_P", "nothing holds what it controls"),
        (
            COPTER, {f"SERVO{number}_FUNCTION": 0 for number in range(4, 15)},
            "contradiction", "FRAME_CLASS", "No output drives motor 4",
        ),
        (PLANE, {"FS_LONG_TIMEOUT": 1}, "cannot-work", "FS_LONG_TIMEOUT", "below FS_SHORT_TIMEOUT (1.5 s)"),
        (ROVER, {"SERVO3_FUNCTION": 56}, "contradiction", "SERVO1_FUNCTION", "no output has throttle"),
        (
            PX4, {"CBRK_SUPPLY_CHK": 894281, "COM_LOW_BAT_ACT": 3},
            "contradiction", "CBRK_SUPPLY_CHK", "no battery counts as low",
        ),
        (PX4, {"COM_OBL_RC_ACT": 0, "COM_RCL_EXCEPT": 4}, "contradiction", "COM_OBL_RC_ACT", "without one"),
        (PX4, {"FW_AIRSPD_MIN": 18, "FW_AIRSPD_TRIM": 17}, "contradiction", "FW_AIRSPD_MIN", "invalid"),
        (PX4, rotors((1, 1), (-1, -1), (1, 1), (-1, -1)), "cannot-work", "CA_ROTOR_COUNT", "stand in a line"),
        (PX4, {"PWM_MAIN_FUNC4": 103}, "contradiction", "CA_ROTOR_COUNT", "no output drives motor 4"),
        (PX4, {"RC_MAP_YAW": 1}, "contradiction", "RC_MAP_YAW", "are both channel 1"),
        (PX4, {"MAV_0_CONFIG": 102, "GPS_1_CONFIG": 102}, "contradiction", "GPS_1_CONFIG", "both port 102"),
        (PX4, {"EKF2_HGT_REF": 1, "EKF2_GPS_CTRL": 5}, "contradiction", "EKF2_HGT_REF", "Add 2 to EKF2_GPS_CTRL"),
        (PX4, {"BAT1_V_EMPTY": 13.2}, "wrong-unit", "BAT1_V_EMPTY", "more than any cell has"),
        (PX4, {"GF_ACTION": 0, "GF_MAX_HOR_DIST": 300}, "hinders", "GF_ACTION", "does nothing"),
    ],
)  # fmt: skip
def test_settings_that_do_not_go_together(
    tmp_path: Path, base: dict[str, float], values: dict[str, float], rule: str, parameter: str, says: str
) -> None:
    problems = [one for one in found(tmp_path, base | values) if one.parameter == parameter]
    assert [one.rule for one in problems] == [rule]
    assert says in f"{problems[0].text} {problems[0].hint}"
    assert problems[0].source


def test_whole_numbers_that_were_stored_byte_by_byte_are_told_once(tmp_path: Path) -> None:
    path = tmp_path / "a.param"
    kept = {name: value for name, value in PX4.items() if not name.startswith(("CA_", "PWM_", "RC_"))}
    rows = [f"{name} {value}" for name, value in kept.items()]
    path.write_text("\n".join([*rows, "RC_MAP_ROLL nan", "RC_MAP_PITCH 2.8e-45", "CA_ROTOR_COUNT 5.6e-45"]) + "\n")
    (linted,) = lint([str(path)])
    (problem,) = linted.problems
    assert (problem.rule, problem.line) == ("wrong-type", 6)
    assert "byte by byte" in problem.text


def linted(tmp_path: Path, text: str) -> Linted:
    path = tmp_path / "a.param"
    path.write_text(text)
    (found,) = lint([str(path)])
    return found


def test_commands_that_set_parameters_are_read(tmp_path: Path) -> None:
    """Airframes of PX4 and what was typed into its shell."""
    text = "#!/bin/sh\n. ${R}etc/init.d/rc.mc_defaults\nparam set-default MC_ROLLRATE_P 1.5\n"
    found = linted(tmp_path, f"{text}param set MPC_XY_P 0.9\nset MIXER quad_x\nparam set-default NAV_ACC_RAD 2 # m\n")
    assert [(one.name, one.line) for one in found.file.entries] == [
        ("MC_ROLLRATE_P", 3), ("MPC_XY_P", 4), ("NAV_ACC_RAD", 6),
    ]  # fmt: skip
    assert [one.rule for one in found.problems] == ["out-of-range"]


def test_a_merge_conflict_is_named_once_and_both_sides_are_read(tmp_path: Path) -> None:
    text = "ANGLE_MAX,3000\n<<<<<<< HEAD\nRTL_ALT,1500\n=======\nRTL_ALT,2000\n>>>>>>> other\n"
    found = linted(tmp_path, text)
    assert [(one.line, one.rule) for one in found.problems] == [(2, "syntax"), (5, "duplicate")]
    assert "merge conflict" in found.problems[0].text


def test_a_default_of_the_firmware_is_no_finding_where_its_range_leaves_it_out(tmp_path: Path) -> None:
    rows = {**COPTER, "PSC_VELZ_IMAX": 1000, "ATC_RAT_YAW_FLTE": 2.5, "EK2_ABIAS_P_NSE": 0.005}
    assert linted(tmp_path, "".join(f"{name},{value}\n" for name, value in rows.items())).problems == ()


def test_a_file_older_than_the_lists_is_taken_for_the_vehicle_whose_names_it_has(tmp_path: Path) -> None:
    """Sub 3.4 is the one list that still has names of channels which all vehicles had."""
    old = "".join(f"RC{number}_REV,1\nRC{number}_FUNCTION,0\n" for number in range(5, 12))
    text = f"RTL_ALT,1500\nLAND_SPEED,50\nSUPER_SIMPLE,0\nRTL_LOIT_TIME,5000\n{old}MOT_SPIN_ARMED,70\n"
    found = linted(tmp_path, text)
    assert not [one for one in found.problems if one.parameter in ("RTL_ALT", "LAND_SPEED", "SUPER_SIMPLE")]
    (armed,) = (one for one in found.problems if one.parameter == "MOT_SPIN_ARMED")
    assert armed.severity is Severity.NOTE  # 70 of it is no 70 of MOT_SPIN_ARM
    assert lint_text([found]).count("RC10_REV") == 1
    assert "The same holds of 13 more: RC5_FUNCTION, line 6;" in " ".join(lint_text([found]).split())


def test_a_rover_that_its_wheels_steer_is_told_to_leave_the_steering_out(tmp_path: Path) -> None:
    (found_one,) = found(tmp_path, ROVER | {"SERVO1_FUNCTION": 73, "SERVO3_FUNCTION": 74, "SERVO2_FUNCTION": 26})
    assert found_one.parameter == "SERVO2_FUNCTION"
    assert found_one.hint == "Set it to 0: 73 and 74 drive and steer."


def test_an_extract_and_a_submarine_may_leave_out_outputs_and_gains(tmp_path: Path) -> None:
    assert found(tmp_path, COPTER | {"SERVO4_FUNCTION": 0}) == []
    assert found(tmp_path, {"FRAME_CONFIG": 1, "ATC_ANG_RLL_P": 0, "JS_GAIN_DEFAULT": 0.5, "FS_LEAK_ENABLE": 1}) == []


def test_what_is_not_a_number_is_told_with_the_value_to_put(tmp_path: Path) -> None:
    path = tmp_path / "a.param"
    path.write_text("COMPASS_MOT_X,nan\nATC_RAT_RLL_P,nan\n", encoding="utf-8")
    (linted,) = lint([str(path)])
    told = [one for one in linted.problems if one.rule in ("wrong-type", "out-of-range")]
    assert [(one.parameter, one.hint) for one in told] == [
        ("COMPASS_MOT_X", "Set it to 0."), ("ATC_RAT_RLL_P", "Set it to 0.135."),
    ]  # fmt: skip
