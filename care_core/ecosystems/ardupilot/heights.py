"""Heights in metres, whatever unit a firmware wrote them in.

POS.RelHomeAlt is in metres today, and was in centimetres. What a log declares of its units (FMTU) is not always so: of
one of 200 logs a barometer's height is in metres that is declared in centimetres. So the other heights of the log
decide, and its own word only where there is none.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from care_core.ecosystems.ardupilot.units import InUnits
from care_core.logs.base import Log, Table, Wanted
from care_core.numbers import Floats

_MESSAGE, _FIELD = "POS", "RelHomeAlt"
_OWN: Wanted = {_MESSAGE: (_FIELD,)}
_OTHERS: Wanted = {"BARO": ("Alt",), "CTUN": ("BAlt", "BarAlt", "Alt"), "GPS": ("Alt",), _MESSAGE: ("Alt",)}
_DECLARED: Wanted = {
    "FMT": ("Type", "Name", "Format", "Columns"), "FMTU": ("FmtType", "UnitIds", "MultIds"), "MULT": ("Id", "Mult"),
}  # fmt: skip
_SCALED = frozenset("cCeEL")
"""Types of fields that a reader scales already."""
_CENTI = 0.01
_DOUBTFUL = 100.0
"""A range of heights that few flights have in metres, and any flight in centimetres."""
_RISE_M = 3.0
"""Heights that range over less tell no unit."""
_FROM, _TO = 30.0, 300.0
"""By what factor centimetres are more than metres: heights of barometer, receiver and estimate differ by less."""


def in_metres(log: Log) -> Log:
    """The log with the height above home in metres."""
    return InUnits(log, _MESSAGE, _factors)


def _factors(log: Log) -> Mapping[str, float]:
    """Metres of one unit of the height above home, where that is another."""
    own = log.read(_OWN).get(_MESSAGE)
    if own is None or _FIELD not in own.columns or (height := _range(own, _FIELD)) <= _DOUBTFUL:
        return {}
    tables = log.read(_OTHERS)
    ranges = (
        _range(tables[name], field)
        for name, fields in _OTHERS.items()
        for field in fields
        if name in tables and field in tables[name].columns
    )
    known = [size for size in ranges if size > _RISE_M]
    is_centi = any(_FROM < height / size < _TO for size in known) if known else _is_declared(log)
    return {_FIELD: _CENTI} if is_centi else {}


def _range(table: Table, field: str) -> float:
    values: Floats = np.asarray(table[field], np.float64)
    known = values[np.isfinite(values)]
    return float(np.ptp(known)) if len(known) else 0.0


def _is_declared(log: Log) -> bool:
    """Whether the log says that the height is in hundredths, in a field that no reader scales."""
    tables = log.read(_DECLARED)
    if not set(_DECLARED) <= tables.keys():
        return False
    factors = dict(zip(map(chr, tables["MULT"]["Id"].astype(int)), tables["MULT"]["Mult"].tolist(), strict=True))
    for number, name, types, columns in zip(*(tables["FMT"][field] for field in _DECLARED["FMT"]), strict=True):
        if name != _MESSAGE or _FIELD not in columns.split(","):
            continue
        place = columns.split(",").index(_FIELD)
        units = tables["FMTU"].where(tables["FMTU"]["FmtType"] == number)
        factors_of = [str(ids)[place : place + 1] for ids in units["MultIds"].tolist()]
        return types[place] not in _SCALED and any(abs(factors.get(one, 1.0) / _CENTI - 1) < 1e-3 for one in factors_of)
    return False
