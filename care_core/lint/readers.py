"""Who reads what of a ROS configuration, with the values of each, for rules of several values."""

from __future__ import annotations

import ast
from collections.abc import Iterable

from care_core.ecosystems.ros.ros2_yaml import PARAMETERS
from care_core.lint.problems import Entry
from care_core.lint.scopes import Keys, Scoped
from care_core.metadata.navigation import OBSTACLES
from care_core.records import Struct, field

PLANNERS = ("DWAPlannerROS", "TrajectoryPlannerROS", "TebLocalPlannerROS")
CONTROLLERS = ("DWBLocalPlanner", "MPPIController", "RegulatedPurePursuitController", "GracefulController")
SHIM = "RotationShimController"
"""Reads its own values and hands all of them on to its primary controller."""
CHECKERS = ("SimpleGoalChecker", "StoppedGoalChecker", "PositionGoalChecker")
PROGRESS = ("SimpleProgressChecker", "PoseProgressChecker")
MARKING = (*OBSTACLES, "RangeSensorLayer")
"""Layers that put what sensors see into a costmap."""
INFLATIONS = ("InflationLayer", "LegacyInflationLayer", "AsymmetricInflationLayer")
SAMPLED = ("DWAPlannerROS", "TrajectoryPlannerROS", "DWBLocalPlanner")
"""Planners that try speeds out, over a time ahead."""
COLLISIONS = ("CostCritic", "ObstaclesCritic")
"""MPPI's critics that hold trajectories, and footprints, against the costmap."""
TOP_SPEEDS = ("max_vel_x", "vx_max", "desired_linear_vel", "max_linear_vel", "v_linear_max")


class Reader(Struct, eq=False):
    """A node or plugin with the values that it reads, by its own names for them."""

    owners: tuple[str, ...]
    scope: Keys
    values: dict[str, Entry] = field(default_factory=dict)

    def name(self) -> str:
        """What its namespace or node is called, empty where the file gives it no name."""
        return next((key for key in reversed(self.scope) if key != PARAMETERS), "")

    def number(self, name: str) -> float | None:
        entry = self.values.get(name)
        return None if entry is None else entry.number

    def first(self, names: Iterable[str]) -> Entry | None:
        """The first of these that has a number."""
        held = (self.values[name] for name in names if name in self.values)
        return next((one for one in held if one.number is not None), None)

    def is_off(self, name: str) -> bool:
        return name in self.values and self.values[name].value == "false"

    def is_on(self, name: str) -> bool:
        return name in self.values and self.values[name].value == "true"

    def has_footprint(self) -> bool:
        """Whether a costmap's robot is drawn, and is not a circle."""
        return "footprint" in self.values and str(self.values["footprint"].value).strip() not in ("", "[]")

    def own(self, name: str) -> list[Entry]:
        """A value of its own or of its parts, such as the sources of a layer."""
        return [entry for key, entry in self.values.items() if key.rpartition(".")[2] == name]

    def is_a(self, *owners: str) -> bool:
        """Whether it is one of these: every reader that it may be, or the controller that a shim hands on to."""
        handed = [one for one in self.owners if one != SHIM]
        return all(one in owners for one in handed or self.owners) or (SHIM in self.owners and SHIM in owners)


class Readers(tuple[Reader, ...]):
    """Every reader of a file."""

    __slots__ = ()

    def of(self, *owners: str) -> list[Reader]:
        return [one for one in self if one.is_a(*owners)]

    def one(self, owners: Iterable[str], names: Iterable[str]) -> Entry | None:
        """The only value of these names; None where there is none, or several differ."""
        found = [entry for one in self.of(*owners) if (entry := one.first(names)) is not None]
        return found[0] if found and len({entry.number for entry in found}) == 1 else None

    def within(self, scope: Keys) -> list[Reader]:
        """The readers below a scope."""
        return [one for one in self if len(one.scope) > len(scope) and one.scope[: len(scope)] == scope]


def readers(result: Scoped) -> Readers:
    """The values of a file by who reads them."""
    found: dict[tuple[tuple[str, ...], Keys], Reader] = {}
    for place in result.places:
        if place.owners:
            reader = found.setdefault((place.owners, place.scope), Reader(place.owners, place.scope))
            reader.values[place.name] = place.entry
    return Readers(found.values())


def numbers(entry: Entry | None) -> list[float]:
    """A list of numbers, empty where it is none."""
    if entry is None or not isinstance(entry.value, str):
        return []
    try:
        held = ast.literal_eval(entry.value.strip())
        return [float(one) for one in held]
    except (ValueError, TypeError, SyntaxError, MemoryError, RecursionError):
        return []
