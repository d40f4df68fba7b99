"""Where the motors' noise stands in the gyros' spectrum, against the notch and the low pass that are to take it out.

A spectrum needs samples at the gyros' own rate: the batches of INS_LOG_BAT_MASK (ISBH, ISBD), or GYR of
INS_RAW_LOG_OPT. A harmonic notch takes out what lies within its bandwidth, of every harmonic as much wider as it is
higher, about a centre that is fixed or follows the throttle (AP_InertialSensor, HarmonicNotchFilter). One that follows
the motors' speed, or a spectrum of the firmware's own, knows better where to stand.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.spans import during
from care_core.logs.base import Wanted
from care_core.numbers import Floats, median
from care_core.run import shown

READS: Wanted = {
    "ISBH": ("N", "type", "instance", "mul", "smp_cnt", "smp_rate"),
    "ISBD": ("N", "seqno", "x", "y", "z"),
    "GYR": ("SampleUS", "GyrX", "GyrY", "GyrZ"),
    "CTUN": ("ThO",),
}

LIMITS = Limits()
_LOWEST_HZ = LIMITS.add("lowest frequency of motors", 40.0, "Hz", "a choice: below it the vehicle itself moves")
_STRONG_DPS = LIMITS.add(
    "noise of a line of the spectrum",
    3.0,
    "deg/s",
    "a choice: thirty times a gyro's own (0.005 deg/s/sqrt(Hz))",
)
_STANDS_OUT = LIMITS.add("times what is between the lines", 10.0, "", "a choice: noise without a line varies by less")
_SURE_P = LIMITS.add("probability of a notch or a low pass beside its noise", 0.8, "", "it is measured")
_LOST_P = LIMITS.add("probability that it costs the mission", 0.1, "", "a choice: most vehicles fly on with it")
_WIDE = 0.05
"""A line of motors that do not turn alike is so wide, each way, as a share of its frequency."""
_SAMPLES, _MOST_PIECES = 1024, 48
_GYRO = 1.0
"""ISBH.type of gyros (AP_InertialSensor: IMU_SENSOR_TYPE)."""
_FIXED, _BY_THROTTLE = 0.0, 1.0
"""INS_HNTCH_MODE."""
_HARMONICS = 8
_FIRST_TWO = 3.0
"""INS_HNTCH_HMNCS as shipped."""


class Line(NamedTuple):
    """The strongest line of a spectrum."""

    hz: float
    noise_dps: float
    pieces: int


class Notch(NamedTuple):
    """A notch that stands where its parameters say."""

    name: str
    centre_hz: float
    width_hz: float
    harmonics: int
    """One bit each."""

    def takes(self, hz: float) -> bool:
        """Whether a frequency lies within a harmonic that is taken out."""
        return any(abs(hz / n - self.centre_hz) <= self.width_hz / 2 for n in self._harmonics(taken=True))

    def left(self, hz: float) -> int | None:
        """The harmonic that a frequency is, from 1, where that is not taken out."""
        return next((n for n in self._harmonics(taken=False) if abs(hz / n / self.centre_hz - 1) < _WIDE), None)

    def _harmonics(self, *, taken: bool) -> Iterator[int]:
        return (n for n in range(1, _HARMONICS + 1) if bool(self.harmonics >> (n - 1) & 1) is taken)


def find(flight: Flight) -> Iterator[Finding]:
    """The notch or the low pass that leaves the strongest line of the gyros' noise."""
    line = strongest_line(flight) if flight.is_copter and flight.flown else None
    notches = list(_notches(flight))
    if line is None or None in notches:
        return
    standing = [one for one in notches if one is not None]
    if any(one.takes(line.hz) for one in standing):
        return
    noise = f"the strongest line of the gyros' noise is at {line.hz:.0f} Hz, {line.noise_dps:.1f} deg/s"
    evidence = f"{noise} (limit {_STRONG_DPS:g}), in {line.pieces} pieces of the flight"
    if standing:
        yield _beside(flight, standing[0], line, evidence)
    elif (low_pass := _raised_low_pass(flight, line)) is not None:
        value = flight.setting("INS_GYRO_FILTER")
        evidence += f"; INS_GYRO_FILTER={shown(value)} lets it through (default {low_pass:g})"
        yield _finding(
            flight, "the gyros' low pass lets the motors' noise through", evidence, "INS_GYRO_FILTER", low_pass
        )


def _beside(flight: Flight, notch: Notch, line: Line, evidence: str) -> Finding:
    harmonic, title = notch.left(line.hz), "the notch is not where the gyros' noise is"
    where = f"{evidence}; {notch.name} stands at {notch.centre_hz:.0f} Hz, {notch.width_hz:.0f} Hz wide"
    if harmonic is not None:
        parameter, wanted = f"{notch.name}_HMNCS", float(notch.harmonics | 1 << (harmonic - 1))
        where += f", and {parameter}={notch.harmonics} leaves its harmonic {harmonic}"
    else:
        parameter = f"{notch.name}_FREQ"
        told = flight.setting(parameter) or notch.centre_hz
        wanted = float(round(line.hz * told / notch.centre_hz))
        where += f" in this flight ({parameter}={told:g})"
    return _finding(flight, title, where, parameter, wanted)


def _finding(flight: Flight, title: str, evidence: str, parameter: str, wanted: float) -> Finding:
    return Finding(
        kind="tuning",
        title=title,
        onset_s=flight.flown[0][0],
        end_s=flight.flown[-1][1],
        severity="warning",
        evidence=evidence,
        source="spectrum of ISBD or GYR in flight; PARM",
        suspect="parameter",
        probability=_SURE_P,
        mission_lost=_LOST_P,
        parameters=(parameter,),
        wanted=((parameter, wanted),),
    )


