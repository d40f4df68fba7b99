"""The published inspection, `care.inspect/1`: what a log holds. Its keys and types are an interface."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import Final, Literal

from care_core.diagnose.verdict import fit_text
from care_core.ecosystems.findings import Health
from care_core.extract.coverage import Missed, Trial
from care_core.folders import files_in
from care_core.logs.base import Log
from care_core.records import field
from care_core.report.entries import (
    DamageEntry,
    EventEntry,
    FindingEntry,
    damage_entries,
    event_entries,
    finding_entries,
)
from care_core.report.health import finding_lines, timeline_lines
from care_core.report.published import Document, publish
from care_core.run import Damage, Fit, MissionInfo, ProfileChoice, place_of_damage
from care_core.text import WIDTH, clean, log_time, wrapped

INSPECT_ID: Final = "care.inspect/1"

MOST_DAMAGE, MOST_CHANGED = 8, 10
"""Damaged places, and changed parameters, that are listed one by one."""

_NUMBER = re.compile(r"\d+")


class ReadShare(Document, kw_only=True):
    """Seconds of the log that could be read, and about how many it had, null where nothing tells."""

    to_s: float
    about_s: float | None


class LogEntry(Document, kw_only=True):
    path: str
    format: str
    start: str | None
    duration_s: float
    bytes: int
    facts: dict[str, str]
    damage: list[DamageEntry]
    read: ReadShare


class ChannelEntry(Document, kw_only=True):
    name: str
    type: str
    count: int
    rate_hz: float | None


class ChangeEntry(Document, kw_only=True):
    """A parameter that was changed while the log was recorded."""

    name: str
    before: float | str
    after: float | str
    time_s: float


class ParameterEntry(Document, kw_only=True):
    count: int
    sources: dict[str, int]
    changed: list[ChangeEntry]


class MissionEntry(Document, kw_only=True):
    """A mission; its times are null where the log stamps nothing around it."""

    index: int
    start_s: float | None
    end_s: float | None
    ended: bool
    fits: bool
    mismatch: str | None


class MissedEntry(Document, kw_only=True):
    name: str
    role: Literal["option", "context", "metric", "objective"]
    reason: str
    hint: str


class ProfileEntry(Document, kw_only=True):
    """An installed profile: whether it can use the log, what of it is there, and what it would miss."""

    name: str
    version: str
    platform: str
    usable: bool
    reason: str | None
    options: int
    options_wanted: int
    sources: int
    sources_wanted: int
    missions: list[MissionEntry]
    missed: list[MissedEntry]


class InspectDocument(Document, kw_only=True):
    schema_: Literal["care.inspect/1"] = field(default=INSPECT_ID, name="schema")
    fit: Fit
    """How well the profile fits that fits best."""
    account: list[EventEntry]
    """What happened, in order of time."""
    findings: list[FindingEntry]
    """In the order told, the first cause first."""
    log: LogEntry
    channels: list[ChannelEntry]
    parameters: ParameterEntry
    profiles: list[ProfileEntry]
    """Those that can use the log first, the best of them before the others."""


def build_inspection(log: Log, trials: Sequence[Trial], choice: ProfileChoice, health: Health) -> InspectDocument:
    """The document of a log and the installed profiles. Text of the log is made safe to show."""
    ranked = sorted(
        trials,
        key=lambda t: (
            not t.is_usable,
            bool(t.coverage.schema.carried_over),
            -t.coverage.found,
            t.coverage.schema.name,
        ),
    )
    profiles = [_profile(trial) for trial in ranked]
    channels = [
        ChannelEntry(name=clean(c.name), type=clean(c.type), count=c.count, rate_hz=_finite(c.rate_hz))
        for c in sorted(log.channels(), key=lambda channel: channel.name)
    ]
    parameters = _parameters(log)
    # Last, since a reader tells what it could not decode only after it was asked to.
    return InspectDocument(
        fit=publish(Fit, choice.fit),
        account=event_entries(health),
        findings=finding_entries(health),
        log=_log(log),
        channels=channels,
        parameters=parameters,
        profiles=profiles,
    )


def _log(log: Log) -> LogEntry:
    files = files_in(log.path) if log.path.is_dir() else [log.path]
    size = sum(path.stat().st_size for path in files)
    return LogEntry(
        path=clean(str(log.path)),
        format=log.format.name,
        start=log.start,
        duration_s=log.duration_s,
        bytes=size,
        facts={clean(name): clean(text) for name, text in log.facts.items()},
        damage=damage_entries(log.damage),
        read=ReadShare(to_s=log.duration_s, about_s=_about_s(log.damage, log.duration_s, size)),
    )


def _about_s(damage: Sequence[Damage], duration_s: float, size: int) -> float | None:
    """How long the whole log was, taking its bytes to come evenly: known when it breaks off well before the file ends.

    A file that ends in the middle of a record says nothing of what was lost behind it.
    """
    if not damage:
        return duration_s
    last = max(damage, key=lambda d: d.byte or 0)
    breaks_off = last.time_s is None or last.time_s >= duration_s - 1.0
    if not breaks_off or not last.byte:
        return None
    whole_s = duration_s * size / last.byte
    return whole_s if whole_s > duration_s + 1.0 else None


def _parameters(log: Log) -> ParameterEntry:
    histories = log.settings()
    sources = Counter(clean(history[0].source) for history in histories.values())
    changed = [
        ChangeEntry(name=clean(after.name), before=_shown(before.value), after=_shown(after.value), time_s=at_s)
        for history in histories.values()
        for before, after in pairwise(history)
        if (at_s := _finite(after.changed_at_s)) is not None
    ]
    changed.sort(key=lambda change: change.time_s)
    return ParameterEntry(count=len(histories), sources=dict(sorted(sources.items())), changed=changed)


def _shown(value: float | str) -> float | str:
    """Numbers that JSON cannot hold as text."""
    if isinstance(value, str):
        return clean(value)
    return value if math.isfinite(value) else str(value)


def _finite(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None


def _profile(trial: Trial) -> ProfileEntry:
    coverage, schema = trial.coverage, trial.coverage.schema
    return ProfileEntry(
        name=schema.name,
        version=schema.version,
        platform=schema.platform,
        usable=trial.is_usable,
        reason=trial.obstacle or None,
        options=coverage.options,
        options_wanted=len(schema.options),
        sources=coverage.sources,
        sources_wanted=coverage.sources_wanted,
        missions=[_mission(mission) for mission in trial.missions],
        missed=[_missed(missed) for missed in trial.missed],
    )


def _mission(mission: MissionInfo) -> MissionEntry:
    return MissionEntry(
        index=mission.index,
        start_s=_finite(mission.start_s),
        end_s=_finite(mission.end_s),
        ended=mission.ended,
        fits=mission.fits,
        mismatch=clean(mission.mismatch) or None,
    )


def _missed(missed: Missed) -> MissedEntry:
    return MissedEntry(
        name=missed.variable.name,
        role=missed.variable.role.value,
        reason=clean(missed.reason),
        hint=clean(missed.hint),
    )


def inspection_text(document: InspectDocument) -> str:
    """Lines for a terminal."""
    fitting = next((profile.name for profile in document.profiles if profile.usable), "")
    findings = list(finding_lines(document.findings, document.account))
    lines = [
        *wrapped(fit_text("" if document.fit.verdict == "no" else fitting, document.fit)),
        *(["", *findings] if findings else []),
        "",
        *timeline_lines(document.account, most=len(document.account)),
    ]
    return "\n".join(lines) + "\n\n" + holdings_text(document)


def holdings_text(document: InspectDocument, width: int = WIDTH) -> str:
    """What the log holds, and what each profile would find in it: lines of at most this width where they are prose."""
    log = document.log
    lines = [
        f"Log         {log.path}",
        f"Format      {log.format}",
        f"Start       {log.start or 'not known (no wall clock)'}",
        f"Duration    {_span(log)}",
        *(f"{name.capitalize():<11} {text}" for name, text in log.facts.items()),
        *_damage_lines(log.damage),
        *_parameter_lines(document.parameters),
        *_profile_lines(document.profiles, width),
        *_channel_lines(document),
    ]
    return "\n".join(lines) + "\n"


def _span(log: LogEntry) -> str:
    if not log.damage:
        return log_time(log.duration_s)
    about = "" if log.read.about_s is None else f" of about {log_time(log.read.about_s, 0)}"
    return f"read to {log_time(log.read.to_s)}{about}, see Damage"


def _damage_lines(damage: Sequence[DamageEntry]) -> Iterator[str]:
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
    return place_of_damage(entry.what, entry.byte, entry.time_s)


def _parameter_lines(found: ParameterEntry) -> Iterator[str]:
    sources = ", ".join(f"{count} from {source}" for source, count in found.sources.items())
    yield f"Parameters  {found.count}{f': {sources}' if sources else ''}"
    for change in found.changed[:MOST_CHANGED]:
        values = f"from {_value(change.before)} to {_value(change.after)}"
        yield f"  changed   {change.name} {values} at {log_time(change.time_s)}"
    if len(found.changed) > MOST_CHANGED:
        yield f"  changed   and {len(found.changed) - MOST_CHANGED} more (see --json)"


def _value(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:g}"


def _profile_lines(profiles: Iterable[ProfileEntry], width: int) -> Iterator[str]:
    others = []
    for profile in profiles:
        if not profile.usable and not profile.sources_wanted:
            others.append(profile.name)
            continue
        held = (
            f"{profile.options} of {profile.options_wanted} parameters and {profile.sources} of"
            f" {profile.sources_wanted} sources are in the log"
        )
        verdict = held if profile.usable else f"no: {profile.reason}; {held}"
        yield from wrapped(f"{profile.name}: {verdict}", "Profile     ", width=width)
        yield from (f"  mission {mission.index} {_mission_text(mission)}" for mission in profile.missions)
        if profile.options or profile.sources:
            yield from _missed_lines(profile.missed, width)
    if others:
        yield from wrapped(f"for other logs (see --json): {', '.join(others)}", "Profile     ", width=width)


def _mission_text(mission: MissionEntry) -> str:
    end = "" if mission.ended else ", the log ends before it does"
    mismatch = f", {mission.mismatch}" if mission.mismatch else ""
    return f"{log_time(mission.start_s)} to {log_time(mission.end_s)}{end}{mismatch}"


def _missed_lines(missed: Sequence[MissedEntry], width: int) -> Iterator[str]:
    """What a profile would miss, variables with the same hint on one line."""
    together: dict[tuple[str, str], list[str]] = {}
    for entry in missed:
        together.setdefault((entry.role, entry.hint), []).append(entry.name)
    for (role, hint), names in together.items():
        yield from wrapped(
            f"{role}{'' if len(names) == 1 else 's'} {', '.join(names)}: {hint}", "  misses    ", width=width
        )


def _channel_lines(document: InspectDocument) -> Iterator[str]:
    width = max((len(channel.name) for channel in document.channels), default=0)
    yield ""
    yield f"{'Channel':<{width}}  {'Count':>8}  {'Hz':>8}  Type"
    for channel in document.channels:
        rate = "" if channel.rate_hz is None else f"{channel.rate_hz:.1f}"
        yield f"{channel.name:<{width}}  {channel.count:>8}  {rate:>8}  {channel.type}"
