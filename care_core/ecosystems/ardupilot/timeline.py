"""What an ArduPilot vehicle did and said, in order of time: a timeline that is read in a minute.

Everything comes from what the vehicle recorded or sent. Repeats are one line with their count; statistics and
calibration are left out.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby, pairwise

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from care_core.ecosystems.ardupilot.aloft import ends_aloft
from care_core.ecosystems.ardupilot.armed import ArmChange
from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.ardupilot.heartbeat import shown_failsafes
from care_core.ecosystems.ardupilot.recorded import Mode
from care_core.ecosystems.ardupilot.supply_events import supply_events
from care_core.ecosystems.ardupilot.texts import (
    RECORDED,
    is_routine,
    mission_item,
    says_what_is_recorded,
)
from care_core.ecosystems.findings import Event
from care_core.ecosystems.spans import Span, within
from care_core.ecosystems.timeline import counted, damage_of, gaps, parameter_changes, repeats, timeline_of
from care_core.ecosystems.vehicles import (
    FAILSAFE,
    Vehicle,
    error_kind,
    error_words,
    event_words,
    is_over,
    motors_of,
    reason_words,
)
from care_core.ecosystems.vehicles.errors import EKF_PRIMARY, TERRAIN
from care_core.logs.base import Table, Wanted
from care_core.numbers import Floats
from care_core.text import listed, log_time, times_until

_UPLOADED = re.compile(r"Flight plan received|New mission|Mission: new", re.IGNORECASE)
"""What the firmware says of a mission that was uploaded."""
READS: Wanted = {
    "MSG": ("Message",),
    "MODE": ("ModeNum", "Rsn"),
    "EV": ("Id",),
    "ERR": ("Subsys", "ECode"),
    "ARM": ("ArmState", "Forced", "Method"),
    "BAT": ("Volt", "Curr"),
    "GPS": ("Status", "NSats", "HDop"),
    "RCOU": ("C1",),
    "RSSI": ("RXRSSI",),
}

_ARMED, _DISARMED = 10, 11
_STILL_S = 1.0
"""Complaints so shortly before the last one stood with it."""
_TOOK_OFF, _LANDED = (16, 28), 18
_QUIET_EVENTS = frozenset((_ARMED, _DISARMED, 15, 16, 17, 18, 25, 26, 27, 28, 29, 38, 39, 57, 63, 64, 65, 66, 73))
"""Armed, landed and taken off are told otherwise; the rest are settings of every flight."""
_AT_START = frozenset((54, 55, 60, 62, 67, 164))
"""Events that mean nothing while disarmed: estimators and switches finding their place."""
_INTERLOCK_OFF, _YAW_RESET = 56, 62
_SPOOL_DOWN_S = 6.0
"""A landing switches the interlock off itself before it disarms."""
_FLURRY_S, _FLURRY = 1.0, 4
_SAME_S = 2.0
_SWITCHED_OFF_S = 0.05
_FLICKERS_S = 1.0
"""A land detector that changes its mind sooner has not seen a flight, nor a landing."""
_STAYS_S, _SPIKE_M = 1.0, 10.0
"""Who is somewhere stays for as long, within so much: no copter turns back in less."""
_IN_AIR_M, _LIFTED_M = 2.0, 0.5


def timelines(flight: Flight, tables: Iterable[Table], ends: Sequence[float] = ()) -> Iterator[tuple[Event, ...]]:
    """What happened in a log, then what did in each of its runs.

    Args:
        tables: everything that is read of its log, to see where nothing is recorded.
        ends: when the part of each run ends.
    """
    vehicle = flight.vehicle
    found = [
        *_arming(flight),
        *_modes(flight),
        *_errors(flight, vehicle),
        *_shown(flight),
        *_events(flight),
        *_flown(flight),
        *_texts(flight),
        *_replaced(flight),
        *parameter_changes(flight.settings, flight.armed, "PARM"),
        *supply_events(flight),
        *gaps(tables, flight.armed),
        *damage_of(flight.log.damage),
        *_clock(flight),
        *_end(flight),
    ]
    told, introduced = list(_once(found)), _introduced(flight, vehicle)
    yield timeline_of(told, introduced)
    for start, end in pairwise((-math.inf, *ends)):
        in_force = [one for one in told if one.kind == "mode" and one.time_s <= start][-1:]
        yield timeline_of([*in_force, *(one for one in told if start < one.time_s <= end)], introduced)


def _introduced(flight: Flight, vehicle: Vehicle) -> Event:
    parts = [vehicle.title]
    motors = motors_of(flight.settings, flight.motor_outputs)
    if motors and vehicle.kind == "quadplane":
        parts.append(f"{len(motors)} lift motors")
    if vehicle.kind == "unknown" and "vehicle" in flight.log.facts:
        parts.append("neither ArduPilot nor PX4 by what it says of itself")
    return Event(0.0, "vehicle", ", ".join(parts), "MSG" if vehicle.firmware else "the log")


# --- arming ----------------------------------------------------------------------------------------------------


def _arming(flight: Flight) -> Iterator[Event]:
    armed_at: float | None = None
    for change in _each_once(flight.arm_changes):
        how = ", ".join(filter(None, (change.how, "by force" if change.is_forced else "")))
        if change.is_armed:
            armed_at = change.time_s
            yield Event(change.time_s, "arming", " ".join(filter(None, ("armed", how))), "ARM")
        else:
            lasted = f", armed for {change.time_s - armed_at:.0f} s" if armed_at is not None else ""
            yield Event(change.time_s, "arming", " ".join(filter(None, ("disarmed", how))) + lasted, "ARM")
            armed_at = None
    if not flight.arm_changes and flight.armed:
        how = (
            "it is written while armed only (LOG_DISARMED 0)"
            if flight.is_written_armed
            else "it needs none (ARMING_REQUIRE 0), and moves"
            if flight.is_winged and flight.setting("ARMING_REQUIRE") == 0
            else "by its status"
            if flight.one("STAT", "Armed") is not None
            else "by its throttle"
        )
        yield Event(flight.armed[0][0], "arming", f"armed: the log records no arming, {how}", "the log")
    yield from _refusals(flight)


def _each_once(changes: Sequence[ArmChange]) -> list[ArmChange]:
    """Without the changes to a state that it was in already."""
    return [one for at, one in enumerate(changes) if at == 0 or changes[at - 1].is_armed != one.is_armed]


def _refusals(flight: Flight) -> Iterator[Event]:
    """Refusals of arming, each complaint once between two armings; the last one of a vehicle that never armed leads."""
    refused = flight.refusals
    if not refused:
        return
    armed = [change.time_s for change in _each_once(flight.arm_changes) if change.is_armed]
    last_s = refused[-1].time_s
    if not flight.armed:
        standing = {one.complaint: one.why for one in flight.lasting_refusals if one.time_s >= last_s - _STILL_S}
        word = "refusal" if any(one.was_tried for one in refused) else "complaint"
        what = f"it never armed{': ' if standing else ', though its complaints passed'}{'; '.join(standing.values())}"
        yield Event(last_s, "arming", f"{what} ({counted(len(refused), word)})", "MSG")
    for _, several in groupby(refused, key=lambda one: sum(t <= one.time_s for t in armed)):
        complaints = list(several)
        tried = {one.why for one in complaints if one.was_tried}
        yield from repeats([
            Event(one.time_s, "arming", f"Arm: {one.why}" if one.why in tried else one.text, "MSG")
            for one in complaints
        ])  # fmt: skip


# --- modes, errors, events -------------------------------------------------------------------------------------


def _modes(flight: Flight) -> Iterator[Event]:
    modes = flight.modes
    changes = [mode for at, mode in enumerate(modes) if at == 0 or modes[at - 1].name != mode.name]
    for flurry in _flurries(changes):
        if len(flurry) < _FLURRY:
            for mode in flurry:
                why = reason_words(mode.reason) if mode.reason is not None else ""
                yield Event(mode.start_s, "mode", f"{_mode(mode.name)}{f' ({why})' if why else ''}", "MODE")
        else:
            names = list(dict.fromkeys(mode.name for mode in flurry))
            text = f"mode changed {len(flurry)} times at once: {', '.join(names)}"
            yield Event(flurry[0].start_s, "mode", text, "MODE")


def _mode(name: str) -> str:
    return name if name.startswith("mode ") else f"mode {name}"


def _flurries(changes: Sequence[Mode]) -> Iterator[list[Mode]]:
    """Mode changes that follow each other faster than anybody flips a switch, together."""
    flurry: list[Mode] = []
    for change in changes:
        if flurry and change.start_s - flurry[-1].start_s > _FLURRY_S:
            yield flurry
            flurry = []
        flurry.append(change)
    if flurry:
        yield flurry


def _errors(flight: Flight, vehicle: Vehicle) -> Iterator[Event]:
    """ERR records; one that is over again is one line with how long it lasted, and so is one that is said again."""
    rows = flight.error_records
    lasted: dict[tuple[int, int], list[Span]] = {}
    lanes: list[tuple[float, int]] = []
    for at, (t, subsystem, code) in enumerate(rows):
        if subsystem == TERRAIN and not within(flight.armed, t):
            continue  # every start, until the map is loaded
        if subsystem == EKF_PRIMARY:
            lanes.append((t, code))
            continue
        if is_over(subsystem, code):
            continue
        after = next((row for row in rows[at + 1 :] if row[1] == subsystem), None)
        ends = after is not None and is_over(subsystem, after[2])
        lasted.setdefault((subsystem, code), []).append((t, after[0] if after and ends else math.inf))
    for (subsystem, code), times in lasted.items():
        kind = {"failsafe": "failsafe", "crash": "crash"}.get(error_kind(subsystem), "error")
        yield Event(times[0][0], kind, error_words(subsystem, code, vehicle.kind) + _lasting(times), "ERR")
    if lanes:
        t, code = lanes[0]
        told = error_words(EKF_PRIMARY, code, vehicle.kind)
        again = f", and {counted(len(lanes) - 1, 'more switch', 'es')} until {log_time(lanes[-1][0], 0)}"
        yield Event(t, "error", told + (again if len(lanes) > 1 else ""), "ERR")


def _shown(flight: Flight) -> Iterator[Event]:
    """Failsafes of which no text speaks while they are on."""
    for (start, end), words in shown_failsafes(flight):
        said = flight.messages_between(start - _SAME_S, end)
        if not any(FAILSAFE.search(text) for _, text in said):
            yield Event(start, "failsafe", f"{words}, until {log_time(end)}", "HEARTBEAT")


def _lasting(times: Sequence[tuple[float, float]]) -> str:
    """How often and until when something was so, of when it began and ended each time (infinity: it did not)."""
    start, end = times[0]
    if len(times) > 1:
        return times_until(len(times), times[-1][0])
    return f", over after {end - start:.1f} s" if math.isfinite(end) else ""


def _events(flight: Flight) -> Iterator[Event]:
    ended = [end for _, end in flight.armed]
    aligned: set[Span] = set()
    told = []
    for t, number in flight.event_records:
        span = next((span for span in flight.armed if span[0] <= t <= span[1]), None)
        if number in _QUIET_EVENTS or (number in _AT_START and span is None):
            continue
        if number == _YAW_RESET and span is not None and span not in aligned:
            aligned.add(span)  # the first climb aligns the estimator's heading
        elif number != _INTERLOCK_OFF or not any(t - 1.0 <= end <= t + _SPOOL_DOWN_S for end in ended):
            told.append(Event(t, "event", event_words(number), "EV"))
    yield from repeats(told)


def _flown(flight: Flight) -> Iterator[Event]:
    """Taking off and landing, as the vehicle's own detector says."""
    for start, end in flight.armed:
        own = flight.run_at(start)
        top = _highest(own, start, end)
        if own.is_copter and own.throttle is not None and not own.airborne:
            continue  # no height without thrust
        if top is not None and top[1] > _IN_AIR_M:
            yield Event(top[0], "flight", f"highest point, {top[1]:.1f} m", "POS")
        if top is not None and top[1] < _LIFTED_M:
            continue  # the land detector of old firmware goes by throttle alone
        told: list[Event] = []
        for t, number in flight.event_records:
            what = "took off" if number in _TOOK_OFF else "landed" if number == _LANDED else ""
            is_switched_off = what == "landed" and t > end - _SWITCHED_OFF_S
            if is_switched_off:
                continue  # disarming says so itself, wherever the vehicle is
            state = told[-1].text if told else "landed"
            if what and what != state and start <= t <= end:
                told.append(Event(t, "flight", what, "EV"))
            if len(told) > 1 and told[-1].time_s - told[-2].time_s < _FLICKERS_S:
                del told[-2:]
        yield from told


