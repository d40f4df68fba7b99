"""The whole way of a plane's mission, from home to where it lands: what its time and its energy follow from.

Beside the legs that are judged (`winged`) it holds the take-off, the way back to home and the landing.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import pairwise

from care_core.ecosystems.ardupilot.held_missions import LAND, LAND_START, PLACES, RETURN, TAKEOFF, Item
from care_core.ecosystems.ardupilot.measures.requested import (
    ITEMS,
    followed,
    home_of,
    mission_held,
    number_set,
    place_of,
)
from care_core.ecosystems.measures import Args, Mission, extractor, missing, one_of
from care_core.geodesy import offset_m
from care_core.records import Record
from care_core.run import Unavailable, Value

_ONLY_RETURNS, _BY_HOME = 0, 1
"""RTL_AUTOLAND: it circles over home; it goes on with the landing of the mission from there, else at once."""
_RETURN_M, _CIRCLE_M = 100.0, 60.0
"""RTL_ALTITUDE and WP_LOITER_RAD as shipped."""
_TURNS_BACK_DEG = 140.0
"""A corner from which on a plane has to turn about: what is blunter is cut, and costs no way."""


Place = tuple[float, float, float]
"""North and east of home and above it, in metres."""


class Way(Record):
    """The places that a mission leads to in the order in which they are flown, `out` from home on, `back` from where it
    returns on. A return is flown at the airspeed of the parameter, whatever the mission commanded before."""

    out: tuple[Place, ...]
    back: tuple[Place, ...] = ()
    circle_m: float = _CIRCLE_M
    """Radius in which it turns."""

    @property
    def climbs(self) -> float:
        way = (*self.out, *self.back[1:])
        return sum(max(b[2] - a[2], 0.0) for a, b in pairwise(way))

    @property
    def out_m(self) -> float:
        """How far the way out leads, with half a circle wherever it turns back. Ten simulated flights of the reference
        configuration with one such corner took 18% longer than their places are apart in the mean, and 6% so."""
        legs = [(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(self.out) if a[:2] != b[:2]]
        corners = (abs(math.remainder(math.atan2(*b) - math.atan2(*a), math.tau)) for a, b in pairwise(legs))
        turns = sum(corner >= math.radians(_TURNS_BACK_DEG) for corner in corners)
        return _length(self.out) + turns * math.pi * self.circle_m


def whole_way(mission: Mission) -> Way | Unavailable:
    """The way that the mission leads; use through `mission.shared`."""
    held, home = mission.shared(mission_held), home_of(mission)
    if isinstance(held, Unavailable):
        return held
    if not held.items:
        return Unavailable("the mission has no items", "upload one")
    if home is None:
        return Unavailable("the log does not say where home is", "record ORGN or POS")
    items = list(followed(held.items))
    returns = next((at for at, item in enumerate(items) if item.command == RETURN), len(items))
    out = ((0.0, 0.0, 0.0), *_places(items[:returns], home))
    ends = any(item.command == LAND for item in items[:returns])
    back = () if ends or returns == len(items) else (out[-1], *_home_and_down(mission, items, home))
    return Way(out, back, abs(number_set(mission, "WP_LOITER_RAD", _CIRCLE_M)))


def _places(items: Sequence[Item], home: Sequence[float]) -> Iterator[Place]:
    """Where items lead, up to the first that lands."""
    at = (0.0, 0.0, 0.0)
    for item in items:
        if item.command == TAKEOFF:
            at = (*at[:2], item.alt_m)
        elif item.command in PLACES:
            at = place_of(item, home, at)
            yield at
        elif item.command == LAND:
            yield (*(offset_m(home, item.lat, item.lng) if item.lat or item.lng else at[:2]), 0.0)
            return


def _home_and_down(mission: Mission, items: Sequence[Item], home: Sequence[float]) -> Iterator[Place]:
    """The way from a return on: by home or not, and along the landing that the mission holds."""
    lands = number_set(mission, "RTL_AUTOLAND", _ONLY_RETURNS)
    start = next((at for at, item in enumerate(items) if item.command == LAND_START), None)
    if start is None or lands in (_ONLY_RETURNS, _BY_HOME):
        yield 0.0, 0.0, number_set(mission, "RTL_ALTITUDE", _RETURN_M)
    if start is not None and lands != _ONLY_RETURNS:
        yield from _places(items[start + 1 :], home)


def _length(way: Sequence[Place]) -> float:
    return sum(math.dist(a[:2], b[:2]) for a, b in pairwise(way))


_WAY: Mapping[str, Callable[[Way], float]] = {
    "out": lambda way: way.out_m,
    "back": lambda way: _length(way.back),
    "climbs": lambda way: way.climbs,
}


@extractor("way_asked", needs=ITEMS, unit="", args={"what": one_of(", ".join(_WAY), *_WAY)})
def way_asked(mission: Mission, args: Args) -> Value:
    """One number of the whole way of a plane's mission, in m: how far it leads from home to where it lands or returns
    from, with half a circle wherever it turns back, `out`, from there on, the landing included, `back`, and what all of
    it leads up, `climbs`."""
    way = mission.shared(whole_way)
    return way if isinstance(way, Unavailable) else _WAY[str(args.get("what"))](way)


@extractor("home_height", needs=ITEMS, unit="m")
def home_height(mission: Mission, args: Args) -> Value:
    """How high above the sea home is: the higher, the faster a plane flies over ground at the same airspeed."""
    home = home_of(mission)
    return float(home[2]) if home is not None and home[2] else missing("ORGN")
