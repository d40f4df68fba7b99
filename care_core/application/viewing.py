"""What the views ask of a log and of the installed profiles. Runs in worker threads; touches no widget."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from care_core.application.open_run import OpenRun, log_of
from care_core.errors import CareError
from care_core.files import read_small_text
from care_core.records import Record

if TYPE_CHECKING:
    from care_core.diagnose.verdict import RunStatus
    from care_core.ecosystems.findings import Event
    from care_core.history.store import History, Triaged, Verified
    from care_core.history.trends import Changed
    from care_core.report.document import TriageDocument
    from care_core.run import FitVerdict


def messages_of(case: OpenRun) -> list[Event]:
    """Everything that the log holds in words, and what was found in its numbers, in time order."""
    from care_core.ecosystems.findings import Event
    from care_core.ecosystems.registry import ecosystem_of

    log = log_of(case)
    ecosystem = ecosystem_of(log.format)
    messages = list(ecosystem.log_messages(ecosystem.model(log)))
    texts = {message.text for message in messages}
    evidence = (part for part in case.diagnosis.run.evidence if part.text not in texts)
    found = [Event(part.time_s, part.kind, part.text, "the run") for part in evidence]
    return sorted([*messages, *found], key=lambda message: message.time_s)


def what_would_fit(case: OpenRun) -> list[str]:
    """What would make a profile fit the log of a case that none fits: by the one of which it is told that it does not,
    or the one for this kind of log and vehicle that misses least, else a profile of its own."""
    from care_core.ecosystems.vehicles import vehicle_of
    from care_core.extract.coverage import to_have, try_on, wrong_kind, wrong_vehicle
    from care_core.extract.select import sound_profiles

    log = log_of(case)
    vehicle = vehicle_of(log.facts, log.settings())
    schemas = [profile.schema for profile in sound_profiles()[0]]
    tried = [
        try_on(log, schema) for schema in schemas if not wrong_kind(log, schema) and not wrong_vehicle(schema, vehicle)
    ]
    told = case.diagnosis.profile.name
    nearest = max(tried, key=lambda one: (one.coverage.schema.name == told, one.coverage.found), default=None)
    own = f"a profile of its own: 'care profiles new {log.path.name}' writes a first one"
    if nearest is None or not nearest.coverage.found:
        return [own]
    name = nearest.coverage.schema.name
    return [f"for {name}: {advice}" for advice in to_have(nearest.missed)] + [own]


class Installed(Record):
    """A profile that came with the program, and its model card."""

    name: str
    version: str
    platform: str
    card: str


def installed_profiles() -> list[Installed]:
    """Every installed profile with its model card."""
    from care_core.extract.select import sound_profiles

    return [
        Installed(one.schema.name, one.schema.version, one.schema.platform, _card(one.path))
        for one in sound_profiles()[0]
    ]


def _card(folder: Path) -> str:
    """The model card, and behind it what became of the fixes."""
    from care_core.history.track_record import RECORD_FILE
    from care_core.profile.store import CARD_FILE

    files = [folder / name for name in (CARD_FILE, RECORD_FILE)]
    texts = [read_small_text(file) for file in files if file.is_file()]
    return "\n".join(texts) if texts else "It has no model card.\n"


class Past(Record):
    """A run that was triaged before."""

    at: str
    log: str
    mission: int
    robot: str
    """Its identity; empty where nothing tells whose log it is."""
    profile: str
    fit: FitVerdict
    status: RunStatus
    verdict: str
    cause: str
    judged_with: str
    """The options that gave it other limits or another reference than its own."""
    advice: str
    report: TriageDocument
    values: Mapping[str, float | None]
    config: Mapping[str, float]
    became: tuple[str, ...]
    """What later logs showed of the change that it was advised."""
    before: str
    """The log of the run before of the same robot, empty where there is none."""
    changed: tuple[Changed, ...]
    """What was set otherwise than in that one."""


def past_runs() -> list[Past]:
    """What the local history holds, the newest first. Raises CareError where it is switched off."""
    from care_core.history.trends import runs_before

    history = _history()
    if history is None:
        return []
    triages, became = history.triages(), _became(history.verifications())
    before = runs_before(triages)
    return [_past(one, before.get(id(one)), became) for one in triages]


def _became(verified: Iterable[Verified]) -> dict[str, list[str]]:
    """What was found of advised changes, by the log whose report advised them."""
    found: dict[str, list[str]] = {}
    for one in verified:
        try:
            advised, log = one.document["report_log"]["sha256"], Path(one.document["log"]["path"]).name
            found.setdefault(advised, []).append(f"{log}: {one.document['sentence']}")
        except (KeyError, TypeError):  # a damaged record tells nothing
            continue
    return found


class KnownVerdict(Record):
    """The verdict on a log that is remembered, and what failed."""

    status: RunStatus
    failed: str
    judged_with: str
    """The options that gave it other limits or another reference than its own."""
    terms: str
    """What it was judged by, as the digest of `terms_of`."""


def known_verdicts(written_s: Mapping[Path, float]) -> dict[Path, KnownVerdict]:
    """What the local history knows of logs, of each that was triaged since it was last written. Empty where there is no
    history to be used."""
    from datetime import datetime

    from care_core.report.document import remembered_verdict
    from care_core.report.reading import remembered

    try:
        triages = _remembered()
    except CareError:
        return {}
    known: dict[Path, KnownVerdict] = {}
    for triaged in triages:  # the newest first
        path = Path(triaged.log_path)
        if (
            path in written_s
            and path not in known
            and datetime.fromisoformat(triaged.at).timestamp() >= written_s[path]
        ):
            verdict = remembered_verdict(remembered(triaged.document))
            known[path] = KnownVerdict(verdict.status, verdict.failed, triaged.judged_with, triaged.terms)
    return known


def _remembered() -> tuple[Triaged, ...]:
    """The triages of the local history. Raises CareError where it is switched off."""
    history = _history()
    return () if history is None else history.triages()


def _history() -> History | None:
    """The local history, None where there is none yet. Raises CareError where it is switched off."""
    from care_core.history.store import SWITCH, History, history_path

    path = history_path()
    if path is None:
        raise CareError("The history is switched off.", hint=f"Unset {SWITCH} to have runs remembered.")
    return History(path) if path.is_file() else None


def _past(triaged: Triaged, before: Triaged | None, became: Mapping[str, list[str]]) -> Past:
    from care_core.history.trends import changed
    from care_core.report.document import leading_cause, remembered_verdict
    from care_core.report.reading import remembered

    document = remembered(triaged.document)
    verdict = remembered_verdict(document)
    return Past(
        at=triaged.at,
        log=triaged.log_path,
        mission=triaged.mission,
        robot=triaged.robot.id if triaged.robot else "",
        profile=document.profile.name if document.profile else "",
        fit=document.fit.verdict,
        status=verdict.status,
        verdict=verdict.headline,
        advice=str(verdict.advice),
        report=document,
        cause=leading_cause(document),
        judged_with=triaged.judged_with,
        values={entry.name: entry.value for entry in document.objectives},
        config=document.config,
        became=tuple(became.get(document.log.sha256, ())),
        before="" if before is None else before.log_path,
        changed=() if before is None else changed(before, triaged),
    )
