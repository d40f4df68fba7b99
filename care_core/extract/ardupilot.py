"""ArduPilot flights: how missions are found in a DataFlash log, and the extractors that read them.

A mission is one arming to the next disarm. A log without any arming in which arming was refused is one mission
too: the vehicle never left the ground, and its last refusals say why.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from care_core.extract.asked import asked
from care_core.extract.flight import AIRBORNE_M, NEEDS, Flight, analyse, messages, metres_between, waypoint_offsets
from care_core.extract.modes import flew_automatically, kind_flown, mode_names, modes_in_force
from care_core.extract.registry import (
    MISSION_KINDS,
    Args,
    Mission,
    MissionKind,
    extractor,
    has,
    merge_needs,
    missing,
    numeric,
    one_of,
    points,
)
from care_core.logs.base import Table, Wanted
from care_core.logs.plausible import is_alive, plausible
from care_core.run import Check, Evidence, Unavailable, Value, is_known
from care_core.vehicles import FAILSAFE, error_kind, error_words, flies, mode_name, motor_outputs, with_said

Floats = NDArray[np.float64]

_EV_ARMED, _EV_DISARMED = 10, 11
_REFUSAL = re.compile(r"(?:Pre)?Arm: (.*)")
_WAYPOINT_TOLERANCE_M = 5.0
_MIN_ROWS = 5
_SAID_AFTER_S = 0.6
"""A crash disarms first and is said then; telemetry knows a disarming to half a second (its heartbeats)."""
_TOOK_OFF, _LANDED = (16, 28), (18,)
"""EV records of the land detector."""
_DRIVES = frozenset(("rover",))
_GLIDES = frozenset(("plane", "quadplane"))
"""What lands where it finds room: its last height says little."""
_MOVED_M = 5.0
_TOUCHED_S, _SWITCHED_OFF_S = 5.0, 0.05
_BARELY_M = 0.5
"""Rise below which a vehicle never left the ground: barometers drift by less in a flight's time."""
"""A receiver that stands still wanders by its accuracy, 2 to 3 m."""
PHASE_ARGS = {
    "phase": one_of(
        "only this part of the flight: takeoff, leg, return, return_climb, return_cruise, descent, touchdown; of a "
        "drive: mission (from its start to where it is complete, or ends), leg, hold",
        *("takeoff", "leg", "return", "return_climb", "return_cruise", "descent", "touchdown", "mission", "hold"),
    ),
    "index": numeric("number of the leg or wait, from 1"),
}
_STATISTIC = one_of("mean, max, min, std, rms or peak (95th percentile)", "mean", "max", "min", "std", "rms", "peak")

HEIGHTS: Wanted = {"POS": ("RelHomeAlt",), "CTUN": ("Alt", "BAlt", "BarAlt")}
"""Where heights are told: above home, else above some other ground."""

_MESSAGE_KINDS: tuple[tuple[re.Pattern[str], str], ...] = (
    (re.compile(r"crash", re.IGNORECASE), "crash"),
    (re.compile(rf"{FAILSAFE.pattern}|battery .* is (low|critical)", re.IGNORECASE), "failsafe"),
    (re.compile(r"EKF variance|lane switch|emergency yaw reset|GPS Glitch", re.IGNORECASE), "ekf"),
    (re.compile(r"thrust loss", re.IGNORECASE), "thrust"),
    (re.compile(r"vibration compensation", re.IGNORECASE), "vibration"),
)
"""Messages of a flight that speak about its failure, first match counts."""


class ArduPilotFlight(MissionKind):
    """From arming to disarming."""

    name = "ardupilot_flight"
    args: Mapping[str, str] = {
        "waypoints": points("list of [latitude, longitude, height above home in m] that the thresholds belong to", 3),
        "tolerance_m": numeric("how far from home a landing may end, and a waypoint may be off"),
    }

    def needs(self, spec: Args) -> Wanted:
        return merge_needs((NEEDS, HEIGHTS))

    def missions(self, tables: Mapping[str, Table], duration_s: float, spec: Args) -> tuple[Mission, ...]:
        spans = _armed_spans(tables, duration_s)
        if not spans and not _arm_events(tables) and _refusals(tables.get("MSG")):
            spans = [(0.0, duration_s, True)]
        sound = plausible(tables)
        return tuple(Mission(sound, start_s, end_s, ended, spec) for start_s, end_s, ended in spans)

    def mismatch(self, mission: Mission) -> str:
        expected = mission.spec.get("waypoints", ())
        flown = mission.shared(analyse).waypoints
        if not expected:
            return ""
        if len(flown) != len(expected):
            return f"the mission has {len(flown)} waypoints, the profile's has {len(expected)}"
        tolerance_m = float(mission.spec.get("tolerance_m", _WAYPOINT_TOLERANCE_M))
        for number, off_m in enumerate(waypoint_offsets(flown, expected), start=1):
            if off_m > tolerance_m:
                return f"waypoint {number} is {off_m:.0f} m from where the profile's mission has it"
        return ""

    def evidence(self, mission: Mission) -> tuple[Evidence, ...]:
        if not _is_armed(mission):
            return tuple(Evidence(t, text, "refusal") for t, text in _last_refusals(mission))
        found = [Evidence(t, text, kind) for t, text, kind in _telling(mission)]
        spoken = {one.kind for one in found}
        for t, subsystem, code in _errors(mission):
            kind = error_kind(subsystem)
            if kind and code and kind not in spoken:
                found.append(Evidence(t, f"ERR: {error_words(subsystem, code, kind_flown(mission))}", kind))
        if _forced(mission):
            found.append(Evidence(mission.end_s, "Disarmed by force in flight", "forced"))
        return tuple(sorted(found, key=lambda one: one.time_s))

    def is_decided(self, mission: Mission) -> bool:
        return _is_over(mission) or (_is_armed(mission) and _failed(mission))

    def checks(self, mission: Mission) -> tuple[Check, ...]:
        return () if not _is_armed(mission) or flew_automatically(mission) else tuple(_plain_checks(mission))

    def outcome(self, mission: Mission) -> tuple[Check, ...]:
        if _is_armed(mission):
            return tuple(_plain_checks(mission, and_mission=True))
        asked_for = any(text.startswith("Arm:") for _, text in _refusals(mission.tables.get("MSG")))
        never = 0.0 if asked_for else Unavailable("the vehicle never armed, and nobody asked it to")
        return (Check("armed", never, "the vehicle armed", "arming was refused"),)

    def modes(self, mission: Mission) -> tuple[str, ...]:
        return mode_names(mission)


