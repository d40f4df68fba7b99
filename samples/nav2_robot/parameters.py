"""Nav2's parameter file, as far as the robot needs it: values by node and dotted name."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

from care_samples.ros import Maker

Parameter: TypeAlias = "bool | int | float | str | Sequence[Any]"
Parameters: TypeAlias = Mapping[str, Mapping[str, Parameter]]
"""By node (`/controller_server`, `/local_costmap/local_costmap`) and by name (`FollowPath.max_vel_x`)."""

_OWN = "ros__parameters"


def read(path: Path) -> Parameters:
    """What a ROS 2 parameter file sets.

    Raises:
        OSError: the file cannot be read.
        ValueError: it is no YAML, or holds no node's parameters.
    """
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    try:
        tree: Any = YAML(typ="safe").load(path.read_text(encoding="utf-8"))
    except (YAMLError, UnicodeDecodeError) as err:
        raise ValueError("this is no YAML") from err
    found = dict(_nodes(tree, "")) if isinstance(tree, Mapping) else {}
    if not found:
        raise ValueError(f"no node has {_OWN}")
    return found


def _nodes(tree: Mapping[str, Any], space: str) -> Iterator[tuple[str, Mapping[str, Parameter]]]:
    for name, below in tree.items():
        if name == _OWN and isinstance(below, Mapping):
            yield space, dict(_leaves(below, ""))
        elif isinstance(below, Mapping):
            yield from _nodes(below, f"{space}/{str(name).strip('/')}")


def _leaves(tree: Mapping[str, Any], space: str) -> Iterator[tuple[str, Parameter]]:
    for name, value in tree.items():
        if isinstance(value, Mapping):
            yield from _leaves(value, f"{space}{name}.")
        elif value is not None:
            yield f"{space}{name}", value


def number(parameters: Parameters, node: str, name: str, otherwise: float) -> float:
    """A number of a node, or what Nav2 takes otherwise."""
    value = parameters.get(node, {}).get(name, otherwise)
    return float(value) if isinstance(value, (int, float)) else otherwise


def event(maker: Maker, time_s: float, node: str, values: Mapping[str, Parameter]) -> Any:
    """A node's parameters as the event that it sends when it declares them."""
    made = [maker.make("rcl_interfaces/Parameter", name, _value(maker, value)) for name, value in values.items()]
    return maker.make("rcl_interfaces/ParameterEvent", maker.stamp(time_s), node, made, [], [])


def _value(maker: Maker, value: Parameter) -> Any:
    import numpy as np

    fields: dict[str, Any] = {
        "type": 0, "bool_value": False, "integer_value": 0, "double_value": 0.0, "string_value": "",
        "byte_array_value": np.empty(0, np.uint8), "bool_array_value": np.empty(0, np.bool_),
        "integer_array_value": np.empty(0, np.int64), "double_array_value": np.empty(0, np.float64),
        "string_array_value": [],
    }  # fmt: skip
    if isinstance(value, bool):
        fields |= {"type": 1, "bool_value": value}
    elif isinstance(value, int):
        fields |= {"type": 2, "integer_value": value}
    elif isinstance(value, float):
        fields |= {"type": 3, "double_value": value}
    elif isinstance(value, str):
        fields |= {"type": 4, "string_value": value}
    elif all(isinstance(one, (int, float)) and not isinstance(one, bool) for one in value):
        fields |= {"type": 8, "double_array_value": np.array(value, np.float64)}
    else:
        fields |= {"type": 9, "string_array_value": [str(one) for one in value]}
    return maker.make("rcl_interfaces/ParameterValue", *fields.values())
