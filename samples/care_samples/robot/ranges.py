"""What the robot's parameters may be, as its log describes them."""

from __future__ import annotations

from collections.abc import Mapping

RANGES: Mapping[str, tuple[float, float]] = {
    "controller/max_speed": (0.2, 1.2),
    "controller/max_turn_rate": (0.3, 3.0),
    "controller/acceleration": (0.15, 2.0),
    "controller/lookahead": (0.15, 1.6),
    "controller/frequency": (1, 20),
    "controller/slow_distance": (0.05, 1.5),
    "controller/stop_margin": (0.02, 0.5),
    "controller/rotate_first_angle": (0.15, 2.5),
    "controller/goal_tolerance": (0.05, 0.6),
    "controller/patience": (0.5, 15.0),
    "planner/replan_period": (0.3, 15.0),
    "planner/inflation_radius": (0.05, 1.5),
    "planner/obstacle_weight": (0.0, 30.0),
    "planner/footprint_padding": (0.0, 0.4),
    "planner/publish_frequency": (1, 10),
    "battery/low_voltage_stop": (10.8, 12.4),
}


def is_whole(name: str) -> bool:
    """Whether a parameter, named without its namespace, is an integer."""
    return name in ("frequency", "publish_frequency")
