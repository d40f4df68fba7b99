"""Health checks of PX4 logs, one module each."""

from __future__ import annotations

from care_core.ecosystems.base import Check
from care_core.ecosystems.px4.checks import (
    arming,
    attitude,
    barometer,
    battery,
    blocked,
    calibration,
    changes,
    crash,
    errors,
    estimator,
    flags,
    idle,
    kill_switch,
    lift,
    log,
    motor,
    not_numbers,
    power,
    recorded,
    rotors,
    spin,
    twist,
    unplaced,
    vibration,
)
from care_core.ecosystems.px4.flight import Px4Flight

CHECKS: tuple[Check[Px4Flight], ...] = (
    not_numbers.CHECK,
    flags.CHECK,
    estimator.CHECK,
    unplaced.CHECK,
    motor.CHECK,
    rotors.CHECK,
    calibration.CHECK,
    twist.CHECK,
    lift.CHECK,
    power.CHECK,
    idle.CHECK,
    vibration.CHECK,
    barometer.CHECK,
    battery.CHECK,
    changes.CHECK,
    attitude.CHECK,
    spin.CHECK,
    crash.CHECK,
    blocked.CHECK,
    errors.CHECK,
    recorded.CHECK,
    kill_switch.CHECK,
    arming.CHECK,
    log.CHECK,
)
