"""Configuration files as operators name them: read, and the values that they give the parameters of a log."""

from __future__ import annotations

import errno
import gc
import re
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from care_core import limits
from care_core.configs.formats import format_of
from care_core.ecosystems.dialect import Dialect
from care_core.ecosystems.ros.dialect import ROS1_YAML
from care_core.errors import ConfigError
from care_core.files import read_small_text
from care_core.records import Record
from care_core.run import Find, Setting
from care_core.text import clean

_LARGEST_BYTES = 1_000_000
_LARGEST = sys.float_info.max
_MANY_DIGITS = re.compile(rf"[+-]?[0-9_]{{{limits.INTEGER_DIGITS},}}")


class ConfigFile(Record):
    """A configuration file as it was named, and what it holds; `source` of a setting is file:line."""

    path: str
    format: Dialect
    settings: Mapping[str, Setting]
    namespace: str = ""


def read_config(path: str | Path, namespace: str = "") -> Mapping[str, Setting]:
    """Settings of a configuration file by name; `source` is file:line.

    Args:
        namespace: where a ROS file is loaded, as `ns` of `rosparam load` does: it goes before every name.

    Raises:
        ConfigError: no such file, not text, a line that is no setting, or a namespace for a file that knows none.
    """
    return _read(Path(path), namespace).settings


def _read(path: Path, namespace: str) -> ConfigFile:
    return read_text(text_of_file(path), path, namespace)


def read_text(text: str, path: Path, namespace: str = "") -> ConfigFile:
    """A configuration file's text as `read_configs` reads the file. Raises ConfigError."""
    format = format_of(text, path)
    if namespace and not format.is_yaml:
        raise ConfigError(
            "Only ROS parameters have namespaces.", hint=f"Leave '{namespace}=' out.", where=f"{namespace}={path}"
        )
    with _no_collector():
        if not namespace:
            read = ConfigFile(str(path), format, format.functions.read(text, path))
        else:
            settings = format.functions.read(text, path, namespace)
            read = ConfigFile(f"{namespace}={path}", format, settings, namespace)
    _check_numbers(read)
    return read


def _check_numbers(file: ConfigFile) -> None:
    """Refuse a number that no robot's software can hold: it would be endless here. Raises ConfigError."""
    for setting in file.settings.values():
        value = setting.value
        if isinstance(value, str):
            is_too_large = _MANY_DIGITS.fullmatch(value) is not None
        else:  # YAML has a word for endless
            is_too_large = not -_LARGEST <= value <= _LARGEST and not (file.format.is_yaml and isinstance(value, float))
        if is_too_large:
            raise ConfigError(
                f"{clean(setting.name)} is larger than any number can be.", hint="Correct it.", where=setting.source
            )


@contextmanager
def _no_collector() -> Iterator[None]:
    """While a tree grows nothing of it is garbage, and the collector would walk all of it again and again."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


def text_of_file(path: Path) -> str:
    """The text of a configuration file, without the mark that some editors begin it with. Raises ConfigError."""
    try:
        return read_small_text(path, encoding="utf-8-sig", most=_LARGEST_BYTES)
    except OSError as err:
        hint = "Is it a log?" if err.errno == errno.EFBIG else "Check the path."
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
    loaded: dict[Dialect, list[Mapping[str, Setting]]] = {}
    for file in files:
        loaded.setdefault(file.format, []).append(file.settings)
    finders: list[Find] = [format.functions.finder(settings) for format, settings in loaded.items()]
    resolved: dict[str, Setting] = {}
    for parameter in parameters:
        for find in finders:
            setting = find(parameter)
            if setting is not None:
                resolved[parameter] = setting
    return resolved


def guesses(files: Sequence[ConfigFile], resolved: Mapping[str, Setting]) -> dict[str, list[str]]:
    """Per file, the parameters whose value is a bare name of a ROS 1 file that was loaded into no namespace."""
    guessed: dict[str, list[str]] = {}
    for file in files:
        if file.format is ROS1_YAML:
            is_guess = file.format.functions.is_guess
            used = (name for name, setting in resolved.items() if file.settings.get(setting.name) is setting)
            if names := [name for name in used if is_guess(resolved[name].name, name)]:
                guessed[file.path] = names
    return guessed
