"""Which name spaces of a recording are robots of their own: robots recorded into one file are told apart by them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import combinations

from care_core.ecosystems.ros.messages import ACTION_GOAL, ODOMETRY, STATUS, TWIST, TWIST_STAMPED, type_of
from care_core.logs.base import Channel

MOVES = (ODOMETRY, TWIST, TWIST_STAMPED)
_MOVING = frozenset((*MOVES, STATUS, ACTION_GOAL))
"""What a robot has that moves: a camera or a driver with two topics of its own is none."""
_NO_ROBOT = ("controller", "server", "base", "filter", "mux", "smoother", "gazebo", "truth", "test")
"""How name spaces of software end."""
_FEWEST = 2
"""Topics that two robots have both, at least one of which says that they move."""


def is_software(namespace: str) -> bool:
    """Whether a name space is that of a program, by its name."""
    return namespace.rpartition("/")[2].endswith(_NO_ROBOT)


def robot_namespaces(channels: Iterable[Channel]) -> tuple[str, ...]:
    """The name spaces ("" is the one without) of robots that have the same topics; none where there is one robot."""
    names: dict[str, list[list[str]]] = {}
    for channel in channels:
        if channel.count:
            names.setdefault(type_of(channel), []).append(channel.name.split("/")[1:])
    shared: dict[tuple[str, str], set[str]] = {}
    for type, several in names.items():
        for one, other in combinations(sorted(several), 2):
            pair = _spaces(one, other)
            if pair is not None and not any(map(is_software, pair)):
                shared.setdefault(pair, set()).add(type if type in _MOVING else "/".join((type, *one)))
    pairs = (pair for pair, kinds in shared.items() if len(kinds) >= _FEWEST and kinds & _MOVING)
    return tuple(sorted({space for pair in pairs for space in pair}))


def is_of(topic: str, namespace: str, robots: Sequence[str]) -> bool:
    """Whether a topic is this robot's. What is in no robot's name space is of the robot that has none, else of all."""
    owner = max((space for space in robots if space and topic.startswith(f"{space}/")), key=len, default="")
    return owner == namespace or (not owner and "" not in robots)


def _spaces(one: list[str], other: list[str]) -> tuple[str, str] | None:
    """The name spaces in which two topics are the same: `/odom` and `/r2/odom` are in "" and /r2."""
    if abs(len(one) - len(other)) == 1:
        short, long = sorted((one, other), key=len)
        return ("", f"/{long[0]}") if long[1:] == short else None
    if len(one) != len(other):
        return None
    differ = [at for at, (a, b) in enumerate(zip(one, other, strict=True)) if a != b]
    if len(differ) != 1 or differ[0] == len(one) - 1:
        return None
    first, second = ("/" + "/".join(names[: differ[0] + 1]) for names in (one, other))
    return first, second
