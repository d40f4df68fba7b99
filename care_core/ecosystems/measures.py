"""The extractor library's frame: a profile names an extractor, the registry finds it and says what it needs.

An extractor is a pure function of one mission and its arguments. It answers a number or `Unavailable`; it
never raises on poor data. New platforms are YAML files that combine these, not code.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import wraps
from typing import Any, TypeGuard, TypeVar

from care_core.ecosystems.base import RunModel
from care_core.ecosystems.coverage import Samples, doubt
from care_core.errors import ProfileError, nearest
from care_core.logs.base import Table, Wanted
from care_core.records import Record, field
from care_core.run import Evidence, OutcomeCheck, Unavailable, Value

Args = Mapping[str, Any]
T = TypeVar("T")


class Argument(str):
    """What an argument means, in words, and what it may be."""

    accepts: Callable[[object], bool]
    choices: tuple[str, ...]

    def __new__(cls, meaning: str, accepts: Callable[[object], bool], choices: tuple[str, ...] = ()) -> Argument:
        argument = super().__new__(cls, meaning)
        argument.accepts, argument.choices = accepts, choices
        return argument


def one_of(meaning: str, *choices: str) -> Argument:
    """An argument that is one of few words."""
    return Argument(meaning, lambda value: value in choices, choices)


def numeric(meaning: str) -> Argument:
    """An argument that is a number."""
    return Argument(meaning, _is_number)


def points(meaning: str, *sizes: int) -> Argument:
    """An argument that lists points, each of one of these counts of numbers."""

    def accepts(value: object) -> bool:
        return isinstance(value, list) and all(
            isinstance(point, list) and len(point) in sizes and all(map(_is_number, point)) for point in value
        )

    return Argument(meaning, accepts)


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


class Mission(Record, eq=False):
    """One mission cut out of a log: what extractors see.

    `model` is the run model of the whole log, of the ecosystem that wrote it. `tables` hold the decoded channels of
    the whole log (times in seconds from its start); `start_s` and `end_s` bound the mission in it. `spec` is the
    profile's `mission` section (its goals or waypoints). `cache` lets extractors share an analysis of the same mission,
    see `shared`.
    """

    model: RunModel
    tables: Mapping[str, Table]
    start_s: float
    end_s: float
    ended: bool
    spec: Mapping[str, Any]
    settings: Mapping[str, float | str] = field(default_factory=dict)
    """Parameters as driven in this mission, by their name in the log."""
    facts: Mapping[str, str] = field(default_factory=dict)
    """What the log says of its robot."""
    cache: dict[Any, Any] = field(default_factory=dict)

    def table(self, channel: str) -> Table | None:
        """The messages of a channel inside the mission, None when the log lacks the channel."""
        table = self.tables.get(channel)
        return None if table is None else table.between(self.start_s, self.end_s)

    def shared(self, analysis: Callable[[Mission], T]) -> T:
        """`analysis(self)`, computed once per mission."""
        if analysis not in self.cache:
            self.cache[analysis] = analysis(self)
        answer: T = self.cache[analysis]
        return answer


Compute = Callable[[Mission, Args], Value]
RestsOn = Callable[[Mission, Args], Iterable[Samples]]
"""The samples that a measure is made of: where they do not cover what it measures, it answers no number."""


class Extractor(Record):
    """A named extractor: the channels and fields it reads (`needs`), its unit, its arguments with their meaning."""

    name: str
    compute: Compute
    needs: Callable[[Args], Wanted]
    unit: str
    doc: str
    args: Mapping[str, str] = field(default_factory=dict)
    parts: tuple[str, ...] = ()
    """What it reads of the channels that the mission section names, beside `needs`: `odometry`, `battery`, ..."""


class MissionKind(ABC):
    """How missions are found in a log, one subclass an ecosystem (see `ardupilot` and `navigation`)."""

    name: str
    args: Mapping[str, str]

    @abstractmethod
    def needs(self, spec: Args) -> Wanted:
        """The channels and fields that `missions`, `fit` and `evidence` read."""

    @abstractmethod
    def missions(self, model: RunModel, tables: Mapping[str, Table], spec: Args) -> tuple[Mission, ...]:
        """Every mission of a log, in time order, out of the tables that its profile reads; empty when it holds none."""

    @abstractmethod
    def mismatch(self, mission: Mission) -> str:
        """Why this is not the mission that the profile's thresholds belong to, one sentence; '' when it is."""

    @abstractmethod
    def evidence(self, mission: Mission) -> tuple[Evidence, ...]:
        """Messages that speak about a failure of this mission, in time order."""

    def shortfall(self, mission: Mission) -> tuple[str, ...]:
        """What kept the mission from being accomplished, in clauses; asked of one that was not."""
        return ()

    def is_decided(self, mission: Mission) -> bool:
        """Whether the log says how the mission came out: it holds its end, or what made it fail for good."""
        return mission.ended

    def left_s(self, mission: Mission) -> float | None:
        """When a failsafe took the robot off its mission, None where none did."""
        return None

    def checks(self, mission: Mission) -> tuple[OutcomeCheck, ...]:
        """What a run that had no mission is judged by; none where there was one."""
        return ()

    def outcome(self, mission: Mission) -> tuple[OutcomeCheck, ...]:
        """What any run is judged by where no profile fits: by what its robot says of itself, and by no limit."""
        return ()

    def span(self, mission: Mission, phase: str) -> tuple[float, float] | None:
        """Start and end in the log of a part of the mission, by its name; None where the mission has no such part."""
        return None

    def modes(self, mission: Mission) -> tuple[str, ...]:
        """The modes in force during the mission, by name; none where the log does not say."""
        return ()


