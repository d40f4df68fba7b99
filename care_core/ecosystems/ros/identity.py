"""Which robot a ROS recording is of: a parameter that names it, its name space, its model."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from care_core.ecosystems.identity import LONGEST, noted_robots
from care_core.ecosystems.ros.messages import type_of
from care_core.ecosystems.ros.namespaces import MOVES, is_software
from care_core.logs.base import Log
from care_core.run import Robot, Setting
from care_core.text import clean

_DESCRIPTION = "/robot_description"
_URDF_NAME = re.compile(r"<robot\b[^>]*?\bname\s*=\s*[\"']([^\"']+)[\"']")
_URDF_HEAD = 4000


def robots(log: Log) -> Iterator[Robot]:
    """What tells this robot from others, the surest first."""
    settings = log.settings()
    yield from noted_robots(((name, history[-1].value) for name, history in settings.items()), "parameter")
    moved = (channel.name.strip("/") for channel in log.channels() if type_of(channel) in MOVES)
    roots = {name.rpartition("/")[0].partition("/")[0] for name in moved}
    if len(roots) == 1 and (root := clean(roots.pop())) and not is_software(root):
        has_number = any(character.isdigit() for character in root)
        yield Robot(root, root, "name space of the topics", is_sure=has_number)
    yield from _described(log, settings)


def _described(log: Log, settings: Mapping[str, tuple[Setting, ...]]) -> Iterator[Robot]:
    """The model's name in the robot's description: robots of one model share it."""
    told = settings.get(_DESCRIPTION)
    texts = [] if told is None else [told[-1].value]
    table = log.read({_DESCRIPTION: ("data",)}).get(_DESCRIPTION) if not texts else None
    if table is not None and "data" in table.columns:
        texts = list(table["data"][:1])
    for text in texts:
        match = _URDF_NAME.search(str(text)[:_URDF_HEAD])
        if match:
            name = clean(match[1])[:LONGEST]
            yield Robot(name, name, "name of the model", is_sure=False)
