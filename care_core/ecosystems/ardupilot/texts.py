"""What a vehicle's texts mean, and which of them a timeline leaves out: those of every start, and what records say."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

from care_core.ecosystems.vehicles.errors import EKF_CHECK, EKF_PRIMARY, GPS, THRUST_LOSS, VIBRATION

_ROUTINE = re.compile(
    r"""
      (Ardu\w+|APM:\w+|Rover|AntennaTracker|Blimp)\sV\d | \S.*\s[Vv]\d+\.\d+\S*\s\([0-9a-f]{8}\)$   # firmware
    | .?[0-9a-fA-F]{31,32}$ | (ChibiOS|NuttX|PX4|Pixhawk|Pixracer|Cube\w*|fmuv\d|Nano)\b | \S+\s[0-9A-F]{8}\s[0-9A-F]{8}
    | Param\sspace | RC\sProtocol | RCOut | RCInput | New\s(mission|rally|fence)$ | Frame: | GROUND\sSTART
    | Ground\sstart | Initiali[sz]ing | ArduPilot\sReady | Calibrating | (Barometer|barometer)\s.*complete | Ready\s
    | Beginning\sINS | <startup | Warming\sup | AHRS:\s\w+\sactive | DCM\sactive | Field\sElevation
    | EKF[23]?\sIMU\d+\s(initialised|tilt\salignment|.*yaw\salign|origin\sset|is\susing\sGPS|buffs)
    | EKF[23]\swaiting | GPS\s?\d?:\s(probing|detected|detecting|specified|u-blox) | u-blox | IMU\d:\sfast\ssampling
    | (Arming|Disarming)\smotors | Throttle\s(armed|disarmed) | Polyfence | RC\d+:\s | ESC\stelem | SmartRTL\s(act|ded)
    | Mission:\s\d+\s*$ | Logging\s(started|stopped) | Log\sNum | got\sMISSION | Airspeed\ssensor\scalibrated
    | Set\s(home|speed|HOME) | CAN\d?\b | Board\svoltage | Hit\s | GyroFFT | Motors?:\s | Lua: | Rally | ADSB:\sOn
    | Trim\ssaved | Sampling\s | Flight\smodes? | Target\s | Loaded\s
    """,
    re.VERBOSE,
)
_MISSION = re.compile(r"(?:Mission: (\d+) (.+)|(?:Reached (?:command|waypoint)|Passed waypoint) #(\d+))")
_LONGEST_TEXT = 50
"""Characters of a STATUSTEXT; what is longer is cut, or goes on in another."""
_REFUSAL = re.compile(r"(?P<before>Pre)?Arm: (?P<why>.*)")
RECORDED = {
    GPS: re.compile(r"GPS Glitch|Glitch cleared", re.IGNORECASE),
    EKF_CHECK: re.compile(r"EKF variance", re.IGNORECASE),
    EKF_PRIMARY: re.compile(r"EKF primary changed|lane switch", re.IGNORECASE),
    THRUST_LOSS: re.compile(r"Potential Thrust Loss", re.IGNORECASE),
    VIBRATION: re.compile(r"Vibration compensation", re.IGNORECASE),
}
"""Subsystem of ERR records -> the texts that say the same."""
_TOLD = 2
"""Code of a record of which a text tells."""


def is_routine(text: str) -> bool:
    """Whether a text is one of those that every start, arming or mission item brings, or says nothing in words: numbers
    alone are somebody's own debugging."""
    return not any(map(str.isalpha, text)) or _ROUTINE.match(text) is not None


_NUMBERS = re.compile(r"\s*\([^)]*\d[^)]*\)")


class Refusal(NamedTuple):
    """What the firmware says of why it cannot be armed."""

    time_s: float
    text: str
    why: str
    was_tried: bool
    """Whether somebody tried to arm it: "Arm: ...", not "PreArm: ..."."""

    @property
    def plain(self) -> str:
        """Why, without the numbers that change from one complaint to the next."""
        return _NUMBERS.sub("", self.why)

    @property
    def complaint(self) -> str:
        """What tells one complaint from another: the same without what was measured."""
        return _RATES.sub("", self.plain)


_RATES = re.compile(r"\b\d+(?:\.\d+)?(?=Hz\b)")
"""What a check measured, where it stands inside its sentence."""


def refusal_of(time_s: float, text: str) -> Refusal | None:
    """The refusal of arming that a text is, None where it is none."""
    match = _REFUSAL.match(text)
    return None if match is None else Refusal(time_s, text, match["why"].rstrip(), match["before"] is None)


def in_full(refusals: Sequence[Refusal]) -> tuple[Refusal, ...]:
    """Refusals with what was cut of one told in full where another was not: "PreArm: " leaves three characters less
    of a text than "Arm: " does."""
    said = {one.why for one in refusals}
    cut = {one.why for one in refusals if len(one.text) >= _LONGEST_TEXT}
    longer = {why: max((other for other in said if other.startswith(why)), key=len) for why in cut}
    return tuple(one._replace(why=longer.get(one.why, one.why)) for one in refusals)


def says_what_is_recorded(text: str, subsystem: int) -> bool:
    """Whether a text says no more than an ERR record of this subsystem."""
    known = RECORDED.get(subsystem)
    return known is not None and known.search(text) is not None


_OVER = re.compile(r"clear|recover|\boff\b|over$", re.IGNORECASE)


def code_of(text: str, subsystem: int) -> int | None:
    """The code of the ERR record that a text stands for, 0 where it tells that all is well again; None where it stands
    for none of this subsystem."""
    return None if not says_what_is_recorded(text, subsystem) else 0 if _OVER.search(text) else _TOLD


def mission_item(text: str) -> tuple[int, str] | None:
    """Number of the mission item that a text is about, and what it says of it: a command, or `reached`."""
    match = _MISSION.match(text)
    if match is None:
        return None
    return (int(match[1]), match[2].strip()) if match[1] else (int(match[3]), "reached")
