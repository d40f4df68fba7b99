"""What an ecosystem is: the logs it writes, the model of a run in them, health checks and mission kinds.

One package each (`ardupilot`, `px4`, `ros`), and one line each in `registry`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar

from care_core.ecosystems.dialect import Dialect
from care_core.ecosystems.dictionary import Dictionary, Field, find_field, find_message
from care_core.ecosystems.findings import Event, Finding, Health
from care_core.logs import formats
from care_core.logs.base import Channel, Log, Table, Wanted, merge_needs
from care_core.logs.formats import LogFormat
from care_core.records import Record, field
from care_core.run import Robot, Setting

if TYPE_CHECKING:  # the app draws its first frame before anything needs numbers
    from care_core.ecosystems.spans import Span


class Limit(Record):
    """A number that a check compares with: what it bounds, and where it comes from."""

    name: str
    value: float
    unit: str
    source: str
    """Documentation, source line, physics, or the runs on which it was measured."""


class Limits(list[Limit]):
    """The limits of a check, each declared where it is used: `FEWEST = LIMITS.add("fewest satellites", 6, "", ...)`."""

    def add(self, name: str, value: float, unit: str, source: str) -> float:
        """Declares a limit and answers its value."""
        self.append(Limit(name, value, unit, source))
        return value


R = TypeVar("R", bound="RunModel")


class Check(Record, Generic[R], eq=False):
    """A health check: a pure function of the run model that yields findings, nothing where the log tells too little."""

    name: str
    looks_for: str
    """What it finds, in one clause."""
    reads: Wanted
    """Messages and fields by today's names; of ROS, message types and fields."""
    limits: Limits
    find: Callable[[R], Iterable[Finding]]


class RunModel:
    """A log as its ecosystem understands it: when it was armed, flown, driven. Everything is worked out when it is
    first asked for, and a message is decoded once for all who said beforehand that they will read it."""

    def __init__(self, log: Log) -> None:
        self.log = log
        self.given: Mapping[str, Setting] = {}
        """Parameters of the configuration files that the operator named."""
        self._expected: Wanted = {}
        self._read: Wanted = {}
        self._tables: dict[str, Table] = {}

    def expect(self, plan: Wanted) -> None:
        """Says that these channels and fields will be read, so that one pass over the log decodes them with others."""
        self._expected = merge_needs((self._expected, plan))

    def tables(self, plan: Wanted) -> dict[str, Table]:
        """The channels and fields of a plan that the log holds, as recorded."""
        if self._lacks(plan):
            self.expect(plan)
            lacking = {name: fields for name, fields in self._expected.items() if self._lacks({name: fields})}
            self._tables |= self.decode(lacking)
            self._read = self._expected
        wanted = ((name, self._tables[name], fields) for name, fields in plan.items() if name in self._tables)
        return {name: table for name, table, fields in wanted if any(field in table.columns for field in fields)}

    def decode(self, wanted: Wanted) -> Mapping[str, Table]:
        """One pass over the log."""
        return self.log.read(wanted)

    def plugins(self) -> Mapping[str, tuple[Setting, ...]]:
        """Parameters that say what the software is put together from, as its messages tell them."""
        return {}

    def repeats(self, channel: str) -> tuple[Span, ...]:
        """Spans in which a source only repeats itself while the robot moves: it is frozen, and measures nothing."""
        return ()

    def _lacks(self, plan: Wanted) -> bool:
        return any(field not in self._read.get(name, ()) for name, fields in plan.items() for field in fields)


class Recording(Record):
    """What is to be in the next log. Topics of ROS, or parameters that have a vehicle log it."""

    channels: tuple[str, ...] = ()
    settings: Mapping[str, float] = field(default_factory=dict)
    remarks: Mapping[str, str] = field(default_factory=dict)
    """By parameter, what its value is for."""


class Ecosystem(ABC):
    """Everything that the program knows of one ecosystem. What is heavy is imported by the method that needs it."""

    name: ClassVar[str]
    """As the rows of `logs.formats` name it."""
    title: ClassVar[str]
    dialects: ClassVar[tuple[Dialect, ...]]
    """How configuration files of it are written."""
    measures: ClassVar[tuple[str, ...]]
    """Modules that register its mission kinds and extractors when they are imported."""

    @property
    def formats(self) -> tuple[LogFormat, ...]:
        """The formats of its logs."""
        return tuple(format for format in formats.FORMATS if format.ecosystem == self.name)

    @abstractmethod
    def model(self, log: Log) -> RunModel:
        """The run model of a log; nothing is read yet."""

    @abstractmethod
    def examine(self, model: RunModel) -> Health:
        """What happened, and what is wrong."""

    @abstractmethod
    def log_messages(self, model: RunModel) -> Iterator[Event]:
        """Everything that its software said, in words, with how much it matters; in no order."""

    @abstractmethod
    def checks(self) -> tuple[Check[Any], ...]:
        """Its health checks."""

    @abstractmethod
    def missions(self, channels: tuple[Channel, ...]) -> Iterator[Mapping[str, Any]]:
        """The mission sections under which a log without a profile may hold runs, the likeliest first."""

    @abstractmethod
    def messages(self) -> Dictionary:
        """What its messages mean, by today's names; of ROS, by the type of the message."""

    def field(self, channel: Channel, name: str) -> Field | None:
        """What a field of a channel means, None where that is not known."""
        return find_field(self.messages(), channel.name, name)

    def speaks_at_times(self, log: Log, channel: str) -> bool:
        """Whether a channel is silent by its nature while there is nothing to say."""
        known = find_message(self.messages(), channel)
        return known is not None and known.at_times

    @abstractmethod
    def dialect(self, format: LogFormat, parameters: Iterable[str]) -> Dialect:
        """How its configuration is written, for the parameters of a log of that format."""

    @abstractmethod
    def robots(self, log: Log) -> Iterator[Robot]:
        """Names of the robot that the log tells, the surest first."""

    def how_to_record(self, channel: str) -> str:
        """What to do to have a channel in the next log; "" where it is none of this ecosystem's."""
        return ""

    def to_record(self, channels: Collection[str], vehicle: str) -> Recording:
        """What to record, and what to set for it, to have these channels and what its health checks read.

        Args:
            vehicle: `copter`, `rover`, ..., where that decides; empty where it is not known.
        """
        return Recording(tuple(sorted(channels)))

    def stack(self, facts: Mapping[str, str]) -> str:
        """The name of its software under which tables of parameters know it: `ros1` and `ros2` differ."""
        return self.name
