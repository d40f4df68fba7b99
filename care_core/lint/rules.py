"""The rules as data: what each finds, and from what source it is known."""

from __future__ import annotations

from typing import NamedTuple


class Rule(NamedTuple):
    """A rule by its id, as reports and SARIF name it."""

    id: str
    about: str
    source: str


_TABLES = "the sources of each release, as tables"
RULES: tuple[Rule, ...] = (
    Rule("syntax", "A line that the reader of the format refuses.", "the format: YAML, NAME VALUE, or five columns"),
    Rule("empty", "A file without any parameter.", "whoever loads it runs on its defaults"),
    Rule("no-parameters", "Values of Nav2's nodes where ROS 2 reads none.", "ROS 2 reads below ros__parameters"),
    Rule("duplicate", "The same parameter twice in one file.", "how the readers of the format work"),
    Rule("unknown-key", "A name that nothing reads in any release.", _TABLES),
    Rule("misplaced-key", "A name that is read elsewhere, but not at that place.", _TABLES),
    Rule("renamed", "A name that another release has instead.", _TABLES),
    Rule("dead-key", "A name that is known and has no effect here.", "the source file that the problem names"),
    Rule("plugin-name", "A plugin that the release, or any, has under another name.", "its plugin description files"),
    Rule("not-loaded", "Parameters of a plugin that no list names.", "plugins are loaded by the lists that name them"),
    Rule("wrong-type", "A value of another type than is declared.", "rclcpp refuses it, roscpp takes the default"),
    Rule("out-of-range", "A value outside the declared range.", _TABLES),
    Rule("not-in-values", "A value that is none of those declared.", _TABLES),
    Rule("wrong-unit", "A value off by the ratio of two units.", "the declared range, or what an angle can be"),
    Rule("clearance", "A costmap in which plans may touch obstacles.", "the source that the problem names"),
    Rule("contradiction", "Two values that cannot both be meant.", "the source that the problem names"),
    Rule("cannot-work", "A value with which its node cannot do its work.", "the source that the problem names"),
    Rule("hinders", "A value that makes a mission likely to fail.", "the source that the problem names"),
    Rule("outside-profile", "A value outside what the profile holds acceptable.", "the profile's `range`"),
)  # fmt: skip
BY_ID = {rule.id: rule for rule in RULES}


class Renamed(NamedTuple):
    """A parameter of a node or plugin that another name replaced in a distribution."""

    owner: str
    old: str
    new: str
    since: str


ROS1_RENAMED: tuple[Renamed, ...] = (
    *(
        Renamed("DWAPlannerROS", old, new, "melodic")
        for old, new in (
            ("max_trans_vel", "max_vel_trans"), ("min_trans_vel", "min_vel_trans"), ("max_rot_vel", "max_vel_theta"),
            ("min_rot_vel", "min_vel_theta"), ("rot_stopped_vel", "theta_stopped_vel"),
            ("acc_limit_trans", "acc_lim_trans"),
        )
    ),
    Renamed("TrajectoryPlannerROS", "acc_lim_th", "acc_lim_theta", "kinetic"),
)  # fmt: skip
"""dwa_planner_ros.cpp of melodic and noetic warns of the old names and does not read them; indigo's
trajectory_planner_ros.cpp warns of its old name and reads both."""

ROS2_RENAMED: tuple[Renamed, ...] = (
    Renamed("behavior_server", "recovery_plugins", "behavior_plugins", "humble"),
    Renamed("behavior_server", "costmap_topic", "local_costmap_topic", "iron"),
    Renamed("behavior_server", "footprint_topic", "local_footprint_topic", "iron"),
    Renamed("controller_server", "goal_checker_plugin", "goal_checker_plugins", "galactic"),
    Renamed("controller_server", "progress_checker_plugin", "progress_checker_plugins", "iron"),
    Renamed("bt_navigator", "default_bt_xml_filename", "default_nav_to_pose_bt_xml", "galactic"),
    Renamed("bt_navigator", "error_code_names", "error_code_name_prefixes", "kilted"),
    Renamed("ObstacleLayer", "<source>.obstacle_range", "<source>.obstacle_max_range", "galactic"),
    Renamed("ObstacleLayer", "<source>.raytrace_range", "<source>.raytrace_max_range", "galactic"),
    Renamed("VoxelLayer", "<source>.obstacle_range", "<source>.obstacle_max_range", "galactic"),
    Renamed("VoxelLayer", "<source>.raytrace_range", "<source>.raytrace_max_range", "galactic"),
    Renamed("RegulatedPurePursuitController", "desired_linear_vel", "max_linear_vel", "lyrical"),
    Renamed(
        "RegulatedPurePursuitController", "max_allowed_time_to_collision",
        "max_allowed_time_to_collision_up_to_carrot", "humble",
    ),
    Renamed("Polygon", "max_points", "min_points", "iron"),
)  # fmt: skip
"""Old and new name in the sources of neighbouring distributions."""

