"""Flight modes: numbers, names, and what a vehicle does in them.

Numbers are those of MODE.ModeNum and of MAVLink's custom_mode, which are the same on ArduPilot (`mode.h` of each
vehicle). PX4's are `nav_state` of vehicle_status.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from care_core.ecosystems.vehicles.vehicle import Kind

Way = Literal["mission", "return", "land", "hold", "guided", "manual", "other"]
"""What a mode does: flies the mission, goes home, lands, keeps its place, follows orders from outside, follows the
pilot's sticks without keeping its place, or something else."""

_COPTER: Mapping[int, tuple[str, Way]] = {
    0: ("Stabilize", "manual"), 1: ("Acro", "manual"), 2: ("AltHold", "manual"), 3: ("Auto", "mission"),
    4: ("Guided", "guided"), 5: ("Loiter", "hold"), 6: ("RTL", "return"), 7: ("Circle", "hold"),
    8: ("Position", "hold"), 9: ("Land", "land"), 10: ("OF_Loiter", "hold"), 11: ("Drift", "manual"),
    13: ("Sport", "manual"), 14: ("Flip", "other"), 15: ("AutoTune", "hold"), 16: ("PosHold", "hold"),
    17: ("Brake", "hold"), 18: ("Throw", "other"), 19: ("Avoid_ADSB", "other"), 20: ("Guided_NoGPS", "guided"),
    21: ("Smart_RTL", "return"), 22: ("FlowHold", "hold"), 23: ("Follow", "guided"), 24: ("ZigZag", "hold"),
    25: ("SystemID", "other"), 26: ("Autorotate", "land"), 27: ("Auto RTL", "mission"), 28: ("Turtle", "other"),
    29: ("Rate_Acro", "manual"),
}  # fmt: skip
_PLANE: Mapping[int, tuple[str, Way]] = {
    0: ("Manual", "manual"), 1: ("Circle", "hold"), 2: ("Stabilize", "manual"), 3: ("Training", "manual"),
    4: ("Acro", "manual"), 5: ("FBWA", "manual"), 6: ("FBWB", "manual"), 7: ("Cruise", "manual"),
    8: ("AutoTune", "manual"), 10: ("Auto", "mission"), 11: ("RTL", "return"), 12: ("Loiter", "hold"),
    13: ("Takeoff", "other"), 14: ("Avoid_ADSB", "other"), 15: ("Guided", "guided"), 16: ("Initialising", "other"),
    17: ("QStabilize", "manual"), 18: ("QHover", "manual"), 19: ("QLoiter", "hold"), 20: ("QLand", "land"),
    21: ("QRTL", "return"), 22: ("QAutoTune", "hold"), 23: ("QAcro", "manual"), 24: ("Thermal", "other"),
    25: ("Loiter to QLand", "land"), 26: ("AutoLand", "land"),
}  # fmt: skip
_ROVER: Mapping[int, tuple[str, Way]] = {
    0: ("Manual", "manual"), 1: ("Acro", "manual"), 2: ("Learning", "manual"), 3: ("Steering", "manual"),
    4: ("Hold", "hold"), 5: ("Loiter", "hold"), 6: ("Follow", "guided"), 7: ("Simple", "manual"),
    8: ("Dock", "other"), 9: ("Circle", "other"), 10: ("Auto", "mission"), 11: ("RTL", "return"),
    12: ("Smart_RTL", "return"), 15: ("Guided", "guided"), 16: ("Initialising", "other"),
}  # fmt: skip
_SUB: Mapping[int, tuple[str, Way]] = {
    0: ("Stabilize", "manual"), 1: ("Acro", "manual"), 2: ("AltHold", "manual"), 3: ("Auto", "mission"),
    4: ("Guided", "guided"), 7: ("Circle", "hold"), 9: ("Surface", "land"), 16: ("PosHold", "hold"),
    19: ("Manual", "manual"), 20: ("Motor Detect", "other"), 21: ("SurfTrak", "manual"),
}  # fmt: skip
_TRACKER: Mapping[int, tuple[str, Way]] = {
    0: ("Manual", "manual"), 1: ("Stop", "hold"), 2: ("Scan", "other"), 3: ("Servo Test", "other"),
    4: ("Guided", "guided"), 10: ("Auto", "other"), 16: ("Initialising", "other"),
}  # fmt: skip
_BLIMP: Mapping[int, tuple[str, Way]] = {
    0: ("Land", "land"), 1: ("Manual", "manual"), 2: ("Velocity", "manual"), 3: ("Loiter", "hold"),
    4: ("RTL", "return"), 5: ("Auto", "mission"),
}  # fmt: skip
_PX4: Mapping[int, tuple[str, Way]] = {
    0: ("Manual", "manual"), 1: ("Altitude", "manual"), 2: ("Position", "hold"), 3: ("Mission", "mission"),
    4: ("Hold", "hold"), 5: ("Return", "return"), 6: ("Position Slow", "hold"), 8: ("Altitude Cruise", "manual"),
    10: ("Acro", "manual"), 12: ("Descend", "land"), 13: ("Termination", "other"), 14: ("Offboard", "guided"),
    15: ("Stabilized", "manual"), 16: ("Rattitude", "manual"), 17: ("Takeoff", "other"), 18: ("Land", "land"),
    19: ("Follow Target", "guided"), 20: ("Precision Land", "land"), 21: ("Orbit", "hold"),
    22: ("VTOL Takeoff", "other"), **{number: (f"External {number - 22}", "other") for number in range(23, 31)},
}  # fmt: skip
_MODES: Mapping[Kind, Mapping[int, tuple[str, Way]]] = {
    "copter": _COPTER, "heli": _COPTER, "plane": _PLANE, "quadplane": _PLANE, "rover": _ROVER, "sub": _SUB,
    "tracker": _TRACKER, "blimp": _BLIMP, "px4": _PX4,
}  # fmt: skip