def _highest(flight: Flight, start: float, end: float) -> tuple[float, float] | None:
    """When a vehicle that flies was highest while armed, and how high; by its barometer where its estimate runs away
    above that."""
    heights = [flight.height, flight.barometer if flight.is_copter else None]
    if heights[0] is None or flight.kind in ("rover", "sub"):
        return None
    estimate, *others = (_highest_of(flight, one, start, end) for one in heights if one is not None)
    heard = next((one for one in others if one is not None), None)
    runs_away = estimate is not None and heard is not None and estimate[1] - heard[1] > _SPIKE_M
    return heard if runs_away else estimate


def _highest_of(flight: Flight, known: tuple[Floats, Floats], start: float, end: float) -> tuple[float, float] | None:
    """Where it stayed for a second if more is but a spike of its barometer."""
    t, height = known
    down_s = end if flight.impact_s is None else max(flight.impact_s, start)  # a barometer drifts on as it lies
    inside = np.flatnonzero((t >= start) & (t <= min(end, down_s)) & np.isfinite(height))
    if len(inside) < 3:
        return None
    t, height = t[inside], height[inside]
    mean_step = max(float(t[-1] - t[0]) / len(t), 1e-6)  # a radio link brings records in bursts
    n = min(max(round(_STAYS_S / mean_step), 3), len(t))
    stayed = sliding_window_view(height, n).min(axis=1)
    top, lasting = int(np.argmax(height)), int(np.argmax(stayed)) + n // 2
    if float(height[top] - stayed.max()) > _SPIKE_M:
        return float(t[lasting]), float(stayed.max())
    return float(t[top]), float(height[top])


