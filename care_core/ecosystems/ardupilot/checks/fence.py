"""A fence that the vehicle was sent across: its limit, and what the mission asked for."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.ardupilot.held_missions import PLACES, TAKEOFF, Item
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.spans import during
from care_core.ecosystems.vehicles.errors import FENCE
from care_core.geodesy import offset_m
from care_core.logs.base import Wanted

READS: Wanted = {"CTUN": ("DAlt",), "POS": ("Lat", "Lng")}

LIMITS = Limits()
_BEYOND_M = LIMITS.add("what was asked for beyond the fence", 0.0, "m", "the vehicle is stopped at the fence itself")
_WAS_SENT_P = LIMITS.add("probability of the fence", 0.9, "", "what was asked for lies beyond it")
_STOPS_P = LIMITS.add("probability that a mission fails of it", 0.95, "", "the rest of the mission is not flown")
_BEFORE_S = 0.1
_BY_ITSELF = frozenset(("mission", "guided"))
_TOO_HIGH, _TOO_FAR = 1, 2
"""Kinds of breach (AC_Fence.h: AC_FENCE_TYPE_ALT_MAX, AC_FENCE_TYPE_CIRCLE)."""
_ABOVE_HOME = frozenset((3, 6))
"""Frames of a height above home (MAV_FRAME)."""
_SWITCHES = ("FENCE_ENABLE", "FENCE_AUTOENABLE")


def find(flight: Flight) -> Iterator[Finding]:
    """The first fence that stopped what the vehicle was told to do."""
    for t, code in flight.errors(FENCE):
        mode = flight.mode_at(t - _BEFORE_S)
        if mode is None or mode.way not in _BY_ITSELF:
            continue  # a pilot flies as he likes
        for kind, parameter, asked, what in (
            (_TOO_HIGH, "FENCE_ALT_MAX", _highest(flight, t), "high"),
            (_TOO_FAR, "FENCE_RADIUS", _farthest(flight), "from home"),
        ):
            limit = flight.setting(parameter)
            if code < 0 or not code & kind or limit is None or asked is None or asked - limit <= _BEYOND_M:
                continue
            yield Finding(
                kind="commands",
                title="it was sent across its fence",
                onset_s=t,
                end_s=t,
                severity="warning",
                evidence=(
                    f"it was told to go {asked:.0f} m {what}, and the fence is at {limit:g} m ({parameter}): the "
                    "mission or the fence is wrong, and which only the site can tell"
                ),
                source="ERR 9, CMD, CTUN.DAlt; AC_Fence.h",
                suspect="parameter",
                probability=_WAS_SENT_P,
                mission_lost=_STOPS_P,
                parameters=_set_so(flight, parameter),
            )
            return


def _set_so(flight: Flight, limit: str) -> tuple[str, ...]:
    """What made the fence what it is: its limit, or, where that is as shipped, first that it was switched on."""
    switched = [name for name in _SWITCHES if flight.default_left(name) is not None]
    return (limit,) if flight.default_left(limit) is not None else (*switched, limit)


def _highest(flight: Flight, at: float) -> float | None:
    """The greatest height above home that was asked for, by the mission or, until the fence acted, its controller."""
    asked = [item.alt_m for item in _places(flight) if item.frame in _ABOVE_HOME]
    wanted = flight.one("CTUN", "DAlt")
    if wanted is not None:
        asked += wanted["DAlt"][during(flight.airborne, wanted.t) & (wanted.t < at - _BEFORE_S)].tolist()
    return max(asked, default=None)


def _farthest(flight: Flight) -> float | None:
    """How far from where it was armed the mission leads."""
    been = flight.one("POS", "Lat", "Lng")
    if been is None or not flight.armed:
        return None
    row = min(int(np.searchsorted(been.t, flight.armed[0][0])), len(been) - 1)
    here = float(been["Lat"][row]), float(been["Lng"][row])
    places = (item for item in _places(flight) if item.lat or item.lng)
    return max((math.hypot(*offset_m(here, item.lat, item.lng)) for item in places), default=None)


def _places(flight: Flight) -> Iterator[Item]:
    for held in flight.held_missions:
        yield from (item for item in held.items.values() if item.command in PLACES or item.command == TAKEOFF)


CHECK = Check("fence", "a fence that the vehicle was sent across", READS, LIMITS, find)
