"""What an ArduPilot log says of a flight: arming, refusals, errors, and messages that speak of a failure."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

import numpy as np

from care_core.ecosystems.ardupilot.measures.flight import NEEDS, analyse, messages
from care_core.ecosystems.measures import Args, Mission, extractor, has, missing
from care_core.ecosystems.vehicles import FAILSAFE, error_kind, error_words, with_said
from care_core.logs.base import Table, Wanted
from care_core.run import Unavailable, Value

_EV_ARMED, _EV_DISARMED = 10, 11
REFUSAL = re.compile(r"(?:Pre)?Arm: (.*)")
_SAID_AFTER_S = 0.6
"""A crash disarms first and is said then; telemetry knows a disarming to half a second (its heartbeats)."""
_MESSAGE_KINDS: tuple[tuple[re.Pattern[str], str], ...] = (
    (re.compile(r"crash", re.IGNORECASE), "crash"),
    (re.compile(rf"{FAILSAFE.pattern}|battery .* is (low|critical)", re.IGNORECASE), "failsafe"),
    (re.compile(r"EKF variance|lane switch|emergency yaw reset|GPS Glitch", re.IGNORECASE), "ekf"),
    (re.compile(r"thrust loss", re.IGNORECASE), "thrust"),
    (re.compile(r"vibration compensation", re.IGNORECASE), "vibration"),
)
"""Messages of a flight that speak about its failure, first match counts."""


def armed_spans(tables: Mapping[str, Table], duration_s: float) -> list[tuple[float, float, bool]]:
    """Start, end and whether it ended, of every time the motors were armed."""
    spans: list[tuple[float, float, bool]] = []
    armed_at: float | None = None
    for t, armed in arm_events(tables):
        if armed and armed_at is None:
            armed_at = t
        elif not armed and armed_at is not None:
            spans.append((armed_at, t, True))
            armed_at = None
    if armed_at is not None:
        spans.append((armed_at, duration_s, False))
    return spans


def arm_events(tables: Mapping[str, Table]) -> list[tuple[float, bool]]:
    """Times of arming (true) and disarming, from records and messages."""
    arm, events = tables.get("ARM"), tables.get("EV")
    recorded: list[tuple[float, bool]] = []
    if arm is not None and has(arm, "ArmState"):
        recorded = list(zip(arm.t.tolist(), (arm["ArmState"] == 1).tolist(), strict=True))
    elif events is not None and has(events, "Id"):
        part = events.where(np.isin(events["Id"], (_EV_ARMED, _EV_DISARMED)))
        recorded = list(zip(part.t.tolist(), (part["Id"] == _EV_ARMED).tolist(), strict=True))
    return with_said(recorded, messages(tables.get("MSG")))


def refusals(table: Table | None) -> list[tuple[float, str]]:
    return [(t, text) for t, text in messages(table) if REFUSAL.match(text)]


def last_refusals(mission: Mission) -> list[tuple[float, str]]:
    """The complaints that still stood when arming was last refused, each once, latest time."""
    said = refusals(mission.tables.get("MSG"))
    attempts = [t for t, text in said if text.startswith("Arm:")] or [t for t, _ in said]
    if not attempts:
        return []
    standing: dict[str, tuple[float, str]] = {}
    for t, text in said:
        if t >= attempts[-1] - 0.5:
            standing[REFUSAL.sub(r"\1", text)] = (t, text)
    return sorted(standing.values())


def is_armed(mission: Mission) -> bool:
    return mission.shared(_was_armed)


def _was_armed(mission: Mission) -> bool:
    return any(armed and t <= mission.end_s for t, armed in arm_events(mission.tables))


def errors(mission: Mission) -> list[tuple[float, int, int]]:
    table = mission.table("ERR")
    if table is None or not has(table, "Subsys", "ECode"):
        return []
    return [
        (t, int(subsystem), int(code))
        for t, subsystem, code in zip(table.t.tolist(), table["Subsys"], table["ECode"], strict=True)
    ]


def telling(mission: Mission) -> list[tuple[float, str, str]]:
    """Messages of the flight that speak about a failure: time, text and kind."""
    found = []
    for t, text in messages(mission.tables.get("MSG"), mission.start_s, mission.end_s + _SAID_AFTER_S):
        kind = next((kind for pattern, kind in _MESSAGE_KINDS if pattern.search(text)), None)
        if kind is not None and not REFUSAL.match(text):
            found.append((t, text, kind))
    return found


def forced(mission: Mission) -> bool:
    arm = mission.table("ARM")
    if arm is None or not has(arm, "ArmState", "Forced"):
        return False
    return bool(np.any((arm["ArmState"] == 0) & (arm["Forced"] == 1)))


CUT = Unavailable("the log ends before the vehicle disarmed", "record until it has disarmed")
NOT_FLOWN = Unavailable("the vehicle never armed", "see why arming was refused")
_EVENTS: Wanted = {name: NEEDS[name] for name in ("MSG", "ARM", "EV", "ERR")}


def has_event(mission: Mission, kind: str, about: str = "") -> float:
    """1 when an ERR record or a message of the flight is of this kind and speaks of `about`."""
    if not is_armed(mission):
        return 0.0
    word = about.casefold()
    for _, subsystem, code in errors(mission):
        if code and error_kind(subsystem) == kind and word in error_words(subsystem, code).casefold():
            return 1.0
    return float(any(known == kind and word in text.casefold() for _, text, known in telling(mission)))


def _in_flight(mission: Mission, kind: str, about: str = "") -> Value:
    """The same, for a vehicle that was armed: one that never flew shows neither."""
    return has_event(mission, kind, about) if is_armed(mission) else NOT_FLOWN


def failed(mission: Mission) -> bool:
    """Whether something ended the flight for good: no landing after it makes the mission a success."""
    return forced(mission) or bool(has_event(mission, "crash")) or bool(has_event(mission, "failsafe"))


def is_over(mission: Mission) -> bool:
    """Whether the vehicle was disarmed, or drove its mission to the end: what stands on the ground stays there."""
    if mission.ended or not is_armed(mission):
        return mission.ended
    flight = mission.shared(analyse)
    return flight.drive is not None and flight.completed


@extractor("arming_refused", needs=_EVENTS, unit="", args={"text": "count only refusals whose message holds this text"})
def arming_refused(mission: Mission, args: Args) -> Value:
    """1 when arming was refused to the end of the log, else 0; earlier refusals before an arming do not count."""
    if is_armed(mission):
        return 0.0
    word = str(args.get("text", "")).casefold()
    return float(any(word in text.casefold() for _, text in last_refusals(mission)))


@extractor("failsafe", needs=_EVENTS, unit="", args={"about": "battery, radio, EKF, ...; any when not given"})
def failsafe(mission: Mission, args: Args) -> Value:
    """1 when a failsafe acted in flight, else 0."""
    return _in_flight(mission, "failsafe", str(args.get("about", "")))


@extractor("crash", needs=_EVENTS, unit="")
def crash(mission: Mission, args: Args) -> Value:
    """1 when the autopilot's crash check disarmed the vehicle, else 0."""
    return _in_flight(mission, "crash")


