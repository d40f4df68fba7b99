"""What a rover's outputs are set to against how it answers to them: trims, ends, and the tightest turn.

A rover records what each output is told (RCOU) and how it turns and speeds up. Where the turn rate is none while it
drives, the steering is straight; where its speed neither grows nor falls but by what it loses of itself, the throttle
is neutral: both follow by least squares from an ordinary drive, whatever SERVOn_TRIM says (SRV_Channel.cpp, pwm from a
scaled value: the trim is the output at nothing asked).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding, Severity
from care_core.logs.base import Wanted
from care_core.metadata.ardupilot import firmware_default
from care_core.metadata.output_functions import LEFT, RIGHT, STEERING, THROTTLE
from care_core.numbers import Bools, Floats
from care_core.records import Record
from care_core.run import shown

READS: Wanted = {
    "RCOU": tuple(f"C{n}" for n in range(1, 15)),
    "THR": ("ThrOut", "DesSpeed", "Speed"),
    "STER": ("TurnRate", "DesTurnRate"),
}

LIMITS = Limits()
_MOVES_MS = LIMITS.add("speed of a rover that drives", 0.5, "m/s", "a choice: above the noise of the estimate")
_EVERY_S = LIMITS.add("time between the records that are compared", 0.4, "s", "a choice: a rover answers within it")
_RECORDS = LIMITS.add("fewest of them", 20.0, "", "a choice: some seconds of driving")
_TURNS_SO = LIMITS.add(
    "share of the turn rate that the outputs explain", 0.8, "", "a choice: simulated drives have 0.99"
)
_SPEEDS_UP_SO = LIMITS.add("share of the acceleration that the outputs explain", 0.5, "", "a choice: hills and gusts")
_OFF_US = LIMITS.add("trim off what was measured", 50.0, "us", "26 at most in 541 drives with right trims")
_SURELY = LIMITS.add(
    "errors of the measurement that it is off by", 4.0, "", "a choice: chance seldom gives more than two"
)
_LOSES = LIMITS.add(
    "the same that surely loses a drive", 100.0, "us", "all 10 simulated drives that were off by as much"
)
_AS_DEFAULT = LIMITS.add(
    "share of it within which the default is meant",
    0.25,
    "",
    "a choice: the measurement tells no better how far it is off",
)
_NARROW = LIMITS.add("least travel of an output", 0.85, "", "a choice: a share of that at its default")
_AT_END_US = LIMITS.add("output that is at its end", 2.0, "us", "a choice: outputs are rounded")
_LACKS = LIMITS.add("share of what is asked that is too little", 0.8, "", "a choice: what follows lags behind by less")
_LACKS_FOR = LIMITS.add(
    "share of the drive for which it lacks", 0.1, "", "a choice: starts and tight turns reach an end for less"
)
_TIMES = LIMITS.add("times the tightest turn that TURN_RADIUS is off", 2.0, "", "a choice: loads and ground change it")
_ASKED = LIMITS.add("share of its travel that the steering used", 0.3, "", "a choice: what is steered less tells less")
_SURE_P = LIMITS.add("probability of a trim", 0.95, "", "it is measured")
_ENDS_P = LIMITS.add("probability of an end", 0.85, "", "a choice: a weak motor would need it, too")
_RADIUS_P = LIMITS.add("probability of TURN_RADIUS", 0.9, "", "it is measured")
_RADIUS_LOST_P = LIMITS.add("probability that it costs the mission", 0.3, "", "a choice: corners alone suffer")

_MIDDLE_US = 1500.0


class Neutral(Record):
    """An output and where the vehicle shows its neutral to be."""

    what: str
    parameter: str
    trim: float
    measured: float
    """Microseconds."""
    default: float | None

    @property
    def off_us(self) -> float:
        """By how much the trim is off."""
        return abs(self.measured - self.trim)

    @property
    def wanted(self) -> float:
        """The trim that follows: the default where that is meant."""
        is_default = self.default is not None and abs(self.measured - self.default) <= _AS_DEFAULT * self.off_us
        return self.default if is_default and self.default is not None else float(round(self.measured))


class _Drive(Record):
    """A drive at times that are evenly apart."""

    t: Floats
    outputs: dict[int, Floats]
    speed: Floats
    wanted_speed: Floats
    turn_dps: Floats
    wanted_dps: Floats
    gains_ms2: Floats


def find(flight: Flight) -> Iterator[Finding]:
    """Trims and ends of the outputs that drive and steer, and a tightest turn that is not the vehicle's."""
    drive = _drive(flight)
    if drive is None:
        return
    off = list(_wrong(flight, drive))
    yield from (_trim_finding(one, drive) for one in off)
    if not off:
        yield from _ends(flight, drive)
    yield from _radius(flight, drive)


def wrong_neutrals(flight: Flight) -> tuple[Neutral, ...]:
    """The outputs whose trim is not what the vehicle shows."""
    drive = _drive(flight)
    return () if drive is None else tuple(_wrong(flight, drive))


