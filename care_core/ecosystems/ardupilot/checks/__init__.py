"""Health checks of ArduPilot logs, one module each."""

from __future__ import annotations

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
    fence,
    gps,
    imu,
    lever_arm,
    log,
    motor,
    prearm,
    radio,
    rate_loop,
    recorded,
    takeoff,
    thrust,
    vibration,
    way_home,
)
from care_core.ecosystems.ardupilot.checks.settings import driven, heading, hover, level, outputs, supply
from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.base import Check

CHECKS: tuple[Check[Flight], ...] = (
    heading.CHECK,
    hover.CHECK,
    level.CHECK,
    supply.CHECK,
    driven.CHECK,
    outputs.CHECK,
    attitude.CHECK,
    barometer.CHECK,
    battery.CHECK,
    blocked.CHECK,
    changes.CHECK,
    compass.CHECK,
    cpu.CHECK,
    crash.CHECK,
    estimator.CHECK,
    fence.CHECK,
    recorded.CHECK,
    gps.CHECK,
    imu.CHECK,
    lever_arm.CHECK,
    log.CHECK,
    motor.CHECK,
    prearm.CHECK,
    radio.CHECK,
    rate_loop.CHECK,
    takeoff.CHECK,
    thrust.CHECK,
    vibration.CHECK,
    way_home.CHECK,
)
