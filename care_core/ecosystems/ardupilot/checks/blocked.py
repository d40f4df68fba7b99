"""A vehicle that works and does not move: a rover that is blocked, stuck, or whose motors do not turn; a copter that
leans against what it hit.

Limits of a rover are those by which the firmware itself calls it crashed or blocked (Rover/crash_check.cpp): in a mode
that drives by itself, for 2 s, a throttle of 5% or more with less than 0.08 m/s and less than 0.08 rad/s of turn. The
check of the firmware acts only where FS_CRASH_CHECK is set, which it is not as shipped.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.ardupilot.checks.settings import outputs
from care_core.ecosystems.ardupilot.flight import STANDS_MS, Flight
from care_core.ecosystems.ardupilot.statistics import lasting
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.spans import during, seconds_in
from care_core.logs.base import Wanted
from care_core.numbers import median

READS: Wanted = {"THR": ("ThrOut", "Speed"), "STER": ("TurnRate",)}

LIMITS = Limits()
_SOURCE = "Rover/crash_check.cpp"
THROTTLE_PERCENT = LIMITS.add("least throttle", 5.0, "%", _SOURCE)
STANDING_MS = LIMITS.add("speed of a rover that stands", 0.08, "m/s", _SOURCE)
TURNING_DPS = LIMITS.add("turn rate of a rover that stands", float(np.degrees(0.08)), "deg/s", _SOURCE)
_LASTS_S = LIMITS.add("shortest time blocked", 2.0, "s", _SOURCE)
LIMITS.add("speed of a copter that is held", STANDS_MS, "m/s", "a choice: wind moves what is free by more")
_HELD_P = LIMITS.add("probability of what holds a copter", 0.9, "", "a choice: what else leans, stands and was hit?")


def find(flight: Flight) -> Iterator[Finding]:
    """The first time that it stood still although it was driven, or leant."""
    yield from _held_copter(flight)
    driven = flight.one("THR", "ThrOut", "Speed")
    if flight.kind != "rover" or driven is None:
        return
    turned = flight.one("STER", "TurnRate")
    still = np.abs(driven["Speed"]) < STANDING_MS
    if turned is not None and len(turned):
        still &= np.abs(np.interp(driven.t, turned.t, turned["TurnRate"])) < TURNING_DPS
    pushed = np.abs(driven["ThrOut"]) >= THROTTLE_PERCENT
    spans = lasting(driven.t, still & pushed & flight.drives_itself(driven.t), _LASTS_S)
    if spans and not outputs.wrong_neutrals(flight):  # else what is asked is not what drives
        start, end = spans[0]
        most = float(np.abs(driven["ThrOut"])[(driven.t >= start) & (driven.t <= end)].max())
        yield Finding(
            kind="blocked",
            title="the vehicle is driven and does not move",
            onset_s=start,
            end_s=end,
            severity="critical",
            evidence=(
                f"for {end - start:.0f} s below {STANDING_MS:g} m/s at up to {most:.0f}% throttle "
                f"(limit {THROTTLE_PERCENT:g}% for {_LASTS_S:g} s)"
            ),
            source="THR, STER; Rover/crash_check.cpp",
            suspect="world",
        )


def _held_copter(flight: Flight) -> Iterator[Finding]:
    """Motors that push a copter against something are not asked for alike, and tell nothing of themselves."""
    if flight.held and flight.tilt is not None:
        start, end = flight.held[0][0], flight.held[-1][1]
        t, tilt = flight.tilt
        lean = float(median(tilt[during(flight.held, t)]))
        lasted = seconds_in(flight.held)
        blow = ", after an impact" if flight.first_blow_s < start else ""
        yield Finding(
            kind="blocked",
            title="something holds it: it leans and does not move",
            onset_s=start,
            end_s=end,
            severity="critical",
            evidence=f"for {lasted:.0f} s below {STANDS_MS:g} m/s at a lean of {lean:.0f} deg{blow}",
            source="ATT, GPS.Spd; blows by VIBE.Clip and IMU",
            suspect="world",
            probability=_HELD_P,
        )


CHECK = Check("blocked", "a vehicle that is driven and does not move", READS, LIMITS, find)