# --- what it said ----------------------------------------------------------------------------------------------


def _texts(flight: Flight) -> Iterator[Event]:
    """The vehicle's texts but for those of every flight; mission items that follow each other are one line."""
    refused = {one.text for one in flight.refusals}
    said = [(t, text) for t, text in flight.messages if text not in refused]
    items: list[tuple[float, int, str]] = []
    told: list[Event] = []
    for t, text in said:
        item = mission_item(text)
        if item is not None:
            items.append((t, *item))
        elif not is_routine(text) and not _is_recorded(text, t, flight):
            kind = "crash" if "crash" in text.casefold() else "failsafe" if FAILSAFE.search(text) else "message"
            told.append(Event(t, kind, text, "MSG"))
    yield from repeats(told)
    yield from _mission(flight, items)


def _is_recorded(text: str, t: float, flight: Flight) -> bool:
    return any(
        says_what_is_recorded(text, subsystem) and any(abs(t - at) < _SAME_S for at, _ in flight.errors(subsystem))
        for subsystem in RECORDED
    )


def _mission(flight: Flight, items: Sequence[tuple[float, int, str]]) -> Iterator[Event]:
    """The mission of each arming in one line."""
    for start, end in flight.armed:
        own = [(t, number, what) for t, number, what in items if start <= t <= end and number > 0]
        if not own:
            continue
        reached = sorted({number for _, number, what in own if what == "reached"})
        last = own[-1]
        text = f"mission: items {own[0][1]} to {max(number for _, number, _ in own)}"
        done = f", reached {_ranges(reached)}" if reached else ", none reached"
        yield Event(own[0][0], "mission", f"{text} until {log_time(last[0], 0)}{done}", "MSG")


