"""Attitude: it does not follow its demand, it oscillates, and control that was lost.

ArduPilot's crash check calls 30 degrees off the demand a loss of control (crash_check.cpp); in good flights roll and
pitch follow within a few degrees (ArduPilot, Diagnosing problems using logs: mechanical failure). In nine of ten
healthy training flights the error is below 7 degrees for 95% of the time, in the rest bad gains make it swing.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.ardupilot.airborne import ACRO, UPSIDE_DOWN_DEG
from care_core.ecosystems.ardupilot.checks.settings import gravity
from care_core.ecosystems.ardupilot.checks.thrust import saturated
from care_core.ecosystems.ardupilot.flight import STANDS_MS, Flight
from care_core.ecosystems.ardupilot.statistics import lasting, means, parts, records, top
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import SPINS, Finding, Severity
from care_core.ecosystems.spans import Span, during
from care_core.logs.base import Table, Wanted
from care_core.numbers import Bools, Floats, median

READS: Wanted = {
    "ATT": ("Roll", "Pitch", "Yaw", "DesRoll", "DesPitch", "DesYaw"),
    "RATE": ("R", "P", "Y", "RDes", "PDes", "YDes", "ROut", "POut", "YOut"),
    "STER": ("TurnRate", "DesTurnRate", "SteerOut"),
}

LIMITS = Limits()
FAR_DEG = LIMITS.add("roll and pitch off their demand", 15.0, "deg", "half of ArduCopter's crash check")
_LASTS_S = LIMITS.add("shortest time off the demand", 1.0, "s", "a choice: a gust is over sooner")
_FLICK_S = LIMITS.add("pause that ends it", 0.3, "s", "a choice: flicks of a stick follow each other more slowly")
YAW_DEG = LIMITS.add("heading off its demand", 45.0, "deg", "a choice: turns to a new heading come nearer")
_YAW_LASTS_S = LIMITS.add("shortest time off the heading", 3.0, "s", "a choice: gusts turn it away for less")
_SPINS_DPS = LIMITS.add("turn against its control", 40.0, "deg/s", "a choice: gusts turn it slower")
_PUSHES = LIMITS.add("output that is to turn it back", 0.2, "of the range", "a choice: less hardly turns it")
_SPINS_S = LIMITS.add("shortest turn against its control", 2.0, "s", "a choice: a blow is countered sooner")
_STILL_S = LIMITS.add(
    "flight that turning directions are right in", 10.0, "s", "a choice: a false one shows in seconds"
)
_BEGINS = LIMITS.add("rate at first, of a turn that gets faster", 0.8, "of it", "a choice: noise is less")
_NEARLY = LIMITS.add("rate off a turn that is followed", 0.5, "of it", "a choice: rates lag as a turn begins")
_TURNED_P = LIMITS.add("probability of wrong turning directions", 0.7, "", "a choice: yaw that is spent shows alike")
_WAVERS_DEG = LIMITS.add("heading that wavers in a turn", 10.0, "deg", "a choice: gusts push a turn back by less")
_NEARER = LIMITS.add(
    "share of the error left after a turn", 0.6, "", "a choice: a turn that is followed brings it much nearer"
)
_OFF_P = LIMITS.add("probability of a part, off its demand", 0.25, "", "a choice: gains and wind show alike")
_LOST_P = LIMITS.add("probability of a part, control lost", 0.3, "", "a choice: control is lost for many reasons")
_GOES_DEG = LIMITS.add("error at the last record", 20.0, "deg", "two thirds of ArduCopter's crash check")
_GOES_BY_DEG = LIMITS.add("by which it grew in the last moment", 10.0, "deg", "a choice: what is held does not grow")
_MOMENT_S = LIMITS.add("the last moment", 0.6, "s", "a choice: a loss of control takes about a second")
_LIFTS = LIMITS.add("throttle that lifts", 0.2, "", "a choice: half of a usual hover")
_AFTER_S = LIMITS.add("attitude looked at after control was lost", 5.0, "s", "a choice: most falls are over by then")
_OVER_P = LIMITS.add("probability of what lies upside down", 0.5, "", "a choice: it turned, or its board is mounted so")
LIMITS.add("tilt of what is upside down", UPSIDE_DOWN_DEG, "deg", "a choice: no slope and no wave")
UPSIDE_DOWN = "the vehicle is upside down"
"""Of what lay so before anybody looked, and did not turn over."""
_KEEP_UPRIGHT = frozenset(("rover", "sub"))
_ANY_WAY_UP = frozenset((1, 19))
"""Modes of a submarine in which the pilot may turn it over: acro, manual (ArduSub/mode.h)."""
_LIES_S = LIMITS.add("shortest time upside down", 5.0, "s", "a choice: a flip is over sooner")
_BEFORE_S = LIMITS.add(
    "upright so shortly before it turned over",
    10.0,
    "s",
    "a choice: it tells what turned over from what lay so from the start",
)
SWING_DPS = LIMITS.add(
    "swing of a rate around its target",
    30.0,
    "deg/s",
    "a choice: gusts and manoeuvres leave less, in the mean of its window",
)
OVER_DEMAND = LIMITS.add("swing, in movements of the target", 3.0, "", "a choice: what is told to move moves")
_SWING_S = LIMITS.add("shortest swing", 5.0, "s", "a choice: a manoeuvre is over sooner")
_WINDOW_S = LIMITS.add("window of a swing", 3.0, "s", "a choice: one swing comes and goes within it")
_TURNS = LIMITS.add("share of records in which a swing turns", 0.15, "", "a choice: slow logs miss the others")
_EVEN = LIMITS.add("mean of a swing over its size", 0.5, "", "a choice: what stays on one side is no swing")
_ALL = LIMITS.add("output of all that the motors have", 1.0, "", "AP_Motors.h: roll and pitch run from -1 to 1")
_ALL_STEERING = LIMITS.add("output of all that the steering has", 4500.0, "", "AP_MotorsUGV.h")
_GETS_ON_S = LIMITS.add(
    "swing that keeps a rover from its way", 30.0, "s", "a choice: what only corrects its heading drives on sooner"
)
_SPENT_P = LIMITS.add(
    "probability of a swing that takes all the motors have", 0.85, "",
    "31 of 34 such training flights fail; all 106 that swing have a gain raised or the gyros' filter lowered",
)  # fmt: skip
_SWINGS_P = LIMITS.add("probability of any other swing", 0.2, "", "a choice: the motors have more to give")
_GROWS = LIMITS.add("growth of each swing that gets out of hand", 1.5, "", "a choice: gusts come and go")
_SWUNG_UP = LIMITS.add("swings to either side that grow", 4, "", "a choice: two or three are a blow and what rights it")
_LEAST_DPS = LIMITS.add("least of them", 3.0, "deg/s", "a choice: a hover's own movements")
_LENGTHENS = LIMITS.add("times as long as the one before", 3.0, "", "a choice: a swing keeps its time")
_OUT_OF_HAND_P = LIMITS.add(
    "probability of a swing that grows until control is lost",
    0.6,
    "",
    "a choice: gains come first, and a part that gives way swings alike",
)
_ENOUGH, _FEW = 10, 3
_GAINS = ("ATC_RAT_", "ATC_ANG_", "INS_GYRO_FILTER", "INS_HNTCH_", "INS_HNTC2_")


def find(flight: Flight) -> Iterator[Finding]:
    """Swings of the rates first: then the attitude's error is theirs."""
    if flight.lost_control_s is not None:
        yield from _lost(flight, flight.lost_control_s)
    yield from _upside_down(flight)
    yield from _steering(flight)
    if flight.is_copter or flight.kind == "quadplane":
        yield from _spins(flight)
    if not flight.is_copter:
        return
    swung = list(swings(flight)) or list(_swung_up(flight))
    yield from swung
    if flight.lost_control_s is None and not swung:
        yield from _far(flight)
    if flight.lost_control_s is None:
        yield from _going(flight)
    yield from _yaw(flight)


