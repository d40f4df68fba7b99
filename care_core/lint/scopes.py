"""Who reads which part of a ROS configuration: nodes by name, plugins by the lists and classes that load them."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from care_core.ecosystems.ros.dialect import ROS1_YAML, ROS2_YAML
from care_core.ecosystems.ros.ros2_yaml import PARAMETERS
from care_core.lint.problems import Entry, LintedFile
from care_core.metadata import navigation
from care_core.metadata.navigation import COSTMAPS, OBSTACLES, Ros
from care_core.records import Struct, field
from care_core.run import Setting

Keys = tuple[str, ...]

COSTMAP = "costmap"
_LAYERS_BY_NAME = {
    "static_layer": ("StaticLayer",), "inflation_layer": ("InflationLayer",), "obstacle_layer": OBSTACLES,
}  # fmt: skip
"""Names that the costmap itself gives layers (costmap_2d_ros.cpp, loadOldParameters)."""
_CLASS = re.compile(r"[A-Z]\w*(?:ROS|Planner|Controller)")
_NODES = frozenset({COSTMAP, "move_base", "amcl", "map_server"})
_OPEN = frozenset({"bt_navigator"})
"""Nodes that let any plugin of theirs read parameters."""
_MOST, _LEAST = 0.7, 2
"""A part whose reader nobody names is taken for whoever knows this share of its names, and at least so many."""
_SUB_OWNERS = {
    "collision_monitor": (("polygons", "Polygon"), ("observation_sources", "Source")),
    "collision_detector": (("polygons", "Polygon"), ("observation_sources", "Source")),
    "docking_server": (("docks", "Dock"),),
    "MPPIController": (("critics", ""),),
}
"""Lists of a node or plugin that name its parts, and who reads these; "": a part of that very name."""
_OWN_PARTS = frozenset({"smoother", "optimizer", "controller"})
"""Parts of a plugin whose names its source declares without them."""
_TOGETHER = {"RotationShimController": "primary_controller"}
"""A plugin that hands its own parameters on to another, and the key that names that one."""


class Place(Struct, eq=False):
    """A value with who reads it: `owners` is empty where nobody knows."""

    entry: Entry
    owners: tuple[str, ...]
    name: str
    """As the owner calls it: with dots, without the parts that lead to it."""
    scope: Keys
    """The keys that lead to the owner."""


class Scoped(Struct, eq=False):
    """A file's values with their readers, and the parts that nothing loads."""

    ros: Ros
    places: list[Place] = field(default_factory=list)
    not_loaded: list[tuple[Entry, str]] = field(default_factory=list)
    """The first value of a part, and the list that would have to name it."""
    plugins: dict[Keys, dict[str, str]] = field(default_factory=dict)
    """By the keys of a costmap (ROS 1): its layers by name, with their class."""
    misnested: dict[Keys, Entry] = field(default_factory=dict)
    """By the keys of a costmap's node (ROS 2) that stands elsewhere than the costmap does: the first of its values."""

    def scopes(self) -> Mapping[Keys, dict[str, Entry]]:
        """The values of each part by their last key."""
        found: dict[Keys, dict[str, Entry]] = {}
        for place in self.places:
            keys = split(place.entry)
            found.setdefault(keys[:-1], {})[keys[-1]] = place.entry
        return found


def split(entry: Entry) -> Keys:
    """Keys with those that stand together, `RotateToGoal.scale`, apart."""
    return tuple(part for key in entry.keys for part in key.split(".") if part)


def class_of(text: str) -> str:
    """The name of a plugin's class without its package."""
    return re.split(r"::|/", text)[-1]


def as_file(parameters: Mapping[str, Setting], path: Path, *, is_ros2: bool) -> LintedFile:
    """The parameters of a run as a file of them, in their order; a value of the log has no line."""
    entries = []
    for name, one in parameters.items():
        node, _, own = name.partition(".")
        keys = tuple(part for part in (node if is_ros2 else name).split("/") if part)
        if is_ros2:
            keys = (*keys, PARAMETERS, *own.split("."))
        line = one.source.rpartition(":")[2]
        entries.append(Entry(keys, one.value, int(line) if line.isdigit() else 0, 1, _kind(one.value)))
    return LintedFile(path, ROS2_YAML if is_ros2 else ROS1_YAML, "", tuple(entries))


def _kind(value: float | str) -> str:
    if isinstance(value, str):
        return "bool" if value in ("true", "false") else "list" if value.startswith("[") else "str"
    return "int" if isinstance(value, int) else "float"


def scoped(file: LintedFile) -> Scoped:
    """Who reads what of a ROS file."""
    return _ros2(file) if file.format is ROS2_YAML else _ros1(file)


def words_of(entry: Entry | None) -> tuple[str, ...]:
    """A list of names, as YAML or as words in one text."""
    if entry is None or not isinstance(entry.value, str):
        return ()
    return tuple(re.findall(r"[\w.]+", entry.value))


