"""ArduPilot parameter files (.param, .parm) in the three ways they are written, and MAVProxy's commands."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import Path

from care_core.errors import ConfigError
from care_core.run import Setting
from care_core.variables import Variable

FLAGS = frozenset({"@READONLY"})
"""What may follow a value in a file of defaults."""

_QGC_FIELDS = 5


def read(text: str, path: Path) -> dict[str, Setting]:
    """Parameters by name, from `NAME value`, `NAME,value`, or QGroundControl's five columns; # begins a comment."""
    settings: dict[str, Setting] = {}
    for number, line in enumerate(text.splitlines(), start=1):
        words = [word for word in re.split(r"[\s,]+", line.partition("#")[0].strip()) if word not in FLAGS]
        if not any(words):
            continue
        where = f"{path}:{number}"
        name, value = _name_and_value(words, where)
        settings[name] = Setting(name, value, where)
    return settings


def _name_and_value(words: list[str], where: str) -> tuple[str, float]:
    if len(words) == _QGC_FIELDS:
        words = words[2:4]
    if len(words) != 2:
        raise ConfigError("Not a parameter: a line is NAME,VALUE.", hint="Correct the line.", where=where)
    name, text = words
    try:
        return name, float(int(text, 16)) if text.lower().startswith("0x") else float(text)
    except ValueError:
        raise ConfigError(
            f"The value of {name} is not a number: '{text}'.", hint="Correct the line.", where=where
        ) from None


def write(settings: Mapping[str, Setting]) -> str:
    """One `NAME,value` a line, in alphabetical order."""
    return "".join(f"{name},{_plain(settings[name].value)}\n" for name in sorted(settings))


def text_of(option: Variable, value: float) -> str:
    """An option's value as the file has it."""
    return _plain(float(round(value)) if option.type in ("int", "bool") else value)


def commands(changes: Iterable[tuple[Variable, str, float]]) -> list[str]:
    """MAVProxy's commands for (option, parameter, value)."""
    changes = tuple(changes)
    lines = [f"param set {parameter} {text_of(option, value)}" for option, parameter, value in changes]
    if any(option.reboot_required for option, _, _ in changes):
        lines.append("reboot")
    return lines


def _plain(value: float | str) -> str:
    # Parameters are 32-bit floats, which seven digits hold.
    return value if isinstance(value, str) else f"{value:.7g}" if value % 1 or abs(value) >= 1e16 else f"{value:.0f}"