EXTRACTORS: dict[str, Extractor] = {}
MISSION_KINDS: dict[str, MissionKind] = {}


def extractor(
    name: str,
    *,
    needs: Wanted | Callable[[Args], Wanted],
    unit: str,
    args: Mapping[str, str] | None = None,
    parts: Sequence[str] = (),
    rests_on: RestsOn | None = None,
) -> Callable[[Compute], Compute]:
    """Register a function as the extractor `name`; its docstring becomes the documentation. What rests on no samples,
    such as what the log's events say, needs no `rests_on`."""

    def register(measure: Compute) -> Compute:
        compute = measure if rests_on is None else resting(measure, rests_on)
        find_needs = needs if callable(needs) else lambda _args: needs
        doc = " ".join((compute.__doc__ or "").split())
        EXTRACTORS[name] = Extractor(name, compute, find_needs, unit, doc, args or {}, tuple(parts))
        return compute

    return register


def resting(measure: Compute, rests_on: RestsOn) -> Compute:
    """The measure where its samples cover what it measures, why not where they do not."""

    @wraps(measure)
    def compute(mission: Mission, args: Args) -> Value:
        value = measure(mission, args)
        if isinstance(value, Unavailable):
            return value
        doubts = (doubt(samples) for samples in rests_on(mission, args))
        return next((one for one in doubts if one is not None), value)

    return compute


def find_extractor(kind: str, where: str = "") -> Extractor:
    """The extractor of that name; raises ProfileError that names the nearest one."""
    if kind not in EXTRACTORS:
        raise ProfileError(f"There is no extractor '{kind}'.", hint=nearest(kind, EXTRACTORS), where=where)
    return EXTRACTORS[kind]


def check_args(given: Args, known: Mapping[str, str], what: str, where: str) -> None:
    """Refuse arguments that `what` does not take, and values that they cannot have. Raises ProfileError."""
    for name, value in given.items():
        if name not in known:
            hint = nearest(name, known) or (f"It takes {', '.join(known)}." if known else "It takes none.")
            raise ProfileError(f"{what} has no argument '{name}'.", hint=hint, where=where)
        argument = known[name]
        if isinstance(argument, Argument) and not argument.accepts(value):
            hint = nearest(str(value), argument.choices)
            raise ProfileError(f"{what} takes no '{name}: {value}'.", hint=hint or f"It is: {argument}.", where=where)


def has(table: Table | None, *fields: str) -> TypeGuard[Table]:
    """Whether a table is there with all these fields and at least one row."""
    return table is not None and len(table) > 0 and all(field in table.columns for field in fields)


def missing(channel: str, hint: str = "") -> Unavailable:
    """The answer of an extractor whose channel is not in the log."""
    from care_core.ecosystems.registry import how_to_record  # the registry's packages import this module

    name = channel.partition(" ")[0]  # "ARM with Forced" is a field that an old ARM lacks
    return Unavailable(f"no {channel} in the log", hint or how_to_record(channel), name)
