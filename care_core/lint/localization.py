"""robot_localization: what its filters fuse, the frames they join, and what navsat_transform takes for radians."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from itertools import combinations

from care_core.ecosystems.ros.ros2_yaml import PARAMETERS
from care_core.lint.generic import near
from care_core.lint.problems import Entry, LintedFile, Problem, Severity
from care_core.lint.readers import numbers

_SOURCE = re.compile(r"(odom|pose|twist|imu)(\d+)")
_OF_SOURCE = re.compile(r"((?:odom|pose|twist|imu)\d+)_(\w+)")
_STATE = ("x", "y", "z", "roll", "pitch", "yaw", "vx", "vy", "vz", "vroll", "vpitch", "vyaw", "ax", "ay", "az")
_CARRIES: Mapping[str, tuple[frozenset[str], str]] = {
    "odom": (frozenset(_STATE[:12]), "nav_msgs/Odometry holds no acceleration"),
    "pose": (frozenset(_STATE[:6]), "PoseWithCovarianceStamped holds neither speed nor acceleration"),
    "twist": (frozenset(_STATE[6:12]), "TwistWithCovarianceStamped holds speeds alone"),
    "imu": (frozenset(_STATE[3:6] + _STATE[9:]), "sensor_msgs/Imu holds neither a position nor a speed"),
}
"""What the messages of a kind of source hold, by the words of the state that is estimated."""
_SETTINGS = (
    "config", "differential", "relative", "queue_size", "nodelay", "pose_use_child_frame", "rejection_threshold",
    "pose_rejection_threshold", "twist_rejection_threshold", "linear_acceleration_rejection_threshold",
    "remove_gravitational_acceleration",
)  # fmt: skip
"""What follows the name of a source, in any release."""
_SHARED = ("frequency", "transform_timeout")
_FILTER = (
    *_SHARED, "sensor_timeout", "two_d_mode", "transform_time_offset", "print_diagnostics", "debug", "debug_out_file",
    "permit_corrected_publication", "publish_acceleration", "publish_tf", "map_frame", "odom_frame", "base_link_frame",
    "base_link_frame_output", "world_frame", "tf_prefix", "predict_to_current_time", "smooth_lagged_data",
    "history_length", "reset_on_time_jump", "use_control", "stamped_control", "control_timeout", "control_config",
    "acceleration_limits", "acceleration_gains", "deceleration_limits", "deceleration_gains",
    "dynamic_process_noise_covariance", "process_noise_covariance", "initial_estimate_covariance", "initial_state",
    "gravitational_acceleration", "disabled_at_startup", "invert_tf", "alpha", "kappa", "beta", "use_sim_time",
)  # fmt: skip
_NAVSAT = (
    *_SHARED, "magnetic_declination_radians", "yaw_offset", "zero_altitude", "publish_filtered_gps",
    "use_odometry_yaw", "wait_for_datum", "datum", "delay", "broadcast_utm_transform", "use_local_cartesian",
    "broadcast_utm_transform_as_parent_frame", "broadcast_cartesian_transform", "cartesian_frame_id",
    "broadcast_cartesian_transform_as_parent_frame", "use_sim_time",
)  # fmt: skip
"""What ros_filter.cpp and navsat_transform.cpp read, of Noetic and of ROS 2."""
_LENGTHS: Mapping[str, tuple[int, ...]] = {
    "process_noise_covariance": (225, 15), "initial_estimate_covariance": (225, 15), "initial_state": (15,),
    "control_config": (6,), "acceleration_limits": (6,), "deceleration_limits": (6,),
}  # fmt: skip
_FRAMES = ("map_frame", "odom_frame", "base_link_frame")
_ROS_FILTER = "ros_filter.cpp of robot_localization"
_NAVSAT_SOURCE = "navsat_transform.cpp of robot_localization"
_MOST_RADIANS = 2 * math.pi

Values = Mapping[str, Entry]


def is_of_localization(values: Values) -> bool:
    """Whether they are the values of a filter, or of navsat_transform."""
    return is_filter(values) or _is_navsat(values)


def _is_navsat(values: Values) -> bool:
    return "magnetic_declination_radians" in values or {"wait_for_datum", "yaw_offset"} <= set(values)


def check(file: LintedFile) -> Iterator[Problem]:
    """What is wrong with the nodes of robot_localization that a file holds."""
    for values in nodes(file):
        if is_filter(values):
            yield from _unread(file, values, _FILTER)
            yield from _sources(file, values)
            yield from _headings(file, values)
            yield from _of_filter(file, values)
        elif _is_navsat(values):
            yield from _unread(file, values, _NAVSAT)
            yield from _of_navsat(file, values)


def nodes(file: LintedFile) -> Iterator[Values]:
    """The values of each node, of a file of ROS 1 those of each part."""
    found: dict[tuple[str, ...], dict[str, Entry]] = {}
    for entry in file.entries:
        scope = entry.keys[: entry.keys.index(PARAMETERS) + 1] if PARAMETERS in entry.keys else entry.keys[:-1]
        found.setdefault(scope, {})["/".join(entry.keys[len(scope) :])] = entry
    return iter(found.values())


def is_filter(values: Values) -> bool:
    """Whether values are those of a filter: only its sources have such names."""
    return any((match := _OF_SOURCE.fullmatch(name)) is not None and match[2] == "config" for name in values)


def _unread(file: LintedFile, values: Values, known: tuple[str, ...]) -> Iterator[Problem]:
    """Names that are a slip of the pen: a node of one's own may add others."""
    for name, entry in values.items():
        of_source = _OF_SOURCE.fullmatch(name) if known is _FILTER else None
        is_read = of_source[2] in _SETTINGS if of_source else name in known or bool(_SOURCE.fullmatch(name))
        if is_read:
            continue
        meant = near(name, [f"{of_source[1]}_{one}" for one in _SETTINGS] if of_source else known)
        if of_source or meant:
            text = f"No parameter {name} of robot_localization is known."
            hint = f"Did you mean {meant}?" if meant else "Leave it out, unless a release of yours has it."
            severity = Severity.WARNING if meant else Severity.NOTE
            yield file.problem("unknown-key", severity, entry, text, hint, _ROS_FILTER)


