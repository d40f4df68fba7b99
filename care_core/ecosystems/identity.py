"""Names of robots under the keys that recorders and parameters use for them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

from care_core.run import Robot
from care_core.text import clean

_NOTES = (
    "robot", "robot_name", "robot_id", "serial", "serial_number", "vehicle_id", "vehicle_name", "vin", "hostname",
    "host", "device", "device_name", "device_id", "machine",
)  # fmt: skip
"""Last words of keys under which recorders and parameters name a robot, the surest kind first."""
_NO_NAME = frozenset(("", "none", "unknown", "default", "localhost", "robot", "0"))
LONGEST = 60


def noted_robots(pairs: Iterable[tuple[str, object]], source: str) -> Iterator[Robot]:
    """Robots that keys name, the surest kind of key first; `source` says whose keys they are."""
    found: dict[str, Robot] = {}
    for key, value in pairs:
        word = re.split(r"[./]", key.casefold())[-1]
        text = clean(value.strip()) if isinstance(value, str) else ""
        if word in _NOTES and text.casefold() not in _NO_NAME and len(text) <= LONGEST:
            found.setdefault(word, Robot(text, text, f"{source}, {clean(key)}", is_sure=True))
    yield from (found[word] for word in _NOTES if word in found)