MISSION_KINDS[ArduPilotFlight.name] = ArduPilotFlight()


def _armed_spans(tables: Mapping[str, Table], duration_s: float) -> list[tuple[float, float, bool]]:
    """Start, end and whether it ended, of every time the motors were armed."""
    spans: list[tuple[float, float, bool]] = []
    armed_at: float | None = None
    for t, is_armed in _arm_events(tables):
        if is_armed and armed_at is None:
            armed_at = t
        elif not is_armed and armed_at is not None:
            spans.append((armed_at, t, True))
            armed_at = None
    if armed_at is not None:
        spans.append((armed_at, duration_s, False))
    return spans


def _arm_events(tables: Mapping[str, Table]) -> list[tuple[float, bool]]:
    arm, events = tables.get("ARM"), tables.get("EV")
    recorded: list[tuple[float, bool]] = []
    if arm is not None and has(arm, "ArmState"):
        recorded = list(zip(arm.t.tolist(), (arm["ArmState"] == 1).tolist(), strict=True))
    elif events is not None and has(events, "Id"):
        part = events.where(np.isin(events["Id"], (_EV_ARMED, _EV_DISARMED)))
        recorded = list(zip(part.t.tolist(), (part["Id"] == _EV_ARMED).tolist(), strict=True))
    return with_said(recorded, messages(tables.get("MSG")))


def _refusals(table: Table | None) -> list[tuple[float, str]]:
    return [(t, text) for t, text in messages(table) if _REFUSAL.match(text)]


def _last_refusals(mission: Mission) -> list[tuple[float, str]]:
    """The complaints that still stood when arming was last refused, each once, latest time."""
    refusals = _refusals(mission.tables.get("MSG"))
    attempts = [t for t, text in refusals if text.startswith("Arm:")] or [t for t, _ in refusals]
    if not attempts:
        return []
    standing: dict[str, tuple[float, str]] = {}
    for t, text in refusals:
        if t >= attempts[-1] - 0.5:
            standing[_REFUSAL.sub(r"\1", text)] = (t, text)
    return sorted(standing.values())


def _is_armed(mission: Mission) -> bool:
    return any(is_armed and t <= mission.end_s for t, is_armed in _arm_events(mission.tables))


def _errors(mission: Mission) -> list[tuple[float, int, int]]:
    table = mission.table("ERR")
    if table is None or not has(table, "Subsys", "ECode"):
        return []
    return [
        (t, int(subsystem), int(code))
        for t, subsystem, code in zip(table.t.tolist(), table["Subsys"], table["ECode"], strict=True)
    ]


def _telling(mission: Mission) -> list[tuple[float, str, str]]:
    """Messages of the flight that speak about a failure: time, text and kind."""
    found = []
    for t, text in messages(mission.tables.get("MSG"), mission.start_s, mission.end_s + _SAID_AFTER_S):
        kind = next((kind for pattern, kind in _MESSAGE_KINDS if pattern.search(text)), None)
        if kind is not None and not _REFUSAL.match(text):
            found.append((t, text, kind))
    return found


def _forced(mission: Mission) -> bool:
    arm = mission.table("ARM")
    if arm is None or not has(arm, "ArmState", "Forced"):
        return False
    return bool(np.any((arm["ArmState"] == 0) & (arm["Forced"] == 1)))


_CUT = Unavailable("the log ends before the vehicle disarmed", "record until it has disarmed")
_NOT_FLOWN = Unavailable("the vehicle never armed", "see why arming was refused")
_EVENTS: Wanted = {name: NEEDS[name] for name in ("MSG", "ARM", "EV", "ERR")}


def flight_of(mission: Mission) -> Flight | Unavailable:
    return mission.shared(analyse) if _is_armed(mission) else _NOT_FLOWN


def _has_event(mission: Mission, kind: str, about: str = "") -> float:
    """1 when an ERR record or a message of the flight is of this kind and speaks of `about`."""
    if not _is_armed(mission):
        return 0.0
    word = about.casefold()
    for _, subsystem, code in _errors(mission):
        if code and error_kind(subsystem) == kind and word in error_words(subsystem, code).casefold():
            return 1.0
    return float(any(known == kind and word in text.casefold() for _, text, known in _telling(mission)))


# --- outcome ---------------------------------------------------------------------------------------------------


def _in_flight(mission: Mission, kind: str, about: str = "") -> Value:
    """The same, for a vehicle that was armed: one that never flew shows neither."""
    return _has_event(mission, kind, about) if _is_armed(mission) else _NOT_FLOWN


def _failed(mission: Mission) -> bool:
    """Whether something ended the flight for good: no landing after it makes the mission a success."""
    return _forced(mission) or bool(_has_event(mission, "crash")) or bool(_has_event(mission, "failsafe"))


def _is_over(mission: Mission) -> bool:
    """Whether the vehicle was disarmed, or drove its mission to the end: what stands on the ground stays there."""
    if mission.ended or not _is_armed(mission):
        return mission.ended
    flight = mission.shared(analyse)
    return flight.drive is not None and flight.completed


