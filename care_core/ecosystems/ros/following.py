"""What the drive was asked for and what it did: odometry beside the commands that were in force."""

from __future__ import annotations

import numpy as np

from care_core.ecosystems.ros.recording import Bools, Commands, Floats, Odometry, Recording
from care_core.numbers import median
from care_core.records import Record

ANSWER_S = 1.0
"""Within this time a drive follows: a step of 1 m/s at 1 m/s^2."""
_STALE_S = 0.6
"""Base drivers stop without commands for about this long (diff_drive_controller: cmd_vel_timeout 0.5 s)."""
MOVING_MPS, TURNING_RADPS = 0.08, 0.15
"""A command for less may be too little to break loose."""
_THIN = 2.5
"""Commands may come this many times later than usual before they count as ceased: recordings are thinned."""


class Following(Record, eq=False):
    """Per odometry sample the commands of the last second: the least and the most that was asked for.

    `asked` is False where no command was in force, `to_move` True where every command of that second asked for motion.
    All of shape (n,).
    """

    odometry: Odometry
    asked: Bools
    to_move: Bools
    speed_low: Floats
    speed_high: Floats
    turn_low: Floats
    turn_high: Floats

    @property
    def wanted_speed(self) -> Floats:
        """The speed that every command of the last second asked for at least, m/s, 0 where they differ in sign."""
        return _least(self.speed_low, self.speed_high, self.asked)

    @property
    def wanted_turn(self) -> Floats:
        return _least(self.turn_low, self.turn_high, self.asked)


def _least(low: Floats, high: Floats, asked: Bools) -> Floats:
    same: Floats = np.where(low > 0, low, np.where(high < 0, high, 0.0))
    return np.where(asked, same, 0.0)


def following(recording: Recording) -> Following | None:
    """Odometry beside commands, None where either is missing or odometry tells no speed."""
    odometry, commands = recording.odometry, recording.commands
    if odometry is None or commands is None or len(commands.t) < 3 or not odometry.tells_speed:
        return None
    return beside(odometry, commands)


def beside(odometry: Odometry, commands: Commands) -> Following:
    first = np.searchsorted(commands.t, odometry.t - ANSWER_S, "right") - 1
    last = np.searchsorted(commands.t, odometry.t, "right")
    usual_s = float(median(np.diff(commands.t)))
    stale_s = max(_STALE_S, _THIN * usual_s)
    asked = (first >= 0) & (last > 0)
    asked &= odometry.t - commands.t[np.maximum(last - 1, 0)] <= stale_s
    rows = np.flatnonzero(asked)
    moving = (np.hypot(commands.speed, commands.sideways) >= MOVING_MPS) | (np.abs(commands.turn) >= TURNING_RADPS)
    to_move = np.zeros(len(odometry.t), bool)
    bounds = [np.zeros(len(odometry.t)) for _ in range(4)]
    for row in rows.tolist():
        own = slice(int(first[row]), int(last[row]))
        speed, turn = commands.speed[own], commands.turn[own]
        for bound, value in zip(bounds, (speed.min(), speed.max(), turn.min(), turn.max()), strict=True):
            bound[row] = value
        to_move[row] = moving[own].all()
    return Following(odometry, asked, to_move, *bounds)
