"""Thrust at its end that does not give the vertical speed that is wanted: too little lift, or lift that nothing ends.

Where the battery gives hardly any power although lift is asked for, no propeller turns: on a bench, or because
the motors get none.

The position controller asks for a vertical speed (vehicle_local_position_setpoint.vz) and, for it, for thrust between
MPC_THR_MIN and MPC_THR_MAX. What is at that end and still far off cannot be held by any gain.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import CAME_DOWN, UNPOWERED, Finding
from care_core.ecosystems.px4.flight import POSITION, Px4Flight
from care_core.ecosystems.spans import Span, during, runs, within
from care_core.ecosystems.vehicles import way_of
from care_core.logs.base import Wanted
from care_core.numbers import Bools, Floats, median, quantile
from care_core.records import replace
from care_core.run import shown
from care_core.text import log_time

_BATTERY = "battery_status"
_WANTED, _AIR = "vehicle_local_position_setpoint", "vehicle_air_data"
_THRUST, _OLD_THRUST = "vehicle_thrust_setpoint", "vehicle_attitude_setpoint"
READS: Wanted = {
    POSITION: ("z", "vz"),
    _WANTED: ("vz",),
    _AIR: ("baro_alt_meter",),
    _THRUST: ("xyz[2]",),
    _OLD_THRUST: ("thrust_body[2]",),
    _BATTERY: ("voltage_v", "current_a"),
}

LIMITS = Limits()
_OFF_MS = LIMITS.add("vertical speed off the wanted one", 0.5, "m/s", "a choice: gusts take less")
_RISES_MS = LIMITS.add("climb that nobody asked for", 0.3, "m/s", "a choice: what hovers wanders by less")
_LASTS_S = LIMITS.add("shortest time of it", 3.0, "s", "a choice: a change of height is reached sooner")
_LONG_S = LIMITS.add("critical time of a climb that nobody asked for", 5.0, "s", "a choice: a gust may carry for less")
_HEARD = LIMITS.add("share of it that the barometer tells, too", 0.5, "", "a choice: an estimate alone may run away")
_ALL = LIMITS.add("thrust of all that there is", 0.98, "", "MPC_THR_MAX is 1 as shipped")
_LEAST = LIMITS.add("least thrust", 0.12, "", "MPC_THR_MIN as shipped")
_NEAR_LEAST = LIMITS.add("thrust near the least", 0.02, "", "a choice: it is rounded")
_LIFTS = LIMITS.add("thrust that lifts", 0.4, "", "a choice: what hovers with less has power to spare")
_DRAWS_W = LIMITS.add("power of a vehicle that lifts", 5.0, "W", "the lightest quadcopter, of 30 g, hovers with 7 W")
_LOOSE_DEG = LIMITS.add("attitude error that no motor holds", 15.0, "deg", "a choice: what flies holds it by far")
_STANDS_M = LIMITS.add("movement of what stands on the ground", 0.5, "m", "a choice: the estimator still drifts")
_FOR_A_WHILE = LIMITS.add("share of the time in which it draws as little", 0.9, "", "a choice: a current is noisy")
_MEASURED_A = LIMITS.add("change of a current that is measured", 0.02, "A", "a choice: what is not measured stays")
_FEWEST = 10
_UNPOWERED_P = LIMITS.add("probability that the motors get no power", 0.95, "", "physics: lift takes power")
_SET_P = LIMITS.add("probability of an end that is set", 0.9, "", "thrust stands at the very value that somebody set")
_SET_BY = LIMITS.add("how far an end is set off its default", 0.1, "", "a choice: a tenth of the thrust is felt")
_LIES_MS = LIMITS.add("speed of what lies on the ground", 0.1, "m/s", "a choice: the estimator still drifts")
_STRANDED_P = LIMITS.add("probability that a part broke, on the ground again", 0.1, "", "a choice: it says hardly why")
_TRUE_P = LIMITS.add("probability of a part", 0.5, "", "a choice: a load, and how outputs are set, look the same")


class _End(NamedTuple):
    """Time, whether thrust is at an end and the speed is off, and how fast it sinks, and should."""

    t: Floats
    holds: np.ndarray
    sinks: Floats
    wanted: Floats


def find(flight: Px4Flight) -> Iterator[Finding]:
    """Thrust that does not suffice, and lift that does not end."""
    driven, thrust = _vertical(flight), _thrust(flight)
    if driven is None or thrust is None or not flight.hovers:
        return
    t, sinks, wanted = driven
    lift = np.interp(t, *thrust)
    most, least = flight.parameter("MPC_THR_MAX") or 1.0, flight.parameter("MPC_THR_MIN") or _LEAST
    lacks = (lift > min(_ALL, most - _NEAR_LEAST)) & (sinks - wanted > _OFF_MS) & (wanted < 0.0)
    flies_off = (lift < least + _NEAR_LEAST) & (wanted - sinks > _OFF_MS) & (sinks < -_RISES_MS)
    all_of_it = _End(t, lacks, sinks, wanted)
    yield from _came_down(flight, all_of_it)
    drawn_w = drawn_while_lifting(flight)
    lifting = all_of_it if drawn_w is not None else all_of_it._replace(holds=lacks & ~_leans(flight, t))
    lacking = list(_at_its_end(flight, lifting, "too little thrust", "all the thrust"))
    if drawn_w is not None:
        yield from _unpowered(flight, lacking or _lifts(flight, t, lift) or _stands(flight, t, lift), drawn_w)
    else:
        yield from (_set(flight, one, "MPC_THR_MAX", -1.0) for one in lacking)
    for one in _at_its_end(
        flight, _End(t, flies_off, sinks, wanted), "it rises with the motors at their least", "the least"
    ):
        lasting = replace(one, severity="critical" if one.end_s - one.onset_s > _LONG_S else "warning")
        yield _set(flight, lasting, "MPC_THR_MIN", 1.0)


def _leans(flight: Px4Flight, t: Floats) -> Bools:
    """Where it leans so far off what it is told that its motors turn it in place of lifting it: the mixer gives up
    thrust for that, however much is asked for."""
    if flight.lean is None or not len(flight.lean.t):
        return np.zeros(len(t), bool)
    return np.interp(t, flight.lean.t, np.nan_to_num(flight.lean.error_deg)) > _LOOSE_DEG


def _set(flight: Px4Flight, one: Finding, end: str, way: float) -> Finding:
    """The finding with the parameter that sets this end of the thrust, where it is off its default so that it explains
    it: the least above it (`way` 1), the most below it (-1)."""
    setting = flight.off_default(end)
    if setting is None or not isinstance(setting.value, (int, float)) or not isinstance(setting.default, (int, float)):
        return one
    if way * (setting.value - setting.default) < _SET_BY:
        return one
    return replace(
        one,
        suspect="parameter",
        evidence=f"{one.evidence}; {end} is {shown(setting.value)} (default {shown(setting.default)})",
        parameters=(end,),
        wanted=((end, float(setting.default)),),
        probability=_SET_P,
    )


def drawn_while_lifting(flight: Px4Flight) -> float | None:
    """The power (W) that the battery gives in the middle while thrust is asked for that lifts, where no multicopter can
    fly on so little; None where it gave more for a while, as before a crash, or the log does not measure it."""
    battery, thrust = flight.table(_BATTERY, "voltage_v", "current_a"), _thrust(flight)
    if battery is None or thrust is None:
        return None
    t, amps = battery.t, battery["current_a"]
    armed = during(flight.armed, t)
    measured = armed & (np.interp(t, *thrust) > _LIFTS) & np.isfinite(amps) & (amps >= 0.0)
    if measured.sum() < _FEWEST or float(np.ptp(amps[np.isfinite(amps)])) < _MEASURED_A:
        return None
    powers = (amps * battery["voltage_v"])[measured]
    power = float(median(powers))
    return power if power < _DRAWS_W and quantile(powers, _FOR_A_WHILE) < 2 * _DRAWS_W else None


def _lifts(flight: Px4Flight, t: Floats, lift: Floats) -> list[Finding]:
    """Where it is asked for thrust that lifts, and does not lean as it is told: without power it is carried. A current
    that is scaled wrongly makes no vehicle lose its attitude."""
    asked = [span for span in runs(t, lift > _LIFTS, _LASTS_S) if span[1] - span[0] >= _LASTS_S]
    flown = [span for span in asked if _is_flown(flight, span)]
    if not flown or flight.lean is None:
        return []
    off = flight.lean.error_deg[during(flown, flight.lean.t)]
    if not len(off) or not median(off) > _LOOSE_DEG:
        return []
    what = f"thrust of {_LIFTS:.0%} and more is asked for from {log_time(flown[0][0])} on, and it does not lean as told"
    return [_finding("too little thrust", (flown[0][0], flown[-1][1]), what)]


def _stands(flight: Px4Flight, t: Floats, lift: Floats) -> list[Finding]:
    """Where it is asked for thrust that lifts, and stays where it stands."""
    for start, end in runs(t, lift > _LIFTS):
        heights = flight.heights((start, end))
        if end - start >= _LASTS_S and heights is not None and np.ptp(heights["height"]) < _STANDS_M:
            what = f"thrust of {_LIFTS:.0%} and more is asked for from {log_time(start)} on, and it stays on the ground"
            return [_finding("too little thrust", (start, end), what)]
    return []


def _unpowered(flight: Px4Flight, lacking: Iterable[Finding], drawn_w: float) -> Iterator[Finding]:
    """Thrust that does not come because nothing drives the propellers: no failure where somebody broke it off."""
    for one in lacking:
        span = next((armed for armed in flight.armed if armed[0] <= one.onset_s <= armed[1]), (one.onset_s, one.end_s))
        by_hand = [way_of("px4", mode) for mode in flight.modes_during(span)][-1:] == ["manual"]
        yield replace(
            one,
            title=UNPOWERED,
            severity="warning" if by_hand else "critical",
            evidence=f"{drawn_w:.1f} W while lift is asked for: no power at their controllers, or no propellers; "
            + one.evidence,
            source=f"{one.source}, {_BATTERY}.current_a",
            probability=_UNPOWERED_P,
        )


def _came_down(flight: Px4Flight, end: _End) -> Iterator[Finding]:
    """All the thrust, and it lies where it came down: what brought it there is what went wrong."""
    span = next((span for span in _lasting(flight, end) if _lies(flight, end, span)), None)
    if span is not None:
        what = f"all the thrust for {span[1] - span[0]:.0f} s on the ground, below the height that it is told to reach"
        stranded = _finding(CAME_DOWN, span, what)
        yield replace(stranded, kind="crash", severity="critical", probability=_STRANDED_P)


def _lies(flight: Px4Flight, end: _End, span: Span) -> bool:
    """Whether it had flown, is low again, and neither rises nor sinks."""
    speeds = np.abs(end.sinks[(end.t >= span[0]) & (end.t <= span[1])])
    was_up = any(up[1] <= span[0] for up in flight.aloft) and not any(up[0] < span[1] < up[1] for up in flight.aloft)
    return was_up and quantile(speeds, _FOR_A_WHILE) < _LIES_MS


def _lasting(flight: Px4Flight, end: _End) -> list[Span]:
    spans = [span for span in runs(end.t, end.holds) if span[1] - span[0] >= _LASTS_S]
    return [span for span in spans if _is_flown(flight, span) and _is_heard(flight, span)]


def _at_its_end(flight: Px4Flight, end: _End, title: str, what: str) -> Iterator[Finding]:
    flown = [span for span in _lasting(flight, end) if not _lies(flight, end, span)]
    if flown:
        start, stop = flown[0]
        during = (end.t >= start) & (end.t <= stop)
        climbs, wanted = -float(median(end.sinks[during])), -float(median(end.wanted[during]))
        evidence = f"{what} for {stop - start:.0f} s: it {_goes(climbs, 's')}, and is to {_goes(wanted)}"
        yield _finding(title, (start, flown[-1][1]), evidence)


def _finding(title: str, span: Span, evidence: str) -> Finding:
    return Finding(
        kind="thrust",
        title=title,
        onset_s=span[0],
        end_s=span[1],
        severity="warning",
        evidence=evidence,
        source=f"{POSITION}.vz, {_WANTED}.vz, {_THRUST}",
        probability=_TRUE_P,
    )


def _is_heard(flight: Px4Flight, span: Span) -> bool:
    """Whether the barometer tells about as much of a climb as the estimate; of a log that holds none, or hardly any
    climb, it may."""
    heights, baro = flight.heights(span), flight.table(_AIR, "baro_alt_meter")
    if heights is None or baro is None:
        return baro is None
    climbed = float(heights["height"][-1])
    heard = np.interp(span, baro.t, baro["baro_alt_meter"])
    return abs(climbed) < _LASTS_S * _RISES_MS or float(heard[1] - heard[0]) > _HEARD * climbed


def _goes(climbs: float, ending: str = "") -> str:
    return f"{'climb' if climbs > 0 else 'sink'}{ending} by {abs(climbs):.1f} m/s"


def _is_flown(flight: Px4Flight, span: Span) -> bool:
    return within(flight.armed, span[0])


def _vertical(flight: Px4Flight) -> tuple[Floats, Floats, Floats] | None:
    """Time, vertical speed (m/s, downwards) and the one that is wanted; None where the log lacks one."""
    moved, asked = flight.table(POSITION, "vz"), flight.table(_WANTED, "vz")
    if moved is None or asked is None:
        return None
    known = asked.where(np.isfinite(asked["vz"]))
    if len(known) < 2:
        return None
    wanted = np.interp(moved.t, known.t, known["vz"], left=np.nan, right=np.nan)
    return moved.t, moved["vz"], wanted


def _thrust(flight: Px4Flight) -> tuple[Floats, Floats] | None:
    """Time and lift that is asked for, 0 to 1."""
    for topic, field in ((_THRUST, "xyz[2]"), (_OLD_THRUST, "thrust_body[2]")):
        table = flight.table(topic, field)
        if table is not None:
            return table.t, -table[field]
    return None


CHECK = Check("lift", "thrust at its end that does not give the vertical speed wanted", READS, LIMITS, find)