ROS2_NODES_RENAMED: tuple[tuple[str, str, str, str], ...] = (
    ("recoveries_server", "behavior_server", "humble",
     "recovery_plugins behavior_plugins, and the package of its plugins nav2_behaviors"),
)  # fmt: skip
"""Nodes: the old name, the new one, the distribution that has it, and what else has another name since then."""

ROS2_ALONE = frozenset({
    "bt_navigator", "controller_server", "planner_server", "smoother_server", "behavior_server", "recoveries_server",
})  # fmt: skip
"""Nodes of Nav2 by names that no node of ROS 1 has."""


class Rescaled(NamedTuple):
    """A parameter that has another unit and type since a distribution."""

    owner: str
    name: str
    since: str
    ratio: float
    """How many of the old unit make one of the new."""
    old: str
    new: str
    """The units, in words."""
    between: float
    """Values from this on are meant in the old unit, those below in the new one."""


RESCALED: tuple[Rescaled, ...] = (
    Rescaled("map_saver", "save_map_timeout", "galactic", 1000.0, "milliseconds", "seconds", 100.0),
)
"""map_saver.cpp of foxy declares 2000 and counts milliseconds, that of galactic 2.0 and counts seconds."""


class Leftover(NamedTuple):
    """A name that files of Nav2 itself hold and nothing reads: with the value that counts anyway it misleads nobody."""

    owner: str
    name: str
    reads: tuple[str, ...]
    """Who reads it, under the part of its own."""
    default: str
    """What those take where nothing is written."""
    source: str


LEFTOVERS: tuple[Leftover, ...] = (
    Leftover(
        "DWBLocalPlanner", "stateful",
        ("SimpleGoalChecker", "StoppedGoalChecker", "PositionGoalChecker", "AdaptiveToleranceGoalChecker"), "true",
        "simple_goal_checker.cpp declares it under the name of the goal checker, and dwb_core nothing of that name",
    ),
    Leftover(
        "docking_server", "simulation_step", (), "0.1",
        "controller.cpp of opennav_docking declares controller.simulation_time_step",
    ),
)  # fmt: skip
"""nav2_params.yaml of foxy to iron holds the first, that of jazzy to rolling the second."""


class Paired(NamedTuple):
    """Two lists of eloquent, of names and of classes side by side, for which releases since foxy have one of names."""

    owner: str
    names: str
    classes: str
    now: str


PAIRED: tuple[Paired, ...] = (
    Paired("costmap", "plugin_names", "plugin_types", "plugins"),
    Paired("controller_server", "controller_plugin_ids", "controller_plugin_types", "controller_plugins"),
    Paired("planner_server", "planner_plugin_ids", "planner_plugin_types", "planner_plugins"),
)
PAIRED_SOURCE = "costmap_2d_ros.cpp, nav2_controller.cpp and planner_server.cpp of eloquent and foxy"

MEANT: dict[tuple[str, str], str] = {
    ("DWAPlannerROS", "max_vel_rot"): "max_vel_theta",
    ("DWAPlannerROS", "min_vel_rot"): "min_vel_theta",
    ("DWAPlannerROS", "acc_lim_th"): "acc_lim_theta",
    ("DWAPlannerROS", "vtheta_samples"): "vth_samples",
    ("TrajectoryPlannerROS", "vth_samples"): "vtheta_samples",
    ("behavior_server", "transform_timeout"): "transform_tolerance",
    ("move_base", "recovery_behaviour_enabled"): "recovery_behavior_enabled",
    ("controller_server", "plugins"): "controller_plugins",
    ("planner_server", "plugins"): "planner_plugins",
    ("behavior_server", "plugins"): "behavior_plugins",
    ("smoother_server", "plugins"): "smoother_plugins",
    ("amcl", "initial_pose_x"): "initial_pose.x",
    ("amcl", "initial_pose_y"): "initial_pose.y",
    ("amcl", "initial_pose_a"): "initial_pose.yaw",
    ("DWBLocalPlanner", "max_speed_theta"): "max_vel_theta",
    ("GracefulController", "initial_rotation_threshold"): "initial_rotation_tolerance",
    ("velocity_smoother", "max_vel"): "max_velocity",
    ("velocity_smoother", "min_vel"): "min_velocity",
}
"""Names that nobody reads, and the one that is meant, where the spelling alone does not tell."""
