"""Loops that miss their rate, transforms that come late, sensors that the costmap waits for, a simulation that lags."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.findings import Finding, FindingKind, Severity
from care_core.ecosystems.ros import plan
from care_core.ecosystems.ros.recording import WARN, Recording, Said
from care_core.ecosystems.timeline import counted
from care_core.logs.plausible import APART, STAMP, is_simulated, kept_its_rate, stamps_pace
from care_core.numbers import median

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
    yield from _lags(recording)
    for pattern, kind, title in _FAMILIES:
        words = [one for one in recording.said if _counts(one, pattern)]
        if not words or len(words) < max(3.0, SHARE * recording.duration_s):
            continue
        at = words[0].time_s
        yield Finding(
            kind, title, at, words[-1].time_s, "info" if kind == "control" else _at_most_warning(recording, at),
            f'{len(words)} messages from {words[0].node}, first "{words[0].text[:90]}"', "/rosout", "parameter", 0.3,
        )  # fmt: skip


def _counts(one: Said, pattern: re.Pattern[str]) -> bool:
    return one.level >= WARN and pattern.search(one.text) is not None and not kept_its_rate(one.text)


def _at_most_warning(recording: Recording, at: float) -> Severity:
    return "warning" if recording.severity(at) == "critical" else "info"


def _lags(recording: Recording) -> Iterator[Finding]:
    """A clock of the robot that runs otherwise than the recorder's: a simulation that its computer cannot keep up with,
    or where both are said to be clocks of the day, one that is wrong."""
    paces, simulated = {}, []
    for topic, table in recording.of(*plan.STAMPED):
        stamp = np.asarray(table.columns.get(STAMP, ()), np.float64)
        if len(stamp) and (pace := stamps_pace(table.t, stamp)) is not None:
            paces[topic] = pace
            simulated += [topic] if is_simulated(table.t, stamp) else []
    off = {topic: pace for topic, pace in paces.items() if not 1 / APART <= pace <= APART}
    if not off:
        return
    pace = float(median(list(off.values())))
    evidence = (
        f"{counted(len(off), 'topic')} with stamps at {min(off.values()):.2f} to {max(off.values()):.2f} s a second"
        f" (limits {1 / APART:.2f} and {APART})"
    )
    if simulated:
        title = f"the robot's clock runs at {pace:.0%} of real time: a {'slow' if pace < 1 else 'fast'} simulation"
        evidence += "; what takes long or comes seldom does so for this"
    else:
        title = f"stamps of {' and '.join(sorted(off))} run at {pace:.2g} of the recording's clock: one is wrong"
    yield Finding(
        "cpu", title, 0.0, recording.duration_s, "info" if simulated else "warning", evidence,
        "header.stamp against times of recording", "world" if simulated else "operation", 0.8,
    )  # fmt: skip
