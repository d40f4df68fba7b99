"""Extractors of a laser scanner, sensor_msgs/LaserScan."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.coverage import EXTREME, Samples
from care_core.ecosystems.measures import Args, Mission, extractor, has, missing
from care_core.run import Unavailable, Value

SCAN = "/scan"
_FIELDS = ("ranges", "range_min", "range_max")


def _scans(mission: Mission, args: Args) -> Iterator[Samples]:
    """The scans of the whole mission."""
    channel = str(args.get("channel", SCAN))
    if channel in mission.tables:
        yield Samples(f"the laser ({channel})", mission.tables[channel].t, [(mission.start_s, mission.end_s)], EXTREME)


@extractor(
    "obstacle_distance",
    needs=lambda args: {str(args.get("channel", SCAN)): _FIELDS},
    unit="m",
    args={"channel": "topic of sensor_msgs/LaserScan, /scan unless given"},
    rests_on=_scans,
)
def obstacle_distance(mission: Mission, args: Args) -> Value:
    """The smallest distance that the scanner measured, from itself; rays outside its own limits are none."""
    channel = str(args.get("channel", SCAN))
    table = mission.table(channel)
    if not has(table, *_FIELDS):
        return missing(channel)
    nearest = [_nearest(*scan) for scan in zip(*(table[name] for name in _FIELDS), strict=True)]
    known = [distance for distance in nearest if distance is not None]
    return min(known) if known else Unavailable("no ray hit anything", "check the scanner", channel)


def _nearest(ranges: object, least: float, most: float) -> float | None:
    distances = np.asarray(ranges, np.float64)
    valid = distances[np.isfinite(distances) & (distances >= least) & (distances <= most)]
    return float(valid.min()) if len(valid) else None
