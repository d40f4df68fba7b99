"""The instances of what a vehicle recorded, under today's names and in today's units, whatever its firmware's age.

Firmware before 4.1 writes a sensor's second instance as a message of its own (MAG2), before 3.3 the battery is CURR and
the outputs are Chan1 or Mot1. Checks see instances of a message with today's fields and units.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from care_core.ecosystems.ardupilot.messages import MESSAGES, former_fields, recorded_as
from care_core.ecosystems.dictionary import instance_field
from care_core.ecosystems.liveness import says_nothing
from care_core.logs.base import Kind, LazyColumns, Table
from care_core.numbers import Bools, Floats, distinct

_NO_FIX, FIX = 1.0, 3.0
"""GPS.Status of a receiver that is there and has no fix, and from which it has one in three dimensions."""
_CENTIVOLTS = 200.0
"""A pack reads more than this only where it is recorded in hundredths of a volt (CURR before 3.3)."""
_FULL_SCALE = 2.0
"""Throttle of a copter is in thousandths before 3.4, at most 1 since."""
_PERCENT = 100.0
"""A plane's throttle is in percent (ArduPlane/Log.cpp: CTUN.ThO), so more than `_FULL_SCALE` under today's name is."""


def instances(tables: Mapping[str, Table], name: str) -> tuple[Table, ...]:
    """The instances of a message in order of their number, under today's names; none where the log has none."""
    found: list[Table] = []
    for message in recorded_as(name):
        table = tables.get(message)
        if table is not None and len(table):
            found += split(name, _renamed(name, table))
    return tuple(found)


class _Today(LazyColumns):
    """A table's columns under today's names and in today's units, made when they are asked for.

    `sources` says of each name the column that it is and what that is divided by.
    """

    def __init__(self, table: Table, sources: Mapping[str, tuple[str, float]]) -> None:
        super().__init__(tuple(sources))
        self._table, self._sources = table, sources

    def __getitem__(self, name: str) -> NDArray[Any]:
        source, divisor = self._sources[name]
        column = self._table[source]
        return column if divisor == 1 else column / divisor

    @property
    def count(self) -> int:
        return len(self._table)

    @property
    def t(self) -> Floats:
        return self._table.t

    def kind(self, name: str) -> Kind:
        return self._table.kind(self._sources[name][0])

    def where(self, mask: Bools | slice) -> _Today:
        return _Today(self._table.where(mask), self._sources)


def _renamed(name: str, table: Table) -> Table:
    sources = {field: (field, 1.0) for field in table.columns}
    for field, olds in former_fields(name).items():
        old = next((old for old in olds if old in sources), None)
        if field not in sources and old is not None:
            sources[field] = sources[old]
    if name == "BAT" and "Volt" in sources and _top(table[sources["Volt"][0]]) > _CENTIVOLTS:
        for field in sources.keys() & {"Volt", "Curr"}:
            sources[field] = (sources[field][0], 100.0)
    if name == "CTUN":
        for field in sources.keys() & {"ThO", "ThI"}:
            if _top(table[sources[field][0]]) > _FULL_SCALE:
                sources[field] = (sources[field][0], _PERCENT if field in table.columns else 1000.0)
        if "Alt" not in sources and "BAlt" in sources:
            sources["Alt"] = sources["BAlt"]
    found = Table(None, _Today(table, sources))
    keep = np.isfinite(table.t)
    return found if keep.all() else found.where(keep)


def _top(column: NDArray[Any]) -> float:
    known = column[np.isfinite(column)]
    return float(known.max()) if len(known) else 0.0


def sees_nothing(receiver: Table) -> bool:
    """Whether rows of GPS never have a satellite or a fix: none is connected, or it lies under a roof."""
    if not {"NSats", "Status"} <= receiver.columns.keys():
        return False
    return says_nothing(receiver["NSats"]) and says_nothing(receiver["Status"], _NO_FIX)


def split(name: str, table: Table) -> list[Table]:
    """The instances that one message holds, in order of their number."""
    field = instance_field(MESSAGES[name], table.columns) if name in MESSAGES else None
    if field is None:
        return [table]
    number = table[field]
    return [table.where(number == own) for own in distinct(number[np.isfinite(number)])]
