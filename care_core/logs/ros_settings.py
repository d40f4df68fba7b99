"""Configuration as driven, from the messages that tell of it: dynamic_reconfigure and ROS 2 parameter events."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from care_core.logs.base import Table, Wanted
from care_core.run import Setting

_CONFIG = "dynamic_reconfigure/Config"
_CONFIG_DESCRIPTION = "dynamic_reconfigure/ConfigDescription"
_KINDS = ("bools", "ints", "strs", "doubles")
_UNBOUNDED = 2**31 - 1
"""dynamic_reconfigure writes the largest number of the type, or infinity, where a parameter has no bound."""

_EVENT = "rcl_interfaces/ParameterEvent"
_EVENT_PARTS = ("new_parameters", "changed_parameters")
_EVENT_VALUES = (
    "bool_value", "integer_value", "double_value", "string_value", "byte_array_value", "bool_array_value",
    "integer_array_value", "double_array_value", "string_array_value",
)  # fmt: skip
"""Fields of rcl_interfaces/ParameterValue; its `type` counts them from 1, 0 is not set."""

Histories = dict[str, list[Setting]]


def setting_fields(types: Mapping[str, str]) -> Wanted:
    """The fields that `settings_in` needs; `types` holds each topic's `package/Type`."""
    wanted: dict[str, list[str]] = {}
    for topic, kind in types.items():
        if kind == _CONFIG:
            wanted[topic] = _config_fields("")
        elif kind == _CONFIG_DESCRIPTION:
            wanted[topic] = [path for part in ("min.", "max.", "dflt.") for path in _config_fields(part)]
        elif kind == _EVENT:
            values = [f"value.{name}" for name in ("type", *_EVENT_VALUES)]
            wanted[topic] = ["node", *(f"{part}.{name}" for part in _EVENT_PARTS for name in ("name", *values))]
    return wanted


def settings_in(
    types: Mapping[str, str], tables: Mapping[str, Table], before: Mapping[str, tuple[Setting, ...]]
) -> dict[str, tuple[Setting, ...]]:
    """Per parameter the values it had, in time order and without repeats; `before`, what was told of the start."""
    histories: Histories = {name: list(history) for name, history in before.items()}
    for topic in sorted(tables):
        if types[topic] == _CONFIG:
            namespace = topic.rpartition("/")[0]
            bounds = _Bounds(tables.get(f"{namespace}/parameter_descriptions"))
            for name, value, time_s in _config_values(tables[topic]):
                _add(histories, f"{namespace}/{name}", value, time_s, topic, bounds, name)
        elif types[topic] == _EVENT:
            space = topic.rpartition("/")[0]
            for node, value, time_s in _event_values(tables[topic]):
                # What was renamed while it was recorded is another robot's, whatever its node calls itself.
                name = node if node.startswith(f"{space}/") else f"{space}{node}"
                _add(histories, name, value, time_s, topic, _Bounds(None), name)
    return {name: tuple(history) for name, history in histories.items()}


class _Bounds:
    """What `parameter_descriptions` says of a node's parameters, by name."""

    def __init__(self, table: Table | None) -> None:
        row = 0 if table is not None and len(table) else None
        self.low = _described(table, "min.", row)
        self.high = _described(table, "max.", row)
        self.default = _described(table, "dflt.", row)


def _add(
    histories: Histories, name: str, value: float | str, time_s: float, source: str,
    bounds: _Bounds, own_name: str,
) -> None:  # fmt: skip
    history = histories.setdefault(name, [])
    if history and history[-1].value == value:
        return
    history.append(
        Setting(
            name=name,
            value=value,
            source=source,
            default=bounds.default.get(own_name),
            low=_bound(bounds.low.get(own_name)),
            high=_bound(bounds.high.get(own_name)),
            changed_at_s=time_s if history else None,
        )
    )


def _config_fields(prefix: str) -> list[str]:
    return [f"{prefix}{kind}.{part}" for kind in _KINDS for part in ("name", "value")]


def _config_values(table: Table) -> Iterator[tuple[str, float | str, float]]:
    for row, time_s in enumerate(table.t.tolist()):
        for name, value in _described(table, "", row).items():
            yield name, value, time_s


def _described(table: Table | None, prefix: str, row: int | None) -> dict[str, float | str]:
    """Name to value of a dynamic_reconfigure Config found under `prefix` in a row of a table."""
    values: dict[str, float | str] = {}
    if table is None or row is None:
        return values
    for kind in _KINDS:
        names, given = _cell(table, f"{prefix}{kind}.name", row), _cell(table, f"{prefix}{kind}.value", row)
        pairs = zip(names, given, strict=False)  # flipped bits make one shorter than the other
        values.update({name: _plain(bool(value) if kind == "bools" else value) for name, value in pairs})
    return values


def _event_values(table: Table) -> Iterator[tuple[str, float | str, float]]:
    """Full name (`/node.parameter`), value and time of each parameter set."""
    nodes = table.columns.get("node", ())
    for row, time_s in enumerate(table.t.tolist()):
        node = "/" + str(nodes[row]).strip("/") if len(nodes) else ""
        for part in _EVENT_PARTS:
            kinds = _cell(table, f"{part}.value.type", row)
            for place, name in enumerate(_cell(table, f"{part}.name", row)):
                value = _event_value(table, f"{part}.value.", row, place, int(kinds[place]) if kinds else 0)
                if value is not None:
                    yield f"{node}.{name}", value, time_s


def _event_value(table: Table, prefix: str, row: int, place: int, kind: int) -> float | str | None:
    if not 0 < kind <= len(_EVENT_VALUES):
        return None
    given = _cell(table, prefix + _EVENT_VALUES[kind - 1], row)
    return _plain(given[place]) if place < len(given) else None


def _plain(value: Any) -> float | str:
    if isinstance(value, str):
        return value
    if hasattr(value, "__len__"):
        return str(value.tolist() if hasattr(value, "tolist") else list(value))
    # A file of parameters minds the difference: true, 1 and 1.0 are three types to ROS 2.
    if isinstance(value, (bool, np.bool_)):
        return "true" if value else "false"
    return int(value) if isinstance(value, (int, np.integer)) else float(value)


def _cell(table: Table, path: str, row: int) -> Sequence[Any]:
    """A list of a message; empty where a publisher's type lacks it."""
    if path not in table.columns:
        return ()
    value = table[path][row]
    return () if value is None else value


def _bound(value: float | str | None) -> float | None:
    if value is None or isinstance(value, str) or not abs(value) < _UNBOUNDED:
        return None
    return value
