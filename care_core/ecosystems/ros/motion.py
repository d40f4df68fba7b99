"""How the robot moved, by its odometry, and what it was commanded to do."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from care_core.ecosystems.plausible import STAMP
from care_core.ecosystems.ros.messages import FRAME, HEIGHT, ODOMETRY, TWIST, TWIST_STAMPED, believable, tilt_of, yaw_of
from care_core.logs.base import Table
from care_core.numbers import Bools, Floats, median, quantile
from care_core.records import Record, replace

STANDS_MPS, STANDS_RADPS = 0.02, 0.05
"""Below these a robot stands still, and a command asks it to: a wheeled robot's odometry at rest is quieter."""
BREAKS_LOOSE_MPS, BREAKS_LOOSE_RADPS = 0.08, 0.15
"""A command for less may be too little to break loose, so a robot that stands still then does not disobey."""
TWIST_MPS, TWIST_RADPS = 0.01, 0.01
"""An odometry that ever tells more than these has its twist filled in: some drivers leave it zero."""
ELSEWHERE_M = 0.5
"""What is so far from where it was has moved, where no speed is told: positions of satellites wander by less."""
STILL_M = 2.0
"""Way by its speed that no noise of a speed makes while a position stays the same to the last digit."""

STALE_S = 0.6
"""Base drivers stop without commands for about this long (diff_drive_controller: cmd_vel_timeout 0.5 s)."""
ANSWER_S = 1.0
"""Within this time a drive follows: a step of 1 m/s at 1 m/s^2."""
_THIN = 2.5
"""Commands may come this many times later than usual before they count as ceased: recordings are thinned."""

PUNCTUAL_S, MOSTLY = 0.25, 0.6
"""Where this share of messages is recorded so soon after it was made, both clocks run alike."""
_WAY_M, _STOOD = 1.0, 0.05
"""Who reaches goals over such a way has moved, and by more than this share of it."""
_ENOUGH = 20
"""Samples that must agree before odometry is called dead."""
_NEARLY_ALL, _A_SECOND = 0.99, 1.0
IN_TURN_M, IN_TURN, BACK = 0.02, 0.25, 0.3
"""Two steps in a row that go so much beyond what its speed explains, and together do not, but for this share of them:
where so many of its samples are such, two publishers send in turn. Noise at rest is a tenth of that step."""
_OFF_MPS, _FITS = 0.05, 0.2
"""A twist is of the parent frame where it is so far from what its position does as the robot looks, and this share of
that from what it does as the map lies."""
_WANDERS_RAD = 0.03
"""By which a heading that stands wanders in a second at most."""
_OVER = 3
"""Steps over which that is compared: encoders count in steps of their own."""
_FEWEST = 3
"""Samples without which there is no movement to speak of."""


