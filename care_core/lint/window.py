"""Local costmaps that are too small for what the robot plans on them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

from care_core.lint.contradictions import inscribed_radius
from care_core.lint.problems import Entry, LintedFile, Problem
from care_core.lint.readers import COLLISIONS, SAMPLED, Reader, Readers
from care_core.lint.scopes import COSTMAP, words_of

_TRIED = "what is off the costmap is no valid trajectory (costmap_model.cpp; dwb_critics, map_grid.cpp)"
_SCORED = "off a costmap that does not track unknown space its critics take a trajectory for one that collides"
_CUT = "the path is cut at half of the longer side (getCostmapMaxExtent): the look-ahead is shorter than set"
_STANDS = "a planner cannot tell whether the robot stands in obstacles that are off the costmap"


class Reach(NamedTuple):
    """How far from the robot a local costmap has to reach."""

    far_m: float
    what: str
    source: str
    others: tuple[Entry, ...] = ()
    is_either: bool = False
    """Whether the longer side is what counts."""


def window(file: LintedFile, held: Readers) -> Iterator[Problem]:
    """Local costmaps that are too small for the robot, its look-ahead or its trajectories."""
    for reader in held.of(COSTMAP):
        if not any("local_costmap" in key for key in reader.scope):
            continue
        if reader.is_off("rolling_window"):
            text = "rolling_window of the local costmap is off: the robot drives out of it."
            entry = reader.values["rolling_window"]
            yield file.warning("cannot-work", entry, text, "Switch it on.", "the window stays where it began")
        sides = [one for name in ("width", "height") if (one := reader.values.get(name)) is not None and one.number]
        for reach in _reaches(held, reader) if sides else ():
            side = (max if reach.is_either else min)(sides, key=lambda one: one.number or 0.0)
            if reach.far_m > (side.number or 0.0) / 2 > 0:
                text = (
                    f"{side.keys[-1]} of the local costmap ({side.number:g} m) ends before {reach.what} "
                    f"({reach.far_m:.3g} m)."
                )
                hint = f"Make it more than {2 * reach.far_m:.3g} m{_or_less(reach)}."
                yield file.warning("hinders", side, text, hint, reach.source, reach.others)


def _or_less(reach: Reach) -> str:
    """The other way, by what is set in time or distance: a large costmap costs much on each update."""
    names = [one.keys[-1] for one in reach.others if one.keys[-1] in ("sim_time", "time_steps", "lookahead_dist")]
    return f", or {names[0]} less" if names else ""


def _reaches(held: Readers, costmap: Reader) -> Iterator[Reach]:
    """What a local costmap has to hold."""
    radius = inscribed_radius(costmap.values.get("footprint"), costmap.values.get("robot_radius"))
    if radius is not None:
        yield Reach(radius, "the robot itself", _STANDS)
    for reader in held.of("RegulatedPurePursuitController"):
        ahead = reader.first(("lookahead_dist",))
        if ahead is not None and not reader.is_on("use_velocity_scaled_lookahead_dist"):
            yield Reach(ahead.number or 0.0, "lookahead_dist", _CUT, (ahead,), is_either=True)
    for reader in held.of(*SAMPLED):
        top, time = reader.first(("max_vel_trans", "max_speed_xy", "max_vel_x")), reader.values.get("sim_time")
        if top is not None and time is not None and top.number and time.number:
            far_m = top.number * time.number
            yield Reach(far_m, "where a trajectory of sim_time ends", _TRIED, (top, time))
    for reader in held.of("MPPIController") if not costmap.is_on("track_unknown_space") else ():
        parts = [reader.values.get(name) for name in ("vx_max", "time_steps", "model_dt")]
        known = tuple(entry for entry in parts if entry is not None and entry.number)
        if len(known) == len(parts) and set(COLLISIONS) & set(words_of(reader.values.get("critics"))):
            far_m = math.prod(entry.number or 0.0 for entry in known)
            yield Reach(far_m, "where a trajectory of time_steps ends", _SCORED, known)