def _nothing_to_judge(mission: Mission, flight: Flight) -> Unavailable | None:
    """Why a flight says nothing about a mission, None when it does."""
    if not flight.waypoints:
        return Unavailable("the log names no waypoints", "record CMD")
    if "MSG" not in mission.tables:
        return Unavailable("the log does not say which waypoints were reached", "record MSG")
    return None


def _plain_checks(mission: Mission, *, and_mission: bool = False) -> Iterator[Check]:
    """What a flight or drive is judged by that no limit belongs to; with its mission, where one was begun."""
    failed = bool(_has_event(mission, "crash"))
    yield Check("armed", 1.0, "the vehicle armed")
    kind = kind_flown(mission)
    if flies(kind):
        yield Check("took_off", _took_off(mission, failed=failed), "it left the ground", "it never left the ground")
    elif and_mission and kind in _DRIVES:
        yield Check("moved", _moved(mission), "it moved")
    done: Value = 0.0
    if and_mission and any(mode.way == "mission" for mode in mission.shared(modes_in_force)):
        done = _mission_done(mission)
        yield Check("mission_success", done, "every waypoint of the mission was reached", _short_of(mission))
    yield Check("no_crash", 1.0 - failed, "the autopilot reported no crash", "the autopilot reported a crash")
    acted = _has_event(mission, "failsafe")
    yield Check("no_failsafe", 1.0 - acted, "no failsafe acted", "a failsafe acted")
    if flies(kind):
        landed = Unavailable("it crashed") if failed else _landed(mission)
        yield Check("landed", landed, "it was on the ground at the end", "it was disarmed above the ground")
    elif done == 1.0 and not mission.ended:
        return  # what stands on the ground when all is done comes to no harm by staying armed
    at_end: Value = 1.0 - _forced(mission) if mission.ended else _CUT
    yield Check("disarmed", at_end, "it was disarmed, and not by force in flight", "it was disarmed by force")


def _mission_done(mission: Mission) -> Value:
    """1 where the vehicle says that its mission is complete or reached every waypoint of it, 0 where a crash or a
    failsafe ended it or it was disarmed on its way; what somebody broke off is no failure of the mission."""
    flight = mission.shared(analyse)
    if flight.completed:
        return 1.0
    unknown = _nothing_to_judge(mission, flight)
    if unknown is not None:
        return unknown
    if flight.reached >= len(flight.waypoints):
        return 1.0
    if _failed(mission):
        return 0.0
    if not mission.ended:
        return _CUT
    last = mission.shared(modes_in_force)[-1]
    if last.way == "mission":
        return 0.0
    name = mode_name(kind_flown(mission), last.number)
    return Unavailable(f"{_short_of(mission)}, and the last mode was {name}", "judge a run that ends in its mission")


def _short_of(mission: Mission) -> str:
    flight = mission.shared(analyse)
    return f"{flight.reached} of the mission's {len(flight.waypoints)} waypoints were reached"


def _moved(mission: Mission) -> Value:
    """1 where its position changed by more than positions do that stand still; to stay is no failure."""
    position = mission.table("POS")
    if not has(position, "Lat", "Lng"):
        return Unavailable("the log holds no position", "record POS", "POS")
    far = metres_between(position["Lat"], position["Lng"])
    return 1.0 if far > _MOVED_M else Unavailable(f"it stayed within {far:.1f} m")


def _took_off(mission: Mission, *, failed: bool) -> Value:
    heights = _heights(mission)
    flew = (len(heights) and bool(heights.max() > AIRBORNE_M)) or _detected(mission, _TOOK_OFF)
    if flew or failed:
        return float(flew)
    if len(heights) and heights.max() > _BARELY_M:
        return Unavailable(f"it rose no higher than {heights.max():.1f} m: too little to tell a flight by")
    return Unavailable("it never left the ground" if len(heights) else "the log holds no height")


def _landed(mission: Mission) -> Value:
    if not is_known(_took_off(mission, failed=False)):
        return _took_off(mission, failed=False)
    if not mission.ended:
        return _CUT
    heights = _heights(mission)
    low = bool(heights[-1] <= AIRBORNE_M) if len(heights) else _detected(mission, _LANDED)
    low = low or _touched_down(mission)
    if not low and kind_flown(mission) in _GLIDES:
        return Unavailable(f"it was disarmed {heights[-1]:.0f} m above home" if len(heights) else "nothing says so")
    return float(low)


def _heights(mission: Mission) -> Floats:
    """Heights above home while armed, shape (n,); none where the log does not tell any."""
    for channel, fields in HEIGHTS.items():
        table = mission.table(channel)
        for field in fields:
            if table is not None and has(table, field):
                heights = table[field][np.isfinite(table[field])]
                if len(heights) and np.ptp(heights) > 0:
                    return np.asarray(heights - (0.0 if channel == "POS" else heights[0]), dtype=np.float64)
    return np.empty(0)


def _touched_down(mission: Mission) -> bool:
    """Whether the land detector found the ground just before it was disarmed, whatever a barometer that drifted says:
    disarming itself sets the detector as well, so that record does not count."""
    table = mission.table("EV")
    if not has(table, "Id"):
        return False
    said = table.t[np.isin(table["Id"], _LANDED)]
    return bool(((said > mission.end_s - _TOUCHED_S) & (said < mission.end_s - _SWITCHED_OFF_S)).any())


def _detected(mission: Mission, events: tuple[int, ...]) -> bool:
    """Whether the land detector said so."""
    table = mission.table("EV")
    return table is not None and has(table, "Id") and bool(np.isin(table["Id"], events).any())