def _raised_low_pass(flight: Flight, line: Line) -> float | None:
    """The default of a low pass that was raised from below a line to above it."""
    default, value = flight.default_left("INS_GYRO_FILTER"), flight.setting("INS_GYRO_FILTER") or 0.0
    return default if default is not None and 0 < default < line.hz < value else None


def _notches(flight: Flight) -> Iterator[Notch | None]:
    """The notches that are on; None for one that follows what this log need not tell."""
    for name in ("INS_HNTCH", "INS_HNTC2"):
        centre, width = flight.setting(f"{name}_FREQ"), flight.setting(f"{name}_BW")
        if not flight.setting(f"{name}_ENABLE") or not centre or not width:
            continue
        mode, reference = flight.setting(f"{name}_MODE"), flight.setting(f"{name}_REF") or 0.0
        if mode not in (_FIXED, _BY_THROTTLE):
            yield None
            continue
        if mode == _BY_THROTTLE and reference > 0:
            least = flight.setting(f"{name}_FM_RAT") or 1.0
            times = max(least, math.sqrt(_throttle(flight) / reference))
            centre, width = centre * times, width * times
        harmonics = flight.setting(f"{name}_HMNCS")
        yield Notch(name, centre, width, int(_FIRST_TWO if harmonics is None else harmonics))


def _throttle(flight: Flight) -> float:
    """The throttle in the air."""
    if flight.throttle is None:
        return 0.0
    t, driven = flight.throttle
    flying = driven[during(flight.flown, t)]
    return max(float(median(flying)), 0.0) if len(flying) else 0.0


def strongest_line(flight: Flight) -> Line | None:
    """The strongest line of the gyros' noise in the air; None where nothing stands out, or none was sampled so fast."""
    pieces = list(_batches(flight)) or list(_stretches(flight))
    if not pieces:
        return None
    rate = float(median(np.array([hz for hz, _ in pieces])))
    alike = [samples for hz, samples in pieces if abs(hz - rate) < _WIDE * rate]
    power = np.mean([_power(samples, rate) for samples in alike], axis=0)
    hz = np.fft.rfftfreq(_SAMPLES, 1 / rate)
    band = (hz >= _LOWEST_HZ) & (hz <= 0.45 * rate)
    if band.sum() < _SAMPLES // 16:
        return None
    peak = float(hz[band][np.argmax(power[band])])
    line = np.abs(hz - peak) <= max(_WIDE * peak, 2 * rate / _SAMPLES)
    noise_dps = math.degrees(math.sqrt(float(power[line].sum()) * rate / _SAMPLES))
    stands_out = float(power[band].max()) > _STANDS_OUT * float(median(power[band]))
    return Line(peak, noise_dps, len(alike)) if stands_out and noise_dps > _STRONG_DPS else None


def _power(samples: Floats, rate_hz: float) -> Floats:
    """The one-sided power density of three axes together, (rad/s)^2 per hertz; `samples` is of shape (n, 3)."""
    window = np.hanning(len(samples))[:, None]
    spectrum = np.fft.rfft((samples - samples.mean(axis=0)) * window, axis=0)
    density: Floats = 2 * (np.abs(spectrum) ** 2).sum(axis=1) / (rate_hz * float((window**2).sum()))
    return density


Piece = tuple[float, Floats]
"""Samples a second, and so many of three axes in a row, rad/s."""


def _batches(flight: Flight) -> Iterator[Piece]:
    """The whole batches of the first gyro in the air."""
    heads, data = flight.one("ISBH", *READS["ISBH"]), flight.one("ISBD", *READS["ISBD"])
    if heads is None or data is None:
        return
    flying, order = during(flight.flown, heads.t), np.argsort(data["seqno"], kind="stable")
    wanted = (heads["type"] == _GYRO) & (heads["instance"] == 0) & (heads["smp_cnt"] >= _SAMPLES) & (heads["mul"] > 0)
    for row in _spread(np.flatnonzero(wanted & flying)):
        rows = order[data["N"][order] == heads["N"][row]]
        parts = [np.array([value for one in data[axis][rows] for value in one], dtype=float) for axis in "xyz"]
        if min(map(len, parts)) >= _SAMPLES:
            yield float(heads["smp_rate"][row]), np.stack(parts, axis=1)[:_SAMPLES] / float(heads["mul"][row])


def _stretches(flight: Flight) -> Iterator[Piece]:
    """Stretches of the gyro's own samples in the air in which none is missing."""
    table = flight.one("GYR", *READS["GYR"])
    if table is None or len(table) < _SAMPLES:
        return
    at_s = table["SampleUS"] / 1e6
    step_s = float(median(np.diff(at_s)))
    starts = np.arange(0, len(table) - _SAMPLES + 1, _SAMPLES)
    for start in _spread(starts[during(flight.flown, table.t[starts])]) if step_s > 0 else ():
        piece = slice(int(start), int(start) + _SAMPLES)
        if np.diff(at_s[piece]).max() < 1.5 * step_s:
            yield 1 / step_s, np.stack([table[f"Gyr{axis}"][piece] for axis in "XYZ"], axis=1)


def _spread(rows: NDArray[np.intp]) -> Sequence[np.intp]:
    """At most so many of these rows, from all of the flight."""
    return list(rows if len(rows) <= _MOST_PIECES else rows[np.linspace(0, len(rows) - 1, _MOST_PIECES).astype(int)])


CHECK = Check("spectrum", "a notch or a low pass beside the noise of the gyros", READS, LIMITS, find)
