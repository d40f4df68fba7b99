"""Arming that was refused: what the firmware said, where the vehicle never armed."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator

from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding, Severity, SuspectKind
from care_core.logs.base import Wanted

READS: Wanted = {}

_BY_OPERATOR = re.compile(
    r"""
      mode\snot\sarmable | \bRC\d*\s?.*(not\s(found|calibrated)|neutral|radio) | not\sneutral | rudder
    | (Throttle|collective)\s.*(high|low|neutral|below\sfailsafe) | Radio\sfailsafe | safety\sswitch | Leaning
    | (compass|accels?|accelerometers?|INS)\s.*(not\scalibrated|calib\w*\sneeded|needs?\scalib)
    | calibration\s(needed|running) | reboot | Emergency\sStop | Interlock | switch(es)?\s(is\s)?on | SD\scard | Logging
    | Rally | Mission: | Auto\smode\srequires
    """,
    re.VERBOSE | re.IGNORECASE,
)
"""Complaints of what the pilot has to do or somebody to set up before a start: sticks, switches, mode, calibration.
None of them reads a parameter that a flight is tuned by (AP_Arming.cpp, AP_Arming_Copter.cpp, RC_Channel.cpp)."""
LIMITS = Limits()
_SURE = LIMITS.add(
    "probability of what the pilot has to do", 0.95, "", "the firmware says itself that this kept it from arming"
)
_BY_SETTING = LIMITS.add("probability of a parameter", 0.3, "", "a choice: a sensor may be the reason as well")
_STARTING_S = LIMITS.add(
    "how long before the last a refusal counts", 30.0, "s", "AP_Arming repeats complaints every 30 s"
)


def find(flight: Flight) -> Iterator[Finding]:
    """The refusal that lasted, where no arming followed it."""
    if flight.armed:
        return
    refusals = [(one.time_s, one.why, one.was_tried) for one in flight.refusals]
    if not refusals:
        return
    last = refusals[-1][0]
    lasting = [(t, why, asked) for t, why, asked in refusals if last - t < _STARTING_S]
    counts = Counter(_plain(why) for _, why, _ in lasting)
    why = max(counts, key=lambda one: counts[one])
    begin = next(t for t, one, _ in refusals if _plain(one) == why)
    asked = any(is_order for _, _, is_order in refusals)
    severity: Severity = "critical" if asked and not flight.breaks_off else "warning"
    by_operator = all(_BY_OPERATOR.search(one) for _, one, _ in lasting)
    suspect: SuspectKind = "operation" if by_operator else "parameter"
    yield Finding(
        kind="prearm",
        title=f"arming was refused: {why}",
        onset_s=begin,
        end_s=last,
        severity=severity,
        evidence="; ".join(dict.fromkeys(_plain(one) for _, one, _ in lasting)),
        source="MSG",
        suspect=suspect,
        probability=_SURE if by_operator else _BY_SETTING,
    )


def _plain(why: str) -> str:
    """A complaint without the numbers that change from one to the next."""
    return re.sub(r"\s*\([^)]*\d[^)]*\)", "", why)


CHECK = Check("prearm", "arming that was refused to the end of the log", READS, LIMITS, find)
