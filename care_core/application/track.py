"""Where a robot went, and the way that it was asked to go, in metres. Runs in worker threads; touches no widget."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

from care_core.application.open_run import OpenRun, log_of
from care_core.application.signals import Source, lines_of, settled_s, type_name, whole_of
from care_core.errors import CareError
from care_core.geodesy import offset_m
from care_core.records import Record, replace

if TYPE_CHECKING:
    from care_core.ecosystems.ros.goals import Goal
    from care_core.numbers import Floats

_GLOBAL = (
    ("POS", "Lat", "Lng", 1.0),
    ("GPS", "Lat", "Lng", 1.0),
    ("vehicle_global_position", "lat", "lon", 1.0),
    ("GLOBAL_POSITION_INT", "lat", "lon", 1e-7),
    ("GPS_RAW_INT", "lat", "lon", 1e-7),
)
"""Channels that hold a place on the globe, north and east, and what makes degrees of their numbers."""
_ITEMS = {
    "CMD": ("CNum", "Lat", "Lng"),
    "navigator_mission_item": ("sequence_current", "latitude", "longitude"),
}
"""Channels that hold a mission: number, latitude and longitude of its items, 0 where an item has no place."""
_ORIGIN = ("ref_lon", "ref_lat")
_LOCAL = (("vehicle_local_position", "y", "x"),)
_POSES = {
    "NavigateToPose_FeedbackMessage": ("feedback.current_pose.pose.position", "feedback.current_pose.header.frame_id"),
    "MoveBaseActionFeedback": ("feedback.base_position.pose.position", "feedback.base_position.header.frame_id"),
    "PoseWithCovarianceStamped": ("pose.pose.position", "header.frame_id"),
    "Odometry": ("pose.pose.position", "header.frame_id"),
}
"""Where messages of ROS say a position and its frame; those first that have that of the goals where odometry drifts."""
_MOST = 2000
"""Points of a track."""

Point = tuple[float, float]


class Way(Record):
    """A track and its legs as points (metres to the east, metres to the north), with the times of the track."""

    track: tuple[Point, ...]
    times_s: tuple[float, ...]
    legs: tuple[Point, ...] = ()
    """The way that was asked for, corner by corner; empty where the log does not say."""


def way_of(case: OpenRun) -> Way:
    """Where the robot went in the mission. What comes after a crash or a landing is left out where it leads away: it is
    where an estimator without a vehicle went. Raises CareError where the log does not say."""
    return _while_it_went(_recorded(case), settled_s(case.diagnosis))


def _while_it_went(way: Way, end_s: float) -> Way:
    went = [point for point, time_s in zip(way.track, way.times_s, strict=True) if time_s <= end_s]
    if len(went) < 2:
        return way
    (west, east), (south, north) = ((min(side), max(side)) for side in zip(*went, *way.legs, strict=True))
    kept = [
        (point, time_s)
        for point, time_s in zip(way.track, way.times_s, strict=True)
        if time_s <= end_s or (west <= point[0] <= east and south <= point[1] <= north)
    ]
    return replace(way, track=tuple(point for point, _ in kept), times_s=tuple(time_s for _, time_s in kept))


def _recorded(case: OpenRun) -> Way:
    span, present = whole_of(case), {channel.name: channel.type for channel in log_of(case).channels() if channel.count}
    for channel, north, east, degrees in _GLOBAL:
        found = _track(case, (channel, east), (channel, north), span) if channel in present else None
        placed = None if found is None else _placed(*found)
        if placed is not None:
            t, lng, lat = placed
            return _on_the_ground(t, lng * degrees, lat * degrees, _flown_to(case, present))
    for channel, x, y in _LOCAL:
        found = _track(case, (channel, x), (channel, y), span) if channel in present else None
        if found is not None:
            return _way(*found, _flown_from(case, present, channel))
    driven = _driven(case, present, span)
    if driven is not None:
        return driven
    raise CareError("The log does not say where the robot was.", hint="Record its position.")


def _track(case: OpenRun, x: Source, y: Source, span: tuple[float, float]) -> tuple[Floats, Floats, Floats] | None:
    import numpy as np

    lines = lines_of(case, (x, y), span)
    across, along = lines[x], lines[y]
    if across is None or along is None or len(across[1]) < 2 or len(across[1]) != len(along[1]):
        return None
    some = np.unique(np.linspace(0, len(across[0]) - 1, min(_MOST, len(across[0]))).astype(int))
    return across[0][some], across[1][some], along[1][some]


def _placed(t: Floats, lng: Floats, lat: Floats) -> tuple[Floats, Floats, Floats] | None:
    """A track without what stands at 0, 0, as a vehicle says that knows no place; None where nothing is left."""
    known = (lng != 0.0) | (lat != 0.0)
    return (t[known], lng[known], lat[known]) if known.sum() > 1 else None


def _on_the_ground(t: Floats, lng: Floats, lat: Floats, corners: tuple[Point, ...]) -> Way:
    """Degrees as metres from where the track begins."""
    home = float(lng[0]), float(lat[0])
    track = tuple(_metres(home, (float(east), float(north))) for east, north in zip(lng, lat, strict=True))
    legs = tuple(_metres(home, corner) for corner in corners)
    return Way(track, tuple(t.tolist()), ((0.0, 0.0), *legs) if legs else ())


def _metres(home: Point, place: Point) -> Point:
    """Metres east and north of home of a place, both in degrees, longitude first."""
    north, east = offset_m(home[::-1], place[1], place[0])
    return east, north


def _flown_from(case: OpenRun, present: Mapping[str, str], channel: str) -> tuple[Point, ...]:
    """The corners of a mission in metres from the origin of a local position of PX4, which names it in degrees."""
    table = log_of(case).read({channel: _ORIGIN}).get(channel)
    corners = _flown_to(case, present)
    if table is None or not corners or not set(_ORIGIN) <= set(table.columns):
        return ()
    origins = [(lng, lat) for lng, lat in zip(*(table[field].tolist() for field in _ORIGIN), strict=True)
               if math.isfinite(lng + lat)]  # fmt: skip
    return ((0.0, 0.0), *(_metres(origins[-1], corner) for corner in corners)) if origins else ()


def _flown_to(case: OpenRun, present: Mapping[str, str]) -> tuple[Point, ...]:
    """The corners of a mission in degrees, longitude first, each item once, as it was by the mission's end."""
    channel = next((name for name in _ITEMS if name in present), None)
    if channel is None:
        return ()
    fields, (_, end_s) = _ITEMS[channel], whole_of(case)
    table = log_of(case).read({channel: fields}).get(channel)
    if table is None or not set(fields) <= set(table.columns):
        return ()
    items = {
        int(number): (float(lng), float(lat))
        for time_s, number, lat, lng in zip(table.t, *(table[field] for field in fields), strict=True)
        if number and lat and lng and time_s <= end_s
    }
    return tuple(items[number] for number in sorted(items))


