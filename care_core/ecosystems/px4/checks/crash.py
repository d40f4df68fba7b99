"""Control that was lost in the air, and a contact with the ground at speed."""

from __future__ import annotations

from collections.abc import Iterator

from care_core.ecosystems.base import Check
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.px4 import upset
from care_core.ecosystems.px4.flight import Px4Flight
from care_core.ecosystems.px4.upset import LEFT_DEG, LIMITS, READS

_LOST = LIMITS.add("probability of gains, control lost", 0.85, "", "training flights: 14 of 15, else a motor")
_CRASHED = LIMITS.add("probability that a part broke", 0.1, "", "a choice: a crash says that it failed, hardly why")


def find(flight: Px4Flight) -> Iterator[Finding]:
    lost, hit = upset.lost_control(flight), upset.hit(flight)
    if lost is not None:
        yield Finding(
            kind="attitude",
            title="control was lost",
            onset_s=lost.time_s,
            end_s=flight.end_s if hit is None else max(hit.time_s, lost.time_s),
            severity="critical",
            evidence=f"the attitude is up to {lost.most_deg:.0f} deg off its target and does not recover",
            source=f"vehicle_attitude, vehicle_attitude_setpoint; above {LEFT_DEG:g} deg",
            suspect="parameter",
            probability=_LOST,
        )
    if hit is not None:
        stop = "stayed there" if hit.blow is None else f"felt a blow of {hit.blow:.0f} m/s^2"
        yield Finding(
            kind="crash",
            title=f"it hit the ground at {hit.speed_ms:.1f} m/s",
            onset_s=hit.time_s,
            end_s=hit.time_s,
            severity="critical",
            evidence=f"it came down at {hit.speed_ms:.1f} m/s and {stop}",
            source="vehicle_local_position.z, sensor_combined",
            probability=_CRASHED,
        )


CHECK = Check("crash", "control lost in the air, a contact with the ground at speed", READS, LIMITS, find)
