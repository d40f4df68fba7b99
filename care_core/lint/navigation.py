"""Rules for ROS navigation: names by who reads them and in which distribution, types, ranges, contradictions."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterator, Sequence

from care_core.ecosystems.ros.ros2_yaml import PARAMETERS
from care_core.errors import UsageError, nearest
from care_core.lint import (
    choices,
    contradictions,
    foreign,
    lists,
    localization,
    misnamed,
    parsed,
    plugins,
    refused,
    slam,
    sources,
    workable,
)
from care_core.lint.problems import Entry, LintedFile, Problem, Severity
from care_core.lint.rules import RESCALED, ROS1_RENAMED, ROS2_ALONE, ROS2_NODES_RENAMED, ROS2_RENAMED, Renamed
from care_core.lint.scopes import COSTMAP, Place, Scoped, class_of, costmaps, scoped, split
from care_core.lint.unread import unread
from care_core.metadata import navigation
from care_core.metadata.fact import Fact
from care_core.metadata.navigation import DISTRIBUTIONS, STACKS

_PLACEHOLDER = re.compile(r"\$\(|\$\{|<.*>|[A-Z][A-Z0-9_]*$|.*\{.*\}")
"""A text that a launch file replaces before the node reads it."""
_ANGLE_TOLERANCE = re.compile(r"(yaw_goal_tolerance|angular_dist_threshold|rotate_to_heading_min_angle)$")
_DEAD_WITH_PLUGINS = ("map_type", "static_map")
_COPIED = {
    "StaticLayer": ("map_topic", "unknown_cost_value", "lethal_cost_threshold"),
    "VoxelLayer": ("origin_z", "z_resolution", "z_voxels", "mark_threshold", "unknown_threshold", "publish_voxel_map"),
    "InflationLayer": ("cost_scaling_factor", "inflation_radius"),
}
"""What a costmap hands on to a layer of that class from its own namespace (copyParentParameters)."""
_SHAPE = "costmap_2d_ros.cpp of Nav2, getParameters, and makeFootprintFromParams of ROS 1 ask for a footprint first"
_NAMESPACE = "costmap_2d_ros.cpp of Nav2 gives the node a namespace of its own name"
_MODES = ("modes", "__DEFAULT__")
_LOCAL = "local_costmap"
_COSTMAP_SOURCE = "costmap_2d_ros.cpp of ros-planning/navigation (noetic)"


def distribution_of(target: str, ros: str) -> str:
    """The distribution that the operator names. Raises UsageError for one that is not known."""
    names = DISTRIBUTIONS["ros2" if ros == "ros2" else "ros1"]
    if not target or target in names:
        return target
    known = [name for several in DISTRIBUTIONS.values() for name in several]
    if target in known:
        return ""
    raise UsageError(f"No tables for '{target}'.", hint=nearest(target, known), where="--target")


def check(file: LintedFile, target: str) -> Iterator[Problem]:
    """What is wrong with a file of ROS parameters."""
    result = scoped(file)
    distribution = distribution_of(target, result.ros)
    other = _no_parameters(file, result)
    if other is not None:
        yield other
        return
    told = frozenset({distribution} if distribution else ())
    shown = told or (plugins.shown(file) if result.ros == "ros2" else told)
    likely = told or _likely(result, shown)
    raised = [*(lists.raised(file, result, shown) if result.ros == "ros2" else ()), *foreign.foreign(file, result)]
    told_as_one = [place.entry for one in raised for place in one.places]
    yield from (one.problem for one in raised)
    for place in result.places:
        if not any(place.entry is entry for entry in told_as_one):
            yield from _place(file, result, place, likely, shown, is_told=bool(told))
    for entry, key in result.not_loaded:
        name = split(entry)[-2]
        if _is_spare(file, entry):
            continue
        text = f"Nothing loads {name}: no list of {key} names it."
        yield file.note("not-loaded", entry, text, f"Add it to {key}, or leave it out.")
    if result.ros == "ros2":
        yield from parsed.check(file)
        yield from _misnested(file, result)
        yield from _nodes(file, shown, is_told=bool(told))
        yield from plugins.check(file, distribution)
        yield from lists.classless(file, result, shown)
        yield from lists.by_default(file, shown)
        yield from lists.spare(file)
    yield from misnamed.check(file, result)
    yield from choices.check(file, result, likely)
    yield from sources.check(file, result, likely)
    yield from refused.check(file, result, likely)
    yield from localization.check(file)
    yield from slam.check(file)
    yield from _unused(file, result)
    yield from values(file, result)


def unknown(file: LintedFile) -> int:
    """How many values of a file are of nodes and plugins that nobody here knows: nothing is said of them."""
    judged = {id(entry) for each in localization.nodes(file) if localization.is_of_localization(each)
              for entry in each.values()}  # fmt: skip
    others = [one.entry for one in scoped(file).places if not one.owners]
    return sum(id(entry) not in judged and not slam.is_of_slam(entry) for entry in others)


def _no_parameters(file: LintedFile, result: Scoped) -> Problem | None:
    """A file of something else that names nodes of Nav2: the modes of system_modes, a launch, or values that nodes
    would read, had they the key that ROS 2 asks for."""
    modes = next((one for one in file.entries if _MODES in zip(one.keys, one.keys[1:], strict=False)), None)
    if modes is not None:
        text = "This is no parameter file: it holds the modes of nodes for system_modes, with the values of each."
        hint = "Lint the parameter files of its nodes."
        return file.note("no-parameters", modes, text, hint, "the model files of system_modes")
    named = [(one, key) for one in file.entries for key in one.keys[:-1] if key in ROS2_ALONE]
    if result.ros == "ros2" or not named:
        return None
    is_meant = any(navigation.known("ros2", key, one.keys[-1]) for one, key in named)
    first, node = named[0]
    text = f"This is no parameter file of ROS 2: it names {node}, and nothing in it stands below {PARAMETERS}."
    hint = f"A parameter file has NODE: {PARAMETERS}: NAME: VALUE."
    severity = Severity.WARNING if is_meant else Severity.NOTE
    return file.problem("no-parameters", severity, first, text, hint)


def values(file: LintedFile, result: Scoped) -> Iterator[Problem]:
    """Values that cannot be meant or cannot work, whatever the release."""
    yield from _contradictions(file, result)
    yield from workable.check(file, result)


def _likely(result: Scoped, shown: frozenset[str]) -> frozenset[str]:
    """The distributions that know most of a file's names, of those that its plugins show where they show any."""
    counts: Counter[str] = Counter()
    for place in result.places:
        for owner in place.owners:
            facts = navigation.known(result.ros, owner, place.name)
            if facts:
                counts.update({name for fact in facts for name in navigation.distributions(fact, result.ros)})
                break
    counts = Counter({name: count for name, count in counts.items() if not shown or name in shown})
    most = max(counts.values(), default=0)
    return frozenset(name for name, count in counts.items() if count == most) or shown


