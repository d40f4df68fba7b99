"""What `care inspect` prints: the inspection as lines for a terminal."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence

from care_core.extract.coverage import try_on
from care_core.logs.base import Log
from care_core.profile.store import available_profiles, load_profile
from care_core.report.inspection import (
    DamageEntry,
    InspectDocument,
    LogEntry,
    MissedEntry,
    MissionEntry,
    ParameterEntry,
    ProfileEntry,
    build_inspection,
)

MOST_DAMAGE, MOST_CHANGED = 8, 10
"""Damaged places, and changed parameters, that are listed one by one."""

_NUMBER = re.compile(r"\d+")


def inspect_log(log: Log) -> InspectDocument:
    """Look into a log without judging it, with every installed profile."""
    return build_inspection(log, [try_on(log, load_profile(path).schema) for path in available_profiles()])


def as_text(document: InspectDocument) -> str:
    """Lines for a terminal."""
    log = document.log
    lines = [
        f"Log         {log.path}",
        f"Format      {log.format}",
        f"Start       {log.start or 'not known (no wall clock)'}",
        f"Duration    {_span(log)}",
        *(f"{name.capitalize():<11} {text}" for name, text in log.facts.items()),
        *_damage(log.damage),
        *_parameters(document.parameters),
        *_profiles(document.profiles),
        *_channels(document),
    ]
    return "\n".join(lines) + "\n"


def _span(log: LogEntry) -> str:
    if not log.damage:
        return f"{_clock(log.duration_s)} ({log.duration_s:.1f} s)"
    about = "" if log.read.about_s is None else f" of about {_clock(log.read.about_s)}"
    return f"read 00:00 to {_clock(log.read.to_s)}{about} ({log.duration_s:.1f} s), see Damage"


def _clock(seconds: float | None) -> str:
    if seconds is None:
        return "an unknown time"
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes:02}:{rest:02}"


def _damage(damage: Sequence[DamageEntry]) -> Iterator[str]:
    """Every damaged place; where they are many, a line for each kind with the first and the last of it."""
    if len(damage) <= MOST_DAMAGE:
        yield from (f"Damage      {entry.what}{_place(entry)}" for entry in damage)
        return
    kinds: dict[str, list[DamageEntry]] = {}
    for entry in damage:
        kinds.setdefault(_NUMBER.sub("N", entry.what), []).append(entry)
    for found in kinds.values():
        more = f", and {len(found) - 1} more like it, the last{_place(found[-1])}" if len(found) > 1 else ""
        yield f"Damage      {found[0].what}{_place(found[0])}{more}"


def _place(entry: DamageEntry) -> str:
    byte = "" if entry.byte is None else f" at byte {entry.byte}"
    return byte + ("" if entry.time_s is None else f" (at {_clock(entry.time_s)})")


def _parameters(found: ParameterEntry) -> Iterator[str]:
    sources = ", ".join(f"{count} from {source}" for source, count in found.sources.items())
    yield f"Parameters  {found.count}{f': {sources}' if sources else ''}"
    for change in found.changed[:MOST_CHANGED]:
        values = f"from {_value(change.before)} to {_value(change.after)}"
        yield f"  changed   {change.name} {values} at {_clock(change.time_s)}"
    if len(found.changed) > MOST_CHANGED:
        yield f"  changed   and {len(found.changed) - MOST_CHANGED} more (see --json)"


def _value(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:g}"


def _profiles(profiles: Iterable[ProfileEntry]) -> Iterator[str]:
    for profile in profiles:
        held = ""
        if profile.sources_wanted:
            held = (
                f"{profile.options} of {profile.options_wanted} options and {profile.sources} of"
                f" {profile.sources_wanted} sources are in the log"
            )
        verdict = held if profile.usable else "; ".join(part for part in (f"no: {profile.reason}", held) if part)
        yield f"Profile     {profile.name}: {verdict}"
        yield from (f"  mission {mission.index} {_mission(mission)}" for mission in profile.missions)
        if profile.options or profile.sources:
            yield from _missed(profile.missed)


def _mission(mission: MissionEntry) -> str:
    end = "" if mission.ended else ", the log ends before it does"
    mismatch = f", {mission.mismatch}" if mission.mismatch else ""
    return f"{_clock(mission.start_s)} to {_clock(mission.end_s)}{end}{mismatch}"


def _missed(missed: Sequence[MissedEntry]) -> Iterator[str]:
    """What a profile would miss, variables with the same hint on one line."""
    together: dict[tuple[str, str], list[str]] = {}
    for entry in missed:
        together.setdefault((entry.role, entry.hint), []).append(entry.name)
    for (role, hint), names in together.items():
        yield f"  misses    {role}{'' if len(names) == 1 else 's'} {', '.join(names)}: {hint}"


def _channels(document: InspectDocument) -> Iterator[str]:
    width = max((len(channel.name) for channel in document.channels), default=0)
    yield ""
    yield f"{'Channel':<{width}}  {'Count':>8}  {'Hz':>8}  Type"
    for channel in document.channels:
        rate = "" if channel.rate_hz is None else f"{channel.rate_hz:.1f}"
        yield f"{channel.name:<{width}}  {channel.count:>8}  {rate:>8}  {channel.type}"
