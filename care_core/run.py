"""One mission, as read from a log: configuration, context, metrics, objectives, and where each came from."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Literal, TypeGuard

from care_core.records import Record, field, replace
from care_core.text import but_for_numbers, log_time, times_until


class Unavailable(Record):
    """A value that could not be had: why, and how to have it next time. A result, not an error."""

    reason: str
    hint: str = ""
    channel: str = ""
    """The channel that is not in the log, where that is why."""
    never_varied: bool = False
    """Whether it is that a sensor said the same throughout: one is broken, or nothing stirred."""


Value = float | Unavailable


def is_known(value: Value | None) -> TypeGuard[float]:
    """Whether there is a number to work with."""
    return value is not None and not isinstance(value, Unavailable)


def shown(value: float | str | None) -> str:
    """A parameter's value as an operator writes it."""
    if value is None:
        return "not there"
    return value if isinstance(value, str) else f"{value:.7g}"


def is_said_again(before: float | str, value: float) -> bool:
    """Whether a record of a parameter says what the one before it said; what is not a number equals nothing."""
    return before == value or (before != before and value != value)


class Setting(Record):
    """A parameter as driven: its last value before the mission ended, and what the source says about it."""

    name: str
    value: float | str
    source: str
    default: float | str | None = None
    low: float | None = None
    high: float | None = None
    changed_at_s: float | None = None
    """Seconds from the start of the log of the last change after the first value, None when it never changed."""


Settings = Mapping[str, Sequence[Setting]]
"""By parameter the values that it had, in order of time."""
Find = Callable[[str], Setting | None]
"""What files give a parameter, by its name in a log; None where they give nothing."""


class Damage(Record):
    """What is broken in a log, at which byte, at which second of the log (None: unknown)."""

    what: str
    byte: int | None = None
    time_s: float | None = None
    is_jump: bool = False
    """Whether the clock of the log jumps there: what lies between two records of it is unknown."""
    is_whole: bool = False
    """Whether no byte of the file is broken: only the times or the order of its messages are odd."""


def place_of_damage(what: str, byte: int | None, time_s: float | None, told: Callable[[float], str] = log_time) -> str:
    """` at byte N, at 3.5 s`, without what the words say themselves.

    Args:
        told: how a time is written.
    """
    at = "" if byte is None or f"at byte {byte}" in what else f" at byte {byte}"
    is_told = time_s is None or f"read to {log_time(time_s)}" in what
    return at if is_told or time_s is None else f"{at}, at {told(time_s)}"


class Evidence(Record):
    """A message of this run that speaks about its failure, with the options it points at (may be none)."""

    time_s: float
    text: str
    kind: str
    """`refusal`, `failsafe`, `crash`, `planner`, ..., as named by the extractor that found it."""
    options: tuple[str, ...] = ()
    says: str = ""
    """What the message means, where the profile knows it."""
    circumstance: str | None = None
    """What the run met, where the message speaks of no parameter."""
    is_concluded: bool = False
    """Whether this program says so, and no message of the robot does."""

    def __str__(self) -> str:
        meaning = f" ({self.says})" if self.says else ""
        return f"this run says: {self.text}{meaning}"


def gathered(evidence: Iterable[Evidence]) -> tuple[Evidence, ...]:
    """The messages, those that differ in nothing but numbers as one, with their count and when the last one was."""
    groups: dict[object, list[Evidence]] = {}
    for one in evidence:
        groups.setdefault((one.kind, but_for_numbers(one.text), one.options, one.says), []).append(one)
    return tuple(
        replace(several[0], text=several[0].text + times_until(len(several), several[-1].time_s))
        for several in groups.values()
    )


class OutcomeCheck(Record):
    """A plain question to a run that no limit judges: did it take off, did it land. 1 is yes and well, 0 is no."""

    name: str
    value: Value
    doc: str
    """What is so where all is well: "it left the ground"."""
    otherwise: str = ""
    """What is said where it is not: "a failsafe acted"."""


class Robot(Record):
    """One robot among several. Runs belong together by `id`; `name` is what people read."""

    id: str
    name: str
    source: str
    """What says so."""
    is_sure: bool
    """Whether it tells this robot from others of its kind: a system id as delivered, or a model's name, does not."""
    is_simulated: bool = False
    """Whether it is a simulator's: every vehicle that this machine simulates has this id."""

    @property
    def digest(self) -> str:
        """What tells it from others without naming it; empty where its id does not, as a simulator's."""
        return hashlib.sha256(self.id.encode()).hexdigest()[:16] if self.is_sure and not self.is_simulated else ""


