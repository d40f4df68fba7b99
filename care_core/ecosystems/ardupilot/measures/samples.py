"""The samples of a message that a measure of an ArduPilot run rests on."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from care_core.ecosystems.ardupilot.instances import split
from care_core.ecosystems.ardupilot.measures.modes import flight_of
from care_core.ecosystems.ardupilot.messages import MESSAGES
from care_core.ecosystems.coverage import SUM, Bears, Samples, doubt
from care_core.ecosystems.dictionary import Message
from care_core.ecosystems.measures import Args, Mission
from care_core.ecosystems.spans import Span
from care_core.logs.base import Table
from care_core.numbers import Floats
from care_core.run import Unavailable

_NAMES = {
    "BAT": "the battery", "POS": "the position", "GPS": "the receiver", "ATT": "the attitude", "VIBE": "the vibration",
    "RCOU": "the outputs", "THR": "the throttle", "STER": "the steering",
}  # fmt: skip
_ANY = Message({})
_BY_GPS = 3
"""EK3_SRC1_POSXY where the estimator has its position from the receiver, as it is shipped."""


def whole(mission: Mission) -> Span:
    """From arming to disarming."""
    return mission.start_s, mission.end_s


def samples(
    mission: Mission, channel: str, fields: Iterable[str], spans: Iterable[Span], bears: Bears,
    moments: Iterable[float] = (), one: Table | None = None,
) -> Samples:  # fmt: skip
    """The samples of a message's first instance, or of `one`, that hold numbers in all of these fields."""
    table = mission.tables.get(channel)
    first = one if one is not None or table is None else next(iter(split(channel, table)), table)
    t = np.empty(0) if first is None else _times_known(first, fields)
    own = flight_of(mission).repeats(channel)
    dead, dead_name = (own, "") if own or channel != "POS" else (_misled(mission), named("GPS"))
    if MESSAGES.get(channel, _ANY).at_times:
        spans = ()  # its silence is no hole
    return Samples(named(channel), t, tuple(spans), bears, tuple(moments), dead, dead_name)


def named(channel: str) -> str:
    """A message as a reader reads it."""
    return f"{_NAMES[channel]} ({channel})" if channel in _NAMES else channel


def _times_known(table: Table, fields: Iterable[str]) -> Floats:
    known = [np.isfinite(table[field]) for field in fields if field in table.columns]
    return table.t if all(one.all() for one in known) else table.t[np.logical_and.reduce(known)]


def _misled(mission: Mission) -> tuple[Span, ...]:
    """Where the receiver is frozen that the estimate of the position has no other than."""
    flight = flight_of(mission)
    by_gps = mission.settings.get("EK3_SRC1_POSXY", _BY_GPS) == _BY_GPS
    return flight.repeats("GPS") if by_gps and len(flight.all("GPS")) < 2 else ()


def everything(mission: Mission, args: Args) -> Iterator[Samples]:
    """Whatever comes steadily: where nothing of it was recorded, no event was either."""
    streams = [table.t for name, table in mission.tables.items() if not MESSAGES.get(name, _ANY).at_times]
    if streams:
        yield Samples("the flight", np.concatenate(streams), [whole(mission)], SUM)


def lost_events(mission: Mission) -> Unavailable | None:
    """Why what the log does not say may have happened all the same; None where it holds the whole run."""
    return next((why for one in everything(mission, {}) if (why := doubt(one)) is not None), None)
