"""Parameters that a node only spoke of: their values stand in a message, not in the configuration as driven."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence

from care_core.ecosystems.ros.node_messages import ROSOUT_TOPICS
from care_core.scaffold.inputs import InputLog

_VALUE = r"(-?\d[\d.eE+-]*|true|false)"
_MENTIONED = (
    re.compile(rf"(?<!\S)(/[A-Za-z]\w*(?:/\w+)+)\s*[:=]\s*{_VALUE}\b", re.IGNORECASE),
    re.compile(rf"\bparam(?:eter)?\s+['\"]?([\w/.~]+)['\"]?\s*(?:[:=]|to|is)\s*{_VALUE}\b", re.IGNORECASE),
)
"""`/node/name: value`, as roslaunch and loggers of parameters print it; `parameter name set to value`."""
_SET_TO = re.compile(r"\b(?:set|changed)\s+to\b", re.IGNORECASE)


def mentioned_parameters(logs: Sequence[InputLog], held: Collection[str]) -> list[str]:
    """`name (value)` of each parameter that messages name and the configuration as driven does not hold."""
    found: dict[str, str] = {}
    for log in logs:
        wanted = {topic: ("msg",) for topic in ROSOUT_TOPICS if topic in log.channels}
        for table in log.opened.read(wanted).values() if wanted else ():
            for text in map(str, table.columns.get("msg", ())):
                for pattern in _MENTIONED:
                    found.update(pattern.findall(_SET_TO.sub("to", text)))
    return [f"{name} ({value})" for name, value in sorted(found.items()) if name not in held]
