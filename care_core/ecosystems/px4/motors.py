"""The motors of a multicopter under PX4: where each sits, and what was asked of it."""

from __future__ import annotations

import numpy as np

from care_core.ecosystems.lost_motor import Commands
from care_core.ecosystems.px4.flight import Px4Flight
from care_core.ecosystems.vehicles import Motor, motors_at, motors_of
from care_core.ecosystems.vehicles.settings import Driven, code, number
from care_core.logs.base import Table, Wanted
from care_core.numbers import Floats

_MOST = 12
_MOTORS, _OUTPUTS = "actuator_motors", "actuator_outputs"
READS: Wanted = {
    _MOTORS: tuple(f"control[{n}]" for n in range(_MOST)),
    _OUTPUTS: tuple(f"output[{n}]" for n in range(16)),
}

_OF_TYPE = {2: 4, 13: 6, 14: 8, 15: 3}
"""MAV_TYPE -> motors, of firmware whose parameters name no rotors (before 1.13)."""
_FRAMES = {4: (1, 1), 5: (1, 0), 6: (2, 1), 7: (2, 0), 8: (3, 1), 9: (3, 0)}
"""Thousands of SYS_AUTOSTART -> class and type of ArduPilot's frame whose motors have the same order (PX4 1.12)."""
_QUADS_X = frozenset((1001, 10016))
_FIRST_MOTOR = 101
_PWM_LEAST, _PWM_MOST = 1000.0, 2000.0
_DSHOT_MOST, _CAN_MOST = 2000.0, 8191.0
_IS_PWM, _IS_DSHOT = (800.0, 2200.0), 2200.0


def px4_motors(settings: Driven) -> tuple[Motor, ...]:
    """The motors with their places, by CA_ROTORn_PX and PY, else by the airframe; empty where neither tells."""
    count = code(settings, "CA_ROTOR_COUNT") or 0
    places = [(number(settings, f"CA_ROTOR{n}_PX"), number(settings, f"CA_ROTOR{n}_PY")) for n in range(count)]
    known = [(x, y) for x, y in places if x is not None and y is not None]
    if len(known) == count > 2:
        return motors_at([float(np.degrees(np.arctan2(y, x))) for x, y in known])
    airframe = code(settings, "SYS_AUTOSTART") or 0
    frame = (1, 1) if airframe in _QUADS_X else _FRAMES.get(airframe // 1000)
    return motors_of({"FRAME_CLASS": frame[0], "FRAME_TYPE": frame[1]}) if frame and not count else ()


def commands(flight: Px4Flight) -> Commands | None:
    """What was asked of each motor of a multicopter, None where the log does not tell."""
    settings = flight.log.settings()
    count = code(settings, "CA_ROTOR_COUNT") or _OF_TYPE.get(code(settings, "MAV_TYPE") or 0, 0)
    tables = flight.tables(READS)
    if count < 3:
        return None
    asked = tables.get(_MOTORS)
    if asked is not None and len(asked):
        return _commands(asked, [f"control[{n}]" for n in range(count)], 0.0, 1.0)
    outputs = tables.get(_OUTPUTS)
    columns = _columns(settings, count)
    if outputs is None or not len(outputs) or columns is None or not set(columns) <= outputs.columns.keys():
        return None
    most = float(np.nanmax([np.nanmax(outputs[column]) for column in columns]))
    least = float(np.nanmax([np.nanmin(outputs[column]) for column in columns]))
    return _commands(outputs, columns, *_range(least, most))


def _columns(settings: Driven, count: int) -> list[str] | None:
    """The outputs of the motors: as their functions say, else the first ones (before 1.13)."""
    functions = {code(settings, f"PWM_MAIN_FUNC{n + 1}"): n for n in range(16)}
    if set(functions) == {None}:
        return [f"output[{n}]" for n in range(count)]
    found = [functions.get(_FIRST_MOTOR + n) for n in range(count)]
    return None if None in found else [f"output[{n}]" for n in found]


def _range(least: float, most: float) -> tuple[float, float]:
    """Of the unit that outputs are in: a share, microseconds, DShot's steps or a CAN controller's."""
    if most <= 1.0:
        return 0.0, 1.0
    if _IS_PWM[0] <= least and most <= _IS_PWM[1]:
        return _PWM_LEAST, _PWM_MOST
    return 0.0, _DSHOT_MOST if most <= _IS_DSHOT else _CAN_MOST


def _commands(table: Table, columns: list[str], low: float, high: float) -> Commands | None:
    if not set(columns) <= table.columns.keys():
        return None
    share: Floats = (np.array([table[column] for column in columns]) - low) / (high - low)
    known = np.isfinite(share).all(axis=0)
    if not known.any():
        return None
    numbers = tuple(range(1, len(columns) + 1))
    return Commands(table.t[known], np.clip(share[:, known], 0.0, 1.0), numbers)
