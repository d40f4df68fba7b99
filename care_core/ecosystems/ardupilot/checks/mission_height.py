"""A vehicle that flies far above all that its mission asks for, or sinks far below it with all the thrust it has.

A plane adds ALT_OFFSET to the height of every item (ArduPlane/altitude.cpp, `mission_alt_offset`): where it is far off,
the mission is flown far above the site, and what lands, or waits for its height, never does.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.ardupilot.held_missions import LAND, PLACES, RETURN, TAKEOFF, HeldMission
from care_core.ecosystems.ardupilot.statistics import lasting
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.spans import Span, during
from care_core.ecosystems.vehicles import flies, way_of
from care_core.logs.base import Wanted
from care_core.numbers import Bools, Floats
from care_core.run import shown

READS: Wanted = {}
LIMITS = Limits()
_ABOVE_M = LIMITS.add("height above the mission's highest item", 100.0, "m", "a choice: no overshoot is as high")
_TIMES = LIMITS.add("that height as a share of the highest item's", 1.0, "", "a choice: of high missions likewise")
_LASTS_S = LIMITS.add("shortest time of it", 10.0, "s", "a choice: a receiver that jumps is back sooner")
_LEAST_OFFSET_M = LIMITS.add("offset that lifts a mission out of its limits", 50.0, "m", "half of what is told here")
_SURE_P = LIMITS.add("probability of the offset", 0.97, "", "it is what the height says")
_LIKELY_P = LIMITS.add("probability that it was set to", 0.6, "", "a choice: else its height is false")
_BELOW = LIMITS.add("height below the mission's lowest item, as a share of it", 0.5, "", "a choice: no corner costs it")
_BELOW_M = LIMITS.add("and in metres", 2.0, "m", "a choice: heights drift by less")
_SANK_S = LIMITS.add("shortest time of that", 1.5, "s", "a choice: a height that is set anew is back at once")
_SPENT = LIMITS.add("throttle with which it sinks", 0.95, "", "a choice: all that there is; who descends takes less")
_SANK_P = LIMITS.add("probability that its thrust was lost by itself", 0.1, "", "a choice: it is what a cause leads to")
_TOUCHES_M = LIMITS.add("height at which it is on the ground", 0.3, "m", "a choice: a leg's length")
_OFFSET = "ALT_OFFSET"
_RELATIVE = 3
"""MAV_FRAME_GLOBAL_RELATIVE_ALT: above home."""
_RETURN_CM = "RTL_ALT", "ALT_HOLD_RTL"
_RETURN_M = "RTL_ALTITUDE", "RTL_ALT_M"


def find(flight: Flight) -> Iterator[Finding]:
    """The first time that it flies a mission so far above it, and that it sinks so far below it."""
    yield from _sank(flight)
    yield from _flew_above(flight)


def _flew_above(flight: Flight) -> Iterator[Finding]:
    known = flight.estimated_height
    if known is None or not flies(flight.mode_kind) or flight.lost_control_s is not None:
        return
    t, height = known
    for mission, until_s in _flown(flight):
        highest = _highest_m(mission, flight)
        above = height > (math.inf if highest is None else highest + max(_ABOVE_M, _TIMES * highest))
        if highest is None or not above.any():
            continue  # nearly every flight: nothing else is looked at
        held = (t >= mission.since_s) & (t < until_s) & during(flight.airborne, t)
        if spans := lasting(t, above & _in_mission(flight, t) & held, _LASTS_S):
            start, end = spans[0][0], spans[-1][1]
            yield _finding(flight, start, end, float(np.max(height[(t >= start) & (t <= end)])), highest)
            return


def _sank(flight: Flight) -> Iterator[Finding]:
    """The times that a copter sank in the middle of its mission, with all the thrust it had, and rose again."""
    known, driven = flight.estimated_height, flight.throttle
    if known is None or driven is None or not flight.is_copter or flight.lost_control_s is not None:
        return
    t, height = known
    spent = np.interp(t, *driven) > _SPENT
    for mission, until_s in _flown(flight):
        lowest = _lowest_m(mission)
        if lowest is None or lowest < 2 * _BELOW_M:
            continue
        held = (t >= mission.since_s) & (t < until_s) & during(flight.armed, t)
        high = t[held & (height > lowest - _BELOW_M / 2)]
        if not len(high):
            continue
        low = held & (height < min(_BELOW * lowest, lowest - _BELOW_M)) & (t > high[0]) & (t < high[-1])
        if not low.any():
            continue  # nearly every flight: nothing else is looked at
        sank = lasting(t, low & _in_mission(flight, t), _SANK_S)
        if spans := [span for span in sank if spent[during([span], t)].any()]:
            yield _sinking(spans, float(min(height[during(spans, t)])), lowest)
            return


def _in_mission(flight: Flight, t: Floats) -> Bools:
    """At which of these times it flew its mission."""
    return np.array([way_of(flight.mode_kind, int(mode)) == "mission" for mode in flight.modes_at(t)])


def _lowest_m(mission: HeldMission) -> float | None:
    """What a mission asks for at least on its way, above home; None where it lands on it, or its heights are not all
    told so."""
    numbers = [number for number, one in mission.items.items() if one.command in PLACES]
    asked = [mission.items[number] for number in numbers]
    lands = (number for number, one in mission.items.items() if one.command == LAND)
    if not asked or any(one.frame != _RELATIVE for one in asked) or any(number < numbers[-1] for number in lands):
        return None
    return min(one.alt_m for one in asked)


def _sinking(spans: list[Span], least_m: float, lowest_m: float) -> Finding:
    touched = least_m < _TOUCHES_M
    return Finding(
        kind="thrust",
        title="it came down to the ground in its mission" if touched else "it sank far below its mission",
        onset_s=spans[0][0],
        end_s=spans[-1][1],
        severity="critical",
        evidence=f"{least_m:.1f} m up at full throttle, where the mission asks for {lowest_m:.0f} m at least"
        + (f"; {len(spans)} times" if len(spans) > 1 else ""),
        source="POS.RelHomeAlt, CMD, CTUN.ThO",
        probability=_SANK_P,
    )


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


CHECK = Check(
    "mission height",
    "a vehicle that flies far above its mission, or sinks far below it at full throttle",
    READS,
    LIMITS,
    find,
)
