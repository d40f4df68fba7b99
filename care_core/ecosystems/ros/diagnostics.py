"""Reports of diagnostic_msgs/DiagnosticArray, changes of level only."""

from __future__ import annotations

from collections.abc import Iterator

from care_core.ecosystems.ros import plan
from care_core.ecosystems.ros.recording import Recording
from care_core.records import Record

WORDS = {0: "OK", 1: "WARN", 2: "ERROR", 3: "STALE"}
"""Levels of diagnostic_msgs/DiagnosticStatus."""


class Report(Record):
    """What diagnostics said of a part when its level changed."""

    time_s: float
    topic: str
    name: str
    level: int
    message: str

    @property
    def word(self) -> str:
        return WORDS.get(self.level, str(self.level))


def reports(recording: Recording) -> Iterator[Report]:
    """Every change of level, the first report included, in order of time within each topic."""
    for topic, table in recording.of(plan.DIAGNOSTICS):
        if not set(plan.FIELDS[plan.DIAGNOSTICS]) <= set(table.columns):
            continue
        now: dict[str, int] = {}
        for time_s, levels, names, messages in zip(
            table.t.tolist(), *(table[name] for name in plan.FIELDS[plan.DIAGNOSTICS]), strict=True
        ):
            for level, name, message in zip(levels, names, messages, strict=True):
                code = level[0] if isinstance(level, bytes) else int(level)
                if now.get(str(name)) != code:
                    now[str(name)] = code
                    yield Report(time_s, topic, str(name), code, str(message))
