"""An attitude that a rover or a boat does not have: its accelerometers feel gravity elsewhere.

On the ground and on water they feel little else, so over some seconds they tell which way is down. In the air lift acts
along the vehicle's own axis, and they feel level however it leans.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.ardupilot.checks.settings import gravity
from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.ardupilot.statistics import lasting, smooth
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.geodesy import GRAVITY
from care_core.logs.base import Wanted
from care_core.numbers import Floats, median

READS: Wanted = {"ATT": ("Roll", "Pitch"), "IMU": gravity.AXES}

LIMITS = Limits()
_APART_DEG = LIMITS.add("lean that gravity contradicts", 30.0, "deg", "a choice: three times what AHRS_TRIM corrects")
_OFF = LIMITS.add("what is felt beside gravity", 0.7, "m/s^2", "a choice: a rover brakes with more, for a moment")
_OVER_S = LIMITS.add("window over which gravity is felt", 3.0, "s", "a choice: jolts and turns cancel over it")
_LASTS_S = LIMITS.add("shortest lean of this kind", 5.0, "s", "a choice: an estimate that starts is right sooner")
_P = LIMITS.add("probability of a part", 0.6, "", "a choice: gyros, their calibration, or how the board is mounted")


def find(flight: Flight) -> Iterator[Finding]:
    """One finding over all the time in which attitude and gravity are so far apart."""
    attitude, felt = flight.one("ATT", "Roll", "Pitch"), flight.one("IMU", *gravity.AXES)
    if flight.kind != "rover" or attitude is None or felt is None:
        return
    t = attitude.t
    pull = np.array([np.interp(t, felt.t, smooth(felt.t, -felt[axis], _OVER_S)) for axis in gravity.AXES])
    down = _down(*(np.radians(smooth(t, attitude[name], _OVER_S)) for name in ("Roll", "Pitch")))
    size = np.linalg.norm(pull, axis=0)
    apart = np.degrees(np.arccos(np.clip((pull * down).sum(axis=0) / np.maximum(size, 1e-9), -1.0, 1.0)))
    spans = lasting(t, (apart > _APART_DEG) & (np.abs(size - GRAVITY) < _OFF), _LASTS_S)
    if not spans:
        return
    start, end = spans[0][0], spans[-1][1]
    inside = (t >= start) & (t <= end) & (apart > _APART_DEG)
    leans = np.degrees(np.arccos(np.clip(down[2], -1.0, 1.0)))
    yield Finding(
        kind="estimator",
        title="the estimated attitude is wrong",
        onset_s=start,
        end_s=end,
        severity="critical",
        evidence=(
            f"it leans {float(median(leans[inside])):.0f} deg, and its accelerometers feel gravity "
            f"{float(median(apart[inside])):.0f} deg from there (limit {_APART_DEG:g}), for {end - start:.0f} s"
        ),
        source="ATT, IMU",
        suspect="hardware",
        probability=_P,
    )


def _down(roll: Floats, pitch: Floats) -> Floats:
    """The direction of gravity in a body that leans so, of length 1, shape (3, n)."""
    return np.array([-np.sin(pitch), np.sin(roll) * np.cos(pitch), np.cos(roll) * np.cos(pitch)])


CHECK = Check("leaning", "an attitude that gravity contradicts, of rovers and boats", READS, LIMITS, find)
