"""Parameters against what the recording shows: topics, frames and the clock that they name, delays and rates that nodes
complain of. A robot that reaches its goals is set well, whatever else is recorded."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from difflib import SequenceMatcher

import numpy as np

from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding, FindingKind
from care_core.ecosystems.ros.drive import Drive
from care_core.ecosystems.ros.messages import CLOUD, GOALS, MESSAGES, ODOMETRY, ROSOUT, SCAN, TF, TREE, reading, type_of
from care_core.ecosystems.ros.node_messages import Level, LogMessage
from care_core.ecosystems.ros.recoveries import repairs
from care_core.logs.base import Table
from care_core.numbers import median
from care_core.records import replace
from care_core.run import Setting

LIMITS = Limits()
ALIKE = LIMITS.add("likeness of a topic that is meant", 0.6, "", "difflib: a letter or a namespace off")
COMPLAINTS = int(LIMITS.add("complaints of a delay or a rate", 10, "", "of 58 drives with other causes most have 5"))
STOPPED_S = LIMITS.add("delay from which it is a transform that stopped", 2.0, "s", "no robot drives on such a pose")
ROUNDED = LIMITS.add("how far apart a parameter and a message's figure of it are", 0.006, "", "two places are told")
MARGIN = LIMITS.add("tolerance over the delay", 1.5, "", "a choice: delays vary")
ANSWER_MS = LIMITS.add("wait for an answer that a busy computer may miss", 100.0, "ms", "Nav2's default is 20")
ENOUGH_MS = LIMITS.add(
    "wait for an answer that is suggested", 1000.0, "ms", "a choice: a wait costs nothing where answers come"
)
LATE = LIMITS.add(
    "probability that a late answer ended the goal",
    0.9,
    "",
    "of 705 missions of Nav2 driven ahead of real time 69 ended so",
)
GAVE_UP_S = LIMITS.add(
    "time from giving up the wait to the end of the goal", 1.0, "s", "the tree fails at its next tick"
)
_CLOCK = "/clock"
_FRAMES = frozenset((
    "global_frame", "robot_base_frame", "base_frame_id", "odom_frame_id", "global_frame_id", "local_frame",
    "base_frame", "odom_frame",
))  # fmt: skip
_SENSED: Mapping[str, tuple[str, ...]] = {"LaserScan": (SCAN,), "PointCloud2": (CLOUD,)}
_READ: Mapping[str, tuple[str, ...]] = {"scan_topic": (SCAN,), "odom_topic": (ODOMETRY,)}
_NAVIGATION = re.compile(
    r"(move_base|amcl|costmap|_server|bt_navigator|velocity_smoother|waypoint_follower|collision_monitor)$"
)
_TIMEOUT = re.compile(
    r"transform timeout.*current time: ?([\d.]+\d).*pose stamp: ?([\d.]+\d).*tolerance: ?([\d.]*\d)", re.IGNORECASE
)
_SELDOM = re.compile(
    r"(\S+) observation buffer has not been updated for ([\d.]+\d) .*every ([\d.]+\d) second", re.IGNORECASE
)
_NO_FRAME = re.compile(
    r"\"?([\w/]+)\"? passed to lookuptransform argument \w+ does not exist|frame \[([\w/]+)\] does not exist"
    r"|invalid frame id \"([\w/]+)\"",
    re.IGNORECASE,
)
_UNANSWERED = re.compile(
    r"timed out while waiting for action server to acknowledge goal request for (\S+)", re.IGNORECASE
)

Held = Mapping[tuple[str, ...], Setting]
"""Parameters by the parts of their names."""


def find(drive: Drive) -> Iterator[Finding]:
    """What the recording shows a parameter to be wrong about, where a goal was missed."""
    if not drive.missed:
        return
    held: Held = {
        tuple(part for part in re.split(r"[/.]", name) if part): one for name, one in drive.parameters.items()
    }
    yield from _topics(drive, held)
    yield from _frames(drive, held)
    yield from _clocks(drive, held)
    yield from _delays(drive, held)
    yield from _rates(drive, held)
    yield from _answers(drive, held)


def _finding(
    drive: Drive, kind: FindingKind, settings: Sequence[Setting], what: str, evidence: str, source: str,
    probability: float, wanted: float | None = None,
) -> Finding:  # fmt: skip
    first = settings[0]
    values = "; ".join(f"{one.name} is {one.value} ({one.source})" for one in settings)
    return Finding(
        kind=kind,
        title=f"{re.split(r'[/.]', first.name)[-1]} is {first.value}: {what}",
        onset_s=drive.missed_s,
        end_s=drive.duration_s,
        severity="warning",
        evidence=f"{values}; {evidence}",
        source=source,
        suspect="parameter",
        probability=probability,
        mission_lost=0.9,
        parameters=tuple(one.name for one in settings),
        wanted=() if wanted is None else tuple((one.name, wanted) for one in settings),
    )


def _topics(drive: Drive, held: Held) -> Iterator[Finding]:
    """Topics that a parameter names and nobody publishes, where others of their kind are recorded."""
    counts = {one.name: one.count for one in drive.channels}
    for keys, setting in held.items():
        types = _READ.get(keys[-1], ())
        if keys[-1] == "topic" and any("costmap" in key for key in keys):
            kind = held.get((*keys[:-1], "data_type"))
            types = _SENSED.get(str(kind.value) if kind else "", (SCAN, CLOUD))
        topic = str(setting.value).strip("/")
        there = [one.name for one in drive.channels if type_of(one) in types and one.count]
        if not topic or not there or any(_is_topic(topic, name) and counts[name] for name in counts):
            continue
        nearest = max(there, key=lambda name: _alike(topic, name))
        complains = any(_SELDOM.search(one.text) for one in drive.log_messages)
        is_sure = complains or _alike(topic, nearest) >= ALIKE or any(_is_topic(topic, name) for name in counts)
        yield _finding(
            drive, "topics", [setting], "nobody publishes that topic", f"recorded are {', '.join(there[:3])}",
            "the topics of the recording", 0.85 if is_sure else 0.3,
        )  # fmt: skip


def _is_topic(wanted: str, name: str) -> bool:
    """Whether a recorded topic may be the one that a node calls so, in whatever namespace."""
    return name.strip("/") == wanted or name.endswith(f"/{wanted}") or wanted.endswith(name)


def _alike(wanted: str, name: str) -> float:
    return SequenceMatcher(None, wanted.casefold(), name.strip("/").casefold()).ratio()


def _frames(drive: Drive, held: Held) -> Iterator[Finding]:
    """Frames that a parameter names and no transform has, or that a node does not find."""
    frames = {frame for _, table in drive.of(*TF) for frame in _named_in(table)}
    sought = {
        next(filter(None, match.groups())).strip("/")
        for one in drive.log_messages
        if (match := _NO_FRAME.search(one.text)) is not None
    }
    for keys, setting in held.items():
        frame = str(setting.value).strip("/")
        if keys[-1] not in _FRAMES or not frame:
            continue
        if frame in sought and frame not in frames:
            evidence = f'nodes say that "{frame}" does not exist'
        elif len(frames) > 1 and not any(one == frame or one.endswith(f"/{frame}") for one in frames):
            evidence = f"transforms are recorded of {', '.join(sorted(frames)[:6])}"
        else:
            continue
        yield _finding(drive, "tf", [setting], "no transform has that frame", evidence, "/tf, /rosout", 0.85)


def _named_in(table: Table) -> Iterator[str]:
    for field in MESSAGES[TF[0]].reads[:2]:
        for names in table.columns.get(field, ()):
            yield from (str(name).strip("/") for name in names)


def _clocks(drive: Drive, held: Held) -> Iterator[Finding]:
    """Nodes of navigation on the computer's clock beside a simulated one."""
    ticks = len(drive.times.get(_CLOCK, ()))
    for keys, setting in held.items():
        is_read = len(keys) == 1 or _NAVIGATION.search(keys[-2]) is not None
        if ticks and keys[-1] == "use_sim_time" and is_read and str(setting.value).casefold() in ("false", "0", "0.0"):
            evidence = f"{_CLOCK} has {ticks} messages"
            yield _finding(
                drive, "tf", [setting], "the recording has a simulated clock", evidence, _CLOCK, 0.8, wanted=1.0
            )


