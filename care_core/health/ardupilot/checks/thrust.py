"""Too little thrust: all that the motors have is used, or hovering takes most of it.

The firmware learns a hover throttle up to 0.6875 (AP_MotorsMulticopter.h: AP_MOTORS_THST_HOVER_MAX); a vehicle that
needs more has too little in hand to keep its attitude. 97.5 % of the healthy training flights hover below 0.62.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from care_core.health.ardupilot.flight import Flight
from care_core.health.ardupilot.measure import lasting, smooth
from care_core.health.records import Finding, Severity
from care_core.logs.base import Wanted

READS: Wanted = {"CTUN": ("ThO", "Alt", "DAlt", "CRt", "DCRt"), "MOTB": ("ThLimit", "LiftMax")}

HOVER_MOST = 0.6875
FULL = 0.95
_LASTS_S, _FULL_LASTS_S = 10.0, 3.0
_BELOW_M = 2.0


def find(flight: Flight) -> Iterator[Finding]:
    """Saturation first, for it says more than a high hover throttle."""
    if not flight.is_copter or flight.throttle is None:
        return
    t, throttle = flight.throttle
    flown = flight.during(flight.flown or flight.watched, t) & (throttle > 0.05)
    if flown.sum() < 5:
        return
    level = smooth(t, throttle, 4.0)
    high = lasting(t, flown & (level > HOVER_MOST), _LASTS_S, gap_s=5.0)
    full = lasting(t, flown & (throttle > FULL), _FULL_LASTS_S, gap_s=1.0)
    if full:
        start, end = full[0][0], full[-1][1]
        below = _below(flight, start, end)
        begin = min([start, *[a for a, _ in high]])
        hover = float(np.median(throttle[flown & (t <= max(start, t[flown][0] + 5))]))
        severity: Severity = "critical" if below or sum(b - a for a, b in full) > 10 else "warning"
        yield Finding(
            "thrust", "too little thrust", begin, end, severity,
            f"throttle above {100 * FULL:.0f} % for {sum(b - a for a, b in full):.0f} s from {start:.0f} s on"
            + (f", {below:.1f} m below the height wanted" if below else "")
            + f"; {100 * hover:.0f} % before that",
            "CTUN.ThO; AP_MOTORS_THST_HOVER_MAX 0.6875", probability=0.5,
        )  # fmt: skip
    elif high and sum(b - a for a, b in high) > 0.3 * float(flown.sum()) * float(np.median(np.diff(t))):
        share = float(np.median(level[flown]))
        yield Finding(
            "thrust", f"hovering takes {100 * share:.0f} % of the throttle", high[0][0], high[-1][1], "warning",
            f"mean throttle {100 * share:.0f} % (the firmware learns up to {100 * HOVER_MOST:.0f} %)",
            "CTUN.ThO; AP_MOTORS_THST_HOVER_MAX 0.6875", probability=0.4,
        )  # fmt: skip


def _below(flight: Flight, start: float, end: float) -> float:
    """Metres by which the vehicle stays below the height that it wants, 0 where it does not or nothing says so."""
    table = flight.one("CTUN", "Alt", "DAlt")
    if table is None or not np.any(table["DAlt"]):
        return 0.0
    part = table.between(start, end)
    gap = float(np.median(part["DAlt"] - part["Alt"])) if len(part) else 0.0
    return gap if gap > _BELOW_M else 0.0
