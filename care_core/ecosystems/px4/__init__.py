"""PX4: what its logs say, how its flights are found, and its health checks."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import Any

from care_core.ecosystems.base import Check, Ecosystem, Recording, RunModel
from care_core.ecosystems.dialect import Dialect
from care_core.ecosystems.dictionary import Dictionary
from care_core.ecosystems.findings import Event, Health
from care_core.ecosystems.px4.dialect import QGC_PARAMS
from care_core.logs.base import Channel, Log
from care_core.logs.formats import LogFormat
from care_core.run import Robot


class Px4(Ecosystem):
    """Vehicles that run PX4."""

    name = "px4"
    title = "PX4"
    dialects = (QGC_PARAMS,)
    measures = (
        "care_core.ecosystems.px4.missions",
        "care_core.ecosystems.px4.measures.requested",
        "care_core.ecosystems.px4.measures.route",
        "care_core.ecosystems.px4.measures.signals",
        "care_core.ecosystems.px4.measures.energy",
        "care_core.ecosystems.px4.measures.outcome",
    )

    def model(self, log: Log) -> RunModel:
        from care_core.ecosystems.px4.flight import Px4Flight

        return Px4Flight(log)

    def examine(self, model: RunModel) -> Health:
        from care_core.ecosystems.px4.examining import examine
        from care_core.ecosystems.px4.flight import Px4Flight

        assert isinstance(model, Px4Flight)
        return examine(model)

    def log_messages(self, model: RunModel) -> Iterator[Event]:
        from care_core.ecosystems.px4.flight import log_messages

        return log_messages(model)

    def checks(self) -> tuple[Check[Any], ...]:
        from care_core.ecosystems.px4.checks import CHECKS

        return CHECKS

    def missions(self, channels: tuple[Channel, ...]) -> Iterator[Mapping[str, Any]]:
        yield {"kind": "px4_flight"}

    def messages(self) -> Dictionary:
        from care_core.ecosystems.px4.messages import MESSAGES

        return MESSAGES

    def dialect(self, format: LogFormat, parameters: Iterable[str]) -> Dialect:
        return QGC_PARAMS

    def to_record(self, channels: Collection[str], vehicle: str) -> Recording:
        refusals = "from boot until disarmed: what refuses to arm is in the log, too"
        remarks = {"SDLOG_MODE": refusals, "SDLOG_PROFILE": "the default set, which the health checks read"}
        return Recording((), {"SDLOG_MODE": 1, "SDLOG_PROFILE": 1}, remarks)

    def robots(self, log: Log) -> Iterator[Robot]:
        from care_core.ecosystems.vehicle_identity import robots

        return robots(log)


ECOSYSTEM = Px4()
