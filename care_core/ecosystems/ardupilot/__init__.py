"""ArduPilot: what its logs say, the model of a flight or drive, health checks and measures of it."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import Any

from care_core.ecosystems.ardupilot.dialect import ARDUPILOT_PARAM
from care_core.ecosystems.base import Check, Ecosystem, Recording, RunModel
from care_core.ecosystems.dialect import Dialect
from care_core.ecosystems.dictionary import Dictionary, find_message
from care_core.ecosystems.findings import Event, Health
from care_core.logs.base import Channel, Log
from care_core.logs.formats import LogFormat
from care_core.run import Robot

_COPTER_BITS, _OTHER_BITS = 176126, 65535
"""LOG_BITMASK as ArduCopter, Plane and Rover are delivered (their Parameters.cpp, 4.0 to 4.6)."""


class ArduPilot(Ecosystem):
    """Copters, planes, rovers and submarines that run ArduPilot."""

    name = "ardupilot"
    title = "ArduPilot"
    dialects = (ARDUPILOT_PARAM,)
    measures = (
        "care_core.ecosystems.ardupilot.measures.energy",
        "care_core.ecosystems.ardupilot.measures.events",
        "care_core.ecosystems.ardupilot.measures.hover",
        "care_core.ecosystems.ardupilot.measures.mission",
        "care_core.ecosystems.ardupilot.measures.outcome",
        "care_core.ecosystems.ardupilot.measures.requested",
        "care_core.ecosystems.ardupilot.measures.rover",
        "care_core.ecosystems.ardupilot.measures.route",
        "care_core.ecosystems.ardupilot.measures.signals",
        "care_core.ecosystems.ardupilot.measures.whole_way",
        "care_core.ecosystems.ardupilot.measures.winged",
    )

    def model(self, log: Log) -> RunModel:
        from care_core.ecosystems.ardupilot.flight import Flight
        from care_core.ecosystems.ardupilot.heights import in_metres
        from care_core.ecosystems.ardupilot.rates import in_degrees
        from care_core.logs.telemetry import as_dataflash

        return Flight(as_dataflash(in_degrees(in_metres(log))))

    def examine(self, model: RunModel) -> Health:
        from care_core.ecosystems.ardupilot.examining import examine
        from care_core.ecosystems.ardupilot.flight import as_flight

        return examine(as_flight(model))

    def log_messages(self, model: RunModel) -> Iterator[Event]:
        from care_core.ecosystems.ardupilot.flight import as_flight
        from care_core.ecosystems.ardupilot.log_messages import log_messages

        return log_messages(as_flight(model))

    def checks(self) -> tuple[Check[Any], ...]:
        from care_core.ecosystems.ardupilot.checks import CHECKS

        return CHECKS

    def missions(self, channels: tuple[Channel, ...]) -> Iterator[Mapping[str, Any]]:
        yield {"kind": "ardupilot_flight"}
        yield {"kind": "ardupilot_unrecorded_arming"}

    def messages(self) -> Dictionary:
        from care_core.ecosystems.ardupilot.messages import MESSAGES

        return MESSAGES

    def dialect(self, format: LogFormat, parameters: Iterable[str]) -> Dialect:
        return ARDUPILOT_PARAM

    def robots(self, log: Log) -> Iterator[Robot]:
        from care_core.ecosystems.vehicle_identity import robots

        return robots(log)

    def how_to_record(self, channel: str) -> str:
        known = find_message(self.messages(), channel.partition(" ")[0])
        return f"{known.how_to_record}, so that the vehicle writes {channel}" if known and known.how_to_record else ""

    def to_record(self, channels: Collection[str], vehicle: str) -> Recording:
        messages = self.messages()
        known = [found for name in channels if (found := find_message(messages, name)) is not None]
        bits = _COPTER_BITS if vehicle == "copter" else _OTHER_BITS
        if vehicle == "copter":
            for one in known:
                bits |= one.log_bits
        return Recording(
            tuple(sorted(channels)),
            {"LOG_BITMASK": bits, "LOG_DISARMED": 1, "LOG_BACKEND_TYPE": 1},
            {
                "LOG_BITMASK": "the firmware's default and what is read",
                "LOG_DISARMED": "what refuses to arm is in the log, too",
                "LOG_BACKEND_TYPE": "to the card",
            },
        )


ECOSYSTEM = ArduPilot()