def _lost(flight: Flight, lost: float) -> Iterator[Finding]:
    error = flight.lean_error
    if error is None or _is_contradicted(flight):
        return
    after = error[1][(error[0] >= lost) & (error[0] <= lost + _AFTER_S)]
    yield Finding(
        kind="attitude",
        title="control was lost",
        onset_s=lost,
        end_s=flight.impact_s or flight.end_s,
        severity="critical",
        evidence=f"the attitude is up to {float(np.max(after)):.0f} deg off its target and does not recover",
        source="ATT; 30 degrees: ArduCopter's crash check",
        probability=_LOST_P,
    )


def _going(flight: Flight) -> Iterator[Finding]:
    """A copter that leaves its demand, faster and faster, in the last moment that the log holds."""
    error, armed = flight.lean_error, flight.armed
    if error is None or not armed or armed[-1][1] < flight.end_s or error[0][-1] < flight.end_s - _MOMENT_S:
        return
    t, off = error
    last = off[t > t[-1] - _MOMENT_S]
    is_lifting = flight.throttle is not None and float(flight.throttle[1][-1]) > _LIFTS
    by_sticks = int(flight.modes_at(t[-1:])[0]) in ACRO
    if len(last) < _FEW or by_sticks or not is_lifting or last[-1] < _GOES_DEG or last[-1] - last[0] < _GOES_BY_DEG:
        return
    yield Finding(
        kind="attitude",
        title="it was out of control as the log ended",
        onset_s=float(t[t > t[-1] - _MOMENT_S][0]),
        end_s=flight.end_s,
        severity="critical",
        evidence=(
            f"the attitude is {last[-1]:.0f} deg off its target at the last record, and was {last[0]:.0f} deg "
            f"{_MOMENT_S:g} s before"
        ),
        source="ATT",
        probability=_LOST_P,
    )


