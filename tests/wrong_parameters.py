"""Nav2 drives of a robot that stands still, with one parameter off what the robot is driven with; also as files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from unittest.mock import patch

from nav2_robot import parameters, recorder
from nav2_robot.parameters import Parameter
from nav2_robot.recorder import Recorder
from nav2_robot.robot import Robot
from nav2_robot.standin import StandIn
from nav2_robot.world import Conditions, Passage, World

START = Path(__file__).parents[1] / "samples" / "nav2_robot" / "start" / "dwb.yaml"
ROOM = World(
    walls=((-1.2, -2.2, 6.2, -2.0), (-1.2, 2.0, 6.2, 2.2), (-1.2, -2.0, -1.0, 2.0), (6.0, -2.0, 6.2, 2.0)),
    clutter=(),
    passages=(Passage(3.0, 0.0, 3.9),),
    start=(0.0, 0.0, 0.0),
    goals=((1.5, 0.0, 0.0),),
)
Wrong = tuple[str, str, Parameter]
"""A node, the name of its parameter, and what it is set to."""


class _Standing(StandIn):
    """Nav2 that never drives off, or drives as it should."""

    moves = False
    frames: Sequence[tuple[str, str]] = ()
    ticks = False
    complaints: Sequence[str] = ()

    def _drive(self, time_s: float) -> None:
        super()._drive(time_s)
        if not self.moves:
            self.top = 0.0
        now, maker = self.robot.now_s, self.recorder.maker
        if self.ticks:
            self.recorder.record("/clock", now, maker.make("rosgraph_msgs/Clock", maker.stamp(now)))
        for text in self.complaints:
            self._say(30, text.format(now=now, earlier=now - 0.4))
        if self.frames:
            self.recorder.record("/tf", now, maker.make("tf2_msgs/TFMessage", [self._tf(*one) for one in self.frames]))

    def _tf(self, frame: str, child: str) -> Any:
        make, maker = self.recorder.maker.make, self.recorder.maker
        still = make("geometry_msgs/Transform", make("geometry_msgs/Vector3", 0.0, 0.0, 0.0),
                     make("geometry_msgs/Quaternion", 0.0, 0.0, 0.0, 1.0))  # fmt: skip
        header = make("std_msgs/Header", maker.stamp(self.robot.now_s), frame)
        return make("geometry_msgs/TransformStamped", header, child, still)


def drive(
    path: Path,
    *wrong: Wrong,
    moves: bool = False,
    frames: Sequence[tuple[str, str]] = (),
    ticks: bool = False,
    complaints: Sequence[str] = (),
    recorded: bool = True,
) -> Path:
    """A drive to one goal, which is missed but for `moves`; `recorded`: whether the log holds the parameters."""
    values: dict[str, Mapping[str, Parameter]] = dict(parameters.read(START))
    for node, name, value in wrong:
        values[node] = {**values[node], name: value}
    robot = Robot(Conditions(ROOM, 0.0, 0.0, 1.0, seed=3), None, False)
    more = {"/clock": "rosgraph_msgs/msg/Clock", "/tf": "tf2_msgs/msg/TFMessage"}
    with patch.object(recorder, "TOPICS", {**recorder.TOPICS, **more}), Recorder(path) as log:
        stand_in = _Standing(robot, values if recorded else {}, log)
        stand_in.moves, stand_in.frames, stand_in.ticks, stand_in.complaints = moves, frames, ticks, complaints
        stand_in.run()
    return path


def rewritten(path: Path, source: Path, wrong: Mapping[str, float | str]) -> Path:
    """A ROS 1 bag with other values of parameters (`/move_base/DWAPlannerROS/sim_time`) in its dynamic_reconfigure."""
    from rosbags.rosbag1 import Reader, Writer
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    with Reader(source) as reader, Writer(path) as writer:
        for one in reader.connections:
            store.register(get_types_from_msg(one.msgdef.data, one.msgtype))
        added = {
            one.id: writer.add_connection(
                one.topic, one.msgtype, msgdef=one.msgdef.data, md5sum=one.digest,
                callerid=getattr(one.ext, 'callerid', None), latching=getattr(one.ext, 'latching', None),
            )
            for one in reader.connections
        }  # fmt: skip
        for connection, stamp, raw in reader.messages():
            data = bytes(raw)
            if connection.topic.endswith("/parameter_updates"):
                space = connection.topic.rpartition("/")[0]
                config: Any = store.deserialize_ros1(data, connection.msgtype)
                for value in (*config.bools, *config.ints, *config.doubles, *config.strs):
                    value.value = wrong.get(f"{space}/{value.name}", value.value)
                data = bytes(store.serialize_ros1(config, connection.msgtype))
            writer.write(added[connection.id], stamp, data)
    return path
