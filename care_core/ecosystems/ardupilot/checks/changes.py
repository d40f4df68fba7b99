"""Parameters that were changed in the air and that act on control at once."""

from __future__ import annotations

from collections.abc import Iterator

from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.logs.base import Wanted

READS: Wanted = {}

_RISKY = ("ATC_", "PSC_", "RATE_", "STB_", "INS_", "EK2_", "EK3_", "EKF_", "AHRS_", "COMPASS_", "MOT_", "FRAME", 
          "SERVO", "ARMING_", "FS_", "MIXMODE", "BRD_")  # fmt: skip
LIMITS = Limits()
_PROBABILITY = LIMITS.add("probability that a change in the air harms", 0.2, "", "a choice: few changes do")
_NAMED = 5
_LEARNED = ("MOT_THST_HOVER", "COMPASS_OFS", "COMPASS_DEC", "INS_GYR", "STAT_", "_CAL", "_ID")
"""What the firmware itself writes while it flies."""


def find(flight: Flight) -> Iterator[Finding]:
    """One finding for all of them."""
    changed = sorted(
        (at, name, one.value)
        for name, values in flight.settings.items()
        if name.startswith(_RISKY) and not any(word in name for word in _LEARNED)
        for one in values
        if (at := one.changed_at_s) is not None and any(start < at < end for start, end in flight.airborne)
    )
    if changed and not flight.events(*range(30, 38)):  # autotune changes gains by itself
        yield Finding(
            kind="tuning",
            title="parameters were changed in the air",
            onset_s=changed[0][0],
            end_s=changed[-1][0],
            severity="info",
            evidence=", ".join(f"{name}={value}" for _, name, value in changed[:_NAMED])
            + (", ..." if len(changed) > _NAMED else ""),
            source="PARM",
            suspect="parameter",
            probability=_PROBABILITY,
        )


CHECK = Check("changes", "parameters changed in the air that act on control at once", READS, LIMITS, find)
