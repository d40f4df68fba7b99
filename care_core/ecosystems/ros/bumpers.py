"""Switches in a robot's rim: what messages of bumpers say, and from when to when they are pressed.

Each maker has a type of its own. Their fields are few: a state, a switch a side, a list of what is detected.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from care_core.logs.base import Channel, Table
from care_core.logs.ros_message import short_name
from care_core.numbers import Bools

FIELDS = (
    "data", "state", "detections.type", "is_pressed", "is_left_pressed", "is_right_pressed",
    "leftFront", "leftSide", "rightFront", "rightSide", "left_front", "left_side", "right_front", "right_side",
)  # fmt: skip
"""Of std_msgs, kobuki_msgs, irobot_create_msgs, create_msgs and the drivers of Neato: which of them a message has."""
AT_MOST = 20_000
"""Messages of a topic that are decoded: of an hour of a base that sends 60 a second, one in ten."""
_BUMP = re.compile(r"bump", re.IGNORECASE)
_PLAIN = ("std_msgs/Bool", "std_msgs/Int8MultiArray", "std_msgs/UInt8MultiArray")
"""Types of anything: the topic's name has to say what they are."""
_OF_BUMPERS = (
    "kobuki_msgs/BumperEvent", "kobuki_ros_interfaces/BumperEvent", "neato_node/Bump", "neato2_interfaces/Bump",
    "create_msgs/Bumper", "ca_msgs/Bumper",
)  # fmt: skip
_HAZARDS, _IS_BUMP = "irobot_create_msgs/HazardDetectionVector", 1
_MOSTLY = 0.9
"""A switch that is pressed for this share of its messages is wired the other way, or stuck: it tells of nothing."""
_SAME_S = 0.5
"""What comes so close together is one contact."""


def is_bumper(channel: Channel) -> bool:
    """Whether a topic tells of bumpers."""
    type = short_name(channel.type)
    if type in _PLAIN:
        return bool(_BUMP.search(channel.name))
    return type == _HAZARDS or type in _OF_BUMPERS


def contacts(table: Table, end_s: float) -> Iterator[tuple[float, float]]:
    """From when to when bumpers are pressed; one that is not let go is pressed to the end of the recording."""
    pressed = _pressed(table)
    if not len(pressed) or pressed.mean() > _MOSTLY:
        return
    begins = np.flatnonzero(np.diff(pressed.astype(int), prepend=0) > 0)
    ends = np.flatnonzero(np.diff(pressed.astype(int), append=0) < 0) + 1
    times = [*table.t.tolist(), end_s]
    last: tuple[float, float] | None = None
    for begin, end in zip(begins.tolist(), ends.tolist(), strict=True):
        span = times[begin], times[end]
        if last is not None and span[0] - last[1] <= _SAME_S:
            last = last[0], span[1]
            continue
        if last is not None:
            yield last
        last = span
    if last is not None:
        yield last


def _pressed(table: Table) -> Bools:
    """Per message whether any switch of it is pressed."""
    pressed = np.zeros(len(table), bool)
    for name in FIELDS:
        if name in table.columns:
            wanted = _IS_BUMP if name == "detections.type" else None
            pressed |= np.array([_says(value, wanted) for value in table[name].tolist()], bool)
    return pressed


def _says(value: object, wanted: int | None) -> bool:
    """Whether a value, or any of a list, is the wanted one; where none is wanted, is not 0."""
    values = list(value) if isinstance(value, (list, tuple, np.ndarray)) else [value]
    known = [one for one in values if isinstance(one, (bool, int, float, np.number)) and one == one]
    return any(one == wanted if wanted is not None else bool(one) for one in known)
