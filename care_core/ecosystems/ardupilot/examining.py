"""A look at an ArduPilot log, by the log alone: its timeline and its findings, in one reading."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

import numpy as np

from care_core.ecosystems.ardupilot import flight as flight_model
from care_core.ecosystems.ardupilot import timeline
from care_core.ecosystems.ardupilot.checks import CHECKS
from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.ardupilot.messages import MESSAGES, expanded
from care_core.ecosystems.explains import EXPLAINS, OF_ROVERS
from care_core.ecosystems.findings import NOT_FLOWN, TOO_SHORT, Finding, FindingKind, Health, OfRun
from care_core.ecosystems.plausible import clock_doubt
from care_core.ecosystems.ranking import GRAVITY, rank_findings
from care_core.logs.base import Wanted, merge_needs
from care_core.records import replace

_TOO_SHORT_S = 2.0
_OF_SENSORS: frozenset[FindingKind] = frozenset((
    "imu", "compass", "gps", "barometer", "battery", "vibration", "estimator", "attitude",
))  # fmt: skip
_BY_HEIGHT: Mapping[str, frozenset[int]] = {"copter": frozenset((2,)), "plane": frozenset((6, 18))}
_BY_PLACE: Mapping[str, frozenset[int]] = {"copter": frozenset(), "plane": frozenset((7,))}
"""Modes under the pilot's sticks that hold a height (AltHold; FBWB, QHover), and a course over ground (Cruise)."""
_UNUSED, _SWITCHED_S = 0.05, 2.0
"""Probability that what it does not fly by loses a mission; a mode switched to so shortly before did not."""
_TELLING = ("MODE", "MSG", "ATT", "IMU")

READS: Wanted = merge_needs(
    expanded(reads) for reads in (flight_model.READS, timeline.READS, *(check.reads for check in CHECKS))
)
"""All that the timeline and any check look at, for one reading."""


def find(flight: Flight) -> tuple[Finding, ...]:
    """Findings of one run, the first cause first, its consequences under it."""
    flight.expect(READS)
    with np.errstate(all="ignore"):
        found = [finding for check in CHECKS for finding in check.find(flight)]
    if _is_on_a_bench(flight):
        return rank_findings(_on_a_bench(found), flight.down_s)
    idle = _unused_at_the_end(flight)
    told = [replace(one, mission_lost=_UNUSED) if one.kind in idle else one for one in found]
    explains = OF_ROVERS if flight.kind == "rover" else EXPLAINS
    return rank_findings(told, flight.down_s, {**explains, **dict.fromkeys(idle, frozenset[FindingKind]())})


def _unused_at_the_end(flight: Flight) -> frozenset[FindingKind]:
    """What a vehicle does not fly by in the mode in which it was lost: those do not explain that it was. Stabilize and
    its like, Manual and FBWA know neither place nor height, and AltHold no place (mode.h: requires_GPS)."""
    lost = min((t for t in (flight.lost_control_s, flight.impact_s) if t is not None), default=None)
    mode = None if lost is None else flight.mode_at(lost - _SWITCHED_S)
    kind = "copter" if flight.is_copter else "plane" if flight.is_winged else ""
    if mode is None or mode.way != "manual" or not kind or mode.number in _BY_PLACE[kind]:
        return frozenset()
    return frozenset(("gps",)) if mode.number in _BY_HEIGHT[kind] else frozenset(("gps", "barometer"))


def _is_on_a_bench(flight: Flight) -> bool:
    """Whether nobody meant to fly or drive: it never armed, and no one tried."""
    return not flight.armed and not any(one.was_tried for one in flight.refusals)


def _on_a_bench(findings: Iterable[Finding]) -> Iterator[Finding]:
    """What sensors of a board on a bench say is an offset to calibrate, or a part not fitted yet: nothing failed."""
    for one in findings:
        is_told_only = one.kind in _OF_SENSORS and one.severity != "info"
        yield replace(one, severity="info", evidence=f"{one.evidence}; nobody tried to arm") if is_told_only else one


def examine(flight: Flight) -> Health:
    """What happened in a DataFlash or telemetry log, and in each of its runs."""
    tables = flight.sound(READS)
    is_readable = flight.end_s >= _TOO_SHORT_S and any(name in tables for name in _TELLING)
    found = [find(run) for run in flight.runs] if is_readable else []
    findings = found[0] if len(found) == 1 else _told_once(one for of_run in found for one in of_run)
    too_little = TOO_SHORT if not is_readable else "" if flight.armed else NOT_FLOWN
    if not too_little and all(one.severity == "info" for one in findings):
        # Times that cannot be are no reason to keep quiet about what was found, but none to call the rest fine.
        too_little = clock_doubt(MESSAGES, tables, 0.0, flight.end_s)
    ends = [run.end_s for run in flight.runs]
    whole, *parts = timeline.timelines(flight, tables.values(), ends)
    runs = tuple(map(OfRun, ends, found, parts)) if len(found) > 1 else ()
    return Health(flight.vehicle.title, whole, findings, too_little, runs, flight.shown_right)


def _told_once(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """The findings of several runs, after an impact last, else the severest first; a note that each run brings once."""
    told: dict[tuple[str, float | None], Finding] = {}
    for one in findings:
        told.setdefault((one.title, None if one.severity == "info" else one.onset_s), one)
    return tuple(sorted(told.values(), key=lambda one: (one.after_impact, GRAVITY[one.severity])))
