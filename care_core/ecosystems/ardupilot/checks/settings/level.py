"""Accelerometers that were calibrated wrongly, a board that is not mounted as it is told, a trim that tilts it.

What stands feels 9.81 m/s^2 downwards. Accelerometers are recorded as offset and scale leave them (AP_InertialSensor:
the offset is taken away, then it is scaled), turned as the board is mounted; AHRS_TRIM turns the attitude alone.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.ardupilot.checks.settings import gravity, heading
from care_core.ecosystems.ardupilot.checks.settings.rotations import matrix
from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding, FindingKind
from care_core.geodesy import GRAVITY
from care_core.logs.base import Wanted, merge_needs
from care_core.numbers import Floats, median
from care_core.records import Record

READS: Wanted = merge_needs((gravity.READS, {"ATT": ("Roll", "Pitch")}))

LIMITS = Limits(gravity.LIMITS)
_G = LIMITS.add("acceleration of what stands", GRAVITY, "m/s^2", "gravity, within 0.03 anywhere on the ground")
_OFF = LIMITS.add("accelerometer off it, or off another", 0.5, "m/s^2", "two thirds of ARMING_ACCTHRESH")
_RIGHT = LIMITS.add("accelerometer that measures it", 0.2, "m/s^2", "a choice: calibrations leave less")
_LEANS_DEG = LIMITS.add("lean of the horizon of what stands level", 5.0, "deg", "a choice: trims are below 3 degrees")
_LEVEL_DEG = LIMITS.add(
    "lean of what stands level by its accelerometers",
    2.0,
    "deg",
    "a choice: grounds that vehicles start from slope by less",
)
_TURNED_DEG = LIMITS.add(
    "gravity off the bottom of a board", 60.0, "deg", "a choice: nothing takes off from such a slope"
)
_NEAR_RAD = LIMITS.add("measured trim that is the default", 0.02, "rad", "a choice: a degree")
_SURE_P = LIMITS.add("probability that undoing it mends", 0.95, "", "no other parameter brings it back")
_TRIM_LOST_P = LIMITS.add(
    "probability that a trim costs the mission", 0.15, "", "0 of 4 flights with 6 to 10 degrees failed"
)


class Undone(Record):
    """A parameter that, undone, makes what stands feel gravity as it is."""

    parameter: str
    wanted: float
    kind: FindingKind
    title: str
    evidence: str
    source: str
    mission_lost: float | None = None


def find(flight: Flight) -> Iterator[Finding]:
    """The parameter by which what stands does not feel itself standing."""
    undone = wrong_accelerometer(flight) or _turned(flight) or _trimmed(flight)
    if undone is None:
        return
    failed = flight.was_refused or flight.lost_control_s is not None or flight.impact_s is not None
    yield Finding(
        kind=undone.kind,
        title=undone.title,
        onset_s=0.0,
        end_s=flight.end_s,
        severity="critical" if failed and undone.mission_lost is None else "warning",
        evidence=undone.evidence,
        source=undone.source,
        suspect="parameter",
        probability=_SURE_P,
        mission_lost=undone.mission_lost,
        parameters=(undone.parameter,),
        wanted=((undone.parameter, undone.wanted),),
    )


def wrong_accelerometer(flight: Flight) -> Undone | None:
    """The offset or scale of an accelerometer whose undoing makes it feel gravity as it is, and as others do."""
    felt = gravity.felt(flight)
    for number, one in felt.items():
        others = [other for n, other in felt.items() if n != number and _is_gravity(other)]
        before = _off(one, others)
        undone = [
            (_off(mended, others), name, default)
            for name, default, mended in _calibrations(flight, number, one)
            if before > _OFF
        ]
        after, name, default = min(undone, default=(math.inf, "", 0.0))
        if after < _RIGHT:
            return Undone(
                parameter=name,
                wanted=default,
                kind="imu",
                title=f"accelerometer {number} is calibrated wrongly",
                evidence=(
                    f"at rest it is {before:.1f} m/s^2 off gravity (limit {_OFF:g}) with "
                    f"{name}={flight.setting(name):.4g}, and would be {after:.1f} off with its default {default:g}"
                ),
                source="IMU.AccX, AccY, AccZ before take-off",
            )
    return None


def _is_gravity(felt: Floats) -> bool:
    return abs(float(np.linalg.norm(felt)) - _G) < _RIGHT


def _off(felt: Floats, others: list[Floats]) -> float:
    """How far a sensor is off gravity, or off one that measures it, m/s^2."""
    apart = min((float(np.linalg.norm(felt - other)) for other in others), default=0.0)
    return max(abs(float(np.linalg.norm(felt)) - _G), apart)


def _calibrations(flight: Flight, number: int, felt: Floats) -> Iterator[tuple[str, float, Floats]]:
    """Each offset and scale of a sensor that is off its default: its name, its default, what is felt with it undone."""
    digit = "" if number == 1 else str(number)
    for axis, letter in enumerate("XYZ"):
        offset, scale = (f"INS_ACC{digit}{what}_{letter}" for what in ("OFFS", "SCAL"))
        factor = flight.setting(scale) or 1.0
        default, value = flight.default_left(offset), flight.setting(offset)
        if default is not None and value is not None:
            mended = felt.copy()
            mended[axis] += (value - default) * factor
            yield offset, default, mended
        default = flight.default_left(scale)
        if default:
            mended = felt.copy()
            mended[axis] *= default / factor
            yield scale, default, mended


def _turned(flight: Flight) -> Undone | None:
    """A board on whose bottom gravity does not pull, and would where it were mounted as by default."""
    default, value = flight.default_left("AHRS_ORIENTATION"), flight.setting("AHRS_ORIENTATION")
    felt = list(gravity.felt(flight).values())
    if default is None or value is None or not felt or heading.wrong_setting(flight) is not None:
        return None
    before, after = matrix(value), matrix(default)
    if before is None or after is None:
        return None
    leans = [gravity.lean_deg(one) for one in felt]
    if min(leans) > _TURNED_DEG and max(gravity.lean_deg(after @ before.T @ one) for one in felt) < gravity.UPRIGHT_DEG:
        return Undone(
            parameter="AHRS_ORIENTATION",
            wanted=default,
            kind="imu",
            title="the board is mounted otherwise than it is told",
            evidence=(
                f"gravity pulls {leans[0]:.0f} degrees off its bottom at rest with AHRS_ORIENTATION={value:g}, and "
                f"would pull on it with its default {default:g}"
            ),
            source="IMU.AccX, AccY, AccZ before take-off",
        )
    return None


def _trimmed(flight: Flight) -> Undone | None:
    """A trim by which a vehicle that stands level by its accelerometers has a horizon that leans."""
    felt, attitude = gravity.felt(flight), flight.one("ATT", "Roll", "Pitch")
    standing = None if attitude is None else gravity.standing(flight, attitude)
    if (
        standing is None
        or len(standing) < gravity.FEWEST
        or not felt
        or max(map(gravity.lean_deg, felt.values())) > _LEVEL_DEG
    ):
        return None
    for name, angle in (("AHRS_TRIM_X", "Roll"), ("AHRS_TRIM_Y", "Pitch")):
        lean = float(median(standing[angle]))
        value = flight.setting(name) or 0.0
        wanted = value + math.radians(lean)
        if abs(lean) > _LEANS_DEG and abs(wanted) < math.radians(_LEVEL_DEG):
            return Undone(
                parameter=name,
                wanted=0.0 if abs(wanted) < _NEAR_RAD else float(f"{wanted:.3f}"),
                kind="estimator",
                title="the horizon leans while the vehicle stands level",
                evidence=(
                    f"{angle.casefold()} is {lean:.1f} degrees before take-off (limit {_LEANS_DEG:g}), and the "
                    f"accelerometers lie level, with {name}={value:.4g}"
                ),
                source=f"ATT.{angle} and IMU before take-off",
                mission_lost=_TRIM_LOST_P,
            )
    return None


CHECK = Check(
    "level settings", "accelerometers, mountings and trims by which what stands level does not", READS, LIMITS, find
)
