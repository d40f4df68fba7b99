"""Configuration files of each ecosystem: read, write, compare, and the commands that apply a change.

One module a format, each with `read`, `find` (the value that loaded files give a parameter), `write`, `text_of`,
`line_of` and `commands`. Formats are told apart by content.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from types import ModuleType

from care_core.configs import ardupilot_param, qgc_params, ros1_yaml, ros2_yaml
from care_core.diagnose.records import Change, Fix
from care_core.errors import ConfigError
from care_core.extract.settings import option_value, readable
from care_core.run import Run, Setting
from care_core.variables import Variable

__all__ = [
    "ConfigFile",
    "ConfigFormat",
    "apply_commands",
    "format_for",
    "format_of",
    "guesses",
    "read_config",
    "read_configs",
    "read_text",
    "resolve",
    "split_name",
    "text_for",
    "unified_diff",
    "write_params",
]


class ConfigFormat(str, Enum):
    """How an ecosystem writes its configuration."""

    ARDUPILOT_PARAM = "ardupilot-param"
    QGC_PARAMS = "qgc-params"
    ROS1_YAML = "ros1-yaml"
    ROS2_YAML = "ros2-yaml"


_MODULES: dict[ConfigFormat, ModuleType] = {
    ConfigFormat.ARDUPILOT_PARAM: ardupilot_param,
    ConfigFormat.QGC_PARAMS: qgc_params,
    ConfigFormat.ROS1_YAML: ros1_yaml,
    ConfigFormat.ROS2_YAML: ros2_yaml,
}
_OF_LOG = {
    "ros1": ConfigFormat.ROS1_YAML,
    "ros2": ConfigFormat.ROS2_YAML,
    "mcap": ConfigFormat.ROS2_YAML,
    "px4": ConfigFormat.QGC_PARAMS,
}
"""By how the name of a log's format begins; any other is of an ArduPilot vehicle."""

_LARGEST_BYTES = 1_000_000
_YAML_SUFFIXES = (".yaml", ".yml")
_PARAMETER_LINE = re.compile(r"[A-Z][A-Z0-9_]*(\s*,\s*|\s+)[-+.\w]+(\s|$)")
_YAML_LINE = re.compile(r"---|[%&!{]|[^\s,#]+\s*:(\s|$)")
_ROS2_KEY = re.compile(rf"^[^#\n]*\b{ros2_yaml.PARAMETERS}['\"]?\s*:", re.MULTILINE)


@dataclass(frozen=True, slots=True)
class ConfigFile:
    """A configuration file as it was named, and what it holds; `source` of a setting is file:line."""

    path: str
    format: ConfigFormat
    settings: Mapping[str, Setting]


def format_for(log_format: str, parameters: Iterable[str] = ()) -> ConfigFormat:
    """The configuration format of the ecosystem that records such logs.

    An MCAP may be of either ROS: `parameters` are names of it, which only in ROS 2 have a dot after the node.
    """
    family = log_format.partition("-")[0]
    if family == "mcap" and (names := list(parameters)) and not any("." in name for name in names):
        return ConfigFormat.ROS1_YAML
    return _OF_LOG.get(family, ConfigFormat.ARDUPILOT_PARAM)


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


def read_config(path: str | Path, namespace: str = "") -> Mapping[str, Setting]:
    """Settings of a configuration file by name; `source` is file:line.

    Args:
        namespace: where a ROS file is loaded, as `ns` of `rosparam load` does: it goes before every name.

    Raises:
        ConfigError: no such file, not text, a line that is no setting, or a namespace for a file that knows none.
    """
    return _read(Path(path), namespace).settings


def _read(path: Path, namespace: str) -> ConfigFile:
    return read_text(_text(path), path, namespace)


