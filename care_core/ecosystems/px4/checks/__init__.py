"""Health checks of PX4 logs, one module each."""

from __future__ import annotations

from care_core.ecosystems.base import Check
from care_core.ecosystems.px4.checks import arming, estimator, flags, kill_switch
from care_core.ecosystems.px4.flight import Px4Flight

CHECKS: tuple[Check[Px4Flight], ...] = (flags.CHECK, estimator.CHECK, kill_switch.CHECK, arming.CHECK)
