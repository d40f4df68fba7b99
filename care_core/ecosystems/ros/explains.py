"""Which finding on a robot that drives by its sensors can bring about which."""

from __future__ import annotations

from care_core.ecosystems.ranking import Explains

EXPLAINS: Explains = {
    "battery": frozenset({"battery", "drive", "commands", "topics", "laser", "cpu"}),
    "cpu": frozenset({"cpu", "control", "tf", "topics", "commands"}),
    "radio": frozenset({"topics", "laser", "localisation", "commands", "drive", "tf", "imu"}),
    "laser": frozenset({"laser", "localisation", "planner", "blocked", "control", "tf", "software"}),
    "localisation": frozenset({"localisation", "planner", "blocked", "control", "tf"}),
    "drive": frozenset({"drive", "planner", "control"}),
    "commands": frozenset({"drive", "planner"}),
    "blocked": frozenset({"planner", "drive", "control", "tf"}),
    "crash": frozenset({"imu", "localisation", "drive", "planner", "software"}),
    "imu": frozenset({"localisation"}),
    "tf": frozenset({"tf", "planner", "control"}),
    "topics": frozenset({"topics", "tf", "planner"}),
    "planner": frozenset({"planner", "control", "tf"}),
    "software": frozenset({"software", "topics"}),
}
"""A planner that finds no path keeps the computer busy, so that loops and transforms come late."""
