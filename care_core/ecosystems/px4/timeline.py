"""The timeline of a PX4 log: arming, modes, heights, what the firmware said, battery, GPS."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterator

import numpy as np

from care_core.ecosystems.findings import Event
from care_core.ecosystems.px4.checks import estimator, flags
from care_core.ecosystems.px4.flight import (
    BARELY_M,
    LANDED,
    MESSAGES,
    POSITION,
    RESULT,
    SAID_WITHIN_S,
    STATUS,
    Px4Flight,
    changes,
    is_arming,
    is_complaint,
    reason_of,
    without_speaker,
)
from care_core.ecosystems.px4.flown_mission import uploads
from care_core.ecosystems.timeline import counted, damage_of, gaps, parameter_changes, repeats, timeline_of
from care_core.ecosystems.vehicles import mode_name, vehicle_of
from care_core.ecosystems.vehicles.way import AIRBORNE_M
from care_core.logs.base import Table, Wanted

READS: Wanted = {
    "battery_status": ("voltage_v", "current_a", "cell_count", "warning", "connected"),
    "vehicle_gps_position": ("fix_type", "satellites_used", "hdop"),
    "sensor_gps": ("fix_type", "satellites_used", "hdop"),
}

_SAGS = 0.9
_SOON_S = 1.0
"""The land detector speaks so shortly after a disarming."""
_3D = 3
_FIXES = {0: "no fix", 1: "no fix", 2: "2D fix", 3: "3D fix", 4: "3D fix, DGPS", 5: "3D fix, RTK float",
          6: "3D fix, RTK fixed", 8: "extrapolated"}  # fmt: skip
_WARNINGS = {1: "low", 2: "critical", 3: "at its emergency level", 4: "failed"}
"""battery_status.warning."""
_ROUTINE = re.compile(
    r"\[(logger|mavlink|px4|tone_alarm|init|uavcan|dataman|load_mon|gps)\]|Ready for takeoff|Using default takeoff"
    r"|home set|mavlink: |ROMFS|Takeoff detected|Landing detected|arming warning|notify"
)
_SPOKEN_LEVELS = frozenset(("EMERGENCY", "ALERT", "CRITICAL", "ERROR", "WARNING"))
_ACTED, _WARNED, _SAID_TOGETHER_S = "Failsafe activated", "Failsafe warning", 0.5
"""What is said of every failsafe until 1.16, and with it of one that only warns (failsafe/framework.cpp)."""
_SPOKEN_BY = re.compile(r"\[(commander|navigator|failsafe|flight_mode_manager|vtol_att_control|land_detector)\]")


def timeline(flight: Px4Flight, tables: Collection[Table]) -> tuple[Event, ...]:
    """What happened, in order of time; `tables` are those in which a gap of the recording shows."""
    log = flight.log
    title, hardware = vehicle_of(log.facts, log.settings()).title, log.facts.get("hardware", "")
    introduction = Event(0.0, "vehicle", ", ".join(filter(None, (title, hardware))), STATUS)
    events = [
        *_arming(flight),
        *_modes(flight),
        *_uploads(flight),
        *_landings(flight),
        *_states(flight),
        *_spoken(flight),
        *_battery(flight),
        *_gps(flight),
        *_not_recorded(flight),
        *parameter_changes(log.settings(), flight.armed, "parameters"),
        *gaps(tables, flight.armed),
        *damage_of(log.damage),
        *_ending(flight),
    ]
    return timeline_of(events, introduction)


def _arming(flight: Px4Flight) -> Iterator[Event]:
    since: float | None = None
    for at, (t, is_armed) in enumerate(flight.arming):
        by = flight.armed_by(t, is_armed=is_armed)
        how = f" {by}" if by else ""
        if is_armed:
            since = t
            yield Event(t, "arming", f"armed{how}" if at or by else "armed when the log begins", STATUS)
        elif at:
            lasted = f", armed for {t - since:.0f} s" if since is not None else ""
            yield Event(t, "arming", f"disarmed{how}{lasted}", STATUS)
    if flight.complaints and not flight.armed:
        last_s = flight.complaints[-1][0]
        reasons = dict.fromkeys(reason_of(text) for t, text in flight.complaints if t >= last_s - SAID_WITHIN_S)
        yield Event(last_s, "arming", f"it never armed: {'; '.join(reasons)}", MESSAGES)
    else:
        yield from repeats([Event(t, "arming", text, MESSAGES) for t, text in flight.complaints])


def _modes(flight: Px4Flight) -> Iterator[Event]:
    yield from (Event(t, "mode", f"mode {mode_name('px4', mode)}", STATUS) for t, mode in flight.modes)


def _uploads(flight: Px4Flight) -> Iterator[Event]:
    for t, count in uploads(flight):
        when = " while armed" if flight.began_armed(t) else ""
        size = "" if count is None else f": {counted(count, 'item')}"
        yield Event(t, "mission", f"another mission was uploaded{when}{size}", RESULT)


def _rose(flight: Px4Flight, t: float) -> bool:
    """Whether it rose while it was armed at this time, as far as the log tells its height."""
    span = next((span for span in flight.armed if span[0] <= t <= span[1] + _SOON_S), None)
    heights = None if span is None else flight.heights(span)
    return heights is None or float(heights["height"].max()) > BARELY_M


def _landings(flight: Px4Flight) -> Iterator[Event]:
    """Taking off and landing by the land detector, and the highest point between. What it says of a vehicle that never
    rose is no flight: it speaks up on a bench as well."""
    for at, (t, landed) in enumerate(flight.changes(LANDED, "landed")):
        if at or not landed:
            said = (
                ("landed", "took off")
                if _rose(flight, t)
                else ("land detector: on the ground", "land detector: in the air")
            )
            yield Event(t, "flight", said[not landed], LANDED)
    for start, end in flight.armed:
        killed_s = flight.killed_s((start, end))
        heights = flight.heights((start, end if killed_s is None else killed_s))
        top = 0 if heights is None else int(np.argmax(heights["height"]))
        if heights is not None and heights["height"][top] > AIRBORNE_M:
            yield Event(float(heights.t[top]), "flight", f"highest point, {heights['height'][top]:.1f} m", POSITION)


def _states(flight: Px4Flight) -> Iterator[Event]:
    """What the vehicle's own checks held for wrong while it was armed."""
    for found in (*flags.episodes(flight), *estimator.episodes(flight)):
        kind = "failsafe" if found.state.field == "failsafe" else "error"
        yield Event(found.start_s, kind, found.text, found.state.topic)