def _replaced(flight: Flight) -> Iterator[Event]:
    """Each mission that took the place of another: when the firmware said so, for its items are known only as they are
    begun where nothing was recorded meanwhile."""
    said = [t for t, text in flight.messages if _UPLOADED.match(text)]
    for before, held in pairwise(flight.held_missions):
        at_s = max((t for t in said if before.since_s < t <= held.since_s), default=held.since_s)
        when = " while armed" if within(flight.armed, at_s) else ""
        now = counted(len(held.waypoints), "waypoint")
        text = f"another mission was uploaded{when}: {now}, {len(before.waypoints)} before"
        yield Event(at_s, "mission", text if before.items else f"a mission was uploaded{when}: {now}", "CMD")


def _ranges(numbers: Sequence[int]) -> str:
    """1, 2, 3, 5 as "1 to 3 and 5"."""
    parts: list[list[int]] = []
    for number in numbers:
        if parts and number == parts[-1][-1] + 1:
            parts[-1].append(number)
        else:
            parts.append([number])
    texts = [f"{part[0]} to {part[-1]}" if len(part) > 1 else str(part[0]) for part in parts]
    return listed(texts)


# --- the end --------------- ---------------------------------------------------------------------------------


def _clock(flight: Flight) -> Iterator[Event]:
    if "clock" in flight.log.facts:
        yield Event(0.0, "log", f"its times are {flight.log.facts['clock']}", "the log")


