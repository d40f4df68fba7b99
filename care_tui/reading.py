"""What the views ask of a log and of the installed profiles. Runs in worker threads; touches no widget."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from care_core.errors import CareError
from care_tui.jobs import Case

TEXTS = {
    "MSG": ("Message",),
    "ERR": ("Subsys", "ECode"),
    "EV": ("Id",),
    "/rosout": ("level", "name", "msg"),
    "/rosout_agg": ("level", "name", "msg"),
}
"""Channels that hold what the robot's software said, and their fields."""

LEVELS = {1: "debug", 2: "info", 4: "WARN", 8: "ERROR", 16: "FATAL", 10: "debug", 20: "info", 30: "WARN", 40: "ERROR"}
"""Levels of ROS 1 and ROS 2 log messages."""


@dataclass(frozen=True, slots=True)
class LogMessage:
    """Something the robot's software said, `time_s` after the start of the log."""

    time_s: float
    kind: str
    text: str


def messages_of(case: Case) -> list[LogMessage]:
    """Everything that the log holds in words, in time order."""
    from care_core.logs import open_log

    tables = open_log(case.diagnosis.run.log.path).read(TEXTS)
    if "/rosout" in tables:
        tables = {name: table for name, table in tables.items() if name != "/rosout_agg"}
    found = []
    for name, table in tables.items():
        fields = [table.columns[field] for field in TEXTS[name] if field in table.columns]
        for time_s, *values in zip(table.t, *fields, strict=True):
            found.append(LogMessage(float(time_s), *_worded(name, values)))
    return sorted(found, key=lambda message: message.time_s)


def _worded(channel: str, values: list[object]) -> tuple[str, str]:
    if channel.startswith("/rosout"):
        level, name, text = (*values, "", "")[:3]
        return LEVELS.get(int(float(str(level))), "?"), f"{name}: {text}"
    if channel == "ERR":
        return "ERR", f"subsystem {values[0]:g}, code {values[1]:g}" if len(values) == 2 else str(values)
    if channel == "EV":
        return "event", f"event {values[0]:g}" if values else ""
    return "message", str(values[0]) if values else ""


@dataclass(frozen=True, slots=True)
class Signal:
    """A number over time in a log, and the variables of the profile that are read from it."""

    channel: str
    field: str
    used_by: tuple[str, ...]

    @property
    def name(self) -> str:
        return f"{self.channel} {self.field}"


@dataclass(frozen=True, slots=True)
class Trace:
    """A signal squeezed into columns: per column its least and its greatest value, None where there is none."""

    start_s: float
    end_s: float
    columns: tuple[tuple[float, float] | None, ...]
    low: float
    high: float
    count: int


def signals_of(case: Case) -> list[Signal]:
    """The signals that the profile reads from this log, those of objectives and of causal paths first."""
    from care_core.extract.registry import find_extractor
    from care_core.logs import open_log

    if case.schema is None:
        return []
    present = {channel.name for channel in open_log(case.diagnosis.run.log.path).channels()}
    users: dict[tuple[str, str], list[str]] = {}
    for variable in case.schema.variables.values():
        if variable.extract is None:
            continue
        needs = find_extractor(variable.extract.kind).needs(variable.extract.args)
        for channel, fields in needs.items():
            for field in fields:
                if channel in present and channel not in TEXTS:
                    users.setdefault((channel, field), []).append(variable.name)
    matters = {result.variable.name for result in case.diagnosis.objectives}
    matters |= {node.name for fault in case.diagnosis.faults for cause in fault.causes for node in cause.path}
    signals = [Signal(channel, field, tuple(names)) for (channel, field), names in users.items()]
    return sorted(signals, key=lambda signal: -len(matters & set(signal.used_by)))


def trace_of(case: Case, signal: Signal, columns: int) -> Trace:
    """The signal over the mission, in so many columns.

    Raises:
        CareError: the log holds no number there.
    """
    import numpy as np

    from care_core.logs import open_log

    run = case.diagnosis.run
    table = open_log(run.log.path).read({signal.channel: (signal.field,)}).get(signal.channel)
    if table is None or signal.field not in table.columns or table[signal.field].dtype.kind not in "fiub":
        raise CareError(f"The log holds no numbers in {signal.name}.", hint="Choose another signal.")
    table = table.between(run.mission.start_s, run.mission.end_s)
    values = table[signal.field].astype(float)
    good = np.isfinite(values)
    t, values = table.t[good], values[good]
    if not len(values):
        raise CareError(f"{signal.name} has no value during the mission.", hint="Choose another signal.")
    span = max(float(t[-1] - t[0]), 1e-9)
    place = np.minimum(((t - t[0]) / span * columns).astype(int), columns - 1)
    parts = (values[place == column] for column in range(columns))
    squeezed = tuple((float(part.min()), float(part.max())) if len(part) else None for part in parts)
    return Trace(float(t[0]), float(t[-1]), squeezed, float(values.min()), float(values.max()), len(values))


@dataclass(frozen=True, slots=True)
class Installed:
    """A profile that came with the program, and its model card."""

    name: str
    version: str
    platform: str
    card: str


def installed_profiles() -> list[Installed]:
    """Every installed profile with its model card."""
    from care_core.profile.store import available_profiles, load_profile

    return [
        Installed(schema.name, schema.version, schema.platform, _card(path))
        for path, schema in ((path, load_profile(path).schema) for path in available_profiles())
    ]


def _card(folder: Path) -> str:
    card = folder / "MODEL_CARD.md"
    return card.read_text(encoding="utf-8") if card.is_file() else "It has no model card.\n"


@dataclass(frozen=True)
class Past:
    """A run that was triaged before."""

    at: str
    log: str
    profile: str
    verdict: str
    cause: str
    values: Mapping[str, float | None]
    config: Mapping[str, float]


def past_runs() -> list[Past]:
    """What the local history holds, the newest first; nothing where it is switched off."""
    from care_core.history import History, history_path

    path = history_path()
    if path is None or not path.is_file():
        return []
    return [_past(triaged.at, triaged.document) for triaged in History(path).triages()]


def _past(at: str, document: Mapping[str, Any]) -> Past:
    broken = [entry["name"] for entry in document["objectives"] if entry["status"] == "fault"]
    unknown = [entry["name"] for entry in document["objectives"] if entry["status"] == "not_evaluated"]
    verdict = f"FAULT {', '.join(broken)}" if broken else "NOT ALL EVALUATED" if unknown else "OK"
    causes = [cause["option"] for fault in document["faults"] for cause in fault["causes"]]
    return Past(
        at=at,
        log=document["log"]["path"],
        profile=document["profile"]["name"],
        verdict=verdict,
        cause=causes[0] if causes else "",
        values={entry["name"]: entry["value"] for entry in document["objectives"]},
        config=document["config"],
    )


def remember_run(case: Case) -> None:
    """Put a diagnosis into the local history. One that cannot be used is no reason to stop."""
    from care_core.history import History, HistoryError, history_path
    from care_core.report import build_document, published

    path = history_path()
    if path is None or case.question is None:
        return
    try:
        History(path).add_triage(published(build_document(case.diagnosis)), case.diagnosis.run.mission.index)
    except HistoryError as err:
        logging.getLogger(__name__).warning("not remembered: %s", err)