def _drive(flight: Flight) -> _Drive | None:
    driven, steered, told = flight.one("THR", *READS["THR"]), flight.one("STER", *READS["STER"]), flight.one("RCOU")
    if flight.kind != "rover" or driven is None or steered is None or told is None or len(driven.t) < _RECORDS:
        return None
    t = np.arange(driven.t[0], driven.t[-1], _EVERY_S)
    t = t[flight.drives_itself(t)]
    if len(t) < _RECORDS:
        return None
    ahead, behind = (np.interp(t + sign * _EVERY_S / 2, driven.t, driven["Speed"]) for sign in (1, -1))
    return _Drive(
        t,
        {n: np.interp(t, told.t, told[f"C{n}"]) for n in range(1, 15) if f"C{n}" in told.columns},
        np.interp(t, driven.t, driven["Speed"]),
        np.interp(t, driven.t, driven["DesSpeed"]),
        np.interp(t, steered.t, steered["TurnRate"]),
        np.interp(t, steered.t, steered["DesTurnRate"]),
        (ahead - behind) / _EVERY_S,
    )


def _wrong(flight: Flight, drive: _Drive) -> Iterator[Neutral]:
    measured = [*_straight(flight, drive), *_at_rest(flight, drive), *_wheels_at_rest(flight, drive)]
    for what, output, at, error in measured:
        name = f"SERVO{output}_TRIM"
        trim, default = flight.setting(name), _default(flight, name)
        off = 0.0 if trim is None else abs(at - trim)
        if trim is None or off < max(_OFF_US, _SURELY * error):
            continue
        # a motor that needs a push to start has its neutral beside a right trim; no steering has
        if trim != default or what == "steering":
            yield Neutral(what, name, trim, at, default)


def _straight(flight: Flight, drive: _Drive) -> Iterator[tuple[str, int, float, float]]:
    """The steering's output at which it drives straight, with its error."""
    output = _output(flight, drive, STEERING)
    if output is None:
        return
    moves = drive.speed > _MOVES_MS
    told, speed = drive.outputs[output][moves] - _MIDDLE_US, drive.speed[moves]
    fit = _least_squares([speed * told, speed], drive.turn_dps[moves], _TURNS_SO)
    if fit is not None:
        yield "steering", output, *_crossing(fit, 0, 1)


def _at_rest(flight: Flight, drive: _Drive) -> Iterator[tuple[str, int, float, float]]:
    """The throttle's output at which it is not driven."""
    output = _output(flight, drive, THROTTLE)
    if output is None:
        return
    told = drive.outputs[output] - _MIDDLE_US
    fit = _least_squares([told, np.ones_like(told), drive.speed], drive.gains_ms2, _SPEEDS_UP_SO)
    if fit is not None:
        yield "throttle", output, *_crossing(fit, 0, 1)


def _wheels_at_rest(flight: Flight, drive: _Drive) -> Iterator[tuple[str, int, float, float]]:
    """The outputs of a skid-steered vehicle at which it neither turns nor is driven."""
    left, right = _output(flight, drive, LEFT), _output(flight, drive, RIGHT)
    if left is None or right is None:
        return
    told = [drive.outputs[n] - _MIDDLE_US for n in (left, right)]
    ones = np.ones_like(told[0])
    turning = _least_squares([*told, ones], drive.turn_dps, _TURNS_SO)
    driving = _least_squares([*told, ones, drive.speed], drive.gains_ms2, _SPEEDS_UP_SO)
    if turning is None or driving is None:
        return
    both = np.array([turning[0][:2], driving[0][:2]])
    if abs(np.linalg.det(both)) < 1e-12:
        return
    at = _MIDDLE_US + np.linalg.solve(both, [-turning[0][2], -driving[0][2]])
    inverse = np.linalg.inv(both) ** 2
    errors = np.sqrt(inverse @ [turning[1][2, 2], driving[1][2, 2]])
    yield "left wheels", left, float(at[0]), float(errors[0])
    yield "right wheels", right, float(at[1]), float(errors[1])


def _least_squares(columns: Sequence[Floats], wanted: Floats, least: float) -> tuple[Floats, Floats] | None:
    """Coefficients and their covariance; None where the columns explain less than this share of what is wanted."""
    a = np.column_stack(columns)
    if len(a) < _RECORDS or not np.isfinite(a).all() or np.linalg.matrix_rank(a) < a.shape[1]:
        return None
    found: Floats = np.linalg.lstsq(a, wanted, rcond=None)[0].astype(np.float64)
    rest, whole = float(np.var(wanted - a @ found)), float(np.var(wanted))
    if not whole or 1.0 - rest / whole < least:
        return None
    return found, np.linalg.inv(a.T @ a) * rest


def _crossing(fit: tuple[Floats, Floats], slope: int, level: int) -> tuple[float, float]:
    """The output (microseconds) at which the fit crosses zero, with its error."""
    (k, c), spread = fit[0][[slope, level]], fit[1][np.ix_([slope, level], [slope, level])]
    by = np.array([c / k**2, -1.0 / k])
    return _MIDDLE_US - float(c / k), float(np.sqrt(by @ spread @ by))


