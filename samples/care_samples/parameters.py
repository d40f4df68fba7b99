"""Parameter files of the simulated robots, and the files that one begins with."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any


def read_parameters(
    path: Path, node: str, defaults: Mapping[str, float], ranges: Mapping[str, tuple[float, float]]
) -> dict[str, float]:
    """All parameters of a node by name (`space/name`), the defaults where the file (ROS 1 or ROS 2) does not say.

    Raises:
        OSError: the file cannot be read.
        ValueError: it is no parameter file, or a value is no number in the parameter's range.
    """
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    try:
        found: Any = YAML(typ="safe").load(path.read_text(encoding="utf-8"))
    except YAMLError as err:
        raise ValueError("this is no YAML") from err
    own = found.get(node) if isinstance(found, Mapping) else None
    own = own.get("ros__parameters", own) if isinstance(own, Mapping) else None
    if not isinstance(own, Mapping):
        raise ValueError(f"there are no parameters of '{node}'")
    given = dict(_leaves(own, ""))
    for name, value in given.items():
        if name not in defaults:
            raise ValueError(f"there is no parameter {name}")
        low, high = ranges[name]
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
            raise ValueError(f"{name} is {value}, not {low:g} to {high:g}")
    return {**defaults, **given}


def _leaves(tree: Mapping[str, Any], space: str) -> Iterator[tuple[str, Any]]:
    for name, value in tree.items():
        if isinstance(value, Mapping):
            yield from _leaves(value, f"{space}{name}/")
        else:
            yield f"{space}{name}", value


def write_start(texts: Mapping[str, str], folder: Path) -> None:
    """Write the files that one begins with; those that are there already stay."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in texts.items():
        path = folder / name
        if path.exists():
            print(f"kept {path}")
        else:
            path.write_text(text, encoding="utf-8")
            print(f"wrote {path}")
