"""A QuadPlane whose lift motors give all that they may, and which stays on the ground.

What they may give ends where Q_M_PWM_MAX and Q_M_SPIN_MAX end it (AP_MotorsMulticopter: output_to_pwm): of simulated
QuadPlanes of 3 kg none took off with less than 0.65 of the range as shipped.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.ardupilot.spans import during
from care_core.ecosystems.ardupilot.statistics import lasting
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.logs.base import Wanted
from care_core.records import Record
from care_core.run import shown

READS: Wanted = {"QTUN": ("ThO",)}

LIMITS = Limits()
_SPENT = LIMITS.add("throttle of the lift motors", 0.9, "", "a choice: any QuadPlane that can fly rises with less")
_GROUNDED_S = LIMITS.add("such a throttle on the ground", 10.0, "s", "a choice: a take-off takes less")
_KEPT = LIMITS.add("range of the outputs that is left", 0.9, "", "a choice: a share of the range as shipped")
_TOO_LITTLE = LIMITS.add(
    "range of the outputs that surely keeps it down", 0.65, "", "none of the simulated ones flew so"
)
_SURE = LIMITS.add("probability that what ends the outputs keeps it down", 0.9, "", "as a copter's")
_UNSURE = LIMITS.add("the same where nearly all is left", 0.2, "", "as a copter's")
_PART = LIMITS.add("probability of a part where nothing ends them", 0.5, "", "a choice: a load looks the same")
_SHIPPED = {"Q_M_SPIN_MAX": 0.95, "Q_M_PWM_MAX": 2000.0}
_PWM_MIN = 1000.0


class _Kept(Record):
    """What ends the outputs: the share of the range as shipped that it leaves."""

    parameter: str
    value: float
    shipped: float
    share: float


def find(flight: Flight) -> Iterator[Finding]:
    """Lift at its end, and no height."""
    lift = flight.one("QTUN", "ThO")
    if flight.kind != "quadplane" or lift is None or flight.airborne:
        return
    spent = (lift["ThO"] > _SPENT) & during(flight.armed, lift.t)
    spans = lasting(lift.t, spent, _GROUNDED_S, gap_s=5.0)
    if not spans:
        return
    kept, (start, end) = _kept(flight), spans[0]
    ended = "" if kept is None else f"; {kept.parameter} is {shown(kept.value)} (as shipped {kept.shipped:g})"
    yield Finding(
        kind="thrust",
        title="too little thrust to take off",
        onset_s=start,
        end_s=end,
        severity="critical",
        evidence=f"{end - start:.0f} s of all the thrust that the lift motors may give without rising{ended}",
        source="QTUN.ThO, height; PARM",
        suspect="hardware" if kept is None else "parameter",
        probability=_PART if kept is None else float(np.interp(kept.share, (_TOO_LITTLE, _KEPT), (_SURE, _UNSURE))),
        parameters=() if kept is None else (kept.parameter,),
        wanted=() if kept is None else ((kept.parameter, kept.shipped),),
    )


def _kept(flight: Flight) -> _Kept | None:
    """The parameter that leaves the least of the range; None where that is nearly whole."""
    found = []
    for name, usual in _SHIPPED.items():
        value, left = flight.setting(name), flight.default_left(name)
        shipped = left or usual
        idle = _PWM_MIN if name.endswith("PWM_MAX") else 0.0
        if value and shipped > idle:  # a pulse of 0 leaves the range to the receiver's
            found.append(_Kept(name, value, shipped, (value - idle) / (shipped - idle)))
    least = min(found, key=lambda one: one.share, default=None)
    return least if least is not None and least.share < _KEPT else None


CHECK = Check("lift", "a QuadPlane that stays on the ground with all its lift", READS, LIMITS, find)
