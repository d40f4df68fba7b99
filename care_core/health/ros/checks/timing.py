"""Loops that miss their rate, transforms that come late, sensors that the costmap waits for, a simulation that lags."""

from __future__ import annotations

import re
from collections.abc import Iterator

from care_core.health.records import Finding, FindingKind, Severity
from care_core.health.ros.recording import WARN, Recording

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


def known(text: str) -> bool:
    """Whether a message is one of those that this check reads."""
    return any(pattern.search(text) for pattern, *_ in _FAMILIES)


def check(recording: Recording) -> Iterator[Finding]:
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
