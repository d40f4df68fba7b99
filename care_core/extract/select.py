"""Which profile is taken for a log, and how well it fits."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, TypeVar

from care_core.errors import LogError, ProfileError
from care_core.extract.coverage import Coverage, cover
from care_core.extract.fit import fit_of
from care_core.extract.read import reading_plan
from care_core.logs.base import Log
from care_core.profile.schema import Schema
from care_core.profile.store import Profile, available_profiles, load_profile
from care_core.run import Fit, ProfileChoice, Settings
from care_core.text import listed

NEARLY_AS_WELL = 0.9
"""Another profile is named when it matches at least this share of what the chosen one does."""
_ORDER = {"fits": 0, "partly": 1, "no": 2}


class HasSchema(Protocol):
    """Anything that carries a schema, such as a loaded profile."""

    @property
    def schema(self) -> Schema: ...


P = TypeVar("P", bound=HasSchema)


def sound_profiles(format: str = "") -> tuple[list[Profile], list[ProfileError]]:
    """The installed profiles, and what is wrong with those that cannot be used: one never keeps the others from use.

    Args:
        format: look only at what those measure that read such logs: it takes time to load what the others do.
    """
    sound, problems = [], []
    for path in available_profiles():
        try:
            profile = load_profile(path)
            if format in profile.schema.logs or (not format and profile.schema.logs):
                reading_plan(profile.schema)
            sound.append(profile)
        except ProfileError as err:
            problems.append(err)
    return sound, problems


def choose_profile(log: Log, candidates: Sequence[P], known: Settings | None = None) -> tuple[P | None, ProfileChoice]:
    """The candidate that fits best: by its verdict, then by the parameters and sources in the log, then by the robot's
    or firmware's name. One of another stack is none where there is one of the log's own, that does not fit. None where
    none fits, with the reasons; a single candidate is still named then.

    Args:
        known: what is known of the robot's parameters, what the log holds unless given.

    Raises:
        LogError: the log is damaged, and no message of it is left.
    """
    _refuse_unreadable(log)
    covered = [cover(log, candidate.schema) for candidate in candidates]
    fits = [fit_of(log, coverage, known) for coverage in covered]
    order = sorted(range(len(fits)), key=lambda i: (_ORDER[fits[i].verdict], *_nearness(log, covered[i])))
    own = [i for i in order if not _is_of_another_stack(log, covered[i])]
    usable = [i for i in own or order if fits[i].verdict != "no"]
    if not usable:
        return None, _none_fits(log, covered, fits, own or order)
    best = usable[0]
    rivals = [covered[i] for i in usable[1:] if not covered[i].schema.carried_over]
    others = [rival.schema.name for rival in rivals if rival.found >= NEARLY_AS_WELL * covered[best].found]
    return candidates[best], _choice(covered[best], fits[best], others)


def fitting_profile(log: Log, candidates: Sequence[P], known: Settings | None = None) -> tuple[P, ProfileChoice]:
    """The candidate that fits best, for those who can do nothing without one.

    Raises:
        LogError: as `choose_profile`.
        ProfileError: none fits.
    """
    profile, choice = choose_profile(log, candidates, known)
    if profile is None:
        named = f"Profile '{choice.name}' does not fit the log" if choice.name else "No profile fits the log"
        hint = "Leave --profile out to have one chosen." if choice.name else "'care inspect' shows what the log holds."
        raise ProfileError(f"{named}: {'; '.join(choice.fit.reasons)}.", hint=hint, where=str(log.path))
    return profile, choice


def _nearness(log: Log, coverage: Coverage) -> tuple[int, int, int, str]:
    """What was learned from such logs comes before what was carried over to them, and that before another stack's."""
    strange = 2 if _is_of_another_stack(log, coverage) else 1 if coverage.schema.carried_over else 0
    return strange, -coverage.found, -coverage.names, coverage.schema.name


def _is_of_another_stack(log: Log, coverage: Coverage) -> bool:
    stack, own = coverage.schema.match.get("stack", ""), log.facts.get("stack", "")
    return bool(own) and stack.casefold() not in own.casefold()


def _choice(coverage: Coverage, fit: Fit, others: Sequence[str] = ()) -> ProfileChoice:
    rivals = f"; {', '.join(others)} would fit nearly as well" if others else ""
    schema = coverage.schema
    return ProfileChoice(schema.name, schema.version, schema.platform, f"{coverage}{rivals}", fit)


def _none_fits(log: Log, covered: Sequence[Coverage], fits: Sequence[Fit], order: Sequence[int]) -> ProfileChoice:
    """Why, by the profiles that come nearest; of those that have nothing of the log nothing needs to be said."""
    if len(covered) == 1:
        return _choice(covered[0], fits[0])
    reasons = tuple(f"{covered[i].schema.name}: {'; '.join(fits[i].reasons)}" for i in order if covered[i].found)
    readers = [coverage for coverage in covered if log.format.name in coverage.schema.logs]
    if not covered:
        reasons = ("no profile is installed",)
    elif not readers:
        reasons = (f"none of the {len(covered)} installed profiles reads {log.format.name}",)
    elif not reasons:
        names = listed([coverage.schema.name for coverage in readers])
        reasons = (f"nothing that {names} would read is in the log",)
    return ProfileChoice("", "", "", "", Fit("no", reasons))


def _refuse_unreadable(log: Log) -> None:
    """A damaged log without a single message left is no question of profiles."""
    if log.damage and not any(channel.count for channel in log.channels()):
        raise LogError(
            f"No message of the log can be read: {log.damage[-1].what}.",
            hint="Copy it from the robot again, or use another recording.",
            where=str(log.path),
        )
