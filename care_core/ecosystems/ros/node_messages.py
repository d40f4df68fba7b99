"""What nodes said on /rosout, and what diagnostics said of the robot's parts."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator
from enum import IntEnum

from care_core.ecosystems.base import RunModel
from care_core.ecosystems.findings import Event
from care_core.ecosystems.ros.messages import DIAGNOSTICS, FAULT_EVENT, MESSAGES, ROSOUT, VIEWER_LOG, holds, type_of
from care_core.logs.base import Table
from care_core.records import Record


class Level(IntEnum):
    """How much a message of a node matters, in the codes of rosgraph_msgs/Log."""

    DEBUG = 1
    INFO = 2
    WARN = 4
    ERROR = 8
    FATAL = 16

    @property
    def word(self) -> str:
        """As a list of messages shows it."""
        return self.name if self >= Level.WARN else self.name.lower()


_ROS2 = {10: Level.DEBUG, 20: Level.INFO, 30: Level.WARN, 40: Level.ERROR, 50: Level.FATAL}
"""Levels of rcl_interfaces/Log; none of them is one of ROS 1."""
_VIEWER = {0: Level.INFO, 1: Level.DEBUG, 2: Level.INFO, 3: Level.WARN, 4: Level.ERROR, 5: Level.FATAL}
"""Levels of foxglove.Log (its schema: unknown, debug, info, warning, error, fatal)."""
ROSOUT_TOPICS = ("/rosout", "/rosout_agg")
PARTS = {0: "OK", 1: "WARN", 2: "ERROR", 3: "STALE"}
"""Levels of diagnostic_msgs/DiagnosticStatus."""

_RATES = re.compile(
    r"missed its desired rate of ([\d.]+\d) ?Hz.*current loop rate is ([\d.]+\d|inf) ?Hz", re.IGNORECASE
)
_CONTROL = re.compile(r"control loop", re.IGNORECASE)
_TOOK = re.compile(r"missed its desired rate of ([\d.]+\d) ?Hz.*loop actually took ([\d.]+\d) ?second", re.IGNORECASE)
_RATE_KEPT = 0.95
"""What Nav2 says of a loop that missed its rate, and from which share of it on it kept it."""


class LogMessage(Record):
    """A message of a node; `level` as ROS 1 has them, `Level` where it is one of those."""

    time_s: float
    level: int
    node: str
    text: str


class Report(Record):
    """What diagnostics said of a part when its level changed."""

    time_s: float
    topic: str
    name: str
    level: int
    message: str
    by: str = "diagnostics"
    """Who says so."""

    @property
    def word(self) -> str:
        return PARTS.get(self.level, str(self.level))


def level_of(code: float, type: str = "") -> int:
    """The level of ROS 1 that a code of a message of that type stands for."""
    if type in VIEWER_LOG:
        return _VIEWER.get(int(code), int(code))
    return _ROS2.get(int(code), int(code))


def level_word(level: int) -> str:
    """A level as a list of messages shows it."""
    return Level(level).word if level in Level.__members__.values() else str(level)


def kept_its_rate(text: str) -> bool:
    """Whether a message that a loop missed its rate says itself that it did not.

    Nav2 sleeps by the computer's clock and measures by the node's: in a simulation that runs ahead of real time every
    cycle is late by the one and in time by the other.
    """
    told = loop_rate(text)
    return told is not None and told[0] >= _RATE_KEPT * told[1]


def control_rate(text: str) -> tuple[float, float] | None:
    """The same of a control loop alone."""
    return loop_rate(text) if _CONTROL.search(text) else None


def loop_rate(text: str) -> tuple[float, float] | None:
    """The rate at which a loop ran and the one that it is to have, as it says itself (Nav2, move_base)."""
    found = _RATES.search(text)
    if found is not None:
        return float(found[2]), float(found[1])
    took = _TOOK.search(text)
    return (1.0 / float(took[2]), float(took[1])) if took is not None and float(took[2]) > 0 else None


def log_messages(table: Table, type: str = "") -> tuple[LogMessage, ...]:
    """The messages of one topic, in order of time. What a damaged definition reads as no text, or no level, was said by
    nobody."""
    text = next((name for name in ("msg", "message") if name in table.columns), None)
    if text is None or "level" not in table.columns:
        return ()
    nodes = table["name"].tolist() if "name" in table.columns else [""] * len(table)
    rows = zip(table.t.tolist(), table["level"].tolist(), nodes, table[text].tolist(), strict=True)
    return tuple(LogMessage(t, level_of(code, type), node, words) for t, code, node, words in rows
                 if isinstance(code, (int, float)) and math.isfinite(code)
                 and isinstance(node, str) and isinstance(words, str))  # fmt: skip


def reports(tables: Iterable[tuple[str, Table]]) -> Iterator[Report]:
    """Every change of level, the first report included, in order of time within each topic of diagnostics."""
    for topic, table in tables:
        if not holds(table, DIAGNOSTICS):
            continue
        now: dict[str, int] = {}
        columns = (table[name] for name in MESSAGES[DIAGNOSTICS].reads)
        for time_s, levels, names, messages in zip(table.t.tolist(), *columns, strict=True):
            for level, name, message in zip(levels, names, messages, strict=True):
                code = level[0] if isinstance(level, bytes) else int(level)
                if now.get(str(name)) != code:
                    now[str(name)] = code
                    yield Report(time_s, topic, str(name), code, str(message))


_SEVERITIES = {0: 0, 1: 1, 2: 2, 3: 2}
"""Severities of ros2_medkit_msgs/Fault (info, warning, error, critical) as levels of diagnostics."""
_CLEARED = "fault_cleared"


def faults(tables: Iterable[tuple[str, Table]]) -> Iterator[Report]:
    """Every fault that ros2_medkit confirmed, and its end, as a change of level."""
    for topic, table in tables:
        if not holds(table, FAULT_EVENT):
            continue
        now: dict[str, int] = {}
        columns = (table[name] for name in MESSAGES[FAULT_EVENT].reads)
        for time_s, event, code, severity, text, sources in zip(table.t.tolist(), *columns, strict=True):
            name = " of ".join([str(code), *map(str, list(sources)[:1])])
            level = 0 if event == _CLEARED else _SEVERITIES.get(int(severity), 2)
            if now.get(name) != level:
                now[name] = level
                yield Report(time_s, topic, name, level, str(text), "ros2_medkit")


def spoken(model: RunModel) -> Iterator[Event]:
    """What nodes said, with its level; of both topics of ROS 1 the one that its nodes write to."""
    present = {channel.name: type_of(channel) for channel in model.log.channels() if channel.name in ROSOUT_TOPICS}
    for topic in sorted(present)[:1]:
        fields = MESSAGES[present[topic]].reads if present[topic] in ROSOUT else ()
        table = model.tables({topic: fields}).get(topic)
        for said in log_messages(table, present[topic]) if table is not None else ():
            yield Event(said.time_s, level_word(said.level), f"{said.node}: {said.text}", topic)