def _spoken(flight: Px4Flight) -> Iterator[Event]:
    """Warnings of anybody, and what the parts that fly it say."""
    spoken = []
    warned = [t for t, _, text in flight.messages if without_speaker(text).startswith(_WARNED)]
    for t, level, text in flight.messages:
        is_loud = level in _SPOKEN_LEVELS or (_SPOKEN_BY.match(text) is not None and not _ROUTINE.search(text))
        only_warned = without_speaker(text) == _ACTED and any(abs(t - at) < _SAID_TOGETHER_S for at in warned)
        if not is_loud or is_complaint(text) or is_arming(text) or only_warned:
            continue
        kind = "failsafe" if "failsafe" in text.casefold() else "crash" if "crash" in text.casefold() else "message"
        spoken.append(Event(t, kind, without_speaker(text), MESSAGES))
    yield from repeats(spoken)


def _battery(flight: Px4Flight) -> Iterator[Event]:
    table = flight.table("battery_status", "voltage_v")
    if table is None:
        return
    sane = table.where((table["voltage_v"] > 1.0) & (table.columns.get("connected", np.ones(len(table))) == 1))
    if not len(sane):
        return
    at = flight.armed[0][0] if flight.armed else float(sane.t[0])
    before = sane.between(-math.inf, at)
    row = len(before) - 1 if len(before) else 0
    volts, count = float(sane["voltage_v"][row]), int(sane.columns.get("cell_count", np.zeros(len(sane)))[row])
    pack = f" ({count} cells)" if count > 1 else ""
    yield Event(max(at, float(sane.t[row])), "battery", f"battery at {volts:.1f} V{pack}", "battery_status")
    yield from _battery_worst(flight, sane, volts)


def _battery_worst(flight: Px4Flight, table: Table, volts: float) -> Iterator[Event]:
    parts = [part for span in flight.armed if len(part := table.between(*span))]
    for part in parts:
        low = int(np.argmin(part["voltage_v"]))
        if part["voltage_v"][low] < _SAGS * volts:
            amps = float(part["current_a"][low]) if "current_a" in part.columns else -1.0
            drawn = f" at {amps:.0f} A" if amps > 0.5 else ""
            text = f"battery at its lowest while armed: {part['voltage_v'][low]:.1f} V{drawn}"
            yield Event(float(part.t[low]), "battery", text, "battery_status")
        if "warning" in part.columns:
            for t, level in changes(part, "warning"):
                if int(level) in _WARNINGS:
                    yield Event(t, "battery", f"battery {_WARNINGS[int(level)]}", "battery_status")


def _gps(flight: Px4Flight) -> Iterator[Event]:
    topic = next((name for name in ("vehicle_gps_position", "sensor_gps") if flight.table(name, "fix_type")), None)
    table = flight.table(topic, "fix_type") if topic else None
    if topic is None or table is None:
        return
    at = flight.armed[0][0] if flight.armed else float(table.t[-1])
    before = table.between(-math.inf, at)
    row = len(before) - 1 if len(before) else 0
    parts = [f"GPS: {_FIXES.get(int(table['fix_type'][row]), '3D fix')}"]
    if "satellites_used" in table.columns:
        parts.append(f"{table['satellites_used'][row]:.0f} satellites")
    if "hdop" in table.columns and table["hdop"][row] > 0:
        parts.append(f"HDop {table['hdop'][row]:.1f}")
    yield Event(max(at, float(table.t[row])), "gps", ", ".join(parts), topic)
    if table["fix_type"][row] >= _3D:
        lost = [t for t, fix in changes(table, "fix_type") if fix < _3D and flight.began_armed(t)]
        if lost:
            yield Event(lost[0], "gps", "GPS lost its 3D fix while armed", topic)


def _not_recorded(flight: Px4Flight) -> Iterator[Event]:
    """What nothing can be said of, of a flight that was armed."""
    missing = []
    if flight.table("battery_status", "voltage_v") is None:
        missing.append("battery")
    if all(flight.table(name, "fix_type") is None for name in ("vehicle_gps_position", "sensor_gps")):
        missing.append("GPS")
    if missing and flight.armed:
        were = "were" if len(missing) > 1 else "was"
        yield Event(flight.armed[0][0], "log", f"{' and '.join(missing)} {were} not recorded", "the log")


def _ending(flight: Px4Flight) -> Iterator[Event]:
    late_s = flight.log.duration_s - flight.end_s
    if late_s > 0:
        yield Event(
            flight.end_s, "log", f"the recording ends, but for a message stamped {late_s:.0f} s later", "the log"
        )
    if flight.ends_armed:
        text = "the log ends with the vehicle armed: power lost, or the recording stopped"
        yield Event(flight.end_s, "log", text, "the log")
