"""What a ROS 2 recorder writes about a recording: `metadata.yaml`, or the same text inside an MCAP or SQLite file."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from care_core.records import Record, field, replace
from care_core.run import Setting

FILE_NAME = "metadata.yaml"
PARAMETERS_NAME = "care_parameters.yaml"
"""Beside a recording the parameters of all nodes at its start, as `ros2 param dump` prints them."""

_ROOT = "rosbag2_bagfile_information"
_PARAMETERS = "ros__parameters"
_MOST_VALUES = 50_000
_LONGEST_NOTE = 200
_NO_DISTRO = "rosbags"
"""What the library of that name writes for a distribution."""
_UNSET_NS = 2**63 - 1


class Metadata(Record):
    """What is known beside the messages; empty or None where it is not said."""

    distro: str = ""
    duration_s: float | None = None
    message_count: int | None = None
    files: tuple[str, ...] = ()
    custom: Mapping[str, str] = field(default_factory=dict)

    def of_one_file(self) -> Metadata:
        """Without what is true of one file of a split recording only."""
        return replace(self, duration_s=None, message_count=None, files=())

    @staticmethod
    def merged(given: Sequence[Metadata]) -> Metadata:
        """One of several that speak of the same recording; the later wins."""
        whole = Metadata()
        for one in given:
            whole = Metadata(
                one.distro or whole.distro,
                whole.duration_s if one.duration_s is None else one.duration_s,
                whole.message_count if one.message_count is None else one.message_count,
                one.files or whole.files,
                {**whole.custom, **one.custom},
            )
        return whole

    def settings(self) -> dict[str, tuple[Setting, ...]]:
        """Parameters among the custom data: ROS 2 parameter files as values, and entries named `/node.parameter`."""
        found: dict[str, tuple[Setting, ...]] = {}
        for key, text in self.custom.items():
            for name, value in _parameters(key, text):
                found[name] = (Setting(name, value, f"recording metadata, {key}"),)
        return found

    def notes(self) -> dict[str, str]:
        """Custom data that is no parameter."""
        return {
            key: text for key, text in self.custom.items()
            if len(text) <= _LONGEST_NOTE and not any(_parameters(key, text))
        }  # fmt: skip


def parse_metadata(text: str) -> Metadata:
    """The metadata that a text holds; what is not understood of it is left out."""
    given = _load(text)
    if not isinstance(given, Mapping):
        return Metadata()
    given = given.get(_ROOT, given)
    if not isinstance(given, Mapping):
        return Metadata()
    duration_ns = _count(_inner(given.get("duration"), "nanoseconds"))
    custom = given.get("custom_data")
    files = given.get("relative_file_paths")
    distro = str(given.get("ros_distro") or "")
    return Metadata(
        distro="" if distro == _NO_DISTRO else distro,
        duration_s=duration_ns / 1e9 if duration_ns else None,
        message_count=_count(given.get("message_count")) or None,
        files=tuple(str(name) for name in files) if isinstance(files, list) else (),
        custom={str(key): str(value) for key, value in custom.items()} if isinstance(custom, Mapping) else {},
    )


def _parameters(key: str, text: str) -> Iterator[tuple[str, float | str]]:
    if _PARAMETERS in text:
        yield from _file_parameters(_load(text))
    elif key.startswith("/") and "." in key:
        value = _value(_load(text))
        if value is not None:
            yield key, value


def _file_parameters(given: Any) -> Iterator[tuple[str, float | str]]:
    """`/node.parameter` and value of each parameter in the tree of a ROS 2 parameter file."""
    pending: list[tuple[str, Any, bool]] = [("", given, False)]
    for _ in range(_MOST_VALUES):
        if not pending:
            return
        name, node, is_inside = pending.pop()
        if isinstance(node, Mapping):
            for key, child in reversed(list(node.items())):
                if is_inside:
                    pending.append((f"{name}.{key}", child, True))
                elif key == _PARAMETERS:
                    pending.append((name, child, True))
                else:
                    pending.append((f"{name}/{str(key).strip('/')}", child, False))
        elif is_inside and (value := _value(node)) is not None:
            yield name, value


def _value(given: Any) -> float | str | None:
    if given is None or isinstance(given, Mapping):
        return None
    if isinstance(given, (bool, int, float)):
        return float(given) if math.isfinite(given) else None
    return str(given)


def _load(text: str) -> Any:
    """The plain data of a YAML text, None where it is none, or goes beyond a limit."""
    from care_core import plain_yaml  # a log without notes needs no YAML

    try:
        return plain_yaml.load(text)
    except plain_yaml.PlainYamlError:
        return None


def _inner(given: Any, key: str) -> Any:
    return given.get(key) if isinstance(given, Mapping) else None


def _count(given: Any) -> int | None:
    """A count or a time; the recorder writes the largest number where there is none."""
    return given if isinstance(given, int) and 0 <= given < _UNSET_NS else None
