"""How likely each parameter outside the profile lost this mission, before it is held against other explanations.

A parameter is wrong with a probability that screening flights with such values tell, or its role where none were
flown; it explains a run as far as what it does shows in the way in which the run failed; and one that no phase of the
run reads explains nothing.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence

from care_core.diagnose.outside.off import OffParameter
from care_core.diagnose.outside.signs import Signs
from care_core.diagnose.records import OutsideSuspect
from care_core.metadata.causal_map import OF_THIS_VEHICLE, Meaning, Read, Role, Sign
from care_core.metadata.screening import ScreeningFlight, flights_of
from care_core.run import Run, shown
from care_core.text import listed

UNSCREENED: Mapping[Role, float] = {"choice": 0.05, "safety": 0.05, "wiring": 0.3, "calibration": 0.3}
"""Probability that a value which nobody flew loses a mission, by the role of its parameter."""
OUT_OF_RANGE = 0.2
"""The least of it where the value lies outside what is documented."""
HARMLESS = 0.02
"""Probability that a value loses a mission that lost none when it was flown."""
ANSWERS, MAY_ANSWER = 0.5, 0.03
"""Share of what an unscreened parameter loses that shows as its signs say, first or later."""
CHANGED, UNCHANGED = 10.0, 0.05
"""By how much its odds rise where it was changed since the last good run, and fall where it was not."""
MANY = 20.0
"""From this ratio of its documented bounds on a parameter's distance is that of logarithms."""
UNLIKELY = 0.02
"""Flights that count for every other way to fail: those that were flown do not show all."""
LEAST = 0.02
"""What is less likely is no suspect."""
NEARLY, LEAST_OF_IT = 0.02, 0.002
"""Probability that a limit is missed by one of the values that lost no flight, shared by all that act on it; and the
share from which one of them is told. A flight that kept its limit does not say by how much."""
_LIMITED: frozenset[Sign] = frozenset(
    ("strays", "costly", "slow_takeoff", "slow_cruise", "slow_hold", "slow_rtl", "slow_land")
)
"""Signs of a mission that was flown, and missed a limit."""


def outside_suspects(
    off: Iterable[OffParameter], signs: Signs, read: frozenset[Read], kind: str
) -> tuple[OutsideSuspect, ...]:
    """The parameters that may have lost a run, the likeliest first.

    Args:
        read: the phases and protections of this run (`phases_of`).
    """
    every = list(off)
    acting = [one for one in every if one.meaning.read & read]
    built = {(one.meaning.role, _block(one.name)) for one in every if one.is_changed is not True}
    counts = Counter(role for role, _ in built)
    found = []
    for one in acting:
        flights = flights_of(one.name, kind)
        like = [flight for flight in flights if flight.is_lost and _is_alike(flight, signs)]
        weight = _wrong(one, flights, counts) * _shows(one, flights, like, signs)
        if weight >= LEAST:
            found.append(_suspect(one, weight, _flown(one.value, like)))
    if not found:
        found.extend(_just_missing(acting, signs, kind))
    return tuple(sorted(found, key=lambda suspect: (-suspect.weight, suspect.name)))


def _just_missing(acting: Iterable[OffParameter], signs: Signs, kind: str) -> Iterator[OutsideSuspect]:
    """Parameters that lost no flight and act on the limit that was missed, as far as they are off."""
    if not signs.first or not signs.first <= _LIMITED:
        return
    flown = [(one, flights_of(one.name, kind)) for one in acting if one.meaning.signs & signs.first]
    ways = [(one, _farthest(one, flights)) for one, flights in flown if flights and not any(f.is_lost for f in flights)]
    total = sum(way for _, way in ways)
    for one, way in ways:
        weight = NEARLY * way / max(1.0, total)
        if weight >= LEAST_OF_IT:
            yield _suspect(one, weight, "")


def _farthest(one: OffParameter, flights: Sequence[ScreeningFlight]) -> float:
    """How far a value is on the way to the farthest that was flown, at most 1."""
    reference = flights[0].reference
    side = [flight for flight in flights if (flight.value - reference) * (one.value - reference) > 0]
    return 1.0 if one.is_code else min((min(1.0, abs(_way(one.value, flight))) for flight in side), default=0.0)


def _block(name: str) -> str:
    """What is set together: the axes and the instances of one calibration."""
    return re.sub(r"\d+|_[XYZ]$", "", name)


def _suspect(one: OffParameter, weight: float, flown: str) -> OutsideSuspect:
    before = f"; it was {shown(one.last_good)} in the good run" if one.is_changed and one.last_good is not None else ""
    text = f"{one.name} {shown(one.value)} (default {shown(one.default)}){before}{': ' if flown else ''}{flown}"
    return OutsideSuspect(
        one.name, one.value, one.back, weight, one.meaning.role, bool(flown), text, one.last_good is not None
    )


