"""Rates in degrees a second and outputs from -1 to 1, whatever unit a firmware wrote them in.

Until ArduCopter 3.4 RATE held hundredths of a degree a second (AC_ATTITUDE_CONTROL_DEGX100) and outputs from -4500 to
4500, without a word of the log on it. An output tells its own unit, and where it is an old one the gyros tell that of
the rates: the two changed one after the other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from care_core.ecosystems.ardupilot.units import InUnits
from care_core.ecosystems.vehicles.vehicle import vehicle_of
from care_core.logs.base import Log, Table, Wanted
from care_core.numbers import Floats, quantile

_MESSAGE = "RATE"
_RATES, _OUTPUTS = ("R", "RDes", "P", "PDes", "Y", "YDes"), ("ROut", "POut", "YOut")
_TOLD: Wanted = {_MESSAGE: ("R", "P", *_OUTPUTS)}
_GYROS: Wanted = {"IMU": ("GyrX", "GyrY")}
_CENTI, _OUTPUT = 0.01, 1 / 4500
_OVER = 50.0
"""An output so far beyond all that the motors have, 1, is one of 4500: a copter that tumbles asks for 22."""
_IN_DEGREES = (3, 5)
"""The first release of ArduCopter of which every build writes degrees: those of 3.4-dev began with hundredths."""
_FROM, _TO = 30.0, 300.0
"""By what factor hundredths of a degree are more than degrees: the gyro's spread and the rate's differ by less."""


def in_degrees(log: Log) -> Log:
    """The log with rates in degrees a second, and their outputs from -1 to 1."""
    return InUnits(log, _MESSAGE, _factors)


def _factors(log: Log) -> Mapping[str, float]:
    """Degrees a second of one unit of each rate, and the share of all the motors have of one unit of each output."""
    version = vehicle_of(log.facts, log.settings()).version
    told = log.read(_TOLD).get(_MESSAGE)
    if told is None or (version is not None and version[:2] >= _IN_DEGREES) or max(_spreads(told, _OUTPUTS)) <= _OVER:
        return {}
    gyros = log.read(_GYROS).get("IMU")
    turned = [] if gyros is None else np.degrees(_spreads(gyros, _GYROS["IMU"])).tolist()
    ratios = [rate / gyro for rate, gyro in zip(_spreads(told, ("R", "P")), turned, strict=False) if gyro > 0]
    is_centi = not ratios or any(_FROM < ratio < _TO for ratio in ratios)
    return {**(dict.fromkeys(_RATES, _CENTI) if is_centi else {}), **dict.fromkeys(_OUTPUTS, _OUTPUT)}


def _spreads(table: Table, fields: Sequence[str]) -> list[float]:
    """How far each field goes from zero, all but the hundredth of its records that goes farthest; 0 if not recorded."""
    return [_spread(np.asarray(table.columns.get(field, ()), np.float64)) for field in fields]


def _spread(values: Floats) -> float:
    known = np.abs(values[np.isfinite(values)])
    return quantile(known, 0.99) if len(known) else 0.0
