"""Sources that were recorded in part, or only repeat themselves while the vehicle moves."""

from __future__ import annotations

from collections.abc import Iterator

from care_core.ecosystems import liveness
from care_core.ecosystems.ardupilot import sources
from care_core.ecosystems.ardupilot.checks.wings.airspeed import LOST_P
from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.ardupilot.measures.samples import named
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.records import replace


def find(flight: Flight) -> Iterator[Finding]:
    """What froze, what was never connected, and what was recorded in part."""
    for one in liveness.findings(flight.frozen):
        steers = one.kind == "airspeed" and flight.is_winged
        yield replace(one, mission_lost=LOST_P) if steers else one
    failsafe = flight.battery_failsafe_s is not None  # whose finding says what its monitor measures
    lacking = (one for one in sources.unconnected(flight, flight.hovering) if one.kind != "battery" or not failsafe)
    yield from liveness.unconnected(lacking, flight.end_s)
    messages = dict.fromkeys(source.message for source in sources.SOURCES)
    recorded = {named(name): table.t for name in messages if (table := flight.one(name)) is not None}
    yield from liveness.recorded_in_part(recorded, flight.armed)


CHECK = Check(
    "recorded", "sources that were recorded in part, or repeat themselves while the vehicle moves", sources.READS,
    Limits([*liveness.LIMITS, *sources.LIMITS]), find,
)  # fmt: skip