def phases_of(run: Run, has_begun: bool) -> frozenset[Read]:
    """When the firmware read parameters in this run.

    Args:
        has_begun: whether it took off; for what drives, whether it armed.
    """
    read: set[Read] = {"always", "arming", "battery", "radio", "gcs"}
    if run.mission.ended or has_begun:
        read |= {"takeoff"}
    modes = {mode.casefold() for mode in run.modes}
    if has_begun:
        read |= {"navigation", "hold", "land"}
        asked = dict(run.mission.asked)
        if asked.get("returns") or any("rtl" in mode or mode == "return" for mode in modes):
            read.add("rtl")
    if any("guided" in mode or mode == "offboard" for mode in modes):
        read.add("guided")
    if modes - _BY_ITSELF:
        read.add("manual")
    for phase, switch in _SWITCHES.items():
        setting = run.settings.get(switch)
        if setting is not None and isinstance(setting.value, (int, float)) and setting.value > 0:
            read.add(phase)
    return frozenset(read)


_BY_ITSELF = frozenset(
    ("auto", "rtl", "land", "guided", "smart rtl", "hold", "mission", "return", "takeoff", "offboard", "descend")
)
"""Modes that no pilot flies: ArduPilot's and PX4's."""
_SWITCHES: Mapping[Read, str] = {
    "fence": "FENCE_ENABLE", "terrain": "TERRAIN_ENABLE", "rangefinder": "RNGFND1_TYPE", "flow": "FLOW_TYPE",
    "beacon": "BCN_TYPE", "airspeed": "ARSPD_TYPE",
}  # fmt: skip
"""The parameter that has something used at all."""


def _wrong(one: OffParameter, flights: Sequence[ScreeningFlight], blocks: Mapping[Role, int]) -> float:
    """Probability that this value loses such a mission."""
    share = _lost(one, flights) if flights else UNSCREENED.get(one.meaning.role, 0.0)
    if one.is_out_of_range:
        share = max(share, OUT_OF_RANGE)
    if one.meaning.role in OF_THIS_VEHICLE and one.is_changed is not True:  # one among many is off for a good reason
        share /= blocks[one.meaning.role]
    if one.is_changed is None:
        return share
    factor = CHANGED if one.is_changed else UNCHANGED
    return factor * share / (factor * share + 1.0 - share) if share < 1.0 else share


def _lost(one: OffParameter, flights: Sequence[ScreeningFlight]) -> float:
    """Probability that the value loses a mission, by the screening flights: at its value, or as much of the way to the
    bound that was lost as it is off, to that of the other side where this one was not flown."""
    reference = flights[0].reference
    if math.isclose(reference, one.value, rel_tol=1e-4, abs_tol=1e-6):
        return HARMLESS  # every flight had it
    if same := _at(one, flights):
        return _share(same)
    if one.is_code:
        return _share(flights)
    side = [flight for flight in flights if (flight.value - reference) * (one.value - reference) > 0]
    ways = [(min(1.0, abs(_way(one.value, flight))), flight.is_lost) for flight in side or flights]
    return max(HARMLESS, *(way * is_lost for way, is_lost in ways))


def _at(one: OffParameter, flights: Sequence[ScreeningFlight]) -> list[ScreeningFlight]:
    """The flights with this very value."""
    return [flight for flight in flights if math.isclose(flight.value, one.value, rel_tol=1e-4, abs_tol=1e-6)]


def _way(value: float, flight: ScreeningFlight) -> float:
    """How far a value is on the way from the reference to the one that was flown."""
    ends = sorted((abs(flight.value), abs(flight.reference)))
    if flight.value * flight.reference > 0 and ends[1] > MANY * ends[0] and value * flight.value > 0:
        return math.log(value / flight.reference) / math.log(flight.value / flight.reference)
    return (value - flight.reference) / (flight.value - flight.reference)


def _share(flights: Sequence[ScreeningFlight]) -> float:
    """Share that was lost, as seen in so few: Jeffreys' estimate."""
    lost = sum(flight.is_lost for flight in flights)
    return (lost + 0.5) / (len(flights) + 1.0) if lost else HARMLESS


def _is_alike(flight: ScreeningFlight, signs: Signs) -> bool:
    """Whether a run failed as a flight did: for the same refusal, or the first signs of each are among those of the
    other."""
    if signs.refusals or flight.refusals:
        return bool(signs.refusals & flight.refusals)
    return bool(flight.first & signs.every) and bool(signs.first & flight.every)


def _shows(
    one: OffParameter, flights: Sequence[ScreeningFlight], like: Sequence[ScreeningFlight], signs: Signs
) -> float:
    """Probability that a mission which the parameter loses fails in this way, by flights and by the causal map where
    nobody flew the value, or not with such a frame."""
    lost = sum(flight.is_lost for flight in flights)
    flown = (len(like) + UNLIKELY) / (lost + 0.5) if lost else 0.0
    is_known = bool(_at(one, flights)) and one.meaning.part != "frame"
    return flown if is_known else max(flown, _answers(one.meaning, signs))


def _answers(meaning: Meaning, signs: Signs) -> float:
    if signs.refusals:
        return 0.0  # the check's own words tell what it reads
    if meaning.signs & signs.first:
        return ANSWERS
    return MAY_ANSWER if meaning.signs & signs.every else 0.0


def _flown(value: float, like: Sequence[ScreeningFlight]) -> str:
    """Which flights failed as this run did: those with its value, else with the nearest ones."""
    if not like:
        return ""
    flown = {flight.value for flight in like}
    nearest = sorted(flown, key=lambda one: (abs(one - value), one))[: 1 if value in flown else 3]
    values = listed([shown(one) for one in sorted(nearest)])
    return f"simulated flights with it at {values} failed in this way"
