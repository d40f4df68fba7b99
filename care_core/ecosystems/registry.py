"""The ecosystems that the program knows: a new one is one package and one line here."""

from __future__ import annotations

from collections.abc import Collection
from functools import cache
from importlib import import_module

from care_core.ecosystems.base import Ecosystem, RunModel
from care_core.logs.base import Log
from care_core.logs.formats import LogFormat

_PACKAGES = (
    "care_core.ecosystems.ardupilot",
    "care_core.ecosystems.px4",
    "care_core.ecosystems.ros",
)
_ANY_ROBOT = ("care_core.ecosystems.parameter", "care_core.ecosystems.whole_log")
"""Modules with the measures of any recording."""


@cache
def ecosystems() -> tuple[Ecosystem, ...]:
    """All ecosystems."""
    return tuple(import_module(package).ECOSYSTEM for package in _PACKAGES)


def ecosystem_of(format: LogFormat) -> Ecosystem:
    """The ecosystem that writes logs of a format."""
    return next(ecosystem for ecosystem in ecosystems() if ecosystem.name == format.ecosystem)


def how_to_record(channel: str) -> str:
    """What to do before the next run to have a channel in the log."""
    hints = (ecosystem.how_to_record(channel) for ecosystem in ecosystems())
    return next(filter(None, hints), f"record {channel}")


def register_measures(formats: Collection[str] | None = None) -> None:
    """Imports the modules that register mission kinds and extractors: of any robot, and of the ecosystems that write
    logs of formats with these names; of every ecosystem where None is given."""
    chosen = [
        ecosystem
        for ecosystem in ecosystems()
        if formats is None or any(format.name in formats for format in ecosystem.formats)
    ]
    for module in (*(name for ecosystem in chosen for name in ecosystem.measures), *_ANY_ROBOT):
        import_module(module)


def run_model(log: Log) -> RunModel:
    """The run model of a log; nothing is read yet."""
    return ecosystem_of(log.format).model(log)
