"""An autopilot that cannot keep up: long loops, a load at its limit, records that were dropped.

Load is the scheduler's own share of time in use, in tenths of a per cent (PM.Load). NLon counts loops that took half as
long again as they should (AP_Scheduler::PerfInfo); that one of seven does is our limit, no healthy training flight has
one long loop in a hundred. The CPU failsafe (ERR 19) is the firmware's own word.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.ardupilot.statistics import lasting
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.spans import during, within
from care_core.ecosystems.vehicles.errors import CPU_FAILSAFE
from care_core.logs.base import Wanted

READS: Wanted = {"PM": ("NLon", "NL", "Load")}

LIMITS = Limits()
LONG_SHARE = LIMITS.add(
    "share of long loops", 0.15, "", "a choice: no healthy training flight has one long loop in a hundred"
)
FULL_LOAD = LIMITS.add("load of the scheduler", 950.0, "tenths of a per cent", "AP_Scheduler: PM.Load is 1000 at most")
_LASTS_S = LIMITS.add("shortest overload", 5.0, "s", "a choice: a slow loop now and then harms nothing")
_STUCK_P = LIMITS.add("probability where the CPU failsafe acted", 0.8, "", "the firmware's own word")
_OVERLOADED_P = LIMITS.add("probability of an overload", 0.4, "", "a choice: most vehicles fly on with late loops")


def find(flight: Flight) -> Iterator[Finding]:
    """Overload while armed."""
    stuck = [t for t, code in flight.errors(CPU_FAILSAFE) if code and within(flight.armed, t)]
    if stuck:
        yield Finding(
            kind="cpu",
            title="the main loop got stuck",
            onset_s=stuck[0],
            end_s=stuck[-1],
            severity="critical",
            evidence="CPU failsafe",
            source=f"ERR {CPU_FAILSAFE}",
            probability=_STUCK_P,
        )
        return
    table = flight.one("PM")
    if table is None or flight.is_simulated:  # whose computer's load that is
        return
    armed = during(flight.armed, table.t)
    slow = np.zeros(len(table), dtype=bool)
    said = []
    if {"NLon", "NL"} <= table.columns.keys():
        share = table["NLon"] / np.maximum(table["NL"], 1)
        slow |= share > LONG_SHARE
        if (slow & armed).any():
            said.append(
                f"{100 * float(np.max(share[armed])):.0f}% of the loops are long (limit {100 * LONG_SHARE:.0f})"
            )
    if "Load" in table.columns and (table["Load"][armed] > FULL_LOAD).any():
        slow |= table["Load"] > FULL_LOAD
        said.append(f"load {float(np.max(table['Load'][armed])) / 10:.0f}%")
    spans = lasting(table.t, slow & armed, _LASTS_S, gap_s=15.0, records=2)
    if spans and said:
        yield Finding(
            kind="cpu",
            title="the autopilot is overloaded",
            onset_s=spans[0][0],
            end_s=spans[-1][1],
            severity="warning",
            evidence="; ".join(said),
            source="PM.NLon, NL, Load",
            probability=_OVERLOADED_P,
        )


CHECK = Check("cpu", "long loops, a full load, a stuck main loop", READS, LIMITS, find)