def _place(
    file: LintedFile, result: Scoped, place: Place, likely: frozenset[str], shown: frozenset[str], *, is_told: bool
) -> Iterator[Problem]:
    ros = result.ros
    facts = [fact for owner in place.owners for fact in navigation.known(ros, owner, place.name)]
    if not place.owners:
        return
    if not facts:
        problem = unread(file, result, place, likely, shown)
        if problem is not None:
            yield problem
        return
    now = [fact for fact in facts if navigation.distributions(fact, ros) & likely]
    lasting = not is_told and _has_lasting_name(result, place, facts)
    if not now or lasting:
        meant = frozenset(DISTRIBUTIONS[ros]) if lasting else likely
        problem = _other_distribution(file, result, place, facts, meant, is_told=is_told)
        if problem is not None:
            yield problem
    here = [fact for fact in facts if navigation.distributions(fact, ros) & shown]
    if shown and not here:
        return
    dead = _dead(result, place)
    if dead:
        yield file.warning("dead-key", place.entry, *dead, _COSTMAP_SOURCE)
        return
    yield from _value(file, place.entry, here or facts, ros)


def _is_spare(file: LintedFile, entry: Entry) -> bool:
    """Whether a layer that nothing loads is a map's in the local costmap, as Nav2's own files have it since humble."""
    keys = split(entry)
    values = {key[-1]: one.value for one in file.entries if (key := split(one))[:-1] == keys[:-1]}
    is_map = class_of(str(values.pop("plugin", ""))) == "StaticLayer"
    return is_map and _LOCAL in keys and values in ({}, {"map_subscribe_transient_local": "true"})


