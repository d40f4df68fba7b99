"""Decoded tables as a log, so that whatever reads logs can be tried on them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from care_core.ecosystems.base import RunModel
from care_core.ecosystems.registry import run_model
from care_core.logs import formats
from care_core.logs.base import Channel, Table, Wanted
from care_core.logs.formats import LogFormat
from care_core.numbers import Floats
from care_core.records import Record, field
from care_core.run import Damage, Setting


class TablesLog(Record, eq=False):
    """A log that holds these tables and nothing else."""

    tables: Mapping[str, Table]
    duration_s: float
    format: LogFormat = formats.DATAFLASH_BIN
    facts: Mapping[str, str] = field(default_factory=dict)
    known: Mapping[str, tuple[Setting, ...]] = field(default_factory=dict)
    damage: tuple[Damage, ...] = ()
    path: Path = Path("made.BIN")
    start: str | None = None

    def channels(self) -> tuple[Channel, ...]:
        return tuple(Channel(name, name, len(table)) for name, table in self.tables.items())

    def times(self) -> Mapping[str, Floats]:
        """As logs of ROS tell them."""
        return {name: table.t for name, table in self.tables.items()}

    def settings(self) -> Mapping[str, tuple[Setting, ...]]:
        return self.known

    def read(self, wanted: Wanted) -> Mapping[str, Table]:
        present = {name: self.tables[name] for name in wanted if name in self.tables}
        return {
            name: Table(table.t, {field: table[field] for field in wanted[name] if field in table.columns})
            for name, table in present.items()
        }


def read(
    tables: Mapping[str, Table],
    duration_s: float,
    format: LogFormat = formats.DATAFLASH_BIN,
    facts: Mapping[str, str] | None = None,
) -> tuple[RunModel, Mapping[str, Table]]:
    """The run model of a log that holds these tables, and the tables: what missions are found in."""
    return run_model(TablesLog(tables, duration_s, format, facts or {})), tables


def no_model() -> RunModel:
    """A model of nothing, for missions that are made by hand."""
    return RunModel(TablesLog({}, 0.0))
