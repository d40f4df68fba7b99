"""What the past says: trends of the objectives, and whether fixes worked as often as promised."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path

from care_core.history.store import Triaged, Verified
from care_core.outputs import REMOVE_HINT, write_output
from care_core.records import Record

EDGES = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)
"""Promises are compared with outcomes in these bins of probability."""

RECORD_FILE = "VERIFIED_FIXES.md"
"""The model card is the training's, and the same model gives the same card: what came after has its own file."""

_BLOCKS = "▁▂▃▄▅▆▇█"
_ASCII = "_.-~=*#@"


class Bin(Record):
    """Fixes promised at about the same probability: how many, the mean promise, how many worked."""

    low: float
    high: float
    count: int
    promised: float
    worked: int


class TrackRecord(Record):
    """Of the fixes that were promised and really made, how many worked."""

    count: int
    worked: int
    expected: float
    """How many should have worked, by the promises."""
    bins: tuple[Bin, ...]


def track_record(verified: Iterable[Verified]) -> TrackRecord:
    """Promises against outcomes; verifications that settle nothing are left out."""
    settled = [one for one in verified if one.worked is not None]
    bins = []
    for low, high in pairwise(EDGES):
        inside = [one for one in settled if low <= one.p_fixed < high or (high == EDGES[-1] and one.p_fixed == high)]
        if inside:
            promised = sum(one.p_fixed for one in inside) / len(inside)
            bins.append(Bin(low, high, len(inside), promised, sum(bool(one.worked) for one in inside)))
    return TrackRecord(
        len(settled), sum(bool(one.worked) for one in settled), sum(one.p_fixed for one in settled), tuple(bins)
    )


def trends(triages: Sequence[Triaged]) -> Mapping[str, tuple[float, ...]]:
    """The known values of every objective, oldest first; `triages` come newest first."""
    found: dict[str, list[float]] = {}
    for triaged in reversed(triages):
        for objective in triaged.document.get("objectives", ()):
            value = objective.get("value")
            series = found.setdefault(str(objective.get("name")), [])
            if isinstance(value, (int, float)) and math.isfinite(value):
                series.append(float(value))
    return {name: tuple(values) for name, values in found.items()}


def sparkline(values: Sequence[float], *, ascii: bool = False) -> str:
    """The values as one character each, lowest to highest; equal values lie in the middle."""
    if not values:
        return ""
    marks = _ASCII if ascii else _BLOCKS
    low, high = min(values), max(values)
    if high <= low:
        return marks[len(marks) // 2 - 1] * len(values)
    return "".join(marks[round((value - low) / (high - low) * (len(marks) - 1))] for value in values)


def write_record(folder: Path, record: TrackRecord) -> Path:
    """Write the verified outcomes into a file of their own beside the model card. Returns it.

    Raises:
        UsageError: the folder may not be written to.
    """
    path = folder / RECORD_FILE
    write_output(path, _as_markdown(record), hint=REMOVE_HINT)
    return path


def _as_markdown(record: TrackRecord) -> str:
    lines = [
        "# Verified fixes",
        "",
        f"Of {record.count} fixes that were made and verified after the next run, {record.worked} worked; the"
        f" probabilities promised {record.expected:.1f}.",
        "",
        "| promised | fixes | mean promise | worked |",
        "|---|---|---|---|",
        *(f"| {b.low:.0%} to {b.high:.0%} | {b.count} | {b.promised:.0%} | {b.worked} |" for b in record.bins),
    ]
    return "\n".join(lines) + "\n"
