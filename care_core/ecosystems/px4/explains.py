"""Which finding on a PX4 vehicle can bring about which."""

from __future__ import annotations

from care_core.ecosystems.ranking import Explains

EXPLAINS: Explains = {
    "motor": frozenset(("attitude", "crash", "vibration")),
    "battery": frozenset(("motor", "crash")),
    "gps": frozenset(("estimator", "planner")),
    "compass": frozenset(("estimator", "attitude")),
    "vibration": frozenset(("estimator", "attitude")),
    "estimator": frozenset(("attitude", "crash")),
    "imu": frozenset(("estimator", "attitude")),
    "attitude": frozenset(("crash",)),
}
"""By physics, not by statistics: what fails first shows in what follows, the attitude and the crash last."""
