"""What makes thrust proportional to the throttle that is asked for: the curve of the motors, and the pack's voltage.

Motors and propellers give more than twice the thrust at twice the throttle, and less of it as the pack drains. The
firmware takes both off again (AP_MotorsMulticopter: apply_thrust_curve_and_volt_scaling). What accelerates a copter
against gravity then grows as its throttle does: where it grows faster, MOT_THST_EXPO is too low. That it grows more
slowly tells nothing: a motor that lags and an estimate that is filtered do the same.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from care_core.ecosystems.ardupilot.battery import Battery
from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.lithium import CHARGED_V, CRITICAL_V, FULL_V, HIGHEST_V, LOW_V
from care_core.ecosystems.spans import during
from care_core.geodesy import GRAVITY
from care_core.logs.base import Wanted
from care_core.records import Record

READS: Wanted = {"CTUN": ("ThO",), "PSCD": ("AD",), "ATT": ("Roll", "Pitch"), "BAT": ("Volt",)}

LIMITS = Limits()
_STEEP = LIMITS.add(
    "growth of thrust over that of throttle", 1.4, "",
    "109 flights: at most 1.06 with MOT_THST_EXPO at 0.3 and more; good flights at -0.3 have 1.27",
)  # fmt: skip
_AGREE = LIMITS.add("least correlation of thrust and throttle", 0.8, "", "a choice: less is wind and noise")
_VARIES = LIMITS.add("least relative change of the throttle", 0.015, "", "a choice: less is no climb or descent")
_RECORDS = LIMITS.add("fewest records of thrust", 60.0, "", "a choice: half a minute of a thinned log")
_EXPO, _FULL, _EMPTY = "MOT_THST_EXPO", "MOT_BAT_VOLT_MAX", "MOT_BAT_VOLT_MIN"
_PACK = LIMITS.add("cell of a pack that was charged", CHARGED_V, "V", "cells of lithium polymer packs")
_FULL_LEAST = LIMITS.add(f"full cell that {_FULL} may mean, least", 3.9, "V", "lithium ion: 4.1 V, iron: less")
_FULL_MOST = LIMITS.add(f"full cell that {_FULL} may mean, most", 4.5, "V", "cells of high voltage: 4.35 V")
_EMPTY_MOST = LIMITS.add(f"empty cell that {_EMPTY} may mean, most", 3.8, "V", "ArduPilot: 3.3 V; 3.5 V is used")
_SURE_P = LIMITS.add("probability of what the thrust is scaled by wrongly", 0.9, "", "it is measured")
_LOST_P = LIMITS.add(
    "probability that a voltage costs the mission", 0.02, "", "0 of 4 flights at half and twice failed"
)
_CURVE_LOST_P = LIMITS.add(
    "probability that the curve costs the mission",
    0.1,
    "",
    "24 of 50 training flights below 0 went well, 150 of 271 at 0.65",
)
_EDGE_S, _LEAST_G = 3.0, 2.0
_THROTTLE = (0.05, 0.9)
"""A throttle that is at neither of its ends."""


class Growth(Record):
    """How thrust grows with the throttle that is asked for, on logarithmic scales: 1 is in proportion."""

    slope: float
    records: int


def find(flight: Flight) -> Iterator[Finding]:
    """A thrust that is made proportional wrongly."""
    if flight.is_copter and flight.kind != "heli" and flight.throttle is not None:
        yield from _too_straight(flight)
        yield from _another_pack(flight)


def _too_straight(flight: Flight) -> Iterator[Finding]:
    default, value = flight.default_left(_EXPO), flight.setting(_EXPO)
    if default is None or value is None or value >= default:
        return
    growth = thrust_growth(flight)
    if growth is not None and growth.slope > _STEEP:
        evidence = (
            f"thrust grows {growth.slope:.2f} times as fast as the throttle that is asked for (limit {_STEEP:g}, in "
            f"{growth.records} records of the flight): {_EXPO}={value:g} takes too little of the motors' curve off "
            f"(default {default:g})"
        )
        yield _finding(flight, _EXPO, default, "the motors' thrust curve is not that of MOT_THST_EXPO", evidence)


def thrust_growth(flight: Flight) -> Growth | None:
    """By regression on the throttle, whose own noise makes it less, never more; None where the log cannot tell."""
    accelerates, tilts = flight.one("PSCD", "AD"), flight.one("ATT", "Roll", "Pitch")
    if accelerates is None or tilts is None or flight.throttle is None:
        return None
    rows = accelerates.where(during(((start + _EDGE_S, end - _EDGE_S) for start, end in flight.flown), accelerates.t))
    angles = (np.radians(np.interp(rows.t, tilts.t, tilts[name])) for name in ("Roll", "Pitch"))
    upright = np.prod([np.cos(angle) for angle in angles], axis=0)
    thrust, asked = (GRAVITY - rows["AD"]) / upright, np.interp(rows.t, *flight.throttle)
    usable = np.isfinite(thrust) & (thrust > _LEAST_G) & (asked > _THROTTLE[0]) & (asked < _THROTTLE[1])
    if usable.sum() < _RECORDS:
        return None
    asked, thrust = np.log(asked[usable]), np.log(thrust[usable])
    if min(np.std(asked), np.std(thrust)) < _VARIES or np.corrcoef(asked, thrust)[0, 1] < _AGREE:
        return None
    return Growth(float(np.polyfit(asked, thrust, 1)[0]), int(usable.sum()))


def _another_pack(flight: Flight) -> Iterator[Finding]:
    """Voltages that the thrust is scaled between (AP_MotorsMulticopter: update_lift_max_from_batt_voltage) and that are
    none of the pack, where that was charged."""
    battery = next(iter(flight.batteries), None)
    cells = None if battery is None else _cells(flight, battery)
    full, empty = flight.setting(_FULL), flight.setting(_EMPTY)
    if battery is None or cells is None or not full:
        return
    pack = f"{battery.rest_v:.1f} V at rest is a full pack of {cells} cells"
    scaled = "the thrust is scaled for another voltage"
    told = partial(_finding, flight)
    if flight.default_left(_FULL) is not None and not _FULL_LEAST <= full / cells <= _FULL_MOST:
        limits = f"(limits {_FULL_LEAST:g} and {_FULL_MOST:g})"
        evidence = f"{pack}, and {_FULL}={full:g} is {full / cells:.2f} V a cell {limits}: {scaled}"
        yield told(_FULL, round(FULL_V * cells, 1), f"{_FULL} is of another pack", evidence)
    elif flight.default_left(_EMPTY) is not None and empty and empty / cells > _EMPTY_MOST:
        lost = "the thrust is not scaled" if empty >= full else "the thrust is hardly scaled as the pack drains"
        evidence = f"{pack}, and {_EMPTY}={empty:g} is {empty / cells:.2f} V a cell (limit {_EMPTY_MOST:g}): {lost}"
        yield told(_EMPTY, round(CRITICAL_V * cells, 1), f"{_EMPTY} is of another pack", evidence)


def _cells(flight: Flight, battery: Battery) -> int | None:
    """How many cells a charged pack has: what BATT_LOW_VOLT is for, else the one number that its voltage can be of;
    None where they disagree, and where it was not charged."""
    low, rest = flight.setting("BATT_LOW_VOLT"), battery.rest_v
    if rest is None:
        return None
    charged = [count for count in range(1, 15) if _PACK <= rest / count <= HIGHEST_V]
    possible = [count for count in range(1, 15) if LOW_V <= rest / count <= HIGHEST_V]
    if low and round(low / LOW_V) in charged:
        return round(low / LOW_V)
    return charged[0] if not low and possible == charged and len(charged) == 1 else None


def _finding(flight: Flight, parameter: str, wanted: float, title: str, evidence: str) -> Finding:
    return Finding(
        kind="tuning",
        title=title,
        onset_s=0.0,
        end_s=flight.end_s,
        severity="warning",
        evidence=evidence,
        source="CTUN.ThO, PSCD.AD" if parameter == _EXPO else "BAT.Volt before take-off; PARM",
        suspect="parameter",
        probability=_SURE_P,
        mission_lost=_CURVE_LOST_P if parameter == _EXPO else _LOST_P,
        parameters=(parameter,),
        wanted=((parameter, wanted),),
    )


CHECK = Check(
    "thrust curve", "a thrust that is not made proportional to the throttle, by curve or voltage", READS, LIMITS, find
)
