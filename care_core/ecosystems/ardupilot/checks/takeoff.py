"""Take-off: motors that answer against their demand, that are driven as servos, or are kept from spooling up.

A rate that grows against all that its controller gives is turned by motors that push the other way: their order, their
places or their directions are not those of FRAME_TYPE, FRAME_CLASS and SERVOn_FUNCTION. One weak or dead motor tips a
vehicle over once; then it lies.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from care_core.ecosystems.ardupilot.airborne import ACRO
from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.spans import Span, during, runs
from care_core.ecosystems.vehicles import motor_outputs
from care_core.logs.base import Table, Wanted
from care_core.metadata.output_functions import LEFT, MOTORS, RIGHT, TILTS
from care_core.numbers import Bools, median

READS: Wanted = {
    "RATE": ("R", "RDes", "ROut", "P", "PDes", "POut", "Y", "YDes", "YOut"),
    "RCOU": tuple(f"C{n}" for n in range(1, 15)),
    "ESC": ("RPM",),
}

LIMITS = Limits()
_AWAY_DPS = LIMITS.add(
    "roll or pitch rate off its target against its output", 450.0, "deg/s", "a hexa set half an arm off has up to 380"
)
_YAW_AWAY_DPS = LIMITS.add("yaw rate off its target against its output", 300.0, "deg/s", "a dead motor has up to 276")
_PUSHES = LIMITS.add("output against it", 0.15, "", "AP_Motors.h: outputs run from -1 to 1")
_LASTS_S = LIMITS.add("time in which roll or pitch run away", 1.5, "s", "a vehicle that tips over lies after one")
_YAW_LASTS_S = LIMITS.add("time in which yaw runs away without a pause", 2.0, "s", "a choice: gusts turn it for less")
_RECORDS, _GAP_RECORDS = 4, 2.2
_BEGINS, _BEGAN_S = 5.0, 2.0
"""It began at so small a share of the limit, so shortly before."""
_TAKEOFF_S = LIMITS.add("first seconds after the first throttle", 20.0, "s", "a choice: then it has flown")
_FLEW_M = LIMITS.add("height of what has flown", 2.5, "m", "a choice: above it other things turn it over")
_THROTTLE = LIMITS.add("first throttle", 0.15, "", "MOT_SPIN_MIN as shipped")
_SURE_P = LIMITS.add("probability of a parameter, where motors answer wrongly", 0.9, "", "its layout is a rare one")
_KEPT_P = LIMITS.add("probability of a parameter that keeps motors down", 0.95, "", "the firmware does as it says")
_LOST_P = LIMITS.add("probability that a mission fails of it", 0.95, "", "it does not take off")
_DELAY_S = LIMITS.add("disarming off DISARM_DELAY", 0.7, "s", "arming and spooling up take some of it")
_FULL = LIMITS.add("throttle of what does not rise", 0.9, "", "a choice: any vehicle that can fly rises with less")
_FULL_S = LIMITS.add("time without rising", 5.0, "s", "a choice: a take-off takes less")
_RESTS_US = LIMITS.add("pulse of a servo at rest", 1500.0, "us", "SERVOn_TRIM as shipped")
_RESTS_BY_US = LIMITS.add("pulse off that", 50.0, "us", "a motor at full throttle is 400 above it")
_AXES = (("roll", "R"), ("pitch", "P"), ("yaw", "Y"))
_USUAL_TYPES, _USUAL_CLASSES = frozenset((0.0, 1.0)), frozenset((1.0, 2.0))
"""FRAME_TYPE of plus and X, FRAME_CLASS of quad and hexa (AP_Motors_Class.h): every other is one of few vehicles."""
_THRUSTERS = frozenset((*MOTORS.values(), LEFT, RIGHT, *TILTS))
_IDLED = "after idling on the ground"


class Runaway(NamedTuple):
    """An axis that turned against its output."""

    axis: str
    span: Span
    rate_dps: float
    output: float
    limit_dps: float


def find(flight: Flight) -> Iterator[Finding]:
    """What answers wrongly; else what never spooled up."""
    if not flight.is_copter or not flight.armed:
        return
    layout = wrong_layout(flight) or _no_motors(flight)
    if layout is not None:
        yield layout
    else:
        yield from _kept_down(flight)


def wrong_layout(flight: Flight) -> Finding | None:
    """That the motors' layout is set wrongly; None where they answer rightly, or where no parameter is to blame."""
    away = _runaway(flight)
    values = _layout(flight) if away is not None else {}
    if away is None or not values:
        return None
    named = ", ".join(f"{name} is {flight.setting(name):g}" + _default_words(value) for name, value in values.items())
    return Finding(
        kind="takeoff",
        title=f"{away.axis} turns against its motors at take-off",
        onset_s=away.span[0],
        end_s=away.span[1],
        severity="critical",
        evidence=(
            f"the {away.axis} torque has the wrong sign at take-off: {away.rate_dps:+.0f} deg/s against an output of "
            f"{away.output:+.2f} (limit {away.limit_dps:g} deg/s off the target); {named}: set it as the frame is built"
        ),
        source="RATE against its demand and output, height; PARM",
        suspect="parameter",
        probability=_SURE_P,
        mission_lost=_LOST_P,
        parameters=tuple(values),
        wanted=() if "FRAME_CLASS" in values else tuple((n, v) for n, v in values.items() if v is not None),
    )


