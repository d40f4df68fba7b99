"""Which parameters become options: those that somebody sets, with type, range and reference, each with its source."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence

from care_core.configs.driven import same_value
from care_core.lint.scopes import as_file, scoped
from care_core.metadata.fact import Fact
from care_core.metadata.navigation import Ros, fact_of, is_ros
from care_core.metadata.navigation import known as known_facts
from care_core.records import Record, Struct, field
from care_core.run import Setting
from care_core.scaffold.excluded import SAFETY, reason_to_exclude
from care_core.scaffold.inputs import InputLog
from care_core.variables import Role, ValueType, Variable, is_parameter_name

_SPREAD = 2.0
"""Where nothing says what is acceptable: half to double of what was driven, for people to correct."""
_SAMPLED = 5
"""So many different values were chosen to cover a range: it is the one that counts."""
_WHOLE = 20.0
"""Vehicles log every parameter as a float. One that is whole and as large as this loses nothing by being an integer."""


class Option(Record):
    """A variable, and where what is said of it comes from."""

    variable: Variable
    remark: str


class Options(Struct, eq=False):
    """What became an option, and the parameters that did not, by reason."""

    chosen: list[Option] = field(default_factory=list)
    left: dict[str, list[str]] = field(default_factory=dict)

    def leave(self, parameter: str, reason: str) -> None:
        self.left.setdefault(reason, []).append(parameter)


class _Driven(Record):
    """A parameter over all logs that hold it: every setting, and the value at the end of each log."""

    name: str
    settings: tuple[Setting, ...]
    last: tuple[float | str, ...]

    @property
    def values(self) -> tuple[float, ...]:
        """The different numbers it had, the smallest first."""
        found: list[float] = []
        for setting in self.settings:
            value = number(setting.value)
            if value is not None and not any(same_value(value, known) for known in found):
                found.append(value)
        return tuple(sorted(found))

    @property
    def usual(self) -> tuple[float, int]:
        """The value that most logs end with, of several the first, and in how many."""
        return Counter(value for value in map(number, self.last) if value is not None).most_common(1)[0]

    @property
    def default(self) -> float | None:
        """What the source of the log calls its default."""
        found = (number(setting.default) for setting in self.settings if setting.default is not None)
        return next((value for value in found if value is not None), None)


def number(value: float | str | None) -> float | None:
    """A parameter's value as an option counts it (true: 1), to the seven digits that vehicles hold; None for text."""
    if isinstance(value, str):
        return {"true": 1.0, "false": 0.0}.get(value.strip().casefold())
    return float(f"{value:.7g}") if value is not None and math.isfinite(value) else None


def find_options(logs: Sequence[InputLog], known: Mapping[str, Variable], taken: Iterable[str]) -> Options:
    """The options of these logs.

    Args:
        known: options of the profiles that came with the program, by parameter.
        taken: names that other variables of the profile have.
    """
    stack = logs[0].stack
    found = Options()
    chosen: list[tuple[_Driven, Fact | None]] = []
    read = _read_by_whom(logs) if is_ros(stack) else {}
    for driven in _all_driven(logs):
        facts = read.get(driven.name)
        fact = _fact_of(driven, facts) if facts else fact_of(stack, driven.name) if is_ros(stack) else None
        reason = _reason_to_exclude(stack, driven, len(logs), fact, known)
        if reason:
            found.leave(driven.name, reason)
        else:
            chosen.append((driven, fact))
    chosen, sets = _together(chosen, known)
    names = _short_names([driven.name for driven, _ in chosen], known, set(taken))
    for driven, fact in chosen:
        option = _option(names[driven.name], driven, stack, fact, known.get(driven.name), sets.get(driven.name, ()))
        if option is None:
            found.leave(driven.name, "they are 0 and nothing says how large they may be")
        else:
            found.chosen.append(option)
    return found


def _read_by_whom(logs: Sequence[InputLog]) -> dict[str, tuple[Fact, ...]]:
    """What the table says of each parameter by the plugin that reads it, which the parameters themselves name."""
    settings = {name: history[-1] for log in logs for name, history in log.settings.items() if history}
    ros: Ros = "ros2" if logs[0].stack == "ros2" else "ros1"
    file = as_file(settings, logs[0].path, is_ros2=ros == "ros2")
    names = {id(entry): name for name, entry in zip(settings, file.entries, strict=True)}
    return {
        names[id(place.entry)]: tuple(fact for owner in place.owners for fact in known_facts(ros, owner, place.name))
        for place in scoped(file).places
        if place.owners
    }