def read_text(text: str, path: Path, namespace: str = "") -> ConfigFile:
    """A configuration file's text as `read_configs` reads the file. Raises ConfigError."""
    format = format_of(text, path)
    if not namespace:
        return ConfigFile(str(path), format, _MODULES[format].read(text, path))
    if format not in (ConfigFormat.ROS1_YAML, ConfigFormat.ROS2_YAML):
        raise ConfigError(
            "Only ROS parameters have namespaces.", hint=f"Leave '{namespace}=' out.", where=f"{namespace}={path}"
        )
    return ConfigFile(f"{namespace}={path}", format, _MODULES[format].read(text, path, namespace))


def text_for(format: ConfigFormat, option: Variable, value: float) -> str:
    """An option's value as a file of that format has it."""
    text: str = _MODULES[format].text_of(option, value)
    return text


def _text(path: Path) -> str:
    try:
        if path.stat().st_size > _LARGEST_BYTES:
            raise ConfigError("Too large for a configuration file.", hint="Is it a log?", where=str(path))
        return path.read_text(encoding="utf-8-sig")
    except OSError as err:
        hint = "Check the path."
        raise ConfigError(f"Cannot read the configuration: {err.strerror}.", hint=hint, where=str(path)) from err
    except UnicodeDecodeError as err:
        raise ConfigError("Not a configuration file: it is not text.", hint="Is it a log?", where=str(path)) from err


def read_configs(named: Iterable[str | Path]) -> tuple[ConfigFile, ...]:
    """Files as an operator names them, in the order they are loaded: `FILE` or, for ROS, `NAMESPACE=FILE`.

    Raises:
        ConfigError: as `read_config`.
    """
    return tuple(_read(*split_name(str(name))) for name in named)


def split_name(named: str) -> tuple[Path, str]:
    """The file and the namespace of `FILE` or `NAMESPACE=FILE`. Raises ConfigError."""
    namespace, equals, path = named.partition("=")
    if not equals or Path(named).exists():
        return Path(named), ""
    if not re.fullmatch(r"[~/\w]+", namespace) or not path:
        raise ConfigError("No such file.", hint="Write FILE or NAMESPACE=FILE.", where=named)
    return Path(path), namespace


def resolve(files: Sequence[ConfigFile], parameters: Iterable[str]) -> dict[str, Setting]:
    """The values that files, loaded one after the other, give parameters; by the parameter's name in the log.

    Names in files are shorter (ROS 1 namespaces) or patterns (ROS 2 wildcards): each format knows how they are meant.
    """
    loaded: dict[ConfigFormat, list[Mapping[str, Setting]]] = {}
    for file in files:
        loaded.setdefault(file.format, []).append(file.settings)
    found: dict[str, Setting] = {}
    for parameter in parameters:
        for format, settings in loaded.items():
            setting: Setting | None = _MODULES[format].find(settings, parameter)
            if setting is not None:
                found[parameter] = setting
    return found


def guesses(files: Sequence[ConfigFile], found: Mapping[str, Setting]) -> dict[str, list[str]]:
    """Per file, the parameters whose value is a bare name of a ROS 1 file that was loaded into no namespace."""
    named: dict[str, list[str]] = {}
    for file in files:
        if file.format is ConfigFormat.ROS1_YAML:
            own = [p for p, s in found.items() if file.settings.get(s.name) is s and ros1_yaml.is_guess(s.name, p)]
            if own:
                named[file.path] = own
    return named


def write_params(
    settings: Mapping[str, Setting], format: ConfigFormat, remarks: Mapping[str, str] | None = None
) -> str:
    """The settings as a configuration file of that format, with `remarks` by name as comments."""
    text: str = _MODULES[format].write(settings, remarks)
    return text


def unified_diff(run: Run, fix: Fix) -> str:
    """The configuration as driven against the fix, in the ecosystem's own format; only keys that change."""
    line_of = _MODULES[format_for(run.log.format, run.settings)].line_of
    driven, fixed = {}, {}
    for option, parameter, suggested in _assignments(fix.changes):
        change = next(change for change in fix.changes if change.option is option)
        setting = run.settings.get(parameter)
        current = None if setting is None else option_value(option, setting)
        driven[parameter] = line_of(option, parameter, change.current if current is None else current)
        fixed[parameter] = line_of(option, parameter, suggested)
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
