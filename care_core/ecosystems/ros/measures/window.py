"""A mission along goals as a window on the drive, worked out once for all extractors.

The mission section of the profile names the topics, see `topics`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from care_core.ecosystems.coverage import MEAN, SUM, Bears, Samples, doubt
from care_core.ecosystems.measures import Args, Mission, RestsOn, missing
from care_core.ecosystems.plausible import APART, STAMP, is_simulated, stamps_pace
from care_core.ecosystems.ros.drive import Drive, way_through
from care_core.ecosystems.ros.goals import Goal
from care_core.ecosystems.ros.motion import STANDS_MPS, STANDS_RADPS, Commands, Odometry, Poses, moved_to, never_moved
from care_core.ecosystems.ros.recoveries import Recoveries
from care_core.ecosystems.spans import Span, stretches
from care_core.logs.base import Wanted
from care_core.numbers import Bools, Floats
from care_core.records import Record, replace
from care_core.run import OutcomeCheck, Unavailable
from care_core.text import log_time

GOAL_TIMEOUT_S = 60.0
TOLERANCE_M = 0.3

_WENT_M = 1.0
"""Who went so far was not standing all the time."""

_MAX_GAP_S = 1.0
"""A sample speaks for at most this long after it, so a gap in a topic counts as nothing."""


class Topics(Record):
    """Where a platform's log holds what is not the goal server's own."""

    odometry: str
    commands: str
    battery: str


def topics(spec: Args) -> Topics:
    """Topics of a mission section; the usual names where it does not say otherwise."""
    return Topics(
        odometry=str(spec.get("odometry", "/odom")),
        commands=str(spec.get("commands", "/cmd_vel")),
        battery=str(spec.get("battery", "/battery_state")),
    )


def timeout_s(spec: Args) -> float:
    """How long a goal may take."""
    return float(spec.get("goal_timeout_s", GOAL_TIMEOUT_S))


def listed_goals(spec: Args) -> tuple[tuple[float, float], ...]:
    """The goals (x, y) of the profile's own mission; empty when it does not say."""
    return tuple((float(goal[0]), float(goal[1])) for goal in spec.get("goals", ()))


def listed_headings(spec: Args) -> tuple[float, ...]:
    """The headings asked for at them, rad; nan where the profile does not say."""
    return tuple(float(goal[2]) if len(goal) > 2 else math.nan for goal in spec.get("goals", ()))


def difference(goals: Sequence[Goal], spec: Args) -> str:
    """What tells a mission from the profile's own, empty where nothing does. One that was given up is still its own."""
    listed = listed_goals(spec)
    tolerance_m = float(spec.get("tolerance_m", TOLERANCE_M))
    for number, goal in enumerate(goals if listed else (), start=1):
        if number > len(listed):
            return f"{len(goals)} goals were sent, the profile's mission has {len(listed)}"
        off_m = goal.offset(*listed[number - 1])
        if math.isnan(off_m):
            return f"the log does not say where goal {number} lies"
        if off_m > tolerance_m:
            return f"goal {number} lies {off_m:.1f} m from the profile's"
    return ""


def own_goals(goals: Sequence[Goal], spec: Args) -> tuple[tuple[float, float], ...]:
    """The goals of the profile's own mission where this is it; empty where the goals are others."""
    return () if difference(goals, spec) else listed_goals(spec)


def time_limit_s(goals: Sequence[Goal], spec: Args) -> float:
    """How long each goal may take. The profile says it of its own goals; where others lie farther apart, longer."""
    listed = listed_goals(spec)
    if len(listed) < 2 or not difference(goals, spec):
        return timeout_s(spec)
    listed_m = max(math.dist(a, b) for a, b in pairwise(listed))
    apart_m = [math.dist((a.x, a.y), (b.x, b.y)) for a, b in pairwise(goals)]
    return timeout_s(spec) * max([1.0, *(apart / listed_m for apart in apart_m if math.isfinite(apart))])


