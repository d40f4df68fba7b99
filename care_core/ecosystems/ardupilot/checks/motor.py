"""Loss of a motor, its controller or its propeller: which, from what the outputs ask of each.

In level flight all motors share the load. One that gives less thrust is asked for more, alone, until it is at its
limit; then the vehicle tips towards it although it is asked for all that it has. The firmware's own check says so after
a second (thrust_loss_check of crash_check.cpp), and a controller with telemetry shows it in its speed.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from care_core.ecosystems import lost_motor
from care_core.ecosystems.ardupilot.airborne import FOLLOWED_DEG
from care_core.ecosystems.ardupilot.checks import bench
from care_core.ecosystems.ardupilot.checks.thrust import climbs, saturated
from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.ardupilot.statistics import calibrated, calibrated_probability, lasting, means, records
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding, Severity
from care_core.ecosystems.lost_motor import Commands, driven_hardest
from care_core.ecosystems.spans import during, within
from care_core.ecosystems.vehicles import Motor, motors_of
from care_core.ecosystems.vehicles.frames import motors_said
from care_core.logs.base import Table, Wanted
from care_core.numbers import Bools, Floats, median, pieces, quantile
from care_core.records import Record

READS: Wanted = {
    "RCOU": tuple(f"C{n}" for n in range(1, 15)),
    "ATT": ("Roll", "Pitch", "Yaw", "DesRoll", "DesPitch", "DesYaw"),
    "ESC": ("RPM",),
    "GPS": ("Spd",),
}

LIMITS = Limits(lost_motor.LIMITS)
ALONE = LIMITS.add(
    "output of one motor above its peers", 0.08, "of the range",
    "in nine of ten healthy training flights none is 0.02 above; a twisted arm or an uneven load moves motors in pairs",
)  # fmt: skip
_IN_PAIRS = LIMITS.add(
    "motors from which loads show in pairs", 4, "", "geometry: of three, one alone holds up the end that a load lies at"
)
_NEXT = LIMITS.add("share of that which the next motor may have", 0.6, "", "a choice: one motor, not a pair")
_PAIR = LIMITS.add(
    "share of that which the motor across may have",
    0.4,
    "",
    "geometry: for a weak motor the one across is asked for less",
)
_ACROSS_DEG = LIMITS.add("angle off the arm across", 20.0, "deg", "a choice: frames are not all square")
_ROOM = LIMITS.add(
    "output of the peers on the ground", 0.7, "of the range", "a choice: above it all are at their limit"
)
_ROOM_FLYING = LIMITS.add(
    "output of the peers in the air", 0.85, "of the range", "a choice: above it all have too little"
)
_STEADY = LIMITS.add("excess over its swings", 2.0, "", "a choice: what oscillates has all motors up in turn")
_WINDOW_S = LIMITS.add("window of an excess", 4.0, "s", "a choice: a turn is over sooner")
_STAYS = LIMITS.add("share of the rest of the flight", 0.7, "", "a choice: a weak motor stays weak")
_RECORDS = LIMITS.add(
    "records that tell of one", 16, "", "a choice: of fewer, once a second, a swing of the controller is as well one"
)
_LASTS_S = LIMITS.add("shortest excess", 4.0, "s", "a choice: a turn is over sooner")
_TRYING_S = LIMITS.add("first seconds of trying to lift", 12.0, "s", "a choice: then integrators wind up")
_LIFTING = LIMITS.add("output that lifts", 0.2, "of the range", "a choice: armed motors idle below it")
_TRIES = LIMITS.add("throttle that tries to lift", 0.1, "of the range", "a choice: MOT_SPIN_MIN is 0.15 as shipped")
_IDLES = LIMITS.add("throttle of what lies on the ground", 0.15, "of the range", "MOT_SPIN_MIN as shipped: 0.15")
_HOVERS_MS = LIMITS.add("speed at which a QuadPlane hovers", 6.0, "m/s", "a choice: faster, its wing lifts part of it")
_FAST_MS = LIMITS.add("speed at which a copter is far from hovering", 20.0, "m/s", "WPNAV_SPEED: 20 at most")
_UPRIGHT_DEG = LIMITS.add("lean of what still flies", 60.0, "deg", "a choice: beyond it motors are told to right it")
_CALM_DEG = LIMITS.add("attitude error before control was lost", 12.0, "deg", "a choice: what drifts off lost no motor")
_TIPS_DEG = LIMITS.add("lean off the demand towards a motor", 10.0, "deg", "a choice: less points nowhere")
_TOWARDS = LIMITS.add("share of a motor in that direction", 0.15, "", "a choice: it lies on that side")
_ASKED = LIMITS.add("output of a motor that gave nothing", 0.5, "of the range", "a choice: asked for much, and clearly")
_CLEARLY = LIMITS.add(
    "that output above its peers", 0.15, "of the range", "a choice: a load off its middle and wind take less"
)
_MOSTLY = LIMITS.add("share of records in which it is the highest", 0.6, "", "a choice: else motors take turns")
_LEANS_S = LIMITS.add("time over which its lean is taken", 0.3, "s", "a choice: then it turns")
_FALL_S = LIMITS.add("fall to the side that lost it", 1.2, "s", "a choice: then it tumbles")
_SWINGS_S = LIMITS.add(
    "time in which a swing comes back", 2.0, "s", "a choice: vehicles swing once a second and faster"
)
_ANSWERS_S = LIMITS.add("time to answer a new demand", 0.5, "s", "a choice: until then it is off it without a swing")
_AT_LIMIT = LIMITS.add("output at its limit", 0.97, "of the range", "a choice: outputs are rounded")
_LIMITED = LIMITS.add("critical share of the time at its limit", 0.2, "", "a choice: nothing is left to give")
_FAR = LIMITS.add("critical excess, in limits", 4.0, "", "a choice: no load off its middle asks for so much")
_FAR_LASTS_S = LIMITS.add("shortest critical excess", 2.0, "s", "a choice: a QuadPlane lands in seconds")
_CHANGED = LIMITS.add("share of an excess that it had before", 1 / 3, "", "a choice: then it was even")
_TURNS = LIMITS.add("share of the others' speed at which it stopped", 0.3, "", "a choice: idling is more")
_TURNING_RPM = LIMITS.add("speed of motors that turn", 1000.0, "1/min", "a choice: idling is more")
_TOLD_TO_TURN = LIMITS.add(
    "share of what the others are asked for at which it is to turn", 0.5, "", "a choice: what idles is asked for less"
)
_CALIBRATION = calibrated(
    LIMITS,
    ((1.0, 0.7), (2.0, 0.85)),
    "9 of 12 training flights with such a motor have a weak one, the other three fail for another part's sake",
    "the excess",
)
_ALWAYS = calibrated(
    LIMITS,
    ((1.0, 0.3), (2.0, 0.5)),
    "a choice: a twisted arm or an uneven load looks the same",
    "an excess from the start on",
)
_GAVE_LITTLE_P = LIMITS.add("probability where it fell towards a motor", 0.85, "", "a choice: outputs are told often")
_PERHAPS_P = LIMITS.add(
    "probability where it fell, of few records",
    0.6,
    "",
    "a choice: outputs that are told seldom may be those of the fall",
)
_REPORTED_P = LIMITS.add("probability of a reported thrust loss", 0.2, "", "a choice: it names who is asked for most")
_STOPPED_P = LIMITS.add("probability of a motor that stopped", 0.95, "", "its controller's own word")
_AROUND_S = 5.0
"""So long around what the firmware says, a vehicle flies about as it did."""
_THRUST_LOSS = re.compile(r"Potential Thrust Loss \((\d+)\)")
_SOURCE = "RCOU of each motor against the middle of the others"


class _Outputs(Record, eq=False):
    """What the motors were asked for, microseconds from the least to the most."""

    motors: tuple[Motor, ...]
    table: Table
    least: float
    most: float

    @property
    def t(self) -> Floats:
        return self.table.t

    def share(self, rows: Bools | slice) -> Floats:
        """What was asked in these rows, shape (motors, n): 0 idle, 1 the most it may give."""
        part = self.table.where(rows)
        share = np.array([part[_column(motor)] for motor in self.motors])
        share -= self.least
        share /= self.most - self.least
        return np.clip(share, 0.0, 1.0, out=share)


def find(flight: Flight) -> Iterator[Finding]:
    """The motor that does not give what is asked of it, by the strongest evidence."""
    outputs = _outputs(flight)
    if outputs is None or bench.unmoved(flight) is not None:
        return
    for test in (_stopped, _fell_towards, _driven_hardest, _weak, _reported):
        found = next(iter(test(flight, outputs)), None)
        if found is not None:
            yield found
            return


def _outputs(flight: Flight) -> _Outputs | None:
    table = flight.one("RCOU")
    if table is None or not (flight.is_copter or flight.kind == "quadplane"):
        return None
    motors = motors_of(flight.settings, flight.motor_outputs)
    if not motors and flight.is_copter:
        motors = _nameless(table.columns, motors_said(flight.log.facts.get("frame", "")))
    columns = [_column(motor) for motor in motors]
    if len(columns) < 3 or not all(column in table.columns for column in columns):
        return None
    low, high = _range(flight, float(np.max([np.max(table[column]) for column in columns])))
    if not np.isfinite(high - low) or high - low < 100:
        return None
    return _Outputs(motors, table, low, high)


def _column(motor: Motor) -> str:
    return f"C{motor.output}"


def _nameless(columns: Mapping[str, Floats], last: int) -> tuple[Motor, ...]:
    """The motors of a frame that the parameters do not tell: outputs in use up to the last one that may drive a motor,
    of unknown place. The first four to eight outputs move in flight, those of servos and unused ones do not."""
    used = [n for n in range(1, last + 1) if (column := columns.get(f"C{n}")) is not None and np.ptp(column) > 100]
    return tuple(Motor(n, n, 0.0, 0.0, 0.0, 0.0, "") for n in used) if len(used) >= 4 else ()


def _range(flight: Flight, seen: float) -> tuple[float, float]:
    """Pulse widths (microseconds) of an idle output and of the most that one may be asked for, `seen` at most."""
    low = flight.setting("MOT_PWM_MIN", "Q_M_PWM_MIN") or flight.setting("RC3_MIN", "THR_MIN_PWM") or 1000.0
    known = flight.setting("MOT_PWM_MAX", "Q_M_PWM_MAX") or flight.setting("RC3_MAX")
    high = known or 2000.0
    most = flight.setting("MOT_SPIN_MAX", "Q_M_SPIN_MAX")
    top = low + (high - low) * (most if most is not None and 0.5 < most <= 1.0 else 1.0)
    if known and flight.is_copter:
        return low, top
    # Lift motors are throttled where wings carry: what they are asked for at most is what they may be asked for.
    return low, min(top, max(seen, low + 0.6 * (high - low)))


def _lifting(flight: Flight, outputs: _Outputs) -> Bools:
    """Rows in which the motors lift it, upright, and nothing else holds it: in the air, or where it never left the
    ground the first seconds of trying, before the integrators wind up. What climbs with all its throttle lacks no
    thrust, and its mixer takes from some motors what the attitude wants of the others."""
    t = outputs.t
    lifting = flight.watch(t)
    for rows in pieces(len(t)):
        lifting[rows] &= median(outputs.share(rows), axis=0) > _LIFTING
    lifting &= ~during(flight.held, t)
    lifting &= ~during([span for span in saturated(flight) if climbs(flight, *span)], t)
    lifting &= _hovers(flight, t)
    if (tilt := flight.tilt) is not None:
        lifting &= np.interp(t, *tilt) < _UPRIGHT_DEG
    throttle = flight.throttle
    if flight.flown:
        if throttle is not None and flight.is_copter:  # what lies with its motors down rights itself in vain
            lifting &= np.interp(t, *throttle) > _IDLES
        return lifting & during(flight.flown, t)
    if (lean_error := flight.lean_error) is not None:  # what is held down is told to lean and does not
        lifting &= np.interp(t, *lean_error) < FOLLOWED_DEG
    if throttle is not None:  # what idles winds up its integrators against the ground
        lifting &= np.interp(t, *throttle) > _TRIES
    return lifting & (t < t[lifting][0] + _TRYING_S) if lifting.any() else lifting


def _hovers(flight: Flight, t: Floats) -> Bools:
    """When a vehicle is carried by its motors alone: a copter until it flies so fast that the air bears unevenly on
    its propellers."""
    moved = flight.one("GPS", "Spd")
    if moved is None:
        return np.full(len(t), flight.is_copter)
    return np.asarray(np.interp(t, moved.t, moved["Spd"]) < (_FAST_MS if flight.is_copter else _HOVERS_MS))


def _excess(outputs: _Outputs, where: Bools) -> Iterator[Floats]:
    """How far each motor stands above the middle of the others in the rows of a mask, piece by piece of them, shape
    (motors, n)."""
    everyone = np.arange(len(outputs.motors))
    for rows in pieces(len(where)):
        share = outputs.share(rows)[:, where[rows]]
        yield np.array([share[n] - median(share[everyone != n], axis=0) for n in everyone])


def _smooth_excess(outputs: _Outputs, where: Bools, window: int) -> Iterator[Floats]:
    """The same as means over a window, which does not lie across a flight on wings or a pause of the record."""
    rows = np.flatnonzero(where)
    for unbroken in np.split(rows, np.flatnonzero(np.diff(outputs.t[rows]) > _WINDOW_S) + 1):
        held = np.zeros(len(where), dtype=bool)
        held[unbroken] = True
        yield from means(_excess(outputs, held), window)


def _joined(parts: Iterable[NDArray[Any]]) -> NDArray[Any]:
    """Pieces of shape (motors, n) as one array."""
    return np.concatenate([*parts], axis=1)


def _of_one(parts: Iterable[Floats], n: int) -> Floats:
    """What pieces of shape (motors, n) hold of one motor."""
    return np.concatenate([part[n] for part in parts])


def _weak(flight: Flight, outputs: _Outputs) -> Iterator[Finding]:
    """One motor lastingly above all the others."""
    lifting = _lifting(flight, outputs)
    if lifting.sum() < _RECORDS:
        return
    t = outputs.t[lifting]
    window = records(t, _WINDOW_S)
    is_alone, is_above, is_far = [], [], []
    for piece in _smooth_excess(outputs, lifting, window):
        order = np.sort(piece, axis=0)
        is_alone.append((piece > ALONE) & (piece >= order[-1] - 1e-9) & (order[-2] < _NEXT * piece))
        is_above.append(piece > ALONE / 2)
        is_far.append(piece > _FAR * ALONE)
    best: tuple[float, int, float, float] | None = None
    for n, (alone, above, far) in enumerate(zip(*map(_joined, (is_alone, is_above, is_far)), strict=True)):
        spans = lasting(t, alone, _LASTS_S, gap_s=3.0) or lasting(t, alone & far, _FAR_LASTS_S)
        if not spans:
            continue
        since = lifting & (outputs.t >= spans[0][0])
        share = outputs.share(since)
        asked = _of_one(_excess(outputs, since), n)
        size = float(median(asked))
        across = _across(outputs.motors, n)
        if across is not None and float(median(_of_one(_excess(outputs, since), across))) > _PAIR * size:
            continue  # both that turn one way: what turns against its will, not one that is weak
        stays = float(above[t >= spans[0][0]].mean()) > _STAYS
        swings = float(np.std(asked - _of_one(_smooth_excess(outputs, since, window), n)))  # not what grows
        steady = size > max(0.7 * ALONE, _STEADY * swings)
        has_room = float(median(np.delete(share, n, axis=0))) < (_ROOM_FLYING if flight.flown else _ROOM)
        if stays and steady and has_room and (best is None or size > best[0]):
            best = (size, n, spans[0][0], spans[-1][1])
    if best is None:
        return
    size, n, start, end = best
    share = outputs.share(lifting & (outputs.t >= start))
    limit = float((share[n] > _AT_LIMIT).mean())
    before = _of_one(_smooth_excess(outputs, lifting, window), n)[t < start - 2.0]
    changed = len(before) >= 5 and float(median(before)) < size * _CHANGED
    if not changed and len(outputs.motors) < _IN_PAIRS:
        return
    over = size / ALONE
    yield _finding(
        outputs.motors[n], "lost thrust" if changed or over > 2 else "works harder than the others", start, end,
        _severity(flight, limit, size) if changed or over > 2 else "warning",
        f"it is asked for {100 * median(share[n]):.0f}% where the others are at "
        f"{100 * median(np.delete(share, n, axis=0)):.0f}% (limit: {100 * ALONE:.0f} points above them)"
        + ("; before, they were even" if changed else "")
        + (f"; at its limit {100 * limit:.0f}% of the time" if limit > 0.05 else ""),
        _SOURCE, calibrated_probability(over, _CALIBRATION if changed or over > 2 else _ALWAYS),
    )  # fmt: skip


def _across(motors: tuple[Motor, ...], n: int) -> int | None:
    """The motor of a quadcopter that sits across from one and turns as it does; None of any other frame."""
    if len(motors) != _IN_PAIRS or not all(motor.place for motor in motors):
        return None
    off = [abs((motor.angle_deg - motors[n].angle_deg) % 360 - 180) for motor in motors]
    return int(np.argmin(off)) if min(off) < _ACROSS_DEG else None


def _severity(flight: Flight, limit: float, size: float) -> Severity:
    """Critical where it has nothing left to give, or where control was lost after it."""
    lost = flight.lost_control_s is not None or flight.impact_s is not None
    return "critical" if lost or limit > _LIMITED or size > _FAR * ALONE else "warning"


def _fell_towards(flight: Flight, outputs: _Outputs) -> Iterator[Finding]:
    """Control was lost towards a motor that was asked for more than the others, at or near its limit."""
    lost = flight.lost_control_s
    table = flight.one("ATT", "Roll", "Pitch", "DesRoll", "DesPitch")
    if (
        lost is None
        or table is None
        or not flight.airborne
        or flight.struck_s is not None
        or not _was_calm(flight, lost)
    ):
        return
    rows = (table.t >= lost - 0.3) & (table.t <= lost + _FALL_S)
    if not rows.any():
        return
    roll = float(np.mean((table["Roll"] - table["DesRoll"])[rows]))
    pitch = float(np.mean((table["Pitch"] - table["DesPitch"])[rows]))
    if np.hypot(roll, pitch) < _TIPS_DEG or _swung_over(table, lost, roll, pitch):
        return
    down = flight.impact_s if flight.impact_s is not None else lost + 2.0
    windows = ((lost - 0.2, lost + 0.8), (lost - 1.0, max(lost, min(lost + 2.0, down))), (lost - 3.0, lost + 2.0))
    near = [(outputs.t >= start) & (outputs.t <= end) for start, end in windows]
    asked = next((rows for rows in near if rows.sum() >= 3), near[-1])
    if not asked.any():
        return
    asked_of = outputs.share(asked)
    share = median(asked_of, axis=1)
    # A motor pushes its own corner up: where it gives too little, that corner goes down.
    towards = np.array([-(motor.roll * roll + motor.pitch * pitch) for motor in outputs.motors]) / np.hypot(roll, pitch)
    score = np.where(towards > _TOWARDS, share, -1.0)
    n = int(np.argmax(score + 0.2 * towards))
    others = np.delete(share, n)
    if score[n] < _ASKED or share[n] - float(median(others)) < _CLEARLY:
        return
    most = np.argmax(asked_of, axis=0) == n
    if most.mean() < _MOSTLY:  # asked for in turn with others: an oscillation
        return
    around = (outputs.t > lost - 2.0) & (outputs.t <= lost + 1.0)
    shares = outputs.share(around)
    begin = outputs.t[around][(shares[n] > _AT_LIMIT) & (median(np.delete(shares, n, axis=0), axis=0) < _AT_LIMIT)]
    yield _finding(
        outputs.motors[n], "gave too little thrust", min(float(begin[0]) if len(begin) else lost, lost), lost + 1.0,
        "critical",
        f"asked for {100 * share[n]:.0f}% (others {100 * median(others):.0f}%), yet the vehicle fell towards it: "
        f"{roll:+.0f} degrees of roll and {pitch:+.0f} of pitch off the demand",
        f"{_SOURCE}, and ATT", _GAVE_LITTLE_P if near[0].sum() > 3 else _PERHAPS_P,
    )  # fmt: skip


def _swung_over(table: Table, lost: float, roll: float, pitch: float) -> bool:
    """Whether it was as far off its demand to the other side just before: the corner of a motor that gives nothing
    sinks from the first, what swings goes to and fro. A demand that has just leapt makes no swing."""
    t = table.t
    rows = (t >= lost - _SWINGS_S) & (t < lost - _LEANS_S)

    def towards(asked: Floats) -> Floats:
        """How far it is off what was asked for then, to the side to which it falls."""
        off_roll = table["Roll"] - np.interp(asked, t, table["DesRoll"])
        off_pitch = table["Pitch"] - np.interp(asked, t, table["DesPitch"])
        return np.asarray((roll * off_roll + pitch * off_pitch)[rows] / np.hypot(roll, pitch))

    swings = np.maximum(towards(t), towards(t - _ANSWERS_S))
    return bool(len(swings)) and float(np.min(swings)) < -_TIPS_DEG


def _driven_hardest(flight: Flight, outputs: _Outputs) -> Iterator[Finding]:
    """The motor that was driven hardest, alone, just before control was lost, and was the first near its limit."""
    lost, table = flight.lost_control_s, flight.one("ATT", "Roll", "Pitch", "DesRoll", "DesPitch")
    if (
        lost is None
        or table is None
        or not flight.airborne
        or flight.struck_s is not None
        or not _was_calm(flight, lost)
    ):
        return
    rows = (table.t >= lost) & (table.t <= lost + _LEANS_S)
    around = np.abs(outputs.t - lost) < _FALL_S + _WINDOW_S
    if not rows.any() or not around.any():
        return
    # Nose up is a fall backwards, right side down one to the right.
    fall = (
        -float(np.mean((table["Pitch"] - table["DesPitch"])[rows])),
        float(np.mean((table["Roll"] - table["DesRoll"])[rows])),
    )
    if any(fall) and _swung_over(table, lost, fall[1], -fall[0]):
        return
    numbers = tuple(motor.number for motor in outputs.motors)
    commands = Commands(outputs.t[around], outputs.share(around), numbers)
    arms = {motor.number: motor.angle_deg for motor in outputs.motors if motor.place}
    hardest = driven_hardest(commands, lost, fall, arms)
    if hardest is not None:
        yield Finding(
            kind="motor",
            title=hardest.title(outputs.motors),
            onset_s=min(hardest.near_s, lost),
            end_s=lost,
            severity="critical",
            evidence=hardest.evidence,
            source=f"{_SOURCE}, and ATT",
            probability=lost_motor.PROBABILITY,
        )


def _was_calm(flight: Flight, lost: float) -> bool:
    """Whether it hovered and followed its attitude until shortly before: what swings or drifts off lost no motor."""
    error = flight.lean_error
    if error is None or not _hovers(flight, np.array([lost]))[0]:
        return False
    before = error[1][(error[0] >= lost - 6.0) & (error[0] <= lost - 0.6)]
    return len(before) < 2 or quantile(before, 0.8) < _CALM_DEG


def _reported(flight: Flight, outputs: _Outputs) -> Iterator[Finding]:
    """The firmware's thrust loss check, which names the motor that is asked for most. Where another is asked for as
    much, as when it turns against its will, neither is weak."""
    for t, text in flight.messages:
        match = _THRUST_LOSS.search(text)
        if match and within(flight.armed, t):
            motor = next((one for one in outputs.motors if one.number == int(match[1])), None)
            near = np.abs(outputs.t - t) < _AROUND_S
            excess = median(_joined(_excess(outputs, near)), axis=1) if near.any() else np.zeros(len(outputs.motors))
            own = float(excess[outputs.motors.index(motor)]) if motor is not None else 0.0
            is_alone = own > ALONE and float(np.sort(excess)[-2]) < _NEXT * own
            crowded = float(median(outputs.share(near))) > _ROOM if near.any() else True
            if motor is not None and not crowded and is_alone:
                severity: Severity = "critical" if flight.impact_s is not None else "warning"
                yield _finding(motor, "lost thrust", t, flight.end_s, severity, f"the firmware says: {text}",
                               "MSG; thrust_loss_check of ArduCopter", _REPORTED_P)  # fmt: skip
                return


def _stopped(flight: Flight, outputs: _Outputs) -> Iterator[Finding]:
    """A speed controller that reports no rotation while the others turn, and its motor is told to."""
    speeds = flight.all("ESC", "RPM")
    if len(speeds) < 3:
        return
    t = speeds[0].t
    rpm = np.stack([np.interp(t, one.t, one["RPM"]) for one in speeds])
    usual = median(rpm, axis=0)
    turning = (usual > _TURNING_RPM) & flight.watch(t)
    asked = np.stack([np.interp(t, outputs.t, share) for share in outputs.share(slice(None))])
    enough = _TOLD_TO_TURN * median(asked, axis=0)
    for n, (row, share) in enumerate(zip(rpm, asked, strict=False)):
        is_asked = share > enough
        if spans := lasting(t, (row < _TURNS * usual) & turning & is_asked, 0.5):
            yield _finding(outputs.motors[n], "stopped", spans[0][0], spans[-1][1], "critical",
                           f"its controller reports {median(row[t >= spans[0][0]]):.0f} turns a minute, the others "
                           f"{median(usual):.0f}", "ESC.RPM", _STOPPED_P)  # fmt: skip
            return


def _finding(
    motor: Motor, what: str, start: float, end: float, severity: Severity, evidence: str, source: str,
    probability: float,
) -> Finding:  # fmt: skip
    place = f" ({motor.place})" if motor.place else ""
    title = f"motor {motor.number}{place} {what}"
    return Finding(
        kind="motor",
        title=title,
        onset_s=start,
        end_s=max(end, start),
        severity=severity,
        evidence=evidence,
        source=source,
        probability=probability,
    )


CHECK = Check("motor", "a motor, controller or propeller that gives too little thrust", READS, LIMITS, find)
