"""Configuration as driven: which parameter values were in force in a mission, and the options they stand for."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

from care_core.ecosystems.vehicles.self_written import SIMULATOR_PREFIX, is_self_written
from care_core.run import Setting, shown
from care_core.text import clean, log_time
from care_core.variables import Variable

SEVEN_DIGITS = 1e-6
"""Vehicles hold parameters in 32 bits (24 of mantissa: 6e-8 of a value), files and reports in seven digits (5e-7)."""


def same_value(a: float | str | None, b: float | str | None) -> bool:
    """The one answer to "the same parameter value": equal as far as a vehicle or a file holds it, `true` is 1."""
    if a is None or b is None:
        return a is b
    one, other = as_number(a), as_number(b)
    if one is None or other is None:
        from care_core.ecosystems.ros.yaml_tree import plain  # YAML's parser, which few logs need

        return bool(plain(str(a).strip()) == plain(str(b).strip()))  # lists, however quoted
    return math.isclose(one, other, rel_tol=SEVEN_DIGITS, abs_tol=1e-12) or (math.isnan(one) and math.isnan(other))


def as_number(value: float | str) -> float | None:
    """A value as a number, `true` as 1; None for what is none."""
    if not isinstance(value, str):
        return float(value)
    word = value.strip().casefold()
    if word in ("true", "false"):
        return float(word == "true")
    try:
        return float(word)
    except ValueError:
        return None


def in_force(history: Sequence[Setting], at_s: float) -> Setting:
    """The value in force at a time of the log; the first known value before that."""
    before = [setting for setting in history[1:] if setting.changed_at_s is not None and setting.changed_at_s <= at_s]
    return before[-1] if before else history[0]


def prevailing(history: Sequence[Setting], start_s: float, end_s: float) -> Setting:
    """The value in force for most of a span of the log: one that was put back before its end is not what was driven."""
    values = [in_force(history, start_s), *(changes_between(history, start_s, end_s)[1:])]
    if len(values) == 1:
        return values[0]
    since = [start_s, *(max(one.changed_at_s or start_s, start_s) for one in values[1:]), end_s]
    lasted: dict[float | str, float] = {}
    for one, begins, ends in zip(values, since, since[1:], strict=False):
        lasted[one.value] = lasted.get(one.value, 0.0) + ends - begins
    longest = max(lasted, key=lasted.__getitem__)
    return next(one for one in reversed(values) if one.value == longest)


def changes_between(history: Sequence[Setting], start_s: float, end_s: float) -> tuple[Setting, ...]:
    """The value in force at `start_s` and those that followed it until `end_s`; empty when none did."""
    later = [one for one in history[1:] if one.changed_at_s is not None and start_s < one.changed_at_s <= end_s]
    return (in_force(history, start_s), *later) if later else ()


def differing(
    histories: Mapping[str, tuple[Setting, ...]], *, everything: bool = False
) -> dict[str, tuple[Setting, ...]]:
    """Parameters that changed in the log or are off their default; `everything`: those of the vehicle's own too."""
    return {
        name: history
        for name, history in histories.items()
        if (everything or not is_self_written(name))
        and (
            len(history) > 1
            or (history[-1].default is not None and not same_value(history[-1].value, history[-1].default))
        )
    }


def remark(history: Sequence[Setting], *, source: bool = False) -> str:
    """What a value was before, when it changed, its default, and its source if asked for; for a comment in a file."""
    first, *later = history
    parts = []
    if later:
        steps = "".join(f" -> {shown(one.value)} at {log_time(one.changed_at_s)}" for one in later)
        parts.append(f"{shown(first.value)}{steps}")
    if history[-1].default is not None and not same_value(history[-1].value, history[-1].default):
        parts.append(f"default {shown(history[-1].default)}")
    if source:
        parts.append(f"from {history[-1].source}")
    return clean(", ".join(parts))


def option_value(option: Variable, setting: Setting) -> float | None:
    """The setting as the number that the option uses (bool: 0 or 1, enum: its code), None when it is no such value."""
    value = setting.value
    if isinstance(value, str) and (code := option.code_of(value)) is not None:
        return code
    number = as_number(value)
    return None if number is None or not math.isfinite(number) else _unscaled(option, number)


def parameter_value(option: Variable, value: float) -> float:
    """The option's value as its parameters hold it."""
    return value if option.scale == 1.0 else float(f"{value * option.scale:.7g}")


def _unscaled(option: Variable, value: float) -> float:
    return value if option.scale == 1.0 else float(f"{value / option.scale:.7g}")


def option_setting(option: Variable, settings: Mapping[str, Setting]) -> Setting | None:
    """The first of the option's parameters that the settings hold with a usable value."""
    for parameter in readable(option):
        setting = settings.get(parameter)
        if setting is not None and option_value(option, setting) is not None:
            return setting
    return None


def readable(option: Variable) -> tuple[str, ...]:
    """The option's parameters without those of a simulator."""
    return tuple(name for name in option.parameters if not name.startswith(SIMULATOR_PREFIX))


def configuration(
    options: Iterable[Variable], driven: Mapping[str, Setting], overrides: Mapping[str, Setting]
) -> tuple[dict[str, float], dict[str, str], dict[str, Setting]]:
    """Option values of a run, where each came from, and the settings with those of `overrides` that the log lacks.

    The log is what was driven, so it wins; `disagreements` lists where a file says otherwise.
    """
    config: dict[str, float] = {}
    sources: dict[str, str] = {}
    for option in options:
        setting = option_setting(option, driven) or option_setting(option, overrides)
        value = None if setting is None else option_value(option, setting)
        if setting is not None and value is not None:
            config[option.name] = value
            sources[option.name] = setting.source
    return config, sources, {**overrides, **driven}


def disagreements(
    options: Iterable[Variable], driven: Mapping[str, Setting], overrides: Mapping[str, Setting]
) -> tuple[str, ...]:
    """One sentence for each parameter of an option whose configuration file says another value than the log drove."""
    sentences = []
    for option in options:
        several = sum(parameter in driven for parameter in option.parameters) > 1
        for parameter in readable(option):
            ours, theirs = driven.get(parameter), overrides.get(parameter)
            if ours is None or theirs is None or ours is theirs:
                continue
            value, wanted = option_value(option, ours), option_value(option, theirs)
            if value is None or wanted is None or same_value(wanted, value):
                continue
            named = f"{option.name} ({parameter})" if several else option.name
            sentences.append(
                f"{named} was {option.show(value)} when driven, {theirs.source} says {option.show(wanted)};"
                " the driven value is used"
            )
    return tuple(sentences)
