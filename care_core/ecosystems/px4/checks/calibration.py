"""A calibration that no sensor needs: what it corrects is measured wrong for the whole flight."""

from __future__ import annotations

from collections.abc import Iterator

from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding, FindingKind
from care_core.ecosystems.px4.calibration import calibrations
from care_core.ecosystems.px4.flight import Px4Flight
from care_core.logs.base import Wanted
from care_core.run import shown

READS: Wanted = {}
LIMITS = Limits()
_SURE_P = LIMITS.add("probability of the calibration", 0.95, "", "no log of some 200 holds one, no simulator needs one")
_LOSES_P = LIMITS.add("probability that a mission fails with it", 0.7, "", "a choice: some are flown, badly")
_SENSORS: tuple[tuple[str, str, FindingKind], ...] = (
    ("CAL_ACC", "an accelerometer", "imu"), ("CAL_GYRO", "a gyroscope", "imu"), ("CAL_MAG", "a compass", "compass"),
)  # fmt: skip


def find(flight: Px4Flight) -> Iterator[Finding]:
    """Of each kind of sensor, where the vehicle was armed: what keeps it from arming is told with the refusal."""
    if not flight.armed:
        return
    for prefix, sensor, kind in _SENSORS:
        used = (name for name in calibrations(prefix) if flight.parameter(f"{name.rpartition('_')[0]}_ID"))
        off = [one for name in used if (one := flight.off_default(name)) is not None]
        if off:
            yield Finding(
                kind=kind,
                title=f"{sensor} is corrected by more than any needs",
                onset_s=flight.armed[0][0],
                end_s=flight.armed[-1][1],
                severity="warning",
                evidence="; ".join(
                    f"{one.name} is {shown(one.value)}, where {shown(one.default)} corrects nothing" for one in off
                ),
                source="parameters CAL_*",
                suspect="parameter",
                parameters=tuple(one.name for one in off),
                probability=_SURE_P,
                mission_lost=_LOSES_P,
            )


CHECK = Check("calibration", "calibrations that no sensor needs", READS, LIMITS, find)
