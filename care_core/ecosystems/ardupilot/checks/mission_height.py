"""A vehicle that flies far above all that its mission asks for.

A plane adds ALT_OFFSET to the height of every item (ArduPlane/altitude.cpp, `mission_alt_offset`): where it is far off,
the mission is flown far above the site, and what lands, or waits for its height, never does.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.ardupilot.held_missions import PLACES, RETURN, TAKEOFF, HeldMission
from care_core.ecosystems.ardupilot.statistics import lasting
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.spans import during
from care_core.ecosystems.vehicles import flies, way_of
from care_core.logs.base import Wanted
from care_core.run import shown

READS: Wanted = {}
LIMITS = Limits()
_ABOVE_M = LIMITS.add("height above the mission's highest item", 100.0, "m", "a choice: no overshoot is as high")
_TIMES = LIMITS.add("that height as a share of the highest item's", 1.0, "", "a choice: of high missions likewise")
_LASTS_S = LIMITS.add("shortest time of it", 10.0, "s", "a choice: a receiver that jumps is back sooner")
_LEAST_OFFSET_M = LIMITS.add("offset that lifts a mission out of its limits", 50.0, "m", "half of what is told here")
_SURE_P = LIMITS.add("probability of the offset", 0.97, "", "it is what the height says")
_LIKELY_P = LIMITS.add("probability that it was set to", 0.6, "", "a choice: else its height is false")
_OFFSET = "ALT_OFFSET"
_RELATIVE = 3
"""MAV_FRAME_GLOBAL_RELATIVE_ALT: above home."""
_RETURN_CM = "RTL_ALT", "ALT_HOLD_RTL"
_RETURN_M = "RTL_ALTITUDE", "RTL_ALT_M"


def find(flight: Flight) -> Iterator[Finding]:
    """The first time that it flies a mission so far above it."""
    known = flight.estimated_height
    if known is None or not flies(flight.mode_kind) or flight.lost_control_s is not None:
        return
    t, height = known
    for mission, until_s in _flown(flight):
        highest = _highest_m(mission, flight)
        above = height > (math.inf if highest is None else highest + max(_ABOVE_M, _TIMES * highest))
        if highest is None or not above.any():
            continue  # nearly every flight: nothing else is looked at
        by_itself = np.array([way_of(flight.mode_kind, int(mode)) == "mission" for mode in flight.modes_at(t)])
        held = (t >= mission.since_s) & (t < until_s) & during(flight.airborne, t)
        if spans := lasting(t, above & by_itself & held, _LASTS_S):
            start, end = spans[0][0], spans[-1][1]
            yield _finding(flight, start, end, float(np.max(height[(t >= start) & (t <= end)])), highest)
            return


def _flown(flight: Flight) -> Iterator[tuple[HeldMission, float]]:
    """Every mission that it held, and until when."""
    held = flight.held_missions
    ends = [*(one.since_s for one in held[1:]), np.inf]
    yield from zip(held, ends, strict=False)


def _highest_m(mission: HeldMission, flight: Flight) -> float | None:
    """What a mission asks for at most, above home; None where its heights are not all told so."""
    asked = [one for one in mission.items.values() if one.command in PLACES or one.command == TAKEOFF]
    if not asked or any(one.frame != _RELATIVE for one in asked):
        return None
    highest = max(one.alt_m for one in asked)
    if not any(one.command == RETURN for one in mission.items.values()):
        return highest
    return max(highest, (flight.setting(*_RETURN_CM) or 0.0) / 100, flight.setting(*_RETURN_M) or 0.0)


def _finding(flight: Flight, start: float, end: float, reached_m: float, highest_m: float) -> Finding:
    offset = flight.setting(_OFFSET) if flight.kind in ("plane", "quadplane") else None
    is_lifted = offset is not None and offset >= _LEAST_OFFSET_M
    lifted = f"; {_OFFSET} is {shown(offset)} (default 0), which is added to every height" if is_lifted else ""
    return Finding(
        kind="control",
        title="it flew far above its mission",
        onset_s=start,
        end_s=end,
        severity="critical",
        evidence=f"{reached_m:.0f} m up, where the mission asks for {highest_m:.0f} m at most{lifted}",
        source="POS.RelHomeAlt, CMD; PARM",
        suspect="parameter",
        probability=_SURE_P if is_lifted else _LIKELY_P,
        parameters=(_OFFSET,) if is_lifted else (),
        wanted=((_OFFSET, 0.0),) if is_lifted else (),
    )


CHECK = Check("mission height", "a vehicle that flies far above its mission", READS, LIMITS, find)
