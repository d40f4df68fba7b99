"""What of a mission a PX4 vehicle flew: the track around home, the items that it reached, and its phases.

Everything is worked out once per mission (`Mission.shared(analyse)`) and read by the measures of this package.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from care_core.ecosystems.measures import Mission, has, numeric, one_of
from care_core.ecosystems.px4.flight import LANDED, POSITION, READS, RESULT
from care_core.ecosystems.px4.flown_mission import did_last_item
from care_core.ecosystems.px4.measures.requested import (
    ITEMS,
    LAND,
    PLACES,
    RETURN,
    Item,
    end_of,
    flight_of,
    home_of,
    items_begun,
    items_in_all,
    requested_mission,
)
from care_core.ecosystems.spans import within
from care_core.ecosystems.vehicles import way_of
from care_core.ecosystems.vehicles.arming import NEVER_ARMED
from care_core.ecosystems.vehicles.way import AIRBORNE_M, Phase, Track, distance_to_legs, phases_home, span_in
from care_core.logs.base import Wanted, merge_needs
from care_core.numbers import Floats
from care_core.records import Record
from care_core.run import Unavailable

NEEDS: Wanted = merge_needs((READS, ITEMS, {POSITION: ("x", "y", "z"), LANDED: ("landed",)}))
"""What `analyse` and the search for missions read."""

PHASE_ARGS = {
    "phase": one_of(
        "only this part of the flight: takeoff, leg, return, return_climb, return_cruise, descent, touchdown",
        *("takeoff", "leg", "return", "return_climb", "return_cruise", "descent", "touchdown"),
    ),
    "index": numeric("number of the leg, from 1"),
}
_SLOW_BELOW_M = 5.0
"""MPC_LAND_ALT2, as shipped: height from which a landing is slow."""


class FlownMission(Record, eq=False):
    """What was flown of a mission. `phases` holds only what was completed, by name and index (legs count from 1)."""

    places: Mapping[int, Item]
    """The items that lead to a place, by number, as far as they were begun."""
    reached: int
    """Number of the last item that was reached, -1 where none was."""
    items: int | None
    """How many items the mission has, None where the log does not say."""
    corners: Floats
    """Shape (legs + 1, 2): the way that was asked for, from home through the waypoints."""
    end: tuple[float, float] | None
    """Where the mission ends, None where it says neither to return nor to land, or broke off before it said so."""
    track: Track | None
    legs: Phase | None
    """From the start of the first leg to where the last one was flown, or broken off; None where none was begun."""
    phases: Mapping[tuple[str, int], Phase]
    did_last_item: bool
    """Whether its last item was reached, or was the return or the landing that it left the mission for, and landed."""

    @property
    def all_reached(self) -> bool:
        """Whether every waypoint was reached: what follows them is the return or the landing, or nothing. A mission
        whose last item was reached is whole, whatever of it has no place (a delay, a gripper)."""
        if self.did_last_item:
            return True
        if self.items is not None and self.reached >= self.items - 1 >= 0:
            return True
        return bool(self.places) and self.reached >= max(self.places) and self.has_all_places

    @property
    def has_all_places(self) -> bool:
        """Whether the last place that was begun is the mission's last."""
        left = None if self.items is None else self.items - 1 - max(self.places, default=-1)
        return left is not None and (left <= 0 or (left == 1 and self.end is not None))

    def under_way(self, t: Floats) -> np.ndarray:
        """Whether the vehicle was in the air at times `t`."""
        if self.track is None or not len(self.track.t):
            return np.zeros(len(t), dtype=bool)
        return np.asarray(np.interp(t, self.track.t, self.track.height) > AIRBORNE_M)

    def path_errors(self) -> Floats:
        """Horizontal distance in metres from the legs while they were flown, along the track as flown."""
        if self.track is None or self.legs is None:
            return np.empty(0)
        track = self.track.filled_in()
        going = self.under_way(track.t) & (track.t >= self.legs.start_s) & (track.t <= self.legs.end_s)
        return distance_to_legs(np.column_stack((track.north[going], track.east[going])), self.corners)


def is_armed(mission: Mission) -> bool:
    """Whether the vehicle was armed in this mission, which may be a refusal to arm."""
    return within(flight_of(mission).armed, mission.start_s)


def flown_mission(mission: Mission) -> FlownMission | Unavailable:
    """What was flown of a mission; why nothing was."""
    return mission.shared(analyse) if is_armed(mission) else NEVER_ARMED


