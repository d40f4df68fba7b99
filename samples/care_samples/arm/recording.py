"""An excavation as a ROS 1 bag: actions with their inputs and answers, the wrist's sensor, the battery, the task."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.typesys import Stores

from care_samples.arm.excavation import DEFAULTS, RANGES, WHOLE, Command, Story
from care_samples.ros import DYNAMIC_RECONFIGURE, Entry, Maker, write_ros1

NODE = "arm_autonomy"
_PACKAGE = "lander_arm_msgs"
_HEAD = "std_msgs/Header header\nactionlib_msgs/GoalID goal_id\n"
_GUARDS = "bool retracting\nfloat64 force_threshold\nfloat64 torque_threshold\n"
_TEXTS = {
    f"{_PACKAGE}/msg/ArmMoveJointsGoal": f"{_HEAD}bool relative\nfloat64[7] angles",
    f"{_PACKAGE}/msg/ArmMoveJointsGuardedGoal": f"{_HEAD}bool relative\nfloat64[7] angles\n{_GUARDS}",
    f"{_PACKAGE}/msg/ArmMoveCartesianGoal": f"{_HEAD}int32 frame\nbool relative\nfloat64[3] position",
    f"{_PACKAGE}/msg/ArmMoveCartesianGuardedGoal": (
        f"{_HEAD}int32 frame\nbool relative\nfloat64[3] position\nfloat64[4] orientation\n{_GUARDS}"
    ),
    f"{_PACKAGE}/msg/ArmResult": (
        "std_msgs/Header header\nactionlib_msgs/GoalStatus status\nbool contact\nfloat64 height\nfloat64 force\n"
        "float64 torque"
    ),
    f"{_PACKAGE}/msg/Wrist": "std_msgs/Header header\nfloat64 height\nfloat64 force\nfloat64 torque",
    f"{_PACKAGE}/msg/Task": "std_msgs/Header header\nbool success\nfloat64 sample_cm3\nstring fault",
    **DYNAMIC_RECONFIGURE,
}


def write_bag(path: Path, story: Story, parameters: Mapping[str, float]) -> None:
    """A ROS 1 bag."""
    maker = Maker(Stores.ROS1_NOETIC, _TEXTS)
    write_ros1(path, maker, _entries(maker, story, parameters))


def _entries(maker: Maker, story: Story, parameters: Mapping[str, float]) -> Iterator[Entry]:
    yield f"/{NODE}/parameter_descriptions", 0.0, maker.described(RANGES, DEFAULTS, WHOLE)
    yield f"/{NODE}/parameter_updates", 0.0, maker.config(parameters, WHOLE)
    for number, command in enumerate(story.commands):
        ident = maker.make("actionlib_msgs/GoalID", maker.stamp(command.sent_s), f"{command.name}-{number + 1}")
        yield f"/arm/{command.name}/goal", command.sent_s, _goal(maker, command, ident, parameters)
        status = maker.make("actionlib_msgs/GoalStatus", ident, command.status, command.text)
        felt = command.found, command.height, command.force, command.torque
        answer = maker.make(f"{_PACKAGE}/ArmResult", maker.header(command.ended_s, ""), status, *felt)
        yield f"/arm/{command.name}/result", command.ended_s, answer
    for t, height, force, torque in story.wrist:
        yield "/arm/wrist", t, maker.make(f"{_PACKAGE}/Wrist", maker.header(t, "wrist"), height, force, torque)
    for t, volts, amps in story.battery:
        yield "/battery_state", t, maker.battery(t, volts, amps)
    for t, level, text in story.said:
        yield "/rosout", t, maker.said(t, level, NODE, text)
    fault = story.commands[-1].text
    task = maker.make(f"{_PACKAGE}/Task", maker.header(story.ended_s, ""), story.is_success, story.sample_cm3, fault)
    yield "/task", story.ended_s, task


def _goal(maker: Maker, command: Command, ident: Any, parameters: Mapping[str, float]) -> Any:
    """The action's inputs; a guarded move takes its limits from the parameters."""
    header = maker.header(command.sent_s, "")
    guards = command.retracting, parameters["force_threshold"], parameters["torque_threshold"]
    if command.name.startswith("ARM_MOVE_JOINTS"):
        inputs = header, ident, False, np.array(command.angles)
        kind = "ArmMoveJointsGuardedGoal" if command.name.endswith("GUARDED") else "ArmMoveJointsGoal"
        return maker.make(f"{_PACKAGE}/{kind}", *inputs, *(guards if kind.endswith("GuardedGoal") else ()))
    position = np.array([0.7, 0.0, parameters["predicted_surface"]])
    if not command.name.endswith("GUARDED"):
        return maker.make(f"{_PACKAGE}/ArmMoveCartesianGoal", header, ident, 0, False, position)
    level = np.array([1.0, 0.0, 0.0, 0.0])
    return maker.make(f"{_PACKAGE}/ArmMoveCartesianGuardedGoal", header, ident, 0, False, position, level, *guards)