def _is_contradicted(flight: Flight) -> bool:
    """Whether its gyros turn and gravity tells of another lean than the estimate each time that it rests: what left its
    demand is the estimate, and nobody knows its attitude."""
    tilt, rests = flight.tilt, list(gravity.rests(flight))
    return (
        tilt is not None
        and bool(rests)
        and all(
            rest.turns_dps > gravity.TURNS_DPS
            and abs(gravity.lean_deg(rest.down) - float(np.interp(rest.span[1], *tilt))) > FAR_DEG
            for rest in rests
        )
    )


def _upside_down(flight: Flight) -> Iterator[Finding]:
    """A rover that rolled over, a submarine that turned, or a board that is mounted otherwise than it is told."""
    if flight.kind not in _KEEP_UPRIGHT or flight.tilt is None:
        return
    t, tilt = flight.tilt
    over = (tilt > UPSIDE_DOWN_DEG) & during(flight.armed, t)
    if flight.kind == "sub":
        over &= ~np.isin(flight.modes_at(t), tuple(_ANY_WAY_UP))
    spans = lasting(t, over, _LIES_S)
    if not spans:
        return
    start, end = spans[0][0], spans[-1][1]
    before = tilt[(t < start) & (t >= start - _BEFORE_S)]
    turned = len(before) > 0 and float(np.min(before)) < UPSIDE_DOWN_DEG / 2
    yield Finding(
        kind="attitude",
        title="the vehicle turned over" if turned else UPSIDE_DOWN,
        onset_s=start,
        end_s=end,
        severity="critical",
        evidence=(
            f"it leans {float(median(tilt[during(spans, t)])):.0f} deg from level"
            + ("" if turned else " from the start: it lies like this, or AHRS_ORIENTATION does not match the board")
        ),
        source="ATT.Roll, Pitch",
        suspect="world" if turned else "parameter",
        probability=_OVER_P,
    )


def _far(flight: Flight) -> Iterator[Finding]:
    if flight.lean_error is None:
        return
    t, error = flight.lean_error
    levels = during(flight.flown, t) & ~np.isin(flight.modes_at(t), tuple(ACRO))
    spans = lasting(t, (error > FAR_DEG) & levels, _LASTS_S, gap_s=_FLICK_S)
    if spans:
        worst = top(error[(t >= spans[0][0]) & (t <= spans[-1][1])], 0.9)
        severity: Severity = "critical" if flight.impact_s is not None else "warning"
        yield Finding(
            kind="attitude",
            title="the attitude does not follow its demand",
            onset_s=spans[0][0],
            end_s=spans[-1][1],
            severity=severity,
            evidence=f"roll and pitch are up to {worst:.0f} deg off (limit {FAR_DEG:g})",
            source="ATT against DesRoll, DesPitch",
            probability=_OFF_P,
            suspect="parameter",
        )