@extractor("mission_success", needs=NEEDS, unit="")
def mission_success(mission: Mission, args: Args) -> Value:
    """1 when every waypoint was reached, the vehicle landed where the mission ends (within `tolerance_m` of it; a rover
    says that its mission is complete) and disarmed by itself, with no crash and no failsafe; else 0. A refused arming
    is 0."""
    if not _is_armed(mission):
        return 0.0
    if not flew_automatically(mission):
        return Unavailable("no mission was flown")
    if _failed(mission):
        return 0.0
    return _mission_flown(mission) if _is_over(mission) else _CUT


def _mission_flown(mission: Mission) -> Value:
    """1 when every waypoint was reached and the vehicle landed where the mission ends, or said so, else 0."""
    flight = mission.shared(analyse)
    unknown = _nothing_to_judge(mission, flight)
    if unknown is not None:
        return unknown
    if flight.reached < len(flight.waypoints):
        return 0.0
    if flight.drive is not None:
        return float(flight.completed)
    if flight.end is None:
        return 1.0
    off_m = landing_error(mission, {})
    if not is_known(off_m):
        return off_m
    return float(off_m <= float(mission.spec.get("tolerance_m", _WAYPOINT_TOLERANCE_M)))


@extractor("arming_refused", needs=_EVENTS, unit="", args={"text": "count only refusals whose message holds this text"})
def arming_refused(mission: Mission, args: Args) -> Value:
    """1 when arming was refused to the end of the log, else 0; earlier refusals before an arming do not count."""
    if _is_armed(mission):
        return 0.0
    word = str(args.get("text", "")).casefold()
    return float(any(word in text.casefold() for _, text in _last_refusals(mission)))


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
    if not _is_armed(mission):
        return _NOT_FLOWN
    arm = mission.table("ARM")
    return float(_forced(mission)) if arm is not None and has(arm, "Forced") else missing("ARM with Forced")


@extractor("arming_time", needs=_EVENTS, unit="s")
def arming_time(mission: Mission, args: Args) -> Value:
    """Time from the first refusal of arming to the arming, 0 when it was never refused."""
    if not _is_armed(mission):
        return _NOT_FLOWN
    earlier = [end for _, end, _ in _armed_spans(mission.tables, mission.end_s) if end < mission.start_s]
    since = max(earlier, default=-math.inf)
    refused = [t for t, _ in _refusals(mission.tables.get("MSG")) if since < t < mission.start_s]
    return mission.start_s - min(refused, default=mission.start_s)


@extractor("waypoints_reached", needs=NEEDS, unit="")
def waypoints_reached(mission: Mission, args: Args) -> Value:
    """How many of the mission's waypoints the autopilot reported as reached."""
    flight = flight_of(mission)
    if isinstance(flight, Unavailable):
        return flight
    return float(flight.reached) if flight.waypoints else Unavailable("the log names no waypoints", "record CMD")


@extractor("landing_error", needs=NEEDS, unit="m")
def landing_error(mission: Mission, args: Args) -> Value:
    """Horizontal distance at the end of the flight from where the mission ends: home, or where it lands."""
    flight = flight_of(mission)
    if isinstance(flight, Unavailable):
        return flight
    if flight.track is None:
        return missing("POS")
    if flight.end is None:
        return Unavailable("the mission does not say where it ends")
    return math.hypot(flight.track.north[-1] - flight.end[0], flight.track.east[-1] - flight.end[1])


@extractor("waypoint_miss", needs=NEEDS, unit="m")
def waypoint_miss(mission: Mission, args: Args) -> Value:
    """The largest, over the waypoints, of the smallest horizontal distance from the waypoint: corners cut."""
    flight = flight_of(mission)
    if isinstance(flight, Unavailable):
        return flight
    if flight.track is None or not len(flight.route):
        return missing("POS" if flight.track is None else "CMD")
    north, east = flight.track.north[:, None] - flight.route[:, 0], flight.track.east[:, None] - flight.route[:, 1]
    return float(np.hypot(north, east).min(axis=0).max())


# --- time, way, energy -----------------------------------------------------------------------------------------


@extractor("mission_time", needs=NEEDS, unit="s")
def mission_time(mission: Mission, args: Args) -> Value:
    """Time from arming to disarming."""
    return mission.end_s - mission.start_s if _is_armed(mission) else _NOT_FLOWN


@extractor("phase_time", needs=NEEDS, unit="s", args=PHASE_ARGS)
def phase_time(mission: Mission, args: Args) -> Value:
    """Duration of one completed part of the flight."""
    span = _phase(mission, args)
    return span if isinstance(span, Unavailable) else span[1] - span[0]


@extractor("cruise_speed", needs=NEEDS, unit="m/s")
def cruise_speed(mission: Mission, args: Args) -> Value:
    """Length of the legs that were completed over the time for them, without the waits at their ends."""
    flight = flight_of(mission)
    if isinstance(flight, Unavailable):
        return flight
    given = mission.shared(asked)
    if isinstance(given, Unavailable):
        return given
    done = [i - 1 for name, i in flight.phases if name == "leg"]
    if not done or len(given.lengths) != len(flight.waypoints):
        return Unavailable("the flight completed no leg")
    waited_s = 0.0 if flight.drive is not None else float(given.holds_s[done].sum())
    moving_s = sum(flight.phases["leg", i + 1].duration_s for i in done) - waited_s
    length_m = float(given.lengths[done].sum())
    return length_m / moving_s if moving_s > 0 and length_m > 0 else Unavailable("the legs have no length")


@extractor("return_height", needs=NEEDS, unit="m")
def return_height(mission: Mission, args: Args) -> Value:
    """The greatest height above home on the way back."""
    span = _phase(mission, {"phase": "return_climb"})
    flight = flight_of(mission)
    if isinstance(span, Unavailable):
        return span
    if isinstance(flight, Unavailable) or flight.track is None:
        return missing("POS")
    return float(flight.track.height[flight.track.t >= span[0]].max())


