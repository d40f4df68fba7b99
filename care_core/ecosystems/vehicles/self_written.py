"""Parameters that a vehicle writes itself: statistics, calibration, identity, and what it only shows.

They are outcomes, never choices.

The list is data, and the only one: whoever compares configurations leaves these out.
"""

from __future__ import annotations

import re
from fnmatch import translate

SIMULATOR_PREFIX = "SIM_"
"""Parameters of ArduPilot's simulated world: only its builds have any, so they are never options."""

SELF_WRITTEN: dict[str, tuple[str, ...]] = {
    "statistics and counters": (
        "STAT_*", "MIS_TOTAL", "FENCE_TOTAL", "RALLY_TOTAL", "LOG_LASTFILE", "SYS_NUM_RESETS", "FORMAT_VERSION",
        "LND_FLIGHT_T_*", "COM_FLIGHT_UUID",
    ),
    "learned in flight": (
        "MOT_THST_HOVER", "H_COL_HOVER", "TUNE_*_LAST", "COMPASS_OFS*", "COMPASS_DEC", "AHRS_TRIM_[XYZ]",
        "Q_M_THST_HOVER", "Q_TRIM_PITCH_LAST", "EKF2_MAG_DECL", "ATT_MAG_DECL", "EKF2_MAGBIAS_*",
        "ASPD_SCALE_[0-9]",
    ),
    "calibration": (
        "COMPASS_DIA*", "COMPASS_ODI*", "COMPASS_MOT*", "COMPASS_SCALE*", "INS_*OFF*_[XYZ]", "INS_*OFFS_*",
        "INS_*SCAL_*", "INS_*CALTEMP", "INS_TCAL*", "BARO*_GND_PRESS", "GND_ABS_PRESS*", "GND_TEMP", "BARO_GND_TEMP",
        "INS[0-9]_ACC*", "INS[0-9]_GYR*", "INS[0-9]_TCAL*", "TCAL*_BARO_EXP", "TCAL*_TEMP_M*",
        "TCALBARO_EXP", "TCALTEMP_M*",
        "ARSPD*_OFFSET", "RC*_MIN", "RC*_MAX", "RC*_TRIM", "CAL_*", "TC_*", "SENS_DPRES_OFF",
    ),
    "read only": ("SYSID_SW_*", "GPS*_CAN_NODEID*", "BARO_FIELD_ELV"),
    "identity of devices": (
        "*_DEVID", "*_DEV_ID*", "COMPASS_PRIO*_ID", "INS_*_ID", "BRD_SERIAL_NUM",
    ),
}  # fmt: skip
"""Shell patterns by what they are, ArduPilot's and PX4's alike."""

_PATTERN = re.compile("|".join(translate(pattern) for group in SELF_WRITTEN.values() for pattern in group))


def is_self_written(parameter: str) -> bool:
    """Whether nobody chose the value of a parameter."""
    return _PATTERN.match(parameter) is not None
