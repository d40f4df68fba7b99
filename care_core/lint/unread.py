"""Names that their reader does not read: what is meant by them, and who else would read them.

Nothing is proposed that is set at that place already, or that means something else by its own words.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from difflib import SequenceMatcher

from care_core.lint.problems import LintedFile, Problem
from care_core.lint.rules import LEFTOVERS, MEANT, PAIRED, PAIRED_SOURCE, Leftover, Paired
from care_core.lint.scopes import COSTMAP, Keys, Place, Scoped, class_of, split, words_of
from care_core.metadata import navigation
from care_core.metadata.navigation import DISTRIBUTIONS, STACKS

_ALIKE = 0.8
"""Least likeness of a name to the one that is meant, of difflib."""
_FEW = 3
"""A name that more plugins beside each other read is one that any has, and tells none of them."""
_CLEAR = 2
"""Most readers of another node by which a name is known to be theirs."""
_LAYERS = frozenset({"StaticLayer", "ObstacleLayer", "VoxelLayer", "InflationLayer"})
_SEARCHED = frozenset({
    "obstacle_range", "raytrace_range", "controller_frequency", "footprint", "robot_radius", "footprint_topic",
    "published_footprint_topic",
})  # fmt: skip
"""Names that ROS 1 looks for in the namespaces above the one that needs it (searchParam)."""


def unread(
    file: LintedFile, result: Scoped, place: Place, likely: frozenset[str], shown: frozenset[str]
) -> Problem | None:
    """A name that its reader reads in no release.

    Args:
        likely: the distributions that the file may be for, as far as its names tell.
        shown: those that somebody or its plugins say it is for; empty where nothing says so.
    """
    owner = place.owners[0]
    paired = next((one for one in PAIRED if one.owner == owner and place.name in (one.names, one.classes)), None)
    if paired is not None and result.ros == "ros2":
        return _paired(file, result, place, paired)
    leftover = next((one for one in LEFTOVERS if one.owner in place.owners and one.name == place.name), None)
    if leftover is not None and (leftover.reads or str(place.entry.value) == leftover.default):
        return _leftover(file, place, leftover)
    if result.ros == "ros1" and place.name in _SEARCHED:
        return None
    others = _others(result, place, likely)
    misplaced = None if (owner, place.name) in MEANT else _misplaced(file, result, place, others)
    if misplaced is not None:
        return misplaced
    meant = _meant(result, place, shown)
    first, *_, last = DISTRIBUTIONS[result.ros]
    text = f"{place.name} is not a parameter of {' or '.join(place.owners)} in any release from {first} to {last}."
    hint = f"Did you mean {meant}?" if meant else "Leave it out." if others else "Check its spelling, or leave it out."
    return file.warning("unknown-key", place.entry, text, hint, STACKS[result.ros])


def _paired(file: LintedFile, result: Scoped, place: Place, paired: Paired) -> Problem | None:
    """The lists by which eloquent loads plugins, once for both."""
    beside = {one.name: one.entry for one in result.places if one.scope == place.scope}
    held = [name for name in (paired.names, paired.classes) if name in beside]
    if place.name != held[0]:
        return None
    verb, them = ("are", "them") if held[1:] else ("is", "it")
    text = f"{' and '.join(held)} {verb} of eloquent: since foxy {paired.owner} reads {paired.now}"
    if paired.now in beside:
        text, hint = f"{text} alone.", f"Leave {them} out."
    else:
        text += ". That is missing here: the default plugins are loaded."
        hint = f"Write {paired.now} with the names, and plugin with its class below each name."
        if _have_classes(file, place.scope, words_of(beside.get(paired.names))):
            rest = f" of {paired.names}, and leave {paired.classes} out" if held[1:] else ""
            hint = f"Write {paired.now} instead{rest}."
    others = [beside[name] for name in held[1:]]
    return file.warning("renamed", place.entry, text, hint, PAIRED_SOURCE, others)


def _have_classes(file: LintedFile, scope: Keys, names: Sequence[str]) -> bool:
    """Whether each of these parts says which class it is of."""
    held = {split(entry) for entry in file.entries}
    return bool(names) and all((*scope, name, "plugin") in held for name in names)


# What is meant


def _meant(result: Scoped, place: Place, shown: frozenset[str]) -> str:
    """The name of the same reader that is spelled nearly so, empty where that is set already or nothing tells."""
    part, dot, last = place.name.rpartition(".")
    taken = {one.name for one in result.places if one.scope == place.scope}
    named = MEANT.get((place.owners[0], place.name))
    if named is not None:
        return "" if f"{part}{dot}{named}" in taken else named
    own = [
        name.rpartition(".")[2]
        for owner in place.owners
        for name in navigation.keys_of(result.ros, owner)
        if name.startswith("<") == bool(dot) and _is_read(result, owner, name, shown)
    ]
    nearest = _nearest(last, own)
    return "" if f"{part}{dot}{nearest}" in taken else nearest


def _nearest(name: str, own: Sequence[str]) -> str:
    """The one name that is spelled most alike; empty where two are, or none means the same."""
    words = {word for one in own for word in one.split("_")}
    alike = {
        one: SequenceMatcher(None, one.casefold(), name.casefold()).ratio()
        for one in own
        if not _differs(name, one, words)
    }
    most = max(alike.values(), default=0.0)
    nearest = [one for one, ratio in alike.items() if ratio == most]
    return nearest[0] if most >= _ALIKE and len(nearest) == 1 else ""


def _is_read(result: Scoped, owner: str, name: str, names: frozenset[str]) -> bool:
    """Whether one of these distributions reads a name; any, where there are none."""
    facts = navigation.known(result.ros, owner, name)
    return not names or any(navigation.distributions(fact, result.ros) & names for fact in facts)


def _differs(name: str, other: str, words: Iterable[str]) -> bool:
    """Whether two names that look alike mean two things: `min_vel` and `max_vel`, `timeout` and `first_timeout`."""
    if other.endswith(f"_{name}") or name.endswith(f"_{other}"):
        return True
    pairs = list(zip(name.split("_"), other.split("_"), strict=False))
    apart = [(one, two) for one, two in pairs if one != two]
    if name.count("_") != other.count("_") or len(apart) != 1:
        return False
    (one, two) = apart[0]
    return {one, two} <= set(words) and not one.startswith(two) and not two.startswith(one)


# Who else reads it


def _others(result: Scoped, place: Place, likely: frozenset[str]) -> list[str]:
    """Who else reads a name: those of the file's distributions, else those of any."""
    found = [one for one in navigation.readers(result.ros, place.name) if one not in place.owners]
    if result.ros == "ros1" and COSTMAP in found and set(place.owners) & _LAYERS and len(found) > 1:
        found.remove(COSTMAP)  # once layers have parts of their own, nothing hands its own values on to them
    return [one for one in found if _is_read(result, one, place.name, likely)] or found


