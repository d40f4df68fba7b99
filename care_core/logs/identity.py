"""Which recording a log is, by what it holds: a copy that is longer by a byte, renamed or converted is none of its own.
The one place where that is decided.

The digest of a file tells files apart, this tells runs apart: when it began, and how the first samples of it came, so
that a vehicle's log that is cut short is a copy, too. Simulated robots of ROS begin alike to the microsecond, so there
every topic counts to its end.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Mapping
from typing import Protocol, cast

from care_core.logs.base import Log, Table, Wanted
from care_core.numbers import Floats

_SAMPLED: Wanted = {
    "ATT": ("Roll", "Pitch", "Yaw"),
    "vehicle_attitude": ("q[0]", "q[1]", "q[2]", "q[3]"),
}
"""What no two runs begin alike with, of vehicles: by messages that their logs hold, telemetry included."""
_SAMPLES = 200
_DIGITS, _FEWEST = 2, 10


class _Timed(Protocol):
    """A log of ROS, which knows when every message was recorded."""

    def times(self) -> Mapping[str, Floats]: ...


def recording_of(log: Log, read: Callable[[Wanted], Mapping[str, Table]]) -> str:
    """A name that copies of a recording share and no other recording has; "" where too little is there to tell.

    Args:
        read: gives tables of the log, decoded already or not.
    """
    if log.format.ecosystem == "ros":
        begun: list[tuple[object, ...]] = list(_message_times(cast("_Timed", log)))
    else:
        there = {channel.name for channel in log.channels()}
        sampled = {name: fields for name, fields in _SAMPLED.items() if name in there}
        samples = list(_first_samples(read(sampled))) if sampled else []
        moves = len({value for _, values in samples for value in values}) >= _FEWEST
        begun = [*samples] if log.start is not None or moves else []  # on a bench one begins like any other
    if not begun:
        return ""
    parts = (log.format.ecosystem, log.start, begun)
    return hashlib.sha256(repr(parts).encode("utf-8", "backslashreplace")).hexdigest()


def _first_samples(tables: Mapping[str, Table]) -> Iterator[tuple[str, list[str]]]:
    for name, table in sorted(tables.items()):
        for field, column in table.columns.items():
            yield f"{name}.{field}", [f"{value:.{_DIGITS}f}" for value in column[:_SAMPLES].tolist()]


def _message_times(log: _Timed) -> Iterator[tuple[str, int, str, str]]:
    for topic, times in sorted(log.times().items()):
        if len(times):
            yield topic, len(times), f"{times[0]:.4f}", f"{times[-1]:.4f}"
