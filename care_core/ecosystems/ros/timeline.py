"""What happened in a ROS recording, in order of time: goals, recoveries, what nodes said, topics, parameters, motion.

Repeats are one line with their count, so that the whole is read in a minute.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from care_core.ecosystems.findings import Event
from care_core.ecosystems.ros.drive import Drive
from care_core.ecosystems.ros.messages import (
    BATTERY,
    COMMANDS,
    DIAGNOSTICS,
    FAULT_EVENT,
    GOALS,
    LOCALISED,
    ODOMETRY,
    RECOVERY,
    ROSOUT,
    TRANSITION,
    TREE,
    WITHOUT_STREAM,
    holds,
    reading,
    tells_events,
    type_of,
)
from care_core.ecosystems.ros.motion import Odometry
from care_core.ecosystems.ros.node_messages import Level, LogMessage, kept_its_rate, level_word, loop_rate
from care_core.ecosystems.ros.other_robots import other_goals
from care_core.ecosystems.ros.recoveries import announced, repairs
from care_core.ecosystems.spans import runs
from care_core.ecosystems.timeline import counted
from care_core.logs.ros_message import short_name
from care_core.numbers import Floats
from care_core.text import first_of, log_time, shortened

_GOALS, _MESSAGES, _REPORTS, _CHANGES, _CONTACTS = 12, 14, 6, 5, 6
"""Lines of each sort at most."""
PAUSE_S, PAUSE_PERIODS = 3.0, 10.0
"""A stream that pauses so long, and so many of its periods, is told of."""
STOOD_M = 0.5
"""A robot that comes no farther has not moved enough for a localisation to say so: amcl's update_min_d is 0.25 m."""
SLOWER, SLOWER_S = 0.5, 10.0
"""A stream whose rate falls below this share of what it was, for so long, is told of."""
_MOVES_S = 0.5
"""Shortest movement that is told as one: the speed of what stands is noise."""
_NAMED = 6
"""Topics or nodes that one moment names."""
_TEXT = 110
_ON_THE_SPOT_M, _TURNED_DEG = 0.3, 45.0
"""A way that is none, and a turn that is worth a word."""
_URGENT = {2: 0, 3: 1, 1: 2}
"""An error of diagnostics comes before silence, and that before a warning."""
_NUMBER = re.compile(r"-?\d+(\.\d+)?(e-?\d+)?")
READS = reading(ODOMETRY, *COMMANDS, BATTERY, DIAGNOSTICS, FAULT_EVENT, TREE, RECOVERY, TRANSITION, *GOALS, *ROSOUT)


def timeline(drive: Drive) -> tuple[Event, ...]:
    """What happened, in order of time."""
    found = [
        *_recorded(drive),
        *_damage(drive),
        *_goals(drive),
        *other_goals(drive),
        *_untold(drive),
        *_recoveries(drive),
        *_log_messages(drive),
        *_diagnostics(drive),
        *_pauses(drive),
        *_contacts(drive),
        *_lifecycle(drive),
        *_changes(drive),
        *_motion(drive),
    ]
    return tuple(sorted(found, key=lambda event: event.time_s))


def _recorded(drive: Drive) -> Iterator[Event]:
    count = sum(len(times) for times in drive.times.values())
    if not count:
        yield Event(0.0, "error", "nothing was recorded: there is no message in it", "recording")
        return
    words = f"{drive.duration_s:.0f} s of {counted(len([1 for times in drive.times.values() if len(times)]), 'topic')}"
    yield Event(0.0, "recording", f"the recording begins: {words}", "recording")
    empty = [one.name for one in drive.channels if not one.count and short_name(one.type) not in WITHOUT_STREAM]
    if empty:
        yield Event(0.0, "topic", f"no message on {first_of(empty, _NAMED)}", "recording")


def _damage(drive: Drive) -> Iterator[Event]:
    for damage in drive.damage:
        yield Event(damage.time_s or 0.0, "damage", damage.what, "recording")


def _goals(drive: Drive) -> Iterator[Event]:
    goals = drive.goals
    if goals and drive.posed is not None:
        words = f"goals are told by {goals[0].action} alone: how they ended is judged by where the robot is"
        yield Event(goals[0].sent_s, "goal", words, goals[0].action)
    shown = goals if len(goals) <= _GOALS else [goal for goal in goals if goal.outcome != "reached"][:_GOALS]
    for number, goal in enumerate(goals, start=1):
        if goal not in shown:
            continue
        place = "" if math.isnan(goal.x) else f" at ({goal.x:.1f}, {goal.y:.1f})"
        took = f"after {goal.time_s:.0f} s"
        why = f": {_cut(goal.text)}" if goal.text and goal.failed else ""
        what = f"{goal.outcome} {took}{why}" if goal.outcome else f"still open {took}, when the recording ends"
        yield Event(goal.end_s, "goal", f"goal {number}{place}, sent at {log_time(goal.sent_s)}, {what}", goal.action)
    if len(shown) < len(goals):
        reached = sum(goal.outcome == "reached" for goal in goals)
        yield Event(goals[0].sent_s, "goal", f"{len(goals)} goals, {reached} reached", goals[0].action)


