"""How a vehicle was armed or disarmed: ARM.Method of ArduPilot (AP_Arming::Method), and what it says when it is."""

from __future__ import annotations

from bisect import bisect
from collections.abc import Iterable, Mapping, Sequence

from care_core.run import Unavailable

NEVER_ARMED = Unavailable("the vehicle never armed", "see why arming was refused")
CUT = Unavailable("the log ends before the vehicle disarmed", "record until it has disarmed")
GOES_ON = Unavailable("the log goes on and does not tell that the vehicle disarmed", "record ARM")
"""Why what only a flight, or only its end, would tell is not known."""

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


_SPOKEN: Mapping[str, bool] = {
    "Arming motors": True, "Disarming motors": False, "Throttle armed": True, "Throttle disarmed": False,
}  # fmt: skip
"""What the firmware says when arming cannot fail any more, and when it is over (AP_Arming.cpp of Copter, Sub, Plane and
Rover: send_arm_disarm_statustext)."""


def unrecorded_changes(
    recorded: Sequence[tuple[float, bool]], messages: Iterable[tuple[float, str]]
) -> list[tuple[float, bool]]:
    """When a vehicle says that it was armed (True) or disarmed where its records, in order of time, tell of none: a log
    that is written while armed only is opened after the record of the arming."""
    times = [t for t, _ in recorded]

    def is_unrecorded(t: float, state: bool) -> bool:
        at = bisect(times, t)
        return state not in [now for _, now in recorded[max(at - 1, 0) : at + 1]]

    spoken = [(t, _SPOKEN[text]) for t, text in messages if text in _SPOKEN]
    return [change for change in spoken if is_unrecorded(*change)]