def _sources(file: LintedFile, values: Values) -> Iterator[Problem]:
    for name, entry in values.items():
        match = _OF_SOURCE.fullmatch(name)
        if match is not None and match[2] == "config":
            yield from _fused(file, values, match[1], entry)


def _fused(file: LintedFile, values: Values, source: str, entry: Entry) -> Iterator[Problem]:
    """What a source is asked for, and whether its messages hold it."""
    flags = re.findall(r"true|false", str(entry.value))
    if source not in values and file.text:
        is_told = any(_SOURCE.fullmatch(name) for name in values)
        severity = Severity.WARNING if is_told else Severity.NOTE
        text = f"{entry.keys[-1]} has no {source} beside it: without its topic nothing of this source is fused."
        hint = f"Write the topic as {source}, unless the launch file names it."
        yield file.problem("cannot-work", severity, entry, text, hint, _ROS_FILTER)
    if len(flags) != len(_STATE):
        text = f"{entry.keys[-1]} has {len(flags)} entries instead of {len(_STATE)}: what is fused is undefined."
        hint = "Write x y z, roll pitch yaw, their rates in the same order, and the accelerations in x y z."
        yield file.error("cannot-work", entry, text, hint, _ROS_FILTER)
        return
    wanted = [word for word, flag in zip(_STATE, flags, strict=True) if flag == "true"]
    carried, why = _CARRIES[source.rstrip("0123456789")]
    lacking = [word for word in wanted if word not in carried]
    if not wanted:
        text = f"{entry.keys[-1]} is false throughout: {source} is not heard at all."
        yield file.warning("cannot-work", entry, text, "Set what it measures to true.", _ROS_FILTER)
    elif lacking:
        text = f"{entry.keys[-1]} asks for {', '.join(lacking)}, and {why}: that is not fused."
        yield file.warning("dead-key", entry, text, "Set it to false.", _ROS_FILTER)
    both = [values.get(f"{source}_{mode}") for mode in ("differential", "relative")]
    if all(one is not None and one.value == "true" for one in both) and both[1] is not None and both[0] is not None:
        text = f"{source}_differential and {source}_relative are both true: only the first counts."
        yield file.warning("contradiction", both[1], text, "Switch one of them off.", _ROS_FILTER, [both[0]])