def _untold(drive: Drive) -> Iterator[Event]:
    last_s = drive.goals_untold_s(drive.goals, drive.odometry)
    if last_s is not None:
        words = "the recording tells of no goal from here on, though the robot drives on"
        yield Event(last_s, "goal", words, "recording")


def _recoveries(drive: Drive) -> Iterator[Event]:
    ran: dict[str, list[tuple[float, str]]] = {}
    for type, read in ((RECOVERY, announced), (TREE, repairs)):
        for topic, table in drive.of(type):
            for t, name in read(table) or ():
                ran.setdefault(name, []).append((t, topic))
    for name, times in ran.items():
        (first_s, topic), (last_s, _) = times[0], times[-1]
        yield Event(first_s, "recovery", f"recovery {name}{_times(len(times), last_s)}", topic)


def _log_messages(drive: Drive) -> Iterator[Event]:
    kinds: dict[tuple[str, str], list[LogMessage]] = {}
    for message in drive.log_messages:
        if message.level >= Level.WARN and not kept_its_rate(message.text):
            kinds.setdefault((message.node, _NUMBER.sub("#", message.text)), []).append(message)
    ranked = sorted(kinds.values(), key=lambda alike: (-alike[0].level, alike[0].time_s))
    for alike in ranked[:_MESSAGES]:
        first = alike[0]
        told, how_often = _worst(alike), _times(len(alike), alike[-1].time_s)
        if told is not first:
            how_often = f"{how_often.removesuffix(')')}, this the lowest)"
        text = f"{level_word(first.level)} {first.node}: {_cut(told.text)}{how_often}"
        yield Event(first.time_s, "error" if first.level >= Level.ERROR else "message", text, "/rosout")
    if len(ranked) > _MESSAGES:
        left = ranked[_MESSAGES:]
        words = f"{len(left)} more kinds of message, {sum(map(len, left))} messages"
        yield Event(left[0][0].time_s, "message", words, "/rosout")


def _worst(alike: list[LogMessage]) -> LogMessage:
    """Of messages that differ in numbers alone the one of the slowest loop, or the first."""
    return min(alike, key=lambda one: (loop_rate(one.text) or (0.0, 0.0))[0])


def _diagnostics(drive: Drive) -> Iterator[Event]:
    bad = [report for report in drive.reports if report.level > 0]
    worst: dict[str, Event] = {}
    for report in sorted(bad, key=lambda report: (_URGENT.get(report.level, 3), report.time_s)):
        text = f"{report.by} {report.word} {report.name}" + (f': "{_cut(report.message)}"' if report.message else "")
        kind = "error" if report.level == 2 else "diagnostics"
        worst.setdefault(report.name, Event(report.time_s, kind, text, report.topic))
    yield from list(worst.values())[:_REPORTS]


def _pauses(drive: Drive) -> Iterator[Event]:
    """Streams that pause, end early, or become slower; those that do so together in one line."""
    paused: dict[tuple[int, int], list[str]] = {}
    for channel in drive.channels:
        if channel.name not in drive.streams or tells_events(channel):
            continue
        times = drive.times[channel.name]
        pauses = np.diff(times)
        usual = drive.streams[channel.name]
        row = int(np.argmax(pauses))
        over = drive.ends_early(channel.name)
        if type_of(channel) == LOCALISED:  # it tells a pose where the robot has moved
            over = over if over and drive.moved_between(over[0], drive.duration_s) > STOOD_M else None
            pauses = pauses if drive.moved_between(times[row], times[row + 1]) > STOOD_M else pauses[:0]
        if over is not None:
            yield Event(over[0], "topic", f"{channel.name} ends; {1 / usual:.3g} Hz before", channel.name)
        if len(pauses) and pauses[row] >= max(PAUSE_S, PAUSE_PERIODS * usual):
            paused.setdefault((round(times[row] / 2), round(times[row + 1] / 2)), []).append(channel.name)
        elif len(pauses):
            yield from _slower(channel.name, times, usual)
    for names in paused.values():
        first = drive.times[names[0]]
        row = int(np.argmax(np.diff(first)))
        pause = "pause" if len(names) > 1 else "pauses"
        words = f"{first_of(names, _NAMED)} {pause} for {first[row + 1] - first[row]:.1f} s"
        yield Event(float(first[row]), "topic", words, names[0])


_USUALLY = 1.3
"""A window that takes so many times as long has nearly the usual rate."""


def _slower(topic: str, times: Floats, usual: float) -> Iterator[Event]:
    """Where the rate falls to less than half, for good or for a while, or rises from it."""
    window = max(int(SLOWER_S / usual), 10)
    if len(times) < 3 * window:
        return
    took = times[window:] - times[:-window]
    slow = np.flatnonzero(took > SLOWER_S / SLOWER)
    slow = slow[took[slow] > window * usual / SLOWER]
    if len(slow):
        rates = f"{window / took[slow].max():.3g} Hz", f"{1 / usual:.3g} Hz"
        usually = np.flatnonzero(took < _USUALLY * window * usual)
        if not len(usually):
            return
        if usually[0] > slow[0]:  # it was slow from the start
            at, how, (now, before) = usually[0], "faster", rates[::-1]
        else:
            at, how, (now, before) = slow[0], "slower", rates
        yield Event(float(times[at]), "topic", f"{topic} becomes {how}: {now} instead of {before}", topic)