# ROS 2


def _ros2(file: LintedFile) -> Scoped:
    result = Scoped("ros2")
    values = {split(entry): entry for entry in file.entries}
    unloaded: set[Keys] = set()
    for keys, entry in values.items():
        if PARAMETERS not in keys[1:-1]:
            result.places.append(Place(entry, (), entry.name, ()))
            continue
        at = keys.index(PARAMETERS)
        node = keys[at - 1]
        owner = COSTMAP if node in COSTMAPS else node if node in navigation.owners("ros2") else ""
        if owner == COSTMAP and not _is_costmap(file, keys[:at]):
            result.misnested.setdefault(keys[:at], entry)
            owner = ""
        owners = () if not owner or "*" in node else (owner,)
        place = _descend(entry, keys, at + 1, owners, values)
        result.places.append(place)
        part = _unloaded(keys, at + 1, owners, values)
        if part and part not in unloaded:
            unloaded.add(part)
            result.not_loaded.append((entry, "plugins"))
    return result


def _is_costmap(file: LintedFile, node: Keys) -> bool:
    """Whether a costmap has that name: it stands in a namespace of its own name. A pattern may mean any."""
    name = (*(part for part in file.namespace.split("/") if part), *node)
    return any("*" in part for part in name) or name[-2:-1] == name[-1:]


def _descend(entry: Entry, keys: Keys, at: int, owners: Keys, values: Mapping[Keys, Entry]) -> Place:
    """Follow the keys from a node down to whoever reads the value."""
    while owners:
        name = ".".join(keys[at:])
        is_open = any(owner in _OPEN for owner in owners)
        if any(navigation.known("ros2", owner, name) for owner in owners):
            return Place(entry, owners, name, keys[:at])
        if len(keys) - at == 1:
            return Place(entry, () if is_open else owners, name, keys[:at])
        deeper = _part(keys, at, owners, values)
        if deeper is None:
            return Place(entry, (), name, keys[:at])
        owners, at = deeper, at + 1
    return Place(entry, (), ".".join(keys[at:]), keys[:at])


def _part(keys: Keys, at: int, owners: Keys, values: Mapping[Keys, Entry]) -> Keys | None:
    """Who reads the part of that name; None where nobody knows."""
    part, here = keys[at], keys[:at]
    plugin = values.get((*here, part, "plugin"))
    if plugin is not None:
        return of_class(plugin, values, (*here, part))
    for owner in owners:
        for key, reader in _SUB_OWNERS.get(owner, ()):
            if part in words_of(values.get((*here, key))):
                named = reader or (part if part in navigation.owners("ros2") else "")
                return (named,) if named else None
        if part in _OWN_PARTS:
            return owners
        if owner == "behavior_server" and part in words_of(values.get((*here, "behavior_plugins"))):
            return owners
        if owner == "MPPIController" and part in navigation.owners("ros2"):
            return (part,)
    return None


def of_class(plugin: Entry, values: Mapping[Keys, Entry], here: Keys) -> Keys | None:
    """Who reads the part of a plugin by its class; None where nobody knows."""
    name = class_of(str(plugin.value))
    if "nav2_behaviors" in str(plugin.value) or "nav2_recoveries" in str(plugin.value):
        return ("behavior_server",)
    if name not in navigation.owners("ros2"):
        return None
    other = values.get((*here, _TOGETHER.get(name, "")))
    if name not in _TOGETHER:
        return (name,)
    handed = class_of(str(other.value)) if other is not None else ""
    return (name, handed) if handed in navigation.owners("ros2") else None


def _unloaded(keys: Keys, at: int, owners: Keys, values: Mapping[Keys, Entry]) -> Keys | None:
    """The keys of a costmap's layer that its list of plugins or filters leaves out."""
    if owners != (COSTMAP,) or len(keys) - at < 2 or (*keys[: at + 1], "plugin") not in values:
        return None
    lists = [values[key] for name in ("plugins", "filters") if (key := (*keys[:at], name)) in values]
    named = {word for one in lists for word in words_of(one)}
    return keys[: at + 1] if lists and named and keys[at] not in named else None


# ROS 1


def _ros1(file: LintedFile) -> Scoped:
    result = Scoped("ros1")
    values = {entry.keys: entry for entry in file.entries}
    parts: dict[Keys, list[Entry]] = {}
    for entry in file.entries:
        parts.setdefault(entry.keys[:-1], []).append(entry)
    for keys, name, kind in file.named:
        if keys[-1] == "plugins":
            result.plugins.setdefault(keys[:-1], {})[name] = class_of(kind)
    everywhere = set(parts) | {key[:depth] for key in parts for depth in range(len(key))} | set(result.plugins)
    owners: dict[Keys, Keys] = {}
    for keys in sorted(everywhere, key=len):
        is_foreign = any(_is_foreign(key) for key in keys)
        owners[keys] = () if is_foreign else _reader(file, keys, owners, parts, result.plugins)
    for keys, entries in parts.items():
        for entry in entries:
            result.places.append(_ros1_place(entry, keys, owners, values))
        layers = result.plugins.get(keys[:-1]) if keys else None
        if layers and owners.get(keys[:-1]) == (COSTMAP,) and keys[-1] not in layers and _is_layer(entries):
            result.not_loaded.append((entries[0], "plugins"))
    return result


