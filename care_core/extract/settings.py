"""Configuration as driven: which parameter values were in force in a mission, and the options they stand for."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

from care_core.profile.schema import Schema
from care_core.run import Setting
from care_core.variables import Variable

SIMULATOR_PREFIX = "SIM_"
"""Parameters of a simulated world: a real vehicle has none, so they are never options."""

_TRUE = frozenset({"true", "yes", "on"})
_FALSE = frozenset({"false", "no", "off"})


def in_force(history: Sequence[Setting], at_s: float) -> Setting:
    """The value in force at a time of the log; the first known value before that."""
    before = [setting for setting in history[1:] if setting.changed_at_s is not None and setting.changed_at_s <= at_s]
    return before[-1] if before else history[0]


def option_value(option: Variable, setting: Setting) -> float | None:
    """The setting as the number that the option uses (bool: 0 or 1, enum: its code), None when it is no such value."""
    value = setting.value
    if isinstance(value, str):
        return _number(option, value.strip())
    return float(value) if math.isfinite(value) else None


def _number(option: Variable, text: str) -> float | None:
    for code, label in option.labels:
        if text.casefold() == label.casefold():
            return code
    if text.casefold() in _TRUE:
        return 1.0
    if text.casefold() in _FALSE:
        return 0.0
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def find_setting(settings: Mapping[str, Setting], parameter: str) -> Setting | None:
    """The setting of a parameter: the same name, else the longest trailing part of it.

    A ROS configuration file is loaded into a namespace that it does not name: `DWAPlannerROS/sim_time` in a file
    is `/move_base/DWAPlannerROS/sim_time` in the log.
    """
    if parameter in settings:
        return settings[parameter]
    parts = parameter.strip("/").split("/")
    for skipped in range(len(parts)):
        name = "/".join(parts[skipped:])
        for candidate in (name, f"/{name}"):
            if candidate in settings:
                return settings[candidate]
    return None


def option_setting(option: Variable, settings: Mapping[str, Setting], *, exact: bool = True) -> Setting | None:
    """The first of the option's parameters that the settings hold with a usable value."""
    for parameter in readable(option):
        setting = settings.get(parameter) if exact else find_setting(settings, parameter)
        if setting is not None and option_value(option, setting) is not None:
            return setting
    return None


def readable(option: Variable) -> tuple[str, ...]:
    """The option's parameters without those of a simulator."""
    return tuple(name for name in option.parameters if not name.startswith(SIMULATOR_PREFIX))


def configuration(
    options: Iterable[Variable], driven: Mapping[str, Setting], overrides: Mapping[str, Setting]
) -> tuple[dict[str, float], dict[str, Setting]]:
    """Option values of a run, and its settings with those of `overrides` that the log lacks.

    The log is what was driven, so it wins; `disagreements` lists where a file says otherwise.
    """
    config: dict[str, float] = {}
    settings = dict(driven)
    for option in options:
        setting = option_setting(option, driven)
        if setting is None:
            setting = option_setting(option, overrides, exact=False)
            if setting is not None:
                settings[readable(option)[0]] = setting
        value = None if setting is None else option_value(option, setting)
        if value is not None:
            config[option.name] = value
    return config, settings


def disagreements(schema: Schema, config: Mapping[str, float], overrides: Mapping[str, Setting]) -> tuple[str, ...]:
    """One sentence for each option whose configuration file says another value than the log drove."""
    sentences = []
    for option in schema.options:
        setting = option_setting(option, overrides, exact=False)
        wanted = None if setting is None else option_value(option, setting)
        driven = config.get(option.name)
        if setting is None or wanted is None or driven is None:
            continue
        if not math.isclose(wanted, driven, rel_tol=1e-4, abs_tol=1e-9):
            sentences.append(
                f"{option.name} was {option.show(driven)} when driven, {setting.source} says {option.show(wanted)};"
                " the driven value is used."
            )
    return tuple(sentences)
