"""The formats of configuration files, told apart by content.

One module a format, each with `read`, `finder` (the values that loaded files give parameters), `write`, `text_of`,
`line_of` and `commands`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from enum import Enum
from importlib import import_module
from pathlib import Path
from types import ModuleType

from care_core.ecosystems.px4 import parameter_file as qgc_params
from care_core.ecosystems.registry import ecosystem_of
from care_core.logs.formats import format_named
from care_core.run import Setting
from care_core.variables import Variable


class ConfigFormat(str, Enum):
    """How an ecosystem writes its configuration."""

    ARDUPILOT_PARAM = "ardupilot-param"
    QGC_PARAMS = "qgc-params"
    ROS1_YAML = "ros1-yaml"
    ROS2_YAML = "ros2-yaml"


_MODULES = {
    ConfigFormat.ARDUPILOT_PARAM: "care_core.ecosystems.ardupilot.parameter_file",
    ConfigFormat.QGC_PARAMS: "care_core.ecosystems.px4.parameter_file",
    ConfigFormat.ROS1_YAML: "care_core.ecosystems.ros.ros1_yaml",
    ConfigFormat.ROS2_YAML: "care_core.ecosystems.ros.ros2_yaml",
}

_YAML_SUFFIXES = (".yaml", ".yml")
_PARAMETER_LINE = re.compile(r"[A-Z][A-Z0-9_]*(\s*,\s*|\s+)[-+.\w]+(\s|$)")
_YAML_LINE = re.compile(r"---|[%&!{]|[^\s,#]+\s*:(\s|$)")
_ROS2_KEY = re.compile(r"^[^#\n]*\bros__parameters['\"]?\s*:", re.MULTILINE)


def module_of(format: ConfigFormat) -> ModuleType:
    """The module of a format, imported when it is first asked for: those of YAML take a while."""
    return import_module(_MODULES[format])


def format_for(log_format: str, parameters: Iterable[str] = ()) -> ConfigFormat:
    """The configuration format of the ecosystem that records such logs; `parameters` are names in the log."""
    recorded = format_named(log_format)
    return ConfigFormat(ecosystem_of(recorded).dialect(recorded, parameters))


def format_of(text: str, path: Path) -> ConfigFormat:
    """The format of a file's text, told from its first line that is no comment, or else from its suffix."""
    lines = (line.rstrip("\r") for line in text.splitlines())
    first = next((line for line in lines if line.strip() and not line.lstrip().startswith("#")), "")
    if qgc_params.is_row(first) or (not first and qgc_params.HEADER in text):
        return ConfigFormat.QGC_PARAMS
    if _PARAMETER_LINE.match(first.strip()):
        return ConfigFormat.ARDUPILOT_PARAM
    if _YAML_LINE.match(first) or path.suffix.lower() in _YAML_SUFFIXES:
        return ConfigFormat.ROS2_YAML if _ROS2_KEY.search(text) else ConfigFormat.ROS1_YAML
    return ConfigFormat.ARDUPILOT_PARAM


def text_for(format: ConfigFormat, option: Variable, value: float) -> str:
    """An option's value as a file of that format has it."""
    text: str = module_of(format).text_of(option, value)
    return text


def write_params(
    settings: Mapping[str, Setting], format: ConfigFormat, remarks: Mapping[str, str] | None = None
) -> str:
    """The settings as a configuration file of that format, with `remarks` by name as comments."""
    text: str = module_of(format).write(settings, remarks)
    return text