def _default_words(value: float | None) -> str:
    return "" if value is None else f" (default {value:g})"


def _layout(flight: Flight) -> dict[str, float | None]:
    """Parameters of the motors' layout that are set to what few vehicles have, with what they were shipped with."""
    kind, usual_kind = flight.setting("FRAME_CLASS"), _shipped(flight, "FRAME_CLASS")
    layout, usual = flight.setting("FRAME_TYPE"), _shipped(flight, "FRAME_TYPE")
    found: dict[str, float | None] = {}
    if layout is not None and layout != usual and not {layout, usual} <= {*_USUAL_TYPES, None}:
        found["FRAME_TYPE"] = usual
    if kind is not None and usual_kind and kind != usual_kind and not {kind, usual_kind} <= _USUAL_CLASSES:
        found["FRAME_CLASS"] = usual_kind
    outputs = motor_outputs(flight.settings)
    swapped = {output: motor for motor, output in outputs.items() if motor != output and output in outputs}
    if not found and sorted(outputs.values()) == list(range(1, len(outputs) + 1)):
        found |= {f"SERVO{output}_FUNCTION": float(MOTORS[output]) for output in sorted(swapped)}
    return found


def _shipped(flight: Flight, name: str) -> float | None:
    """What the log says that a parameter is as shipped."""
    history = flight.settings.get(name, ())
    said = history[0].default if history else None
    return float(said) if isinstance(said, (int, float)) else None


def _runaway(flight: Flight) -> Runaway | None:
    """The first axis that turned faster and faster against its output, before it had flown."""
    table, throttle = flight.one("RATE", *READS["RATE"]), flight.throttle
    if table is None or throttle is None:
        return None
    for begin, end in flight.armed:
        t, driven = throttle
        up = t[(t >= begin) & (t <= end) & (driven > _THROTTLE)]
        if not len(up):
            continue
        first = table.between(float(up[0]), min(end, float(up[0]) + _TAKEOFF_S))
        found = [away for axis in _AXES for away in _away(flight, first, *axis)]
        if found:
            return min(found, key=lambda away: away.span[0])
    return None


def _away(flight: Flight, first: Table, axis: str, rate: str) -> Iterator[Runaway]:
    if len(first) < _RECORDS:
        return
    step = float(median(np.diff(first.t)))
    off, output = first[rate] - first[f"{rate}Des"], first[f"{rate}Out"]
    limit = _YAW_AWAY_DPS if rate == "Y" else _AWAY_DPS
    against: Bools = (np.abs(off) > limit) & (np.sign(off) == -np.sign(output)) & (np.abs(output) > _PUSHES)
    against &= ~np.isin(flight.modes_at(first.t), tuple(ACRO))
    if rate == "Y":
        spans = [
            span
            for span in runs(first.t, against, gap_s=_GAP_RECORDS * step)
            if span[1] - span[0] + step >= _YAW_LASTS_S
        ]
    else:
        lasts = against.sum() >= _RECORDS and against.sum() * step >= _LASTS_S
        spans = [(float(first.t[against][0]), float(first.t[against][-1]))] if lasts else []
    if not spans or _flew(flight, spans[0][0], rate):
        return
    start, end = spans[0]
    within = np.flatnonzero(against & (first.t >= start) & (first.t <= end))
    row = int(within[np.argmax(np.abs(off[within]))])
    grows = (np.abs(off) > limit / _BEGINS) & (np.sign(off) == -np.sign(output)) & (first.t >= start - _BEGAN_S)
    yield Runaway(axis, (float(first.t[grows][0]), end), float(first[rate][row]), float(output[row]), limit)


def _flew(flight: Flight, at: float, rate: str) -> bool:
    """Whether it had flown before: what lifts without turning over rises while it spins."""
    height = flight.height
    if height is None:
        return True
    t, metres = height
    before = metres[(t <= at) & (t >= at - _TAKEOFF_S)]
    most = _FLEW_M if rate != "Y" else 3 * _FLEW_M
    return len(before) > 0 and float(np.max(before)) > most


