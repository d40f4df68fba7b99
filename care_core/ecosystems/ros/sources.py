"""The sources of a robot on ROS that vary while it drives, and what tells that it does.

In 110 recordings of healthy and failing drives odometry never repeats itself while its own speed is not 0, an IMU never
at all; a battery does for 9.5 s, a command for 15 s over 4 m (teleoperation) and 60 s on the spot (a recovery).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from care_core.ecosystems.base import Limits
from care_core.ecosystems.liveness import (
    WATCHED,
    Frozen,
    Live,
    Motion,
    least,
    longest_repetitions,
    numberless,
    ranged,
    repeats,
    turned,
)
from care_core.ecosystems.ros.messages import (
    BATTERY,
    HEIGHT,
    IMU,
    LOCALISED,
    MESSAGES,
    ODOMETRY,
    TWIST,
    TWIST_STAMPED,
    yaw_of,
)
from care_core.ecosystems.spans import Span
from care_core.logs.base import Table
from care_core.numbers import Floats

LIMITS = Limits()
_s = longest_repetitions(LIMITS, "any of 110 recordings repeats while the robot drives so far")
_WAY_M = LIMITS.add("way that shows in odometry, an IMU", 0.5, "m", "a choice: wheels resolve 1 cm")
_TURN_DEG = LIMITS.add("turn that shows in odometry, an IMU", 20.0, "deg", "a choice: they resolve 1 degree")
_FOUND_M = LIMITS.add("way that shows in a localisation", 2.0, "m", "ten times amcl's update_min_d")
_DRAWN_M = LIMITS.add("way that shows in a battery", 3.0, "m", "a choice: driving draws more than standing")
_CURVE_M = LIMITS.add("way of a curve that no controller drives", 3.0, "m", "a choice: it steers by what it sees")
_PLACE = ("pose.pose.position.x", "pose.pose.position.y")
_TURNED = tuple(f"pose.pose.orientation.{axis}" for axis in "xyzw")
_DRIVEN = least(_WAY_M, _TURN_DEG)
_STANDS_MPS, _STANDS_RADPS = 0.02, 0.05
_TWIST = MESSAGES[TWIST].reads

SOURCES = (
    Live(ODOMETRY, (*_PLACE, *_TURNED), "the odometry", "localisation", _s("odometry", 2.0), _DRIVEN),
    Live(IMU, MESSAGES[IMU].reads[1:], "the IMU", "imu", _s("IMU", 2.0), _DRIVEN),
    Live(LOCALISED, (*_PLACE, HEIGHT, *_TURNED), "the localisation", "localisation", _s("localisation", 5.0),
         least(way_m=_FOUND_M), records=3),
    Live(BATTERY, ("voltage", "current"), "the battery's monitor", "battery", _s("battery", 30.0),
         least(way_m=_DRAWN_M), is_optional=True, mission_lost=WATCHED),
    Live(BATTERY, ("current",), "the battery's current", "battery", _s("battery's current", 30.0),
         least(way_m=_DRAWN_M), is_optional=True, mission_lost=WATCHED),
    *(
        Live(kind, fields, "the command to the base", "commands", _s(f"command ({kind})", 10.0), least(way_m=_CURVE_M),
             is_optional=True)
        for kind, fields in ((TWIST, _TWIST), (TWIST_STAMPED, tuple(f"twist.{name}" for name in _TWIST)))
    ),
)  # fmt: skip
TYPES = tuple(dict.fromkeys(source.message for source in SOURCES))


def frozen(source: Live, topic: str, table: Table, others: Mapping[str, Table]) -> Iterator[Frozen]:
    """The stretches in which a topic says the same while others tell that the robot drove.

    Args:
        others: odometry and localisation of every other topic.
    """
    columns = [np.asarray(table[field], np.float64) for field in source.fields if field in table.columns]
    if len(columns) < min(2, len(source.fields)):
        return
    if source.message != BATTERY:  # many tell no current
        yield from (Frozen(source, topic, *one, None) for one in numberless(table.t, columns, source))
    for span, count in repeats(table.t, columns, source):
        if source.message in (TWIST, TWIST_STAMPED) and not _is_a_curve(source, table.between(*span)):
            continue
        motion = _motion(source, table.between(*span), others, span)
        if motion.reaches(source.moved):
            yield Frozen(source, topic, span, count, motion)


def _is_a_curve(source: Live, own: Table) -> bool:
    """Whether a command asks for a curve: straight on, and on the spot, robots drive for long."""
    speed, turn = float(own[source.fields[0]][0]), float(own[source.fields[2]][0])
    return abs(speed) > _STANDS_MPS and abs(turn) > _STANDS_RADPS


def _motion(source: Live, own: Table, others: Mapping[str, Table], span: Span) -> Motion:
    """How far the robot came in a span by others, and by the speed that odometry itself tells."""
    ways, turns = [0.0], [0.0]
    for table in (table.between(*span) for table in others.values()):
        if len(table) > 1 and {*_PLACE, *_TURNED} <= set(table.columns):
            ways.append(ranged(*(np.asarray(table[name], np.float64) for name in _PLACE)))
            turns.append(turned(np.degrees(yaw_of(table, "pose.pose.orientation"))))
    if source.message == ODOMETRY:
        speeds = [f"twist.twist.{name}" for name in ("linear.x", "linear.y", "angular.z")]
        if set(speeds) <= set(own.columns) and len(own) > 1:
            x, y, turn = (np.asarray(own[name], np.float64) for name in speeds)
            ways.append(_sum(own.t, np.where(np.hypot(x, y) > _STANDS_MPS, np.hypot(x, y), 0.0)))
            turns.append(float(np.degrees(_sum(own.t, np.where(np.abs(turn) > _STANDS_RADPS, np.abs(turn), 0.0)))))
    return Motion(max(ways), max(turns))


def _sum(t: Floats, rate: Floats) -> float:
    return float(np.nansum(rate[:-1] * np.diff(t)))
