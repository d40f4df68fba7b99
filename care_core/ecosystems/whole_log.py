"""A recording as it is, whatever robot made it: the whole of it as a mission, or the times at which a field has a
value, and extractors of any field of any channel.

They serve robots whose missions no other kind finds. What a field means, and its unit, the profile says.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np

from care_core.ecosystems.base import RunModel
from care_core.ecosystems.coverage import EXTREME, MEAN, Samples
from care_core.ecosystems.measures import MISSION_KINDS, Args, Mission, MissionKind, extractor, missing, numeric, one_of
from care_core.ecosystems.registry import ecosystem_of
from care_core.logs.base import Table, Wanted
from care_core.numbers import Floats, median, quantile
from care_core.records import replace
from care_core.run import Evidence, Unavailable, Value

KIND = "recording"
_FEWEST, _MOST, _STEADY = 10, 0.9, 3.0
"""Pauses that tell whether a channel comes steadily: nine in ten are below so many times the middle one."""
_WHOLE = "record the whole mission"
STATISTICS = ("mean", "min", "max", "std", "rms", "first", "last", "change")


class Recordings(MissionKind):
    """The recording from its beginning to its end, or each time that a field of a channel has a value."""

    name = KIND
    args: Mapping[str, str] = {
        "channel": "the channel that tells when a mission lasts; the whole recording is one unless given",
        "field": "the field of it that tells",
        "value": numeric("what the field says while a mission lasts"),
    }

    def needs(self, spec: Args) -> Wanted:
        return {str(spec["channel"]): (str(spec.get("field", "")),)} if "channel" in spec else {}

    def missions(self, model: RunModel, tables: Mapping[str, Table], spec: Args) -> tuple[Mission, ...]:
        """One mission a stretch of the value; one that lasts to the end of the recording has not ended."""
        if "channel" not in spec:
            return (Mission(model, tables, 0.0, model.log.duration_s, True, spec),)
        table = tables.get(str(spec["channel"]))
        values = None if table is None else _numbers(table, str(spec.get("field", "")))
        if table is None or values is None:
            return ()
        during = values == float(spec.get("value", 1.0))
        starts = np.flatnonzero(during & ~np.concatenate(([False], during[:-1])))
        missions = []
        for start in starts.tolist():
            after = np.flatnonzero(~during[start:])
            end_s = float(table.t[start + after[0]]) if len(after) else model.log.duration_s
            missions.append(Mission(model, tables, float(table.t[start]), end_s, bool(len(after)), spec))
        return tuple(missions)

    def mismatch(self, mission: Mission) -> str:
        return ""

    def evidence(self, mission: Mission) -> tuple[Evidence, ...]:
        return ()


def _numbers(table: Table, field: str) -> Floats | None:
    """A column as numbers, shape (n,); None where it is absent or holds none."""
    if field not in table.columns:
        return None
    column = table[field]
    if column.dtype == object:
        try:
            return np.array([float(value) for value in column])
        except (TypeError, ValueError):
            return None
    return np.asarray(column, dtype=np.float64)


@extractor("recorded_time", needs={}, parts=("channel",), unit="s")
def recorded_time(mission: Mission, args: Args) -> Value:
    """Length of the mission as its kind bounds it."""
    return mission.end_s - mission.start_s


@extractor("outcome", needs={}, parts=("outcome",), unit="")
def outcome(mission: Mission, args: Args) -> Value:
    """1 where the robot's own word is that all went well, 0 where anything did not: what its kind of mission is judged
    by without any limit."""
    kind = MISSION_KINDS.get(str(mission.spec.get("kind", "")))
    answers = [check.value for check in kind.outcome(mission)] if kind is not None else []
    if any(answer == 0 for answer in answers):
        return 0.0
    unknown = next((answer for answer in answers if isinstance(answer, Unavailable)), None)
    if not answers:
        return Unavailable("nothing in the log says how the mission came out", _WHOLE)
    return 1.0 if unknown is None else replace(unknown, hint=unknown.hint or _WHOLE)


def _signal_samples(mission: Mission, args: Args) -> Iterator[Samples]:
    """The messages of the mission in which the field is a number, of a channel that comes steadily."""
    channel, stat = str(args.get("channel", "")), str(args.get("stat", "mean"))
    table = mission.tables.get(channel)
    values = None if table is None else _numbers(table, str(args.get("field", "")))
    if table is None or values is None or not _comes_steadily(mission, channel, table):
        return
    start_s, end_s = mission.start_s, mission.end_s
    moments = {"first": [start_s], "last": [end_s], "change": [start_s, end_s]}.get(stat, [])
    bears = EXTREME if stat in ("min", "max") else MEAN
    t, dead = table.t[np.isfinite(values)], mission.model.repeats(channel)
    yield Samples(channel, t, () if moments else [(start_s, end_s)], bears, moments, dead)


def _comes_steadily(mission: Mission, channel: str, table: Table) -> bool:
    """Whether a channel sends all the time, so that its silence is a hole: most do, but not what tells of events."""
    pauses = np.diff(table.t)
    is_steady = len(pauses) >= _FEWEST and quantile(pauses, _MOST) <= _STEADY * float(median(pauses))
    return is_steady and not ecosystem_of(mission.model.log.format).speaks_at_times(mission.model.log, channel)


@extractor(
    "signal",
    needs=lambda args: {str(args["channel"]): (str(args.get("field", "")),)} if "channel" in args else {},
    parts=("channel",),
    unit="that of the field",
    args={
        "channel": "the topic or message",
        "field": "the field of it, dotted in ROS messages, such as twist.twist.linear.x",
        "stat": one_of(f"{', '.join(STATISTICS)} (last minus first); mean unless given", *STATISTICS),
        "scale": numeric("what the statistic is multiplied by, 1 unless given"),
        "offset": numeric("what is added then, 0 unless given"),
    },
    rests_on=_signal_samples,
)
def signal(mission: Mission, args: Args) -> Value:
    """A statistic of one number of a channel during the mission; values that are no numbers are left out."""
    channel, field = str(args.get("channel", "")), str(args.get("field", ""))
    table = mission.table(channel)
    if table is None or not len(table):
        return missing(channel)
    values = _numbers(table, field)
    if values is None:
        return Unavailable(f"{channel} has no number {field}", "look at its fields with 'care inspect'", channel)
    known = values[np.isfinite(values)]
    if not len(known):
        return Unavailable(f"{field} of {channel} is never a number", "check the sensor and its driver", channel)
    value = _statistic(known, str(args.get("stat", "mean")))
    return value * float(args.get("scale", 1.0)) + float(args.get("offset", 0.0))


def _statistic(values: Floats, stat: str) -> float:
    if stat == "rms":
        return math.sqrt(float(np.mean(values**2)))
    if stat == "change":
        return float(values[-1] - values[0])
    if stat in ("first", "last"):
        return float(values[0] if stat == "first" else values[-1])
    if stat in ("min", "max"):
        return float(values.min() if stat == "min" else values.max())
    return float(values.std() if stat == "std" else values.mean())


MISSION_KINDS[KIND] = Recordings()