@extractor("thrust_loss", needs=_EVENTS, unit="")
def thrust_loss(mission: Mission, args: Args) -> Value:
    """1 when the autopilot reported that thrust could not hold attitude or height, else 0."""
    return _in_flight(mission, "thrust")


@extractor("ekf_trouble", needs=_EVENTS, unit="")
def ekf_trouble(mission: Mission, args: Args) -> Value:
    """1 when the estimator reported variance, a lane switch or a yaw reset in flight, else 0."""
    return _in_flight(mission, "ekf")


@extractor("forced_disarm", needs=_EVENTS, unit="")
def forced_disarm(mission: Mission, args: Args) -> Value:
    """1 when the operator disarmed the vehicle by force, else 0."""
    if not is_armed(mission):
        return NOT_FLOWN
    arm = mission.table("ARM")
    return float(forced(mission)) if arm is not None and has(arm, "Forced") else missing("ARM with Forced")


@extractor("arming_time", needs=_EVENTS, unit="s")
def arming_time(mission: Mission, args: Args) -> Value:
    """Time from the first refusal of arming to the arming, 0 when it was never refused."""
    if not is_armed(mission):
        return NOT_FLOWN
    earlier = [end for _, end, _ in armed_spans(mission.tables, mission.end_s) if end < mission.start_s]
    since = max(earlier, default=-math.inf)
    refused = [t for t, _ in refusals(mission.tables.get("MSG")) if since < t < mission.start_s]
    return mission.start_s - min(refused, default=mission.start_s)
