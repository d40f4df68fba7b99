"""Sources of Nav2's obstacle layers: sensors that are heard and of which nothing is kept, or that nobody hears."""

from __future__ import annotations

from collections.abc import Iterator

from care_core.ecosystems.ros.dialect import ROS2_YAML
from care_core.lint.problems import LintedFile, Problem
from care_core.lint.readers import Reader, Readers, readers
from care_core.lint.scopes import Scoped, words_of
from care_core.metadata.navigation import OBSTACLES, spanned

_BUFFER = "observation_buffer.cpp keeps the points between min_obstacle_height and max_obstacle_height of the source"
_PRIVATE = spanned("foxy-jazzy", "ros2")
"""Since kilted a relative topic is one of the robot's namespace (obstacle_layer.cpp, joinWithParentNamespace)."""


def _heights(file: LintedFile, held: Readers) -> Iterator[Problem]:
    """Sources that keep no point above the frame's own height. Nav2 takes 0.0 m where nothing is written, ROS 1 2.0 m.

    Of a file alone: a robot that drove shows by its costmap whether its laser lies at that height, as some simulated
    ones do.
    """
    for reader in held.of(*OBSTACLES) if file.text else ():
        for name in _sources(reader):
            entry, first = reader.values.get(f"{name}.max_obstacle_height"), _first(reader, name)
            if reader.is_off(f"{name}.marking") or first is None:
                continue
            if entry is not None and entry.number == 0:
                text = f"max_obstacle_height of {name} is 0: what it sees above the floor is not marked."
                yield file.warning("cannot-work", entry, text, "It must be above 0.", _BUFFER)
            elif entry is None and file.format is ROS2_YAML:
                text = f"max_obstacle_height of {name} is not set, and 0 then: what it sees above the floor is not "
                text += "marked."
                others = ("max_obstacle_height",) if "max_obstacle_height" in reader.values else ()
                hint = (
                    f"Write max_obstacle_height below {name}{', not beside it alone' if others else ''}: 2.0 is usual."
                )
                yield file.note("hinders", reader.values[first], text, hint, _BUFFER)


def _sources(reader: Reader) -> tuple[str, ...]:
    return words_of(reader.values.get("observation_sources"))


def _first(reader: Reader, name: str) -> str | None:
    """The first value that a source has."""
    return next((key for key in reader.values if key.startswith(f"{name}.")), None)


def check(file: LintedFile, result: Scoped, likely: frozenset[str]) -> Iterator[Problem]:
    """Topics that are others by the namespace of the costmap, which launch files of several robots remap (a note), and
    lists where Nav2 reads a text.

    Args:
        likely: the distributions that the file may be for.
    """
    for reader in readers(result).of(*OBSTACLES) if result.ros == "ros2" else ():
        entry = reader.values.get("observation_sources")
        if entry is not None and entry.kind == "list":
            text = "observation_sources is a list, declared is a string: the costmap will not start."
            hint = f'Write "{" ".join(words_of(entry))}".'
            yield file.error("wrong-type", entry, text, hint, "obstacle_layer.cpp, onInitialize")
        for name in _sources(reader) if likely and likely <= _PRIVATE else ():
            yield from _relative(file, reader, name)


def _relative(file: LintedFile, reader: Reader, name: str) -> Iterator[Problem]:
    entry = reader.values.get(f"{name}.topic")
    topic = "" if entry is None else str(entry.value)
    costmap = next((key for key in reader.scope if "costmap" in key), "")
    if entry is None or not costmap or not topic or topic[0] in "/~$<{":
        return
    text = f"{topic} has no slash before it: before kilted that is /{costmap}/{topic}, unless the launch remaps it."
    source = "obstacle_layer.cpp: the node of a costmap has a namespace of its name"
    yield file.note("hinders", entry, text, f"Is /{topic} meant?", source)


RULES = (_heights,)
