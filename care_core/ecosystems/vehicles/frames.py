"""Frames of multicopters: where each motor sits and what it does to roll, pitch and yaw.

From `AP_MotorsMatrix::setup_motors` and `AP_MotorsTri` of ArduPilot. A factor is the share of a demand that a motor
gives: a motor on the right lowers roll, one in front raises pitch, one that turns counter-clockwise raises yaw.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from care_core.ecosystems.vehicles.settings import Driven, code

CLASSES: Mapping[int, str] = {
    1: "quad", 2: "hexa", 3: "octa", 4: "octaquad", 5: "Y6", 6: "helicopter", 7: "tricopter", 8: "single copter",
    9: "coaxial copter", 10: "bicopter", 11: "dual helicopter", 12: "dodecahexa", 13: "quad helicopter", 14: "deca",
    15: "scripted frame", 16: "scripted 6-axis frame", 17: "scripted frame",
}  # fmt: skip
"""FRAME_CLASS."""

TYPES: Mapping[int, str] = {
    0: "plus", 1: "X", 2: "V", 3: "H", 4: "V-tail", 5: "A-tail", 10: "Y6B", 11: "Y6F", 12: "X, Betaflight order",
    13: "X, DJI order", 14: "X, clockwise order", 15: "I", 18: "X, Betaflight order reversed", 19: "Y4",
}  # fmt: skip
"""FRAME_TYPE; before firmware 3.5 the same numbers stood in FRAME."""

_QUAD, _HEXA, _OCTA, _OCTAQUAD, _Y6, _TRI, _DODECAHEXA = 1, 2, 3, 4, 5, 7, 12
_BY_MOTORS = {4: _QUAD}
"""Classes that the number of motors alone tells; six could be a hexa or a Y6, eight an octa or an octaquad."""


MOST_MOTORS = 8
_MOTORS_OF_WORD: Mapping[str, int] = {"quad": 4, "hexa": 6, "y6": 6, "tri": 4}
"""Outputs of a frame's motors, by its class as old firmware says it ("Frame: QUAD"); a tricopter's are 1, 2 and 4."""


def motors_said(frame: str) -> int:
    """The last output that drives a motor, as far as the firmware's word for its frame tells."""
    return _MOTORS_OF_WORD.get(frame.casefold(), MOST_MOTORS)


class Arm(NamedTuple):
    """A motor of a frame, factors at most 0.5. `level` is `upper` or `lower` where two motors share an arm."""

    angle_deg: float
    """Clockwise from the nose, -180 to 180."""
    roll: float
    pitch: float
    yaw: float
    level: str = ""


def _around(angles: str, levels: str = "") -> dict[int, Arm]:
    """A frame whose motors lie on a circle: per motor its angle, with `+` where it turns counter-clockwise."""
    arms = {}
    for number, text in enumerate(angles.split(), start=1):
        angle, spin = float(text[:-1]), 1.0 if text.endswith("+") else -1.0
        level = {"u": "upper", "l": "lower"}[levels[number - 1]] if levels else ""
        arms[number] = Arm(angle, -math.sin(math.radians(angle)), math.cos(math.radians(angle)), spin, level)
    return _scaled(arms)


def _at(places: str, levels: str = "") -> dict[int, Arm]:
    """A frame given by factors: per motor `roll,pitch,yaw`."""
    arms = {}
    for number, text in enumerate(places.split(), start=1):
        roll, pitch, yaw = (float(part) for part in text.split(","))
        level = {"u": "upper", "l": "lower"}[levels[number - 1]] if levels else ""
        arms[number] = Arm(math.degrees(math.atan2(-roll, pitch)), roll, pitch, yaw, level)
    return _scaled(arms)


def _scaled(arms: dict[int, Arm]) -> dict[int, Arm]:
    """Factors of each axis with the largest brought to 0.5."""
    roll = max(abs(arm.roll) for arm in arms.values())
    pitch = max(abs(arm.pitch) for arm in arms.values())
    yaw = max(abs(arm.yaw) for arm in arms.values())
    return {
        number: arm._replace(roll=arm.roll / roll / 2, pitch=arm.pitch / pitch / 2, yaw=arm.yaw / yaw / 2)
        for number, arm in arms.items()
    }


_V_YAW = 0.7981
_TAIL = math.sin(math.radians(60)), math.cos(math.radians(60)), math.cos(math.radians(160))


def _tail(spin: int) -> dict[int, Arm]:
    """V-tail (spin -1) and A-tail (1) quads: the front motors roll, the rear ones yaw."""
    side, front, rear = _TAIL
    return _at(f"{-side},{front},0 0,{rear},{spin} {side},{front},0 0,{rear},{-spin}")


_STACKED = "uuuullll"
_TWELVE = "ul" * 6