def _driven(case: OpenRun, present: Mapping[str, str], span: tuple[float, float]) -> Way | None:
    """The way of a ROS robot, with its goals where a source of its position has their frame."""
    goals = _goals(case)
    frame = goals[0].frame.strip("/") if goals else ""
    places = sorted(
        ((list(_POSES).index(kind), name, *_POSES[kind])
         for name, type in present.items() if (kind := type_name(type)) in _POSES)
    )  # fmt: skip
    drawn: Way | None = None
    for _, name, position, frame_field in places:
        found = _track(case, (name, f"{position}.x"), (name, f"{position}.y"), span)
        if found is not None and frame and _frame(case, name, frame_field) in ("", frame):
            return _way(*found, tuple((goal.x, goal.y) for goal in goals))
        if found is not None and drawn is None:
            drawn = _way(*found)
    return drawn


def _goals(case: OpenRun) -> tuple[Goal, ...]:
    """The goals that a ROS robot was sent to, in the order sent, of those with a place in one frame."""
    from care_core.ecosystems.registry import run_model
    from care_core.ecosystems.ros.drive import Drive
    from care_core.ecosystems.ros.measures.window import GOAL_SERVERS

    model, spec = run_model(log_of(case)), case.schema.mission if case.schema is not None else {}
    if not isinstance(model, Drive):
        return ()
    kinds = {kind: spec if spec.get("kind") == kind else {} for kind in GOAL_SERVERS}
    sent = (GOAL_SERVERS[kind].goals(model, own) for kind, own in kinds.items())
    placed = next(filter(None, (tuple(goal for goal in some if math.isfinite(goal.x + goal.y)) for some in sent)), ())
    return tuple(goal for goal in placed if goal.frame == placed[0].frame)


def _frame(case: OpenRun, channel: str, field: str) -> str:
    """The frame of a channel's positions, empty where it names none."""
    table = log_of(case).read({channel: (field,)}).get(channel)
    return str(table[field][0]).strip("/") if table is not None and field in table.columns and len(table) else ""


def _way(t: Floats, east: Floats, north: Floats, legs: tuple[Point, ...] = ()) -> Way:
    return Way(_points(east, north), tuple(t.tolist()), legs)


def _points(east: Floats, north: Floats) -> tuple[Point, ...]:
    return tuple((float(x), float(y)) for x, y in zip(east, north, strict=True))