def _contacts(drive: Drive) -> Iterator[Event]:
    """What touched the robot, by the topics that tell of it."""
    times = drive.contacts_s.tolist()
    if times:
        when = first_of([log_time(at) for at in times], _CONTACTS)
        topics = (*drive.contact_topics, *(drive.bumper_topics if drive.bumps else ()))
        words = f"{counted(len(times), 'contact')} told by {first_of(topics, _NAMED)}: {when}"
        yield Event(times[0], "contact", words, topics[0])


def _lifecycle(drive: Drive) -> Iterator[Event]:
    reached: dict[str, list[tuple[float, str]]] = {}
    for topic, table in drive.of(TRANSITION):
        if holds(table, TRANSITION):
            node = topic.rpartition("/")[0] or topic
            for t, state in zip(table.t.tolist(), table["goal_state.label"], strict=True):
                reached.setdefault(str(state), []).append((t, node))
    for state, own in reached.items():
        if state in ("active", "inactive", "finalized", "unconfigured", "errorprocessing"):
            nodes = list(dict.fromkeys(node for _, node in own))
            kind = "error" if state == "errorprocessing" else "lifecycle"
            yield Event(min(t for t, _ in own), kind, f"{first_of(nodes, _NAMED)}: {state}", "transition_event")


def _changes(drive: Drive) -> Iterator[Event]:
    """Parameters that were changed while the recording ran."""
    changes: dict[tuple[str, str, str], list[tuple[float, str]]] = {}
    for name, history in drive.settings.items():
        for before, later in pairwise(history):
            if later.changed_at_s is not None and later.changed_at_s > 1.0:
                what = (re.split(r"[./]", name)[-1], str(before.value), str(later.value))
                changes.setdefault(what, []).append((later.changed_at_s, name))
    ranked = sorted((min(own)[0], what, own) for what, own in changes.items())
    for at, (leaf, was, now), own in ranked[:_CHANGES]:
        name = own[0][1] if len(own) == 1 else f"{leaf} of {len(own)} nodes"
        yield Event(at, "parameter", f"{name} changed from {was} to {now}", "parameters")
    if len(ranked) > _CHANGES:
        words = f"{len(ranked) - _CHANGES} more changes of parameters"
        yield Event(ranked[_CHANGES][0], "parameter", words, "parameters")


def _motion(drive: Drive) -> Iterator[Event]:
    odometry = drive.odometry
    if odometry is not None and drive.fall is not None:  # how it tumbles is no driving
        odometry = odometry.where(odometry.t < drive.fall.start_s)
    if odometry is not None:
        rows = np.flatnonzero(odometry.moves)
        end_s = float(odometry.t[-1])
        if not len(rows):
            yield Event(end_s, "motion", "the robot never moved", odometry.topic)
        else:
            lasting = (start for start, end in runs(odometry.t, odometry.moves) if end - start >= _MOVES_S)
            began_s = max(0.0, next(lasting, float(odometry.t[rows[0]])))  # its own stamp may lie before the recording
            yield Event(began_s, "motion", "the robot moves for the first time", odometry.topic)
            yield Event(end_s, "motion", _driven(odometry), odometry.topic)
    for battery in drive.batteries:
        volts = battery.voltage
        words = (
            f"battery {volts[0]:.1f} V at the start, {volts[-1]:.1f} V at the end, {volts.min():.1f} V at the lowest"
        )
        yield Event(float(battery.t[-1]), "battery", words, battery.topic)


def _driven(odometry: Odometry) -> str:
    """How far and how fast it went; positions alone, such as a receiver's, wander too much to be added up."""
    if len(odometry.in_turn):
        return "its odometry comes from two sources: how far it went is not known"
    if not odometry.tells_speed:
        return f"its positions lie within {odometry.spread_m(0.0):.1f} m; its odometry tells no speed"
    went = odometry.way_by_speed_m if odometry.stands_still else odometry.path_m()
    turned_deg = math.degrees(odometry.turned_rad)
    on_the_spot = went < _ON_THE_SPOT_M and turned_deg > _TURNED_DEG
    turned = f", turned {turned_deg:.0f} deg on the spot" if on_the_spot else ""
    # over pauses of its odometry it goes on, at speeds that nothing tells
    is_in_part = went > odometry.fastest_mps * float(np.ptp(odometry.t))
    fastest = "" if is_in_part else f", {odometry.fastest_mps:.2f} m/s at its fastest"
    return f"drove {went:.1f} m{fastest}{turned}"


def _times(count: int, last_s: float) -> str:
    return f" ({count} times, until {log_time(last_s)})" if count > 1 else ""


def _cut(text: str) -> str:
    return shortened(" ".join(text.split()), _TEXT)