def _yaw(flight: Flight) -> Iterator[Finding]:
    table = flight.living_attitude("Yaw", "DesYaw")
    if table is None or flight.lost_control_s is not None or not np.ptp(table["DesYaw"]):
        return
    off = np.abs((table["Yaw"] - table["DesYaw"] + 180) % 360 - 180)
    spans = [
        span
        for span in lasting(table.t, (off > YAW_DEG) & during(flight.flown, table.t), _YAW_LASTS_S)
        if not _is_a_turn(off[during((span,), table.t)])
    ]
    if spans:
        yield Finding(
            kind="attitude",
            title="the heading does not follow its demand",
            onset_s=spans[0][0],
            end_s=spans[-1][1],
            severity="warning",
            evidence=f"up to {top(off[during(spans, table.t)]):.0f} deg off (limit {YAW_DEG:g})",
            source="ATT.Yaw against DesYaw",
            probability=_OFF_P,
        )


def _spins(flight: Flight) -> Iterator[Finding]:
    """A turn that goes on, and faster, though the motors are told to turn it back: they turn it on."""
    table = flight.one("RATE", "Y", "YDes", "YOut")
    if table is None:
        return
    t, rate, out = table.t, table["Y"], table["YOut"]
    against = (rate * out < 0) & (np.abs(out) > _PUSHES)
    against &= (np.abs(rate - table["YDes"]) > _SPINS_DPS) & during(flight.flown, t)
    turn = -rate * np.sign(out)
    spans = [
        (start, end)
        for start, end in lasting(t, against & (turn > _SPINS_DPS), _SPINS_S)
        if np.interp(end, t, turn) > np.interp(start, t, turn)
    ]
    slow = lasting(t, against, _SPINS_S)
    if spans := spans or [span for span in slow if _speeds_up(t, turn, *span) and _is_level(flight, span)]:
        start, end = spans[0]
        most = float(np.max(turn[against & (t >= start) & (t <= end)]))
        had_turned = _turned_as_told(flight, table, start) or _held_still(flight, table, start)
        why = (
            ", though it had held or turned as told until then: something struck or holds it, or a motor gave way"
            if had_turned
            else ": motors or propellers of the wrong turning direction, or a frame type that is not its own"
        )
        yield Finding(
            kind="attitude",
            title=SPINS,
            onset_s=start,
            end_s=end,
            severity="critical",
            evidence=f"it turns faster and faster, up to {most:.0f} deg/s, with the motors told to turn it back{why}",
            source="RATE.Y, YDes, YOut",
            suspect="hardware" if had_turned else "operation",
            probability=_LOST_P if had_turned else _TURNED_P,
        )


def _speeds_up(t: Floats, rate: Floats, start: float, end: float) -> bool:
    """Whether a turn, counted against what the motors are told, gets faster and goes far: one that is only slow to stop
    gets slower from its first moment on, and one that swings does not go far."""
    inside = (t >= start) & (t <= end)
    begun, most = float(np.interp(start, t, rate)), float(np.max(rate[inside]))
    is_faster = float(np.interp(end, t, rate)) > begun or begun < _BEGINS * most
    turned = float(np.sum(rate[inside][1:] * np.diff(t[inside])))
    return is_faster and most > _SPINS_DPS and turned > _SPINS_DPS * _SPINS_S


def _is_level(flight: Flight, span: Span) -> bool:
    """Whether roll and pitch follow all the while: what swings or tumbles has no motors left for its heading."""
    if flight.lean_error is None:
        return False
    t, error = flight.lean_error
    off = error[(t >= span[0]) & (t <= span[1])]
    return len(off) > 0 and float(np.max(off)) < FAR_DEG


def _turned_as_told(flight: Flight, table: Table, until: float) -> bool:
    """Whether its motors turned it in flight, as fast as they were told: then all turn the way that they should."""
    t, wanted = table.t, table["YDes"]
    followed = (np.abs(wanted) > _SPINS_DPS) & (np.abs(table["Y"] - wanted) < _NEARLY * np.abs(wanted))
    return bool(lasting(t, followed & during(flight.flown, t) & (t < until), _SPINS_S))


def _held_still(flight: Flight, table: Table, until: float) -> bool:
    """Whether it flew for long without turning: with motors that turn the wrong way each touch of its control grows."""
    still = (np.abs(table["Y"]) < _SPINS_DPS / 2) & during(flight.flown, table.t) & (table.t < until)
    return bool(lasting(table.t, still, _STILL_S))


