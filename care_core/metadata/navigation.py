"""Parameters of ROS navigation, by who reads them and in which distribution, from the table beside this module."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Literal, TypeGuard, get_args

from care_core.metadata.fact import Fact, FactType, lines_of, number
from care_core.metadata.words import word_of
from care_core.records import Record

Ros = Literal["ros1", "ros2"]

_TABLE = Path(__file__).with_name("navigation.tsv")
DISTRIBUTIONS: Mapping[Ros, tuple[str, ...]] = {
    "ros1": ("indigo", "kinetic", "melodic", "noetic"),
    "ros2": ("foxy", "galactic", "humble", "iron", "jazzy", "kilted", "lyrical", "rolling"),
}
"""In order of time; those between two that are named have what both have."""
STACKS: Mapping[Ros, str] = {
    "ros1": "the sources of ros-planning/navigation and teb_local_planner, indigo to noetic",
    "ros2": "the sources of ros-navigation/navigation2, foxy to rolling",
}
COSTMAPS = ("local_costmap", "global_costmap")
OBSTACLES = ("ObstacleLayer", "VoxelLayer")
"""Classes of the layers that put obstacles into a costmap; both read the same parameters."""


class Mended(Record):
    """A parameter whose right value a recording shows: a finding may ask for a change of it, and a report may make it,
    whatever profile is theirs. `restart`: it is read only while its node is configured."""

    type: FactType
    unit: str = ""
    restart: bool = False


_MENDED: Mapping[str, Mended] = {
    "default_server_timeout": Mended("int", "ms", restart=True),
    "expected_update_rate": Mended("float", "s", restart=True),
    "transform_tolerance": Mended("float", "s"),
    "use_sim_time": Mended("bool"),
}
"""By the last part of their names; `nav2_behavior_tree` and `nav2_costmap_2d` say when they are read."""
EVERY_NODE = "*"
_GENERAL = re.compile(r"(use_sim_time|qos_overrides|bond_|diagnostic_updater|start_type_description)")
_LOADING = frozenset({"plugin", "class"})
"""What names the class of a part that is loaded."""
_WORD = re.compile(r"[a-z]+")
_COMMON = frozenset({"server", "plugin", "parameters", "layer", "ros", "base"})


def mended(name: str) -> Mended | None:
    """What is known of a parameter that a recording can show the right value of; None of any other."""
    return _MENDED.get(re.split(r"[/.]", name)[-1])


def is_ros(stack: str) -> TypeGuard[Ros]:
    """Whether the parameters of a stack of software are those of ROS."""
    return stack in get_args(Ros)


def owners(ros: Ros) -> Collection[str]:
    """The nodes and plugins that the table knows."""
    return _by_owner(ros).keys()


def readers(ros: Ros, name: str) -> tuple[str, ...]:
    """Who reads a parameter of that name, in any distribution."""
    return tuple(owner for owner, facts in _by_owner(ros).items() if name in facts)


def node_of(ros: Ros, owner: str) -> str:
    """The node that a plugin is of; a node is its own."""
    return _nodes(ros).get(owner, owner)


def keys_of(ros: Ros, owner: str) -> Collection[str]:
    """The names that a node or plugin reads, in any distribution."""
    return _by_owner(ros).get(owner, {}).keys()


def known(ros: Ros, owner: str, name: str) -> tuple[Fact, ...]:
    """What the distributions say of a name that a node or plugin reads; empty where none of them reads it."""
    table = _by_owner(ros)
    general = table.get(EVERY_NODE, {}).get(name)
    if general:
        return tuple(general)
    facts = table.get(owner, {})
    first, dot, rest = name.partition(".")
    patterns = (name, f"<source>.{rest}", f"<name>.{rest}") if dot else (name,)
    found = tuple(fact for pattern in patterns for fact in facts.get(pattern, ()))
    if found or ros == "ros1":
        return found
    is_general = _GENERAL.match(first) or name.rpartition(".")[2] in _LOADING
    return (Fact(name, EVERY_NODE, "every ROS node"),) if is_general else ()


def distributions(fact: Fact, ros: Ros) -> frozenset[str]:
    """The distributions in which a fact holds."""
    return spanned(fact.releases, ros)


def spanned(releases: str, ros: Ros) -> frozenset[str]:
    """The distributions of a text such as `foxy humble-jazzy`; all of them where it is empty."""
    order = DISTRIBUTIONS[ros]
    if not releases:
        return frozenset(order)
    found: set[str] = set()
    for span in releases.split():
        first, _, last = span.partition("-")
        found |= set(order[order.index(first) : order.index(last or first) + 1])
    return frozenset(found)


def spans(names: Collection[str], ros: Ros) -> str:
    """Distributions in words: `foxy, humble to jazzy`."""
    order = DISTRIBUTIONS[ros]
    runs: list[list[str]] = []
    for place, name in enumerate(order):
        if name in names:
            if not runs or order[place - 1] not in names:
                runs.append([])
            runs[-1].append(name)
    return ", ".join(f"{run[0]} to {run[-1]}" if len(run) > 2 else ", ".join(run) for run in runs)


def fact_of(ros: Ros, parameter: str, distribution: str = "", owner: str = "") -> Fact | None:
    """What the table says of a parameter (`/move_base/DWAPlannerROS/sim_time`, `/controller_server.FollowPath.vx_max`).

    Without its owner, that must share a word with the parameter's path; where several are as near and differ, nothing
    is known. Without its distribution the newest one counts.
    """
    parts = [part for part in re.split(r"[/.]", parameter) if part]
    if not parts:
        return None
    words = _words(parts[:-1])
    named = [
        fact
        for name, facts in _by_owner(ros).items()
        if not owner or name == owner
        for key in facts
        if _is_called(key, parts)
        for fact in [_newest(facts[key], distribution, ros)]
    ]
    if owner:
        return named[0] if named else None
    scored = [(_alike(words, _words([node_of(ros, fact.owner), fact.owner])), fact) for fact in named]
    best = max((score for score, _ in scored), default=(0, 0))
    likeliest = [fact for score, fact in scored if score == best and score[0] > 0]
    return likeliest[0] if likeliest and _agree(likeliest) else None


def _newest(facts: Sequence[Fact], distribution: str, ros: Ros) -> Fact:
    own = [fact for fact in facts if distribution in distributions(fact, ros)]
    return own[-1] if own else facts[-1]


def _is_called(name: str, parts: Sequence[str]) -> bool:
    own = name.split(".")
    if own[0].startswith("<"):
        own = own[1:]
    return list(parts[-len(own) :]) == own


def _alike(words: set[str], owner: set[str]) -> tuple[int, int]:
    """How many words two have in common, then how few of the owner's are not among them."""
    return len(words & owner), -len(owner - words)