class Odometry(Record, eq=False):
    """What odometry says, where it says numbers: s, m, rad, m/s, rad/s, each of shape (n,)."""

    topic: str
    frame: str
    """Empty where it was not read."""
    recorded_s: Floats
    t: Floats
    """When each sample was made, in the recorder's time, see `when_made`."""
    clock: Floats
    """The same by the robot's own clock, which a slow simulation slows."""
    x: Floats
    y: Floats
    yaw: Floats
    speed: Floats
    """Forward, negative backwards."""
    sideways: Floats
    turn: Floats
    z: Floats
    tilt: Floats
    """To what was upright at first, deg."""
    numberless_s: Floats
    """When messages without numbers were recorded, shape (m,)."""
    is_of_parent: bool = False
    """Whether its twist was told in the frame of its position, and was turned into the robot's here."""

    @property
    def dt(self) -> Floats:
        """Time since the sample before by the robot's own clock; 0 for the first."""
        step = np.diff(self.clock, prepend=np.nan)
        return np.where(step > 0, step, 0.0)

    @property
    def tells_speed(self) -> bool:
        """Whether its twist is filled in."""
        return bool(np.any(np.abs(self.speed) > TWIST_MPS) or np.any(np.abs(self.turn) > TWIST_RADPS))

    @property
    def way_by_speed_m(self) -> float:
        """How far it went by its speed."""
        return float(np.sum(np.hypot(self.speed, self.sideways) * self.dt))

    @property
    def stands_still(self) -> bool:
        """Whether its position is not filled in: the same to the last digit while its speed makes metres of way."""
        return not np.ptp(self.x) and not np.ptp(self.y) and self.way_by_speed_m > STILL_M

    @property
    def turned_rad(self) -> float:
        """How far it turned in all, either way added up, by its heading second by second; what only wanders does not
        count."""
        if len(self.t) < _FEWEST:
            return 0.0
        each = np.arange(self.t[0], self.t[-1] + _A_SECOND, _A_SECOND)
        steps = np.abs(np.diff(np.interp(each, self.t, np.unwrap(self.yaw))))
        return float(steps[steps > _WANDERS_RAD].sum())

    def path_m(self, start_s: float = -np.inf, end_s: float = np.inf) -> float:
        """Length of the path of its positions in a time, m."""
        inside = (self.t >= start_s) & (self.t <= end_s)
        return float(np.sum(np.hypot(np.diff(self.x[inside]), np.diff(self.y[inside]))))

    @property
    def fastest_mps(self) -> float:
        """The greatest speed that lasts: as its twist says, and no more than its position went in a second, where it
        tells one. A twist that is made of single steps of an encoder has spikes."""
        spoken = quantile(np.abs(self.speed), _NEARLY_ALL)
        rows, later = self._seconds
        if self.stands_still or not len(rows):
            return spoken
        return min(spoken, quantile(self._rate(rows, later, self.x, self.y), _NEARLY_ALL))

    @property
    def in_turn(self) -> NDArray[np.intp]:
        """The samples that are elsewhere than those before and after them: none, unless they are many."""
        went, most = self.steps_m
        first, second = (went - most)[1:-1], (went - most)[2:]
        along = np.hypot(self.x[2:] - self.x[:-2], self.y[2:] - self.y[:-2]) - most[1:-1] - most[2:]
        least = np.minimum(first, second)
        rows: NDArray[np.intp] = np.flatnonzero((least > IN_TURN_M) & (along < BACK * least)) + 1
        return rows if len(rows) >= max(_ENOUGH, IN_TURN * len(self.t)) else rows[:0]

    @property
    def steps_m(self) -> tuple[Floats, Floats]:
        """Per sample how far the position went since the one before, and the most that the speeds allow, m."""
        went = np.hypot(np.diff(self.x, prepend=self.x[:1]), np.diff(self.y, prepend=self.y[:1]))
        speed = np.hypot(self.speed, self.sideways)
        return went, np.maximum(speed, np.concatenate([speed[:1], speed[:-1]])) * self.dt

    @property
    def moves(self) -> Bools:
        """Where it does not stand, by its speed; where it tells none, where it is elsewhere than at first."""
        if self.tells_speed:
            return np.asarray((np.abs(self.speed) > STANDS_MPS) | (np.abs(self.turn) > STANDS_RADPS))
        return np.asarray(np.hypot(self.x - self.x[0], self.y - self.y[0]) > ELSEWHERE_M)

    @property
    def most_by_position(self) -> tuple[float, float]:
        """The greatest speed and turn that its poses give over a second, m/s and rad/s; of one that holds no second
        without a pause none are known, and nothing is beyond them."""
        rows, later = self._seconds
        if not len(rows):
            return np.inf, np.inf
        yaw = np.unwrap(self.yaw)
        return float(self._rate(rows, later, self.x, self.y).max()), float(self._rate(rows, later, yaw).max())

    @property
    def _seconds(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Rows from which about a second passes without a long pause, and the rows at its end."""
        later = np.minimum(np.searchsorted(self.clock, self.clock + _A_SECOND), len(self.clock) - 1)
        apart = self.clock[later] - self.clock
        rows = np.flatnonzero((apart >= _A_SECOND) & (apart < 2 * _A_SECOND))
        return rows, later[rows]

    def _rate(self, rows: NDArray[np.intp], later: NDArray[np.intp], *columns: Floats) -> Floats:
        """How fast these change between rows, per second."""
        went = np.sqrt(sum((column[later] - column[rows]) ** 2 for column in columns))
        rate: Floats = went / (self.clock[later] - self.clock[rows])
        return rate

    def spread_m(self, start_s: float) -> float:
        """Diagonal of the area that its positions lie in from a time on, m."""
        x, y = (axis[(self.t >= start_s) & np.isfinite(axis)] for axis in (self.x, self.y))
        return float(np.hypot(np.ptp(x), np.ptp(y))) if len(x) and len(y) else 0.0

    def advancing(self) -> Odometry | None:
        """The samples with a heading that were made one after the other; None where hardly any were."""
        good = np.isfinite(self.yaw + self.t)
        good[1:] &= np.diff(self.t) > 0
        if np.count_nonzero(good) < _FEWEST:
            return None
        return self.where(good)

    def where(self, good: Bools) -> Odometry:
        """The samples of a mask."""
        if good.all():
            return self
        columns = ("recorded_s", "t", "clock", "x", "y", "yaw", "speed", "sideways", "turn", "z", "tilt")
        return replace(self, **{name: getattr(self, name)[good] for name in columns})


class Commands(Record, eq=False):
    """Velocity commands: s, m/s, rad/s, each of shape (n,), in order of time."""

    topic: str
    t: Floats
    speed: Floats
    sideways: Floats
    turn: Floats
    numberless_s: Floats
    """When commands without numbers were recorded, shape (m,)."""

    def way_m(self, start_s: float, end_s: float) -> float:
        """How far a robot goes that follows the commands of a time, m."""
        inside = (self.t >= start_s) & (self.t <= end_s)
        ordered = np.hypot(self.speed, self.sideways) * np.minimum(np.diff(self.t, append=self.t[-1:]), STALE_S)
        return float(ordered[inside].sum())


def odometry_of(topic: str, table: Table) -> Odometry | None:
    """The odometry of a topic; None where it has no messages of that kind."""
    places, speeds = ("pose.pose.position.x", "pose.pose.position.y"), ("linear.x", "linear.y", "angular.z")
    fields = (*places, *(f"twist.twist.{name}" for name in speeds))
    headings = [f"pose.pose.orientation.{axis}" for axis in "xyzw"]
    if not len(table) or not {*fields, *headings} <= set(table.columns):
        return None
    x, y, speed, sideways, turn = (believable(table, ODOMETRY, name) for name in fields)
    good = np.isfinite(x + y + speed + sideways + turn)
    frames = table[FRAME][good].tolist() if FRAME in table.columns else []
    t, clock = when_made(table), _clock(table)
    told = Odometry(
        topic=topic,
        frame=str(frames[0]) if frames else "",
        recorded_s=table.t[good],
        t=t[good],
        clock=(t if clock is None else clock)[good],
        x=x[good],
        y=y[good],
        yaw=yaw_of(table, "pose.pose.orientation")[good],
        speed=speed[good],
        sideways=sideways[good],
        turn=turn[good],
        z=(believable(table, ODOMETRY, HEIGHT) if HEIGHT in table.columns else np.zeros(len(table)))[good],
        tilt=tilt_of(table, ODOMETRY, "pose.pose.orientation")[good],
        numberless_s=table.t[~good],
    )
    return _turned_to_the_robot(told) if _tells_of_parent(told) else told


def _turned_to_the_robot(told: Odometry) -> Odometry:
    cos, sin = np.cos(told.yaw), np.sin(told.yaw)
    forward, sideways = told.speed * cos + told.sideways * sin, told.sideways * cos - told.speed * sin
    return replace(told, speed=forward, sideways=sideways, is_of_parent=True)


def _tells_of_parent(told: Odometry) -> bool:
    """Whether its twist is that of its position along the axes of the map, where nav_msgs/Odometry wants it along those
    of the robot: only where it turns they differ."""
    if len(told.t) <= _OVER:
        return False
    dt = told.clock[_OVER:] - told.clock[:-_OVER]
    steps = (dt > 0) & (dt < STALE_S * _OVER)
    along, across = ((one[_OVER:] - one[:-_OVER])[steps] / dt[steps] for one in (told.x, told.y))
    yaw, said_x, said_y = (
        np.convolve(one, np.full(_OVER, 1 / _OVER), "valid")[1:][steps]
        for one in (np.unwrap(told.yaw), told.speed, told.sideways)
    )
    moves = np.hypot(along, across) > STANDS_MPS
    if np.count_nonzero(moves) < _ENOUGH:
        return False
    ahead, aside = along * np.cos(yaw) + across * np.sin(yaw), across * np.cos(yaw) - along * np.sin(yaw)
    off = float(median(np.hypot(said_x - ahead, said_y - aside)[moves]))
    return off > _OFF_MPS and float(median(np.hypot(said_x - along, said_y - across)[moves])) < _FITS * off


def _clock(table: Table) -> Floats | None:
    """The stamps of messages, where they are set and run forward."""
    if STAMP not in table.columns:
        return None
    stamp = np.asarray(table[STAMP], np.float64)
    return stamp if np.isfinite(stamp).all() and stamp[-1] > stamp[0] and np.all(np.diff(stamp) >= 0) else None


def when_made(table: Table) -> Floats:
    """When messages were made, in the recorder's time: by their stamps where that clock runs as the recorder's does.

    What a link held back was recorded later than it was made, and comes in a burst.
    """
    stamp = _clock(table)
    if stamp is None:
        return table.t
    late: Floats = table.t - stamp
    usual = quantile(late, 0.1)
    return stamp + usual if float(np.mean(late - usual < PUNCTUAL_S)) >= MOSTLY else table.t


def commands_of(topic: str, table: Table) -> Commands | None:
    """The commands of a topic of geometry_msgs/Twist or TwistStamped; None where none is."""
    type, prefix = (TWIST_STAMPED, "twist.") if "twist.linear.x" in table.columns else (TWIST, "")
    names = [f"{prefix}{name}" for name in ("linear.x", "linear.y", "angular.z")]
    if not set(names) <= set(table.columns):
        return None
    speed, sideways, turn = (believable(table, type, name) for name in names)
    good = np.isfinite(speed + turn + sideways)
    if not good.any():
        return None
    return Commands(topic, table.t[good], speed[good], sideways[good], turn[good], table.t[~good])


def never_moved(path_m: float, samples: int, way_m: float) -> bool:
    """Whether odometry whose path is so long says that a robot stood which reached goals over a way of `way_m`."""
    return samples >= _ENOUGH and way_m >= _WAY_M and path_m < _STOOD * way_m


class Following(Record, eq=False):
    """Per odometry sample the commands of the last second: the least and the most that was asked for.

    `commanded` is False where no command was in force, `to_move` True where every command of that second asked for
    motion. All of shape (n,).
    """

    odometry: Odometry
    commanded: Bools
    to_move: Bools
    speed_low: Floats
    speed_high: Floats
    turn_low: Floats
    turn_high: Floats

    @property
    def wanted_speed(self) -> Floats:
        """The speed that every command of the last second asked for at least, m/s, 0 where they differ in sign."""
        return _least(self.speed_low, self.speed_high, self.commanded)

    @property
    def wanted_turn(self) -> Floats:
        """The same of the turn, rad/s."""
        return _least(self.turn_low, self.turn_high, self.commanded)


def _least(low: Floats, high: Floats, commanded: Bools) -> Floats:
    same: Floats = np.where(low > 0, low, np.where(high < 0, high, 0.0))
    return np.where(commanded, same, 0.0)


def following(odometry: Odometry, commands: Commands) -> Following:
    """Odometry beside the commands that were in force."""
    first = np.searchsorted(commands.t, odometry.t - ANSWER_S, "right") - 1
    last = np.searchsorted(commands.t, odometry.t, "right")
    stale_s = max(STALE_S, _THIN * float(median(np.diff(commands.t))))
    commanded = (first >= 0) & (last > 0)
    commanded &= odometry.t - commands.t[np.maximum(last - 1, 0)] <= stale_s
    moving = np.hypot(commands.speed, commands.sideways) >= BREAKS_LOOSE_MPS
    moving |= np.abs(commands.turn) >= BREAKS_LOOSE_RADPS
    to_move = np.zeros(len(odometry.t), bool)
    bounds = [np.zeros(len(odometry.t)) for _ in range(4)]
    for row in np.flatnonzero(commanded).tolist():
        second = slice(int(first[row]), int(last[row]))
        speed, turn = commands.speed[second], commands.turn[second]
        for bound, value in zip(bounds, (speed.min(), speed.max(), turn.min(), turn.max()), strict=True):
            bound[row] = value
        to_move[row] = moving[second].all()
    return Following(odometry, commanded, to_move, *bounds)


class Poses(Record, eq=False):
    """Poses of the robot in a frame: s, m, rad, all shape (n,)."""

    t: Floats
    x: Floats
    y: Floats
    yaw: Floats
    frame: str


def moved_to(poses: Poses, t: Floats, x: Floats, y: Floats, yaw: Floats) -> tuple[Floats, Floats, Floats]:
    """Odometry, shape (n,), moved to the last pose that was told before each sample, the first one before it."""
    rows = np.interp(poses.t, t, np.arange(len(t))).round().astype(np.intp)
    at = np.clip(np.searchsorted(poses.t, t, side="right") - 1, 0, None)
    off = poses.yaw[at] - yaw[rows[at]]
    dx, dy = x - x[rows[at]], y - y[rows[at]]
    return (
        poses.x[at] + np.cos(off) * dx - np.sin(off) * dy,
        poses.y[at] + np.sin(off) * dx + np.cos(off) * dy,
        yaw + off,
    )