def _is_a_turn(off: Floats) -> bool:
    """Whether a heading only comes nearer to its demand, and much: it turns to one that was given at once."""
    return bool(np.all(off <= np.minimum.accumulate(off) + _WAVERS_DEG)) and float(off[-1]) < _NEARER * float(off[0])


def swings(flight: Flight) -> Iterator[Finding]:
    """Rates that swing far more than is asked for: gains too high, or filters too slow. The axis that swings most."""
    table = flight.one("RATE", "R", "P", "RDes", "PDes")
    if table is None:
        return
    flown = during(flight.flown, table.t)
    if flown.sum() < _ENOUGH:
        return
    found = []
    for axis, wanted, name in (("R", "RDes", "roll"), ("P", "PDes", "pitch")):
        spans, peak = _unasked(flight, table, axis, wanted, flown, (f"{axis}Out", _ALL))
        if spans:
            found.append((peak, name, spans))
    if not found:
        return
    peak, name, spans = max(found)
    spent = _spent(flight, spans)
    down = _came_down(flight, spans)
    lost = spent > 0 or down or flight.lost_control_s is not None
    is_simulators = not lost and flight.is_simulated and _is_as_shipped(flight)
    limit = (
        f"; the motors are at their limit for {spent:.0f} s of it" if spent else "; then it came down" if down else ""
    )
    yield Finding(
        kind="tuning",
        title=f"{name} oscillates",
        onset_s=spans[0][0],
        end_s=spans[-1][1],
        severity="critical" if lost else "info" if is_simulators else "warning",
        evidence=(
            f"the {name} rate swings {peak:.0f} deg/s around its target (above {SWING_DPS:g} is abnormal where it is "
            f"{OVER_DEMAND:g} times the target's own movement, or takes all that the motors have){limit}"
            + (
                "; every gain is the firmware's default and this is a simulator, whose delay does that"
                if is_simulators
                else ""
            )
        ),
        source="RATE against its demand",
        suspect="parameter",
        probability=_SPENT_P if spent or down else _SWINGS_P,
    )


def _swung_up(flight: Flight) -> Iterator[Finding]:
    """Rates that swing further to either side each time until control is lost: the rate controllers are unstable. What
    a blow or a dead motor does comes at once."""
    lost, table = flight.lost_control_s, flight.one("RATE", "R", "P")
    if lost is None or table is None:
        return
    grown = [(name, *_growing(table.t, table[axis], lost)) for axis, name in (("R", "roll"), ("P", "pitch"))]
    name, start, sizes = max(grown, key=lambda one: len(one[2]))
    if len(sizes) < _SWUNG_UP or sizes[-1] < SWING_DPS:
        return
    yield Finding(
        kind="tuning",
        title=f"{name} oscillates",
        onset_s=start,
        end_s=lost,
        severity="critical",
        evidence=(
            f"the {name} rate swings from side to side, further each time: "
            f"{', '.join(f'{size:.0f}' for size in sizes)} deg/s; then control is lost"
        ),
        source="RATE",
        suspect="parameter",
        probability=_OUT_OF_HAND_P,
    )


def _growing(t: Floats, rate: Floats, lost: float) -> tuple[float, list[float]]:
    """When a rate began to swing further to either side each time, up to the swing in which control was lost, and how
    far each went."""
    edges = np.flatnonzero(np.diff(np.sign(rate)) != 0) + 1
    begins = np.concatenate(([0], edges)).astype(int)
    begins = begins[t[begins] <= lost] if len(t) else begins
    start, sizes = lost, list[float]()
    end, lasted = int(np.searchsorted(t, lost)) if len(t) else 0, math.inf
    for begin in begins[::-1].tolist():
        size = float(np.max(np.abs(rate[begin : max(end, begin + 1)])))
        took = float(t[min(end, len(t) - 1)] - t[begin])
        is_next = not sizes or (sizes[0] >= _GROWS * size and took < _LENGTHENS * lasted)
        if size < _LEAST_DPS or not is_next:
            break
        start, end, lasted = float(t[begin]), begin, took if sizes else math.inf
        sizes.insert(0, size)
    return start, sizes


def _is_as_shipped(flight: Flight) -> bool:
    """Whether every gain and filter of the rate controllers is the firmware's default: in all 106 training flights that
    swing one is not."""
    held = [history[0] for name, history in flight.settings.items() if name.startswith(_GAINS) and history]
    known = [one for one in held if one.default is not None]
    return bool(known) and all(one.value == one.default for one in known)


