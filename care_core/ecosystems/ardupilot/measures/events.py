"""What an ArduPilot log says of a flight: arming, refusals, errors, and messages that speak of a failure."""

from __future__ import annotations

import math
import re

from care_core.ecosystems.ardupilot.airborne import Hit
from care_core.ecosystems.ardupilot.aloft import FALLS_MS, ends_aloft
from care_core.ecosystems.ardupilot.armed import ArmChange
from care_core.ecosystems.ardupilot.measures.flown_mission import NEEDS, SAID_AFTER_S, analyse
from care_core.ecosystems.ardupilot.measures.modes import flight_of, is_armed
from care_core.ecosystems.ardupilot.measures.samples import everything
from care_core.ecosystems.ardupilot.recorded import ErrorRecord
from care_core.ecosystems.ardupilot.texts import Refusal, refusal_of
from care_core.ecosystems.measures import Args, Mission, extractor, missing
from care_core.ecosystems.vehicles import FAILSAFE, error_kind, error_words
from care_core.ecosystems.vehicles.arming import NEVER_ARMED
from care_core.logs.base import Wanted
from care_core.run import Unavailable, Value
from care_core.text import listed

_TELLS = (4, 1)
"""From here on "Arm:" instead of "PreArm:" begins whatever an attempt to arm complains of (AP_Arming.cpp)."""
_FEW = 2
"""Refusals that are told in one line."""
_STILL_S = 0.5
"""A complaint so shortly before the last attempt to arm stood when it was refused."""
_MESSAGE_KINDS: tuple[tuple[re.Pattern[str], str], ...] = (
    (re.compile(r"crash", re.IGNORECASE), "crash"),
    (re.compile(rf"{FAILSAFE.pattern}|battery .* is (low|critical)|^low battery\b", re.IGNORECASE), "failsafe"),
    (re.compile(r"EKF variance|lane switch|emergency yaw reset|GPS Glitch", re.IGNORECASE), "ekf"),
    (re.compile(r"thrust loss", re.IGNORECASE), "thrust"),
    (re.compile(r"vibration compensation", re.IGNORECASE), "vibration"),
)
"""Messages of a flight that speak about its failure, first match counts."""


def last_refusals(mission: Mission) -> list[Refusal]:
    """The complaints that still stood when arming was last refused, each once, latest time."""
    refusals = flight_of(mission).lasting_refusals
    attempts = [one for one in refusals if one.was_tried] or list(refusals)
    standing = {one.why: one for one in refusals if one.time_s >= attempts[-1].time_s - _STILL_S}
    return sorted(standing.values(), key=lambda one: (one.time_s, one.text))


def refused_for(mission: Mission) -> str:
    """What stood when arming was last refused, a few of it in words; empty where nothing was refused."""
    if not flight_of(mission).lasting_refusals:
        return ""
    told = {one.complaint: one.why for one in last_refusals(mission)}
    return listed(list(told.values())[:_FEW])


def was_asked(mission: Mission) -> bool:
    """Whether a text says that somebody tried to arm it."""
    return any(one.was_tried for one in flight_of(mission).refusals)


def never_asked(mission: Mission) -> Unavailable:
    """Of a vehicle that never armed, and that nobody tried to arm as far as is known: what it would have said."""
    flight = flight_of(mission)
    refused = refused_for(mission)
    why = f"; it would refuse: {refused}" if refused else ""
    tells = flight.vehicle.version is not None and flight.vehicle.version[:2] >= _TELLS
    asked = "nobody asked it to" if tells else "its firmware does not say whether anybody asked it to"
    return Unavailable(f"the vehicle never armed, and {asked}{why}")


def errors(mission: Mission) -> list[ErrorRecord]:
    """The ERR records of the mission."""
    records = flight_of(mission).error_records
    return [one for one in records if mission.start_s <= one.time_s <= mission.end_s]


def telling(mission: Mission) -> list[tuple[float, str, str]]:
    """Messages of the flight that speak about a failure: time, text and kind."""
    found = []
    for t, text in flight_of(mission).messages_between(mission.start_s, mission.end_s + SAID_AFTER_S):
        kind = next((kind for pattern, kind in _MESSAGE_KINDS if pattern.search(text)), None)
        if kind is not None and refusal_of(t, text) is None:
            found.append((t, text, kind))
    return found


def forced(mission: Mission) -> bool:
    """Whether somebody disarmed the vehicle by force."""
    return any(change.is_forced and not change.is_armed for change in _arm_changes(mission))


def _arm_changes(mission: Mission) -> list[ArmChange]:
    changes = flight_of(mission).arm_changes
    return [change for change in changes if mission.start_s <= change.time_s <= mission.end_s]