class GoalServer(Record):
    """How a recording tells the goals of a server: one a mission kind, see `actionlib` and `nav2`."""

    needs: Callable[[Args], Wanted]
    goals: Callable[[Drive, Args], tuple[Goal, ...]]
    """Every goal of a recording, in the order they were sent."""
    recoveries: Callable[[Mission], Recoveries | Unavailable]
    poses: Callable[[Mission], Poses | None] = lambda _: None
    """Where the server said that the robot was, in the frame of the goals."""
    judged: Callable[[Sequence[Goal], OutcomeCheck], OutcomeCheck] = lambda _, check: check
    """Whether its goals were reached, in the words of how that is known."""


GOAL_SERVERS: dict[str, GoalServer] = {}
"""By the `kind` of the mission section."""


def goal_server(spec: Args) -> GoalServer:
    """The goal server of a mission section."""
    return GOAL_SERVERS[str(spec.get("kind", "actionlib_goals"))]


def drive_of(mission: Mission) -> Drive | None:
    """The drive that a mission is a part of; None in a log of another ecosystem."""
    return mission.model if isinstance(mission.model, Drive) else None


class ActiveOdometry(Record, eq=False):
    """Odometry while a goal is active: m, rad, m/s, rad/s; `dt` is what each sample speaks for. All shape (n,)."""

    t: Floats
    dt: Floats
    x: Floats
    y: Floats
    yaw: Floats
    speed: Floats
    turn: Floats
    goal: NDArray[np.intp]
    """Number of the active goal."""
    frame: str
    tells_speed: bool
    """Whether its twist is filled in, as far as it went anywhere."""

    @property
    def stands(self) -> Bools:
        return np.asarray((np.abs(self.speed) < STANDS_MPS) & (np.abs(self.turn) < STANDS_RADPS))

    @property
    def step_m(self) -> Floats:
        """Distance from the sample before, shape (n,), 0 for the first."""
        return np.hypot(np.diff(self.x, prepend=self.x[:1]), np.diff(self.y, prepend=self.y[:1]))


class ActiveCommands(Record, eq=False):
    """Velocity commands while a goal is active: m/s, rad/s; `dt` is how long each was in force. All shape (n,)."""

    t: Floats
    dt: Floats
    speed: Floats
    turn: Floats

    @property
    def stands(self) -> Bools:
        return np.asarray((np.abs(self.speed) < STANDS_MPS) & (np.abs(self.turn) < STANDS_RADPS))

    @property
    def turns_on_spot(self) -> Bools:
        return np.asarray((np.abs(self.speed) < STANDS_MPS) & (np.abs(self.turn) >= STANDS_RADPS))


class DriveWindow(Record, eq=False):
    """What extractors share. `odometry` and `commands` are None where the log lacks them, odometry also where it cannot
    be right: `doubt` says why."""

    goals: tuple[Goal, ...]
    timeout_s: float
    listed: tuple[tuple[float, float], ...]
    """The goals of the profile's own mission where this is it."""
    odometry: ActiveOdometry | None
    commands: ActiveCommands | None
    topics: Topics
    doubt: str = ""
    untold: Unavailable | None = None
    """Why the goals are not known to the end, None where they are."""
    placed: ActiveOdometry | None = None
    """The odometry in the frame of the goals, where the goal server says where the robot is; its steps are not those of
    the wheels: a localization corrects itself."""

    @property
    def reached(self) -> tuple[Goal, ...]:
        return tuple(goal for goal in self.goals if goal.reached(self.timeout_s))

    @property
    def active_s(self) -> float:
        return sum(goal.time_s for goal in self.goals)


