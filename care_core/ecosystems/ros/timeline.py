"""What happened in a ROS recording, in order of time: goals, recoveries, what nodes said, topics, parameters, motion.

Repeats are one line with their count, so that the whole is read in a minute.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise

import numpy as np

from care_core.ecosystems.findings import Event
from care_core.ecosystems.ros import plan
from care_core.ecosystems.ros.diagnostics import reports
from care_core.ecosystems.ros.recording import ERROR, FATAL, WARN, Floats, Recording
from care_core.ecosystems.ros.silence import ends_early
from care_core.logs.ros_message import short_name
from care_core.numbers import quantile

GOALS, MESSAGES, DIAGNOSTICS, CHANGES = 12, 14, 6, 5
"""Lines of each sort at most."""
PAUSE_S, PAUSE_PERIODS = 3.0, 10.0
"""A stream that pauses so long, and so many of its periods, is told of."""
SLOWER, SLOWER_S = 0.5, 10.0
"""A stream whose rate falls below this share of what it was, for so long, is told of."""
_TEXT = 110
_URGENT = {2: 0, 3: 1, 1: 2}
"""An error of diagnostics comes before silence, and that before a warning."""
_LEVELS = {WARN: "WARN", ERROR: "ERROR", FATAL: "FATAL"}
_NUMBER = re.compile(r"-?\d+(\.\d+)?(e-?\d+)?")
_QUIET_TYPES = (
    "rcl_interfaces/ParameterEvent",
    "rosbag2_interfaces/ReadSplitEvent",
    "rosbag2_interfaces/WriteSplitEvent",
    "bond/Status",
    *plan.ROSOUT,
)
"""Types whose channels are empty, or stop, without anything being wrong."""
_REPAIRS = ("spin", "backup", "wait", "driveonheading", "assistedteleop", "clear")
"""How the names of Nav2's tree nodes that repair something begin."""


def timeline(recording: Recording) -> tuple[Event, ...]:
    """The moments of a recording, in order of time."""
    found = [
        *_recorded(recording),
        *_damage(recording),
        *_goals(recording),
        *_recoveries(recording),
        *_said(recording),
        *_diagnostics(recording),
        *_pauses(recording),
        *_lifecycle(recording),
        *_changes(recording),
        *_motion(recording),
    ]
    return tuple(sorted(found, key=lambda one: one.time_s))


def _recorded(recording: Recording) -> Iterator[Event]:
    count = sum(len(times) for times in recording.times.values())
    if not count:
        yield Event(0.0, "error", "nothing was recorded: there is no message in it", "recording")
        return
    words = f"{recording.duration_s:.0f} s of {len([1 for times in recording.times.values() if len(times)])} topics"
    yield Event(0.0, "recording", f"the recording begins: {words}", "recording")
    empty = [one.name for one in recording.channels if not one.count and short_name(one.type) not in _QUIET_TYPES]
    if empty:
        yield Event(0.0, "topic", f"no message on {_listed(empty)}", "recording")


def _damage(recording: Recording) -> Iterator[Event]:
    for one in recording.damage:
        yield Event(one.time_s if one.time_s is not None else 0.0, "damage", one.what, "recording")


def _goals(recording: Recording) -> Iterator[Event]:
    goals = recording.goals
    shown = goals if len(goals) <= GOALS else [goal for goal in goals if goal.outcome != "reached"][:GOALS]
    for number, goal in enumerate(goals, start=1):
        if goal not in shown:
            continue
        place = "" if math.isnan(goal.x) else f" at ({goal.x:.1f}, {goal.y:.1f})"
        took = f"after {goal.end_s - goal.sent_s:.0f} s"
        said = f": {goal.text[:_TEXT]}" if goal.text and goal.failed else ""
        what = f"{goal.outcome} {took}{said}" if goal.outcome else f"still open {took}, when the recording ends"
        yield Event(goal.end_s, "goal", f"goal {number}{place}, sent at {goal.sent_s:.1f} s, {what}", goal.action)
    if len(shown) < len(goals):
        reached = sum(goal.outcome == "reached" for goal in goals)
        yield Event(goals[0].sent_s, "goal", f"{len(goals)} goals, {reached} reached", goals[0].action)