def span_of_phase(mission: Mission, args: Mapping[str, object]) -> tuple[float, float] | Unavailable:
    """Start and end in the log of the part of the flight that `args` name."""
    flown = flown_mission(mission)
    return flown if isinstance(flown, Unavailable) else span_in(flown.phases, args)


def analyse(mission: Mission) -> FlownMission:
    """Works out what was flown of a mission; use through `mission.shared`."""
    begun = mission.shared(items_begun)
    items = {} if isinstance(begun, Unavailable) else begun
    places = {number: item for number, item in items.items() if item.command in PLACES and number > 0}
    way = mission.shared(requested_mission)
    ending = "open" if isinstance(way, Unavailable) else way.ending
    corners = np.empty((0, 2)) if isinstance(way, Unavailable) else way.points[:, :2]
    end = end_of(mission) if isinstance(way, Unavailable) else None
    if ending != "open":
        end = (0.0, 0.0) if ending == "return" else (float(corners[-1, 0]), float(corners[-1, 1]))
    reached = _reached(mission)
    track = _track(mission)
    phases = _phases(mission, items, places, reached, track)
    return FlownMission(
        places=places,
        reached=max(reached, default=-1),
        items=items_in_all(mission),
        corners=corners,
        end=end,
        track=track,
        legs=_legs(mission, items, places, reached),
        phases=phases,
        did_last_item=did_last_item(flight_of(mission), (mission.start_s, mission.end_s)),
    )


def _reached(mission: Mission) -> dict[int, float]:
    """When each item was first said to be reached. What the navigator went on from, it had reached."""
    table = mission.table(RESULT)
    if not has(table, "seq_reached"):
        return {}
    found: dict[int, float] = {}
    for t, number in zip(table.t.tolist(), table["seq_reached"].tolist(), strict=True):
        if 0 <= number < 2**15:
            for one in range(int(number), -1, -1):
                if one in found:
                    break
                found[one] = t
    return found


def _track(mission: Mission) -> Track | None:
    """The estimated position from home, in the times that it is known."""
    table, home = mission.table(POSITION), home_of(mission)
    if not has(table, "x", "y", "z"):
        return None
    known = table.where(np.isfinite(table["x"] + table["y"] + table["z"]))
    if not len(known):
        return None
    x, y, z = home.local if home is not None else (known["x"][0], known["y"][0], known["z"][0])
    return Track(known.t, known["x"] - x, known["y"] - y, float(z) - known["z"])


def _phases(
    mission: Mission, items: Mapping[int, Item], places: Mapping[int, Item], reached: Mapping[int, float],
    track: Track | None,
) -> dict[tuple[str, int], Phase]:  # fmt: skip
    phases: dict[tuple[str, int], Phase] = {}
    if places:
        phases["takeoff", 0] = Phase(mission.start_s, places[min(places)].begun_s)
    for index, number in enumerate(sorted(places), start=1):
        if number in reached:
            phases["leg", index] = Phase(places[number].begun_s, reached[number])
    homeward_s, returns = _homeward(mission, items)
    if track is not None and math.isfinite(homeward_s):
        slow_below_m = mission.settings.get("MPC_LAND_ALT2", _SLOW_BELOW_M)
        slow = float(slow_below_m) if isinstance(slow_below_m, (int, float)) else _SLOW_BELOW_M
        home = phases_home(track, homeward_s, mission.end_s, slow, returns=returns)
        phases.update({(name, 0): phase for name, phase in home.items()})
    return phases


def _legs(
    mission: Mission, items: Mapping[int, Item], places: Mapping[int, Item], reached: Mapping[int, float]
) -> Phase | None:
    """The part of the flight that was spent on legs."""
    if not places:
        return None
    homeward_s, _ = _homeward(mission, items)
    end_s = min(homeward_s, reached.get(max(places), math.inf), mission.end_s)
    return Phase(places[min(places)].begun_s, max(end_s, places[min(places)].begun_s))


def _homeward(mission: Mission, items: Mapping[int, Item]) -> tuple[float, bool]:
    """When the vehicle set out for home or for the ground, and whether it flew home for that."""
    said = {item.begun_s: item.command == RETURN for item in items.values() if item.command in (RETURN, LAND)}
    for t, mode in flight_of(mission).modes:
        if mission.start_s <= t <= mission.end_s and way_of("px4", mode) in ("return", "land"):
            said.setdefault(t, way_of("px4", mode) == "return")
    return min(said.items(), default=(math.inf, False))
