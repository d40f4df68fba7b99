"""What measures of an ArduPilot run rest on: samples of a message, over the flight, under way, or in a phase."""

from __future__ import annotations

from collections.abc import Iterator

from care_core.ecosystems.ardupilot.measures.flown_mission import analyse
from care_core.ecosystems.ardupilot.measures.phases import span_of_phase
from care_core.ecosystems.ardupilot.measures.samples import samples, whole
from care_core.ecosystems.coverage import EXTREME, MEAN, SUM, USUAL, Bears, Samples
from care_core.ecosystems.measures import Args, Mission, RestsOn
from care_core.ecosystems.spans import Span
from care_core.run import Unavailable

_OF_STAT = {"max": EXTREME, "min": EXTREME}
_RETURNING = ("return", "return_climb", "return_cruise", "descent", "touchdown")
"""Phases that are told by heights."""


def position(bears: Bears) -> RestsOn:
    """The position from arming to disarming."""

    def rests_on(mission: Mission, args: Args) -> Iterator[Samples]:
        bearing = _OF_STAT.get(str(args.get("stat", "")), bears)
        yield samples(mission, "POS", ("Lat", "Lng"), [whole(mission)], bearing)

    return rests_on


def landing(mission: Mission, args: Args) -> Iterator[Samples]:
    """The position where the run ended."""
    yield samples(mission, "POS", ("Lat", "Lng"), (), SUM, [mission.end_s])


def heights_of_phase(mission: Mission, args: Args) -> Iterator[Samples]:
    """The height on the way back, for the phases that are told by it."""
    if str(args.get("phase", "return")) in _RETURNING:
        climb = span_of_phase(mission, {"phase": "return_climb"})
        start_s = mission.start_s if isinstance(climb, Unavailable) else climb[0]
        yield samples(mission, "POS", ("RelHomeAlt",), [(start_s, mission.end_s)], EXTREME)


def of(channel: str, *fields: str, bears: Bears = MEAN) -> RestsOn:
    """A message under way, or in the phase that is asked for, and the height that tells where it was under way."""

    def rests_on(mission: Mission, args: Args) -> Iterator[Samples]:
        bearing = _OF_STAT.get(str(args.get("stat", "")), bears)
        if "phase" in args:
            span = span_of_phase(mission, args)
            yield samples(mission, channel, fields, () if isinstance(span, Unavailable) else [span], bearing)
            return
        if mission.shared(analyse).drive is None:
            yield samples(mission, "POS", ("RelHomeAlt",), [whole(mission)], USUAL)
        yield samples(mission, channel, fields, under_way(mission), bearing)

    return rests_on


def all_of(*parts: RestsOn) -> RestsOn:
    """Several of them."""
    return lambda mission, args: (one for part in parts for one in part(mission, args))


def under_way(mission: Mission) -> list[Span]:
    """Where the vehicle was on its way: in its mission, or from where it left the ground to where it was back."""
    flown = mission.shared(analyse)
    if flown.drive is not None:
        return [(flown.drive.start_s, flown.drive.end_s)]
    if flown.track is None:
        return []
    up = flown.track.t[flown.under_way(flown.track.t)]
    return [(float(up[0]), float(up[-1]))] if len(up) else []