def _fact_of(driven: _Driven, facts: Sequence[Fact]) -> Fact:
    """Of what the releases say that whose default was driven, else the newest."""
    usual = driven.usual[0] if any(number(value) is not None for value in driven.last) else None
    alike = (one for one in facts if usual is not None and _same(one.default_number, usual))
    return next(alike, facts[-1])


def _same(default: float | None, value: float) -> bool:
    return default is not None and same_value(default, value)


def _together(
    chosen: Sequence[tuple[_Driven, Fact | None]], known: Mapping[str, Variable]
) -> tuple[list[tuple[_Driven, Fact | None]], dict[str, tuple[str, ...]]]:
    """What a bundled profile sets as one, where it was driven as one: the first of each, and all that this one sets."""
    by_name = {driven.name: driven for driven, _ in chosen}
    sets: dict[str, tuple[str, ...]] = {}
    for name, driven in by_name.items():
        option = known.get(name)
        own = () if option is None else tuple(one for one in option.parameters if known.get(one) is option)
        if len(own) > 1 and own[0] == name:
            alike = [one for one in own if one in by_name and by_name[one].last == driven.last]
            if len(alike) > 1:
                sets[name] = tuple(alike)
    others = {other for name, several in sets.items() for other in several if other != name}
    return [(driven, fact) for driven, fact in chosen if driven.name not in others], sets


def _all_driven(logs: Sequence[InputLog]) -> list[_Driven]:
    histories: dict[str, list[tuple[Setting, ...]]] = {}
    for log in logs:
        for name, history in log.settings.items():
            histories.setdefault(name, []).append(history)
    return [
        _Driven(name, tuple(one for history in several for one in history), tuple(h[-1].value for h in several))
        for name, several in sorted(histories.items())
    ]


def _reason_to_exclude(stack: str, driven: _Driven, logs: int, fact: Fact | None, known: Mapping[str, Variable]) -> str:
    """Why a parameter is not an option; '' for one that is."""
    if not is_parameter_name(driven.name):
        return "no parameter is called so: the log is damaged there"
    reason = reason_to_exclude(stack, driven.name)
    if reason:
        return reason
    if any(number(value) is None for value in driven.last):
        return "their value is a string, a list or not a number"
    if len(driven.last) < logs:
        return f"not every log holds them (an option needs a value in all {logs})"
    default = driven.default if fact is None or driven.default is not None else fact.default_number
    is_new = len(driven.values) == 1 and driven.name not in known
    if is_new and default is None and not is_ros(stack):
        return "they never changed, and no log says their default"
    is_set = len(driven.values) > 1 or default is None or not same_value(driven.usual[0], default)
    return "" if is_set or driven.name in known else "at their default in every log"


def _short_names(parameters: Sequence[str], known: Mapping[str, Variable], taken: set[str]) -> dict[str, str]:
    """A name each: the one that a bundled profile has for it, else as many of its last parts as tell it apart."""
    names: dict[str, str] = {}
    for parameter in parameters:
        option = known.get(parameter)
        is_own = option is not None and option.parameters[0] == parameter  # not a second key that the option sets too
        if option is not None and is_own and option.name not in {*taken, *names.values()}:
            names[parameter] = option.name
    for parameter in parameters:
        parts = [re.sub(r"\W", "_", part) for part in re.split(r"[/.]", parameter) if part] or ["parameter"]
        used = {*taken, *names.values()}
        others = [other for other in parameters if other != parameter]
        for count in range(1, len(parts) + 1):
            name = "_".join(parts[-count:])
            is_own = not any(_ends_alike(other, parts[-count:]) for other in others)
            if parameter not in names and name not in used and (is_own or count == len(parts)):
                names[parameter] = name
        names.setdefault(parameter, f"{'_'.join(parts)}_{len(names)}")
    return names


def _ends_alike(other: str, parts: Sequence[str]) -> bool:
    own = [re.sub(r"\W", "_", part) for part in re.split(r"[/.]", other) if part]
    return own[-len(parts) :] == list(parts)


