"""Parameter files of ROS 1 and ROS 2: YAML, of ROS 2 with a key `ros__parameters` under each node."""

from __future__ import annotations

import re
from pathlib import Path

from care_core.ecosystems.dialect import Dialect

_SUFFIXES = (".yaml", ".yml")
_YAML_LINE = re.compile(r"---|[%&!{]|[^\s,#]+\s*:(\s|$)")
_ROS2_KEY = re.compile(r"^[^#\n]*\bros__parameters['\"]?\s*:", re.MULTILINE)
_LINE = r"""((?:[^#\n]*?[\s{{,]|\s*)["']?[\w/.~]*{key}["']?\s*:\s+)("[^"]*"|'[^']*'|[^\s#&*!|>\[{{,}}][^\s#,}}]*)(.*)"""


def _is_yaml(first: str, path: Path) -> bool:
    return _YAML_LINE.match(first) is not None or path.suffix.lower() in _SUFFIXES


def _is_ros1(first: str, text: str, path: Path) -> bool:
    return _is_yaml(first, path) and _ROS2_KEY.search(text) is None


def _is_ros2(first: str, text: str, path: Path) -> bool:
    return _is_yaml(first, path) and _ROS2_KEY.search(text) is not None


ROS1_YAML = Dialect(
    name="ros1-yaml",
    suffix=".yaml",
    module="care_core.ecosystems.ros.ros1_yaml",
    is_written=_is_ros1,
    line=_LINE,
    is_yaml=True,
)
ROS2_YAML = Dialect(
    name="ros2-yaml",
    suffix=".yaml",
    module="care_core.ecosystems.ros.ros2_yaml",
    is_written=_is_ros2,
    line=_LINE,
    is_yaml=True,
)