def _headings(file: LintedFile, values: Values) -> Iterator[Problem]:
    """Odometry and an IMU that both say where the robot points to: they drift apart, and the filter jumps."""
    found: dict[str, Entry] = {}
    for name, entry in values.items():
        match = _OF_SOURCE.fullmatch(name)
        flags = re.findall(r"true|false", str(entry.value))
        if match is None or match[2] != "config" or len(flags) != len(_STATE) or flags[_STATE.index("yaw")] != "true":
            continue
        modes = (values.get(f"{match[1]}_{mode}") for mode in ("differential", "relative"))
        if not any(one is not None and one.value == "true" for one in modes):
            found.setdefault(match[1].rstrip("0123456789"), entry)
    if "odom" in found and "imu" in found:
        odom, imu = found["odom"], found["imu"]
        text = f"{odom.keys[-1]} and {imu.keys[-1]} both give the heading: they drift apart, and the filter jumps."
        hint = "Take the heading from one, and the turn rate from the other."
        source = "robot_localization's documentation of differential"
        yield file.note("hinders", imu, text, hint, source, [odom])


def _of_filter(file: LintedFile, values: Values) -> Iterator[Problem]:
    yield from _joined(file, values)
    for name, lengths in _LENGTHS.items():
        entry = values.get(name)
        own = len(re.findall(r"[^\s,\[\]]+", str(entry.value))) if entry is not None and entry.kind == "list" else 0
        if entry is not None and own and own not in lengths:
            text = f"{name} has {own} numbers instead of {lengths[0]}: it is refused, or read past its end."
            yield file.error("cannot-work", entry, text, "Count its rows.", _ROS_FILTER)
    yield from _rate(file, values)


def _rate(file: LintedFile, values: Values) -> Iterator[Problem]:
    entry = values.get("frequency")
    if entry is not None and entry.number is not None and entry.number <= 0:
        text = f"frequency is {entry.number:g}: nothing is ever published."
        yield file.warning("cannot-work", entry, text, "It must be above 0.", _ROS_FILTER)


def _joined(file: LintedFile, values: Values) -> Iterator[Problem]:
    """Frames of which two are one, and a world that is none of them."""
    frames = {name: str(entry.value).strip("/") for name in _FRAMES if (entry := values.get(name)) is not None}
    if any(re.search(r"[$<{]", frame) for frame in frames.values()):
        return
    for one, other in combinations(frames, 2):
        if frames[one] == frames[other]:
            text = f"{one} and {other} are both {frames[one]}: the filter refuses such frames."
            hint = "Map, odometry and robot are three frames (REP 105)."
            yield file.warning("cannot-work", values[other], text, hint, _ROS_FILTER, [values[one]])
    world = values.get("world_frame")
    known = {frames.get("map_frame", "map"), frames.get("odom_frame", "odom")}
    if world is not None and str(world.value).strip("/") not in known and not re.search(r"[$<{]", str(world.value)):
        text = f"world_frame is {world.value}, which is neither map_frame nor odom_frame."
        hint = "Give it the value of odom_frame for odometry alone, of map_frame where positions are absolute."
        yield file.warning("contradiction", world, text, hint, f"{_ROS_FILTER}; REP 105")


def _of_navsat(file: LintedFile, values: Values) -> Iterator[Problem]:
    for name in ("magnetic_declination_radians", "yaw_offset"):
        entry = values.get(name)
        if entry is not None and entry.number is not None and abs(entry.number) > _MOST_RADIANS:
            text = f"{name} is {entry.number:g} rad, more than a whole turn."
            hint = f"Is it in degrees? {math.radians(entry.number):.4g} rad would be."
            yield file.warning("wrong-unit", entry, text, hint, "an angle is at most 2 pi")
    yield from _rate(file, values)
    entry, datum = values.get("wait_for_datum"), values.get("datum")
    if entry is not None and entry.value == "true" and datum is None and file.text:
        text = "wait_for_datum is on, and no datum stands beside it: the origin is 0, 0 or waits for a service call."
        hint = "Write datum: [latitude, longitude, heading], unless a node calls the service."
        yield file.note("hinders", entry, text, hint, _NAVSAT_SOURCE)
    elif datum is not None and datum.kind == "list" and len(numbers(datum)) < 3 and "," in str(datum.value):
        text = "datum holds less than latitude, longitude and heading."
        yield file.warning("cannot-work", datum, text, "Give it all three.", _NAVSAT_SOURCE)
