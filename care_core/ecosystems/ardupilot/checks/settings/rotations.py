"""The mountings of boards and compasses (AP_Math: rotations.h): how each turns a reading into the vehicle's frame."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from care_core.numbers import Floats

_EULER: Mapping[int, tuple[float, float, float]] = {
    **{n: (0, 0, 45 * n) for n in range(8)},
    **{8 + n: (180, 0, 45 * n) for n in range(8)},
    12: (0, 180, 0),
    **{16 + n: (90, 0, 45 * n) for n in range(4)},
    **{20 + n: (270, 0, 45 * n) for n in range(4)},
    24: (0, 90, 0), 25: (0, 270, 0), 26: (0, 180, 90), 27: (0, 180, 270),
    28: (90, 90, 0), 29: (180, 90, 0), 30: (270, 90, 0), 31: (90, 180, 0), 32: (270, 180, 0),
    33: (90, 270, 0), 34: (180, 270, 0), 35: (270, 270, 0), 36: (90, 180, 90), 37: (90, 0, 270),
    38: (90, 68.8, 293.3), 39: (0, 315, 0), 40: (90, 315, 0), 41: (0, 7, 0), 42: (45, 0, 0), 43: (315, 0, 0),
}  # fmt: skip
"""By their number roll, pitch and yaw in degrees, turned in that order."""


def matrix(number: float) -> Floats | None:
    """The rotation of a number, shape (3, 3); None where it is none of the fixed ones."""
    euler = _EULER.get(int(number))
    return None if euler is None else _turn(*euler)


def _turn(roll: float, pitch: float, yaw: float) -> Floats:
    (cr, cp, cy), (sr, sp, sy) = (f(np.radians([roll, pitch, yaw])) for f in (np.cos, np.sin))
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    turned: Floats = about_z @ about_y @ about_x
    return turned