def _delays(drive: Drive, held: Held) -> Iterator[Finding]:
    """Tolerances of a transform below the delay that a node complains of."""
    for node, tolerance_s, late in _complaints(drive, _TIMEOUT):
        delays = np.array([float(one[1]) - float(one[2]) for _, one in late])
        delay_s = float(median(delays))
        if not tolerance_s < delay_s < STOPPED_S:
            continue
        if settings := _settings(held, "transform_tolerance", tolerance_s):
            yield _finding(
                drive, "tf", settings, f"poses are {delay_s:.2g} s old",
                f"{node} says so {len(late)} times", "/rosout", 0.7, wanted=_wanted(float(delays.max())),
            )  # fmt: skip


def _rates(drive: Drive, held: Held) -> Iterator[Finding]:
    """Sources that come more seldom than a layer is told to expect."""
    for node, every_s, late in _complaints(drive, _SELDOM):
        topic = late[0][1][1].strip("/")
        period_s = next((s for name, s in drive.streams.items() if _is_topic(topic, name)), None)
        if period_s is None or period_s <= every_s:  # it stopped: that is the sensor's
            continue
        if settings := _settings(held, "expected_update_rate", every_s):
            yield _finding(
                drive, "topics", settings, f"one comes every {period_s:.2g} s",
                f"{node} complains {len(late)} times", "/rosout, times of recording", 0.7,
                wanted=_wanted(period_s),
            )  # fmt: skip


