"""What a mission along goals requests: how many, how far apart, how much turning. Known before it, never a cause.

A mission of the profile's own goals requests all of them, however many were sent before it was given up. Distances
are straight lines: what the map puts between two goals is not in the log.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from functools import wraps
from itertools import pairwise

import numpy as np

from care_core.ecosystems.measures import Args, Mission, extractor, one_of
from care_core.ecosystems.ros.measures.window import (
    TOLERANCE_M,
    DriveWindow,
    angle_between,
    listed_headings,
    no_odometry,
    window,
)
from care_core.numbers import Floats
from care_core.records import Record
from care_core.run import Unavailable, Value

_LEAST_RAD = 0.2
"""A smaller turn is made on the way: headings at the start of the training runs lie within 0.12 rad of the course."""

Pose = tuple[float, float, float]
"""x and y in m, heading in rad; nan where the log does not say."""


class RequestedWay(Record, eq=False):
    """The way through the goals of a mission, from where the robot stood."""

    lengths: Floats
    """From goal to goal, m, shape (goals,)."""
    turn: float
    """All turning that it asks for, rad."""


def requested_way(mission: Mission) -> RequestedWay | Unavailable:
    """The way that a mission requests; use through `mission.shared`."""
    drive = mission.shared(window)
    goals = _goals(drive, mission.spec)
    if any(math.isnan(x) for x, _, _ in goals):
        return Unavailable("the log does not say where the goals lie", "ros2 bag record /goal_pose /plan")
    start = _start(drive, goals[0])
    if isinstance(start, Unavailable):
        return start
    poses = (start, *goals)
    lengths = [math.hypot(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(poses)]
    return RequestedWay(np.array(lengths), sum(_turns(poses)))


def _goals(drive: DriveWindow, spec: Args) -> tuple[Pose, ...]:
    """The goals of the mission: all of the profile's own, or those that were sent."""
    sent = tuple((goal.x, goal.y, goal.yaw) for goal in drive.goals)
    unsent = tuple((x, y, yaw) for (x, y), yaw in zip(drive.listed, listed_headings(spec), strict=False))
    return (*sent, *unsent[len(sent) :])


def _start(drive: DriveWindow, first: Pose) -> Pose | Unavailable:
    """Where the robot stood when the first goal was sent, in the frame of the goals.

    Where the odometry has a frame of its own, the way to the first goal is as long as the robot came forward on it.
    """
    odometry = drive.placed or drive.odometry
    if odometry is None:
        return no_odometry(drive)
    here = np.flatnonzero(odometry.goal == 0)
    if not len(here):
        return Unavailable("the odometry begins after the first goal was sent", "record the whole mission")
    begin, end = here[0], here[-1]
    frame, own = drive.goals[0].frame.strip("/"), odometry.frame.strip("/")
    if not frame or not own or frame == own:
        return float(odometry.x[begin]), float(odometry.y[begin]), float(odometry.yaw[begin])
    if not drive.goals[0].reached(drive.timeout_s):
        hint = "name in the mission section a topic of nav_msgs/Odometry in the goals' frame"
        return Unavailable(f"goals are in frame {frame}, odometry is in {own}", hint)
    way_m = math.hypot(odometry.x[end] - odometry.x[begin], odometry.y[end] - odometry.y[begin])
    return first[0] - max(way_m, TOLERANCE_M), first[1], math.nan


def _turns(poses: tuple[Pose, ...]) -> Iterator[float]:
    """Towards each goal, and at it to its heading; rad. What is not known counts as none."""
    for (x, y, before), (there_x, there_y, after) in pairwise(poses):
        course = math.atan2(there_y - y, there_x - x)
        if math.hypot(there_x - x, there_y - y) < TOLERANCE_M:
            yield _turn(before, after)
        else:
            yield _turn(before, course) + _turn(course, after)


def _turn(a: float, b: float) -> float:
    angle = angle_between(a, b)
    return angle if angle >= _LEAST_RAD else 0.0


_REQUESTS: Mapping[str, Callable[[RequestedWay], float]] = {
    "goals": lambda way: float(len(way.lengths)),
    "path_length": lambda way: float(way.lengths.sum()),
    "goal_distance": lambda way: float(way.lengths.mean()),
    "turn": lambda way: way.turn,
    "goal_turn": lambda way: way.turn / len(way.lengths),
}


@extractor(
    "goals_asked",
    needs={},
    parts=("goals", "odometry"),
    unit="",
    args={"what": one_of(", ".join(_REQUESTS), *_REQUESTS)},
)
def goals_asked(mission: Mission, args: Args) -> Value:
    """One number of what the goals ask for: `goals`, `path_length` (m, straight from goal to goal), `turn` (rad), and
    `goal_distance` and `goal_turn`, the same for each goal."""
    measure = _REQUESTS.get(str(args.get("what")))
    if measure is None:
        return Unavailable(f"there is no '{args.get('what')}' of goals", f"use one of {', '.join(_REQUESTS)}")
    way = mission.shared(requested_way)
    return way if isinstance(way, Unavailable) else measure(way)


def _length_m(mission: Mission) -> float | Unavailable:
    way = mission.shared(requested_way)
    if isinstance(way, Unavailable):
        return way
    length_m = float(way.lengths.sum())
    return length_m if length_m > 0 else Unavailable("the goals ask for no distance", "judge one that leads somewhere")


PER_GOAL = {"per": one_of("goal: for each goal that the mission asks for; in all unless given", "goal")}
PER_METRE = {"per": one_of("metre: for each metre of way that the goals ask for; in all unless given", "metre")}


def divided(compute: Callable[[Mission, Args], Value]) -> Callable[[Mission, Args], Value]:
    """A sum over the mission, for each metre or goal that it asks for where the argument `per` says so."""

    @wraps(compute)
    def answer(mission: Mission, args: Args) -> Value:
        value, per = compute(mission, args), args.get("per")
        if isinstance(value, Unavailable) or per is None:
            return value
        drive = mission.shared(window)
        amount = _length_m(mission) if per == "metre" else float(len(drive.listed) or len(drive.goals))
        return amount if isinstance(amount, Unavailable) else value / amount

    return answer
