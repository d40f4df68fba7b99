"""Everything that an ArduPilot vehicle said: its texts, and its errors and events in words."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from care_core.ecosystems.base import RunModel
from care_core.ecosystems.findings import Event
from care_core.ecosystems.vehicles import error_words, event_words, is_over, vehicle_of
from care_core.logs.base import Table, Wanted

READS: Wanted = {"MSG": ("Message",), "ERR": ("Subsys", "ECode"), "EV": ("Id",)}


def log_messages(model: RunModel) -> Iterator[Event]:
    """Texts, errors and events."""
    tables = model.tables(READS)
    kind = vehicle_of(model.log.facts, model.log.settings()).kind
    if (texts := _table(tables, "MSG")) is not None:
        for t, text in zip(texts.t.tolist(), texts["Message"].tolist(), strict=True):
            yield Event(t, "message", str(text), "MSG")
    for t, subsystem, code in _codes(tables, "ERR"):
        yield Event(t, "over" if is_over(subsystem, code) else "ERR", error_words(subsystem, code, kind), "ERR")
    for t, number in _codes(tables, "EV"):
        yield Event(t, "event", event_words(number), "EV")


def _table(tables: Mapping[str, Table], message: str) -> Table | None:
    """A message with all the fields that are read of it."""
    table = tables.get(message)
    return table if table is not None and set(READS[message]) <= table.columns.keys() else None


def _codes(tables: Mapping[str, Table], message: str) -> Iterator[tuple[Any, ...]]:
    """Time and codes of a message's sound rows."""
    table = _table(tables, message)
    if table is not None:
        columns = [table[field] for field in READS[message]]
        for row in np.flatnonzero(np.isfinite(columns).all(axis=0)).tolist():
            yield float(table.t[row]), *(int(column[row]) for column in columns)
