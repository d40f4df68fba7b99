"""An estimated height or climb that runs away from the barometer's, by which the estimator holds it.

The estimator carries the height on by the accelerometers and corrects it by the barometer (EK3_SRC1_POSZ 1, and before
4.1 EK2_ALT_SOURCE 0 as shipped). Accelerometers that are far off, or a barometer that it rejects, part them; the
firmware refuses arming from 1 m on (PREARM_MAX_ALT_DISPARITY_CM).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.ardupilot.recorded import Mode
from care_core.ecosystems.ardupilot.statistics import lasting, smooth
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.spans import Span, during, seconds_in
from care_core.geodesy import GRAVITY
from care_core.logs.base import Wanted
from care_core.numbers import Bools, Floats, median, quantile

_AXES = ("AccX", "AccY", "AccZ")
READS: Wanted = {"IMU": _AXES, "GPS": ("Alt", "Status"), "CTUN": ("CRt",)}

LIMITS = Limits()
_APART_M = LIMITS.add("estimate off the barometer", 5.0, "m", "five times what arming allows")
_LASTS_S = LIMITS.add("shortest time of it", 5.0, "s", "a choice: a descent through its own wash is over sooner")
_CLIMB_MS = LIMITS.add("climb off the barometer's", 2.0, "m/s", "more than LAND_SPEED: it lands as it means to hold")
_CLIMB_LASTS_S = LIMITS.add("shortest such climb", 3.0, "s", "a choice: a gust on the static port is over sooner")
_GRAVITY = LIMITS.add("gravity", GRAVITY, "m/s^2", "physics")
_OFF = LIMITS.add("gravity off, at rest", 0.5, "m/s^2", "a choice: a calibrated accelerometer is within 0.1")
_FAR_OFF = LIMITS.add("gravity far off, at rest", 1.0, "m/s^2", "MPU-6000, not calibrated: 0.8 on one axis")
_TRUE_P = LIMITS.add("probability that it is so", 0.8, "", "a choice: both are measured; which one is wrong is not")
_LOST_P = LIMITS.add("probability that it costs the mission", 0.4, "", "a choice: the barometer corrects most of it")
_SOURCES = (("EK3_SRC1_POSZ", 1.0), ("EK3_ALT_SOURCE", 0.0), ("EK2_ALT_SOURCE", 0.0))
"""The value with which the height is that of the barometer."""
_FASTEST_MS = LIMITS.add(
    "climb of a copter, at most", 50.0, "m/s", "none climbs so fast: a damaged value, or another unit"
)
_HELD = frozenset(("hold", "mission", "return", "land", "guided"))
_ALT_HOLD = 2
_FIX, _CM = 3, 0.01
_FEWEST, _STANDS = 20, 0.2
"""A clock that stands still for so many records tells of no two heights when they were measured."""


def find(flight: Flight) -> Iterator[Finding]:
    """Where estimate and barometer part while it matters."""
    heard = flight.barometer
    if not flight.is_copter or heard is None or not flight.armed or not _is_by_barometer(flight):
        return
    estimates = (one for one in (flight.estimated_height, flight.controlled_height) if one is not None)
    found = next(filter(None, (_parted(flight, one, heard) for one in estimates)), None)
    climbs = _climb_parted(flight, heard)
    if (parted := climbs or found) is not None:
        yield parted
    if found is None or climbs is not None:
        yield from _not_gravity(flight, is_critical=climbs is not None)


def _climb_parted(flight: Flight, heard: tuple[Floats, Floats]) -> Finding | None:
    """A climb rate that the barometer contradicts while a mode holds the height by it: the vehicle climbs or sinks as
    fast as that is off."""
    table = flight.one("CTUN", "CRt")
    table = None if table is None else table.where(np.abs(table["CRt"]) * _CM < _FASTEST_MS)
    if (
        table is None
        or len(table) < _FEWEST
        or not flight.airborne
        or any(np.mean(np.diff(one) <= 0.0) > _STANDS for one in (table.t, heard[0]))
        or any(
            float(median(np.diff(one))) > _CLIMB_LASTS_S / 3 for one in (table.t, heard[0])
        )  # too few to tell a rate
    ):
        return None
    t, half = table.t, _CLIMB_LASTS_S / 2
    rises = (np.interp(t + half, *heard) - np.interp(t - half, *heard)) / _CLIMB_LASTS_S
    apart = smooth(t, table["CRt"] * _CM, _CLIMB_LASTS_S) - rises
    spans = lasting(t, (np.abs(apart) > _CLIMB_MS) & flight.watch(t) & _holds_at(flight, t), _CLIMB_LASTS_S)
    if not spans:
        return None
    inside = during(spans, t)
    said, rose = float(median((apart + rises)[inside])), float(median(rises[inside]))
    received = _received_climb(flight, spans[0])
    if received is not None and abs(received - said) < abs(received - rose):
        return None
    return Finding(
        kind="estimator",
        title="the estimated climb rate runs away from the barometer's",
        onset_s=spans[0][0],
        end_s=spans[-1][1],
        severity="critical",
        evidence=f"the estimate says {said:+.1f} m/s and the barometer {rose:+.1f} m/s (limit {_CLIMB_MS:g} m/s apart) "
        f"for {seconds_in(spans):.0f} s in a mode that holds the height{_at_rest(flight)}",
        source="CTUN.CRt against CTUN.BAlt or BARO.Alt",
        probability=_TRUE_P,
    )


def _received_climb(flight: Flight, span: Span) -> float | None:
    """How fast the receiver's height rises meanwhile, m/s; None where it has no fix."""
    received = flight.one("GPS", "Alt", "Status")
    part = None if received is None else received.where(during((span,), received.t) & (received["Status"] >= _FIX))
    if part is None or len(part) < 3 or part.t[-1] <= part.t[0]:
        return None
    return float(np.polyfit(part.t, part["Alt"], 1)[0])