_REASONS: Mapping[int, str] = {
    1: "by the pilot", 2: "by the ground station", 3: "radio failsafe", 4: "battery failsafe",
    5: "ground station failsafe", 6: "EKF failsafe", 7: "GPS glitch", 8: "end of the mission",
    9: "landing given up by the throttle stick", 10: "fence breach", 11: "terrain failsafe", 12: "brake timeout",
    13: "flip complete", 14: "avoidance", 15: "avoidance over", 16: "throw complete", 17: "termination",
    18: "toy mode", 19: "crash failsafe", 20: "soaring", 21: "soaring", 22: "soaring",
    23: "failed transition", 24: "failed VTOL take-off", 25: "failsafe", 26: "start-up", 27: "surfaced",
    28: "bad depth", 29: "leak failsafe", 30: "servo test", 31: "start-up", 32: "by a script", 33: "mode unavailable",
    34: "autorotation", 35: "autorotation", 36: "soaring", 37: "soaring", 38: "soaring", 39: "home reached",
    40: "home reached", 41: "by the mission", 42: "by telemetry", 43: "back from the fence", 44: "QRTL instead of RTL",
    45: "end of Auto RTL", 46: "loiter height reached", 47: "already in VTOL flight", 48: "radio is back",
    49: "QLand instead of RTL", 50: "dead reckoning failsafe", 51: "take-off mode failsafe",
}  # fmt: skip
"""MODE.Rsn (ModeReason.h); 0 and 26 are what the firmware does by itself at start."""

# PX4's custom_mode of MAVLink: main mode in the third byte, sub-mode of the automatic ones in the fourth.
_PX4_MAIN = {1: 0, 2: 1, 3: 2, 5: 10, 6: 14, 7: 15, 8: 16}
_PX4_AUTO = {2: 17, 3: 4, 4: 3, 5: 5, 6: 18, 8: 19, 9: 20, 10: 22}


def mode_name(kind: Kind, number: int) -> str:
    """The name of a mode as operators know it, "mode 31" where it is unknown."""
    known = _MODES.get(kind, {}).get(number)
    return known[0] if known else f"mode {number}"


def mode_number(kind: Kind, name: str) -> int | None:
    """The number of a mode by the name that a log in words gives it ("ALT_HOLD"), None where there is no such mode."""
    wanted = _letters(name)
    return next((number for number, (known, _) in _MODES.get(kind, {}).items() if _letters(known) == wanted), None)


def way_of(kind: Kind, number: int) -> Way:
    """What the vehicle does in a mode."""
    known = _MODES.get(kind, {}).get(number)
    return known[1] if known else "other"


def reason_words(reason: int) -> str:
    """Why a mode was entered, in words; "" where the number tells nothing."""
    return _REASONS.get(reason, "")


def px4_mode(custom_mode: int) -> int:
    """`nav_state` for the custom_mode of a PX4 heartbeat; -1 where they have none in common."""
    main, sub = custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF
    return _PX4_AUTO.get(sub, -1) if main == 4 else _PX4_MAIN.get(main, -1)


def _letters(name: str) -> str:
    return "".join(filter(str.isalnum, name)).casefold()