def _steering(flight: Flight) -> Iterator[Finding]:
    """A rover that steers by itself swings around its course: gains of the steering that are too high."""
    table = flight.one("STER", "TurnRate", "DesTurnRate")
    if flight.kind != "rover" or table is None:
        return
    steered = flight.drives_itself(table.t)
    spans, peak = _unasked(flight, table, "TurnRate", "DesTurnRate", steered, ("SteerOut", _ALL_STEERING))
    if not spans:
        return
    driven = flight.one("THR", "Speed")
    swung = np.zeros(0) if driven is None else np.abs(driven["Speed"][during(spans, driven.t)])
    stays = len(swung) > 0 and spans[-1][1] - spans[0][0] > _GETS_ON_S and float(median(swung)) < STANDS_MS
    end = "; the vehicle makes no progress" if stays else ""
    yield Finding(
        kind="tuning",
        title="the steering oscillates",
        onset_s=spans[0][0],
        end_s=spans[-1][1],
        severity="critical" if stays else "warning",
        evidence=(
            f"the turn rate swings {peak:.0f} deg/s around its target (above {SWING_DPS:g} is abnormal where it is "
            f"{OVER_DEMAND:g} times the target's own movement, or takes all that the steering has){end}"
        ),
        source="STER.TurnRate against its demand",
        suspect="parameter",
        probability=_SPENT_P if stays else _SWINGS_P,
    )


def _unasked(
    flight: Flight, table: Table, rate: str, wanted: str, where: Bools, limit: tuple[str, float]
) -> tuple[list[Span], float]:
    """Where a rate swings far more than is asked for, and how far it is off its demand at most.

    `limit` names the controller's output and the most that the vehicle can give.
    """
    if len(table) < 3:
        return [], 0.0
    n = records(table.t, _WINDOW_S)

    def level() -> Iterator[Floats]:
        return means((np.abs(part[rate] - part[wanted]) for part in parts(table)), n)

    def demand() -> Iterator[Floats]:
        return means((np.abs(part[wanted]) for part in parts(table)), n)

    far = where & np.concatenate([swing > SWING_DPS for swing in level()])
    if not far.any():
        return [], 0.0
    over = [swing > OVER_DEMAND * asked for swing, asked in zip(level(), demand(), strict=True)]
    spans = lasting(table.t, far & (np.concatenate(over) | _exhausted(table, n, *limit)), _SWING_S)
    if not spans:
        return [], 0.0
    swung = during(spans, table.t)
    if not _to_and_fro((table[rate] - table[wanted])[swung]):
        return [], 0.0
    return spans, top(np.concatenate(list(level()))[swung], 0.9)


def _exhausted(table: Table, n: int, output: str, most: float) -> Bools:
    """Where the controller asks for more than the vehicle can give: then the demand swings with it."""
    if output not in table.columns:
        return np.zeros(len(table), dtype=bool)
    asked = means((np.abs(part[output]) for part in parts(table)), n)
    return np.concatenate([level > most for level in asked])


def _to_and_fro(error: Floats) -> bool:
    """Whether an error changes its side: often, or, in a log too slow to show each swing, so that it comes out even."""
    turns = int((np.diff(np.sign(error)) != 0).sum())
    often = turns > _TURNS * (len(error) - 1)
    return often or (turns >= 2 and abs(float(np.mean(error))) < _EVEN * float(np.mean(np.abs(error))))


def _came_down(flight: Flight, swings: list[Span]) -> bool:
    """Whether it was on the ground and could not rise when, or soon after, it swung, and did not fall at once: that is
    a part that broke."""
    if flight.stranded is None or flight.lost_control_s is not None:
        return False
    return swings[0][0] < flight.stranded[0] <= swings[-1][1] + _SWING_S


def _spent(flight: Flight, swings: list[Span]) -> float:
    """Seconds in which the motors give all that they have after the vehicle began to swing and while it does.

    To keep the attitude the mixer gives up height first (AP_MotorsMatrix: the throttle makes room for roll and pitch).
    """
    start, end = swings[0][0], swings[-1][1]
    full = saturated(flight)
    if not full or full[0][0] < start:
        return 0.0
    return sum(max(0.0, min(b, end) - a) for a, b in full)


CHECK = Check("attitude", "control lost, an attitude off its demand, oscillation", READS, LIMITS, find)