def _answers(drive: Drive, held: Held) -> Iterator[Finding]:
    """A goal that the tree gave up since a server did not answer: a wait too short, else a busy computer. Where
    it was repairing something before, that is what failed."""
    repaired = [t for _, table in drive.of(TREE) for t, _ in repairs(table) or ()]
    unanswered = [(one, match[1]) for one in drive.log_messages if (match := _UNANSWERED.search(one.text)) is not None]
    ends = [one.end_s for one in drive.missed if not any(one.sent_s <= t < one.end_s for t in repaired)]
    lost = [(one, by) for one, by in unanswered if any(abs(end - one.time_s) <= GAVE_UP_S for end in ends)]
    if not lost:
        return
    # The navigator's action node holds a copy of it.
    settings = [one for keys, one in held.items() if keys[-2:] == ("bt_navigator", "default_server_timeout")]
    short = [one for one in settings if not isinstance(one.value, str) and float(one.value) <= ANSWER_MS]
    last, server = lost[-1]
    evidence = f"{len(unanswered)} wait{'' if len(unanswered) == 1 else 's'} for an answer ran out"
    if short:
        what = f"{server} did not answer in that many ms, and the goal was given up"
        why = f"{evidence}; a longer wait costs nothing where answers come"
        found = _finding(drive, "software", short, what, why, "/rosout", 0.7, wanted=ENOUGH_MS)
        yield replace(found, onset_s=lost[0][0].time_s)
        return
    waits = "; ".join(f"default_server_timeout is {one.value} ms" for one in settings)
    yield Finding(
        kind="software",
        title=f"the computer is too busy: {server} did not answer in time, and the goal was given up",
        onset_s=last.time_s,
        end_s=drive.duration_s,
        severity="critical",
        evidence="; ".join(filter(None, (evidence, waits))),
        source="/rosout",
        suspect="world",
        probability=LATE,
        mission_lost=1.0,
    )


def _wanted(seconds: float) -> float:
    return float(f"{MARGIN * seconds:.2g}")


Complaint = tuple[LogMessage, "re.Match[str]"]


def _complaints(drive: Drive, pattern: re.Pattern[str]) -> Iterator[tuple[str, float, list[Complaint]]]:
    """By node and limit, what nodes complain of; the last group of the pattern is the limit."""
    found: dict[tuple[str, float], list[Complaint]] = {}
    for one in drive.log_messages:
        match = pattern.search(one.text) if one.level >= Level.WARN else None
        if match is not None:
            found.setdefault((one.node, float(match[3])), []).append((one, match))
    for (node, limit), said in found.items():
        if len(said) >= COMPLAINTS:
            yield node, limit, said


def _settings(held: Held, name: str, value: float) -> list[Setting]:
    """The parameters of that name with that value, as a message rounds it."""
    named = (one for keys, one in held.items() if keys[-1] == name and not isinstance(one.value, str))
    return [one for one in named if abs(float(one.value) - value) < ROUNDED]


READS = reading(*ROSOUT, ODOMETRY, SCAN, *TF, TREE, *GOALS)
CHECK = Check(
    "parameters",
    "topics, frames and clocks that parameters name and the recording lacks, tolerances below what is measured, waits "
    "that ran out",
    READS,
    LIMITS,
    find,
)
