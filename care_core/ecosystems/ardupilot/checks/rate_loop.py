"""What makes the rate controllers late where they swing: a main loop that was set slow, a notch in the band that they
control."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from care_core.ecosystems.ardupilot.checks.attitude import swings
from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.spans import during
from care_core.logs.base import Wanted
from care_core.numbers import median

READS: Wanted = {"PM": ("LR", "NL")}

LIMITS = Limits()
_SLOW = LIMITS.add(
    "main loop, as a share of what it is shipped with", 0.5, "", "gains as shipped leave no more room (ArduPilot wiki)"
)
_IN_BAND_HZ = LIMITS.add("notch in the band of the rate controllers", 30.0, "Hz", "INS_HNTCH_FREQ is 80 as shipped")
_SURE_P = LIMITS.add(
    "probability of what makes them late, where they swing",
    0.9,
    "",
    "a choice: the swing is what such a delay brings, and gains may be raised as well",
)
_PM_S = 10.0
"""PM.NL counts the loops of so long (AP_Scheduler)."""
_LOOP_HZ, _NOTCH_HZ = 400.0, 80.0
"""SCHED_LOOP_RATE and INS_HNTCH_FREQ as shipped (AP_Scheduler.cpp, HarmonicNotchFilter.cpp)."""


class _Late(NamedTuple):
    """A parameter that makes the controllers late, in words."""

    parameter: str
    wanted: float
    title: str
    shown: str


def find(flight: Flight) -> Iterator[Finding]:
    """The parameter, where roll or pitch swings."""
    late = next((one for one in (_slow_loop(flight), *_low_notches(flight)) if one is not None), None)
    if late is None or not flight.is_copter or not flight.flown:
        return
    swing = next(swings(flight), None)
    if swing is None:
        return
    yield Finding(
        kind="cpu",
        title=late.title,
        onset_s=min(swing.onset_s, flight.armed[0][0]),
        end_s=swing.end_s,
        severity="critical" if swing.severity == "critical" else "warning",
        evidence=f"{late.shown}; {swing.title}: {swing.evidence}",
        source="PM.LR, NL; RATE; PARM",
        suspect="parameter",
        probability=_SURE_P,
        mission_lost=None if swing.severity == "critical" else swing.probability,
        parameters=(late.parameter,),
        wanted=((late.parameter, late.wanted),),
    )


def _slow_loop(flight: Flight) -> _Late | None:
    told, usual = flight.setting("SCHED_LOOP_RATE"), _shipped(flight, "SCHED_LOOP_RATE", _LOOP_HZ)
    if not told or told > _SLOW * usual:
        return None
    ran = _loop_hz(flight)
    measured = "" if ran is None else f", and the main loop ran at {ran:.0f} Hz"
    return _Late(
        "SCHED_LOOP_RATE", usual, "the main loop is set too slow for the rate controllers",
        f"SCHED_LOOP_RATE is {told:g} (default {usual:g}){measured}",
    )  # fmt: skip


def _loop_hz(flight: Flight) -> float | None:
    """How often the main loop ran a second, None where the log does not say."""
    for field, per_s in (("LR", 1.0), ("NL", 1 / _PM_S)):
        table = flight.one("PM", field)
        counts = np.zeros(0) if table is None else table[field][during(flight.flown, table.t)]
        if len(counts) and counts.any():
            return float(median(counts)) * per_s
    return None


def _low_notches(flight: Flight) -> Iterator[_Late]:
    for notch in ("INS_HNTCH", "INS_HNTC2"):
        name = f"{notch}_FREQ"
        told, usual = flight.setting(name), _shipped(flight, name, _NOTCH_HZ)
        if flight.setting(f"{notch}_ENABLE") == 1 and told and told <= _IN_BAND_HZ < usual:
            yield _Late(
                name, usual, "a notch filter makes the rate controllers late",
                f"{name} is {told:g} Hz (default {usual:g}), within what they control",
            )  # fmt: skip


def _shipped(flight: Flight, name: str, usual: float) -> float:
    """What the log says that a parameter is as shipped, else what ArduPilot's is."""
    history = flight.settings.get(name, ())
    said = history[0].default if history else None
    return float(said) if isinstance(said, (int, float)) else usual


CHECK = Check("rate_loop", "what makes rate controllers late that swing", READS, LIMITS, find)
