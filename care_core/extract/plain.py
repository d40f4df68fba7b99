"""Runs of a log that no profile fits: found and read by the mission kinds that its ecosystem may hold.

What such a run is judged by are the `outcome` checks of its kind. It has no options, metrics or objectives.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from care_core.ecosystems.base import RunModel
from care_core.ecosystems.registry import ecosystem_of
from care_core.errors import NoMissionError
from care_core.extract.read import read_runs, reading_plan
from care_core.logs.base import Log, Wanted
from care_core.logs.digest import Sha256
from care_core.profile.schema import Schema
from care_core.run import Run


def plain_plans(log: Log) -> tuple[Wanted, ...]:
    """What is read of a log that no profile fits, per mission kind that it may hold."""
    return tuple(reading_plan(schema) for schema in _schemas(log))


def read_plain_runs(model: RunModel, sha256: Sha256 | None = None) -> tuple[Run, ...]:
    """Every run of a log in time order, without any profile; empty where the log holds none."""
    for schema in _schemas(model.log):
        try:
            return read_runs(model, schema, sha256=sha256)
        except NoMissionError:
            continue
    return ()


def _schemas(log: Log) -> list[Schema]:
    return [_bare(log, mission) for mission in ecosystem_of(log.format).missions(log.channels())]


def _bare(log: Log, mission: Mapping[str, Any]) -> Schema:
    return Schema("", "", "", "", {}, (log.format.name,), False, mission, (), {})