FRAMES: Mapping[tuple[int, int], Mapping[int, Arm]] = {
    (_QUAD, 0): _around("90+ -90+ 0- 180-"),
    (_QUAD, 1): _around("45+ -135+ -45- 135-"),
    (_QUAD, 2): _at(f"-1,1,{_V_YAW} 1,-1,1 1,1,-{_V_YAW} -1,-1,-1"),
    (_QUAD, 3): _around("45- -135- -45+ 135+"),
    (_QUAD, 4): _tail(-1),
    (_QUAD, 5): _tail(1),
    (_QUAD, 12): _around("135- 45+ -135+ -45-"),
    (_QUAD, 13): _around("45+ -45- -135+ 135-"),
    (_QUAD, 14): _around("45+ 135- -135+ -45-"),
    (_QUAD, 18): _around("135+ 45- -135- -45+"),
    (_QUAD, 19): _at("-1,1,1 0,-1,-1 0,-1,1 1,1,-1"),
    (_HEXA, 0): _around("0- 180+ -120- 60+ -60+ 120-"),
    (_HEXA, 1): _around("90- -90+ -30- 150+ 30+ -150-"),
    (_HEXA, 3): _at("-1,0,-1 1,0,1 1,1,-1 -1,-1,1 -1,1,1 1,-1,-1"),
    (_HEXA, 13): _around("30+ -30- -90+ -150- 150+ 90-"),
    (_HEXA, 14): _around("30+ 90- 150+ -150- -90+ -30-"),
    (_OCTA, 0): _around("0- 180- 45+ 135+ -45+ -135+ -90- 90-"),
    (_OCTA, 1): _around("22.5- -157.5- 67.5+ 157.5+ -22.5+ -112.5+ -67.5- 112.5-"),
    (_OCTA, 3): _at("-1,1,-1 1,-1,-1 -1,.333,1 -1,-1,1 1,1,1 1,-.333,1 1,.333,-1 -1,-.333,-1"),
    (_OCTA, 13): _around("22.5+ -22.5- -67.5+ -112.5- -157.5+ 157.5- 112.5+ 67.5-"),
    (_OCTA, 14): _around("22.5+ 67.5- 112.5+ 157.5- -157.5+ -112.5- -67.5+ -22.5-"),
    (_OCTA, 15): _at(".333,-1,-1 -.333,1,-1 1,-1,1 .333,1,1 -.333,-1,1 -1,1,1 -1,-1,-1 1,1,-1"),
    (_OCTAQUAD, 0): _around("0+ -90- 180+ 90- -90+ 0- 90+ 180-", _STACKED),
    (_OCTAQUAD, 1): _around("45+ -45- -135+ 135- -45+ 45- 135+ -135-", _STACKED),
    (_OCTAQUAD, 3): _around("45- -45+ -135- 135+ -45- 45+ 135- -135+", _STACKED),
    (_Y6, 0): _at("-1,.666,1 1,.666,-1 1,.666,1 0,-1.333,-1 -1,.666,-1 0,-1.333,1"),
    (_Y6, 10): _at("-1,.5,-1 -1,.5,1 0,-1,-1 0,-1,1 1,.5,-1 1,.5,1", "ululul"),
    (_Y6, 11): _at("0,-1,1 -1,.5,1 1,.5,1 0,-1,-1 -1,.5,-1 1,.5,-1"),
    (_DODECAHEXA, 0): _around("0+ 0- 60- 60+ 120+ 120- 180- 180+ -120+ -120- -60- -60+", _TWELVE),
    (_DODECAHEXA, 1): _around("30+ 30- 90- 90+ 150+ 150- -150- -150+ -90+ -90- -30- -30+", _TWELVE),
}
"""(FRAME_CLASS, FRAME_TYPE) -> motor number -> its arm."""

TRICOPTER: Mapping[int, Arm] = {1: Arm(60, -0.5, 0.5, 0), 2: Arm(-60, 0.5, 0.5, 0), 4: Arm(180, 0, -0.5, 0)}
"""Yaw comes from the servo of the rear motor; the front motors' angles are those of a tricopter with equal arms."""


def frame_of(settings: Driven, motors: int | None = None) -> tuple[int | None, int | None]:
    """Class and type of a frame by its parameters; firmware before 3.5 has no class, which `motors` may tell."""
    prefix = "Q_" if code(settings, "Q_ENABLE") in (1, 2) else ""
    frame_class, frame_type = code(settings, f"{prefix}FRAME_CLASS"), code(settings, f"{prefix}FRAME_TYPE")
    if frame_class is None and code(settings, "FRAME") is not None:
        return _BY_MOTORS.get(motors or 0), code(settings, "FRAME")
    return frame_class, frame_type


def arms_of(frame_class: int | None, frame_type: int | None) -> Mapping[int, Arm]:
    """The arms of a frame by motor number, empty where the frame is not in the tables."""
    if frame_class == _TRI:
        return TRICOPTER
    if frame_class == _Y6 and frame_type not in (10, 11):
        frame_type = 0
    return FRAMES.get((frame_class or 0, -1 if frame_type is None else frame_type), {})
