"""What a look at any log answers: a timeline of events, and findings. Plain values, read by reports and the app."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Literal, Protocol, TypeVar

from care_core.records import Record, replace

Severity = Literal["info", "warning", "critical"]
FindingKind = Literal[
    "motor",
    "thrust",
    "vibration",
    "gps",
    "compass",
    "estimator",
    "barometer",
    "imu",
    "battery",
    "radio",
    "airspeed",
    "leak",
    "surface",
    "attitude",
    "tuning",
    "takeoff",
    "crash",
    "prearm",
    "cpu",
    "log",
    "laser",
    "localisation",
    "drive",
    "blocked",
    "clearance",
    "planner",
    "control",
    "tf",
    "commands",
    "topics",
    "software",
]

SuspectKind = Literal["hardware", "world", "parameter", "operation"]
"""What a finding speaks of: a part that failed, what the robot met, how it was set, what its operator did."""


class Event(Record):
    """One line of the timeline: what happened at `time_s` seconds from the start of the log, and where it says so."""

    time_s: float
    kind: str
    """`vehicle`, `mode`, `arming`, `message`, `error`, `parameter`, `goal`, ...: what sort of thing happened."""
    text: str
    source: str
    """The message type or topic that tells it."""


class Finding(Record):
    """Something that was not as it should be."""

    kind: FindingKind
    title: str
    """What is wrong, in one clause an operator reads aloud: "motor 2 lost thrust"."""
    onset_s: float
    """Seconds from the start of the log at which it begins."""
    end_s: float
    severity: Severity
    evidence: str
    """The numbers that show it, beside the limits that they broke."""
    source: str
    """What of the log shows it, and where its limit comes from (documentation, source line)."""
    suspect: SuspectKind = "hardware"
    probability: float = 0.5
    """How likely it is, seeing this, that the thing named really failed (0 to 1); measured on flights and drives whose
    truth is known where there are any."""
    mission_lost: float | None = None
    """How likely a mission fails with it (0 to 1), where the training flights tell; None: as its severity says."""
    parameters: tuple[str, ...] = ()
    """Parameters that it names by itself, whatever any profile knows of them."""
    wanted: tuple[tuple[str, float], ...] = ()
    """The value that the log itself measures for a parameter that it names; none where only that it is wrong follows.
    """
    after_impact: bool = False
    consequences: tuple[Finding, ...] = ()
    """Later findings that this one led to, by physical steps each forwards in time."""
    followed_by: tuple[Finding, ...] = ()
    """Findings of its course of events that nothing shows it to have led to; some are seen just before it."""

    @property
    def below(self) -> tuple[Finding, ...]:
        """All that is folded under it."""
        return (*self.consequences, *self.followed_by)

    @property
    def links(self) -> tuple[tuple[str, tuple[Finding, ...]], ...]:
        """What is folded under it, by the words for how it hangs together."""
        return linked(self.onset_s, self.consequences, self.followed_by)


class _Timed(Protocol):
    @property
    def onset_s(self) -> float | None: ...


T = TypeVar("T", bound=_Timed)


def linked(
    onset_s: float | None, consequences: Sequence[T], followed_by: Sequence[T]
) -> tuple[tuple[str, tuple[T, ...]], ...]:
    """What is folded under a finding, by the words for how it hangs together; without empty ones."""
    since_s = math.inf if onset_s is None else onset_s
    at_once = tuple(one for one in followed_by if one.onset_s == since_s)
    later = tuple(one for one in followed_by if one.onset_s is None or one.onset_s > since_s)
    before = tuple(one for one in followed_by if one not in (*at_once, *later))
    links = (
        ("led to", tuple(consequences)),
        ("at the same time", at_once),
        ("followed by", later),
        ("seen just before it", before),
    )
    return tuple(link for link in links if link[1])


def every_finding(findings: Iterable[Finding]) -> Iterator[Finding]:
    """The findings and what is folded under them."""
    for one in findings:
        yield one
        yield from every_finding(one.below)


WHOLE_LOG = "the whole log"
"""Source of the finding that says no more than that the log holds too little."""
TOO_SHORT = "too little is recorded to say anything of a run"
NO_TASK = "neither goals nor messages of nodes are recorded: what the robot was to do is not known"
"""Its title where checks of the robot did run, and only its task is not known."""
NOT_FLOWN = "the vehicle never armed: no run of it is in this log"


OWN_SUPPLY = "the autopilot's own supply"
"""What the title of a finding about the board's voltage, not the pack's, begins with."""
LOW_SUPPLY = f"{OWN_SUPPLY} is low"
UNCHARGED = "the battery was only partly charged"
SAGS = "the battery sags under its load"
BATTERY_FAILSAFE = "battery failsafe"
STEERED = "it was steered into the ground"
SPINS = "it spins against its control"
IDLED = "control was lost with the throttle stick at its bottom"
STRUCK = "it hit something"
LEANED = "it was told to lean while it stood, and tipped over"
BY_STICK = frozenset((STEERED, IDLED))
"""What a pilot's stick brought about."""
SHOW_WHY = BY_STICK | {STRUCK, LEANED}
"""Symptoms of which the log does show why."""
KILLED = "the kill switch cut the motors in the air"
DROPPED = "it was disarmed in the air, and fell"
CUT = "its motors stopped in the air, and it fell"
CLOSED = "its throttle was closed in the air, and it fell"
STOPPED = "the emergency switch stopped the motors in the air"
UNDRIVEN = "the firmware found a crash while its motors were at rest"
UNPOWERED = "the motors draw no power"
NOT_BEGUN = "its mission never began"
HASTY = "it was disarmed before its motors had spooled up"
NO_MISSION = "the firmware had no valid mission to fly"
NO_POSITION_FOR = " was asked for, and no position is known"
"""Ends the title of a mode that cannot act; the mode stands before it."""
NOT_READY = "not ready to fly: "
"""Begins the title of a refusal of PX4; the words of its last check follow."""
NO_BATTERY = "the battery monitor measures no battery"
"""Begins the title of its failsafe, which follows."""
MONITOR_SILENT = "the battery monitor fell silent"
OF_MONITOR = NO_BATTERY, MONITOR_SILENT
"""What titles begin with that speak of the monitor of a battery, and of no pack."""
CAME_DOWN = "it came down and could not rise again"
LOST_SIGHT = "the vehicle is heard no more, in the air"
ASKED_SPEED = "a program asks it for "
"""Begins the title of a speed that nobody means, which follows."""


class OfRun(Record):
    """What happened in one run of a log that holds several, and what was found in it."""

    end_s: float
    """When its part of the log ends."""
    findings: tuple[Finding, ...]
    timeline: tuple[Event, ...]


class Health(Record):
    """What happened in a log. `findings` stand in the order told, the first cause first."""

    robot: str
    """What it is, in a few words: "ArduCopter V4.5.4, quad X"; "ROS 1 robot with move_base"."""
    timeline: tuple[Event, ...]
    findings: tuple[Finding, ...]
    too_little: str = ""
    """Why the log holds too little to say how a run went: it is too short, or no run is in it."""
    runs: tuple[OfRun, ...] = ()
    """Of a log that holds several runs, each of them."""
    shown_right: frozenset[str] = frozenset()
    """Parameters that this log shows to be right, however far from a default."""

    def of_run(self, start_s: float) -> Health:
        """The same of one run alone, that of a log which was begun at this time."""
        own = next((run for run in self.runs if start_s <= run.end_s), None)
        return self if own is None else replace(self, findings=own.findings, timeline=own.timeline)


NOTHING_SEEN = Health("", (), ())
