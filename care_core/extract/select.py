"""Which profile fits a log, and what of the log differs from it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, TypeVar

from care_core.errors import LogError, ProfileError
from care_core.extract.coverage import Coverage, cover
from care_core.logs.base import Log
from care_core.profile.schema import Schema
from care_core.run import ProfileChoice

NEARLY_AS_WELL = 0.9
"""Another profile is named when it matches at least this share of what the chosen one does."""


class HasSchema(Protocol):
    """Anything that carries a schema, such as a loaded profile."""

    @property
    def schema(self) -> Schema: ...


P = TypeVar("P", bound=HasSchema)


def choose_profile(log: Log, candidates: Sequence[P]) -> tuple[P, ProfileChoice]:
    """The candidate with most parameters and sources in the log, then with the robot's or firmware's name.

    Raises:
        ProfileError: no candidate has anything in common with the log.
    """
    found = [cover(log, candidate.schema) for candidate in candidates]
    order = sorted(range(len(found)), key=lambda i: (-found[i].found, -found[i].names, found[i].schema.name))
    usable = [i for i in order if found[i].found]
    if not usable:
        raise _nothing_readable(log) or _nothing_fits(log, found)
    best = found[usable[0]]
    others = [found[i].schema.name for i in usable[1:] if found[i].found >= NEARLY_AS_WELL * best.found]
    return candidates[usable[0]], _choice(log, best, others)


def describe_fit(log: Log, profile: HasSchema) -> ProfileChoice:
    """How a profile that the operator named fits the log. Raises ProfileError when nothing of it is there."""
    return choose_profile(log, [profile])[1]


def _choice(log: Log, coverage: Coverage, others: Sequence[str]) -> ProfileChoice:
    rivals = f"; {', '.join(others)} would fit nearly as well" if others else ""
    return ProfileChoice(
        name=coverage.schema.name,
        version=coverage.schema.version,
        platform=coverage.schema.platform,
        reason=f"{coverage}{rivals}",
        warnings=differences(log, coverage.schema),
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


def _nothing_fits(log: Log, found: Sequence[Coverage]) -> ProfileError:
    if len(found) == 1:
        schema = found[0].schema
        reads = f"It reads {' or '.join(schema.logs)}" if schema.logs else "It comes from a table and reads no log"
        return ProfileError(
            f"Profile '{schema.name}' does not fit the log: none of its parameters or sources are in it.",
            hint=f"{reads}, this is {log.format.value}; leave --profile out to have one chosen.",
            where=str(log.path),
        )
    names = ", ".join(one.schema.name for one in found if log.format.value in one.schema.logs)
    looked = f"Looked for the parameters and sources of {names}" if names else f"None of them reads {log.format.value}"
    return ProfileError(
        "No profile fits the log.",
        hint=f"{looked}; 'care inspect' shows what the log holds.",
        where=str(log.path),
    )
