"""Calibrations that no sensor needs. PX4 writes them itself, so a log holds no default of them: what a sound sensor may
need tells them from those that somebody set, or that went wrong."""

from __future__ import annotations

import re

_AXES = "XYZ"
_SENSORS = 4
"""How many of a kind PX4 calibrates."""
_ENDS = {"CAL_ACC": ("OFF", "SCALE"), "CAL_GYRO": ("OFF", "SCALE"), "CAL_MAG": ("OFF", "SCALE", "ODIAG")}
_USUAL = (
    (re.compile(r"CAL_(ACC|GYRO)\d_[XYZ]SCALE"), 1.0, 0.2, 0.2),
    (re.compile(r"CAL_MAG\d_[XYZ]SCALE"), 1.0, 0.95, 0.2),
    (re.compile(r"CAL_ACC\d_[XYZ]OFF"), 0.0, 6.0, 0.5),
    (re.compile(r"CAL_GYRO\d_[XYZ]OFF"), 0.0, 0.4, 0.1),
    (re.compile(r"CAL_MAG\d_[XYZ]OFF"), 0.0, 3.0, 0.2),
    (re.compile(r"CAL_MAG\d_[XYZ]ODIAG"), 0.0, 0.5, 0.2),
    (re.compile(r"CAL_MAG\d_PRIO"), 75.0, 74.0, 74.0),  # 0 and -1 leave a compass out; 75 is an external one's
)
"""What a sensor without errors needs, and how far from it one is at most, of an autopilot and of a simulator: shares,
m/s^2, rad/s, gauss. In some 200 logs scales of accelerometers are 0.96 to 1.06 and of compasses 0.12 to 1.22,
offsets up to 3.8 m/s^2, 0.12 rad/s and 1.15 gauss, off the diagonal up to 0.18."""


def calibrations(of: str) -> tuple[str, ...]:
    """The names of all calibrations of `CAL_ACC`, `CAL_GYRO` or `CAL_MAG`; none of anything else."""
    ends = _ENDS.get(of, ())
    return tuple(f"{of}{n}_{axis}{end}" for n in range(_SENSORS) for axis in _AXES for end in ends)


def is_calibration(name: str) -> bool:
    """Whether PX4 writes it itself as it calibrates: being off a default says nothing of it."""
    return any(pattern.fullmatch(name) for pattern, *_ in _USUAL)


def usual(name: str, value: float, *, is_simulated: bool) -> float | None:
    """What a sensor without errors needs in place of a value that none needs; None where it may be right."""
    for pattern, sound, most, simulated in _USUAL:
        if pattern.fullmatch(name):
            return None if abs(value - sound) <= (simulated if is_simulated else most) else sound
    return None