def _no_motors(flight: Flight) -> Finding | None:
    """Outputs of motors that stay where a servo rests while the throttle is all the way up, and it does not rise."""
    table, throttle, values = flight.one("RCOU"), flight.throttle, _layout(flight)
    if table is None or throttle is None or "FRAME_CLASS" not in values or flight.airborne:
        return None
    driven = np.interp(table.t, *throttle)
    full = (driven > _FULL) & during(flight.armed, table.t)
    if not full.any() or float(np.sum(np.diff(table.t)[full[1:]])) < _FULL_S:
        return None
    outputs = [
        n for n in range(1, 15) if flight.setting(f"SERVO{n}_FUNCTION") in _THRUSTERS and f"C{n}" in table.columns
    ]
    pulses = {n: table[f"C{n}"][full] for n in outputs if table[f"C{n}"][full].any()}
    resting = [n for n, us in pulses.items() if float(np.abs(us[:_RECORDS] - _RESTS_US).max()) < _RESTS_BY_US]
    if not resting or len(resting) == len(pulses):
        return None
    kind = flight.setting("FRAME_CLASS")
    return Finding(
        kind="takeoff",
        title="outputs of motors are driven as servos",
        onset_s=float(table.t[full][0]),
        end_s=float(table.t[full][-1]),
        severity="critical",
        evidence=(
            f"with the throttle above {100 * _FULL:.0f}% outputs {', '.join(map(str, resting))} stay within "
            f"{_RESTS_BY_US:g} us of {_RESTS_US:g} us, and it does not rise; FRAME_CLASS is {kind:g}"
            f"{_default_words(values['FRAME_CLASS'])}: set it as the frame is built"
        ),
        source="RCOU against CTUN.ThO, height; PARM",
        suspect="parameter",
        probability=_SURE_P,
        mission_lost=_LOST_P,
        parameters=("FRAME_CLASS",),
    )


def _kept_down(flight: Flight) -> Iterator[Finding]:
    """It was armed to fly by itself, idled, and was disarmed for it."""
    for change in flight.arm_changes:
        span = next((one for one in flight.armed if one[1] == change.time_s), None)
        mode = flight.mode_at(change.time_s - 0.1)
        if change.is_armed or span is None or change.how != _IDLED or flight.airborne or flight.throttle is None:
            continue
        t, driven = flight.throttle
        idle = driven[(t >= span[0]) & (t <= span[1])]
        if mode is None or mode.way not in ("mission", "guided") or (len(idle) and float(np.max(idle)) > _THROTTLE):
            continue
        kept = _waits_for_speed(flight, span) or _disarmed_soon(flight, span)
        if kept is not None:
            yield kept
            return


def _waits_for_speed(flight: Flight, span: Span) -> Finding | None:
    """The firmware lets motors spool up only once their controllers report a speed within TKOFF_RPM_MIN and MAX."""
    least, most = flight.setting("TKOFF_RPM_MIN") or 0.0, flight.setting("TKOFF_RPM_MAX") or 0.0
    if least <= 0:
        return None
    reported = [float(median(one.between(*span)["RPM"])) for one in flight.all("ESC", "RPM") if len(one.between(*span))]
    name, limit = (
        ("TKOFF_RPM_MAX", most) if most > 0 and reported and max(reported) > most else ("TKOFF_RPM_MIN", least)
    )
    if reported and min(reported) >= least and name == "TKOFF_RPM_MIN":
        return None
    said = f"they report {min(reported):.0f} to {max(reported):.0f}" if reported else "no motor controller reports one"
    return _down(
        "the motors were kept from spooling up", span,
        f"{name} is {limit:g} turns a minute, and {said}: it was armed for {span[1] - span[0]:.1f} s at "
        "no throttle and disarmed",
        "ARM, CTUN.ThO, ESC.RPM; ArduCopter: takeoff_check.cpp", name, None if reported else 0.0,
    )  # fmt: skip


def _disarmed_soon(flight: Flight, span: Span) -> Finding | None:
    delay, usual = flight.setting("DISARM_DELAY"), _shipped(flight, "DISARM_DELAY")
    if not delay or usual is None or delay >= usual or abs(span[1] - span[0] - delay) > _DELAY_S:
        return None
    return _down(
        "it was disarmed before it rose", span,
        f"armed for {span[1] - span[0]:.1f} s and disarmed for idling: DISARM_DELAY is {delay:g} s (default {usual:g})",
        "ARM, CTUN.ThO; PARM", "DISARM_DELAY", usual,
    )  # fmt: skip


def _down(title: str, span: Span, evidence: str, source: str, parameter: str, value: float | None) -> Finding:
    return Finding(
        kind="takeoff",
        title=title,
        onset_s=span[0],
        end_s=span[1],
        severity="critical",
        evidence=evidence,
        source=source,
        suspect="parameter",
        probability=_KEPT_P,
        mission_lost=_LOST_P,
        parameters=(parameter,),
        wanted=() if value is None else ((parameter, value),),
    )


CHECK = Check("takeoff", "motors that answer against their demand, or are driven as none", READS, LIMITS, find)
