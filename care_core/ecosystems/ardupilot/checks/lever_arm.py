"""Where the GPS antenna and the IMU are said to be, against how the GPS velocity parts from the estimate in turns.

The estimator takes out the velocity that a turn gives an antenna away from the centre: the turn rate times its arm. An
arm that is not there is put in instead, and the innovations of the velocity follow it, turn by turn.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.spans import during
from care_core.ecosystems.vehicles.errors import EKF_CHECK, EKF_FAILSAFE
from care_core.logs.base import Wanted
from care_core.numbers import Bools, Floats

READS: Wanted = {
    "XKF3": ("IVN", "IVE", "IVD"), "ATT": ("Roll", "Pitch", "Yaw"), "RATE": ("R", "P", "Y"),
}  # fmt: skip

LIMITS = Limits()
_ARM_M = LIMITS.add("arm of a sensor that is looked at", 0.5, "m", "a choice: shorter ones move it less than wind does")
_TURNS_MS = LIMITS.add("velocity that the arm gives in a turn", 0.15, "m/s", "a choice: less is noise")
_RECORDS = LIMITS.add("velocities in turns", 8, "", "a choice: fewer are alike by chance")
_OFF_MS = LIMITS.add(
    "innovation of the velocity in turns", 0.18, "m/s", "nine of ten healthy training flights have below 0.1"
)
_ALIKE = LIMITS.add(
    "correlation with what the arm gives", 0.4, "", "one of 600 training flights has it with an arm of 3 m put in"
)
_FOLLOWS = LIMITS.add("share of the arm that it follows", 0.2, "", "in a thinned log much of a turn is missed")
_SURE_P = LIMITS.add("probability of the arm", 0.9, "", "all 13 such flights have an arm that is not there")
_LOST_P = LIMITS.add("probability that a mission fails of it, after an EKF failsafe", 0.95, "", "7 of 7 such flights")
_OFF_PATH_P = LIMITS.add("probability that a mission fails of a wrong antenna, else", 0.8, "", "3 of 3 such flights")
_IN_TURNS_P = LIMITS.add(
    "probability that a mission fails of a wrong IMU, else", 0.3, "", "none of 8 flights; a choice"
)
_STEP_S, _LEARNED_S = 0.1, 1.0
_LAGS_S = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5)
"""Receivers are late by so much (AP_GPS)."""


class _Arm(NamedTuple):
    """An arm as set: of what, by which parameters, and as the estimator uses it (m, forward, right, down)."""

    title: str
    parameters: tuple[str, ...]
    used: Floats
    fails: float
    """How likely a mission fails with it, where the estimator still holds."""


def find(flight: Flight) -> Iterator[Finding]:
    """The arm that the innovations follow most."""
    if not flight.is_copter or not flight.flown:
        return
    found = [(alike, arm, shown) for arm in _arms(flight) for alike, shown in _follows(flight, arm.used)]
    if not found:
        return
    _, arm, (at, off, given, alike) = max(found, key=lambda one: one[0])
    told = (*flight.errors(EKF_CHECK), *flight.errors(EKF_FAILSAFE))
    lost = next((t for t, code in told if code and t >= at), None)
    set_to = ", ".join(f"{name} is {flight.setting(name):g} m" for name in arm.parameters)
    yield Finding(
        kind="gps",
        title=arm.title,
        onset_s=at,
        end_s=flight.flown[-1][1],
        severity="warning" if lost is None else "critical",
        evidence=(
            f"{set_to}: in turns the GPS velocity is {off:.2f} m/s off the estimate (limit {_OFF_MS:g}), as an arm "
            f"that is not there gives it ({given:.2f} m/s, correlation {alike:.2f}, limit {_ALIKE:g})"
        ),
        source="XKF3.IVN, IVE, IVD against RATE and ATT; PARM",
        suspect="parameter",
        probability=_SURE_P,
        mission_lost=arm.fails if lost is None else _LOST_P,
        parameters=arm.parameters,
        wanted=((arm.parameters[0], 0.0),) if len(arm.parameters) == 1 else (),
    )


def _arms(flight: Flight) -> Iterator[_Arm]:
    for what, sign, fails, names in (
        ("the GPS antenna", 1.0, _OFF_PATH_P, ("GPS_POS1_{}", "GPS1_POS_{}")),
        ("the IMU", -1.0, _IN_TURNS_P, ("INS_POS1_{}",)),
    ):
        for name in names:
            arm = {name.format(axis): flight.setting(name.format(axis)) or 0.0 for axis in "XYZ"}
            named = tuple(one for one, metres in arm.items() if metres)
            if np.linalg.norm(list(arm.values())) >= _ARM_M:
                yield _Arm(f"{what} is not where it is said to be", named, sign * np.array([*arm.values()]), fails)


def _follows(flight: Flight, arm: Floats) -> Iterator[tuple[float, tuple[float, float, float, float]]]:
    """How alike the innovations are to what an arm gives, with when that begins, both in m/s and the correlation;
    nothing where they are not."""
    inno, leans, rates = (flight.one(name, *fields) for name, fields in READS.items())
    if inno is None or leans is None or rates is None:
        return
    rows = during(flight.flown, inno.t)
    t, off = inno.t[rows], np.stack([inno[axis][rows] for axis in READS["XKF3"]], axis=-1)
    grid = np.arange(flight.flown[0][0] - _LEARNED_S, flight.flown[-1][1], _STEP_S)
    given = _arm_velocity(leans.t, _angles(leans.columns), rates.t, rates.columns, grid, arm)
    found = [
        alike
        for velocity in (given, _unlearned(given))
        for lag in _LAGS_S
        for alike in _alike(t, off, np.stack([np.interp(t - lag, grid, one) for one in velocity.T], axis=-1))
    ]
    if found:
        yield max(found, key=lambda one: one[0])


def _alike(t: Floats, off: Floats, given: Floats) -> Iterator[tuple[float, tuple[float, float, float, float]]]:
    turns: Bools = (np.abs(given) > _TURNS_MS) & np.isfinite(off)
    if turns.sum() < _RECORDS:
        return
    a, b = given[turns], off[turns]
    size = float(np.sqrt(np.mean(b**2)))
    alike = float(a @ b) / float(np.linalg.norm(a) * np.linalg.norm(b) or 1.0)
    if size > _OFF_MS and alike > _ALIKE and float(a @ b) > _FOLLOWS * float(a @ a):
        begin = float(t[np.any(turns & (np.abs(off) > _OFF_MS), axis=1)][0])
        yield alike, (begin, size, float(np.sqrt(np.mean(a**2))), alike)


def _unlearned(given: Floats) -> Floats:
    """What is left of a velocity once the estimator has learned, over a second, what lasts; shape (n, 3)."""
    learned, left = np.zeros(given.shape[1]), np.empty_like(given)
    for row, velocity in enumerate(given):
        learned = learned + (velocity - learned) * _STEP_S / _LEARNED_S
        left[row] = velocity - learned
    return left


def _angles(leans: Mapping[str, Floats]) -> tuple[Floats, Floats, Floats]:
    return np.radians(leans["Roll"]), np.radians(leans["Pitch"]), np.unwrap(np.radians(leans["Yaw"]))


def _arm_velocity(
    leans_t: Floats, angles: tuple[Floats, Floats, Floats], rates_t: Floats, rates: Mapping[str, Floats], t: Floats,
    arm: Floats,
) -> Floats:  # fmt: skip
    """Velocity that turning gives the end of an arm, m/s north, east and down, shape (n, 3)."""
    turn = np.stack([np.interp(t, rates_t, np.radians(rates[axis])) for axis in READS["RATE"]], axis=-1)
    ahead, right, down = np.cross(turn, arm).T
    roll, pitch, yaw = (np.interp(t, leans_t, angle) for angle in angles)
    level_right = right * np.cos(roll) - down * np.sin(roll)
    level_down = right * np.sin(roll) + down * np.cos(roll)
    level_ahead = ahead * np.cos(pitch) + level_down * np.sin(pitch)
    return np.stack((
        level_ahead * np.cos(yaw) - level_right * np.sin(yaw),
        level_ahead * np.sin(yaw) + level_right * np.cos(yaw),
        level_down * np.cos(pitch) - ahead * np.sin(pitch),
    ), axis=-1)  # fmt: skip


CHECK = Check("lever_arm", "a GPS antenna or IMU that is not where it is said to be", READS, LIMITS, find)
