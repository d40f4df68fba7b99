"""EV records of ArduPilot in words (LogEvent of AP_Logger.h; 16, 23 and 40 are of firmware before 3.3)."""

from __future__ import annotations

from collections.abc import Mapping

ARMED, DISARMED = 10, 11

EVENTS: Mapping[int, str] = {
    ARMED: "armed", DISARMED: "disarmed", 15: "auto-armed", 16: "took off", 17: "maybe landed", 18: "landed",
    19: "lost GPS", 21: "flip began", 22: "flip ended", 23: "flip given up", 25: "home set", 26: "simple mode on",
    27: "simple mode off", 28: "took off", 29: "super-simple mode on", 30: "autotune began", 31: "autotune off",
    32: "autotune began anew", 33: "autotune succeeded", 34: "autotune failed", 35: "autotune reached a limit",
    36: "autotune: the pilot tests the new gains", 37: "autotune saved its gains", 38: "trim saved",
    39: "waypoint saved", 40: "mission cleared", 41: "fence enabled", 42: "fence disabled", 43: "acro trainer off",
    44: "acro trainer: levelling", 45: "acro trainer: limited", 46: "gripper closed", 47: "gripper opened",
    49: "parachute disabled", 50: "parachute enabled", 51: "parachute released", 52: "landing gear deployed",
    53: "landing gear retracted", 54: "motors stopped by the emergency switch", 55: "emergency motor stop cleared",
    56: "motor interlock off: motors cannot turn", 57: "motor interlock on", 58: "rotor at speed",
    59: "rotor speed below critical", 60: "EKF height reset", 61: "landing given up by the pilot", 62: "EKF yaw reset",
    63: "ADSB avoidance on", 64: "ADSB avoidance off", 65: "proximity avoidance on", 66: "proximity avoidance off",
    67: "primary GPS changed", 71: "point A stored", 72: "point B stored",
    73: "landing: the pilot moves the vehicle", 74: "standby on", 75: "standby off", 76: "upper altitude fence enabled",
    77: "upper altitude fence disabled", 78: "circle fence enabled", 79: "circle fence disabled",
    80: "lower altitude fence enabled", 81: "lower altitude fence disabled", 82: "polygon fence enabled",
    83: "polygon fence disabled", 85: "EKF sources: primary", 86: "EKF sources: secondary",
    87: "EKF sources: tertiary", 90: "primary airspeed sensor changed", 163: "surfaced", 164: "left the surface",
    165: "touched the bottom", 166: "left the bottom",
}  # fmt: skip


def event_words(number: int) -> str:
    """An EV record as a clause; "event 99" where it is unknown."""
    return EVENTS.get(number, f"event {number}")
