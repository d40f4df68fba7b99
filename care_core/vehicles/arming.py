"""Who armed or disarmed a vehicle: ARM.Method of ArduPilot (AP_Arming::Method)."""

from __future__ import annotations

from collections.abc import Mapping

_METHODS: Mapping[int, str] = {
    0: "by the rudder stick", 1: "by the ground station", 2: "by a switch", 3: "for a motor test", 4: "by a script",
    5: "by termination", 6: "by the CPU failsafe", 7: "by the battery failsafe", 8: "after landing",
    9: "by the advanced failsafe", 10: "by collision avoidance", 11: "by the parachute's release",
    12: "by the crash check", 13: "after landing", 14: "at the end of the mission", 15: "by the fence",
    16: "by the radio failsafe", 17: "after idling on the ground", 18: "by the ground station failsafe",
    19: "by the terrain failsafe", 20: "by a failsafe", 21: "by the terrain failsafe", 22: "after motor detection",
    23: "by a software fault", 24: "by the EKF failsafe", 25: "by the ground station failsafe",
    26: "by the ground station failsafe", 27: "since it did not take off", 28: "after landing",
    29: "by the pilot input failsafe", 30: "by the toy mode", 31: "by the toy mode", 32: "after landing",
    33: "by the dead reckoning failsafe", 34: "by the black box", 35: "by DDS", 36: "once checks passed",
    37: "for turtle mode", 38: "by the toy mode",
}  # fmt: skip


def method_words(method: int) -> str:
    """How a vehicle was armed or disarmed, "" where the number tells nothing."""
    return _METHODS.get(method, "")