class LogInfo(Record):
    """Where a run came from."""

    path: str
    format: str
    start: str | None
    """ISO 8601 wall-clock time (UTC) of the first message, None where the log has no wall clock."""
    duration_s: float
    sha256: str
    damage: tuple[Damage, ...] = ()
    facts: Mapping[str, str] = field(default_factory=dict)
    """What the log says of its robot: firmware, frame, distro."""
    robot: Robot | None = None
    """Whose log it is, None where nothing says so."""
    recording: str = ""
    """What copies of a recording share, whatever their files are called and how long they are."""

    @property
    def identity(self) -> str:
        """What tells this run from others: its recording, else its file."""
        return self.recording or self.sha256


FitVerdict = Literal["fits", "partly", "no"]
FIT_WORDS: Mapping[FitVerdict, str] = {"fits": "fits", "partly": "partly fits", "no": "does not fit"}


NO_PROFILE_FOR = "no profile is for "
"""How a reason ends where it is the kind of vehicle that nobody has learned a profile of."""


class Fit(Record):
    """How well a profile fits a log: "partly" caps every confidence at low, with "no" training tells nothing."""

    verdict: FitVerdict
    reasons: tuple[str, ...] = ()
    """What is missing or differs, one clause each; empty where it fits."""

    def with_objection(self, *reasons: str) -> Fit:
        """The fit with more found that differs: in part at best."""
        if not reasons:
            return self
        return Fit("no" if self.verdict == "no" else "partly", tuple(dict.fromkeys((*self.reasons, *reasons))))


FITS = Fit("fits")


class ProfileChoice(Record):
    """The profile that was used, how it was chosen, and how well it fits the log."""

    name: str
    version: str
    platform: str
    reason: str
    fit: Fit = FITS
    origin: str = ""
    """Where a profile is from that is not CaRE's own and not one of the user's, in a clause; empty for those."""
    instead: str = ""
    """The installed profile that fits the log, where the operator named another that does not."""

    @property
    def title(self) -> str:
        """Its name, and where it is from if that needs to be known; empty where there is none."""
        return profile_title(self.name, self.origin)


def profile_title(name: str, origin: str) -> str:
    """A profile's name with where it is from."""
    return f"{name} ({origin})" if origin else name


class MissionInfo(Record):
    """Which mission of the log this is. `index` counts from 1; `fits` says whether it is the profile's mission."""

    index: int
    count: int
    start_s: float
    end_s: float
    ended: bool
    """False when the log stops before the mission is decided: nothing about its end is known."""
    fits: bool
    mismatch: str = ""
    """Why it is not the profile's mission, in one sentence; empty when it fits."""
    asked: tuple[tuple[str, float], ...] = ()
    """What the mission asks for, by context, known before it is flown: runs that were asked the same compare."""
    left_s: float | None = None
    """When a failsafe took the robot off the mission, in seconds of the log; None where none did."""


class Run(Record):
    """One mission. Keys are the profile's variable names; `config` lacks options that no source holds."""

    config: Mapping[str, float]
    context: Mapping[str, Value]
    metrics: Mapping[str, Value]
    objectives: Mapping[str, Value]
    settings: Mapping[str, Setting]
    log: LogInfo
    mission: MissionInfo
    evidence: tuple[Evidence, ...] = ()
    changes: Mapping[str, tuple[Setting, ...]] = field(default_factory=dict)
    """Per parameter that changed during the mission: the value it began with, and each later one until its end."""
    checks: tuple[OutcomeCheck, ...] = ()
    """What a run is judged by that flew no mission, or that no profile fits; empty where a profile judges it."""
    modes: tuple[str, ...] = ()
    """The modes that were in force during the mission; empty where the log does not say."""
    shortfall: tuple[str, ...] = ()
    """What kept the mission from being accomplished, in clauses; empty where it was, or the log does not say."""
    sources: Mapping[str, str] = field(default_factory=dict)
    """Per option of `config` where its value came from: a record or topic of the log, or file:line."""

    @property
    def noun(self) -> str:
        """What to call it: a mission, or a run that was no mission or is judged without one."""
        return "run" if self.checks else "mission"

    def left_at(self, parameter: str) -> Setting | None:
        """What a parameter was at last: where it was changed on the way, that is what has to go back."""
        history = self.changes.get(parameter)
        return history[-1] if history else self.settings.get(parameter)

    def value(self, name: str) -> Value | None:
        """The run's value of a variable of any role, None when the run does not hold it."""
        parts: tuple[Mapping[str, Value], ...] = (self.config, self.context, self.metrics, self.objectives)
        return next((part[name] for part in parts if name in part), None)

    def with_evidence(self, *others: Evidence) -> Run:
        """The run with more that speaks about its failure, all of it in order of time."""
        return replace(self, evidence=tuple(sorted((*self.evidence, *others), key=lambda one: one.time_s)))

    @property
    def refused_by(self) -> frozenset[str]:
        """Options that the check reads which refused this mission, and whose value sets it off.

        Only a refusal is proof: the mission ended there. A message in flight says what happened, not why.
        """
        return frozenset(option for e in self.evidence if e.kind == "refusal" for option in e.options)
