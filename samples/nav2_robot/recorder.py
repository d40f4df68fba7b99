"""The recording: MCAP as `ros2 bag record` writes it, of serialized messages; no ROS needed."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

from rosbags.typesys import Stores

from care_samples.ros import Maker, ns

_TREE = {
    "nav2_msgs/msg/BehaviorTreeStatusChange": (
        "builtin_interfaces/Time timestamp\nstring node_name\nuint16 uid\nstring previous_status\nstring current_status"
    ),
    "nav2_msgs/msg/BehaviorTreeLog": "builtin_interfaces/Time timestamp\nBehaviorTreeStatusChange[] event_log",
}
_FEEDBACK = {
    "nav2_msgs/action/NavigateToPose_FeedbackMessage": (
        "unique_identifier_msgs/UUID goal_id\nnav2_msgs/action/NavigateToPose_Feedback feedback"
    ),
    "nav2_msgs/action/NavigateToPose_Feedback": (
        "geometry_msgs/PoseStamped current_pose\nbuiltin_interfaces/Duration navigation_time\n"
        "builtin_interfaces/Duration estimated_time_remaining\nint16 number_of_recoveries\nfloat32 distance_remaining"
    ),
}
_FEEDBACK_PARTS = (
    "unique_identifier_msgs/msg/UUID",
    "geometry_msgs/msg/PoseStamped",
    "builtin_interfaces/msg/Duration",
)
"""What the feedback is made of: generated definitions know messages, not actions."""

STATUS = "/navigate_to_pose/_action/status"
FEEDBACK = "/navigate_to_pose/_action/feedback"

TOPICS: Mapping[str, str] = {
    "/rosout": "rcl_interfaces/msg/Log",
    "/parameter_events": "rcl_interfaces/msg/ParameterEvent",
    STATUS: "action_msgs/msg/GoalStatusArray",
    FEEDBACK: "nav2_msgs/action/NavigateToPose_FeedbackMessage",
    "/behavior_tree_log": "nav2_msgs/msg/BehaviorTreeLog",
    "/plan": "nav_msgs/msg/Path",
    "/odom": "nav_msgs/msg/Odometry",
    "/cmd_vel": "geometry_msgs/msg/Twist",
    "/battery_state": "sensor_msgs/msg/BatteryState",
    "/scan": "sensor_msgs/msg/LaserScan",
}
"""What operators record of a drive, and its types."""

PERIODS_S: Mapping[str, float] = {"/scan": 1.0, FEEDBACK: 0.5}
"""What would be most of the file is recorded so often."""


def maker() -> Maker:
    """Makes messages of the recorded types."""
    return Maker(Stores.ROS2_HUMBLE, {**_TREE, **_FEEDBACK})


class Recorder:
    """Writes one MCAP file; times are those of the mission in s."""

    def __init__(self, path: Path) -> None:
        from mcap.writer import Writer

        self.maker = maker()
        self._stream = path.open("wb")
        self._writer = Writer(self._stream)
        self._writer.start(profile="ros2", library="nav2_robot")
        self._channels: dict[str, int] = {}
        self._next_s: dict[str, float] = {}

    def __enter__(self) -> Recorder:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._writer.finish()  # type: ignore[no-untyped-call]
        self._stream.close()

    def write(self, topic: str, time_s: float, data: bytes) -> None:
        """Record a serialized message of one of `TOPICS`, or leave it out where one was recorded just before."""
        if time_s < self._next_s.get(topic, time_s):
            return
        if topic in PERIODS_S:
            self._next_s[topic] = time_s + PERIODS_S[topic] - 1e-6
        if topic not in self._channels:
            kind = TOPICS[topic]
            schema = self._writer.register_schema(kind, "ros2msg", _definition(self.maker, kind).encode())
            self._channels[topic] = self._writer.register_channel(topic, "cdr", schema)
        self._writer.add_message(self._channels[topic], ns(time_s), data, ns(time_s))

    def record(self, topic: str, time_s: float, message: Any) -> None:
        """Record a message that the maker made."""
        self.write(topic, time_s, bytes(self.maker.store.serialize_cdr(message, TOPICS[topic])))


def _definition(made: Maker, kind: str) -> str:
    """The text of a type with those of all types in it."""
    if kind not in _FEEDBACK:
        return str(made.store.generate_msgdef(kind, ros_version=2)[0])
    rule = "=" * 80
    first, second = _FEEDBACK.items()
    texts = [first[1], f"MSG: {second[0]}\n{second[1]}"]
    known: set[str] = set()
    for part in _FEEDBACK_PARTS:
        own, *below = str(made.store.generate_msgdef(part, ros_version=2)[0]).split(f"{rule}\n")
        for text in (f"MSG: {part.replace('/msg/', '/')}\n{own}", *below):
            if text.partition("\n")[0] not in known:
                known.add(text.partition("\n")[0])
                texts.append(text)
    return f"\n{rule}\n".join(text.strip("\n") for text in texts)
