"""Which robot a log is of, as the log itself says it: the one place where that is decided.

What a recorder noted and what names one device (the serial of the board) come before what people set (a system id, a
name space), for that is often left as it was delivered. Where nothing names a robot, none is guessed.
"""

from __future__ import annotations

from collections.abc import Iterator

from care_core.ecosystems.identity import noted_robots
from care_core.ecosystems.registry import ecosystem_of
from care_core.logs.base import Log
from care_core.run import Robot
from care_core.text import clean


def identify(log: Log) -> Robot | None:
    """The robot of a log, by the best that the log says of it; None where it says nothing."""
    return next(_names(log), None)


def named(name: str) -> Robot:
    """The robot that the operator names."""
    return Robot(clean(name.strip()), clean(name.strip()), "named by the operator", is_sure=True)


def _names(log: Log) -> Iterator[Robot]:
    yield from noted_robots(log.facts.items(), "what the recorder noted")
    yield from ecosystem_of(log.format).robots(log)