def window(mission: Mission) -> DriveWindow:
    """The window of a mission; use through `mission.shared`."""
    drive, names, server = drive_of(mission), topics(mission.spec), goal_server(mission.spec)
    every = () if drive is None else server.goals(drive, mission.spec)
    goals = tuple(goal for goal in every if mission.start_s <= goal.sent_s <= mission.end_s)
    whole = None if drive is None else drive.odometry_on(names.odometry)
    commands = None if drive is None else drive.commands_on(names.commands)
    odometry = None if whole is None else _odometry(whole, mission, goals)
    doubt = "" if whole is None else _doubt(whole, mission, goals, odometry, way_through(goals, commands))
    return DriveWindow(
        goals=goals,
        timeout_s=time_limit_s(goals, mission.spec),
        listed=own_goals(goals, mission.spec),
        odometry=None if doubt else odometry,
        commands=None if commands is None else _commands(commands, mission, goals),
        topics=names,
        doubt=doubt,
        untold=None if drive is None or not goals or goals[-1] != every[-1] else _untold(drive, every, whole),
        placed=None if doubt or odometry is None else _placed(odometry, server.poses(mission)),
    )


def _untold(drive: Drive, goals: Sequence[Goal], odometry: Odometry | None) -> Unavailable | None:
    last_s = drive.goals_untold_s(goals, odometry)
    if last_s is None:
        return _unheard(drive, [(goal.sent_s, goal.end_s) for goal in goals if goal.status is None])
    reason = f"the recording tells of no goal after {log_time(last_s, 0)}, though the robot drives on"
    return Unavailable(reason, "record the topics of the action to the end")


def _unheard(drive: Drive, open_goals: Sequence[Span]) -> Unavailable | None:
    """Why goals without an answer may have had one: nothing at all was recorded for a time; None where all was."""
    streams = [drive.times[topic] for topic in drive.streams]
    return doubt(Samples("the drive", np.concatenate(streams), open_goals, SUM)) if streams and open_goals else None


def no_odometry(drive: DriveWindow) -> Unavailable:
    """Why a drive has no odometry."""
    if drive.doubt:
        return Unavailable(drive.doubt, "check the odometry's source and its driver")
    return missing(drive.topics.odometry)


def samples_of(mission: Mission, part: str, bears: Bears) -> Iterator[Samples]:
    """What the log tells of one of the `topics` of a mission, while a goal is active; of the battery, throughout."""
    drive, channel = drive_of(mission), str(getattr(topics(mission.spec), part))
    if drive is None:
        return
    goals = [(goal.sent_s, goal.end_s) for goal in mission.shared(window).goals]
    odometry = drive.odometry_on(topics(mission.spec).odometry)
    dead = drive.repeats(channel)
    if part == "odometry" and odometry is not None:
        yield Samples(f"the odometry ({channel})", odometry.recorded_s, goals, bears, dead=dead)
    if part == "commands" and (commands := drive.commands_on(channel)) is not None and odometry is not None:
        # What is silent while the robot stands commands nothing.
        yield Samples(f"the commands ({channel})", commands.t, _moving(odometry, goals), bears, dead=dead)
    if part == "battery" and (battery := drive.battery_on(channel)) is not None:
        yield Samples(f"the battery ({channel})", battery.t, [(mission.start_s, mission.end_s)], bears, dead=dead)


def _moving(odometry: Odometry, goals: Sequence[Span]) -> list[Span]:
    """Where it moves on its way to goals, as long as it stands for no longer than a moment."""
    t = odometry.recorded_s
    on_its_way = np.zeros(len(t), bool)
    for start, end in goals:
        on_its_way |= (t >= start) & (t <= end)
    moves = (np.hypot(odometry.speed, odometry.sideways) >= STANDS_MPS) | (np.abs(odometry.turn) >= STANDS_RADPS)
    return stretches(t, np.asarray(on_its_way & moves), _MAX_GAP_S)


def resting_on(*parts: str, bears: Bears = MEAN) -> RestsOn:
    """What is measured on these topics needs them throughout."""
    return lambda mission, _args: (one for part in parts for one in samples_of(mission, part, bears))


def arrivals(mission: Mission, args: Args) -> Iterator[Samples]:
    """The odometry at the end of each goal."""
    ends = [goal.end_s for goal in mission.shared(window).goals]
    for one in samples_of(mission, "odometry", MEAN):
        yield replace(one, spans=(), moments=ends)