def _other_distribution(
    file: LintedFile,
    result: Scoped,
    place: Place,
    facts: Sequence[Fact],
    likely: frozenset[str],
    *,
    is_told: bool,
) -> Problem | None:
    """A name of other distributions than the file's; where nobody says which that is, one that has a new name."""
    severity = Severity.WARNING if is_told else Severity.NOTE
    order = DISTRIBUTIONS[result.ros]
    told = f"; the old name is not read in {next(iter(likely))}" if is_told else ""
    for one, new in _renames(result, place):
        if any(order.index(name) >= order.index(one.since) for name in likely):
            text = f"{place.name} is {new} since {one.since}{told}."
            return file.problem(
                "renamed", severity, place.entry, text, f"Write {new.rpartition('.')[2]}.", STACKS[result.ros]
            )
    if not is_told or not _is_covered(result, place.owners[0], likely):
        return None
    known = frozenset(name for fact in facts for name in navigation.distributions(fact, result.ros))
    text = (
        f"{place.owners[0]} reads {place.name} in {navigation.spans(known, result.ros)}, not in {next(iter(likely))}."
    )
    return file.problem(
        "unknown-key", severity, place.entry, text, "Is the file for this distribution?", STACKS[result.ros]
    )


def _renames(result: Scoped, place: Place) -> Iterator[tuple[Renamed, str]]:
    """The new names of an old one."""
    generic = re.sub(r"^\w+\.", "<source>.", place.name)
    for one in ROS1_RENAMED if result.ros == "ros1" else ROS2_RENAMED:
        if one.owner in place.owners and one.old in (place.name, generic):
            yield one, one.new.replace("<source>", place.name.partition(".")[0])


def _has_lasting_name(result: Scoped, place: Place, facts: Sequence[Fact]) -> bool:
    """Whether the releases that read an old name read the new one as well: it is then right whatever the file is for,
    and is told, unless the file has both."""
    ros = result.ros
    old = {name for fact in facts for name in navigation.distributions(fact, ros)}
    held = {one.name for one in result.places if one.scope == place.scope}
    return any(
        old <= {name for fact in navigation.known(ros, one.owner, new) for name in navigation.distributions(fact, ros)}
        for one, new in _renames(result, place)
        if new not in held
    )


def _is_covered(result: Scoped, owner: str, likely: frozenset[str]) -> bool:
    """Whether the table holds anything that a node or plugin reads in these distributions."""
    facts = (
        fact for name in navigation.keys_of(result.ros, owner) for fact in navigation.known(result.ros, owner, name)
    )
    return any(fact.owner == owner and navigation.distributions(fact, result.ros) & likely for fact in facts)


def _dead(result: Scoped, place: Place) -> tuple[str, str] | None:
    """A name of a ROS 1 costmap that has no effect once the file lists its layers."""
    if result.ros != "ros1" or place.owners != (COSTMAP,) or place.scope not in result.plugins:
        return None
    if place.name in _DEAD_WITH_PLUGINS:
        return f"{place.name} is not used where plugins are listed.", "Leave it out."
    classes = set(result.plugins[place.scope].values())
    for layer, names in _COPIED.items():
        if place.name in names and layer not in classes:
            return f"{place.name} is for a {layer}, and no layer here is one.", f"Add a {layer}, or leave it out."
    return None


