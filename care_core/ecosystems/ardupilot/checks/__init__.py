"""Health checks, one module each: `READS`, what it looks at, and `find`, what is wrong in a flight."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol

from care_core.ecosystems.ardupilot.checks import (
    attitude,
    barometer,
    battery,
    blocked,
    changes,
    compass,
    cpu,
    crash,
    estimator,
    gps,
    imu,
    log,
    motor,
    prearm,
    radio,
    thrust,
    vibration,
)
from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.findings import Finding
from care_core.logs.base import Wanted


class Check(Protocol):
    """A module of this package."""

    @property
    def READS(self) -> Wanted: ...  # noqa: N802

    def find(self, flight: Flight) -> Iterable[Finding]:
        """What is wrong, nothing where the log holds too little to say."""


CHECKS: tuple[Check, ...] = (
    attitude, barometer, battery, blocked, changes, compass, cpu, crash, estimator, gps, imu, log, motor, prearm, radio,
    thrust, vibration,
)  # fmt: skip