def _misplaced(file: LintedFile, result: Scoped, place: Place, others: Sequence[str]) -> Problem | None:
    """A name that others read and that is plainly theirs."""
    text = f"{place.owners[0]} does not read {place.name}"
    if targets := _targets(result, place, others):
        text, hint = f"{text}; {', '.join(targets)} would.", "Move it there, or leave it out."
    elif owners := _of_whom(result, place, others):
        text, hint = f"{text}, which is for {', '.join(owners)}.", "Leave it out here."
    else:
        return None
    return file.warning("misplaced-key", place.entry, text, hint, STACKS[result.ros])


def _targets(result: Scoped, place: Place, others: Sequence[str]) -> list[str]:
    """Parts of this file to which a value may be moved: those that read its name and have no value of it.

    A plugin's value may be any plugin's where many of its node read the name, and another node's by chance.
    """
    beside, near = _near(result, place, others)
    is_plugin = navigation.node_of(result.ros, place.owners[0]) != place.owners[0]
    if (len(beside) > _FEW and is_plugin) or (not beside and len(others) > _CLEAR):
        return []
    lacking = [one for one in (near if beside else others) if _lacks(result, one, place.name)]
    return lacking if len(lacking) <= _CLEAR else []


def _of_whom(result: Scoped, place: Place, others: Sequence[str]) -> Sequence[str]:
    """Whose name it is, where few read it: plugins of the same node, or the one reader in files of ROS 1, which are
    loaded together."""
    beside, near = _near(result, place, others)
    owners = near or beside or (others if result.ros == "ros1" and len(others) == 1 else [])
    return owners if len(owners) <= _FEW else []


def _near(result: Scoped, place: Place, others: Sequence[str]) -> tuple[list[str], list[str]]:
    """Those that belong to the same node, and of these the ones that the file configures."""
    node = navigation.node_of(result.ros, place.owners[0])
    beside = [one for one in others if navigation.node_of(result.ros, one) == node]
    held = {owner for one in result.places for owner in one.owners}
    return beside, [one for one in beside if one in held]


def _lacks(result: Scoped, owner: str, name: str) -> bool:
    """Whether a part of the file that has this reader has no value of that name."""
    parts = [one for one in result.places if owner in one.owners]
    return bool({one.scope for one in parts} - {one.scope for one in parts if one.name == name})


def _leftover(file: LintedFile, place: Place, leftover: Leftover) -> Problem | None:
    """A name that Nav2's own files hold as well: wrong only where what counts is another value."""
    values = {split(entry): entry for entry in file.entries}
    parts = [
        keys[:-1] for keys, one in values.items() if keys[-1] == "plugin" and class_of(str(one.value)) in leftover.reads
    ]
    held = {part: str(one.value) if (one := values.get((*part, leftover.name))) else leftover.default for part in parts}
    value = str(place.entry.value)
    part, other = next(((part, one) for part, one in held.items() if one != value), ((), leftover.default))
    if value == other or (parts and not part):
        return None
    name = part[-1] if part else "a goal checker"
    text = f"{place.owners[0]} does not read {place.name}: that is for {name}, where it is {other}."
    hint = f"Write {place.name}: {value} under {name}, or leave it out."
    return file.warning("misplaced-key", place.entry, text, hint, leftover.source)
