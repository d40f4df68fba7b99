"""A robot that carries parcels down a corridor under Nav2, as recordings, with what a diagnosis should find.

Its time is the way over `max_vel_x`, longer with a timid `inflation_radius`; a goal tolerance below `SETTLES_M` keeps
it hunting until the goal is aborted. `rate` and `samples` do nothing.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from tests.ros_drives import ABORTED, BATTERY, LOG, ODOMETRY, STATUS, SUCCEEDED, TWIST, Drive, _battery, _status, _twist
from tests.ros_samples import ROS2, SECOND_NS, START_NS, McapFile, cdr, make, stamp

WAY_M = 8.0
SETTLES_M = 0.1
EVENT = "rcl_interfaces/msg/ParameterEvent"
SPEED = "/controller_server.FollowPath.max_vel_x"
INFLATION = "/controller_server.inflation_layer.inflation_radius"
TOLERANCE = "/controller_server.goal_checker.xy_goal_tolerance"
USUAL = {SPEED: 0.5, INFLATION: 0.5, TOLERANCE: 0.25, "/controller_server.rate": 20, "/controller_server.samples": 12}
BESIDE: dict[str, float | str | bool] = {
    "/controller_server.use_sim_time": False,
    "/controller_server.base_frame": "base_link",
}
"""Beside what is tuned: what is none of an operator's business."""


def configured(rng: np.random.Generator) -> dict[str, float]:
    """A configuration drawn at random."""
    return {
        SPEED: float(rng.uniform(0.2, 1.0)),
        INFLATION: float(rng.uniform(0.2, 1.0)),
        TOLERANCE: float(rng.choice([0.05, 0.2, 0.3, 0.4])),
        "/controller_server.rate": int(rng.integers(10, 30)),
        "/controller_server.samples": int(rng.integers(5, 20)),
    }


def deliver(path: Path, config: dict[str, float], rng: np.random.Generator, said: str = "") -> Path:
    """Drive one mission and write its recording."""
    speed = config[SPEED] * (1 - 0.3 * (config[INFLATION] - 0.5))
    arrives = config[TOLERANCE] >= SETTLES_M
    takes_s = WAY_M / speed * float(rng.normal(1.0, 0.02)) + (0.0 if arrives else 10.0)
    drive = Drive()
    messages: list[tuple[str, str, float, Any]] = [
        ("/parameter_events", EVENT, 0.1, event(config)),
        ("/navigate_to_pose/_action/status", STATUS, 0.5, _status(2)),
        ("/navigate_to_pose/_action/status", STATUS, 0.5 + takes_s, _status(SUCCEEDED if arrives else ABORTED)),
        ("/rosout", LOG, 0.2, make(ROS2, LOG, stamp(ROS2, START_NS), 20, "planner", said or "ready", "", "", 0)),
    ]
    for t in np.arange(0.0, takes_s + 2.0, 0.25).tolist():
        moving = 0.5 <= t <= 0.5 + takes_s and drive.x < WAY_M
        drive.x += 0.25 * speed * moving
        messages.append(("/odom", ODOMETRY, t, drive._odometry(t, speed * moving, 0.01 * float(rng.normal()))))
        messages.append(("/cmd_vel", TWIST, t, _twist(config[SPEED] * moving, 0.0)))
        amps = 1.0 + 2.0 * speed * moving + 0.01 * float(rng.normal())
        messages.append(("/battery_state", BATTERY, t, _battery(24.0 - 0.001 * t - 0.05 * amps, -amps)))
    with McapFile(path) as log:
        for topic, kind, time_s, message in sorted(messages, key=lambda one: one[2]):
            log.add(topic, kind, START_NS + round(time_s * SECOND_NS), cdr(message))
    return path


def event(config: dict[str, float]) -> Any:
    """The parameters of /controller_server as it tells them when it starts."""
    given: dict[str, float | str | bool] = {**config, **BESIDE}
    set_ = [_parameter(name.partition(".")[2], value) for name, value in given.items()]
    return make(ROS2, EVENT, stamp(ROS2, START_NS), "/controller_server", set_, [], [])


def _parameter(name: str, value: float | str | bool) -> Any:
    kind = 1 if isinstance(value, bool) else 2 if isinstance(value, int) else 3 if isinstance(value, float) else 4
    none: tuple[Any, ...] = (
        np.empty(0, np.uint8),
        np.empty(0, bool),
        np.empty(0, np.int64),
        np.empty(0, np.float64),
        [],
    )
    given = (value if kind == 1 else False, value if kind == 2 else 0, value if kind == 3 else 0.0,
             value if kind == 4 else "")  # fmt: skip
    held = make(ROS2, "rcl_interfaces/msg/ParameterValue", kind, *given, *none)
    return make(ROS2, "rcl_interfaces/msg/Parameter", name, held)