def _option(
    name: str, driven: _Driven, stack: str, fact: Fact | None, known: Variable | None, sets: tuple[str, ...]
) -> Option | None:
    kind, labels, type_from = _type(driven, stack, fact, known)
    reference, reference_from = _reference(driven, stack, known)
    bounds = (0.0, 1.0), "yes or no"
    if kind == "enum":
        bounds = (min(code for code, _ in labels), max(code for code, _ in labels)), type_from
    elif kind != "bool":
        found = _range(driven, reference, kind, fact, known)
        if found is None:
            return None
        bounds = found
    (low, high), range_from = bounds
    low, high = min(float(f"{low:.4g}"), reference), max(float(f"{high:.4g}"), reference)
    variable = Variable(
        name,
        Role.OPTION,
        kind,
        unit="" if known is None else known.unit,
        doc="" if known is None else known.doc,
        range=(low, high),
        default=reference,
        labels=labels,
        parameters=sets or (driven.name,),
        safety=SAFETY.match(driven.name) is not None,
    )
    said = [f"range: {range_from}", f"default: {reference_from}", f"type: {type_from}", _driven_as(driven)]
    return Option(variable, "; ".join(part for part in said if part))


def _driven_as(driven: _Driven) -> str:
    values = driven.values
    if len(values) == 1:
        return f"driven as {values[0]:g} only"
    shown = ", ".join(f"{value:g}" for value in values) if len(values) <= _SAMPLED else f"{len(values)} values"
    return f"driven as {shown}"


def _type(
    driven: _Driven, stack: str, fact: Fact | None, known: Variable | None
) -> tuple[ValueType, tuple[tuple[float, str], ...], str]:
    if known is not None and (not known.labels or set(driven.values) <= {code for code, _ in known.labels}):
        return known.type, known.labels, "bundled profile"
    if fact is not None and fact.values and set(driven.values) <= {code for code, _ in fact.values}:
        return "enum", fact.values, "bundled table"
    if any(isinstance(value, str) for value in driven.last):
        return "bool", (), "log"
    if is_ros(stack):
        return ("int" if all(isinstance(value, int) for value in driven.last) else "float"), (), "log"
    everything = (*driven.values, *([] if driven.default is None else [driven.default]))
    is_whole = all(value.is_integer() for value in everything) and max(map(abs, everything)) >= _WHOLE
    return ("int" if is_whole else "float"), (), "its values"


def _reference(driven: _Driven, stack: str, known: Variable | None) -> tuple[float, str]:
    """The configuration to judge against: the firmware's; for ROS, whose defaults drive no robot, the usual one."""
    default = driven.default
    if not is_ros(stack) and default is not None:
        return default, "firmware default (log)"
    usual, times = driven.usual
    if times == 1 and len(driven.last) > 1 and known is not None and known.default is not None:
        return known.default, "bundled profile, for no two logs agree"
    own = "" if default is None or same_value(default, usual) else f" (the node's own is {default:g})"
    return usual, f"as driven in {times} of {len(driven.last)} logs{own}"


def _range(
    driven: _Driven, reference: float, kind: ValueType, fact: Fact | None, known: Variable | None
) -> tuple[tuple[float, float], str] | None:
    """Acceptable values and what says so; None where nothing does. Holds the reference and all that was driven."""
    values = (*driven.values, reference)
    low, high = min(values), max(values)
    if known is not None and known.range is not None:
        return (min(low, known.range[0]), max(high, known.range[1])), "bundled profile, and what was driven"
    if len(driven.values) >= _SAMPLED:
        return (low, high), f"log, {len(driven.values)} values driven"
    bounds, bounds_from = _bounds(driven, fact)
    if low == high == 0:
        return None if None in bounds else ((float(bounds[0] or 0), float(bounds[1] or 0)), bounds_from)
    wide = low / _SPREAD if low >= 0 else low * _SPREAD, high * _SPREAD if high >= 0 else high / _SPREAD
    held = (
        wide[0] if bounds[0] is None else min(max(wide[0], bounds[0]), low),
        wide[1] if bounds[1] is None else max(min(wide[1], bounds[1]), high),
    )
    if kind == "int":
        held = float(math.floor(held[0])), float(math.ceil(held[1]))
    if held[0] >= held[1]:
        return None
    said = "a guess, half to double of what was driven"
    return held, f"{said}, within {bounds_from}" if bounds_from else said


def _bounds(driven: _Driven, fact: Fact | None) -> tuple[tuple[float | None, float | None], str]:
    """The least and the largest value that the log, else the bundled table, allows."""
    low = next((one.low for one in driven.settings if one.low is not None), None)
    high = next((one.high for one in driven.settings if one.high is not None), None)
    if low is not None or high is not None:
        return (low, high), f"{_shown(low)} to {_shown(high)} (log)"
    if fact is not None and (fact.low is not None or fact.high is not None):
        return (fact.low, fact.high), f"{_shown(fact.low)} to {_shown(fact.high)} (bundled table)"
    return (None, None), ""


def _shown(bound: float | None) -> str:
    return "any" if bound is None else f"{bound:g}"
