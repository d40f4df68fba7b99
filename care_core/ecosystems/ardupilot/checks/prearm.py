"""Arming that was refused: what the firmware said, where the vehicle never armed."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator

from care_core.ecosystems.ardupilot.checks.refused_by import LIMITS as SETTING_LIMITS
from care_core.ecosystems.ardupilot.checks.refused_by import Refusing, refusing, standing
from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding, Severity, SuspectKind
from care_core.logs.base import Wanted
from care_core.records import replace

READS: Wanted = {}

_BY_OPERATOR = re.compile(
    r"""
      mode\snot\sarmable | \bRC\d*\s?.*(not\s(found|calibrated)|neutral|radio) | not\sneutral | rudder
    | (Throttle|collective)\s.*(high|low|neutral|below\sfailsafe) | Radio\sfailsafe | safety\sswitch | Leaning
    | (compass|accels?|accelerometers?|gyros?|INS)\s.*(not\scalibrated|calib\w*\sneeded|needs?\scalib)
    | calibration\s(needed|running) | reboot | Emergency\sStop | Interlock | switch(es)?\s(is\s)?on | SD\scard | Logging
    | Rally | Mission: | Auto\smode\srequires
    """,
    re.VERBOSE | re.IGNORECASE,
)
"""Complaints of what the pilot has to do or somebody to set up before a start: sticks, switches, mode, calibration.
None of them reads a parameter that a flight is tuned by (AP_Arming.cpp, AP_Arming_Copter.cpp, RC_Channel.cpp)."""
_CHANNELS = "RCMAP_"
"""Beginning of what says which channel a stick is on: on another, no pilot centres it."""
LIMITS = Limits()
_SURE_P = LIMITS.add(
    "probability of what the pilot has to do", 0.95, "", "the firmware says itself that this kept it from arming"
)
_BY_SETTING_P = LIMITS.add("probability of a parameter", 0.3, "", "a choice: a sensor may be the reason as well")


def find(flight: Flight) -> Iterator[Finding]:
    """The refusal that lasted, where no arming followed it."""
    if flight.armed:
        return
    refusals, lasting = flight.lasting_refusals, standing(flight)
    if not lasting:
        yield from _without_frame(flight)
        return
    counts, plain = Counter(one.complaint for one in lasting), {one.complaint: one.plain for one in lasting}
    most = max(counts, key=lambda one: counts[one])
    why, begin = plain[most], next(one.time_s for one in refusals if one.complaint == most)
    asked = any(one.was_tried for one in refusals)
    severity: Severity = "critical" if asked else "warning"
    by_operator = all(_BY_OPERATOR.search(one.why) for one in lasting)
    suspect: SuspectKind = "operation" if by_operator else "parameter"
    complaints = tuple(plain.values())
    finding = Finding(
        kind="prearm",
        title=f"arming {'was' if asked else 'would be'} refused: {why}",
        onset_s=begin,
        end_s=lasting[-1].time_s,
        severity=severity,
        evidence="; ".join(complaints),
        source="MSG",
        suspect=suspect,
        probability=_SURE_P if by_operator else _BY_SETTING_P,
    )
    blamed = (one for one in refusing(flight) if one.is_shown or not by_operator or one.name.startswith(_CHANNELS))
    yield _blaming(finding, tuple(blamed))


def _without_frame(flight: Flight) -> Iterator[Finding]:
    """A copter whose frame nobody chose: it mixes no motor and never arms (AP_MotorsMatrix::setup_motors)."""
    if flight.kind == "copter" and flight.setting("FRAME_CLASS") == 0:
        yield Finding(
            kind="prearm",
            title="arming would be refused: no frame is chosen",
            onset_s=0.0,
            end_s=flight.end_s,
            severity="warning",
            evidence="FRAME_CLASS is 0: no motor is mixed; set it to the frame that is built (1: quad)",
            source="PARM; AP_MotorsMatrix",
            suspect="parameter",
            probability=_SURE_P,
            parameters=("FRAME_CLASS",),
        )


def _blaming(finding: Finding, blamed: tuple[Refusing, ...]) -> Finding:
    """The finding with the parameters that keep the vehicle from arming, where there are any."""
    if not blamed:
        return finding
    return replace(
        finding,
        suspect="parameter",
        parameters=tuple(one.name for one in blamed if not one.is_beside),
        wanted=tuple((one.name, one.wanted) for one in blamed if one.wanted is not None),
        evidence="; ".join((finding.evidence, *(one.words for one in blamed))),
        source="MSG, PARM; what each check reads: AP_Arming",
        probability=max(one.probability for one in blamed),
    )


CHECK = Check(
    "prearm", "arming that was refused to the end of the log", READS, Limits((*LIMITS, *SETTING_LIMITS)), find
)