@extractor("distance", needs=NEEDS, unit="m")
def distance(mission: Mission, args: Args) -> Value:
    """Length of the way over ground while airborne; of a rover, in its mission."""
    flight = flight_of(mission)
    if isinstance(flight, Unavailable):
        return flight
    if flight.track is None:
        return missing("POS")
    steps = np.hypot(np.diff(flight.track.north), np.diff(flight.track.east))
    return float(steps[flight.under_way(flight.track.t)[1:]].sum())


@extractor("path_error", needs=NEEDS, unit="m", args={"stat": one_of("max or mean", "max", "mean")})
def path_error(mission: Mission, args: Args) -> Value:
    """Horizontal distance from the legs (home, waypoints, home if it returns) while airborne, or in a rover's
    mission."""
    flight = flight_of(mission)
    if isinstance(flight, Unavailable):
        return flight
    if flight.track is None or not len(flight.corners):
        return missing("POS" if flight.track is None else "CMD")
    return statistic(flight.path_errors(), str(args.get("stat", "max")))


_BATTERY: Wanted = {"BAT": ("Inst", "Instance", "Volt", "Curr", "EnrgTot")}
_LEAST_V = 2.0
"""A lithium cell is empty above it."""
_LEAST_W, _MOST_W = 1.0, 1e5
"""Mean power while armed: an autopilot and its receivers alone take more than a watt, air taxis up to 100 kW."""
_AGREE, _ENOUGH_FOR_DOUBT = 2.0, 20
"""By what factor the monitor's counter and voltage times current may differ; thinned logs miss peaks, not half."""
_NO_VOLTAGE = Unavailable("BAT says the same voltage throughout, or none", "is BATT_MONITOR one that measures voltage?")


@extractor("energy_used", needs=merge_needs((NEEDS, _BATTERY)), unit="Wh", args=PHASE_ARGS)
def energy_used(mission: Mission, args: Args) -> Value:
    """Energy drawn between arming and disarming, or in a part of it: the monitor's counter, else voltage times current
    over time."""
    if not _is_armed(mission):
        return _NOT_FLOWN
    span = _phase(mission, args) if "phase" in args else (mission.start_s, mission.end_s)
    if isinstance(span, Unavailable):
        return span
    table = mission.tables.get("BAT")
    if table is None or not len(table):
        return missing("BAT")
    batteries = [battery for battery in _instances(table) if not has(battery, "Volt") or _has_voltage(battery)]
    if not batteries:
        return _NO_VOLTAGE
    used = [_energy(battery, *span) for battery in batteries]
    known = [value for value in used if isinstance(value, float)]
    if known:
        return _unless_absurd(sum(known), mission.end_s - mission.start_s) if "phase" not in args else sum(known)
    if not has(table, "EnrgTot") and not has(table, "Volt", "Curr"):
        return missing("BAT energy, or voltage with current")
    doubt = next((value for value in used if isinstance(value, Unavailable)), None)
    return doubt or Unavailable(
        "BAT says the same current throughout, or none", "is BATT_MONITOR one that measures current?"
    )


def _energy(battery: Table, start_s: float, end_s: float) -> float | Unavailable | None:
    """Wh of one battery between two times, None where its monitor counts and measures nothing."""
    inside = battery.between(start_s, end_s)
    measured, drawn = _known(inside, "Volt", "Curr"), None
    if len(measured) >= _MIN_ROWS and is_alive(measured["Curr"]) and measured["Curr"].any():
        power = measured["Volt"] * measured["Curr"]
        drawn = float(np.sum((power[1:] + power[:-1]) / 2 * np.diff(measured.t)) / 3600)
    counted = _known(inside, "EnrgTot")
    if not len(counted) or np.ptp(counted["EnrgTot"]) <= 0 or (np.diff(counted["EnrgTot"]) < 0).any():
        return drawn
    whole = _known(battery, "EnrgTot")
    start, end = np.interp((start_s, end_s), whole.t, whole["EnrgTot"])
    used = float(end - start)
    if drawn is not None and len(measured) >= _ENOUGH_FOR_DOUBT and not 1 / _AGREE < used / max(drawn, 1e-9) < _AGREE:
        return Unavailable(
            f"BAT counts {used:.3g} Wh, but its voltage times current over time makes {drawn:.3g} Wh",
            "is the scale of the current sensor right, and the log's clock?",
        )
    return used


def _unless_absurd(used: float, time_s: float) -> Value:
    """The energy, unless no vehicle runs on so little or so much."""
    power_w = used * 3600 / time_s if time_s > 0 else math.inf
    if _LEAST_W <= power_w <= _MOST_W:
        return used
    return Unavailable(
        f"BAT says {power_w:.3g} W on average, on which no vehicle runs", "is the scale of the current sensor right?"
    )


def _has_voltage(battery: Table) -> bool:
    """Whether what is called the voltage of a battery is measured: it moves, and no cell is empty at less than 2 V."""
    volts = battery["Volt"][np.isfinite(battery["Volt"])]
    return is_alive(volts) and float(volts.max()) >= _LEAST_V


def _known(table: Table, *fields: str) -> Table:
    """The rows in which all of the fields are numbers; none where the table lacks one."""
    if not has(table, *fields):
        return table.where(slice(0))
    return table.where(np.logical_and.reduce([np.isfinite(table[field]) for field in fields]))


