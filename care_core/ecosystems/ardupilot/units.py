"""A log whose message some firmware wrote in other units, read in ours."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any

from care_core.logs.base import Log, Table, Wanted
from care_core.records import Record


class InUnits(Record, eq=False, dict=True):
    """A log of which one message is multiplied, field by field; everything else is the log's."""

    log: Log
    message: str
    factors_of: Callable[[Log], Mapping[str, float]]
    """Our units in one of the log's, by field; a field that is not named stays as it is. Asked when the message is
    first read."""

    def __getattr__(self, name: str) -> Any:
        return getattr(self.log, name)

    def read(self, wanted: Wanted) -> Mapping[str, Table]:
        tables = self.log.read(wanted)
        table = tables.get(self.message)
        if table is None or self._factors.keys().isdisjoint(table.columns):
            return tables
        columns = {
            name: table[name] * self._factors[name] if name in self._factors else table[name] for name in table.columns
        }
        return {**tables, self.message: Table(table.t, columns)}

    @cached_property
    def _factors(self) -> Mapping[str, float]:
        return self.factors_of(self.log)
