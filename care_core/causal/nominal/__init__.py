"""What physics says a mission takes: formulas that a profile names for a variable, and a mechanism corrects.

A few hundred missions cannot teach how far it is to every waypoint, but nobody has to learn that: the autopilot's
speed profile is known. A mechanism then learns what is left, the ratio of the value to its nominal, which is much the
same on every mission. Arguments are arrays of one value a run, in m, s, m/s, W, degrees and their like.
"""

from __future__ import annotations

from care_core.causal.nominal import goals, multicopters, planes, px4, rovers, submarines  # each registers its formulas
from care_core.causal.nominal.formulas import FORMULAS, Nominal, nominal

__all__ = ["FORMULAS", "Nominal", "goals", "multicopters", "nominal", "planes", "px4", "rovers", "submarines"]