@extractor("min_voltage", needs=merge_needs((NEEDS, _BATTERY)), unit="V")
def min_voltage(mission: Mission, args: Args) -> Value:
    """The lowest battery voltage between arming and disarming."""
    if not _is_armed(mission):
        return _NOT_FLOWN
    table = mission.tables.get("BAT")
    if table is not None and has(table, "Volt") and not _has_voltage(next(iter(_instances(table)), table)):
        return _NO_VOLTAGE
    volts = series(mission, "BAT", ("Volt",), {}, under_way=False)
    return volts if isinstance(volts, Unavailable) else statistic(volts["Volt"], "min")


@extractor("start_voltage", needs=merge_needs((NEEDS, _BATTERY)), unit="V")
def start_voltage(mission: Mission, args: Args) -> Value:
    """Battery voltage in the last second before the motors were armed."""
    table = mission.tables.get("BAT")
    if table is None or not has(table, "Volt"):
        return missing("BAT")
    battery = next(iter(_instances(table)), table)
    if _is_armed(mission) and not _has_voltage(battery):  # no motor, no change
        return _NO_VOLTAGE
    before = battery.between(-math.inf, mission.start_s)
    return float(before["Volt"][-1]) if len(before) else Unavailable("no BAT before arming", "log while disarmed")


@extractor(
    "voltage_margin", needs=merge_needs((NEEDS, _BATTERY)), unit="V", args={"parameter": "the low voltage failsafe"}
)
def voltage_margin(mission: Mission, args: Args) -> Value:
    """How far the lowest voltage of the flight stayed above the low voltage failsafe; below 0 it was crossed."""
    lowest = min_voltage(mission, {})
    name = str(args.get("parameter", "BATT_LOW_VOLT"))
    bound = mission.settings.get(name)
    if not is_known(lowest):
        return lowest
    return lowest - float(bound) if isinstance(bound, (int, float)) else Unavailable(f"no parameter {name} in the log")


# --- statistics over a part of the flight ----------------------------------------------------------------------


def _phase(mission: Mission, args: Args) -> tuple[float, float] | Unavailable:
    """Start and end in the log of the part of the flight that `args` name."""
    flight = flight_of(mission)
    if isinstance(flight, Unavailable):
        return flight
    name, index = str(args.get("phase", "")), int(args.get("index", 0))
    phase = flight.phases.get((name, index))
    if phase is None:
        return Unavailable(f"the flight did not complete '{name}{f' {index}' if index else ''}'")
    return phase.start_s, phase.end_s


def series(
    mission: Mission, channel: str, fields: Sequence[str], args: Args, *, under_way: bool = True
) -> Table | Unavailable:
    """Rows of a channel while under way (or in a phase), first instance only, with all of `fields` finite."""
    flight = flight_of(mission)
    if isinstance(flight, Unavailable):
        return flight
    table = mission.table(channel)
    if table is None or not all(field in table.columns for field in fields):
        return missing(channel)
    table = next(iter(_instances(table)), table)
    if "phase" in args:
        span = _phase(mission, args)
        if isinstance(span, Unavailable):
            return span
        table = table.between(*span)
    elif under_way:
        if flight.track is None and flight.drive is None:
            return missing("POS")
        table = table.where(flight.under_way(table.t))
    finite = np.ones(len(table), dtype=bool)
    for field in fields:
        finite &= np.isfinite(table[field])
    table = table.where(finite)
    if len(table) < _MIN_ROWS:
        return Unavailable(f"too little {channel} in this part of the flight", "was the vehicle under way?")
    return table


def _instances(table: Table) -> list[Table]:
    """The table split by the column that numbers its sensors, lowest first."""
    name = next((name for name in ("I", "IMU", "C", "Inst", "Instance") if name in table.columns), None)
    if name is None:
        return [table]
    return [table.where(table[name] == number) for number in np.unique(table[name])]


def statistic(values: Floats, stat: str) -> Value:
    """One number from many. `peak` is the 95th percentile, which one bad sample cannot move."""
    measures: dict[str, Callable[[Floats], object]] = {
        "mean": np.mean,
        "max": np.max,
        "min": np.min,
        "std": np.std,
        "rms": lambda x: np.sqrt(np.mean(x**2)),
        "peak": lambda x: np.percentile(x, 95),
    }
    if not len(values):
        return Unavailable("the vehicle was never under way")
    if stat not in measures:
        return Unavailable(f"there is no statistic '{stat}'", f"use one of {', '.join(measures)}")
    return float(measures[stat](values))  # type: ignore[arg-type]


def _wrapped(degrees: Floats) -> Floats:
    return np.asarray((degrees + 180.0) % 360.0 - 180.0)


def register(
    name: str, wanted: Wanted, unit: str, doc: str, measure: Callable[[Table, Mission, Args], Floats],
    *, stat: str, args: Mapping[str, str] | None = None,
    columns: Callable[[Mission], Sequence[str]] | None = None,
) -> None:  # fmt: skip
    """Register an extractor that is a statistic of one channel over a part of the flight.

    Args:
        columns: which of the wanted fields this vehicle's log must have; all of them when None.
    """
    ((channel, fields),) = wanted.items()
    required = [field for field in fields if field not in ("I", "IMU", "C")]

    def compute(mission: Mission, given: Args) -> Value:
        table = series(mission, channel, required if columns is None else columns(mission), given)
        if isinstance(table, Unavailable):
            return table
        return statistic(measure(table, mission, given), str(given.get("stat", stat)))

    compute.__doc__ = f"{doc} Statistic: {stat} unless `stat` says otherwise."
    described = {"stat": _STATISTIC, **PHASE_ARGS, **(args or {})}
    extractor(name, needs=merge_needs((NEEDS, wanted)), unit=unit, args=described)(compute)


