"""What a vehicle recorded, under one set of names: those of today's firmware, whatever the log's age calls them.

Firmware before 4.1 writes a sensor's second instance as a message of its own (MAG2), before 3.3 the battery is CURR and
the outputs are Chan1 or Mot1. Checks see instances of a message with today's fields and units.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from care_core.logs.base import Kind, LazyColumns, Table, Wanted
from care_core.numbers import distinct

Floats = NDArray[np.float64]

MESSAGES: Mapping[str, tuple[str, ...]] = {
    "IMU": ("IMU", "IMU2", "IMU3"),
    "MAG": ("MAG", "MAG2", "MAG3"),
    "BARO": ("BARO", "BAR2", "BAR3"),
    "GPS": ("GPS", "GPS2", "GPSB"),
    "GPA": ("GPA", "GPA2"),
    "BAT": ("BAT", "CURR", "BAT2", "CUR2", "CURR2"),
    "RCOU": ("RCOU", "MOT"),
    "XKF1": ("XKF1", "NKF1", "EKF1", "NKF6"),
    "XKF3": ("XKF3", "NKF3", "EKF3", "NKF8"),
    "XKF4": ("XKF4", "NKF4", "EKF4", "NKF9"),
}
"""Today's message -> the messages that carry it or carried it, one an instance. All others keep their name."""

INSTANCE: Mapping[str, tuple[str, ...]] = {
    "IMU": ("I",), "MAG": ("I",), "BARO": ("I",), "GPS": ("I",), "GPA": ("I",), "BAT": ("Inst", "Instance"),
    "VIBE": ("IMU",), "XKF1": ("C",), "XKF3": ("C",), "XKF4": ("C",), "RFND": ("Instance",), "ESC": ("Instance",),
}  # fmt: skip
"""The field that numbers the instances of a message, where one message holds them all."""

FORMER: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "ATT": {"DesRoll": ("RollIn",), "DesPitch": ("PitchIn",), "DesYaw": ("NavYaw",)},
    "CTUN": {"ThO": ("ThrOut",), "ThI": ("ThrIn",), "BAlt": ("BarAlt",), "DAlt": ("WPAlt",), "CRt": ("CRate",),
             "DCRt": ("DCRate",), "SAlt": ("SonAlt",)},
    "RCOU": {f"C{n}": (f"Ch{n}", f"Chan{n}", f"Mot{n}") for n in range(1, 15)},
    "RCIN": {f"C{n}": (f"Ch{n}", f"Chan{n}") for n in range(1, 15)},
    "XKF3": {"IYAW": ("IYAW",)},
    "PM": {"NL": ("NLoop",), "NLon": ("NLon",)},
    "MODE": {"ModeNum": ("Mode",)},
    "VIBE": {"Clip": ("Clip0",)},
    "RFND": {"Dist": ("Dist1",), "Instance": ()},
}  # fmt: skip
"""Today's field -> what it was called."""

_CENTIVOLTS = 200.0
"""A pack reads more than this only where it is recorded in hundredths of a volt (CURR before 3.3)."""
_FULL_SCALE = 2.0
"""Throttle of a copter is in thousandths before 3.4, at most 1 since."""
_PERCENT = 100.0
"""A plane's throttle is in percent (ArduPlane/Log.cpp: CTUN.ThO), so more than `_FULL_SCALE` under today's name is."""


def expanded(reads: Wanted) -> dict[str, tuple[str, ...]]:
    """The channels and fields by every name that they may have in a log."""
    wanted: dict[str, tuple[str, ...]] = {}
    for name, fields in reads.items():
        former = FORMER.get(name, {})
        known = [old for field in fields for old in (field, *former.get(field, ()))]
        for message in MESSAGES.get(name, (name,)):
            wanted[message] = tuple(dict.fromkeys([*wanted.get(message, ()), *known, *INSTANCE.get(name, ())]))
    return wanted


def instances(tables: Mapping[str, Table], name: str) -> tuple[Table, ...]:
    """The instances of a message in order of their number, under today's names; none where the log has none."""
    found: list[Table] = []
    for message in MESSAGES.get(name, (name,)):
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

    def where(self, mask: NDArray[np.bool_] | slice) -> _Today:
        return _Today(self._table.where(mask), self._sources)


def _renamed(name: str, table: Table) -> Table:
    sources = {field: (field, 1.0) for field in table.columns}
    for field, olds in FORMER.get(name, {}).items():
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


def split(name: str, table: Table) -> list[Table]:
    """The instances that one message holds, in order of their number."""
    field = next((field for field in INSTANCE.get(name, ()) if field in table.columns), None)
    if field is None:
        return [table]
    number = table[field]
    return [table.where(number == own) for own in distinct(number[np.isfinite(number)])]
