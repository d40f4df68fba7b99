"""What every log reader offers. Readers stream, never write, and report damage instead of raising on it."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Protocol

from care_core.logs.formats import LogFormat
from care_core.records import Record
from care_core.run import Damage, Setting

if TYPE_CHECKING:  # a log is told by its first bytes before anything needs numbers
    from numpy.typing import NDArray

    from care_core.numbers import Bools, Floats

Wanted = Mapping[str, Sequence[str]]
"""Channel name to the fields to decode; ROS fields are dotted paths such as `pose.pose.position.x`."""


_BURST_S = 0.1


class Channel(Record):
    """A topic or message type: what it carries and how often (`rate_hz` over the channel's own span)."""

    name: str
    type: str
    count: int
    rate_hz: float | None = None

    @classmethod
    def over(cls, name: str, type: str, count: int, span_s: float) -> Channel:
        """A channel whose first and last of `count` messages are `span_s` apart; a burst has no rate."""
        return cls(name, type, count, (count - 1) / span_s if count > 1 and span_s > _BURST_S else None)


Kind = Literal["number", "text", "other"]


class LazyColumns(Mapping[str, Any]):
    """Columns that a reader decodes only when they are asked for, and then only the rows that are left; and the times
    of the rows, likewise."""

    def __init__(self, names: Sequence[str]) -> None:
        self._names = names

    def __contains__(self, name: object) -> bool:
        return name in self._names  # the inherited way would decode the column

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    @property
    @abstractmethod
    def count(self) -> int:
        """Of rows."""

    @property
    @abstractmethod
    def t(self) -> Floats: ...

    @abstractmethod
    def where(self, mask: Bools | slice) -> LazyColumns: ...

    @abstractmethod
    def kind(self, name: str) -> Kind: ...


class Table(Record, eq=False):
    """Decoded messages of one channel.

    `t` has shape (n,), seconds since the start of the log. Each column has shape (n,): float64 for numbers,
    object (str) for text, object for whatever else the message holds. Arrays are read-only by convention.
    """

    times: Floats | None
    """None where the columns are lazy: those of a large log are not all held, see `t`."""
    columns: Mapping[str, NDArray[Any]]

    @property
    def t(self) -> Floats:
        if self.times is not None:
            return self.times
        assert isinstance(self.columns, LazyColumns)
        return self.columns.t

    def __len__(self) -> int:
        if self.times is not None:
            return len(self.times)
        assert isinstance(self.columns, LazyColumns)
        return self.columns.count

    def __getitem__(self, field: str) -> NDArray[Any]:
        return self.columns[field]

    def kind(self, field: str) -> Kind:
        """What a column holds; none is decoded for it."""
        if isinstance(self.columns, LazyColumns):
            return self.columns.kind(field)
        column = self.columns[field]
        if column.dtype.kind == "f":
            return "number"
        return "text" if all(isinstance(value, str) for value in column[:1]) else "other"

    def between(self, start_s: float, end_s: float) -> Table:
        """The messages with start_s <= t <= end_s."""
        import numpy as np

        t = self.t
        if np.all(t[:-1] <= t[1:]):  # in order, as nearly always: views instead of copies
            low, high = np.searchsorted(t, start_s, "left"), np.searchsorted(t, end_s, "right")
            return self.where(slice(int(low), int(high)))
        return self.where((t >= start_s) & (t <= end_s))

    def where(self, mask: Bools | slice) -> Table:
        """The messages of a mask, or of a range of rows."""
        if not isinstance(mask, slice) and mask.all():
            return self
        if isinstance(self.columns, LazyColumns):
            return Table(None, self.columns.where(mask))
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
        """Configuration as driven: per parameter every value it had, in time order, at least one each.

        Names are those of the ecosystem: `WPNAV_SPEED` (ArduPilot); `<namespace>/<parameter>` such as
        `/move_base/DWAPlannerROS/sim_time` (ROS 1); `<node>.<parameter>` with the node's full name and the
        parameter's dotted one, such as `/controller_server.FollowPath.max_vel_x` (ROS 2).
        """

    def read(self, wanted: Wanted) -> Mapping[str, Table]:
        """Decode the wanted fields in one pass. A channel or field that the log lacks is absent from the answer."""


def merge_needs(parts: Iterable[Wanted]) -> dict[str, tuple[str, ...]]:
    """One reading plan out of many: per channel the union of the fields, in order of first mention."""
    plan: dict[str, dict[str, None]] = {}
    for part in parts:
        for channel, fields in part.items():
            plan.setdefault(channel, {}).update(dict.fromkeys(fields))
    return {channel: tuple(fields) for channel, fields in plan.items()}
