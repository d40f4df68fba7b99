"""Which parameters each preflight check of PX4 reads, as the firmware's own descriptions of its checks name them
(src/modules/commander/HealthAndArmingChecks, 1.13 to 1.17)."""

from __future__ import annotations

import re

from care_core.ecosystems.px4.calibration import calibrations

_CHECKS = (
    (r"geofence violation", "GF_ACTION GF_MAX_HOR_DIST GF_MAX_VER_DIST"),
    (r"first waypoint|too far", "MIS_DIST_1WP"),
    (r"safety configuration", "COM_ARMABLE"),
    (r"low battery|battery unhealthy", "BAT_LOW_THR BAT_CRIT_THR BAT_EMERGEN_THR COM_ARM_BAT_MIN"),
    (r"CPU load", "COM_CPU_MAX IMU_GYRO_RATEMAX"),
    (r"RAM usage", "COM_RAM_MAX"),
    (r"distance sensor \d+ missing", "SYS_HAS_NUM_DIST"),
    (r"airspeed data|airspeed selector", "SYS_HAS_NUM_ASPD"),
    (r"optical flow", "SYS_HAS_NUM_OF"),
    (r"\bESC\b", "COM_ARM_CHK_ESCS FD_ESCS_EN"),
    (r"magnetic interference", "COM_ARM_MAG_STR EKF2_MAG_CHECK EKF2_MAG_CHK_STR EKF2_MAG_CHK_INC CAL_MAG"),
    (r"no valid .*(attitude|position) estimate", "SYS_HAS_GPS EKF2_EN EKF2_IMU_CTRL EKF2_GPS_CTRL"),
    # The estimator begins where it feels 0.8 to 1.2 g and turns by less than 15 deg/s (EKF/ekf.cpp: initialiseTilt).
    (r"ekf2 missing data", "EKF2_EN EKF2_IMU_CTRL CAL_ACC CAL_GYRO"),
    (r"height estimate (error|not stable)", "COM_ARM_EKF_HGT CAL_ACC"),
    (r"velocity estimate error", "COM_ARM_EKF_VEL CAL_ACC"),
    (r"position estimate error", "COM_ARM_EKF_POS CAL_ACC"),
    (r"yaw estimate error", "COM_ARM_EKF_YAW CAL_MAG CAL_GYRO"),
    (r"GPS fix", "EKF2_GPS_CHECK EKF2_REQ_FIX"),
    (r"GPS satellites", "EKF2_GPS_CHECK EKF2_REQ_NSATS"),
    (r"PDOP", "EKF2_GPS_CHECK EKF2_REQ_PDOP"),
    (r"GPS horizontal pos\w* error", "EKF2_GPS_CHECK EKF2_REQ_EPH"),
    (r"GPS vertical pos\w* error", "EKF2_GPS_CHECK EKF2_REQ_EPV"),
    (r"GPS speed accuracy", "EKF2_GPS_CHECK EKF2_REQ_SACC"),
    (r"GPS horizontal (pos\w*|speed) drift", "EKF2_GPS_CHECK EKF2_REQ_HDRIFT"),
    (r"GPS vertical (pos\w*|speed) drift", "EKF2_GPS_CHECK EKF2_REQ_VDRIFT"),
    (r"accelerometer bias", "EKF2_ABL_LIM CAL_ACC"),
    (r"gyro bias", "EKF2_ABL_GYRLIM CAL_GYRO"),
    (r"attitude failure", "FD_FAIL_R FD_FAIL_P SENS_BOARD_ROT CAL_ACC"),
    (r"motor failure", "FD_ACT_EN"),
    (r"flight time", "COM_FLT_TIME_MAX"),
    (r"accels? \d* ?inconsistent", "COM_ARM_IMU_ACC"),
    (r"gyros? \d* ?inconsistent", "COM_ARM_IMU_GYR"),
    (r"compass(es)? .*inconsistent", "COM_ARM_MAG_ANG"),
    (r"found \d+ compass|compass (sensor )?\d+ missing", "SYS_HAS_MAG SENS_EN_MAGSIM CAL_MAG0_PRIO CAL_MAG1_PRIO"),
    (r"barometer (sensor )?\d+ missing", "SYS_HAS_BARO SENS_EN_BAROSIM"),
    (r"no valid mission", "COM_ARM_MIS_REQ"),
    (r"takeoff|landing required", "MIS_TKO_LAND_REQ"),
    (r"manual control", "COM_RC_IN_MODE"),
    (r"drone ID", "COM_ARM_ODID"),
    (r"parachute", "COM_PARACHUTE"),
    (r"power module|avionics power|power unavailable", "CBRK_SUPPLY_CHK"),
    (r"power redundancy", "COM_POWER_COUNT"),
    (r"ground control station", "NAV_DLL_ACT"),
    (r"SD card", "COM_ARM_SDCARD COM_ARM_HFLT_CHK"),
    (r"USB", "CBRK_USB_CHK"),
    (r"(global|home) position required", "COM_ARM_WO_GPS"),
    (r"safety button", "CBRK_IO_SAFETY"),
    (r"wind speed", "COM_WIND_MAX"),
)
"""What a refusal says, case ignored, and what its check reads; of calibrations, what comes before the sensor's number.
"""


def _named(names: str) -> tuple[str, ...]:
    return tuple(one for name in names.split() for one in calibrations(name) or (name,))


_READ_BY = tuple((re.compile(says, re.IGNORECASE), _named(names)) for says, names in _CHECKS)


def read_by(refusal: str) -> tuple[str, ...]:
    """The parameters that the check reads which says this; none where it is no check of this list."""
    return tuple(name for pattern, names in _READ_BY if pattern.search(refusal) for name in names)