def _trim_finding(one: Neutral, drive: _Drive) -> Finding:
    severity: Severity = "critical" if one.off_us >= _LOSES else "warning"
    shows = "it drives straight" if one.what == "steering" else "nothing is driven"
    default = "" if one.default is None else f" (default {shown(one.default)})"
    return Finding(
        kind="drive",
        title=f"the trim of the {one.what} is not its middle",
        onset_s=float(drive.t[0]),
        end_s=float(drive.t[-1]),
        severity=severity,
        evidence=(
            f"{shows} at {one.measured:.0f} us, and {one.parameter} is {shown(one.trim)}{default}: off by "
            f"{one.off_us:.0f} us (limit {_OFF_US:g})"
        ),
        source="RCOU against STER.TurnRate and THR.Speed; PARM",
        suspect="parameter",
        probability=_SURE_P,
        parameters=(one.parameter,),
        wanted=((one.parameter, one.wanted),),
    )


def _ends(flight: Flight, drive: _Drive) -> Iterator[Finding]:
    """An end of an output that is nearer than by default, and keeps the vehicle from what it is asked for."""
    slow = (np.abs(drive.wanted_speed) > _MOVES_MS) & (np.abs(drive.speed) < _LACKS * np.abs(drive.wanted_speed))
    turns = np.abs(drive.wanted_dps) > np.degrees(_MOVES_MS) / 10
    wide = turns & (np.abs(drive.turn_dps) < _LACKS * np.abs(drive.wanted_dps))
    for function, lacks in ((STEERING, wide), (THROTTLE, slow), (LEFT, slow | wide), (RIGHT, slow | wide)):
        output = _output(flight, drive, function)
        for end in ("MIN", "MAX") if output is not None else ():
            name = f"SERVO{output}_{end}"
            value, default, trim = flight.setting(name), _default(flight, name), flight.setting(f"SERVO{output}_TRIM")
            if value is None or default is None or trim is None or output is None:
                continue
            if abs(value - trim) >= _NARROW * abs(default - trim):
                continue
            at_end: Bools = np.abs(drive.outputs[output] - value) <= _AT_END_US
            share = float(np.mean(at_end & lacks))
            if share >= _LACKS_FOR:
                yield _end_finding(drive, name, value, default, share)


def _end_finding(drive: _Drive, name: str, value: float, default: float, share: float) -> Finding:
    return Finding(
        kind="drive",
        title="an output ends before what it is asked for",
        onset_s=float(drive.t[0]),
        end_s=float(drive.t[-1]),
        severity="critical",
        evidence=(
            f"{name} is {shown(value)} (default {shown(default)}): for {share:.0%} of the drive the output is at it, "
            f"while the vehicle is slower or turns less than it is asked to (limit {_LACKS_FOR:.0%})"
        ),
        source="RCOU, THR, STER; PARM",
        suspect="parameter",
        probability=_ENDS_P,
        parameters=(name,),
        wanted=((name, default),),
    )


def _radius(flight: Flight, drive: _Drive) -> Iterator[Finding]:
    """TURN_RADIUS against the turn that the steering gives at its end."""
    output, said = _output(flight, drive, STEERING), flight.setting("TURN_RADIUS")
    if output is None or not said:
        return
    moves = drive.speed > _MOVES_MS
    told, speed = drive.outputs[output][moves] - _MIDDLE_US, drive.speed[moves]
    fit = _least_squares([speed * told, speed], np.radians(drive.turn_dps[moves]), _TURNS_SO)
    low, high = flight.setting(f"SERVO{output}_MIN"), flight.setting(f"SERVO{output}_MAX")
    if fit is None or low is None or high is None or high <= low:
        return
    if np.ptp(told) < _ASKED * (high - low):
        return
    tightest = 1.0 / abs(float(fit[0][0]) * (high - low) / 2.0)
    if not (said > _TIMES * tightest or said < tightest / _TIMES) or said == _default(flight, "TURN_RADIUS"):
        return
    yield Finding(
        kind="drive",
        title="the tightest turn is not TURN_RADIUS",
        onset_s=float(drive.t[0]),
        end_s=float(drive.t[-1]),
        severity="warning",
        evidence=(
            f"at full steering it turns with a radius of {tightest:.1f} m, and TURN_RADIUS is {said:g} m "
            f"(limit: {_TIMES:g} times)"
        ),
        source="RCOU against STER.TurnRate and THR.Speed; PARM",
        suspect="parameter",
        probability=_RADIUS_P,
        mission_lost=_RADIUS_LOST_P,
        parameters=("TURN_RADIUS",),
        wanted=(("TURN_RADIUS", float(f"{tightest:.2g}")),),
    )


def _output(flight: Flight, drive: _Drive, function: int) -> int | None:
    """The first recorded output with a function."""
    return next((n for n in drive.outputs if flight.setting(f"SERVO{n}_FUNCTION") == function), None)


def _default(flight: Flight, name: str) -> float | None:
    settings = flight.settings.get(name)
    recorded = settings[0].default if settings else None
    return float(recorded) if isinstance(recorded, (int, float)) else firmware_default(name, flight.kind)


CHECK = Check(
    "outputs",
    "trims and ends of a rover's outputs, and a tightest turn, that are not the vehicle's",
    READS,
    LIMITS,
    find,
)
