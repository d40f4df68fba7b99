"""A look at a ROS recording: its account and its findings, in one reading."""

from __future__ import annotations

from typing import cast

from care_core.ecosystems.base import RunModel
from care_core.ecosystems.findings import Health
from care_core.ecosystems.ros import plan
from care_core.ecosystems.ros.finding import find
from care_core.ecosystems.ros.recording import STREAM_MESSAGES, Recording
from care_core.ecosystems.ros.timeline import timeline
from care_core.logs.ros_log import RosLog
from care_core.text import listed

SHORT_S = 5.0
"""Nothing can be said of how a robot drives in less."""
_UNREAD = "not decoded "
"""How the facts about encodings begin that no reader knows."""
_HELD = {
    "geometry_msgs/PoseStamped": "poses", plan.LOCALISED: "poses", "geometry_msgs/TransformStamped": "poses",
    **dict.fromkeys(plan.TF, "transforms"), plan.IMU: "inertial data", "sensor_msgs/NavSatFix": "satellite positions",
    "sensor_msgs/Image": "images", "sensor_msgs/CompressedImage": "images", plan.CLOUD: "point clouds",
    "sensor_msgs/JointState": "joint states", "sensor_msgs/Range": "ranges",
}  # fmt: skip
"""What recordings without a robot's own streams hold, in words."""
_STREAMS = {plan.ODOMETRY: "odometry", plan.SCAN: "laser", plan.BATTERY: "battery"}
"""What counts where there is more than a little of it, and plausible."""
_TELLING = ("odometry", "goals", "commands", "laser", "battery", "messages")
"""What tells how a robot did."""
_STACKS = {"move_base": "move_base", "nav2": "Nav2"}


def examine(model: RunModel) -> Health:
    """What happened in a ROS 1 bag or a ROS 2 recording."""
    recording = Recording.read(cast(RosLog, model.log))
    findings = find(recording)
    return Health(_robot(recording), timeline(recording), findings, "" if findings else _too_little(recording))


def _robot(recording: Recording) -> str:
    ros = recording.facts.get("ros", "1")
    stack = _STACKS.get(recording.facts.get("stack", ""), "")
    distro = recording.facts.get("distro", "")
    return f"ROS {ros}{f' {distro}' if distro else ''} robot{f' with {stack}' if stack else ''}"


def _too_little(recording: Recording) -> str:
    """Why nothing can be judged, empty where something can."""
    if not any(len(times) for times in recording.times.values()):
        return "an empty recording: nothing can be said of the robot"
    drives = recording.odometry is not None or recording.commands is not None
    senses = bool(recording.scans or recording.batteries)
    longest = max(len(table) for _, table in recording.of(*plan.ROBOT)) if drives or senses else 0
    speaks = bool(recording.said or recording.goals) or any(True for _ in recording.of(plan.DIAGNOSTICS))
    unread = [fact.removeprefix(_UNREAD) for fact in recording.facts if fact.startswith(_UNREAD)]
    if longest < STREAM_MESSAGES and not speaks and unread:
        return f"its messages are {' and '.join(unread)}, not ROS 1, CDR or JSON: only when they came is known"
    if longest < STREAM_MESSAGES and not speaks:
        return _nothing_of_a_robot(recording)
    if recording.duration_s < SHORT_S:
        return f"{recording.duration_s:.1f} s are too short to judge a robot by"
    if not speaks:
        return "neither goals nor messages of nodes are recorded: what the robot was to do is not known"
    return ""


def _nothing_of_a_robot(recording: Recording) -> str:
    """What is there, so that its reader sees that it was read, and what would be needed."""
    there = {plan.kind_of(channel) for channel in recording.channels if channel.count}
    held = list(dict.fromkeys(words for kind, words in _HELD.items() if kind in there))
    poor = [word for kind, word in _STREAMS.items() if kind in there]
    lacks = f"no {listed([word for word in _TELLING if word not in poor], 'or')}"
    if poor:
        lacks += f", and too little or nothing plausible of {listed(poor, 'and')}"
    if not held:
        return f"nothing in it tells of a robot: {lacks}"
    return f"it holds {listed(held, 'and')}, and nothing that tells how a robot did: {lacks}"
