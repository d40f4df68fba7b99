"""What only QuadPlanes do: they hover to take off and to land, go over to their wings, and let the lift motors help.

RATE, PSCN, PSCE and QTUN are recorded only while the lift motors run (ArduPlane/quadplane.cpp).
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.ardupilot.measures import rests
from care_core.ecosystems.ardupilot.measures.flown_mission import NEEDS
from care_core.ecosystems.ardupilot.measures.modes import flight_of
from care_core.ecosystems.ardupilot.measures.phases import flown_mission
from care_core.ecosystems.ardupilot.measures.samples import everything, samples
from care_core.ecosystems.ardupilot.measures.series import MIN_ROWS
from care_core.ecosystems.ardupilot.measures.winged import legs_flown
from care_core.ecosystems.coverage import USUAL, Samples
from care_core.ecosystems.measures import Args, Mission, extractor, missing, one_of
from care_core.ecosystems.spans import seconds_in
from care_core.ecosystems.statistic import statistic
from care_core.logs.base import Table, merge_needs
from care_core.numbers import Floats, median
from care_core.run import Unavailable, Value

_BEGINS = re.compile(r"Transition started")
_DONE = re.compile(r"Transition (?:FW )?done")
_RATES = {"roll": ("RDes", "R"), "pitch": ("PDes", "P"), "yaw": ("YDes", "Y")}
_STAT = one_of("mean, max, rms or peak (95th percentile)", "mean", "max", "rms", "peak")


def _rows(mission: Mission, channel: str, *fields: str) -> Table | Unavailable:
    """Rows of a channel in the air, with all of `fields` finite."""
    flown = flown_mission(mission)
    if isinstance(flown, Unavailable):
        return flown
    table = mission.table(channel)
    if table is None or not all(field in table.columns for field in fields):
        return missing(channel)
    wanted = flown.under_way(table.t) & np.logical_and.reduce([np.isfinite(table[field]) for field in fields])
    rows = table.where(wanted)
    return rows if len(rows) >= MIN_ROWS else Unavailable(f"too little {channel}: did it hover?")


@extractor(
    "hover_rate_error",
    needs=merge_needs((NEEDS, {"RATE": ("RDes", "R", "PDes", "P", "YDes", "Y")})),
    unit="deg/s",
    args={"axis": one_of("roll, pitch or yaw; roll unless given", *_RATES), "stat": _STAT},
)
def hover_rate_error(mission: Mission, args: Args) -> Value:
    """Wanted minus flown rotation rate of a QuadPlane while its lift motors run. Statistic: rms unless `stat` says
    otherwise."""
    wanted, flown = _RATES[str(args.get("axis", "roll"))]
    table = _rows(mission, "RATE", wanted, flown)
    if isinstance(table, Unavailable):
        return table
    return statistic(table[wanted] - table[flown], str(args.get("stat", "rms")))


@extractor(
    "hover_position_error",
    needs=merge_needs((NEEDS, {"PSCN": ("TPN", "PN"), "PSCE": ("TPE", "PE")})),
    unit="m",
    args={"stat": _STAT},
)
def hover_position_error(mission: Mission, args: Args) -> Value:
    """Wanted minus flown horizontal position of a QuadPlane in hover. Statistic: rms unless `stat` says otherwise."""
    off: list[Floats] = []
    for axis in "NE":
        table = _rows(mission, f"PSC{axis}", f"TP{axis}", f"P{axis}")
        if isinstance(table, Unavailable):
            return table
        off.append(table[f"TP{axis}"] - table[f"P{axis}"])
    count = min(map(len, off))
    return statistic(np.hypot(off[0][:count], off[1][:count]), str(args.get("stat", "rms")))


@extractor(
    "hover_height_error",
    needs=merge_needs((NEEDS, {"QTUN": ("DAlt", "Alt")})),
    unit="m",
    args={"stat": _STAT},
)
def hover_height_error(mission: Mission, args: Args) -> Value:
    """Wanted minus flown height of a QuadPlane in hover. Statistic: rms unless `stat` says otherwise."""
    table = _rows(mission, "QTUN", "DAlt", "Alt")
    if isinstance(table, Unavailable):
        return table
    return statistic(table["DAlt"] - table["Alt"], str(args.get("stat", "rms")))


@extractor("transition_time", needs=NEEDS, unit="s", rests_on=everything)
def transition_time(mission: Mission, args: Args) -> Value:
    """From the start of the first transition of a QuadPlane to its end, as it says."""
    flown = flown_mission(mission)
    if isinstance(flown, Unavailable):
        return flown
    texts = flight_of(mission).messages_between(mission.start_s, mission.end_s)
    begun = next((t for t, text in texts if _BEGINS.match(text)), None)
    done = next((t for t, text in texts if begun is not None and t > begun and _DONE.match(text)), None)
    if begun is None or done is None:
        return Unavailable("no transition was completed")
    return done - begun


def _on_legs(mission: Mission, args: Args) -> Iterator[Samples]:
    spans = legs_flown(mission)
    yield samples(mission, "CTUN", ("As",), () if isinstance(spans, Unavailable) else spans, USUAL)


@extractor("assisted", needs=merge_needs((NEEDS, {"RATE": ("R",), "CTUN": ("As",)})), unit="", rests_on=_on_legs)
def assisted(mission: Mission, args: Args) -> Value:
    """Share of the legs on which the lift motors of a QuadPlane ran."""
    spans = legs_flown(mission)
    if isinstance(spans, Unavailable):
        return spans
    table = mission.table("RATE")
    if table is None or len(table) < MIN_ROWS:
        return missing("RATE")
    helped = sum(((table.t >= start) & (table.t <= end)).sum() for start, end in spans)
    return float(min(helped * median(np.diff(table.t)) / seconds_in(spans), 1.0))


@extractor("landing_time", needs=NEEDS, unit="s", rests_on=rests.heights_of_phase)
def landing_time(mission: Mission, args: Args) -> Value:
    """From where the vehicle set out to land, or to return, to its disarming."""
    flown = flown_mission(mission)
    if isinstance(flown, Unavailable):
        return flown
    begun = flown.phases.get(("return_climb", 0))
    return Unavailable("it never set out to land") if begun is None else mission.end_s - begun.start_s