def _holds_at(flight: Flight, t: Floats) -> Bools:
    """Where a mode that goes by the height is in force."""
    numbers = [mode.number for mode in flight.modes if mode.number is not None and _goes_by_height(mode)]
    return np.isin(flight.modes_at(t), numbers)


def _not_gravity(flight: Flight, *, is_critical: bool) -> Iterator[Finding]:
    """Accelerometers that are far off gravity at rest: every climb rate that is estimated from them is wrong, though
    the barometer holds the height within its limit. Where one of several feels it, the others disagree with that."""
    felt = flight.felt_at_rest
    if felt and abs(felt[0] - _GRAVITY) > _FAR_OFF and all(abs(one - _GRAVITY) > _OFF for one in felt):
        yield Finding(
            kind="imu",
            title="the accelerometers do not feel gravity at rest",
            onset_s=flight.armed[0][0],
            end_s=flight.end_s,
            severity="critical" if is_critical else "warning",
            evidence=f"{felt[0]:.1f} m/s^2 before take-off, gravity is {_GRAVITY:g} (limit {_FAR_OFF:g} off): "
            "calibrate them",
            source="IMU.AccX, AccY, AccZ before the throttle is raised",
            probability=_TRUE_P,
            mission_lost=None if is_critical else _LOST_P,
        )


def _parted(flight: Flight, estimate: tuple[Floats, Floats], heard: tuple[Floats, Floats]) -> Finding | None:
    """Where a height and the barometer's part while it matters."""
    t, height = estimate
    if any(np.mean(np.diff(one) <= 0.0) > _STANDS for one in (t, heard[0])):
        return None
    apart = height - np.interp(t, *heard)
    watched = flight.watch(t)
    if watched.sum() < _FEWEST or not np.any(apart):
        return None
    apart = smooth(t, apart - float(median(apart[watched][:_FEWEST])), 3.0)
    spans = lasting(t, (np.abs(apart) > _APART_M) & watched, _LASTS_S)
    if not spans or _receiver_agrees(flight, estimate, heard, spans):
        return None
    start, end = spans[0][0], spans[-1][1]
    most = quantile(np.abs(apart[during(spans, t)]), 0.9)
    return Finding(
        kind="estimator",
        title="the estimated height runs away from the barometer's",
        onset_s=start,
        end_s=end,
        severity="critical" if _holds_height(flight, start, end) else "warning",
        evidence=f"they are up to {most:.0f} m apart (limit {_APART_M:g} m){_at_rest(flight)}",
        source="CTUN.Alt or POS.RelHomeAlt against CTUN.BAlt or BARO.Alt",
        probability=_TRUE_P,
    )


def _is_by_barometer(flight: Flight) -> bool:
    """Whether the height is to be the barometer's."""
    return all(flight.setting(name) in (None, value) for name, value in _SOURCES)


def _receiver_agrees(
    flight: Flight, estimate: tuple[Floats, Floats], heard: tuple[Floats, Floats], spans: list[Span]
) -> bool:
    """Whether the receiver's height is nearer to the estimate than to the barometer meanwhile: then that drifts."""
    received = flight.one("GPS", "Alt", "Status")
    fixed = None if received is None else received.where((received["Status"] >= _FIX) & flight.watch(received.t))
    if fixed is None or not len(fixed):
        return False
    told = during(spans, fixed.t)
    climbed = fixed["Alt"] - float(median(fixed["Alt"][:_FEWEST]))
    off = [float(median(np.abs(climbed - np.interp(fixed.t, *known))[told])) for known in (estimate, heard)]
    return bool(told.any()) and off[0] < off[1]


def _holds_height(flight: Flight, start: float, end: float) -> bool:
    """Whether a mode that goes by the height was in force meanwhile."""
    return any(map(_goes_by_height, flight.modes_between(start, end)))


def _goes_by_height(mode: Mode) -> bool:
    return mode.way in _HELD or mode.number == _ALT_HOLD


def _at_rest(flight: Flight) -> str:
    """That the accelerometers do not feel gravity before take-off, in a clause; empty where they do."""
    felt = flight.felt_at_rest
    if not felt or abs(felt[0] - _GRAVITY) < _OFF:
        return ""
    return f"; at rest the accelerometers feel {felt[0]:.1f} m/s^2, gravity is {_GRAVITY:g}: calibrate them"


CHECK = Check("height", "an estimated height that runs away from the barometer's", READS, LIMITS, find)
