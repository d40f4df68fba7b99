"""DWB, which tries trajectories out: what its critics have to look at, and limits that none can keep."""

from __future__ import annotations

from collections.abc import Iterator

from care_core.errors import nearest
from care_core.lint.problems import LintedFile, Problem, Severity
from care_core.lint.readers import Reader, Readers
from care_core.lint.scopes import class_of, words_of

_DRAWING = {"PathAlign", "PathDist", "GoalAlign", "GoalDist"}
"""Critics for which a place nearer to the path or its end is better."""
_CRITICS = _DRAWING | {
    "BaseObstacle", "ObstacleFootprint", "Oscillation", "PreferForward", "RotateToGoal", "Twirling",
}  # fmt: skip
"""Of dwb_critics in every release: what another package's critic looks at, nobody here knows."""
_SPEEDS = (
    "dwb_plugins, xy_theta_iterator.cpp: what is slower than min_speed_xy and than min_speed_theta is no valid speed"
)


def _drawn(file: LintedFile, held: Readers) -> Iterator[Problem]:
    """DWB without any critic that draws it along: every free trajectory is as good as standing."""
    for reader in held.of("DWBLocalPlanner"):
        entry, known = reader.values.get("critics"), set(_classes(reader).values())
        if entry is None or not known or not known <= _CRITICS or known & _DRAWING:
            continue
        text = "No critic of DWBLocalPlanner looks at the path or the goal: nothing draws the robot along."
        hint = "Add PathAlign, PathDist, GoalAlign and GoalDist to the list."
        yield file.warning("cannot-work", entry, text, hint, "dwb_critics, map_grid.cpp")


def _classes(reader: Reader) -> dict[str, str]:
    """The critics of a list by name, each with its class without its package and without what all end with."""
    found = {}
    for name in words_of(reader.values.get("critics")):
        told = reader.values.get(f"{name}.class")
        found[name] = class_of(str(told.value) if told is not None else name).removesuffix("Critic")
    return found


def _misspelled(file: LintedFile, held: Readers) -> Iterator[Problem]:
    """Critics that the package in which DWB looks for names without one does not have."""
    for reader in held.of("DWBLocalPlanner"):
        entry = reader.values.get("critics")
        if entry is None or entry.kind != "list" or "::" in str(entry.value) or _looks_elsewhere(reader):
            continue
        for name, kind in _classes(reader).items():
            meant = nearest(kind, _CRITICS)
            if f"{name}.class" in reader.values or kind in _CRITICS or not meant:
                continue
            text = f"critics names {name}, and dwb_critics has no such critic: controller_server will not start."
            yield file.error("plugin-name", entry, text, meant, "dwb_local_planner.cpp")


def _looks_elsewhere(reader: Reader) -> bool:
    return "default_critic_namespaces" in reader.values


def _turning(file: LintedFile, held: Readers) -> Iterator[Problem]:
    """Turns that must be faster than they may: no turn in place is valid, unless min_speed_xy lets all speeds be."""
    for reader in held.of("DWBLocalPlanner"):
        entry, top = reader.values.get("min_speed_theta"), reader.values.get("max_vel_theta")
        least, most = (reader.number(name) or 0.0 for name in ("min_speed_theta", "max_vel_theta"))
        if entry is None or top is None or not 0 < most < least:
            continue
        is_asked = (reader.number("min_speed_xy") or 0.0) > 0
        what = "the robot can never turn in place" if is_asked else "no turn is so fast, where it counts"
        text = f"min_speed_theta ({least:g}) is above max_vel_theta ({most:g}): {what}."
        hint = f"The other is in line {top.line}." if top.line else ""
        severity = Severity.WARNING if is_asked else Severity.NOTE
        yield file.problem("contradiction", severity, entry, text, hint, _SPEEDS, [top])


RULES = (_drawn, _misspelled, _turning)