def _agree(facts: Sequence[Fact]) -> bool:
    return len({(fact.type, fact.default, fact.low, fact.high) for fact in facts}) == 1


def _words(texts: Iterable[str]) -> set[str]:
    """Words of names, CamelCase and snake_case alike."""
    split = (re.sub(r"(?<=[a-z])(?=[A-Z])", " ", text).casefold() for text in texts)
    return {word.removesuffix("s") for text in split for word in _WORD.findall(text)} - _COMMON


@cache
def _nodes(ros: Ros) -> Mapping[str, str]:
    return {row["owner"]: row["node"] for row in _table() if row["ros"] == ros}


@cache
def _by_owner(ros: Ros) -> Mapping[str, Mapping[str, list[Fact]]]:
    found: dict[str, dict[str, list[Fact]]] = {}
    for row in _table():
        if row["ros"] == ros:
            found.setdefault(row["owner"], {}).setdefault(row["name"], []).append(_fact(row, ros))
    return found


@cache
def _table() -> tuple[Mapping[str, str], ...]:
    head, *lines = lines_of(_TABLE)
    columns = head.split("\t")
    return tuple(dict(zip(columns, line.split("\t"), strict=True)) for line in lines)


def _fact(row: Mapping[str, str], ros: Ros) -> Fact:
    pairs = [pair.partition("=") for pair in row["values"].split("|") if pair]
    codes = tuple((float(code), label) for code, _, label in pairs if re.fullmatch(r"-?[\d.]+", code))
    kind: FactType = "enum" if codes else row["type"]  # type: ignore[assignment]
    stack = "the sources of ROS 1 navigation" if ros == "ros1" else "the sources of Nav2"
    order = DISTRIBUTIONS[ros]
    word = word_of("ros", row["name"], row["owner"])
    return Fact(
        row["name"],
        row["owner"],
        f"{stack}, {row['distributions'] or f'{order[0]}-{order[-1]}'}",
        kind,
        row["default"],
        number(row["low"]),
        number(row["high"]),
        codes,
        unit=word.unit,
        releases=row["distributions"],
        line=word.line,
    )
