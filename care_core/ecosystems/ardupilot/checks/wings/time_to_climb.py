"""A QuadPlane whose take-off the firmware ended, for it took longer than it may."""

from __future__ import annotations

from collections.abc import Iterator

from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.logs.base import Wanted

READS: Wanted = {}

LIMITS = Limits()
_LIMITED_P = LIMITS.add("probability of the time limit", 0.7, "", "a choice: else it climbs too slowly")
_STOPS_P = LIMITS.add("probability that a mission fails of it", 0.95, "", "it lands, and the mission is not flown")
_TEXT = "Failed to complete takeoff within time limit"
_SCALE = "Q_TKOFF_FAIL_SCL"


def find(flight: Flight) -> Iterator[Finding]:
    """The firmware's own word, and the parameter that sets the limit: quadplane.cpp, takeoff_failure_scalar."""
    scale = flight.setting(_SCALE)
    ended_s = next((t for t, text in flight.messages if text.startswith(_TEXT)), None)
    if ended_s is None or not scale:
        return
    yield Finding(
        kind="takeoff",
        title="the take-off took longer than it may",
        onset_s=ended_s,
        end_s=ended_s,
        severity="critical",
        evidence=(
            f'"{_TEXT}": {_SCALE} gives it {scale:g} times what the climb takes at full speed, at least 5 s; with 0 it '
            "has no limit, and a vehicle that does climb too slowly would go on"
        ),
        source=f"MSG; {_SCALE}: ArduPlane/quadplane.cpp",
        suspect="parameter",
        probability=_LIMITED_P,
        mission_lost=_STOPS_P,
        parameters=(_SCALE,),
    )


CHECK = Check("time to climb", "a QuadPlane whose take-off took longer than it may", READS, LIMITS, find)
