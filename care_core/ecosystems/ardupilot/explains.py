"""Which finding on an ArduPilot vehicle can bring about which."""

from __future__ import annotations

from collections.abc import Mapping

from care_core.ecosystems.findings import FindingKind

_FALL: frozenset[FindingKind] = frozenset(("attitude", "crash", "takeoff", "log"))

EXPLAINS: Mapping[FindingKind, frozenset[FindingKind]] = {
    "vibration": frozenset(("imu", "estimator", "barometer", "tuning", "compass", "thrust", *_FALL)),
    "imu": frozenset(("vibration", "estimator", "tuning", "thrust", *_FALL)),
    "motor": frozenset(
        ("thrust", "tuning", "vibration", "estimator", "battery", "gps", "compass", "barometer", *_FALL)
    ),
    "thrust": frozenset(("battery", *_FALL)),
    "battery": frozenset(("thrust", "motor", "log", "attitude", "crash")),
    "gps": frozenset(("estimator", "attitude", "crash", "prearm")),
    "compass": frozenset(("estimator", "gps", "prearm", *_FALL)),
    "barometer": frozenset(("estimator", "thrust", "crash", "prearm")),
    "estimator": frozenset(("attitude", "crash", "prearm", "gps", "compass")),
    "tuning": frozenset(("vibration", "thrust", "estimator", *_FALL)),
    "cpu": frozenset(("estimator", "tuning", "log", "attitude", "crash")),
    "radio": frozenset(("crash",)),
    "takeoff": frozenset(
        ("attitude", "crash", "motor", "thrust", "vibration", "estimator", "compass", "tuning", "imu")
    ),
    "attitude": frozenset(("crash", "takeoff", "thrust", "estimator", "vibration", "motor")),
    "crash": frozenset(("attitude", "log")),
    "blocked": frozenset(("motor", "thrust", "tuning", "vibration", "attitude", "crash", "log")),
}
"""By physics, not by statistics: what fails first shows in what follows, the attitude and the crash last."""
