"""Layers of a costmap: their order, their sources, what marks obstacles and what takes them away."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from care_core.ecosystems.ros.dialect import ROS2_YAML
from care_core.lint.problems import Entry, LintedFile, Problem
from care_core.lint.readers import INFLATIONS, MARKING, Reader, Readers
from care_core.lint.scopes import COSTMAP, class_of, words_of
from care_core.metadata.navigation import OBSTACLES

_RANGES = {"obstacle_max_range": 2.5, "raytrace_max_range": 3.0}
"""What a source of Nav2's obstacle layers has where nothing is written, m (obstacle_layer.cpp)."""
_OF_SOURCES = (".topic", ".data_type", ".marking", ".clearing")
"""What tells the part of a source from others of a layer."""
Listed = Sequence[tuple[str, str]]
"""Layers that are loaded and on, with their class, in their order."""
_ORDER = "layered_costmap.cpp, updateMap: layers write into the costmap in the order of the list"


def _marks(file: LintedFile, held: Readers) -> Iterator[Problem]:
    """Costmaps into which nothing puts obstacles, or out of which nothing takes them, and obstacles that stay."""
    for costmap in held.of(COSTMAP):
        layers = [one for one in held.within(costmap.scope) if one.is_a(*OBSTACLES)]
        marking = [one for one in layers if not one.is_off("enabled")]
        if layers and not marking and any("local_costmap" in key for key in costmap.scope):
            text = "No layer of the local costmap that marks obstacles is on: the robot drives blind."
            yield file.warning("hinders", layers[0].values["enabled"], text, "Switch one on.", "obstacle_layer.cpp")
        for name, what in (("marking", "puts obstacles into it"), ("clearing", "takes obstacles out of it")):
            switches = [entry for layer in marking for entry in layer.own(name)]
            if switches and all(entry.value == "false" for entry in switches):
                text = f"No source of {costmap.name() or 'the costmap'} {what}."
                hint = f"Switch {name} on for one."
                yield file.warning("hinders", switches[0], text, hint, "obstacle_layer.cpp", switches[1:])
    for reader in held.of(*OBSTACLES, COSTMAP):
        yield from _uncleared(file, reader)


def _uncleared(file: LintedFile, reader: Reader) -> Iterator[Problem]:
    """Sources that mark obstacles farther away than they clear."""
    for short, far in (("raytrace_range", "obstacle_range"), ("raytrace_max_range", "obstacle_max_range")):
        keys = {key[: -len(last)] for key in reader.values for last in (short, far) if key.endswith(last)}
        for source in sorted(keys):
            marked, cleared = reader.values.get(f"{source}{far}"), reader.values.get(f"{source}{short}")
            one_is_default = marked is None or cleared is None
            if reader.is_off(f"{source}marking") or reader.is_off(f"{source}clearing"):
                continue
            if one_is_default and (short not in _RANGES or not source or not reader.is_on(f"{source}clearing")):
                continue
            far_m, short_m = (_RANGES.get(name, 0.0) if one is None else one.number or 0.0
                              for one, name in ((marked, far), (cleared, short)))  # fmt: skip
            entry = cleared or marked
            if entry is not None and 0 < short_m < far_m:
                said = [" by default" if one is None else "" for one in (marked, cleared)]
                text = f"{far} ({far_m:g} m{said[0]}) is above {short} ({short_m:g} m{said[1]})."
                hint = "What is marked beyond is never cleared."
                others = [marked] if cleared is not None and marked is not None else []
                yield file.warning("hinders", entry, text, hint, "obstacle_layer.cpp", others)


def _ordered(file: LintedFile, held: Readers) -> Iterator[Problem]:
    """Layers of Nav2 that come too late in the list: it is the order in which they write into the costmap."""
    for reader in held.of(COSTMAP, "PluginContainerLayer"):
        entry, listed = reader.values.get("plugins"), _listed(held, reader)
        if entry is not None:
            yield from _overwritten(file, reader, entry, listed)
            yield from _not_inflated(file, entry, listed)


def _listed(held: Readers, costmap: Reader) -> Listed:
    off = {one.scope[-1] for one in held.within(costmap.scope) if one.is_off("enabled")}
    named = words_of(costmap.values.get("plugins"))
    classes = {name: one for name in named if (one := costmap.values.get(f"{name}.plugin"))}
    return [(name, class_of(str(one.value))) for name, one in classes.items() if name not in off]