UNRECORDED = Unavailable("the log records no arming", "set LOG_DISARMED to 1", "ARM")
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
    return has_event(mission, kind, about) if is_armed(mission) else NEVER_ARMED


def crash_of(mission: Mission) -> str:
    """What says that the vehicle crashed, in a clause; empty where nothing does."""
    if has_event(mission, "crash"):
        return "the autopilot reported a crash"
    if (hit := hit_of(mission)) is not None:
        return f"it hit {hit.what} at {hit.speed_ms:.1f} m/s"
    flight = flight_of(mission)
    if flight.impact_s is None or not mission.start_s <= flight.impact_s <= mission.end_s + SAID_AFTER_S:
        return ""
    return "it turned over" if flight.impact_s == flight.turned_over_s else "control was lost, and it came down"


def fall_of(mission: Mission) -> str:
    """What says that a vehicle without wings was falling out of control, or faster than any is told to, as its log
    ended, in a clause; empty where nothing does."""
    flight = flight_of(mission)
    aloft = None if flight.is_winged or mission.ended else ends_aloft(flight.run_at(flight.end_s))
    if aloft is None or not aloft.is_falling or mission.end_s < flight.end_s - SAID_AFTER_S:
        return ""
    lost = flight.lost_control_s
    if lost is not None and mission.start_s <= lost:
        return f"control was lost, and it was {aloft} as the log ends"
    return f"it was {aloft} as the log ends" if aloft.fell_ms > FALLS_MS else ""


def hit_of(mission: Mission) -> Hit | None:
    """The contact with the ground at speed that ended the mission, None where there was none."""
    hit = flight_of(mission).ending_hit
    return hit if hit is not None and mission.start_s <= hit.time_s <= mission.end_s + SAID_AFTER_S else None


def failed(mission: Mission) -> bool:
    """Whether something ended the flight for good: no landing after it makes the mission a success."""
    return forced(mission) or bool(crash_of(mission)) or bool(has_event(mission, "failsafe"))


def is_over(mission: Mission) -> bool:
    """Whether the vehicle was disarmed, or drove its mission to the end: what stands on the ground stays there."""
    if mission.ended or not is_armed(mission):
        return mission.ended
    flown = mission.shared(analyse)
    return flown.drive is not None and flown.completed


@extractor("arming_refused", needs=_EVENTS, unit="", args={"text": "count only refusals whose message holds this text"})
def arming_refused(mission: Mission, args: Args) -> Value:
    """1 when arming was refused to the end of the log, else 0; earlier refusals before an arming do not count."""
    if is_armed(mission):
        return 0.0
    word = str(args.get("text", "")).casefold()
    return float(any(word in one.text.casefold() for one in last_refusals(mission)))


@extractor(
    "failsafe",
    needs=_EVENTS,
    unit="",
    args={"about": "battery, radio, EKF, ...; any when not given"},
    rests_on=everything,
)
def failsafe(mission: Mission, args: Args) -> Value:
    """1 when a failsafe acted in flight, else 0."""
    return _in_flight(mission, "failsafe", str(args.get("about", "")))


@extractor("crash", needs=_EVENTS, unit="", rests_on=everything)
def crash(mission: Mission, args: Args) -> Value:
    """1 when the autopilot's crash check disarmed the vehicle, else 0."""
    return _in_flight(mission, "crash")


@extractor("thrust_loss", needs=_EVENTS, unit="", rests_on=everything)
def thrust_loss(mission: Mission, args: Args) -> Value:
    """1 when the autopilot reported that thrust could not hold attitude or height, else 0."""
    return _in_flight(mission, "thrust")


@extractor("ekf_trouble", needs=_EVENTS, unit="", rests_on=everything)
def ekf_trouble(mission: Mission, args: Args) -> Value:
    """1 when the estimator reported variance, a lane switch or a yaw reset in flight, else 0."""
    return _in_flight(mission, "ekf")


@extractor("forced_disarm", needs=_EVENTS, unit="", rests_on=everything)
def forced_disarm(mission: Mission, args: Args) -> Value:
    """1 when the operator disarmed the vehicle by force, else 0."""
    if not is_armed(mission):
        return NEVER_ARMED
    is_recorded = any(change.is_forced is not None for change in _arm_changes(mission))
    return float(forced(mission)) if is_recorded else missing("ARM with Forced")


@extractor("arming_time", needs=_EVENTS, unit="s")
def arming_time(mission: Mission, args: Args) -> Value:
    """Time from the first refusal of arming to the arming, 0 when it was never refused."""
    if not is_armed(mission):
        return NEVER_ARMED
    flight = flight_of(mission)
    since = max((end for _, end in flight.recorded_armed if end < mission.start_s), default=-math.inf)
    refused = [one.time_s for one in flight.refusals if since < one.time_s < mission.start_s]
    return mission.start_s - min(refused, default=mission.start_s)
