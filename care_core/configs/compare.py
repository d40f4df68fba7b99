"""Two configurations: what only one has, and what differs."""

from __future__ import annotations

from collections.abc import Mapping

from care_core.configs.driven import same_value
from care_core.configs.loading import ConfigFile, resolve
from care_core.ecosystems.dialect import Dialect
from care_core.ecosystems.vehicles.self_written import is_self_written
from care_core.records import Record
from care_core.run import Setting, shown


class Side(Record):
    """One configuration by its name, with its settings.

    `format` is that of a configuration file, None for a log or a report. What a `partial` side does not hold means
    nothing: a report knows the profile's options only.
    """

    name: str
    settings: Mapping[str, Setting]
    format: Dialect | None = None
    partial: bool = False


class Difference(Record):
    """A parameter that differs; a side that lacks it is None."""

    parameter: str
    a: Setting | None
    b: Setting | None

    def __str__(self) -> str:
        if self.b is None:
            return f"- {self.parameter}  {shown(self.a.value if self.a else None)}"
        if self.a is None:
            return f"+ {self.parameter}  {shown(self.b.value)}"
        return f"! {self.parameter}  {shown(self.a.value)} -> {shown(self.b.value)}"


def compare(a: Side, b: Side, *, everything: bool = False) -> tuple[Difference, ...]:
    """The parameters that differ, by name.

    A name in a file may leave out its namespace: it is matched with the parameter of a log or a report that it stands
    for. Calibration and statistics, which nobody chooses, are left out unless `everything`.
    """
    left = _named_like(a, b) if b.format is None else dict(a.settings)
    right = _named_like(b, a) if a.format is None else dict(b.settings)
    found = []
    for name in sorted(left.keys() | right.keys()):
        one, other = left.get(name), right.get(name)
        if one is None or other is None:
            differs = not (b.partial if other is None else a.partial)
        else:
            differs = not same_value(one.value, other.value)
        if differs and (everything or not is_self_written(name)):
            found.append(Difference(name, one, other))
    return tuple(found)


def _named_like(side: Side, other: Side) -> dict[str, Setting]:
    """A file's settings by the names of a log, where one stands for it; by its own name elsewhere."""
    if side.format is None:
        return dict(side.settings)
    found = resolve((ConfigFile("", side.format, side.settings),), other.settings)
    used = {setting.name for setting in found.values()}
    return {**{name: setting for name, setting in side.settings.items() if name not in used}, **found}
