"""A drive without ROS 2: a plain pursuit of the shortest way in Nav2's place, recorded as Nav2's drives are.

It is there to try the files, the failures and the recording where no Nav2 is; nothing is to be learned from it, and of
Nav2's parameters it obeys the top speed and the goal tolerance alone.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterator

import numpy as np

from nav2_robot import messages, parameters
from nav2_robot.parameters import Parameters
from nav2_robot.recorder import STATUS, Recorder
from nav2_robot.robot import RADIUS, STEP_S, Robot
from nav2_robot.world import Pose, World

GOAL_LIMIT_S = 60.0

_CELL_M, _LOOKAHEAD_M, _KEEP_M = 0.1, 0.5, RADIUS + 0.1
_CONTROL_S, _REPLAN_S = 0.1, 1.0
_SPEED, _TOLERANCE_M = 0.5, 0.25
"""Of Nav2's parameters, where the file does not say."""
_TURN_GAIN, _TOP_TURN = 2.0, 1.2
_STUCK_S = 10.0

_EXECUTING, _SUCCEEDED, _ABORTED = 2, 4, 6


class StandIn:
    """Drives the goals of the robot's world one after the other."""

    def __init__(self, robot: Robot, settings: Parameters, recorder: Recorder) -> None:
        self.robot, self.recorder = robot, recorder
        self.top = parameters.number(settings, "/controller_server", "FollowPath.max_vel_x", _SPEED)
        self.near = parameters.number(
            settings, "/controller_server", "general_goal_checker.xy_goal_tolerance", _TOLERANCE_M
        )
        self.settings = settings
        self.codes: list[int] = []
        self._steps = 0

    def run(self) -> int:
        """Drive; the number of goals that were reached. A goal that is given up ends the mission."""
        for node, values in self.settings.items():
            made = parameters.event(self.recorder.maker, 0.0, node, values)
            self.recorder.record("/parameter_events", 0.0, made)
        self._rest(2.0)
        for goal in self.robot.conditions.world.goals:
            self._tell(_EXECUTING)
            reached = self._go(goal)
            self.codes.pop()
            self._tell(_SUCCEEDED if reached else _ABORTED)
            if not reached:
                self._say(40, "Goal failed")
                break
            self._say(20, "Goal succeeded")
            self._rest(0.5)
        self._rest(2.0)
        return self.codes.count(_SUCCEEDED)

    def _go(self, goal: Pose) -> bool:
        begun, planned, moved, here = self.robot.now_s, -math.inf, self.robot.now_s, self.robot.odometry
        way: list[tuple[float, float]] = []
        while self.robot.now_s < begun + GOAL_LIMIT_S:
            x, y, yaw = self.robot.odometry
            now = self.robot.now_s
            if math.dist((x, y), goal[:2]) <= self.near:
                return True
            if math.dist((x, y), here[:2]) > 0.1 or abs(yaw - here[2]) > 0.3:
                moved, here = now, self.robot.odometry
            if now - moved > _STUCK_S:
                self._say(40, "Failed to make progress")
                return False
            if now - planned >= _REPLAN_S:
                way, planned = list(plan(self.robot.world, (x, y), goal)), now
                self._record("/plan", messages.path(self.recorder.maker, now, [*way, goal[:2]], goal[2]))
            self._command(*self._pursue([*way, goal[:2]]))
            self._drive(_CONTROL_S)
        return False

    def _pursue(self, way: list[tuple[float, float]]) -> tuple[float, float]:
        x, y, yaw = self.robot.odometry
        nearest = min(range(len(way)), key=lambda i: math.dist((x, y), way[i]))
        aim = next((place for place in way[nearest:] if math.dist((x, y), place) >= _LOOKAHEAD_M), way[-1])
        off = math.remainder(math.atan2(aim[1] - y, aim[0] - x) - yaw, math.tau)
        turn = max(-_TOP_TURN, min(_TOP_TURN, _TURN_GAIN * off))
        return (0.0, turn) if abs(off) > 0.8 else (self.top * math.cos(off), turn)

    def _rest(self, time_s: float) -> None:
        self._command(0.0, 0.0)
        self._drive(time_s)

    def _command(self, speed: float, turn: float) -> None:
        self.robot.command(speed, turn)
        self._record("/cmd_vel", messages.twist(self.recorder.maker, speed, turn))

    def _drive(self, time_s: float) -> None:
        for _ in range(round(time_s / STEP_S)):
            self.robot.step()
            self._steps += 1
            for topic, message in messages.sensed(self.recorder.maker, self.robot, self._steps):
                self._record(topic, message)

    def _tell(self, code: int) -> None:
        self.codes.append(code)
        self._record(STATUS, messages.states(self.recorder.maker, self.robot.now_s, self.codes))

    def _say(self, level: int, text: str) -> None:
        maker = self.recorder.maker
        self._record("/rosout", maker.make("rcl_interfaces/Log", maker.stamp(self.robot.now_s), level, "bt_navigator",
                                           text, "", "", 0))  # fmt: skip

    def _record(self, topic: str, message: object) -> None:
        self.recorder.record(topic, self.robot.now_s, message)


def plan(world: World, here: tuple[float, float], goal: Pose) -> Iterator[tuple[float, float]]:
    """The shortest way over a grid that keeps clear of everything that stands; nothing where there is none."""
    boxes = np.array([*world.walls, *world.clutter])
    x0, y0 = float(boxes[:, 0].min()), float(boxes[:, 1].min())
    columns, rows = (math.ceil((float(boxes[:, i].max()) - low) / _CELL_M) for i, low in ((2, x0), (3, y0)))
    x, y = x0 + (np.arange(columns) + 0.5) * _CELL_M, y0 + (np.arange(rows) + 0.5) * _CELL_M
    free = np.full((columns, rows), np.inf)
    for left, below, right, above in boxes:
        aside = np.maximum(np.maximum(left - x, x - right), 0.0)[:, None]
        free = np.minimum(free, np.hypot(aside, np.maximum(np.maximum(below - y, y - above), 0.0)[None, :]))

    def cell(place: tuple[float, ...]) -> tuple[int, int]:
        return int((place[0] - x0) / _CELL_M), int((place[1] - y0) / _CELL_M)

    begin, end = cell(here), cell(goal[:2])
    came: dict[tuple[int, int], tuple[int, int]] = {}
    best = {end: 0.0}
    queue = [(0.0, end)]
    while queue:
        cost, last = heapq.heappop(queue)
        if last == begin:
            break
        if cost > best[last]:
            continue
        for i, j in ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)):
            to = last[0] + i, last[1] + j
            if not (0 <= to[0] < columns and 0 <= to[1] < rows) or (free[to] < _KEEP_M and to != begin):
                continue
            longer = cost + math.hypot(i, j) * (1 + 0.3 / max(float(free[to]), 0.1))
            if longer < best.get(to, math.inf):
                best[to], came[to] = longer, last
                heapq.heappush(queue, (longer, to))
    at: tuple[int, int] | None = begin if begin in came else None
    while at is not None and at != end:
        yield float(x[at[0]]), float(y[at[1]])
        at = came.get(at)
