"""Loops that miss their rate, transforms that come late, sensors that the costmap waits for, a simulation that lags."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from care_core.health.moments import counted
from care_core.health.records import Finding, FindingKind, Severity
from care_core.health.ros import plan
from care_core.health.ros.recording import WARN, Recording
from care_core.logs.base import Table

SHARE = 0.1
"""Of the time, with a message a second counted as all of it: loops that miss now and then are no fault."""
_LOOPS = re.compile(
    r"(control|map update|planner) loop missed|missed its desired rate|behavior tree.*(tick|loop) rate", re.IGNORECASE
)
_TF = re.compile(
    r"transform timeout|could not get robot pose|unable to get starting pose|extrapolation|lookup would require"
    r"|transform data too old|lookuptransform|could not (find|get|obtain) (a |the )?(transform|connection)"
    r"|timed out waiting for transform|message filter dropping",
    re.IGNORECASE,
)
_STALE = re.compile(
    r"observation buffer has not been updated|sensor origin .* out of map|origin for the sensor"
    r"|costmap is not current|waiting for the (first )?(global |local )?costmap",
    re.IGNORECASE,
)
_FAMILIES: tuple[tuple[re.Pattern[str], FindingKind, str], ...] = (
    (_LOOPS, "control", "loops miss their rate: the computer is too slow for its settings"),
    (_TF, "tf", "transforms come late or not at all"),
    (_STALE, "planner", "the costmap does not get what it needs"),
)


SLOW, SLOW_FOR_S, SLOW_MESSAGES = 0.8, 10.0, 20
"""Of real time, over so many seconds and messages. A real clock is right to 0.01 %; Gazebo is set to 1 as shipped."""
QUARTERS, MOSTLY = 4, 0.9
"""A slow simulation is slow in each quarter of its time, and its stamps move on: a clock that was set is neither."""


def known(text: str) -> bool:
    """Whether a message is one of those that this check reads."""
    return any(pattern.search(text) for pattern, *_ in _FAMILIES)


def check(recording: Recording) -> Iterator[Finding]:
    yield from _lags(recording)
    for pattern, kind, title in _FAMILIES:
        words = [one for one in recording.said if one.level >= WARN and pattern.search(one.text)]
        if not words or len(words) < max(3.0, SHARE * recording.duration_s):
            continue
        at = words[0].time_s
        yield Finding(
            kind, title, at, words[-1].time_s, "info" if kind == "control" else _at_most_warning(recording, at),
            f'{len(words)} messages from {words[0].node}, first "{words[0].text[:90]}"', "/rosout", "parameter", 0.3,
        )  # fmt: skip


def _at_most_warning(recording: Recording, at: float) -> Severity:
    return "warning" if recording.severity(at) == "critical" else "info"


def _lags(recording: Recording) -> Iterator[Finding]:
    """A robot whose own clock runs slower than the recorder's: a simulation that its computer cannot keep up with."""
    rates = [rate for _, table in recording.of(*plan.STAMPED) if (rate := _pace(table)) is not None]
    if not rates:
        return
    pace = float(np.median(rates))
    yield Finding(
        "cpu", f"the robot's clock runs at {pace:.0%} of real time: a slow simulation", 0.0, recording.duration_s,
        "info", f"{counted(len(rates), 'topic')} with stamps at {min(rates):.2f} to {max(rates):.2f} s a second"
        f" (limit {SLOW}); what takes long or comes seldom does so for this", "header.stamp against times of recording",
        "world", 0.8,
    )  # fmt: skip


def _pace(table: Table) -> float | None:
    """Seconds of a topic's stamps for a second of recording where that is slow all the time, else None."""
    if "header.stamp" not in table.columns:
        return None
    stamp = np.asarray(table["header.stamp"], np.float64)
    told = np.isfinite(stamp)
    stamp, t = stamp[told], table.t[told]
    if len(t) < SLOW_MESSAGES or t[-1] - t[0] < SLOW_FOR_S or np.mean(np.diff(stamp) > 0) < MOSTLY:
        return None
    edges = np.searchsorted(t, np.linspace(t[0], t[-1], QUARTERS + 1)).clip(0, len(t) - 1)
    took, passed = np.diff(stamp[edges]), np.diff(t[edges])
    return float((stamp[-1] - stamp[0]) / (t[-1] - t[0])) if np.all((took > 0) & (took < SLOW * passed)) else None
