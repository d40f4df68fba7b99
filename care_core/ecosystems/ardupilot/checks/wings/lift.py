"""A QuadPlane whose lift motors give all that they may, and which stays on the ground.

Of simulated QuadPlanes of 3 kg none took off with less than 0.65 of the range of their outputs as shipped.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.ardupilot.checks.settings.output_range import kept_from_range
from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.ardupilot.statistics import lasting
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.spans import during
from care_core.logs.base import Wanted

READS: Wanted = {"QTUN": ("ThO",)}

LIMITS = Limits()
_SPENT = LIMITS.add("throttle of the lift motors", 0.8, "", "a choice: any QuadPlane that can fly rises with less")
_GROUNDED_S = LIMITS.add("such a throttle on the ground", 10.0, "s", "a choice: a take-off takes less")
_KEPT = LIMITS.add("range of the outputs that is left", 0.9, "", "a choice: a share of the range as shipped")
_TOO_LITTLE = LIMITS.add(
    "range of the outputs that surely keeps it down", 0.65, "", "none of the simulated ones flew so"
)
_SURE_P = LIMITS.add("probability that what ends the outputs keeps it down", 0.9, "", "as a copter's")
_UNSURE = LIMITS.add("the same where nearly all is left", 0.2, "", "as a copter's")
_PART_P = LIMITS.add("probability of a part where nothing ends them", 0.5, "", "a choice: a load looks the same")


def find(flight: Flight) -> Iterator[Finding]:
    """Lift at its end, and no height."""
    lift = flight.one("QTUN", "ThO")
    if flight.kind != "quadplane" or lift is None or flight.airborne:
        return
    spent = (lift["ThO"] > _SPENT) & during(flight.armed, lift.t)
    spans = lasting(lift.t, spent, _GROUNDED_S, gap_s=5.0)
    if not spans:
        return
    (start, end), kept = spans[0], kept_from_range(flight, "Q_M_")
    kept = kept if kept is not None and kept.share < _KEPT else None
    ended = "" if kept is None else f"; {kept}"
    yield Finding(
        kind="thrust",
        title="too little thrust to take off",
        onset_s=start,
        end_s=end,
        severity="critical",
        evidence=(
            f"{end - start:.0f} s of {100 * _SPENT:.0f}% and more of what the lift motors may give, without "
            f"rising{ended}"
        ),
        source="QTUN.ThO, height; PARM",
        suspect="hardware" if kept is None else "parameter",
        probability=_PART_P if kept is None else float(np.interp(kept.share, (_TOO_LITTLE, _KEPT), (_SURE_P, _UNSURE))),
        parameters=() if kept is None else (kept.parameter,),
        wanted=() if kept is None else ((kept.parameter, kept.wanted),),
    )


CHECK = Check("lift", "a QuadPlane that stays on the ground with all its lift", READS, LIMITS, find)
