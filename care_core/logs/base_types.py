"""Messages of bases and vacuum cleaners that no message set of ROS brings: recordings of humble hold no definitions."""

from __future__ import annotations

from collections.abc import Mapping

_SEPARATOR = f"\n{'=' * 80}\nMSG: "
_HEADER = _SEPARATOR.join((
    "", "std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id",
    "builtin_interfaces/Time\nint32 sec\nuint32 nanosec",
))  # fmt: skip
_HAZARD = f"{_SEPARATOR}irobot_create_msgs/HazardDetection\nstd_msgs/Header header\nuint8 type"
DEFINITIONS: Mapping[str, str] = {
    "irobot_create_msgs/msg/HazardDetectionVector":
        f"std_msgs/Header header\nirobot_create_msgs/HazardDetection[] detections{_HAZARD}{_HEADER}",
    "kobuki_ros_interfaces/msg/BumperEvent": "uint8 bumper\nuint8 state",
    "neato2_interfaces/msg/Bump": "bool left_front\nbool left_side\nbool right_front\nbool right_side",
    "create_msgs/msg/Bumper": "std_msgs/Header header\nbool is_left_pressed\nbool is_right_pressed\n"
        "bool is_light_left\nbool is_light_front_left\nbool is_light_center_left\nbool is_light_center_right\n"
        "bool is_light_front_right\nbool is_light_right\nuint16 light_signal_left\nuint16 light_signal_front_left\n"
        "uint16 light_signal_center_left\nuint16 light_signal_center_right\nuint16 light_signal_front_right\n"
        f"uint16 light_signal_right{_HEADER}",
}  # fmt: skip
"""By type, as a log would hold them: a message of other length is not read by them."""
