"""Loops that miss their rate, transforms that come late, sensors that the costmap waits for, a simulation that lags."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding, FindingKind, Severity
from care_core.ecosystems.plausible import APART, STAMP, is_simulated, stamps_pace
from care_core.ecosystems.ros.drive import Drive
from care_core.ecosystems.ros.messages import GOALS, ROSOUT, STAMPED, reading
from care_core.ecosystems.ros.node_messages import Level, LogMessage, control_rate, kept_its_rate, loop_rate
from care_core.ecosystems.timeline import counted
from care_core.numbers import median
from care_core.text import log_time, shortened

LIMITS = Limits()
SHARE = LIMITS.add("messages a second", 0.1, "1/s", "loops that miss now and then are no fault")
FEWEST = LIMITS.add("messages", 3.0, "", "loops that miss now and then are no fault")
FASTEST = LIMITS.add("ratio of two clocks", APART, "", "a real clock is right to 0.01%")
SLOW = LIMITS.add("share of its rate at which a control loop runs", 0.2, "", "a choice: five steps on one command")
SLOW_SENT = LIMITS.add(
    "the same, by the commands that are recorded", 0.12, "", "a choice: recordings thinned to 2 Hz have 0.2 and more"
)
AHEAD_S = LIMITS.add(
    "stamps ahead of the recording", 1.0, "s", "Nav2 and amcl wait for a transform no longer than that"
)
EPOCH_S = LIMITS.add("stamps ahead of a recording by simulated time", 1e9, "s", "31 years: the clock of the day is not")
COMMANDS_LEAST = LIMITS.add("steps between commands", 20, "", "a choice: fewer tell of no rate")
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


def is_late(text: str) -> bool:
    """Whether a message says that something came late: this check reads it."""
    return any(pattern.search(text) for pattern, *_ in _FAMILIES)


def find(drive: Drive) -> Iterator[Finding]:
    """Clocks that run apart, and messages that loops, transforms or sensors are late."""
    yield from _lags(drive)
    yield from _ahead(drive)
    yield from _slow_control(drive)
    for pattern, kind, title in _FAMILIES:
        complaints = [message for message in drive.log_messages if _counts(message, pattern)]
        # a loop that misses its rate for a moment, as a goal begins, says so at each of its steps
        often = {int(one.time_s) for one in complaints} if pattern is _LOOPS else complaints
        if not complaints or len(often) < max(FEWEST, SHARE * drive.duration_s):
            continue
        first = complaints[0]
        yield Finding(
            kind=kind,
            title=title,
            onset_s=first.time_s,
            end_s=complaints[-1].time_s,
            severity="info" if kind == "control" else _at_most_warning(drive, first.time_s),
            evidence=_evidence(complaints),
            source="/rosout",
            suspect="parameter",
            probability=0.3,
        )


def _evidence(complaints: list[LogMessage]) -> str:
    """How many messages there are, and the lowest rate that they tell, or the first of them."""
    first = complaints[0]
    words = f"{len(complaints)} messages from {first.node}"
    rates = [told for one in complaints if (told := loop_rate(one.text)) is not None]
    if not rates:
        return f'{words}, first "{shortened(first.text, 90)}"'
    now, wanted = min(rates)
    return f"{words} of less than its rate, the lowest {now:.2g} of {wanted:g} Hz"


def _slow_control(drive: Drive) -> Iterator[Finding]:
    """A control loop at a fraction of its rate, by its own word; where no node's words are recorded, by how seldom
    commands come while it drives: a loop that is late says so, and a recording may hold one command in ten."""
    rates = [
        (one.time_s, now, wanted)
        for one in drive.log_messages
        if (told := control_rate(one.text)) is not None
        for now, wanted in [told]
    ]
    slow = [row for row in rates if row[1] < SLOW * row[2]]
    if len(slow) >= FEWEST:
        now, wanted = (float(median([row[n] for row in slow])) for n in (1, 2))
        yield _slow(drive, slow[0][0], slow[-1][0], now, wanted, f"{counted(len(slow), 'message')} of its own")
        return
    setting = next((held[0] for name, held in drive.settings.items() if name.endswith("controller_frequency")), None)
    if drive.log_messages or drive.commands is None or setting is None or not isinstance(setting.value, (int, float)):
        return
    t, goals = drive.commands.t, [(goal.sent_s, goal.end_s) for goal in drive.goals]
    steps = np.concatenate([np.empty(0), *(np.diff(t[(t >= start) & (t <= end)]) for start, end in goals)])
    if len(steps) < COMMANDS_LEAST:
        return
    now = 1.0 / max(float(median(steps)), 1e-6)
    if now < SLOW_SENT * setting.value:
        evidence = f"commands on {drive.commands.topic} while it had a goal, of {len(steps)} steps"
        yield _slow(drive, goals[0][0], goals[-1][1], now, float(setting.value), evidence)


def _slow(drive: Drive, start_s: float, end_s: float, now: float, wanted: float, evidence: str) -> Finding:
    return Finding(
        kind="control",
        title=f"the control loop runs at {now:.2g} Hz, its rate is {wanted:g} Hz",
        onset_s=start_s,
        end_s=end_s,
        severity="warning" if drive.severity(start_s) == "warning" else "critical" if drive.goals else "warning",
        evidence=f"{evidence} (limit {SLOW:.0%} of the rate); the computer is too slow for its settings",
        source="/rosout, commands, controller_frequency",
        suspect="parameter",
        probability=0.5,
    )


def _counts(message: LogMessage, pattern: re.Pattern[str]) -> bool:
    is_bad = message.level >= Level.WARN and pattern.search(message.text) is not None
    return is_bad and not kept_its_rate(message.text)


def _at_most_warning(drive: Drive, at: float) -> Severity:
    return "warning" if drive.severity(at) == "critical" else "info"


def _lags(drive: Drive) -> Iterator[Finding]:
    """A clock of the robot that runs otherwise than the recorder's: a simulation that its computer cannot keep up with,
    or where both are said to be clocks of the day, one that is wrong."""
    paces, simulated = {}, []
    for topic, table in drive.of(*STAMPED):
        stamp = np.asarray(table.columns.get(STAMP, ()), np.float64)
        if len(stamp) and (pace := stamps_pace(table.t, stamp)) is not None:
            paces[topic] = pace
            simulated += [topic] if is_simulated(table.t, stamp) else []
    off = {topic: pace for topic, pace in paces.items() if not 1 / FASTEST <= pace <= FASTEST}
    if not off:
        return
    pace = float(median(list(off.values())))
    evidence = (
        f"{counted(len(off), 'topic')} with stamps at {min(off.values()):.2f} to {max(off.values()):.2f} s a second"
        f" (limits {1 / FASTEST:.2f} and {FASTEST})"
    )
    if simulated:
        title = f"the robot's clock runs at {pace:.0%} of real time: a {'slow' if pace < 1 else 'fast'} simulation"
        evidence += "; what takes long or comes seldom does so for this"
    else:
        title = f"stamps of {' and '.join(sorted(off))} run at {pace:.2g} of the recording's clock: one is wrong"
    yield Finding(
        kind="cpu",
        title=title,
        onset_s=0.0,
        end_s=drive.duration_s,
        severity="info" if simulated else "warning",
        evidence=evidence,
        source="header.stamp against times of recording",
        suspect="world" if simulated else "operation",
        probability=0.8,
    )


def _ahead(drive: Drive) -> Iterator[Finding]:
    """Stamps of a time at which nothing of it was recorded yet: two computers whose clocks were not set alike. What is
    played again has stamps of the past."""
    ahead: dict[str, float] = {}
    for topic, table in drive.of(*STAMPED):
        by = np.asarray(table.columns.get(STAMP, ()), np.float64) - table.t if STAMP in table.columns else np.empty(0)
        known = by[np.isfinite(by)]
        if len(known) and AHEAD_S < (by_s := float(median(known))) < EPOCH_S:
            ahead[topic] = by_s
    if not ahead:
        return
    first, *others = sorted(ahead)
    more = f" and of {counted(len(others), 'more topic')}" if others else ""
    yield Finding(
        kind="cpu",
        title=f"stamps of {first}{more} are {log_time(max(ahead.values()))} ahead of the recording",
        onset_s=0.0,
        end_s=drive.duration_s,
        severity="warning",
        evidence="the clocks of two computers differ: what one stamps is of the future to the other, which finds no "
        "transform for it; let one set its clock by the other (chrony)",
        source="header.stamp against times of recording",
        suspect="operation",
        probability=0.8,
    )


READS = reading(*ROSOUT, *STAMPED, *GOALS)
CHECK = Check("timing", "clocks that run apart, loops and transforms that are late", READS, LIMITS, find)