def _value(file: LintedFile, entry: Entry, facts: Sequence[Fact], ros: str) -> Iterator[Problem]:
    """A value that no distribution the file may be for takes."""
    if isinstance(entry.value, str) and _PLACEHOLDER.match(entry.value):
        return
    if any(not fact.type for fact in facts):
        return
    fact = facts[-1]
    types: set[str] = {"int" if one.type == "enum" else one.type for one in facts}
    if entry.kind not in types and not _is_taken(entry, types, ros):
        refused = "the node will not start" if ros == "ros2" else "the default is used instead"
        text = f"{entry.keys[-1]} is {_a(entry.kind)}, declared is {_a(' or '.join(sorted(types)))}: {refused}."
        severity = Severity.ERROR if ros == "ros2" else Severity.WARNING
        hint = _rescaled(fact, entry, types) or _as_type(entry, types)
        yield file.problem("wrong-type", severity, entry, text, hint, fact.source)
        return
    number = entry.number
    if number is None:
        return
    if fact.values and not any(number == code for code, _ in fact.values):
        listed = ", ".join(f"{code:g} ({label})" for code, label in fact.values)
        text = f"{entry.keys[-1]} is {number:g}, which is none of its values."
        yield file.warning("not-in-values", entry, text, f"They are {listed}.", fact.source)
    elif all(_is_outside(number, one) for one in facts):
        text = f"{entry.keys[-1]} is {number:g}, {_bounds(fact)}: the node takes the bound."
        yield file.warning("out-of-range", entry, text, "", fact.source)
    elif _ANGLE_TOLERANCE.search(entry.keys[-1]) and math.pi < abs(number) <= 360 and number > 2 * math.pi:
        text = f"{entry.keys[-1]} is {number:g} rad, more than a whole turn."
        hint = f"Is it in degrees? {math.radians(number):.4g} rad would be."
        yield file.warning("wrong-unit", entry, text, hint, "an angle is at most 2 pi")


def _bounds(fact: Fact) -> str:
    if fact.low is not None and fact.high is not None:
        return f"outside {fact.low:g} to {fact.high:g}"
    return f"below {fact.low:g}" if fact.high is None else f"above {fact.high:g}"


def _is_outside(number: float, fact: Fact) -> bool:
    """Any negative value is as good as another where they mean "off", as a negative bound says."""
    is_off = number < 0 and fact.low is not None and fact.low < 0
    is_below = fact.low is not None and number < fact.low and not is_off
    return is_below or (fact.high is not None and number > fact.high)


def _is_taken(entry: Entry, types: set[str], ros: str) -> bool:
    """Whether the client library takes a value of that type for another."""
    if ros == "ros2":
        return entry.kind == "list" and types <= {"str", "list"}
    return (
        (entry.kind, *types) in {("int", "float"), ("float", "int")}
        or entry.kind == "list"
        or "str" in types
        or (entry.kind == "int" and "float" in types)
    )


def _a(kind: str) -> str:
    words = {"int": "an integer", "float": "a decimal number", "bool": "true or false", "str": "a string"}
    return " or ".join(words.get(one, f"a {one}") for one in kind.split(" or "))


def _as_type(entry: Entry, types: set[str]) -> str:
    number = entry.number
    if number is not None and types == {"float"}:
        return f"Write {number:g}.0."
    if number is not None and types == {"int"} and number.is_integer():
        return f"Write {number:.0f}."
    if number in (0.0, 1.0) and types == {"bool"}:
        return f"Write {'true' if number else 'false'}."
    return ""


