"""PX4 flights as missions: each from arming to disarming, and what it is judged by where no profile fits."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np

from care_core.ecosystems.base import RunModel
from care_core.ecosystems.coverage import SUM, Samples, doubt
from care_core.ecosystems.findings import KILLED
from care_core.ecosystems.measures import MISSION_KINDS, Args, Mission, MissionKind, numeric
from care_core.ecosystems.px4 import upset
from care_core.ecosystems.px4.checks.kill_switch import killed_aloft_s
from care_core.ecosystems.px4.failsafes import READS as FAILSAFES
from care_core.ecosystems.px4.failsafes import in_words
from care_core.ecosystems.px4.flight import (
    BARELY_M,
    LANDED,
    MESSAGES,
    READS,
    RESULT,
    ROVER,
    STATUS,
    Px4Flight,
)
from care_core.ecosystems.px4.flown_mission import mission_outcome
from care_core.ecosystems.px4.measures.flown import NEEDS, is_armed, span_of_phase
from care_core.ecosystems.px4.measures.outcome import failsafe_s, flew_automatically, halted, left_s, lost_s
from care_core.ecosystems.px4.measures.shortfall import evidence, shortfall
from care_core.ecosystems.spans import Span
from care_core.ecosystems.vehicles import mode_name, way_of
from care_core.ecosystems.vehicles.arming import CUT
from care_core.ecosystems.vehicles.way import AIRBORNE_M
from care_core.logs.base import Table, Wanted, merge_needs
from care_core.records import replace
from care_core.run import Evidence, OutcomeCheck, Unavailable, Value
from care_core.text import log_time

_SOON_S = 1.0
"""What falls is disarmed as it hits the ground."""
_HOVERS_S = 5.0
"""A throttle-up on a bench is over sooner."""
_UNTOLD = Unavailable("the firmware cut its motors, and the log tells no height")


class Px4Missions(MissionKind):
    """From arming to disarming."""

    name = "px4_flight"
    args: Mapping[str, str] = {"tolerance_m": numeric("how far from where the mission ends a landing may be")}

    def needs(self, spec: Args) -> Wanted:
        return merge_needs((NEEDS, FAILSAFES))

    def missions(self, model: RunModel, tables: Mapping[str, Table], spec: Args) -> tuple[Mission, ...]:
        flight = _flight(model)
        if not flight.armed and flight.was_denied:
            return (Mission(model, tables, 0.0, flight.end_s, True, spec),)
        closed = len(flight.armed) - flight.ends_armed
        return tuple(
            Mission(model, tables, start_s, end_s, number < closed, spec)
            for number, (start_s, end_s) in enumerate(flight.armed)
        )

    def mismatch(self, mission: Mission) -> str:
        return ""

    def evidence(self, mission: Mission) -> tuple[Evidence, ...]:
        return evidence(mission)

    def shortfall(self, mission: Mission) -> tuple[str, ...]:
        return shortfall(mission)

    def is_decided(self, mission: Mission) -> bool:
        return mission.ended or any(one(mission) is not None for one in (lost_s, failsafe_s, halted))

    def left_s(self, mission: Mission) -> float | None:
        return left_s(mission)

    def checks(self, mission: Mission) -> tuple[OutcomeCheck, ...]:
        return () if not is_armed(mission) or flew_automatically(mission) else self.outcome(mission)

    def span(self, mission: Mission, phase: str) -> tuple[float, float] | None:
        span = span_of_phase(mission, {"phase": phase})
        return None if isinstance(span, Unavailable) else span

    def outcome(self, mission: Mission) -> tuple[OutcomeCheck, ...]:
        if not is_armed(mission):
            return (OutcomeCheck("armed", 0.0, "the vehicle armed", "arming was refused"),)
        return tuple(_checks(_flight(mission.model), (mission.start_s, mission.end_s), ended=mission.ended))

    def modes(self, mission: Mission) -> tuple[str, ...]:
        modes = _flight(mission.model).modes_during((mission.start_s, mission.end_s))
        return tuple(dict.fromkeys(mode_name("px4", mode) for mode in modes))


MISSION_KINDS[Px4Missions.name] = Px4Missions()


def _flight(model: RunModel) -> Px4Flight:
    assert isinstance(model, Px4Flight)
    return model


def _checks(flight: Px4Flight, span: Span, *, ended: bool) -> Iterator[OutcomeCheck]:
    yield OutcomeCheck("armed", 1.0, "the vehicle armed")
    flies = flight.last(STATUS, "vehicle_type", span[1]) != ROVER
    if flies:
        yield OutcomeCheck("took_off", _took_off(flight, span), "it left the ground")
    if any(way_of("px4", mode) == "mission" for mode in flight.modes_during(span)):
        yield OutcomeCheck(
            "mission_success", mission_outcome(flight, span), "the mission was flown to its end", "the mission failed"
        )
    silent: Value = _lost_events(flight, span) or 1.0
    no_crash = _no_crash(flight, span)
    yield replace(no_crash, value=silent) if no_crash.value == 1.0 else no_crash
    acted = _failsafe(flight, _before_kill(flight, span))
    yield OutcomeCheck("no_failsafe", 0.0 if acted else silent, "no failsafe acted", acted)
    if flies:
        landed = _on_ground(flight, span, ended=ended)
        yield OutcomeCheck("landed", landed, "it was on the ground at the end", "it was disarmed in the air")
    yield OutcomeCheck("disarmed", 1.0 if ended else CUT, "it was disarmed at the end")


def _before_kill(flight: Px4Flight, span: Span) -> Span:
    """A span until its kill switch: what acts on a vehicle that somebody cut says nothing of its flight."""
    killed_s = flight.killed_s(span)
    return span if killed_s is None else (span[0], killed_s)


def _failsafe(flight: Px4Flight, span: Span) -> str:
    """The first failsafe of a span in words, empty where none acted."""
    acted_s = flight.first_s(STATUS, "failsafe", 1, span)
    if acted_s is None:
        return ""
    about = in_words(flight, acted_s)
    return f"{about} failsafe at {log_time(acted_s)}" if about else f"a failsafe acted at {log_time(acted_s)}"


def _lost_events(flight: Px4Flight, span: Span) -> Unavailable | None:
    """Why what the log does not say may have happened all the same; None where it holds the whole flight."""
    streams = [table.t for topic, table in flight.tables(READS).items() if topic not in (MESSAGES, RESULT)]
    return doubt(Samples("the flight", np.concatenate(streams), [span], SUM)) if streams else None


def _no_crash(flight: Px4Flight, span: Span) -> OutcomeCheck:
    """Whether it stayed in control. What falls after its motors were cut is no failure of its own."""
    before = _before_kill(flight, span)
    detected_s, ended_s = flight.detected_s(before), flight.terminated_s(before)
    was_cut = detected_s is None and ended_s is None and killed_aloft_s(flight, span) is not None
    hit, lost = upset.hit(flight), upset.lost_control(flight)
    aloft_m = None if ended_s is None else flight.height_m(ended_s)
    how = (
        KILLED if was_cut
        else f"it hit the ground at {hit.speed_ms:.1f} m/s" if hit is not None and _is_in(span, hit.time_s)
        else "control was lost in the air" if lost is not None and _is_in(span, lost.time_s)
        else f"the failure detector acted at {log_time(detected_s)}" if detected_s is not None
        else f"the firmware cut its motors in the air at {log_time(ended_s)}, {aloft_m:.1f} m up"
        if ended_s is not None and aloft_m is not None and aloft_m > BARELY_M
        else ""
    )  # fmt: skip
    silent: Value = _UNTOLD if ended_s is not None and aloft_m is None else float(not how)
    return OutcomeCheck("no_crash", silent if not how else 0.0, "control was kept", how)


def _is_in(span: Span, t: float) -> bool:
    return span[0] <= t <= span[1] + _SOON_S


def _took_off(flight: Px4Flight, span: Span) -> Value:
    """1 where it rose, or, where no height is told, the land detector said so: that also speaks up on a bench. Under a
    roof both say so: a low rise, and for longer than a throttle-up takes no ground."""
    heights = flight.heights(span)
    if heights is not None:
        rise_m = float(heights["height"].max())
        if rise_m < AIRBORNE_M and float(heights["height"].min()) < -AIRBORNE_M:
            return Unavailable("its height runs off below where it was armed")
        if rise_m > BARELY_M and _off_the_ground_s(flight, span) > _HOVERS_S:
            return 1.0
        barely = f"it rose no higher than {rise_m:.1f} m" if rise_m > BARELY_M else "it never left the ground"
        return 1.0 if rise_m > AIRBORNE_M else Unavailable(barely)
    if flight.during(LANDED, "landed", span) is None:
        return Unavailable("the log does not say when it was on the ground", f"record {LANDED}", LANDED)
    return 1.0 if flight.ever(LANDED, "landed", 0, span) else Unavailable("it never left the ground")


def _off_the_ground_s(flight: Px4Flight, span: Span) -> float:
    """For how long the land detector says at a stretch that it is in the air."""
    table = flight.during(LANDED, "landed", span)
    if table is None or not len(table):
        return 0.0
    up = np.append(table["landed"] == 0, False)
    longest, since = 0.0, None
    for t, is_up in zip([*table.t.tolist(), span[1]], up.tolist(), strict=True):
        if is_up and since is None:
            since = t
        elif not is_up and since is not None:
            longest, since = max(longest, t - since), None
    return longest


def _on_ground(flight: Px4Flight, span: Span, *, ended: bool) -> Value:
    if flight.during(LANDED, "landed", span) is None:
        return Unavailable("the log does not say when it was on the ground", f"record {LANDED}", LANDED)
    if not ended:
        return CUT
    aloft_m, before = flight.height_m(span[1]), flight.during(LANDED, "landed", (-math.inf, span[1]))
    was_aloft = before is not None and len(before) > 0 and before["landed"][-1] == 0
    if was_aloft and aloft_m is not None and aloft_m > AIRBORNE_M:
        # Disarming itself says that it landed, and a height drifts: what falls feels it.
        return float(upset.falls_after(flight, flight.killed_s(span) or span[1]) is False)
    return float(flight.last(LANDED, "landed", span[1]) == 1)
