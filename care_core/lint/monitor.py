"""The collision monitor: parts that its lists name, what they are, and a topic that it sends to itself."""

from __future__ import annotations

from collections.abc import Iterator

from care_core.lint.generic import problem_at
from care_core.lint.problems import ConfigFile, Problem, Severity
from care_core.lint.readers import Reader, Readers, warning
from care_core.lint.scopes import words_of

_NODES = ("collision_monitor", "collision_detector")
_TYPES = {
    "polygons": ("polygon", "circle", "velocity_polygon"),
    "observation_sources": ("scan", "pointcloud", "range", "polygon", "costmap"),
}
"""By list of parts: what a part may be, in any release."""
_SOURCE = "collision_monitor_node.cpp, getPolygons and configureSources"


def _types(file: ConfigFile, held: Readers) -> Iterator[Problem]:
    """Parts of a type that the node does not know."""
    for reader in held.of(*_NODES):
        for key, known in _TYPES.items():
            for name in words_of(reader.values.get(key)):
                entry = reader.values.get(f"{name}.type")
                if entry is None or entry.kind != "str" or entry.value in known or "$" in str(entry.value):
                    continue
                text = f"type of {name} is {entry.value}, which is none of its values: the node will not start."
                hint = f"They are {', '.join(known)}."
                yield problem_at("not-in-values", Severity.ERROR, file, entry, text, hint, _SOURCE)


def _shapeless(file: ConfigFile, held: Readers) -> Iterator[Problem]:
    """Polygons of which nothing says the type, which has no default."""
    for reader in held.of(*_NODES):
        entry = reader.values.get("polygons")
        typed = _typed(reader)
        missing = [name for name in words_of(entry) if name not in typed]
        if entry is not None and entry.kind == "list" and missing and file.text:
            text = f"polygons names {missing[0]}, and nothing here says its type: the node will not start."
            hint = f"Write the part {missing[0]} with its type, or leave it out of the list."
            yield warning("cannot-work", file, entry, text, hint, _SOURCE)


def _typed(reader: Reader) -> set[str]:
    return {key.rpartition(".")[0] for key in reader.values if key.endswith(".type")}


def _circular(file: ConfigFile, held: Readers) -> Iterator[Problem]:
    """Commands that the monitor hands on to the topic from which it takes them."""
    for reader in held.of("collision_monitor"):
        entry, out = reader.values.get("cmd_vel_in_topic"), reader.values.get("cmd_vel_out_topic")
        if entry is not None and out is not None and str(entry.value).strip("/") == str(out.value).strip("/"):
            text = f"cmd_vel_in_topic and cmd_vel_out_topic are both {out.value}: the monitor hears its own commands."
            hint = "The controller or the smoother has to send to another topic than the base listens to."
            yield warning("contradiction", file, out, text, hint, "collision_monitor_node.cpp", [entry])


RULES = (_types, _shapeless, _circular)
