"""A motor that gave way as control was lost, and motors that were all told to stop in the air."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from care_core.ecosystems import lost_motor
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.lost_motor import Commands, driven_hardest, weakened
from care_core.ecosystems.px4 import motors, upset
from care_core.ecosystems.px4.flight import LANDED, Px4Flight
from care_core.ecosystems.vehicles import Motor
from care_core.logs.base import Wanted, merge_needs
from care_core.text import log_time

READS: Wanted = merge_needs((motors.READS, upset.READS))
LIMITS = Limits(lost_motor.LIMITS)
_IDLE = LIMITS.add("output of motors that lift nothing", 0.06, "of the range", "DShot and MC_AIRMODE: idle is 0.055")
_STOPPED_S = LIMITS.add("shortest stop in the air", 0.3, "s", "a choice: a descent keeps some thrust")
_NEAR_S = LIMITS.add("time before control was lost", 2.0, "s", "it falls, then turns over")
_FALLS_S = LIMITS.add("left out before control was lost", 0.5, "s", "a choice: it is driven to right the vehicle")
_WEAK_P = LIMITS.add("probability that a motor driven harder is weak", 0.7, "", "as of ArduPilot: 9 of 12 such flights")
_AT_LIMIT = LIMITS.add("output of a motor that can give no more", 0.97, "of the range", "a choice: outputs are rounded")
_CUT_P = LIMITS.add("probability that the stop made it fall", 0.9, "", "what has no thrust falls")


def find(flight: Px4Flight) -> Iterator[Finding]:
    """The motor that gave way, or all that stopped, before control was lost in the air."""
    commands, killed_s = motors.commands(flight), next(iter(flight.kills), math.inf)
    if commands is None:
        return
    # What is asked of motors that a switch has cut tells of no motor.
    lost, dropped = upset.lost_control(flight), upset.hit(flight)
    lost = None if lost is None or lost.time_s > killed_s else lost
    dropped = None if dropped is None or dropped.falls_s > killed_s else dropped
    stopped_s = None if lost is None else _all_stopped_s(commands, lost.time_s)
    if lost is not None and stopped_s is not None:
        yield _all_stopped(flight, stopped_s, lost)
        return
    upsets = [] if lost is None else [(lost.time_s, lost.fall)]
    if dropped is not None and upset.is_aloft(flight, dropped.falls_s):
        upsets.append((dropped.falls_s, (0.0, 0.0)))  # what swings for long falls for another reason, later
    found = (_gave_way(flight, commands, at_s, fall) for at_s, fall in upsets)
    first = next((one for one in found if one is not None), None)
    if first is not None:
        yield first
    else:
        yield from _weak(flight, commands, min(killed_s, math.inf if lost is None else lost.time_s - _FALLS_S), lost)


def _gave_way(flight: Px4Flight, commands: Commands, upset_s: float, fall: tuple[float, float]) -> Finding | None:
    """The motor that was driven hardest as it tipped or fell."""
    placed = _placed(flight)
    arms = {motor.number: motor.angle_deg for motor in placed}
    hardest = driven_hardest(commands, upset_s, fall, arms)
    if hardest is None:
        return None
    return Finding(
        kind="motor",
        title=hardest.title(placed),
        onset_s=min(hardest.near_s, upset_s),
        end_s=upset_s,
        severity="critical",
        evidence=hardest.evidence,
        source="actuator_motors or actuator_outputs, vehicle_attitude",
        probability=lost_motor.PROBABILITY,
    )


def _weak(flight: Px4Flight, commands: Commands, until_s: float, lost: upset.Lost | None) -> Iterator[Finding]:
    """A motor that came to be driven harder than all others while it flew on."""
    landed = flight.table(LANDED, "landed")
    if landed is None or not flight.hovers:
        return
    at = np.maximum(np.searchsorted(landed.t, commands.t, side="right") - 1, 0)
    down_s = max((end for _, end in flight.aloft), default=0.0)
    flown = (landed["landed"][at] == 0) & (commands.t < min(until_s, down_s))
    flown &= np.array([any(start < t <= end for start, end in flight.armed) for t in commands.t.tolist()], dtype=bool)
    weak = weakened(commands, flown)
    if weak is None:
        return
    place = next((f" ({one.place})" for one in _placed(flight) if one.number == weak.number and one.place), "")
    yield Finding(
        kind="motor",
        title=f"motor {weak.number}{place} lost thrust",
        onset_s=weak.since_s,
        end_s=weak.until_s,
        severity="critical" if lost is not None or weak.share > _AT_LIMIT else "warning",
        evidence=f"it is asked for {weak.share:.0%} where the others are at {weak.others:.0%}; before, they were even",
        source="actuator_motors or actuator_outputs",
        probability=_WEAK_P,
    )


def _placed(flight: Px4Flight) -> tuple[Motor, ...]:
    return motors.px4_motors(flight.log.settings())


def _all_stopped_s(commands: Commands, lost_s: float) -> float | None:
    """When all motors were told to stop, shortly before control was lost; None where some were to lift."""
    near = (commands.t >= lost_s - _NEAR_S) & (commands.t <= lost_s + _STOPPED_S)
    idle = commands.share.max(axis=0) < _IDLE
    t = commands.t[near & idle]
    if not len(t) or t[-1] - t[0] < _STOPPED_S or t[0] > lost_s or not idle[near & (commands.t >= t[0])].all():
        return None
    return float(t[0]) if bool((commands.t[near] < t[0]).any()) else None


def _all_stopped(flight: Px4Flight, stopped_s: float, lost: upset.Lost) -> Finding:
    height = flight.height_m(stopped_s)
    up = "" if height is None else f", {height:.0f} m above where it was armed"
    landed = [t for t, is_landed in flight.changes(LANDED, "landed") if is_landed and abs(t - stopped_s) < _NEAR_S]
    said = f"; the land detector said that it had landed at {log_time(landed[0])}" if landed else ""
    return Finding(
        kind="motor",
        title="all motors were told to stop in the air",
        onset_s=stopped_s,
        end_s=lost.time_s,
        severity="critical",
        evidence=f"every output is at idle from {log_time(stopped_s)} on{up}{said}",
        source="actuator_motors or actuator_outputs, vehicle_land_detected",
        suspect="operation",
        probability=_CUT_P,
    )


CHECK = Check("motor", "a motor that gave way as control was lost, motors stopped in the air", READS, LIMITS, find)
