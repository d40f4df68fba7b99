"""Which parameters go to strangers without a name: a list of what may, so that nothing private has to be thought of.

A number may be an address, a position, a serial number or a day, whatever its parameter is called. What stays is what
explains a flight or a drive: the profile's own parameters, and the documented ones of families that tune, limit and
protect.
"""

from __future__ import annotations

import re

from care_core.logs.formats import PX4_ULG
from care_core.metadata import ardupilot, navigation

_ARDUPILOT = frozenset(
    (
        "ACCEL", "ACRO", "AHRS", "ANGLE", "ARMING", "ARSPD", "ATC", "AUTOTUNE", "AVOID", "BATT", "CIRCLE", "COMPASS",
        "CRASH", "CRUISE", "DISARM", "EK", "EKF", "FENCE", "FFT", "FHLD", "FILT", "FLOW", "FLTMODE", "FRAME", "FS",
        "GPS", "GUID", "GUIDED", "INS", "LAND", "LOG", "LOIT", "MIS", "MODE", "MOT", "NAVL", "OA", "PHLD", "PILOT",
        "PIVOT", "PLND", "POSXY", "POSZ", "PRX", "PSC", "PTCH", "Q", "RC", "RCMAP", "RELAY", "RLL", "RNGFND", "RPM",
        "RTL", "SCHED", "SERIAL", "SERVO", "SPEED", "SRTL", "STEER", "SURFTRAK", "TECS", "THR", "TKOFF", "TUNE", "TURN",
        "VEL", "VELXY", "VELZ", "VISO", "WP", "WPNAV", "WVANE", "YAW",
    )
)  # fmt: skip
_PX4 = frozenset(
    (
        "ASPD", "BAT", "BAT1", "BAT2", "CA", "CBRK", "COM", "CP", "EKF2", "FD", "FW", "GF", "HTE", "IMU", "LNDFW",
        "LNDMC", "LPE", "MAN", "MC", "MIS", "MPC", "NAV", "NPFG", "PWM", "RTL", "THR", "TRIM", "VT", "WEIGHT",
    )
)  # fmt: skip
_PRIVATE = re.compile(
    r"""(^|_)(ID\d*|(?:DEV|NODE|SYS|UAS|BOARD|USER)ID\w*|CAN|LAT\w*|LO?NG?\w*|ORIG\w*|OPOS|ELV|ELEV\w*|DEC|DECL|AUTODEC|TERR\w*|INITIAL_POSE|HOME|RALLY
    |.*PRESS|DATE|TIME_UTC|WEEK|TZ|UTC\w*|MAC\w*|IP\w*|ADDR\w*|HOST\w*|PORT|SQUAWK|ICAO|CALLSIGN|PASS|PASSWD|KEY|PIN_CODE
    |SERIAL_?NUM|SERIAL|UUID|UNIQUE|NODE\w*)($|_)""",
    re.VERBOSE | re.IGNORECASE,
)
"""Among a family that may go: what a vehicle is called by, or where and when it was."""
_FAMILY = re.compile(r"[A-Z]+")
_LAST = re.compile(r"[^/.]+$")


def may_go(name: str, options: frozenset[str], format: str) -> bool:
    """Whether the number of a parameter may go to strangers.

    Args:
        options: the names of the profile's own parameters.
        format: of the log that holds it.
    """
    if name in options:
        return True
    if "/" in name:
        last = _LAST.search(name)
        return last is not None and not _PRIVATE.search(last[0]) and _is_navigation(last[0])
    if _PRIVATE.search(name):
        return False
    if format == PX4_ULG.name:
        return name.partition("_")[0] in _PX4
    family = _FAMILY.match(name)
    return family is not None and family[0] in _ARDUPILOT and bool(ardupilot.known_in(name))


def _is_navigation(name: str) -> bool:
    return any(navigation.readers(ros, name) for ros in ("ros1", "ros2"))