_AXES = {"roll": ("R", "RDes", "ROut"), "pitch": ("P", "PDes", "POut"), "yaw": ("Y", "YDes", "YOut")}
_AXIS = {"axis": one_of("roll, pitch or yaw; roll unless given", *_AXES)}
_TILT = {"axis": one_of("roll, pitch, yaw, or tilt (roll and pitch together); tilt unless given", *_AXES, "tilt")}


def _attitude_error(table: Table, mission: Mission, args: Args) -> Floats:
    errors = {
        "roll": table["DesRoll"] - table["Roll"],
        "pitch": table["DesPitch"] - table["Pitch"],
        "yaw": _wrapped(table["DesYaw"] - table["Yaw"]),
    }
    axis = args.get("axis", "tilt")
    return np.asarray(np.hypot(errors["roll"], errors["pitch"]) if axis == "tilt" else errors[axis])


def _of_axis(column: Callable[[Table, tuple[str, str, str]], Floats]) -> Callable[[Table, Mission, Args], Floats]:
    return lambda table, _mission, args: column(table, _AXES[args.get("axis", "roll")])


def _lean(table: Table) -> Floats:
    return np.asarray(np.degrees(np.arccos(np.cos(np.radians(table["Roll"])) * np.cos(np.radians(table["Pitch"])))))


def _motor_columns(mission: Mission) -> tuple[str, ...]:
    """The columns of RCOU that drive motors; the first four where no parameter says which."""
    outputs = motor_outputs(mission.settings).values() or range(1, 5)
    return tuple(f"C{output}" for output in sorted(outputs))


def _motors(table: Table, mission: Mission) -> Floats:
    """Outputs of the motors, shape (rows, motors), as a share of their range of 1000 to 2000 microseconds."""
    return np.asarray((np.column_stack([table[name] for name in _motor_columns(mission)]) - 1000.0) / 1000.0)


def _at_limit(table: Table, mission: Mission, _args: Args) -> Floats:
    limit = mission.settings.get("MOT_SPIN_MAX", 0.95)
    top = float(limit) if isinstance(limit, (int, float)) else 0.95
    return np.asarray(_motors(table, mission).max(axis=1) >= top - 0.005, dtype=np.float64)


_ATTITUDE = {"ATT": ("DesRoll", "Roll", "DesPitch", "Pitch", "DesYaw", "Yaw")}
_RATE = {"RATE": ("R", "RDes", "ROut", "P", "PDes", "POut", "Y", "YDes", "YOut")}
_LEAN = {"ATT": ("Roll", "Pitch")}
_SINK = {"PSCD": ("VD",)}
_OUTPUTS = {"RCOU": tuple(f"C{output}" for output in range(1, 15))}

register("attitude_error", _ATTITUDE, "deg", "Wanted minus flown attitude.", _attitude_error, stat="rms", args=_TILT)
register("rate_error", _RATE, "deg/s", "Wanted minus flown rotation rate: slack or oscillation of one axis.",
          _of_axis(lambda t, c: t[c[0]] - t[c[1]]), stat="rms", args=_AXIS)  # fmt: skip
register("rate_activity", _RATE, "deg/s", "Rotation rate of one axis.",
          _of_axis(lambda t, c: t[c[0]]), stat="rms", args=_AXIS)  # fmt: skip
register("rate_output", _RATE, "", "Output of one axis' rate controller: how hard it works.",
          _of_axis(lambda t, c: t[c[2]]), stat="rms", args=_AXIS)  # fmt: skip
register("lean_angle", _LEAN, "deg", "Angle between the vehicle's mast and the vertical.",
          lambda t, _m, _a: _lean(t), stat="peak")  # fmt: skip
register("altitude_error", {"PSCD": ("TPD", "PD")}, "m", "Wanted minus flown height.",
          lambda t, _m, _a: np.abs(t["TPD"] - t["PD"]), stat="rms")  # fmt: skip
register("climb_rate_error", {"PSCD": ("TVD", "VD")}, "m/s", "Wanted minus flown vertical speed.",
          lambda t, _m, _a: np.abs(t["TVD"] - t["VD"]), stat="rms")  # fmt: skip
register("vertical_acceleration_error", {"PSCD": ("TAD", "AD")}, "m/s/s", "Wanted minus flown vertical acceleration.",
          lambda t, _m, _a: np.abs(t["TAD"] - t["AD"]), stat="rms")  # fmt: skip
register("climb_rate", _SINK, "m/s", "Speed upwards.", lambda t, _m, _a: -t["VD"], stat="peak")
register("descent_rate", _SINK, "m/s", "Speed downwards.", lambda t, _m, _a: t["VD"], stat="peak")
register("motor_saturation", _OUTPUTS, "", "Share of the time in which a motor is at MOT_SPIN_MAX.",
          _at_limit, stat="mean", columns=_motor_columns)  # fmt: skip
register("motor_output", _OUTPUTS, "", "Mean output of the motors, as a share of their range.",
          lambda t, m, _a: _motors(t, m).mean(axis=1), stat="mean", columns=_motor_columns)  # fmt: skip
register("motor_spread", _OUTPUTS, "", "How far the motors differ from each other, as a share of their range.",
          lambda t, m, _a: np.ptp(_motors(t, m), axis=1), stat="mean", columns=_motor_columns)  # fmt: skip
register("throttle", {"CTUN": ("ThO",)}, "", "Throttle out of the attitude controller, 0 to 1.",
          lambda t, _m, _a: t["ThO"], stat="mean")  # fmt: skip
register("vibration", {"VIBE": ("IMU", "VibeX", "VibeY", "VibeZ")}, "m/s/s", "Vibration of the first IMU, all axes.",
          lambda t, _m, _a: np.sqrt(t["VibeX"] ** 2 + t["VibeY"] ** 2 + t["VibeZ"] ** 2), stat="mean")  # fmt: skip