def _overwritten(file: LintedFile, costmap: Reader, entry: Entry, listed: Listed) -> Iterator[Problem]:
    """Obstacles over which a map is written."""
    maps = [place for place, (_, layer) in enumerate(listed) if layer == "StaticLayer"]
    marked = [name for name, layer in listed[: maps[-1] if maps else 0] if layer in MARKING]
    if marked and not costmap.is_on("use_maximum"):
        name = listed[maps[-1]][0]
        text = f"{name} comes after {marked[0]}: the map overwrites the obstacles."
        hint = f"Put {name} first, or switch use_maximum of the costmap on."
        yield file.warning("hinders", entry, text, hint, "static_layer.cpp, updateCosts")


def _not_inflated(file: LintedFile, entry: Entry, listed: Listed) -> Iterator[Problem]:
    """Obstacles that are written after all inflation is done."""
    places = [place for place, (_, layer) in enumerate(listed) if layer in INFLATIONS]
    if not places:
        return
    last = listed[places[-1]][0]
    for name, layer in listed[places[-1] + 1 :]:
        if layer in (*MARKING, "StaticLayer"):
            text = f"{name} comes after {last}: its obstacles are not inflated."
        elif layer == "DenoiseLayer":
            text = f"{name} comes after {last}: what it removes stays inflated."
        else:
            continue
        yield file.warning("hinders", entry, text, f"Put {last} after {name}.", _ORDER)


def _sourced(file: LintedFile, held: Readers) -> Iterator[Problem]:
    """Sources that are named otherwise than the part that is to describe them."""
    for reader in held.of(*OBSTACLES):
        entry = reader.values.get("observation_sources")
        named = words_of(entry)
        parts = list(dict.fromkeys(key.rpartition(".")[0] for key in reader.values if key.endswith(_OF_SOURCES)))
        missing = [name for name in named if name not in parts]
        spare = [name for name in parts if name not in named]
        if entry is None or not missing or not spare:
            continue
        text = f"observation_sources names {missing[0]}, which has no values here, and {spare[0]} is not named: "
        text += f"{missing[0]} has the defaults, which clear nothing."
        hint = f"Give both the same name: {missing[0]} or {spare[0]}."
        others = [one for key, one in reader.values.items() if key.startswith(f"{spare[0]}.")]
        yield file.warning("contradiction", entry, text, hint, "obstacle_layer.cpp, onInitialize", others[:1])


def _beside(file: LintedFile, held: Readers) -> Iterator[Problem]:
    """Sources that stand beside an obstacle layer of Nav2, not in it: only layers read them."""
    for costmap in held.of(COSTMAP):
        entry = costmap.values.get("observation_sources")
        layers = [one for one in held.within(costmap.scope) if one.is_a(*OBSTACLES)]
        deaf = [
            one for one in layers if f"{one.scope[-1]}.plugin" in costmap.values and not one.own("observation_sources")
        ]
        if entry is not None and deaf:
            name = deaf[0].scope[-1]
            text = f"observation_sources stands beside {name}, not in it: the layer hears no sensor."
            hint = f"Move it below {name}, and what it names as well."
            yield file.warning("cannot-work", entry, text, hint, "obstacle_layer.cpp, onInitialize")


def _drifting(file: LintedFile, held: Readers) -> Iterator[Problem]:
    """A map that is drawn into a costmap of the odometry: it is not moved to where the robot is found on it."""
    for costmap in held.of(COSTMAP):
        frame = costmap.values.get("global_frame")
        is_global = any("global_costmap" in key for key in costmap.scope)
        if frame is None or not is_global or costmap.is_on("rolling_window"):
            continue
        if str(frame.value).strip("/") == "odom" and _holds_map(file, held, costmap):
            text = (
                "global_frame is odom, and the map is drawn into it as it stands: as odometry drifts, it is elsewhere."
            )
            hint = "Set it to the frame of the map."
            yield file.warning("hinders", frame, text, hint, "static_layer.cpp, updateCosts: not rolling")


def _holds_map(file: LintedFile, held: Readers, costmap: Reader) -> bool:
    if file.format is ROS2_YAML:
        return any(layer == "StaticLayer" for _, layer in _listed(held, costmap))
    named = [class_of(kind) for keys, _, kind in file.named if keys == (*costmap.scope, "plugins")]
    return "StaticLayer" in named if named else costmap.is_on("static_map")


RULES = (_beside, _drifting, _marks, _ordered, _sourced)
