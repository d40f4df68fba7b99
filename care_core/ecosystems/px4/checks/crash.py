"""Control that was lost in the air, and a contact with the ground at speed: a fall, or as it was steered."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.base import Check
from care_core.ecosystems.findings import IDLED, STEERED, Finding
from care_core.ecosystems.px4 import upset
from care_core.ecosystems.px4.flight import Px4Flight
from care_core.ecosystems.px4.upset import LEFT_DEG, LIMITS
from care_core.logs.base import Wanted, merge_needs
from care_core.numbers import Floats, median

_STICKS = "manual_control_setpoint"
READS: Wanted = merge_needs((upset.READS, {_STICKS: ("z", "throttle")}))
_STICK_LOW = LIMITS.add(
    "throttle stick near its bottom",
    0.25,
    "of its way",
    "MPC_THR_CURVE: in the middle it hovers, at half of that it falls",
)
_STEERS_S = LIMITS.add("time before the ground in which it is there", 2.0, "s", "free fall: 20 m")
_LETS_GO_S = LIMITS.add("last of that, in which a pilot may pull up", 0.5, "s", "a choice: motors answer later")
_BY_THROTTLE = frozenset((0, 10, 15))
"""Modes in which the stick is the thrust: manual, acro, stabilized (vehicle_status.msg)."""
_IDLES_S = LIMITS.add(
    "time before control is lost in which it is there", 0.4, "s", "a choice: who sees it tip is later"
)
_LOST_P = LIMITS.add("probability of gains, control lost", 0.85, "", "training flights: 14 of 15, else a motor")
_STEERED_P = LIMITS.add("probability that its stick brought it down", 0.9, "", "a choice: it may have been falling")
_CRASHED_P = LIMITS.add("probability that a part broke", 0.1, "", "a choice: a crash says that it failed, hardly why")


def find(flight: Px4Flight) -> Iterator[Finding]:
    lost, hit = upset.lost_control(flight), upset.hit(flight)
    if lost is not None:
        stick = _thrust_stick(flight, (lost.time_s - _IDLES_S, lost.time_s))
        idled = len(stick) > 0 and bool(np.all(stick < _STICK_LOW))
        idle = "; motors that idle hold no attitude" if idled else ""
        yield Finding(
            kind="attitude",
            title=IDLED if idled else "control was lost",
            onset_s=lost.time_s,
            end_s=flight.end_s if hit is None else max(hit.time_s, lost.time_s),
            severity="critical",
            evidence=f"the attitude is up to {lost.most_deg:.0f} deg off its target and does not recover{idle}",
            source=f"vehicle_attitude, vehicle_attitude_setpoint; above {LEFT_DEG:g} deg",
            suspect="operation" if idled else "parameter",
            probability=_LOST_P,
        )
    if hit is not None:
        stop = "stayed there" if hit.blow is None else f"felt a blow of {hit.blow:.0f} m/s^2"
        steered = lost is None and _is_down(_thrust_stick(flight, (hit.time_s - _STEERS_S, hit.time_s - _LETS_GO_S)))
        told = "; the throttle stick was near its bottom and the attitude followed its demand" if steered else ""
        yield Finding(
            kind="crash",
            title=STEERED if steered else f"it hit the ground at {hit.speed_ms:.1f} m/s",
            onset_s=hit.time_s,
            end_s=hit.time_s,
            severity="critical",
            evidence=f"it came down at {hit.speed_ms:.1f} m/s and {stop}{told}",
            source="vehicle_local_position.z, sensor_combined, manual_control_setpoint",
            suspect="operation" if steered else "hardware",
            probability=_STEERED_P if steered else _CRASHED_P,
        )


def _thrust_stick(flight: Px4Flight, span: tuple[float, float]) -> Floats:
    """Where the stick was that is the thrust itself, 0 to 1; nothing where another mode was in force."""
    if _BY_THROTTLE.issuperset(flight.modes_during(span)):
        for field, bottom, way in (("z", 0.0, 1.0), ("throttle", -1.0, 2.0)):  # before 1.14, and since
            sticks = flight.during(_STICKS, field, span)
            if sticks is not None and len(sticks) > 1:
                return (sticks[field] - bottom) / way
    return np.empty(0)


def _is_down(stick: Floats) -> bool:
    return len(stick) > 0 and float(median(stick)) < _STICK_LOW


CHECK = Check("crash", "control lost in the air, a contact with the ground at speed", READS, LIMITS, find)
