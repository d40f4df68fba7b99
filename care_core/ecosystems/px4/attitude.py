"""How a vehicle leaned, and how it was to lean, as series: from quaternions, whatever the heading.

A lean is the direction of down in the frame of the body: forward and right parts are positive where that side is low.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from care_core.logs.base import Table, Wanted
from care_core.numbers import Floats

ATTITUDE, WANTED = "vehicle_attitude", "vehicle_attitude_setpoint"
_Q, _Q_D = (tuple(f"{name}[{n}]" for n in range(4)) for name in ("q", "q_d"))
READS: Wanted = {ATTITUDE: _Q, WANTED: _Q_D}

_KNOWN_S = 1.0
"""A target that was not published for so long is none: nobody asks for an attitude."""
_OFF_UNIT = 0.1
"""Quaternions are of length 1; records round them."""


class Lean(NamedTuple):
    """What the attitude was, at the times `t`."""

    t: Floats
    tilt_deg: Floats
    """From level."""
    error_deg: Floats
    """Between the thrust direction wanted and the one there is; not a number where none is wanted."""
    off: Floats
    """Shape (2, n): forward and right parts of the lean off the one wanted."""


def lean_of(attitude: Table | None, wanted: Table | None) -> Lean | None:
    """The lean of a vehicle, None where the log lacks its attitude."""
    if attitude is None or not set(_Q) <= attitude.columns.keys():
        return None
    t, down = attitude.t, _down(attitude, _Q)
    tilt = np.degrees(np.arccos(np.clip(down[2], -1.0, 1.0)))
    target = np.full_like(down, np.nan)
    if wanted is not None and len(wanted) and set(_Q_D) <= wanted.columns.keys():
        at = np.searchsorted(wanted.t, t, side="right") - 1
        known = (at >= 0) & (t - wanted.t[np.maximum(at, 0)] < _KNOWN_S)
        target[:, known] = _down(wanted, _Q_D)[:, at[known]]
    error = np.degrees(np.arccos(np.clip((down * target).sum(axis=0), -1.0, 1.0)))
    return Lean(t, tilt, error, down[:2] - np.nan_to_num(target[:2]))


def _down(table: Table, names: tuple[str, ...]) -> Floats:
    """The direction of down in the frame of the body, shape (3, n); not a number where damage left no rotation."""
    told = np.array([table[name] for name in names])
    with np.errstate(over="ignore", invalid="ignore"):
        is_rotation = np.abs(np.sum(told**2, axis=0) - 1.0) < _OFF_UNIT
    w, x, y, z = np.where(is_rotation, told, np.nan)
    return np.stack((2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x**2 + y**2)))
