"""Settings of a vehicle that do not go together, and protections that are off: conditions as data."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from typing import NamedTuple

from care_core.lint.problems import Entry, LintedFile, Problem, Severity
from care_core.metadata.refusals import RELATIONS

_CLASH, _BROKEN, _HINDERS, _UNIT = "contradiction", "cannot-work", "hinders", "wrong-unit"
Clause = tuple[str, str, str]


class Clash(NamedTuple):
    """What is wrong where all conditions hold. `{NAME}` in a text is the value of NAME; `{n}` runs through numbers."""

    when: str
    """`A = 1; B >= A`: the finding stands at the first name. A name that the file lacks fulfils nothing."""
    text: str
    hint: str
    source: str
    rule: str = _CLASH
    severity: Severity = Severity.WARNING
    numbers: tuple[str, ...] = ("",)


_NUMBERS = tuple(map(str, range(1, 17)))
_BATTERIES = ("", *map(str, range(2, 10)))
_COPTER_LOOPS = ("PSC_POSXY", "PSC_POSZ", "PSC_VELZ", "PSC_ACCZ", "ATC_ANG_RLL", "ATC_ANG_PIT", "ATC_ANG_YAW")
_PLANE_LOOPS = tuple(one.replace("PSC_", "Q_P_").replace("ATC_", "Q_A_") for one in _COPTER_LOOPS)
"""Loops of which a copter or quadplane does not arm without the gain."""
_ARMING = "it refuses to arm"
_NOTE = Severity.NOTE
_EKF_SOURCE = "AP_NavEKF_Source.cpp, pre_arm_check"
_DOCS = "ArduPilot's documentation of failsafes"
_PX4_SAFETY = "PX4's documentation of failsafes"

ARDUPILOT: tuple[Clash, ...] = (
    # Protections that are off
    Clash("FS_THR_ENABLE = 0", "FS_THR_ENABLE is 0: nothing is done when the radio is lost.",
          "Switch it on, unless nobody flies it by radio.", _DOCS, _HINDERS, _NOTE),
    Clash("THR_FAILSAFE = 0", "THR_FAILSAFE is 0: nothing is done when the radio is lost.",
          "Switch it on, unless nobody flies it by radio.", _DOCS, _HINDERS, _NOTE),
    Clash("FS_ACTION = 0; FS_TIMEOUT >= 0", "FS_ACTION is 0: the vehicle drives on when radio or ground station is "
          "lost.", "2 holds it.", "Failsafes of Rover, ArduPilot's documentation", _HINDERS, _NOTE),
    Clash("BATT_FS_LOW_ACT = 0; BATT_FS_CRT_ACT = 0; BATT_MONITOR > 0",
          "BATT_FS_LOW_ACT and BATT_FS_CRT_ACT are 0: nothing is done when the battery runs low.",
          "Choose what is to be done.", _DOCS, _HINDERS, _NOTE),
    Clash("FS_EKF_THRESH <= 0", "FS_EKF_THRESH is 0: nothing is done when the position cannot be trusted.",
          "0.8 is usual.", "ArduCopter/ekf_check.cpp", _HINDERS, _NOTE),
    Clash("FS_CRASH_CHECK = 0; FRAME_CLASS > 0; MOT_SPIN_ARM >= 0",
          "FS_CRASH_CHECK is 0: motors turn on after a crash.", "Switch it on.",
          "ArduPilot's documentation of the crash check", _HINDERS, _NOTE),
    Clash("FS_LEAK_ENABLE = 0", "FS_LEAK_ENABLE is 0: nothing is done when water comes in.", "1 warns, 2 surfaces.",
          "Failsafes of Sub, ArduPilot's documentation", _HINDERS, _NOTE),
    Clash("ARMING_CHECK = 0", "ARMING_CHECK is 0: nothing is checked before arming.",
          "1 checks all; leave out single checks where one must not count.",
          "ArduPilot's documentation of the checks before arming", _HINDERS, _NOTE),
    Clash("FENCE_ACTION = 0; FENCE_ENABLE = 1", "FENCE_ACTION is 0: the fence only reports that it was left.",
          "1 returns or lands.", "ArduPilot's documentation of the fence", _HINDERS, _NOTE),
    Clash("LOG_BACKEND_TYPE = 0", "LOG_BACKEND_TYPE is 0: no log is written, and none will tell what failed.",
          "1 writes to the card.", "AP_Logger", _HINDERS, _NOTE),
    Clash("INS_GYRO_FILTER = 0", "INS_GYRO_FILTER is 0: vibration reaches the rate controllers unfiltered.",
          "20 is the default; small frames take more.", "ArduPilot's parameter list: not recommended", _HINDERS),
    # Batteries
    Clash("BATT_LOW_VOLT >= MOT_BAT_VOLT_MAX; MOT_BAT_VOLT_MAX > 0; BATT_MONITOR > 0",
          "BATT_LOW_VOLT ({BATT_LOW_VOLT}) is not below a full pack (MOT_BAT_VOLT_MAX {MOT_BAT_VOLT_MAX}): the "
          "failsafe acts at once.", "Give it the voltage of the pack when it is to come home.", "AP_BattMonitor"),
    Clash("BATT{n}_VOLT_MULT = 0; BATT{n}_MONITOR >= 3; BATT{n}_MONITOR <= 4",
          "BATT{n}_VOLT_MULT is 0: every voltage reads 0.", "Calibrate it with a voltmeter.",
          "AP_BattMonitor_Analog.cpp", _BROKEN, numbers=_BATTERIES),
    Clash("BATT{n}_LOW_VOLT = BATT{n}_CRT_VOLT; BATT{n}_CRT_VOLT > 0; BATT{n}_FS_LOW_ACT > 0",
          "BATT{n}_LOW_VOLT equals BATT{n}_CRT_VOLT ({BATT{n}_CRT_VOLT} V): the battery is critical at once, and what "
          "BATT{n}_FS_LOW_ACT asks for is never done.", "Set the low voltage higher.", "ArduPilot/ardupilot #22631",
          numbers=_BATTERIES),
    Clash("BATT_FS_LOW_ACT > 0; BATT_MONITOR = 0", "BATT_FS_LOW_ACT never acts: BATT_MONITOR is 0.",
          "Say which sensor measures the battery.", "AP_BattMonitor"),
    # Motors
    Clash("{n}_SPIN_MIN > 0.3", "{n}_SPIN_MIN is {{n}_SPIN_MIN}: motors never slow down below it, and since 4.3 "
          f"{_ARMING} above 0.3.", "0.15 is usual.", "AP_MotorsMulticopter.cpp, arming_checks", _BROKEN,
          numbers=("MOT", "Q_M")),
    Clash("{n}_THST_HOVER > 1", "{n}_THST_HOVER is {{n}_THST_HOVER}, more than all there is: the vehicle leaps up.",
          "It is a share: 0.35, not 35.", "ArduPilot/ardupilot #17038", _UNIT, numbers=("MOT", "Q_M")),
    Clash("{n}_PWM_MIN <= 0; {n}_PWM_MAX > 0", f"Of {{n}}_PWM_MIN and {{n}}_PWM_MAX one is set: {_ARMING}.",
          "Set both, or none.", "AP_MotorsMulticopter.cpp, check_mot_pwm_params", _BROKEN, numbers=("MOT", "Q_M")),
    Clash("{n}_PWM_MAX <= 0; {n}_PWM_MIN > 0", f"Of {{n}}_PWM_MIN and {{n}}_PWM_MAX one is set: {_ARMING}.",
          "Set both, or none.", "AP_MotorsMulticopter.cpp, check_mot_pwm_params", _BROKEN, numbers=("MOT", "Q_M")),
    *(
        Clash(f"{{n}}_P <= 0; {vehicle}", "{n}_P is {{n}_P}: nothing holds what it controls, and since 4.1 "
              f"{_ARMING}.", "Give it the firmware's own value back.",
              "AC_PosControl.cpp and AC_AttitudeControl.cpp, pre_arm_checks", _BROKEN, numbers=loops)
        for vehicle, loops in (("FRAME_CLASS > 0", _COPTER_LOOPS), ("Q_ENABLE > 0", _PLANE_LOOPS))
    ),
    Clash("FRAME_CLASS = 0; MOT_SPIN_ARM >= 0", f"FRAME_CLASS is 0: no motor is mixed, and {_ARMING}.",
          "Say which frame it is: 1 has four motors, 2 six.", "Copter: Check frame class", _BROKEN, _NOTE),
    Clash("PILOT_SPEED_UP <= 0", f"PILOT_SPEED_UP is {{PILOT_SPEED_UP}}: the pilot cannot climb, and {_ARMING}.",
          "It is in cm/s: 250 is usual.", "ArduCopter/AP_Arming.cpp", _BROKEN),
    Clash("H_RSC_MODE = 0", f"H_RSC_MODE is 0: nothing drives the rotor, and {_ARMING}.",
          "Say how its speed is governed.", "AP_MotorsHeli.cpp, arming_checks", _BROKEN),
    Clash("H_COL_MIN >= H_COL_MAX; H_COL_MAX > 0", "H_COL_MIN ({H_COL_MIN}) is not below H_COL_MAX ({H_COL_MAX}).",
          "Reverse the servos instead.", "AP_MotorsHeli scales the collective by both", _BROKEN),
    Clash("INS_HNTCH_MODE = 1; INS_HNTCH_ENABLE = 1; H_RSC_MODE >= 0", "INS_HNTCH_MODE is 1, which follows the "
          "throttle, and that of a helicopter is its collective.", "Follow the rotor's speed, or fix it (0).",
          "ArduPilot/ardupilot #28843"),
    # Radio and servos
    Clash("FS_THR_VALUE >= RC3_MIN; FS_THR_ENABLE > 0; RC3_MIN > 0; MOT_SPIN_ARM >= 0",
          "FS_THR_VALUE ({FS_THR_VALUE}) is not below RC3_MIN ({RC3_MIN}): a stick at its lowest counts as a lost "
          f"radio, and {_ARMING}.", "Give it 10 less than the receiver's lowest.", "ArduCopter/AP_Arming.cpp"),
    Clash("SERVO{n}_MIN > SERVO{n}_TRIM; SERVO{n}_FUNCTION > 0",
          f"SERVO{{n}}_MIN ({{SERVO{{n}}_MIN}}) is above SERVO{{n}}_TRIM ({{SERVO{{n}}_TRIM}}): {_ARMING}.",
          "Reversing is SERVO{n}_REVERSED.", "AP_Arming.cpp, servo_checks", _BROKEN, numbers=_NUMBERS),
    Clash("SERVO{n}_MAX < SERVO{n}_TRIM; SERVO{n}_FUNCTION > 0",
          f"SERVO{{n}}_MAX ({{SERVO{{n}}_MAX}}) is below SERVO{{n}}_TRIM ({{SERVO{{n}}_TRIM}}): {_ARMING}.",
          "Reversing is SERVO{n}_REVERSED.", "AP_Arming.cpp, servo_checks", _BROKEN, numbers=_NUMBERS),
    Clash("RC{n}_MIN > RC{n}_TRIM; RC{n}_TRIM > 0", "RC{n}_MIN ({RC{n}_MIN}) is above RC{n}_TRIM ({RC{n}_TRIM}): "
          f"{_ARMING}.", "Calibrate the radio.", "AP_Arming.cpp, rc_calibration_checks", _BROKEN, numbers=_NUMBERS),
    Clash("RC{n}_MAX < RC{n}_TRIM; RC{n}_MAX > 0", "RC{n}_MAX ({RC{n}_MAX}) is below RC{n}_TRIM ({RC{n}_TRIM}): "
          f"{_ARMING}.", "Calibrate the radio.", "AP_Arming.cpp, rc_calibration_checks", _BROKEN, numbers=_NUMBERS),
    # Estimators and their sensors
    Clash("EK3_ENABLE = 0; AHRS_EKF_TYPE = 3", "AHRS_EKF_TYPE asks for EKF3, and EK3_ENABLE is 0.", "Switch it on.",
          "AP_AHRS: not using configured AHRS type"),
    Clash("EK2_ENABLE = 0; AHRS_EKF_TYPE = 2", "AHRS_EKF_TYPE asks for EKF2, and EK2_ENABLE is 0.",
          "Switch it on, or use EKF3.", "AP_AHRS: not using configured AHRS type"),
    Clash("GPS_TYPE = 0; GPS_TYPE2 = 0; EK3_SRC1_POSXY = 3; EK3_ENABLE = 1",
          "EK3_SRC1_POSXY asks for GPS, and no GPS is on: there is no position.",
          "Switch a receiver on, or change EK3_SRC1_POSXY, VELXY and VELZ.", _EKF_SOURCE),
    Clash("GPS1_TYPE = 0; GPS2_TYPE = 0; EK3_SRC1_POSXY = 3; EK3_ENABLE = 1",
          "EK3_SRC1_POSXY asks for GPS, and no GPS is on: there is no position.",
          "Switch a receiver on, or change EK3_SRC1_POSXY, VELXY and VELZ.", _EKF_SOURCE),
    Clash("COMPASS_USE = 0; COMPASS_USE2 = 0; COMPASS_USE3 = 0; EK3_SRC1_YAW = 1; FRAME_CLASS > 0",
          f"EK3_SRC1_YAW asks for a compass, and none is used: {_ARMING}.", "Use one, or change EK3_SRC1_YAW.",
          _EKF_SOURCE),
    Clash("COMPASS_ENABLE = 0; EK3_SRC1_YAW = 1; FRAME_CLASS > 0",
          f"EK3_SRC1_YAW asks for a compass, and COMPASS_ENABLE is 0: {_ARMING}.", "Use one, or change EK3_SRC1_YAW.",
          _EKF_SOURCE),
    Clash("ARSPD_TYPE = 0; ARSPD_USE > 0", "ARSPD_USE is {ARSPD_USE}, and ARSPD_TYPE is 0: no airspeed is measured.",
          "Say which sensor it is, or set ARSPD_USE to 0.", "AP_Airspeed.cpp"),
    # Planes
    Clash("THR_MAX <= 0; TRIM_THROTTLE >= 0", "THR_MAX is {THR_MAX}: automatic modes fly without throttle.",
          "It is in percent: 75 is usual.", "ArduPlane limits the throttle of automatic modes by it", _BROKEN),
    Clash("LIM_PITCH_MAX < 300; LIM_PITCH_MAX > 0", f"LIM_PITCH_MAX is {{LIM_PITCH_MAX}} cdeg, under 3 degrees: "
          f"{_ARMING}.", "It is in hundredths of a degree: 2000 is usual.", "ArduPlane/AP_Arming.cpp", _UNIT),
    Clash("LIM_ROLL_CD < 300; LIM_ROLL_CD > 0", f"LIM_ROLL_CD is {{LIM_ROLL_CD}} cdeg, under 3 degrees: {_ARMING}.",
          "It is in hundredths of a degree: 4500 is usual.", "ArduPlane/AP_Arming.cpp", _UNIT),
    Clash("FS_LONG_TIMEOUT < FS_SHORT_TIMEOUT; FS_LONG_TIMEOUT > 0", "FS_LONG_TIMEOUT ({FS_LONG_TIMEOUT} s) is below "
          f"FS_SHORT_TIMEOUT ({{FS_SHORT_TIMEOUT}} s): {_ARMING}.", "5 and 1.5 are usual.", "ArduPlane/AP_Arming.cpp",
          _BROKEN),
    Clash("ALT_HOLD_RTL < 1000; ALT_HOLD_RTL > 0", "ALT_HOLD_RTL is {ALT_HOLD_RTL} cm: the plane comes home lower "
          "than trees.", "Is it in metres? 10000 is 100 m.", "ArduPilot's parameter list: centimetres up to 4.4",
          _UNIT),
)  # fmt: skip

PX4: tuple[Clash, ...] = (
    Clash("RC{n}_MIN >= RC{n}_MAX; RC{n}_MAX > 0", "RC{n}_MIN ({RC{n}_MIN}) is not below RC{n}_MAX ({RC{n}_MAX}).",
          "Calibrate the radio; reversing is RC{n}_REV.", "rc_update.cpp of PX4 scales by both", _BROKEN,
          numbers=(*_NUMBERS, "17", "18")),
    Clash("COM_LOW_BAT_ACT = 0", "COM_LOW_BAT_ACT is 0: a battery that runs low is only reported.",
          "3 returns and lands.", _PX4_SAFETY, _HINDERS, _NOTE),
    Clash("CBRK_SUPPLY_CHK = 894281; COM_LOW_BAT_ACT > 0",
          "CBRK_SUPPLY_CHK is set: no battery counts as low, and COM_LOW_BAT_ACT is never done.",
          "Set it to 0, unless a power supply feeds it.", "batteryCheck.cpp of PX4"),
    Clash("COM_OBL_RC_ACT = 0; COM_RCL_EXCEPT >= 4; COM_RCL_EXCEPT < 8", "COM_OBL_RC_ACT is 0: when the offboard link "
          "is lost, the pilot is to take over, and COM_RCL_EXCEPT lets it fly offboard without one.",
          "Let it hold, return or land instead.", "PX4/PX4-Autopilot #26289"),
    Clash("GF_ACTION = 0; GF_MAX_HOR_DIST > 0", "GF_ACTION is 0: the fence of GF_MAX_HOR_DIST does nothing.",
          "2 holds, 3 returns.", "PX4's documentation of the geofence", _HINDERS, _NOTE),
    Clash("GF_ACTION = 0; GF_MAX_VER_DIST > 0", "GF_ACTION is 0: the fence of GF_MAX_VER_DIST does nothing.",
          "2 holds, 3 returns.", "PX4's documentation of the geofence", _HINDERS, _NOTE),
    Clash("RTL_RETURN_ALT > GF_MAX_VER_DIST; GF_MAX_VER_DIST > 0; GF_ACTION > 1",
          "RTL_RETURN_ALT ({RTL_RETURN_ALT} m) is above the fence (GF_MAX_VER_DIST {GF_MAX_VER_DIST} m): coming home "
          "leaves it.", "Lower the one or raise the other.", "PX4's documentation of the geofence"),
    Clash("RTL_DESCEND_ALT > RTL_RETURN_ALT; RTL_RETURN_ALT > 0",
          "RTL_DESCEND_ALT ({RTL_DESCEND_ALT} m) is above RTL_RETURN_ALT ({RTL_RETURN_ALT} m): there is nothing to "
          "descend to.", "Return higher.", "PX4's documentation of the return mode", severity=_NOTE),
    Clash("MPC_THR_MIN >= MPC_THR_HOVER", "MPC_THR_MIN ({MPC_THR_MIN}) is not below MPC_THR_HOVER ({MPC_THR_HOVER}): "
          "the vehicle cannot descend.", "0.12 is usual.", "PX4's position controller keeps the thrust above it"),
    Clash("BAT{n}_V_CHARGED > 5", "BAT{n}_V_CHARGED is {BAT{n}_V_CHARGED} V, more than any cell has.",
          "It is the voltage of one cell: 4.05 is usual.", "PX4's parameter reference: per cell", _UNIT,
          numbers=("1", "2", "3")),
    Clash("BAT{n}_V_EMPTY > 5", "BAT{n}_V_EMPTY is {BAT{n}_V_EMPTY} V, more than any cell has.",
          "It is the voltage of one cell: 3.6 is usual.", "PX4's parameter reference: per cell", _UNIT,
          numbers=("1", "2", "3")),
    Clash("BAT{n}_N_CELLS = 0; BAT{n}_SOURCE = 0", "BAT{n}_N_CELLS is 0: how much is left in the battery is not known, "
          "and no failsafe acts on it.", "Say how many cells it has.", "battery.cpp of PX4", _HINDERS, _NOTE,
          ("1",)),
    Clash("IMU_GYRO_CUTOFF = 0", "IMU_GYRO_CUTOFF is 0: vibration reaches the rate controller unfiltered.",
          "30 to 100 Hz are usual.", "PX4's parameter reference: 0 disables the filter", _HINDERS),
    Clash("EKF2_GPS_CTRL = 0; EKF2_EV_CTRL = 0; EKF2_OF_CTRL = 0", "GPS, external vision and optical flow are all off: "
          "there is no position, and no mode that holds one.", "Switch on what the vehicle has.",
          "PX4's documentation of EKF2", _HINDERS, _NOTE),
    Clash("SYS_HAS_GPS = 0; EKF2_GPS_CTRL > 0", "EKF2_GPS_CTRL fuses GPS, and SYS_HAS_GPS says that there is none.",
          "Set one of them.", "PX4's parameter reference", severity=_NOTE),
    Clash("SDLOG_MODE = -1", "SDLOG_MODE is -1: no log is written, and none will tell what failed.",
          "0 logs from arming on.", "PX4's documentation of logging", _HINDERS, _NOTE),
    Clash("SYS_AUTOSTART = 0", "SYS_AUTOSTART is 0: no airframe is loaded, and no output drives anything.",
          "Choose the airframe.", "PX4's documentation of airframes", _BROKEN),
)  # fmt: skip


def check(file: LintedFile, values: Mapping[str, Entry], clashes: Sequence[Clash]) -> Iterator[Problem]:
    """Conditions that hold in a file."""
    for clash in clashes:
        for number in clash.numbers:
            clauses = _clauses(clash.when, number)
            if all(_holds(clause, values) for clause in clauses):
                first, *others = dict.fromkeys(side for left, _, right in clauses for side in (left, right))
                held = [values[name] for name in others if name in values]
                text, hint = (_filled(text, number, values) for text in (clash.text, clash.hint))
                yield file.problem(clash.rule, clash.severity, values[first], text, hint, clash.source, held)


@cache
def _clauses(when: str, number: str) -> tuple[Clause, ...]:
    parts = (clause.split() for clause in when.replace("{n}", number).split("; "))
    return tuple((left, relation, right) for left, relation, right in parts)


def _holds(clause: Clause, values: Mapping[str, Entry]) -> bool:
    left, relation, right = clause
    first = _number(left, values)
    if right in ("true", "false"):
        return left in values and values[left].value == right
    second = _number(right, values) if right[0].isalpha() else float(right)
    return first is not None and second is not None and RELATIONS[relation][1](first, second)


def _number(name: str, values: Mapping[str, Entry]) -> float | None:
    number = values[name].number if name in values else None
    return None if number is None or not math.isfinite(number) else number


def _filled(text: str, number: str, values: Mapping[str, Entry]) -> str:
    filled = text.replace("{n}", number)
    for name, entry in values.items():
        if f"{{{name}}}" in filled and entry.number is not None:
            filled = filled.replace(f"{{{name}}}", f"{entry.number:g}")
    return filled
