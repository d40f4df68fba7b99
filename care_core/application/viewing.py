"""What the views ask of a log and of the installed profiles. Runs in worker threads; touches no widget."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from care_core.application.case import Case
from care_core.errors import CareError
from care_core.records import Record

if TYPE_CHECKING:
    from care_core.ecosystems.vehicles import Kind
    from care_core.history.store import Triaged
    from care_core.logs.base import Log
    from care_core.run import FitVerdict

TEXTS = {
    "MSG": ("Message",),
    "ERR": ("Subsys", "ECode"),
    "EV": ("Id",),
    "logged_messages": ("message", "level"),
    "/rosout": ("level", "name", "msg"),
    "/rosout_agg": ("level", "name", "msg"),
}
"""Channels that hold what the robot's software said, and their fields."""

LEVELS = {1: "debug", 2: "info", 4: "WARN", 8: "ERROR", 16: "FATAL", 10: "debug", 20: "info", 30: "WARN", 40: "ERROR"}
"""Levels of ROS 1 and ROS 2 log messages."""
PX4_LEVELS = {"emergency": "FATAL", "alert": "FATAL", "critical": "FATAL", "error": "ERROR", "warning": "WARN"}
"""Levels of PX4's logged messages that ask for attention."""


class LogMessage(Record):
    """Something the robot's software said, `time_s` after the start of the log."""

    time_s: float
    kind: str
    text: str


def log_of(case: Case) -> Log:
    """The log of a case, which is open. Raises CareError where there is none."""
    if case.log is None:
        raise CareError("There is no log to look into.", hint="Open one.")
    return case.log


def messages_of(case: Case) -> list[LogMessage]:
    """Everything that the log holds in words, and what was found in its numbers, in time order."""
    from care_core.ecosystems.registry import run_model
    from care_core.ecosystems.vehicles import vehicle_of

    log = run_model(log_of(case)).log
    tables = log.read(TEXTS)
    if "/rosout" in tables:
        tables = {name: table for name, table in tables.items() if name != "/rosout_agg"}
    kind = vehicle_of(log.facts, case.diagnosis.run.settings).kind
    found = []
    for name, table in tables.items():
        fields = [table.columns[field] for field in TEXTS[name] if field in table.columns]
        for time_s, *values in zip(table.t, *fields, strict=True):
            found.append(LogMessage(float(time_s), *_worded(name, values, kind)))
    said = {message.text for message in found}
    evidence = case.diagnosis.run.evidence
    found += [LogMessage(part.time_s, part.kind, part.text) for part in evidence if part.text not in said]
    return sorted(found, key=lambda message: message.time_s)


def _worded(channel: str, values: list[object], kind: Kind) -> tuple[str, str]:
    """Kind and words of a message of this channel."""
    from care_core.ecosystems.vehicles import error_words, event_words, is_over

    if channel.startswith("/rosout"):
        level, name, text = (*values, "", "")[:3]
        return LEVELS.get(int(float(str(level))), "?"), f"{name}: {text}"
    if channel == "logged_messages":
        text, level = (*values, "", "")[:2]
        return PX4_LEVELS.get(str(level).casefold(), "message"), str(text)
    if channel == "ERR":
        subsystem, code = (int(float(str(value))) for value in (*values, 0, 0)[:2])
        return ("over" if is_over(subsystem, code) else "ERR"), error_words(subsystem, code, kind)
    if channel == "EV":
        return "event", event_words(int(float(str(values[0])))) if values else ""
    return "message", str(values[0]) if values else ""


def what_would_fit(case: Case) -> list[str]:
    """What would make a profile fit the log of a case that none fits: by the one for this kind of log and vehicle that
    misses least, else a profile of its own."""
    from care_core.ecosystems.vehicles import vehicle_of
    from care_core.extract.coverage import to_have, try_on, wrong_kind
    from care_core.extract.fit import is_other_vehicle
    from care_core.extract.select import sound_profiles

    log = log_of(case)
    vehicle = vehicle_of(log.facts, log.settings())
    schemas = [profile.schema for profile in sound_profiles()[0]]
    tried = [
        try_on(log, schema)
        for schema in schemas
        if not wrong_kind(log, schema) and not is_other_vehicle(schema, vehicle)
    ]
    nearest = max(tried, key=lambda trial: trial.coverage.found, default=None)
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
    texts = [file.read_text(encoding="utf-8") for file in files if file.is_file()]
    return "\n".join(texts) if texts else "It has no model card.\n"


class Past(Record):
    """A run that was triaged before."""

    at: str
    log: str
    mission: int
    profile: str
    fit: FitVerdict
    verdict: str
    cause: str
    values: Mapping[str, float | None]
    config: Mapping[str, float]


def past_runs() -> list[Past]:
    """What the local history holds, the newest first. Raises CareError where it is switched off."""
    from care_core.history.store import SWITCH, History, history_path

    path = history_path()
    if path is None:
        raise CareError("The history is switched off.", hint=f"Unset {SWITCH} to have runs remembered.")
    if not path.is_file():
        return []
    return [_past(triaged) for triaged in History(path).triages()]


def _past(triaged: Triaged) -> Past:
    from care_core.report.history import fit_of, profile_of, verdict_of

    document = triaged.document
    causes = [cause["option"] for fault in document["faults"] for cause in fault["causes"]]
    return Past(
        at=triaged.at,
        log=triaged.log_path,
        mission=triaged.mission,
        profile=profile_of(document),
        fit=fit_of(document),
        verdict=verdict_of(document),
        cause=causes[0] if causes else "",
        values={entry["name"]: entry["value"] for entry in document["objectives"]},
        config=document["config"],
    )
