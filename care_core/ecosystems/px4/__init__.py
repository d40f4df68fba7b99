"""PX4: what its logs say, how its flights are found, and its health checks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from care_core.ecosystems.base import Check, Ecosystem, RunModel
from care_core.ecosystems.findings import Health
from care_core.logs.base import Channel, Log, LogFormat


class Px4(Ecosystem):
    """Vehicles that run PX4."""

    name = "px4"
    title = "PX4"
    formats = (LogFormat.PX4_ULG,)
    measures = ("care_core.ecosystems.px4.missions",)

    def model(self, log: Log) -> RunModel:
        return RunModel(log)

    def examine(self, model: RunModel) -> Health:
        from care_core.ecosystems.px4.examining import examine

        return examine(model)

    def checks(self) -> tuple[Check[Any], ...]:
        return ()

    def missions(self, channels: tuple[Channel, ...]) -> Iterator[Mapping[str, Any]]:
        yield {"kind": "px4_flight"}


ECOSYSTEM = Px4()
