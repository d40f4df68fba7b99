"""The collision monitor: parts that its lists name, what they are, and a topic that it sends to itself."""

from __future__ import annotations

from collections.abc import Iterator

from care_core.lint.problems import LintedFile, Problem
from care_core.lint.readers import Reader, Readers, numbers
from care_core.lint.scopes import split, words_of

_NODES = ("collision_monitor", "collision_detector")
_TYPES = {
    "polygons": ("polygon", "circle", "velocity_polygon"),
    "observation_sources": ("scan", "pointcloud", "range", "polygon", "costmap"),
}
"""By list of parts: what a part may be, in any release."""
_LEAST = 6
"""Numbers of the smallest polygon."""
_SOURCE = "collision_monitor_node.cpp, getPolygons and configureSources"


def _types(file: LintedFile, held: Readers) -> Iterator[Problem]:
    """Parts of a type that the node does not know."""
    for reader in held.of(*_NODES):
        for key, known in _TYPES.items():
            for name in words_of(reader.values.get(key)):
                entry = reader.values.get(f"{name}.type")
                if entry is None or entry.kind != "str" or entry.value in known or "$" in str(entry.value):
                    continue
                text = f"type of {name} is {entry.value}, which is none of its values: the node will not start."
                hint = f"They are {', '.join(known)}."
                yield file.error("not-in-values", entry, text, hint, _SOURCE)


def _shapeless(file: LintedFile, held: Readers) -> Iterator[Problem]:
    """Polygons of which nothing says the type, which has no default."""
    for reader in held.of(*_NODES):
        entry = reader.values.get("polygons")
        typed = _typed(reader)
        missing = [name for name in words_of(entry) if name not in typed]
        if entry is not None and entry.kind == "list" and missing and file.text:
            text = f"polygons names {missing[0]}, and nothing here says its type: the node will not start."
            hint = f"Write the part {missing[0]} with its type, or leave it out of the list."
            yield file.warning("cannot-work", entry, text, hint, _SOURCE)


def _points(file: LintedFile, held: Readers) -> Iterator[Problem]:
    """Polygons with half a corner, or fewer than three."""
    for reader in held.of("Polygon"):
        entry = reader.values.get("points")
        count = len(numbers(entry))
        if entry is not None and count and (count % 2 or count < _LEAST):
            text = f"points of {reader.name()} has {count} numbers: the node will not start."
            hint = "Write x and y of each corner, of at least three."
            yield file.error("cannot-work", entry, text, hint, "polygon.cpp, getParameters")


def _unheard(file: LintedFile, held: Readers) -> Iterator[Problem]:
    """Sources that a list names and nothing describes, where another is described that no list names."""
    for reader in held.of(*_NODES):
        entry = reader.values.get("observation_sources")
        parts = dict.fromkeys(name.partition(".")[0] for name in _around(file, reader) if "." in name)
        listed = {word for key in _TYPES for word in words_of(reader.values.get(key))}
        spare = [part for part in parts if part not in listed and f"{part}.topic" in _around(file, reader)]
        missing = [name for name in words_of(entry) if name not in parts]
        if entry is not None and missing and spare:
            text = f"observation_sources names {missing[0]}, which nothing describes, and not {spare[0]}: the node "
            text += "listens to a laser on scan."
            yield file.warning("cannot-work", entry, text, f"Is {spare[0]} meant?", _SOURCE)


def _around(file: LintedFile, reader: Reader) -> set[str]:
    """What stands below a node, by names with dots, whoever reads it."""
    size = len(reader.scope)
    keys = (split(entry) for entry in file.entries)
    return {".".join(one[size:]) for one in keys if one[:size] == reader.scope}


def _typed(reader: Reader) -> set[str]:
    return {key.rpartition(".")[0] for key in reader.values if key.endswith(".type")}


def _circular(file: LintedFile, held: Readers) -> Iterator[Problem]:
    """Commands that the monitor hands on to the topic from which it takes them."""
    for reader in held.of("collision_monitor"):
        entry, out = reader.values.get("cmd_vel_in_topic"), reader.values.get("cmd_vel_out_topic")
        if entry is not None and out is not None and str(entry.value).strip("/") == str(out.value).strip("/"):
            text = f"cmd_vel_in_topic and cmd_vel_out_topic are both {out.value}: the monitor hears its own commands."
            hint = "The controller or the smoother has to send to another topic than the base listens to."
            yield file.warning("contradiction", out, text, hint, "collision_monitor_node.cpp", [entry])


RULES = (_types, _shapeless, _circular, _points, _unheard)
