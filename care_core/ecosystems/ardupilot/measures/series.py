"""Rows of a channel over a part of an ArduPilot run, and statistics of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from care_core.ecosystems.ardupilot.instances import split
from care_core.ecosystems.ardupilot.measures import rests
from care_core.ecosystems.ardupilot.measures.flown_mission import NEEDS
from care_core.ecosystems.ardupilot.measures.phases import PHASE_ARGS, flown_mission, span_of_phase
from care_core.ecosystems.measures import Args, Mission, extractor, missing
from care_core.ecosystems.statistic import STATISTIC, statistic
from care_core.logs.base import Table, Wanted, merge_needs
from care_core.numbers import Floats
from care_core.run import Unavailable, Value

MIN_ROWS = 5


def series(
    mission: Mission, channel: str, fields: Sequence[str], args: Args, *, under_way: bool = True
) -> Table | Unavailable:
    """Rows of a channel while under way (or in a phase), first instance only, with all of `fields` finite."""
    flown = flown_mission(mission)
    if isinstance(flown, Unavailable):
        return flown
    table = mission.table(channel)
    if table is None or not all(field in table.columns for field in fields):
        return missing(channel)
    table = next(iter(split(channel, table)), table)
    if "phase" in args:
        span = span_of_phase(mission, args)
        if isinstance(span, Unavailable):
            return span
        table = table.between(*span)
    elif under_way:
        if flown.track is None and flown.drive is None:
            return missing("POS")
        table = table.where(flown.under_way(table.t))
    finite = np.ones(len(table), dtype=bool)
    for field in fields:
        finite &= np.isfinite(table[field])
    table = table.where(finite)
    if len(table) < MIN_ROWS:
        return Unavailable(f"too little {channel} in this part of the flight", "was the vehicle under way?")
    return table


def register(
    name: str, wanted: Wanted, unit: str, doc: str, measure: Callable[[Table, Mission, Args], Floats],
    *, stat: str, args: Mapping[str, str] | None = None,
    columns: Callable[[Mission], Sequence[str]] | None = None,
) -> None:  # fmt: skip
    """Register an extractor that is a statistic of one channel over a part of the flight.

    Args:
        columns: which of the wanted fields this vehicle's log must have; all of them when None.
    """
    ((channel, fields),) = wanted.items()
    required = [field for field in fields if field not in ("I", "IMU", "C")]

    def compute(mission: Mission, given: Args) -> Value:
        table = series(mission, channel, required if columns is None else columns(mission), given)
        if isinstance(table, Unavailable):
            return table
        return statistic(measure(table, mission, given), str(given.get("stat", stat)))

    compute.__module__ = measure.__module__
    compute.__doc__ = f"{doc} Statistic: {stat} unless `stat` says otherwise."
    described = {"stat": STATISTIC, **PHASE_ARGS, **(args or {})}
    needed = rests.of(channel, *(required if columns is None else ()))
    extractor(name, needs=merge_needs((NEEDS, wanted)), unit=unit, args=described, rests_on=needed)(compute)