def _end(flight: Flight) -> Iterator[Event]:
    """A log that ends while the vehicle is armed says nothing of how the flight ended; nor does a station that records
    on without it."""
    changes = flight.arm_changes
    is_armed = changes[-1].is_armed if changes else bool(flight.armed) and flight.armed[-1][1] > flight.end_s - 1.0
    if not is_armed:
        if flight.silent_s:
            text = f"the vehicle is heard no more; the station records for {flight.silent_s:.0f} s more"
            yield Event(flight.end_s, "log", text, "the log")
        return
    aloft = ends_aloft(flight.run_at(flight.end_s))
    where = f" in the air, {aloft}" if aloft is not None else ""
    text = f"the log ends{where} with the vehicle armed: power lost, or the recording stopped"
    if flight.silent_s:
        text = f"the vehicle is heard no more{where}, armed; the station records for {flight.silent_s:.0f} s more"
    yield Event(flight.end_s, "log", text, "the log")


# --- putting it together ---------------------------------------------------------------------------------------


def _once(moments: Sequence[Event]) -> list[Event]:
    """Without crashes and failsafes that were said twice: their text tells more than their ERR record."""
    texts = [one for one in moments if one.source == "MSG"]
    return [
        one
        for one in moments
        if one.source != "ERR" or one.kind not in ("crash", "failsafe")
        or not any(_same_subject(one, text) for text in texts)
    ]  # fmt: skip


def _same_subject(record: Event, text: Event) -> bool:
    is_near = abs(text.time_s - record.time_s) < _SAME_S and record.kind == text.kind
    return is_near and record.text.split(maxsplit=1)[0].casefold() in text.text.casefold()
