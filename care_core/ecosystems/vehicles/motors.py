"""Which output drives which motor, and where that motor is."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence

from care_core.ecosystems.vehicles.frames import Arm, arms_of, frame_of
from care_core.ecosystems.vehicles.settings import Driven, code
from care_core.metadata.output_functions import LEFT, MOTORS, RIGHT, STEERING
from care_core.records import Record

_DRIVEN = {function: motor for motor, function in MOTORS.items()}
"""SERVOn_FUNCTION -> motor number."""
_ARDUPILOT_FUNCTION, _PX4_FUNCTION = re.compile(r"SERVO\d+_FUNCTION"), re.compile(r"\w+_FUNC\d+")
_OUTPUTS = 32
_ON_AXIS_DEG = 10.0


class Motor(Record):
    """A motor of a multicopter. Factors are the shares of a demand that it gives, at most 0.5; see `frames`."""

    number: int
    output: int
    """Number of its output: column `C<output>` of RCOU."""
    angle_deg: float
    """Clockwise from the nose."""
    roll: float
    pitch: float
    yaw: float
    place: str
    """In words: "front right", "upper rear left"."""


def motor_outputs(settings: Driven) -> dict[int, int]:
    """Motor number -> output number, as SERVOn_FUNCTION says; empty where no parameter does (firmware before 3.5)."""
    outputs: dict[int, int] = {}
    for output in range(1, _OUTPUTS + 1):
        function = code(settings, f"SERVO{output}_FUNCTION")
        if function in _DRIVEN:
            outputs.setdefault(_DRIVEN[function], output)
    return outputs


def switched_off(parameter: str, before: float | str, after: float | str) -> int | None:
    """The motor that a change of an output's function leaves without one, None where it is none: SERVOn_FUNCTION of
    ArduPilot, and of PX4 PWM_MAIN_FUNCn and its like, where Motor1 to Motor12 are 101 to 112."""
    if not isinstance(before, (int, float)) or before == after:
        return None
    if _ARDUPILOT_FUNCTION.fullmatch(parameter):
        return _DRIVEN.get(int(before))
    is_motor = _PX4_FUNCTION.fullmatch(parameter) is not None and before in range(101, 113)
    return int(before) - 100 if is_motor else None


def is_skid_steered(settings: Driven) -> bool | None:
    """Whether a ground vehicle steers by driving its sides apart, rather than by a steered wheel or rudder; None where
    no parameter says."""
    functions = {code(settings, f"SERVO{output}_FUNCTION") for output in range(1, _OUTPUTS + 1)}
    if {LEFT, RIGHT} <= functions:
        return True
    return False if STEERING in functions else None


def motors_of(settings: Driven, motors: int | None = None) -> tuple[Motor, ...]:
    """The motors of a multicopter or a quadplane with their outputs, in order of number.

    Empty where the frame is unknown, or its outputs do not drive its motors. `motors` is the number of motor outputs
    that the log records, which old firmware needs (see `vehicle_of`).
    """
    arms = arms_of(*frame_of(settings, motors))
    outputs = motor_outputs(settings)
    if not any(name.startswith("SERVO") and name.endswith("_FUNCTION") for name in settings):
        outputs = {number: number for number in arms}  # as firmware before 3.5 has them
    if not arms or not arms.keys() <= outputs.keys():
        return ()
    places = _places(arms)
    return tuple(
        Motor(number, outputs[number], arm.angle_deg, arm.roll, arm.pitch, arm.yaw, places[number])
        for number, arm in sorted(arms.items())
    )


def motors_at(angles_deg: Sequence[float]) -> tuple[Motor, ...]:
    """Motors of which no more is known than where they sit, clockwise from the nose; outputs in their order."""
    arms = {n: Arm((angle + 180) % 360 - 180, 0.0, 0.0, 0.0) for n, angle in enumerate(angles_deg, start=1)}
    places = _places(arms)
    return tuple(Motor(n, n, arm.angle_deg, 0.0, 0.0, 0.0, places[n]) for n, arm in arms.items())


def _places(arms: Mapping[int, Arm]) -> dict[int, str]:
    """Per motor its place in words; two motors of one word (an octocopter has them) are told apart by their angle."""
    words = {n: " ".join(filter(None, (arm.level, _side(arm.angle_deg)))) for n, arm in arms.items()}
    spots = {(words[n], round(arm.angle_deg)) for n, arm in arms.items()}
    alike = Counter(word for word, _ in spots)
    return {
        n: word if alike[word] == 1 else f"{word}, {abs(arms[n].angle_deg):.0f} degrees from the nose"
        for n, word in words.items()
    }


def _side(angle_deg: float) -> str:
    """Where an angle from the nose points: one of the four axes, else the corner between two."""
    from_nose = abs((angle_deg + 180) % 360 - 180)
    along = "front" if from_nose < 90 - _ON_AXIS_DEG else "rear" if from_nose > 90 + _ON_AXIS_DEG else ""
    is_across = _ON_AXIS_DEG < from_nose < 180 - _ON_AXIS_DEG
    across = ("right" if angle_deg % 360 < 180 else "left") if is_across else ""
    return " ".join(filter(None, (along, across)))
