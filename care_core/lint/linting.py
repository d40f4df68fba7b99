"""Files in, problems out: which family of rules a file belongs to."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from care_core.configs.driven import option_value, readable
from care_core.configs.loading import split_name
from care_core.ecosystems.ros.dialect import ROS2_YAML
from care_core.errors import UsageError, nearest
from care_core.lint import ardupilot, clashes, contradictions, generic, navigation, outputs, px4
from care_core.lint.problems import Entry, LintedFile, Problem
from care_core.lint.reading import read_file
from care_core.metadata.navigation import DISTRIBUTIONS
from care_core.records import Record
from care_core.run import Setting

if TYPE_CHECKING:
    from care_core.profile.schema import Schema

_VEHICLES = ("copter", "plane", "rover", "sub", "tracker", "blimp", "px4")
_MOST_KNOWN = 0.5
"""The share of its names above which a file is taken for a vehicle's."""


class Linted(Record):
    """One file and what was found in it, in the order of its lines."""

    file: LintedFile
    problems: tuple[Problem, ...]
    unknown: int = 0
    """Values of nodes, plugins and vehicles that no rule knows."""


def lint(names: Sequence[str], target: str = "", schema: Schema | None = None) -> tuple[Linted, ...]:
    """What is wrong with configuration files.

    Args:
        names: `FILE`, or for ROS `NAMESPACE=FILE`.
        target: the distribution or firmware that the files are for (`noetic`, `humble`, `copter-4.6`, `px4-1.15`);
            told from the files where it is empty.
        schema: of a profile, whose ranges are checked as well.

    Raises:
        CareError: no such file, not text, or an unknown target.
    """
    _check_target(target)
    return tuple(_lint(name, target, schema) for name in names)


def _check_target(target: str) -> None:
    ros = [name for several in DISTRIBUTIONS.values() for name in several]
    vehicle = target.partition("-")[0].removeprefix("ardu")
    if target and target not in ros and vehicle not in _VEHICLES:
        hint = (
            nearest(target, [*ros, *_VEHICLES]) or "Write a distribution (humble) or a firmware (copter-4.6, px4-1.15)."
        )
        raise UsageError(f"No tables for '{target}'.", hint=hint, where="--target")


def _lint(name: str, target: str, schema: Schema | None) -> Linted:
    path, namespace = split_name(name)
    file, refused = read_file(path, namespace)
    file, bytewise = (file, ()) if file.format.is_yaml else px4.read_as_numbers(file)
    problems = [*refused, *bytewise, *generic.check(file), *_of_ecosystem(file, target)]
    if schema is not None:
        problems += _of_profile(file, schema)
    order = sorted(set(problems), key=lambda one: (one.line, one.column, one.rule, one.text))
    return Linted(file, tuple(order), _unknown(file))


def _unknown(file: LintedFile) -> int:
    if file.format.is_yaml:
        return navigation.unknown(file)
    names = {entry.name for entry in file.entries}
    return 0 if max(px4.known(names), ardupilot.known(names)) > _MOST_KNOWN else len(file.entries)


def _of_ecosystem(file: LintedFile, target: str) -> Iterator[Problem]:
    if file.format.is_yaml:
        yield from navigation.check(file, target if target in _all_distributions() else "")
        return
    values = {entry.name: entry for entry in file.entries}
    yield from contradictions.pairs(file, values, contradictions.VEHICLE_PAIRS)
    firmware = "" if target in _all_distributions() else target
    is_px4 = firmware.startswith("px4") if firmware else px4.known(values) > ardupilot.known(values)
    rules = px4 if is_px4 else ardupilot
    if rules.known(values) > _MOST_KNOWN:
        yield from rules.check(file, firmware)
        yield from clashes.check(file, values, clashes.PX4 if is_px4 else clashes.ARDUPILOT)
        yield from (outputs.px4 if is_px4 else outputs.ardupilot)(file, values)


def _all_distributions() -> set[str]:
    return {name for several in DISTRIBUTIONS.values() for name in several}


def _of_profile(file: LintedFile, schema: Schema) -> Iterator[Problem]:
    """Values outside what a profile holds acceptable."""
    entries = {_setting_name(file, entry): entry for entry in file.entries}
    settings = {name: Setting(name, entry.value, "") for name, entry in entries.items()}
    find = file.format.functions.finder([settings])
    for option in schema.options:
        for parameter in readable(option):
            setting = find(parameter)
            value = None if setting is None else option_value(option, setting)
            if setting is None or value is None or option.accepts(value):
                continue
            text = f"{option.name} is {option.show(value)}, acceptable is {option.acceptable}."
            hint = "What is predicted there is a guess."
            yield file.note("outside-profile", entries[setting.name], text, hint)


def _setting_name(file: LintedFile, entry: Entry) -> str:
    """A value's name as the reader of the format has it."""
    if file.format is not ROS2_YAML or "ros__parameters" not in entry.keys:
        return "/".join((*file.namespace.strip("/").split("/"), *entry.keys)).strip("/")
    split = entry.keys.index("ros__parameters")
    node = "/".join((file.namespace.strip("/"), *entry.keys[:split])).strip("/")
    return f"/{node}.{'.'.join(entry.keys[split + 1 :])}"