def _is_layer(entries: Sequence[Entry]) -> bool:
    names = {entry.keys[-1] for entry in entries}
    return any(
        names <= set(navigation.keys_of("ros1", owner)) for owner in ("StaticLayer", "InflationLayer", "VoxelLayer")
    )


def _reader(
    file: LintedFile,
    keys: Keys,
    owners: Mapping[Keys, Keys],
    parts: Mapping[Keys, list[Entry]],
    plugins: Mapping[Keys, Mapping[str, str]],
) -> Keys:
    """Who reads a namespace: by its name, by the list that loads it, or by what is in it."""
    name = keys[-1] if keys else file.namespace.strip("/").rpartition("/")[2]
    if name in COSTMAPS:
        return (COSTMAP,)
    if name in navigation.owners("ros1"):
        return (name,)
    layers = plugins.get(keys[:-1], {}) if keys else {}
    if name in layers:
        return (layers[name],) if layers[name] in navigation.owners("ros1") else ()
    above = owners.get(keys[:-1], ()) if keys else ()
    if keys and above == (COSTMAP,) and name in _LAYERS_BY_NAME:
        return _LAYERS_BY_NAME[name]
    if keys and above and above != (COSTMAP,):
        return ()  # a part of a plugin, such as a source of observations: its own names hold the dots
    if not keys and keys in plugins:
        return (COSTMAP,)
    below = {key[len(keys)] for key in parts if len(key) > len(keys) and key[: len(keys)] == keys}
    if not keys and below & {"DWAPlannerROS", "TrajectoryPlannerROS", "TebLocalPlannerROS", *COSTMAPS}:
        return _of_part([entry.keys[-1] for entry in parts.get(keys, ())]) or ("move_base",)
    return _by_names([entry.keys[-1] for entry in parts.get(keys, ())], is_inside=bool(keys))


def _is_foreign(name: str) -> bool:
    """Whether it is a planner or controller that no table knows, by how their classes are named: what stands below is
    its own, whoever has parameters of the same names."""
    return bool(_CLASS.fullmatch(name)) and name not in navigation.owners("ros1")


def _of_part(names: Sequence[str]) -> Keys:
    """The plugin whose file it is, loaded into its namespace by a launch: it knows all of these names, and move_base
    none."""
    if any(navigation.known("ros1", "move_base", name) for name in names):
        return ()
    found = _by_names(names, is_inside=True)
    return found if all(navigation.known("ros1", owner, name) for owner in found for name in names) else ()


def _by_names(names: Sequence[str], *, is_inside: bool) -> Keys:
    """Whoever knows most of these names, where that is most of them and one alone knows so many.

    Args:
        is_inside: whether the names stand under another, where no node has its own.
    """
    candidates = [owner for owner in navigation.owners("ros1") if not (is_inside and owner in _NODES)]
    counts = {owner: sum(bool(navigation.known("ros1", owner, name)) for name in names) for owner in candidates}
    most = max(counts.values(), default=0)
    best = [owner for owner, count in counts.items() if count == most]
    if most < _LEAST or most < _MOST * len(names):
        return ()
    if set(best) <= {"ObstacleLayer", "VoxelLayer"}:
        return tuple(best)
    return (best[0],) if len(best) == 1 else ()


def _ros1_place(entry: Entry, keys: Keys, owners: Mapping[Keys, Keys], values: Mapping[Keys, Entry]) -> Place:
    """The nearest namespace with a reader, and the name that this one has for the value.

    A source that a costmap itself names is moved to its obstacle layer (costmap_2d_ros.cpp of noetic,
    loadOldParameters): files from before Hydro list no layers.
    """
    for depth in range(len(keys), -1, -1):
        found = owners.get(keys[:depth], ())
        if not found:
            continue
        name = ".".join(entry.keys[depth:])
        if depth == len(keys) or any(navigation.known("ros1", owner, name) for owner in found):
            return Place(entry, found, name, keys[:depth])
        sources = words_of(values.get((*keys[:depth], "observation_sources")))
        if len(keys) - depth == 1 and keys[depth] in sources:
            return Place(entry, _LAYERS_BY_NAME["obstacle_layer"] if found == (COSTMAP,) else found, name, keys[:depth])
        break
    return Place(entry, (), entry.keys[-1], keys)


def costmaps(result: Scoped) -> Iterator[Keys]:
    """The keys of each costmap of a file."""
    yield from dict.fromkeys(place.scope for place in result.places if place.owners == (COSTMAP,))
