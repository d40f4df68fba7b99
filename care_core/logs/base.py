"""What every log reader offers. Readers stream, never write, and report damage instead of raising on it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from care_core.run import Damage, Setting

Wanted = Mapping[str, Sequence[str]]
"""Channel name to the fields to decode; ROS fields are dotted paths such as `pose.pose.position.x`."""


class LogFormat(str, Enum):
    """The formats that are told apart by content."""

    DATAFLASH_BIN = "dataflash-bin"
    ROS1_BAG = "ros1-bag"


@dataclass(frozen=True, slots=True)
class Channel:
    """A topic or message type: what it carries and how often (`rate_hz` over the channel's own span)."""

    name: str
    type: str
    count: int
    rate_hz: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """Decoded messages of one channel.

    `t` has shape (n,), seconds since the start of the log. Each column has shape (n,): float64 for numbers,
    object (str) for text, object for whatever else the message holds. Arrays are read-only by convention.
    """

    t: NDArray[np.float64]
    columns: Mapping[str, NDArray[Any]]

    def __len__(self) -> int:
        return len(self.t)

    def __getitem__(self, field: str) -> NDArray[Any]:
        return self.columns[field]

    def between(self, start_s: float, end_s: float) -> Table:
        """The messages with start_s <= t <= end_s."""
        if np.all(self.t[:-1] <= self.t[1:]):  # in order, as nearly always: views instead of copies
            low, high = np.searchsorted(self.t, start_s, "left"), np.searchsorted(self.t, end_s, "right")
            return self.where(slice(int(low), int(high)))
        return self.where((self.t >= start_s) & (self.t <= end_s))

    def where(self, mask: NDArray[np.bool_] | slice) -> Table:
        """The messages of a mask, or of a range of rows."""
        return Table(self.t[mask], {name: column[mask] for name, column in self.columns.items()})


class Log(Protocol):
    """An open log. Reading the same log twice gives the same answer; nothing is kept open between calls."""

    @property
    def path(self) -> Path: ...

    @property
    def format(self) -> LogFormat: ...

    @property
    def start(self) -> str | None:
        """ISO 8601 UTC time of the first message, None where the log has no believable wall clock."""

    @property
    def duration_s(self) -> float: ...

    @property
    def damage(self) -> tuple[Damage, ...]: ...

    @property
    def facts(self) -> Mapping[str, str]:
        """What the log says of its robot, such as `firmware`, `frame`, `stack`."""

    def channels(self) -> tuple[Channel, ...]: ...

    def settings(self) -> Mapping[str, tuple[Setting, ...]]:
        """Configuration as driven: per parameter every value it had, in time order, at least one each."""

    def read(self, wanted: Wanted) -> Mapping[str, Table]:
        """Decode the wanted fields in one pass. A channel or field that the log lacks is absent from the answer."""