def _rescaled(fact: Fact, entry: Entry, types: set[str]) -> str:
    """What to write for a value in the unit of another release."""
    one = next((one for one in RESCALED if (one.owner, one.name) == (fact.owner, fact.name)), None)
    number = entry.number
    if one is None or number is None or number <= 0:
        return ""
    if types == {"float"} and number >= one.between:
        return f"It is in {one.new} since {one.since}, in {one.old} before: write {float(number / one.ratio)}."
    if types == {"int"} and number < one.between:
        return f"It is in {one.old} before {one.since}, in {one.new} since: write {number * one.ratio:.0f}."
    return ""


def _misnested(file: LintedFile, result: Scoped) -> Iterator[Problem]:
    """Costmaps by the name of a node that there is not. What stands there is judged once it is read."""
    for keys, entry in result.misnested.items():
        node = (*keys, keys[-1])
        text = f"Nothing reads this part: the costmap is the node /{'/'.join(node)}, not /{'/'.join(keys)}."
        hint = f"Write {': '.join((*node, PARAMETERS))}:, each below the other. What nobody reads is not judged here."
        yield file.warning("misplaced-key", entry, text, hint, _NAMESPACE)


def _nodes(file: LintedFile, releases: frozenset[str], *, is_told: bool) -> Iterator[Problem]:
    """Nodes by a name that the file's releases do not have any more, where it has nothing by the new one; where nothing
    says which releases those are, a note.

    Args:
        releases: what somebody, or its plugins, say that the file is for.
        is_told: whether somebody says so.
    """
    order = DISTRIBUTIONS["ros2"]
    nodes: dict[str, Entry] = {}
    for entry in file.entries:
        for key in entry.keys[:-1]:
            nodes.setdefault(key, entry)
    for old, new, since, also in ROS2_NODES_RENAMED:
        newer = [order.index(one) >= order.index(since) for one in releases]
        if old not in nodes or (is_told and not all(newer)):
            continue
        text = f"The node {old} is {new} since {since}: later distributions do not read this part."
        severity = Severity.WARNING if newer and all(newer) and new not in nodes else Severity.NOTE
        yield file.problem("renamed", severity, nodes[old], text, f"Name it {new}, {also}.", STACKS["ros2"])


def _unused(file: LintedFile, result: Scoped) -> Iterator[Problem]:
    """A radius beside a footprint, which alone counts."""
    scopes = result.scopes()
    for scope in costmaps(result):
        footprint, radius = scopes.get(scope, {}).get("footprint"), scopes.get(scope, {}).get("robot_radius")
        if footprint is None or radius is None or radius.number is None:
            continue
        inner, outer = contradictions.inscribed_radius(footprint, None), contradictions.reach(footprint)
        if inner is None or outer is None:
            continue
        is_alike = inner <= radius.number <= outer
        text = f"robot_radius ({radius.number:g} m) is not used where footprint is set"
        if not is_alike:
            text += f", which reaches from {inner:.3g} to {outer:.3g} m"
        severity = Severity.NOTE if is_alike else Severity.WARNING
        hint = f"Leave one of the two out{f'; the other is in line {footprint.line}' if footprint.line else ''}."
        yield file.problem("dead-key", severity, radius, f"{text}.", hint, _SHAPE, [footprint])


def _contradictions(file: LintedFile, result: Scoped) -> Iterator[Problem]:
    scopes = result.scopes()
    for values in scopes.values():
        yield from contradictions.pairs(file, values, contradictions.ROS_PAIRS)
    for scope in costmaps(result):
        own = scopes.get(scope, {})
        radius = contradictions.inscribed_radius(own.get("footprint"), own.get("robot_radius"))
        loaded = [
            values["inflation_radius"]
            for keys, values in scopes.items()
            if "inflation_radius" in values and keys[: len(scope)] == scope and len(keys) <= len(scope) + 1
            and _inflates(result, values["inflation_radius"])
        ]  # fmt: skip
        yield from contradictions.inflation(file, radius, loaded)


def _inflates(result: Scoped, entry: Entry) -> bool:
    """Whether it is an inflation layer that reads a value."""
    return any(place.entry is entry and place.owners in (("InflationLayer",), (COSTMAP,)) for place in result.places)
