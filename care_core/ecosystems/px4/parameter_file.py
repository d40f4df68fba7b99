"""QGroundControl's parameter files (.params), of PX4 and ArduPilot vehicles: five columns with tabs between them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from care_core.ecosystems.ardupilot.parameter_file import commands, finder, is_name, line_of, not_a_name, plain, text_of
from care_core.ecosystems.px4.dialect import HEADER, is_row
from care_core.errors import ConfigError
from care_core.run import Setting

__all__ = ["commands", "finder", "line_of", "read", "text_of", "write"]

_INT32, _REAL32 = 6, 9
"""Types of MAVLink (MAV_PARAM_TYPE): what a PX4 parameter can be."""
_REALS = (_REAL32, 10)


def read(text: str, path: Path) -> dict[str, Setting]:
    """Parameters by name; where several components have one of that name, the first row counts (the autopilot's).

    Raises:
        ConfigError: a row that has not the five columns, or a value that is no number.
    """
    settings: dict[str, Setting] = {}
    for number, line in enumerate(text.splitlines(), start=1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        where = f"{path}:{number}"
        if not is_row(line):
            hint = "A row is VEHICLE, COMPONENT, NAME, VALUE, TYPE with tabs between them."
            raise ConfigError("Not a row of a parameter file.", hint=hint, where=where)
        _, _, name, value, kind = (word.strip() for word in line.split("\t"))
        settings.setdefault(name, Setting(name, _number(name, value, int(kind), where), where))
    return settings


def _number(name: str, text: str, kind: int, where: str) -> float:
    try:
        number = float(text)
        return number if kind in _REALS else int(number)
    except (ValueError, OverflowError):
        raise ConfigError(
            f"The value of {name} is not a number: '{text}'.", hint="Correct the line.", where=where
        ) from None


def write(settings: Mapping[str, Setting], remarks: Mapping[str, str] | None = None) -> str:
    """One row a parameter of vehicle 1, component 1, in alphabetical order; a remark stands in a line before."""
    lines = [HEADER]
    for name in sorted(settings):
        if not is_name(name):
            lines.append(not_a_name(name))
            continue
        value = settings[name].value
        if remarks and remarks.get(name):
            lines.append(f"# {name}: {remarks[name]}")
        kind = _INT32 if isinstance(value, int) else _REAL32
        lines.append(f"1\t1\t{name}\t{plain(value)}\t{kind}")
    return "".join(f"{line}\n" for line in lines)
