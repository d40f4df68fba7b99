"""ArduPilot parameter files (.param, .parm, .params): `NAME value` or `NAME,value`, and the commands that set them."""

from __future__ import annotations

import re
from collections import ChainMap
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from care_core.errors import ConfigError
from care_core.run import Find, Setting
from care_core.text import clean, command
from care_core.variables import Variable

FLAGS = frozenset({"@READONLY"})
"""What may follow a value in a file of defaults."""

_DIGITS_HOLD = 1e16
"""Below this a whole number is written without an exponent."""

_LINE = re.compile(r"([^\s,]+)(?:\s*,\s*|\s+)(\S+)")


def read(text: str, path: Path) -> dict[str, Setting]:
    """Parameters by name; # begins a comment.

    Raises:
        ConfigError: a line that is no parameter.
    """
    settings: dict[str, Setting] = {}
    for number, line in enumerate(text.splitlines(), start=1):
        words = [word for word in line.partition("#")[0].split() if word not in FLAGS]
        if not words:
            continue
        where = f"{path}:{number}"
        match = _LINE.fullmatch(" ".join(words))
        if match is None:
            raise ConfigError("Not a parameter: a line is NAME,VALUE.", hint="Correct the line.", where=where)
        name = match[1]
        settings[name] = Setting(name, _number(name, match[2], where), where)
    return settings


def _number(name: str, text: str, where: str) -> float:
    try:
        return float(int(text, 16)) if text.lower().startswith("0x") else float(text)
    except (ValueError, OverflowError):
        raise ConfigError(
            f"The value of {name} is not a number: '{text}'.", hint="Correct the line.", where=where
        ) from None


def finder(files: Sequence[Mapping[str, Setting]]) -> Find:
    """The values that files loaded one after the other give parameters."""
    return dict(ChainMap(*(dict(settings) for settings in reversed(files)))).get


def is_name(name: str) -> bool:
    """Whether a vehicle can have such a parameter; damage makes names of anything, a line of its own included."""
    return re.fullmatch(r"\w+", name, re.ASCII) is not None


def not_a_name(name: str) -> str:
    """The comment that stands in the place of a parameter of which no file can hold the name."""
    return f"# left out, the log is damaged here: {clean(name)}"


def write(settings: Mapping[str, Setting], remarks: Mapping[str, str] | None = None) -> str:
    """One `NAME,value` a line, in alphabetical order, with the remark of the name as a comment."""
    lines = []
    for name in sorted(settings):
        if not is_name(name):
            lines.append(f"{not_a_name(name)}\n")
            continue
        remark = f"  # {remarks[name]}" if remarks and remarks.get(name) else ""
        lines.append(f"{name},{plain(settings[name].value)}{remark}\n")
    return "".join(lines)


def text_of(option: Variable, value: float) -> str:
    """An option's value as the file has it."""
    return plain(float(round(value)) if option.type in ("int", "bool") else value)


def line_of(option: Variable, parameter: str, value: float) -> str:
    """One setting as a line of a diff."""
    return f"{parameter},{text_of(option, value)}"


def commands(changes: Iterable[tuple[Variable, str, float]]) -> list[str]:
    """MAVProxy's commands for (option, parameter, value), which PX4's shell knows as well."""
    changes = tuple(changes)
    lines = [command("param", "set", parameter, text_of(option, value)) for option, parameter, value in changes]
    if any(option.reboot_required for option, _, _ in changes):
        lines.append("reboot")
    return lines


def plain(value: float | str) -> str:
    """A number in as few digits as hold it: parameters are 32-bit floats."""
    if isinstance(value, str):
        return value
    if float(value).is_integer() and abs(value) < _DIGITS_HOLD:
        return f"{value:.0f}"
    short = f"{value:.7g}"
    return short if np.float32(short) == np.float32(value) else f"{value:.9g}"
