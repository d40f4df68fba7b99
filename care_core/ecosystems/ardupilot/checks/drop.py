"""A fall from the air once the motors stop: it was disarmed there, or its outputs went to their least."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from care_core.ecosystems.ardupilot.flight import BY_STICK, Flight
from care_core.ecosystems.base import Limits
from care_core.ecosystems.findings import CLOSED, CUT, DROPPED
from care_core.ecosystems.spans import during, runs
from care_core.ecosystems.vehicles.motors import motors_of
from care_core.numbers import Floats

LIMITS = Limits()
_DISARMED_M = LIMITS.add("height at which it is disarmed", 2.0, "m", "a choice: what came down on a slope stands lower")
_DROPS_M = LIMITS.add("fall after it", 2.0, "m", "a choice: a height that is estimated drifts by less")
_DROPS_S = LIMITS.add("time of that fall", 1.5, "s", "from 2 m it takes 0.6 s; who carries it down takes longer")
_WITHIN_S = LIMITS.add("time within which it begins", 10.0, "s", "a choice: telemetry of a busy link is late")
_SILENT_S = LIMITS.add("age of the last height before it", 5.0, "s", "a choice: the same, and it hovers on meanwhile")
_CALM_MS = LIMITS.add("descent before it", 2.0, "m/s", "LAND_SPEED_HIGH as shipped: what falls already is no drop")
_STILL_US = LIMITS.add("output above its least that turns no motor", 10.0, "us", "MOT_SPIN_ARM as shipped: 100 us")
_CUT_S = LIMITS.add("shortest time of motors that stopped", 0.3, "s", "a choice: more than one record")
_STEP = LIMITS.add("share of the fall in one record", 0.7, "", "a choice: a height that is set anew is one step")
_IDLES = LIMITS.add("share of the range at which motors idle", 0.1, "", "MOT_SPIN_ARM as shipped, where not recorded")
_LEAST_US, _MOST_US, _FEWEST = 1000.0, 2000.0, 3
"""Pulse of a motor that stands, where no parameter tells it, and records of its height that tell of a fall."""


class Drop(NamedTuple):
    """When its motors stopped and by what, how high it was then, and how far it fell at once."""

    time_s: float
    title: str
    height_m: float
    fell_m: float
    is_forced: bool
    """Whether somebody disarmed it against all checks."""


def drop_of(flight: Flight) -> Drop | None:
    """The first such fall; None where there was none, or no height tells."""
    if flight.height is None:
        return None
    disarmed = [(one.time_s, DROPPED, bool(one.is_forced)) for one in flight.arm_changes if not one.is_armed]
    stops = sorted([*disarmed, *((t, title, False) for t, title in _stopped(flight))])
    drops = (_fall(flight.height, *stop) for stop in stops)
    return next((drop for drop in drops if drop is not None), None)


def _stopped(flight: Flight) -> Iterator[tuple[float, str]]:
    """When the outputs of all motors of a copter went to their least while it was armed, and stayed there: the least
    that they turn at in the air is more; or to idling by the pilot's stick, until it was lost. Wings carry a QuadPlane
    without them."""
    table, motors = flight.one("RCOU"), motors_of(flight.settings, flight.motor_outputs)
    columns = [f"C{motor.output}" for motor in motors]
    if not flight.is_copter or table is None or not columns or not set(columns) <= table.columns.keys():
        return
    least = flight.setting("MOT_PWM_MIN", "Q_M_PWM_MIN") or _LEAST_US
    idling_us = ((flight.setting("MOT_PWM_MAX") or _MOST_US) - least) * (flight.setting("MOT_SPIN_ARM") or _IDLES)
    highest = np.max([table[column] for column in columns], axis=0)
    is_armed = during(flight.armed, table.t)
    for start, end in runs(table.t, is_armed & (highest <= least + _STILL_US)):
        if end - start >= _CUT_S:
            yield start, CUT
    by_stick = np.isin(flight.modes_at(table.t), BY_STICK)
    lost = flight.lost_control_s if flight.lost_control_s is not None else flight.impact_s
    for start, end in runs(table.t, is_armed & by_stick & (highest <= least + idling_us + _STILL_US)):
        if lost is not None and end - start >= _CUT_S and start <= lost <= end:
            yield start, CLOSED


def _fall(height: tuple[Floats, Floats], at: float, title: str, is_forced: bool) -> Drop | None:
    """The fall that follows at once on motors that stop; None where none does. Where nothing told of its height for a
    while, the record that comes then tells from where it falls."""
    t, metres = height
    last = int(np.searchsorted(t, at, side="right")) - 1
    is_silent = last < 0 or at - t[last] > _SILENT_S
    if is_silent and last + 1 < len(t) and t[last + 1] - at < _DROPS_S and title == CUT:
        at, last = float(t[last + 1]), last + 1
    elif is_silent:
        return None
    after = (t > at) & (t <= at + _WITHIN_S)
    high_m, before_m = float(metres[last]), float(np.interp(t[last] - _DROPS_S, t, metres))
    sinks = not is_silent and before_m - high_m > _CALM_MS * _DROPS_S
    if np.count_nonzero(after) < _FEWEST or high_m < _DISARMED_M or sinks:
        return None
    fell_m = _largest_fall(np.append(at, t[after]), np.append(high_m, metres[after]))
    return Drop(at, title, high_m, fell_m, is_forced) if fell_m > _DROPS_M else None


def _largest_fall(t: Floats, height: Floats) -> float:
    """The largest loss of height within the time of a fall that is no single step, m."""
    most = 0.0
    for n in range(len(t)):
        inside = height[n : int(np.searchsorted(t, t[n] + _DROPS_S, side="right"))]
        lost = float(inside[0] - inside.min())
        step = float(np.max(inside[:-1] - inside[1:])) if len(inside) > 1 else 0.0
        if step < _STEP * lost:
            most = max(most, lost)
    return most
