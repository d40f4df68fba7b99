"""What the views ask of a log and of the installed profiles. Runs in worker threads; touches no widget."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from care_core.application.case import Case
from care_core.errors import CareError

if TYPE_CHECKING:
    from care_core.history.store import Triaged
    from care_core.logs.base import Log

TEXTS = {
    "MSG": ("Message",),
    "ERR": ("Subsys", "ECode"),
    "EV": ("Id",),
    "/rosout": ("level", "name", "msg"),
    "/rosout_agg": ("level", "name", "msg"),
}
"""Channels that hold what the robot's software said, and their fields."""

EVENTS = {
    10: "armed",
    11: "disarmed",
    15: "armed by the autopilot",
    17: "may have landed",
    18: "landed",
    19: "lost GPS",
    25: "home set",
    28: "flies",
    54: "motors stopped in an emergency",
    56: "motor interlock off",
    57: "motor interlock on",
    62: "EKF reset its yaw",
}
"""Events of an ArduPilot EV record that operators ask for; the others keep their number."""

SUBSYSTEMS = {
    2: "radio",
    3: "compass",
    11: "GPS",
    15: "parachute",
    18: "barometer",
    19: "processor",
    21: "terrain data",
    22: "navigation",
    30: "internal error",
}
"""Subsystems of an ERR record that are no failure of a flight by themselves."""
_MODE_CHANGE = 10
"""The one whose code is the flight mode that was refused."""

LEVELS = {1: "debug", 2: "info", 4: "WARN", 8: "ERROR", 16: "FATAL", 10: "debug", 20: "info", 30: "WARN", 40: "ERROR"}
"""Levels of ROS 1 and ROS 2 log messages."""


@dataclass(frozen=True, slots=True)
class LogMessage:
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
    tables = log_of(case).read(TEXTS)
    if "/rosout" in tables:
        tables = {name: table for name, table in tables.items() if name != "/rosout_agg"}
    found = []
    for name, table in tables.items():
        fields = [table.columns[field] for field in TEXTS[name] if field in table.columns]
        for time_s, *values in zip(table.t, *fields, strict=True):
            found.append(LogMessage(float(time_s), *_worded(name, values)))
    said = {message.text for message in found}
    evidence = case.diagnosis.run.evidence
    found += [LogMessage(part.time_s, part.kind, part.text) for part in evidence if part.text not in said]
    return sorted(found, key=lambda message: message.time_s)


def _worded(channel: str, values: list[object]) -> tuple[str, str]:
    if channel.startswith("/rosout"):
        level, name, text = (*values, "", "")[:3]
        return LEVELS.get(int(float(str(level))), "?"), f"{name}: {text}"
    if channel == "ERR":
        return _error(*(int(float(str(value))) for value in values)) if len(values) == 2 else ("ERR", str(values))
    if channel == "EV":
        number = int(float(str(values[0]))) if values else -1
        return "event", EVENTS.get(number, f"number {number}")
    return "message", str(values[0]) if values else ""


def _error(subsystem: int, code: int) -> tuple[str, str]:
    """An ERR record in words; code 0 says that the trouble is over."""
    from care_core.extract.ardupilot import ERR_SUBSYSTEMS

    if subsystem == _MODE_CHANGE:
        return "ERR", f"flight mode {code} was refused"
    named = ERR_SUBSYSTEMS.get(subsystem, (SUBSYSTEMS.get(subsystem, f"subsystem {subsystem}"),))
    name = ": ".join(dict.fromkeys(named))
    return ("over", name) if code == 0 else ("ERR", f"{name}, code {code}")


@dataclass(frozen=True, slots=True)
class Installed:
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


@dataclass(frozen=True)
class Past:
    """A run that was triaged before."""

    at: str
    log: str
    mission: int
    profile: str
    verdict: str
    cause: str
    values: Mapping[str, float | None]
    config: Mapping[str, float]


def past_runs() -> list[Past]:
    """What the local history holds, the newest first; nothing where it is switched off."""
    from care_core.history.store import History, history_path

    path = history_path()
    if path is None or not path.is_file():
        return []
    return [_past(triaged) for triaged in History(path).triages()]


def _past(triaged: Triaged) -> Past:
    from care_core.report.history import verdict_of

    document = triaged.document
    causes = [cause["option"] for fault in document["faults"] for cause in fault["causes"]]
    return Past(
        at=triaged.at,
        log=document["log"]["path"],
        mission=triaged.mission,
        profile=document["profile"]["name"],
        verdict=verdict_of(document),
        cause=causes[0] if causes else "",
        values={entry["name"]: entry["value"] for entry in document["objectives"]},
        config=document["config"],
    )
