"""Which profile fits a log, and what of the log differs from it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, TypeVar

from care_core.diagnose.records import ProfileChoice
from care_core.errors import LogError, ProfileError
from care_core.extract.read import reading_plan
from care_core.extract.settings import readable
from care_core.extract.telemetry import as_dataflash
from care_core.logs.base import Log
from care_core.profile.schema import Schema

NEARLY_AS_WELL = 0.9
"""Another profile is named when it matches at least this share of what the chosen one does."""


class HasSchema(Protocol):
    """Anything that carries a schema, such as a loaded profile."""

    @property
    def schema(self) -> Schema: ...


P = TypeVar("P", bound=HasSchema)


@dataclass(frozen=True, slots=True)
class Fit:
    """How much of a profile a log holds: options with a parameter, sources among its channels, matched names."""

    schema: Schema
    options: int
    sources: int
    sources_wanted: int
    names: int

    @property
    def found(self) -> int:
        return self.options + self.sources

    def __str__(self) -> str:
        return (
            f"{self.options} of {len(self.schema.options)} options and {self.sources} of {self.sources_wanted}"
            " sources are in the log"
        )


def choose_profile(log: Log, candidates: Sequence[P]) -> tuple[P, ProfileChoice]:
    """The candidate with most parameters and sources in the log, then with the robot's or firmware's name.

    Raises:
        ProfileError: no candidate has anything in common with the log.
    """
    fits = [measure_fit(log, candidate.schema) for candidate in candidates]
    order = sorted(range(len(fits)), key=lambda i: (-fits[i].found, -fits[i].names, fits[i].schema.name))
    usable = [i for i in order if fits[i].found]
    if not usable:
        raise _nothing_readable(log) or _nothing_fits(log, fits)
    best = fits[usable[0]]
    others = [fits[i].schema.name for i in usable[1:] if fits[i].found >= NEARLY_AS_WELL * best.found]
    return candidates[usable[0]], _choice(log, best, others)


def describe_fit(log: Log, profile: HasSchema) -> ProfileChoice:
    """How a profile that the operator named fits the log. Raises ProfileError when nothing of it is there."""
    return choose_profile(log, [profile])[1]


def _choice(log: Log, fit: Fit, others: Sequence[str]) -> ProfileChoice:
    rivals = f"; {', '.join(others)} would fit nearly as well" if others else ""
    return ProfileChoice(
        name=fit.schema.name,
        version=fit.schema.version,
        platform=fit.schema.platform,
        reason=f"{fit}{rivals}",
        warnings=differences(log, fit.schema),
    )


def measure_fit(log: Log, schema: Schema) -> Fit:
    """Count what a log holds of a profile. A profile of another format, or of a published table, has nothing."""
    if log.format.value not in schema.logs:
        return Fit(schema, 0, 0, 0, 0)
    settings = log.settings()
    channels = {channel.name for channel in as_dataflash(log).channels()}
    plan = reading_plan(schema)
    return Fit(
        schema,
        options=sum(any(name in settings for name in readable(option)) for option in schema.options),
        sources=len(channels & plan.keys()),
        sources_wanted=len(plan),
        names=sum(text.casefold() in log.facts.get(key, "").casefold() for key, text in schema.match.items()),
    )


def differences(log: Log, schema: Schema) -> tuple[str, ...]:
    """What the log says of its robot that is not what the profile was learned on, one sentence each."""
    return tuple(
        f"the log's {key} is '{log.facts[key]}', the profile is for '{text}'"
        for key, text in schema.match.items()
        if log.facts.get(key) and text.casefold() not in log.facts[key].casefold()
    )


def _nothing_readable(log: Log) -> LogError | None:
    """A damaged log without a single message left is no question of profiles."""
    if not log.damage or any(channel.count for channel in log.channels()):
        return None
    return LogError(
        f"No message of the log can be read: {log.damage[-1].what}.",
        hint="Copy it from the robot again, or use another recording.",
        where=str(log.path),
    )


def _nothing_fits(log: Log, fits: Sequence[Fit]) -> ProfileError:
    if len(fits) == 1:
        schema = fits[0].schema
        reads = f"It reads {' or '.join(schema.logs)}" if schema.logs else "It comes from a table and reads no log"
        return ProfileError(
            f"Profile '{schema.name}' does not fit the log: none of its parameters or sources are in it.",
            hint=f"{reads}, this is {log.format.value}; leave --profile out to have one chosen.",
            where=str(log.path),
        )
    names = ", ".join(fit.schema.name for fit in fits if log.format.value in fit.schema.logs)
    looked = f"Looked for the parameters and sources of {names}" if names else f"None of them reads {log.format.value}"
    return ProfileError(
        "No profile fits the log.",
        hint=f"{looked}; 'care inspect' shows what the log holds.",
        where=str(log.path),
    )
