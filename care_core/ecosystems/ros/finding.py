"""All findings of a ROS recording, the first cause before its consequences."""

from __future__ import annotations

from care_core.ecosystems.findings import Finding
from care_core.ecosystems.ranking import Explains, rank_findings
from care_core.ecosystems.ros.checks import CHECKS
from care_core.ecosystems.ros.recording import Recording

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
"""What each kind of finding can bring about, in a robot that drives by its sensors. A planner that finds no way keeps
the computer busy, so that loops and transforms come late."""


def find(recording: Recording) -> tuple[Finding, ...]:
    """What was not as it should be, in the order told."""
    return rank_findings((finding for check in CHECKS for finding in check(recording)), EXPLAINS)
