"""Sources that were recorded in part, or only repeat themselves while the vehicle moves."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from care_core.ecosystems import liveness
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.px4 import sources
from care_core.ecosystems.px4.flight import Px4Flight

_NEVER = np.empty(0)


def find(flight: Px4Flight) -> Iterator[Finding]:
    """What froze, what fell silent, what was never connected, and what was recorded in part."""
    yield from liveness.findings(flight.frozen)
    yield from liveness.unconnected(flight.unconnected, flight.end_s)
    topics = {source.message for source in sources.SOURCES}
    recorded = {topic: table.t for topic, table in flight.tables(sources.READS).items() if topic in topics}
    for source in sources.SENSORS:
        silent = list(liveness.fell_silent(recorded.get(source.message, _NEVER), source, flight.armed))
        yield from silent
        if silent:
            del recorded[source.message]
    yield from liveness.recorded_in_part(recorded, flight.armed)


CHECK = Check(
    "recorded", "sources that were recorded in part, or repeat themselves while the vehicle moves", sources.READS,
    Limits([*liveness.LIMITS, *sources.LIMITS]), find,
)  # fmt: skip
