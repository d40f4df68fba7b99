"""Motors that stop in the air: by the emergency switch, or since the vehicle is disarmed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import DROPPED, STOPPED, Finding
from care_core.ecosystems.spans import within
from care_core.logs.base import Wanted
from care_core.numbers import Floats

_CHANNELS = range(5, 15)
READS: Wanted = {"EV": ("Id",), "RCIN": tuple(f"C{n}" for n in _CHANNELS)}
LIMITS = Limits()
_HIGH_US = LIMITS.add("pulse of a switch that is on", 1800.0, "us", "RC_Channel.h: AUX_SWITCH_PWM_TRIGGER_HIGH")
_OFF_US = LIMITS.add("pulse of a switch that is off", 1200.0, "us", "RC_Channel.h: AUX_SWITCH_PWM_TRIGGER_LOW")
_ALOFT_M = LIMITS.add("height", 1.0, "m", "a choice: lower, a landing leg may touch")
_FALLS_S = LIMITS.add("time in which it falls", 2.0, "s", "from 1 m a free fall takes half a second")
_FALLS_M = LIMITS.add("fall", 0.5, "m", "half of the least height; what lies keeps its height")
_DISARMED_M = LIMITS.add("height at which it is disarmed", 2.0, "m", "a choice: what came down on a slope stands lower")
_DROPS_M = LIMITS.add("fall after it", 2.0, "m", "a choice: a height that is estimated drifts by less")
_DROPS_S = LIMITS.add("time of that fall", 1.5, "s", "from 2 m it takes 0.6 s; who carries it down takes longer")
_WITHIN_S = LIMITS.add("time within which it begins", 10.0, "s", "a choice: telemetry of a busy link is late")
_SILENT_S = LIMITS.add("age of the last height before it", 5.0, "s", "a choice: the same, and it hovers on meanwhile")
_STEP = LIMITS.add("share of the fall in one record", 0.7, "", "a choice: a height that is set anew is one step")
_CALM_MS = LIMITS.add("descent before it", 2.0, "m/s", "LAND_SPEED_HIGH as shipped: what falls already is no drop")
_STOPPED, _EMERGENCY_STOP = 54, 31
"""LogEvent::MOTORS_EMERGENCY_STOPPED, and the function of a switch that stops the motors (RC_Channel.h)."""


def find(flight: Flight) -> Iterator[Finding]:
    """The first time that the switch was thrown while it flew; else that it was disarmed there."""
    if not (flight.is_copter or flight.kind == "quadplane"):
        return
    thrown = sorted((*flight.events(_STOPPED), *_switched(flight)))
    stopped_s = next((t for t in thrown if within(flight.airborne, t)), None)
    height_m = None if stopped_s is None or flight.height is None else float(np.interp(stopped_s, *flight.height))
    if stopped_s is not None and (height_m is None or (height_m > _ALOFT_M and _falls(flight, stopped_s))):
        yield Finding(
            kind="crash",
            title=STOPPED,
            onset_s=stopped_s,
            end_s=flight.end_s,
            severity="critical",
            evidence="its switch was thrown" + ("" if height_m is None else f", {height_m:.1f} m up"),
            source="EV 54; RCIN of the switch with option 31",
            suspect="operation",
            probability=0.9,
        )
    elif (drop := _dropped(flight)) is not None:
        yield Finding(
            kind="crash",
            title=DROPPED,
            onset_s=drop.time_s,
            end_s=flight.end_s,
            severity="critical",
            evidence=f"{drop.height_m:.1f} m up, and it lost {drop.fell_m:.1f} m of that within a second or two",
            source="ARM; the vehicle's height",
            suspect="operation",
            probability=0.9,
        )


def _falls(flight: Flight, stopped_s: float) -> bool:
    """Whether it lost height without its motors; a log that ends before tells nothing against it."""
    assert flight.height is not None
    t, height = flight.height
    after = height[(t > stopped_s) & (t <= stopped_s + _FALLS_S)]
    lasts = len(t) > 0 and float(t[-1]) >= stopped_s + _FALLS_S
    return not lasts or not len(after) or float(np.interp(stopped_s, t, height) - after.min()) > _FALLS_M


def _switched(flight: Flight) -> Iterator[float]:
    """When the switch that stops the motors was thrown, by what the receiver hears."""
    for n in _CHANNELS:
        if flight.setting(f"RC{n}_OPTION", f"CH{n}_OPT") != _EMERGENCY_STOP:
            continue
        heard = flight.one("RCIN", f"C{n}")
        if heard is not None and len(heard) > 1:
            pulse = heard[f"C{n}"]
            yield from heard.t[1:][(pulse[1:] > _HIGH_US) & (pulse[:-1] < _OFF_US)].tolist()


class _Drop(NamedTuple):
    """When it was disarmed, how high it was then, and how far it fell at once."""

    time_s: float
    height_m: float
    fell_m: float


def _dropped(flight: Flight) -> _Drop | None:
    """The first such fall; None where there was none, or no height tells."""
    if not (flight.is_copter or flight.kind == "quadplane") or flight.height is None:
        return None
    t, height = flight.height
    for at in (one.time_s for one in flight.arm_changes if not one.is_armed):
        last = int(np.searchsorted(t, at, side="right")) - 1
        after = (t > at) & (t <= at + _WITHIN_S)
        if last < 0 or at - t[last] > _SILENT_S or np.count_nonzero(after) < 3:
            continue
        high_m, before_m = float(height[last]), float(np.interp(t[last] - _DROPS_S, t, height))
        if high_m < _DISARMED_M or before_m - high_m > _CALM_MS * _DROPS_S:
            continue
        fell_m = _largest_fall(np.append(at, t[after]), np.append(high_m, height[after]))
        if fell_m > _DROPS_M:
            return _Drop(at, high_m, fell_m)
    return None


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


CHECK = Check(
    "kill switch",
    "motors that stop in the air: by the emergency switch, or since the vehicle is disarmed",
    READS,
    LIMITS,
    find,
)
