"""Configuration files of each ecosystem: read, write, compare, and the commands that apply a change."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from enum import Enum
from pathlib import Path
from types import ModuleType

from care_core.configs import ardupilot_param, ros1_yaml
from care_core.diagnose.records import Change, Fix
from care_core.errors import ConfigError
from care_core.extract.settings import option_value, readable
from care_core.run import Run, Setting
from care_core.variables import Variable

__all__ = [
    "ConfigFormat",
    "apply_commands",
    "format_for",
    "read_config",
    "read_configs",
    "unified_diff",
    "write_params",
]


class ConfigFormat(str, Enum):
    """How an ecosystem writes its configuration."""

    ARDUPILOT_PARAM = "ardupilot-param"
    ROS1_YAML = "ros1-yaml"


_MODULES: dict[ConfigFormat, ModuleType] = {
    ConfigFormat.ARDUPILOT_PARAM: ardupilot_param,
    ConfigFormat.ROS1_YAML: ros1_yaml,
}
_OF_LOG = {
    "dataflash-bin": ConfigFormat.ARDUPILOT_PARAM,
    "dataflash-text": ConfigFormat.ARDUPILOT_PARAM,
    "mavlink-tlog": ConfigFormat.ARDUPILOT_PARAM,
    "ros1-bag": ConfigFormat.ROS1_YAML,
}
_YAML_SUFFIXES = (".yaml", ".yml")


def format_for(log_format: str) -> ConfigFormat:
    """The configuration format of the ecosystem that records such logs."""
    return _OF_LOG[log_format]


def read_config(path: str | Path) -> Mapping[str, Setting]:
    """Settings of a configuration file by name; `source` is file:line.

    Raises:
        ConfigError: no such file, not text, or a line that is no setting, with file:line.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as err:
        raise ConfigError(f"Cannot read the configuration: {err.strerror}.", where=str(path)) from err
    except UnicodeDecodeError as err:
        raise ConfigError("Not a configuration file: it is not text.", where=str(path)) from err
    module = ros1_yaml if path.suffix.lower() in _YAML_SUFFIXES else ardupilot_param
    settings: Mapping[str, Setting] = module.read(text, path)
    return settings


def read_configs(paths: Iterable[str | Path]) -> Mapping[str, Setting]:
    """Settings of several files in one; where two name the same key the later file wins, as when they are loaded."""
    merged: dict[str, Setting] = {}
    for path in paths:
        merged.update(read_config(path))
    return merged


def write_params(settings: Mapping[str, Setting], format: ConfigFormat) -> str:
    """The settings as a configuration file of that format."""
    text: str = _MODULES[format].write(settings)
    return text


def unified_diff(run: Run, fix: Fix) -> str:
    """The configuration as driven against the fix, in the ecosystem's own format; only keys that change."""
    format = format_for(run.log.format)
    driven, fixed = {}, {}
    for option, parameter, suggested in _assignments(fix.changes):
        change = next(change for change in fix.changes if change.option is option)
        setting = run.settings.get(parameter)
        current = None if setting is None else option_value(option, setting)
        driven[parameter] = _line(format, option, parameter, change.current if current is None else current)
        fixed[parameter] = _line(format, option, parameter, suggested)
    lines = difflib.unified_diff(
        [driven[parameter] for parameter in sorted(driven)],
        [fixed[parameter] for parameter in sorted(fixed)],
        fromfile="as driven",
        tofile="suggested",
        n=0,
        lineterm="",
    )
    return "".join(f"{line}\n" for line in lines)


def apply_commands(changes: Iterable[Change], format: ConfigFormat) -> list[str]:
    """Shell or ground station commands that make the changes."""
    commands: list[str] = _MODULES[format].commands(_assignments(changes))
    return commands


def _assignments(changes: Iterable[Change]) -> tuple[tuple[Variable, str, float], ...]:
    return tuple(
        (change.option, parameter, change.suggested) for change in changes for parameter in readable(change.option)
    )


def _line(format: ConfigFormat, option: Variable, parameter: str, value: float) -> str:
    text = _MODULES[format].text_of(option, value)
    return f"{parameter},{text}" if format is ConfigFormat.ARDUPILOT_PARAM else f"{parameter}: {text}"