def _recoveries(recording: Recording) -> Iterator[Event]:
    ran = []
    for topic, table in recording.of(plan.RECOVERY):
        if set(plan.FIELDS[plan.RECOVERY]) <= set(table.columns):
            ran += [
                (t, str(name), topic) for t, name in zip(table.t.tolist(), table["recovery_behavior_name"], strict=True)
            ]
    for topic, table in recording.of(plan.TREE):
        if not set(plan.FIELDS[plan.TREE]) <= set(table.columns):
            continue
        for t, *lists in zip(table.t.tolist(), *(table[name] for name in plan.FIELDS[plan.TREE]), strict=True):
            for name, before, _ in zip(*lists, strict=True):
                if str(before).upper() == "IDLE" and str(name).replace("_", "").casefold().startswith(_REPAIRS):
                    ran.append((t, str(name), topic))
    for name in dict.fromkeys(name for _, name, _ in ran):
        own = [one for one in ran if one[1] == name]
        yield Event(own[0][0], "recovery", f"recovery {name}{_times(len(own), own[-1][0])}", own[0][2])


def _said(recording: Recording) -> Iterator[Event]:
    kinds: dict[tuple[str, str], list[int]] = {}
    for row, one in enumerate(recording.said):
        if one.level >= WARN:
            kinds.setdefault((one.node, _NUMBER.sub("#", one.text)), []).append(row)
    said = recording.said
    ranked = sorted(kinds.values(), key=lambda rows: (-said[rows[0]].level, rows[0]))
    for rows in ranked[:MESSAGES]:
        first = said[rows[0]]
        level = _LEVELS.get(first.level, str(first.level))
        text = f"{level} {first.node}: {_cut(first.text)}{_times(len(rows), said[rows[-1]].time_s)}"
        yield Event(first.time_s, "error" if first.level >= ERROR else "message", text, "/rosout")
    if len(ranked) > MESSAGES:
        left = ranked[MESSAGES:]
        words = f"{len(left)} more kinds of message, {sum(len(rows) for rows in left)} messages"
        yield Event(said[left[0][0]].time_s, "message", words, "/rosout")


def _diagnostics(recording: Recording) -> Iterator[Event]:
    bad = [one for one in reports(recording) if one.level > 0]
    worst: dict[str, Event] = {}
    for one in sorted(bad, key=lambda one: (_URGENT.get(one.level, 3), one.time_s)):
        said = f': "{_cut(one.message)}"' if one.message else ""
        kind = "error" if one.level == 2 else "diagnostics"
        worst.setdefault(one.name, Event(one.time_s, kind, f"diagnostics {one.word} {one.name}{said}", one.topic))
    yield from list(worst.values())[:DIAGNOSTICS]


def _pauses(recording: Recording) -> Iterator[Event]:
    """Streams that pause, end early, or become slower; those that do so together in one line."""
    paused: dict[tuple[int, int], list[str]] = {}
    for channel in recording.channels:
        if channel.name not in recording.streams or short_name(channel.type) in _QUIET_TYPES:
            continue
        times = recording.times[channel.name]
        pauses = np.diff(times)
        usual = recording.streams[channel.name]
        row = int(np.argmax(pauses))
        over = ends_early(recording, channel.name)
        if over is not None:
            yield Event(over[0], "topic", f"{channel.name} ends; {1 / usual:.3g} Hz before", channel.name)
        if pauses[row] >= max(PAUSE_S, PAUSE_PERIODS * usual):
            paused.setdefault((round(times[row] / 2), round(times[row + 1] / 2)), []).append(channel.name)
        else:
            yield from _slower(channel.name, times, usual)
    for names in paused.values():
        first = recording.times[names[0]]
        row = int(np.argmax(np.diff(first)))
        words = f"{_listed(names)} {'pause' if len(names) > 1 else 'pauses'} for {first[row + 1] - first[row]:.1f} s"
        yield Event(float(first[row]), "topic", words, names[0])


