"""A speed that nobody means: a program that commands a copter in Guided asks for ever more.

The firmware flies what is asked for there; WPNAV_SPEED bounds missions alone (mode_guided.cpp, velocity control).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import ASKED_SPEED, Finding
from care_core.ecosystems.spans import during, runs
from care_core.logs.base import Wanted
from care_core.numbers import Floats

READS: Wanted = {"PSCN": ("DVN", "VN"), "PSCE": ("DVE", "VE")}

LIMITS = Limits()
_ABOVE = LIMITS.add("speed over WPNAV_SPEED", 2.0, "", "a choice: it is what an operator holds to be fast")
_LEAST_MS = LIMITS.add("speed, at least", 15.0, "m/s", "a choice: small copters reach it, and few tasks need it")
_LASTS_S = LIMITS.add("shortest time of it", 3.0, "s", "a choice: a single command is taken back sooner")
_FLOWN = LIMITS.add("share of it that is flown", 0.5, "", "a choice: what is asked for and not flown does no harm")
_MEANT_P = LIMITS.add("probability that nobody means it", 0.8, "", "a choice: a race is flown by hand")
_CM = 0.01


def find(flight: Flight) -> Iterator[Finding]:
    """Where more is asked for in Guided than any task of this vehicle needs, and it flies so."""
    speeds, usual = _speeds(flight), flight.setting("WPNAV_SPEED")
    if not flight.is_copter or speeds is None or not usual:
        return
    t, asked, flown = speeds
    limit = max(_LEAST_MS, _ABOVE * usual * _CM)
    numbers = [one.number for one in flight.modes if one.number is not None and one.way == "guided"]
    guided = np.isin(flight.modes_at(t), numbers)
    spans = [span for span in runs(t, guided & (asked > limit)) if span[1] - span[0] >= _LASTS_S]
    inside = during(spans, t)
    if not spans or float(flown[inside].max()) < _FLOWN * limit:
        return
    yield Finding(
        kind="commands",
        title=f"{ASKED_SPEED}{float(asked[inside].max()):.0f} m/s",
        onset_s=spans[0][0],
        end_s=spans[-1][1],
        severity="critical",
        evidence=f"it flew up to {float(flown[inside].max()):.0f} m/s; WPNAV_SPEED is {usual * _CM:g} m/s (limit "
        f"{limit:g}), and does not bind what a program asks for",
        source="PSCN.DVN, PSCE.DVE",
        suspect="operation",
        probability=_MEANT_P,
    )


def _speeds(flight: Flight) -> tuple[Floats, Floats, Floats] | None:
    """Time, the speed over ground that is asked for, and the one flown, m/s; None where the log holds none."""
    north, east = flight.one("PSCN", "DVN", "VN"), flight.one("PSCE", "DVE", "VE")
    if north is None or east is None or not len(north) or not len(east):
        return None
    asked = np.hypot(north["DVN"], np.interp(north.t, east.t, east["DVE"]))
    return north.t, asked, np.hypot(north["VN"], np.interp(north.t, east.t, east["VE"]))


CHECK = Check("asked speed", "a speed in Guided that nobody means", READS, LIMITS, find)