def _odometry(whole: Odometry, mission: Mission, goals: Sequence[Goal]) -> ActiveOdometry | None:
    rows, goal, dt = _active(whole.recorded_s, mission, goals)
    if len(rows) < 2:
        return None
    x, y, yaw, speed, turn = (column[rows] for column in (whole.x, whole.y, whole.yaw, whole.speed, whole.turn))
    stood = float(np.hypot(np.diff(x), np.diff(y)).sum()) < _WENT_M
    t = whole.recorded_s[rows]
    return ActiveOdometry(t, dt, x, y, yaw, speed, turn, goal, whole.frame, whole.tells_speed or stood)


def _commands(whole: Commands, mission: Mission, goals: Sequence[Goal]) -> ActiveCommands | None:
    rows, _, dt = _active(whole.t, mission, goals)
    return ActiveCommands(whole.t[rows], dt, whole.speed[rows], whole.turn[rows]) if len(rows) >= 2 else None


def _placed(odometry: ActiveOdometry, poses: Poses | None) -> ActiveOdometry | None:
    """The odometry moved to the last pose that was told before each sample, the first one before it."""
    if poses is None or poses.frame.strip("/") == odometry.frame.strip("/"):
        return None
    x, y, yaw = moved_to(poses, odometry.t, odometry.x, odometry.y, odometry.yaw)
    return replace(odometry, x=x, y=y, yaw=yaw, frame=poses.frame)


def _doubt(
    whole: Odometry, mission: Mission, goals: Sequence[Goal], odometry: ActiveOdometry | None, way_m: float
) -> str:
    """Why what odometry says cannot be, in words; empty where it can.

    Args:
        way_m: how far the robot must have gone.
    """
    if len(_active(whole.recorded_s, mission, goals)[0]) < len(_active(whole.numberless_s, mission, goals)[0]):
        return f"{whole.topic} has no numbers in most of its messages"
    if odometry is not None and never_moved(float(odometry.step_m.sum()), len(odometry.t), way_m):
        return f"{whole.topic} says that the robot never moved, but it reached its goals"
    table = mission.table(whole.topic)
    if table is not None and STAMP in table.columns and not is_simulated(table.t, table[STAMP]):
        pace = stamps_pace(table.t, table[STAMP])
        if pace is not None and not 1 / APART <= pace <= APART:
            return f"the stamps of {whole.topic} run at {pace:.2g} of the recording's clock"
    return ""


def _active(t: Floats, mission: Mission, goals: Sequence[Goal]) -> tuple[NDArray[np.intp], NDArray[np.intp], Floats]:
    """The rows of a mission in which a goal is active, its number, and the time that each row speaks for."""
    inside = np.flatnonzero((t >= mission.start_s) & (t <= mission.end_s))
    times = t[inside]
    number = np.full(len(times), -1, np.intp)
    for place, goal in enumerate(goals):
        number[(times >= goal.sent_s) & (times <= goal.end_s)] = place
    dt = np.minimum(np.diff(times, append=times[-1:]), _MAX_GAP_S)
    active = number >= 0
    return inside[active], number[active], dt[active]


def share(where: Bools, weight: Floats) -> float:
    """Share of the time, 0 to 1, that a condition held."""
    total = float(weight.sum())
    return float(weight[where].sum()) / total if total > 0 else 0.0


def longest(where: Bools, dt: Floats) -> float:
    """The longest unbroken time that a condition held, s."""
    best = current = 0.0
    for is_so, time_s in zip(where.tolist(), dt.tolist(), strict=True):
        current = current + time_s if is_so else 0.0
        best = max(best, current)
    return best


def angle_between(a: float, b: float) -> float:
    """The smaller angle between two headings, rad, 0 to pi."""
    return abs((a - b + math.pi) % (2 * math.pi) - math.pi)