def _slower(topic: str, times: Floats, usual: float) -> Iterator[Event]:
    """Where the rate falls to less than half, for good or for a while."""
    window = max(int(SLOWER_S / usual), 10)
    if len(times) < 3 * window:
        return
    took = times[window:] - times[:-window]
    slow = np.flatnonzero(took > SLOWER_S / SLOWER)
    slow = slow[took[slow] > window * usual / SLOWER]
    if len(slow):
        at = float(times[slow[0]])
        words = f"{topic} becomes slower: {window / took[slow].max():.3g} Hz instead of {1 / usual:.3g} Hz"
        yield Event(at, "topic", words, topic)


def _lifecycle(recording: Recording) -> Iterator[Event]:
    reached: dict[str, list[tuple[float, str]]] = {}
    for topic, table in recording.of(plan.TRANSITION):
        if set(plan.FIELDS[plan.TRANSITION]) <= set(table.columns):
            node = topic.rpartition("/")[0] or topic
            for t, state in zip(table.t.tolist(), table["goal_state.label"], strict=True):
                reached.setdefault(str(state), []).append((t, node))
    for state, own in reached.items():
        if state in ("active", "inactive", "finalized", "unconfigured", "errorprocessing"):
            nodes = list(dict.fromkeys(node for _, node in own))
            kind = "error" if state == "errorprocessing" else "lifecycle"
            yield Event(min(t for t, _ in own), kind, f"{_listed(nodes)}: {state}", "transition_event")


def _changes(recording: Recording) -> Iterator[Event]:
    """Parameters that were changed while the recording ran."""
    changes: dict[tuple[str, str, str], list[tuple[float, str]]] = {}
    for name, history in recording.settings.items():
        for before, later in pairwise(history):
            if later.changed_at_s is not None and later.changed_at_s > 1.0:
                what = (re.split(r"[./]", name)[-1], str(before.value), str(later.value))
                changes.setdefault(what, []).append((later.changed_at_s, name))
    ranked = sorted((min(own)[0], what, own) for what, own in changes.items())
    for at, (leaf, was, now), own in ranked[:CHANGES]:
        name = own[0][1] if len(own) == 1 else f"{leaf} of {len(own)} nodes"
        yield Event(at, "parameter", f"{name} changed from {was} to {now}", "parameters")
    if len(ranked) > CHANGES:
        words = f"{len(ranked) - CHANGES} more changes of parameters"
        yield Event(ranked[CHANGES][0], "parameter", words, "parameters")


def _motion(recording: Recording) -> Iterator[Event]:
    odometry = recording.odometry
    if odometry is not None:
        moving = (np.abs(odometry.speed) > 0.02) | (np.abs(odometry.turn) > 0.05)
        rows = np.flatnonzero(moving)
        if not len(rows):
            yield Event(float(odometry.t[-1]), "motion", "the robot never moved", odometry.topic)
        else:
            went = recording.moved_between(float(odometry.t[0]), float(odometry.t[-1]))
            began_s = max(0.0, float(odometry.t[rows[0]]))  # by its own stamp, which may lie before the recording
            yield Event(began_s, "motion", "the robot moves for the first time", odometry.topic)
            if odometry.stands_still:
                went = odometry.way_m
            words = f"drove {went:.1f} m in all, {quantile(np.abs(odometry.speed), 0.99):.2f} m/s at most"
            yield Event(float(odometry.t[-1]), "motion", words, odometry.topic)
    for battery in recording.batteries:
        words = f"battery {battery.voltage[0]:.1f} V at first, {battery.voltage[-1]:.1f} V at last"
        yield Event(float(battery.t[-1]), "battery", f"{words}, {battery.voltage.min():.1f} V at least", battery.topic)


def _times(count: int, last_s: float) -> str:
    return f" ({count} times, until {last_s:.1f} s)" if count > 1 else ""


def _listed(names: Iterable[str], most: int = 6) -> str:
    every: Sequence[str] = list(names)
    return ", ".join(every[:most]) + (f" and {len(every) - most} more" if len(every) > most else "")


def _cut(text: str) -> str:
    line = " ".join(text.split())
    return line if len(line) <= _TEXT else line[: _TEXT - 3] + "..."
