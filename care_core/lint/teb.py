"""TEB (ROS 1): what it warns of itself as it starts, and obstacles that are nearer than they may be."""

from __future__ import annotations

from collections.abc import Iterator

from care_core.lint.clashes import Clash, check
from care_core.lint.problems import LintedFile, Problem
from care_core.lint.readers import Readers

_TEB = "TebLocalPlannerROS"
_CHECKED = "teb_config.cpp of teb_local_planner, checkParameters"
_BROKEN, _HINDERS = "cannot-work", "hinders"
_SPEEDS = ("max_vel_x", "max_vel_x_backwards", "max_vel_theta", "acc_lim_x", "acc_lim_theta")
CLASHES: tuple[Clash, ...] = (
    Clash("dt_hysteresis >= dt_ref", "dt_hysteresis ({dt_hysteresis}) is not below dt_ref ({dt_ref}): no point of a "
          "trajectory is ever taken out.", "A tenth of dt_ref is usual.", _CHECKED),
    Clash("inflation_dist <= min_obstacle_dist; inflation_dist > 0", "inflation_dist ({inflation_dist} m) is not above "
          "min_obstacle_dist ({min_obstacle_dist} m): it has no effect.",
          "Make it larger, or 0 where nothing is to be inflated.", "optimal_planner.cpp of teb_local_planner",
          "dead-key"),
    Clash("weight_optimaltime <= 0", "weight_optimaltime is {weight_optimaltime}: nothing draws the robot on.",
          "It must be above 0, also where weight_shortest_path is used.", _CHECKED, _HINDERS),
    Clash("min_samples < 3", "min_samples is {min_samples}: no trajectory of so few points can be planned.",
          "3 is the default.", _CHECKED, _BROKEN),
    Clash("max_vel_x_backwards <= 0", "max_vel_x_backwards is {max_vel_x_backwards}: what TEB does then is undefined.",
          "Keep it above 0, and raise weight_kinematics_forward_drive against driving backwards.", _CHECKED,
          _HINDERS),
    Clash("max_vel_trans < max_vel_x; max_vel_trans > 0", "max_vel_trans ({max_vel_trans}) is below max_vel_x "
          "({max_vel_x}): the robot never drives so fast.", "Give both the same.",
          "teb_local_planner_ros.cpp, saturateVelocity", "contradiction"),
    Clash("weight_adapt_factor < 1", "weight_adapt_factor is {weight_adapt_factor}: obstacles count less with every "
          "round.", "It must be 1 or more.", _CHECKED, _HINDERS),
    Clash("cmd_angle_instead_rotvel = true; wheelbase = 0", "cmd_angle_instead_rotvel is on, and wheelbase is 0: there "
          "is no steering angle.", "Give it the distance of the axles.", _CHECKED, _BROKEN),
    Clash("cmd_angle_instead_rotvel = true; min_turning_radius = 0", "cmd_angle_instead_rotvel is on, and "
          "min_turning_radius is 0: a car is planned like a robot that turns in place.",
          "Give it the least radius that the wheels allow.", _CHECKED, _HINDERS),
    *(
        Clash(f"{name} <= penalty_epsilon; {name} > 0", f"{name} ({{{name}}}) is not above penalty_epsilon "
              "({penalty_epsilon}): its bound turns negative.", "Raise the one or lower the other.", _CHECKED, _HINDERS)
        for name in _SPEEDS
    ),
)  # fmt: skip


def _clashes(file: LintedFile, held: Readers) -> Iterator[Problem]:
    for reader in held.of(_TEB):
        yield from check(file, {name.rpartition(".")[2]: one for name, one in reader.values.items()}, CLASHES)


RULES = (_clashes,)
