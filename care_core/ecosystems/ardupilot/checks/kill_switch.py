"""Motors that stop in the air: by the emergency switch, or since the vehicle is disarmed."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.ardupilot.checks import drop
from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import DROPPED, STOPPED, Finding
from care_core.ecosystems.spans import within
from care_core.logs.base import Wanted

_CHANNELS = range(5, 15)
READS: Wanted = {"EV": ("Id",), "RCIN": tuple(f"C{n}" for n in _CHANNELS)}
LIMITS = Limits(drop.LIMITS)
_HIGH_US = LIMITS.add("pulse of a switch that is on", 1800.0, "us", "RC_Channel.h: AUX_SWITCH_PWM_TRIGGER_HIGH")
_OFF_US = LIMITS.add("pulse of a switch that is off", 1200.0, "us", "RC_Channel.h: AUX_SWITCH_PWM_TRIGGER_LOW")
_ALOFT_M = LIMITS.add("height", 1.0, "m", "a choice: lower, a landing leg may touch")
_FALLS_S = LIMITS.add("time in which it falls", 2.0, "s", "from 1 m a free fall takes half a second")
_FALLS_M = LIMITS.add("fall", 0.5, "m", "half of the least height; what lies keeps its height")
_DROPPED_P = LIMITS.add("probability that it came down by that", 0.9, "", "nothing else carries it")
_FORCED_P = LIMITS.add(
    "the same, of what somebody forced", 0.1, "", "a choice: who cuts motors in the air has a reason"
)
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
            probability=_DROPPED_P,
        )
    elif (fall := drop.drop_of(flight)) is not None:
        yield Finding(
            kind="crash",
            title=fall.title,
            onset_s=fall.time_s,
            end_s=flight.end_s,
            severity="critical",
            evidence=f"{fall.height_m:.1f} m up, and it lost {fall.fell_m:.1f} m of that within a second or two"
            + ("; somebody forced it, for what came before" if fall.is_forced else ""),
            source=f"{'ARM' if fall.title == DROPPED else 'RCOU, MODE'}; the vehicle's height",
            suspect="operation",
            probability=_FORCED_P if fall.is_forced else _DROPPED_P,
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


CHECK = Check(
    "kill switch",
    "motors that stop in the air: by the emergency switch, or since the vehicle is disarmed",
    READS,
    LIMITS,
    find,
)