register("gps_quality", {"GPS": ("I", "HDop")}, "", "Horizontal dilution of precision of the first GPS.",
          lambda t, _m, _a: t["HDop"], stat="mean")  # fmt: skip
register("ekf_velocity_innovation", {"XKF3": ("C", "IVN", "IVE")}, "m/s",
          "Horizontal velocity measured minus estimated, first core.",
          lambda t, _m, _a: np.hypot(t["IVN"], t["IVE"]), stat="rms")  # fmt: skip
register("ekf_position_innovation", {"XKF3": ("C", "IPN", "IPE")}, "m",
          "Horizontal position measured minus estimated, first core.",
          lambda t, _m, _a: np.hypot(t["IPN"], t["IPE"]), stat="rms")  # fmt: skip


@extractor(
    "ekf_innovation",
    needs=lambda args: merge_needs((NEEDS, {"XKF4": ("C", str(args.get("field", "SV")))})),
    unit="",
    args={
        "field": one_of("SV velocity, SP position, SH height, SM compass", "SV", "SP", "SH", "SM"),
        "stat": one_of("mean, max, rms or peak", "mean", "max", "rms", "peak"),
        **PHASE_ARGS,
    },
)
def ekf_innovation(mission: Mission, args: Args) -> Value:
    """Innovation test ratio of the first estimator core (above 1 it rejects the sensor). Mean unless `stat`."""
    field = str(args.get("field", "SV"))
    table = series(mission, "XKF4", (field,), args)
    return table if isinstance(table, Unavailable) else statistic(table[field], str(args.get("stat", "mean")))


@extractor("mean_lean_angle", needs=merge_needs((NEEDS, _ATTITUDE)), unit="deg", args=PHASE_ARGS)
def mean_lean_angle(mission: Mission, args: Args) -> Value:
    """Angle of the lean averaged over the earth's directions while airborne: what steady wind asks for."""
    table = series(mission, "ATT", ("Roll", "Pitch", "Yaw"), args)
    if isinstance(table, Unavailable):
        return table
    roll, pitch, yaw = (np.radians(table[name]) for name in ("Roll", "Pitch", "Yaw"))
    forward, right = -np.tan(pitch), np.tan(roll) / np.cos(pitch)
    north, east = forward * np.cos(yaw) - right * np.sin(yaw), forward * np.sin(yaw) + right * np.cos(yaw)
    # A tumbling vehicle passes through 90 degrees, where the tangent has no bound.
    level = np.hypot(north, east) < 2.0
    if not level.any():
        return Unavailable("the vehicle was never near level", "")
    return math.degrees(math.atan(math.hypot(float(north[level].mean()), float(east[level].mean()))))


def _horizontal(*fields: str) -> Wanted:
    """The position controller's records of both horizontal axes, by the letter that the axis puts in a field."""
    return merge_needs(
        (NEEDS, {"PSCN": tuple(f"{field}N" for field in fields), "PSCE": tuple(f"{field}E" for field in fields)})
    )


def _both_axes(mission: Mission, args: Args, of_axis: Callable[[Callable[[str], Floats]], Floats], stat: str,
               fields: Sequence[str]) -> Value:  # fmt: skip
    """A statistic of the length of the vector whose north and east parts `of_axis` gives."""
    parts = []
    for axis in "NE":
        names = [f"{field}{axis}" for field in fields]
        table = series(mission, f"PSC{axis}", names, args)
        if isinstance(table, Unavailable):
            return table
        columns = dict(zip(fields, (table[name] for name in names), strict=True))
        parts.append(of_axis(columns.__getitem__))
    count = min(len(part) for part in parts)
    return statistic(np.hypot(parts[0][:count], parts[1][:count]), str(args.get("stat", stat)))


_HORIZONTAL_ARGS = {
    "stat": one_of("mean, max, rms or peak (95th percentile)", "mean", "max", "rms", "peak"),
    **PHASE_ARGS,
}


@extractor("velocity_error", needs=_horizontal("TV", "V"), unit="m/s", args=_HORIZONTAL_ARGS)
def velocity_error(mission: Mission, args: Args) -> Value:
    """Wanted minus flown horizontal velocity. Statistic: rms unless `stat` says otherwise."""
    return _both_axes(mission, args, lambda of: of("TV") - of("V"), "rms", ("TV", "V"))


@extractor("position_error", needs=_horizontal("TP", "P"), unit="m", args=_HORIZONTAL_ARGS)
def position_error(mission: Mission, args: Args) -> Value:
    """Wanted minus flown horizontal position. Statistic: rms unless `stat` says otherwise."""
    return _both_axes(mission, args, lambda of: of("TP") - of("P"), "rms", ("TP", "P"))


@extractor("acceleration_error", needs=_horizontal("TA", "A"), unit="m/s/s", args=_HORIZONTAL_ARGS)
def acceleration_error(mission: Mission, args: Args) -> Value:
    """Wanted minus flown horizontal acceleration. Statistic: rms unless `stat` says otherwise."""
    return _both_axes(mission, args, lambda of: of("TA") - of("A"), "rms", ("TA", "A"))


@extractor("planned_acceleration", needs=_horizontal("DA"), unit="m/s/s", args=_HORIZONTAL_ARGS)
def planned_acceleration(mission: Mission, args: Args) -> Value:
    """Horizontal acceleration that the path planner asks for. Statistic: peak unless `stat` says otherwise."""
    return _both_axes(mission, args, lambda of: of("DA"), "peak", ("DA",))


@extractor("speed", needs=_horizontal("V"), unit="m/s", args=_HORIZONTAL_ARGS)
def speed(mission: Mission, args: Args) -> Value:
    """Horizontal speed while airborne. Statistic: mean unless `stat` says otherwise."""
    return _both_axes(mission, args, lambda of: of("V"), "mean", ("V",))
