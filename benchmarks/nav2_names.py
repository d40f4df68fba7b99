"""What Nav2 calls what move_base has: the `nav2` profile is learned from missions of move_base through these names.

DWB's critics take the weights of DWA over one by one (`path_distance_bias` became PathDist and PathAlign, and so on).
Both multiply a weight of the grid by half the resolution of the costmap and that of the obstacles by nothing, so only
the ratios of the three count. They are multiplied by `WEIGHTS`: DWA's goal weight of 1 is the 24 that Nav2 ships.
"""

from __future__ import annotations

from dataclasses import replace

from care_core.profile.schema import Schema
from care_core.variables import Extract, Variable

WEIGHTS = 24.0
_DWA, _GLOBAL, _LOCAL = "/move_base/DWAPlannerROS", "/move_base/global_costmap", "/move_base/local_costmap"
_LAYERS = {
    "cost_scaling_factor": "inflation/cost_scaling_factor",
    "inflation_radius": "inflation/inflation_radius",
    "combination_method": "obstacles_laser/combination_method",
}
_PLANNER = {
    "path_dist_scale": "path_distance_bias",
    "goal_dist_scale": "goal_distance_bias",
    "base_obstacle_scale": "occdist_scale",
    "max_speed_xy": "max_vel_trans",
    "vtheta_samples": "vth_samples",
}
_EXTRACTS = {
    "spins": Extract("recoveries", {"behavior": "rotate", "absent": 0}),
    "clearings": Extract("recoveries", {"behavior": "reset", "absent": 0}),
}
_MISSION = {
    "kind": "actionlib_goals",
    "goals": [[4.243, 0.118], [6.797, 0.178], [9.391, 0.161], [11.791, 0.188], [14.576, 0.234]],
    "goal_timeout_s": 60,
}
"""That of the recorded missions; a mission is accomplished where each of its goals was reached within that time."""


def on_move_base(nav2: Schema) -> Schema:
    """The schema with the same variables, read from bags of move_base."""
    variables = {name: _on_move_base(variable) for name, variable in nav2.variables.items()}
    return replace(nav2, logs=("ros1-bag",), mission=_MISSION, carried_over="", variables=variables)


def _on_move_base(variable: Variable) -> Variable:
    if variable.name in _EXTRACTS:
        return replace(variable, extract=_EXTRACTS[variable.name])
    if not variable.parameters:
        return variable
    scale = 1 / WEIGHTS if variable.name.endswith("_scale") else 1.0
    return replace(variable, parameters=(_parameter(variable.name),), scale=scale)


def _parameter(option: str) -> str:
    """Where move_base has an option of Nav2."""
    if option == "controller_frequency":
        return "/move_base/controller_frequency"
    for suffix, costmap in (("_global", _GLOBAL), ("_local", _LOCAL)):
        if option.endswith(suffix):
            own = option.removesuffix(suffix)
            return f"{costmap}/{_LAYERS.get(own, own)}"
    return f"{_DWA}/{_PLANNER.get(option, option)}"
