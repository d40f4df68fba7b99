"""ERR records of ArduPilot in words: subsystem and code (LogErrorSubsystem, LogErrorCode of AP_Logger.h)."""

from __future__ import annotations

import re
from collections.abc import Mapping

from care_core.ecosystems.vehicles.modes import mode_name
from care_core.ecosystems.vehicles.vehicle import Kind
from care_core.records import Record, field

RADIO_FAILSAFE, BATTERY_FAILSAFE, GCS_FAILSAFE, FENCE, FLIGHT_MODE = 5, 6, 8, 9, 10
GPS, CRASH_CHECK, EKF_CHECK, EKF_FAILSAFE, CPU_FAILSAFE = 11, 12, 16, 17, 19
TERRAIN, EKF_PRIMARY, THRUST_LOSS, LEAK, VIBRATION = 21, 24, 25, 27, 29
"""Subsystems that checks ask for."""
GPS_GLITCH = 2
"""The code of a glitch, of subsystem GPS."""
FAILSAFE = re.compile(
    r"(?<!PrecLand: )failsafe(?!s? (measures|off|over|cleared|disabled)\b|\W+(short|long) event off)"
    r"|(critical|dangerous|emergency) battery\b(?!.*\b(advised|recommended)).*\b(landing|returning|return|RTL)\b",
    re.IGNORECASE,
)
"""Texts that say that a failsafe acts, not that one is over or, in a landing on a target, what is done without it; of
PX4 what it does where the battery is that low."""
_FENCES = ((1, "upper altitude"), (2, "circle"), (4, "polygon"), (8, "lower altitude"))


class Subsystem(Record):
    """A subsystem that reports errors."""

    what: str
    kind: str = ""
    """Of a mission's evidence: `failsafe`, `crash`, `ekf`, `thrust`, `vibration`; "" where it is none."""
    codes: Mapping[int, str] = field(default_factory=dict)


_SWITCHED = {0: "over", 1: "on"}

SUBSYSTEMS: Mapping[int, Subsystem] = {
    1: Subsystem("main loop", codes={1: "inertial sensors delayed"}),
    2: Subsystem("radio", codes={0: "radio is back", 2: "no radio frames for a while"}),
    3: Subsystem("compass", codes={0: "compass is healthy again", 1: "compass did not start", 4: "compass unhealthy"}),
    4: Subsystem("optical flow", codes={1: "optical flow did not start"}),
    RADIO_FAILSAFE: Subsystem("radio failsafe", "failsafe", _SWITCHED),
    BATTERY_FAILSAFE: Subsystem("battery failsafe", "failsafe", _SWITCHED),
    7: Subsystem("GPS failsafe", codes={0: "GPS is back", 1: "no GPS position"}),
    GCS_FAILSAFE: Subsystem("ground station failsafe", "failsafe", _SWITCHED),
    FENCE: Subsystem("fence breach", "failsafe", {0: "back inside the fence"}),
    FLIGHT_MODE: Subsystem("flight mode"),
    GPS: Subsystem("GPS", codes={0: "GPS glitch cleared", GPS_GLITCH: "GPS glitch", 4: "GPS unhealthy"}),
    CRASH_CHECK: Subsystem("crash check", "crash", {1: "crash detected", 2: "loss of control detected"}),
    13: Subsystem("flip", codes={2: "flip abandoned"}),
    15: Subsystem("parachute", codes={2: "parachute not released: too low", 3: "parachute not released: landed"}),
    EKF_CHECK: Subsystem("EKF check", "ekf", {0: "EKF variances are fine again", 2: "EKF variances too high"}),
    EKF_FAILSAFE: Subsystem("EKF failsafe", "failsafe", _SWITCHED),
    18: Subsystem("barometer", codes={0: "barometer is fine again", 2: "barometer glitch", 3: "bad depth",
                                      4: "barometer unhealthy"}),
    CPU_FAILSAFE: Subsystem("CPU failsafe", codes={0: "main loop runs again", 1: "main loop stuck"}),
    20: Subsystem("ADSB failsafe", "failsafe", _SWITCHED),
    TERRAIN: Subsystem("terrain", codes={2: "terrain data missing"}),
    22: Subsystem("navigation", codes={
        2: "destination refused", 3: "RTL started anew", 4: "circle did not start", 5: "destination beyond the fence",
        6: "RTL without range finder",
    }),
    23: Subsystem("terrain failsafe", "failsafe", _SWITCHED),
    EKF_PRIMARY: Subsystem("EKF primary", "ekf"),
    THRUST_LOSS: Subsystem("thrust loss check", "thrust", {0: "thrust loss over", 1: "potential thrust loss"}),
    26: Subsystem("sensor failsafe", "failsafe", _SWITCHED),
    LEAK: Subsystem("leak failsafe", "failsafe", {0: "no leak any more", 1: "leak detected"}),
    28: Subsystem("pilot input failsafe", codes=_SWITCHED),
    VIBRATION: Subsystem("vibration failsafe", "vibration", {0: "vibration compensation off",
                                                             1: "vibration compensation on"}),
    30: Subsystem("internal error"),
    31: Subsystem("dead reckoning failsafe", "failsafe", _SWITCHED),
}  # fmt: skip


def error_words(subsystem: int, code: int, kind: Kind = "copter") -> str:
    """An ERR record as a clause: "battery failsafe", "radio failsafe over", "Loiter was refused"."""
    if subsystem == FLIGHT_MODE:
        return f"{mode_name(kind, code)} was refused"
    if subsystem == EKF_PRIMARY:
        return f"estimator switched to lane {code}"
    if subsystem == FENCE and code:
        breached = [name for bit, name in _FENCES if code & bit]
        return f"fence breach ({', '.join(breached)})" if breached else f"fence breach, code {code}"
    known = SUBSYSTEMS.get(subsystem)
    if known is None:
        return f"error of subsystem {subsystem}, code {code}"
    words = known.codes.get(code)
    if words is None:
        return f"{known.what} over" if code == 0 else f"{known.what}, code {code}"
    if known.codes is _SWITCHED:
        return known.what if code else f"{known.what} over"
    return words


def error_kind(subsystem: int) -> str:
    """Which kind of evidence an ERR record of this subsystem is, "" where it is none."""
    known = SUBSYSTEMS.get(subsystem)
    return known.kind if known else ""


def is_over(subsystem: int, code: int) -> bool:
    """Whether the record says that the fault went away."""
    return code == 0 and subsystem not in (FLIGHT_MODE, EKF_PRIMARY)
