"""Whether sources live, and were recorded: a sensor that works varies while its vehicle moves, if only by its noise.

Bit-identical samples tell of a sensor, or its driver, that died and is read on. Some repeat themselves rightly: parked
vehicles, simulators without noise, batteries whose volts are rounded. So a source is called frozen only where another
one says that the vehicle moved meanwhile, and for far longer than it repeats itself otherwise.

What says nothing from first to last was never connected: that is told, and is no fault.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from care_core.ecosystems.base import Limits
from care_core.ecosystems.coverage import unseen, usual_pause
from care_core.ecosystems.findings import Finding, FindingKind, Severity
from care_core.ecosystems.lithium import HARMED_V, NO_CELL_V
from care_core.ecosystems.spans import Span, seconds_in, unbroken
from care_core.numbers import Floats, ascending, distinct, quantile
from care_core.records import Record

LIMITS = Limits()
_RECORDS = LIMITS.add("equal samples in a row", 10, "", "a choice: fewer may be chance, or a driver that reads twice")
_HABIT = LIMITS.add("times as long as it repeats itself usually", 10.0, "", "a choice: what is rounded repeats often")
_VARIED = LIMITS.add(
    "different samples besides", 10, "", "a choice: a part that is not fitted says one thing all along"
)
_MISSED = LIMITS.add("share of the time that was not recorded", 0.2, "", "a choice: checks say so where they saw less")
_SILENT_S = LIMITS.add("silence to the end of a flight", 5.0, "s", "EKF2: a height that is so old is given up")
_LASTS_S = LIMITS.add("shortest time of which this is said", 10.0, "s", "a choice: less is over before it is recorded")
ASIDE = LIMITS.add("probability that what nothing steers by costs the mission", 0.05, "", "a choice: failsafes read it")
WATCHED = LIMITS.add(
    "probability that a record of the battery or the outputs that stands still costs the mission", 0.01, "",
    "a choice: less than a parameter that nobody knows of; its failsafe has a finding of its own",
)  # fmt: skip
UNPOWERED_V = LIMITS.add(
    "most volts of a monitor without a pack", 2.5, "V", "a choice: 1 empty cell; loose inputs say 0.1 V"
)
_ONE_CELL_V = LIMITS.add(
    "one full cell", NO_CELL_V, "V", "voltages of lithium polymer cells, high voltage ones as well"
)
_TWO_CELLS_V = LIMITS.add(
    "two cells that lift a vehicle", 2 * HARMED_V, "V", "voltages of lithium polymer cells: 3 V ruin one"
)
_TWO_LOW_V = LIMITS.add("two cells that are nearly empty", 6.8, "V", "voltages of lithium polymer cells")
PROBABILITY = LIMITS.add("probability of a dead source", 0.9, "", "a choice: nothing else repeats to the last bit")

ZERO = "from first to last: it is not connected, not set up, or sees nothing"
"""Of a sensor that reads zero."""


class Motion(Record):
    """How far a vehicle came in a time, as others than the source in question tell: m, degrees, m up or down."""

    way_m: float = 0.0
    turn_deg: float = 0.0
    rise_m: float = 0.0

    def reaches(self, least: Motion) -> bool:
        """Whether it went as far, turned as much or rose as high."""
        return self.way_m >= least.way_m or self.turn_deg >= least.turn_deg or self.rise_m >= least.rise_m

    def __str__(self) -> str:
        parts = (
            (self.way_m, "went {:.0f} m"), (self.turn_deg, "turned by {:.0f} degrees"),
            (self.rise_m, "rose or sank by {:.0f} m"),
        )  # fmt: skip
        return " and ".join(words.format(size) for size, words in parts if size >= 1)


def least(way_m: float = math.inf, turn_deg: float = math.inf, rise_m: float = math.inf) -> Motion:
    """The motion of which any part shows in a source that lives."""
    return Motion(way_m, turn_deg, rise_m)


def longest_repetitions(limits: Limits, of: str) -> Callable[[str, float], float]:
    """Makes limits of how many seconds each source may repeat itself.

    Args:
        of: whose repetitions they are several times.
    """
    return lambda name, seconds: limits.add(
        f"longest repetition of the {name}", seconds, "s", f"a choice: several times what {of}"
    )


class Shows(NamedTuple):
    """The motion that shows in a vehicle's sources, whatever wrote the log."""

    place: Motion
    heading: Motion
    height: Motion
    any: Motion
    """In an attitude and in what it is made from."""


def motion_shown(limits: Limits) -> Shows:
    """The motion that shows in a vehicle's sources, as limits of the check that compares with it."""
    way_m = limits.add("way that shows in a position", 10.0, "m", "a choice: receivers resolve 1 cm")
    turn_deg = limits.add(
        "turn that shows in a compass, an attitude", 20.0, "deg", "a choice: they resolve 0.1 degrees"
    )
    rise_m = limits.add("rise that shows in an attitude", 5.0, "m", "a choice: still air moves a vehicle, too")
    rose_m = limits.add(
        "rise that shows in a barometer", 10.0, "m", "a choice: of estimates on the ground some rise 6 m"
    )
    height, whole = least(rise_m=rose_m), least(way_m, turn_deg, rise_m)
    return Shows(least(way_m=way_m), least(turn_deg=turn_deg), height, whole)


class Live(Record):
    """A source whose samples vary while its vehicle moves."""

    message: str
    """By today's name; of ROS, the type."""
    fields: tuple[str, ...]
    """What is compared: where any of them varies, it lives."""
    name: str
    """As a title has it: "the GPS"."""
    kind: FindingKind
    seconds: float
    """For how long it says the same at least."""
    moved: Motion
    """What others must tell meanwhile, any of it."""
    is_optional: bool = False
    """Whether saying one thing all along means that it is not fitted."""
    records: float = _RECORDS
    mission_lost: float | None = None
    """As of a finding; little where nothing steers by it."""


class Frozen(Record):
    """A source that said the same for a time, or nothing that is a number."""

    source: Live
    channel: str
    """The message or topic, with its number where it is not the first of its kind."""
    span: Span
    records: int
    motion: Motion | None
    """What others told meanwhile; None where it said no numbers."""


def repeats(t: Floats, columns: Sequence[NDArray[Any]], source: Live) -> Iterator[tuple[Span, int]]:
    """Stretches in which a source says the same for longer than it may, each with its number of samples.

    Args:
        t: times of the samples, shape (n,), ascending.
        columns: what they say, each of shape (n,). Samples that are no numbers say nothing.
    """
    says = ~np.all([np.isnan(column) for column in columns], axis=0)
    t, columns = t[says], [column[says] for column in columns]
    if len(t) < source.records:
        return
    if source.is_optional and max(len(distinct(column)) for column in columns) < _VARIED:
        return
    alike = np.all([(a[1:] == a[:-1]) | (np.isnan(a[1:]) & np.isnan(a[:-1])) for a in columns], axis=0)
    starts = np.flatnonzero(np.concatenate(([True], ~alike)))
    ends = np.append(starts[1:] - 1, len(t) - 1)
    lasts, counts = t[ends] - t[starts], ends - starts + 1
    for row in np.flatnonzero((lasts >= source.seconds) & (counts >= source.records)).tolist():
        others = np.delete(lasts, row)
        if not len(others) or lasts[row] >= _HABIT * quantile(others, 0.9):
            yield (float(t[starts[row]]), float(t[ends[row]])), int(counts[row])


def numberless(t: Floats, columns: Sequence[NDArray[Any]], source: Live) -> Iterator[tuple[Span, int]]:
    """Stretches in which a source that says numbers otherwise says none, each with its number of samples."""
    says_nothing = np.logical_or.reduce([~np.isfinite(column) for column in columns])
    if not says_nothing.any() or np.count_nonzero(~says_nothing) < source.records:
        return
    for start, end in unbroken(says_nothing):
        if end - start + 1 >= source.records and t[end] - t[start] >= source.seconds:
            yield (float(t[start]), float(t[end])), end - start + 1


def overlaps(span: Span, others: Iterable[Span], least_s: float) -> Iterator[Span]:
    """What others have in common with a span, where that is so long."""
    for start, end in others:
        common = max(span[0], start), min(span[1], end)
        if common[1] - common[0] >= least_s:
            yield common


def is_part(one: Frozen, known: Iterable[Frozen]) -> bool:
    """Whether it is told already of the whole of which a source is a part: a monitor, and its current."""
    return any(
        other.channel == one.channel
        and set(one.source.fields) < set(other.source.fields)
        and any(overlaps(one.span, [other.span], one.source.seconds))
        for other in known
    )


def findings(
    frozen: Iterable[Frozen], severity: Callable[[float], Severity] = lambda _onset_s: "warning"
) -> Iterator[Finding]:
    """What is said of sources that died: each once, from where it first did."""
    found: dict[tuple[str, str], list[Frozen]] = {}
    for one in frozen:
        found.setdefault((one.channel, f"{one.source.name} {one.motion is None}"), []).append(one)
    for (channel, _), stretches in found.items():
        first, source = stretches[0], stretches[0].source
        again = f", and {len(stretches) - 1} times more" if len(stretches) > 1 else ""
        lasted = f"in {first.records} records over {first.span[1] - first.span[0]:.0f} s (limit {source.seconds:g} s)"
        said = f"the same to the last digit {lasted}, while the vehicle {first.motion}{again}"
        yield Finding(
            kind=source.kind,
            title=f"{source.name} {'has no numbers' if first.motion is None else 'is frozen'}",
            onset_s=first.span[0],
            end_s=stretches[-1].span[1],
            severity="warning" if source.mission_lost is not None else severity(first.span[0]),
            evidence=f"no numbers {lasted}{again}" if first.motion is None else said,
            source=f"{channel}: {', '.join(source.fields)}",
            probability=PROBABILITY,
            mission_lost=source.mission_lost,
        )


def fell_silent(t: Floats, source: Live, spans: Sequence[Span]) -> Iterator[Finding]:
    """What is said of a source that stops for good while its vehicle goes on, and is in the log no more."""
    times = ascending(t)
    if len(times) < _RECORDS or not any(start < times[-1] < end for start, end in spans):
        return
    usual_s, end_s = float(np.median(np.diff(times))), spans[-1][1]
    quiet_s = end_s - float(times[-1])
    if quiet_s > max(_SILENT_S, _HABIT * usual_s):
        yield Finding(
            kind=source.kind,
            title=f"{source.name} falls silent",
            onset_s=float(times[-1]),
            end_s=end_s,
            severity="warning",
            evidence=f"nothing for the last {quiet_s:.0f} s, one every {usual_s:.2g} s before",
            source=source.message,
            probability=PROBABILITY,
        )


def recorded_in_part(sources: Mapping[str, Floats], spans: Sequence[Span]) -> Iterator[Finding]:
    """What is said of sources that checks saw only a part of: what they do not find, they do not rule out.

    Args:
        sources: when each was recorded, shape (n,), by its name.
        spans: when the vehicle was under way.
    """
    total_s = seconds_in(spans)
    parts = []
    for name, times in sources.items():
        t = ascending(times)
        seen_s = total_s - unseen(t, spans, usual_pause(t))
        if len(t) and seen_s < (1 - _MISSED) * total_s:
            parts.append((name, f"{seen_s:.0f} of {total_s:.0f} s"))
    if not parts or total_s < _LASTS_S:
        return
    one = f"{parts[0][0]} was recorded for {parts[0][1]}"
    several = ", ".join(f"{name} {time}" for name, time in parts)
    yield Finding(
        kind="log",
        title=one if len(parts) == 1 else f"{len(parts)} sources were recorded in part",
        onset_s=spans[0][0],
        end_s=spans[-1][1],
        severity="info",
        evidence=f"{f'{several}; ' if len(parts) > 1 else ''}of the rest no check can say that it was well",
        source=" and ".join(name for name, _ in parts),
        suspect="operation",
        probability=PROBABILITY,
    )


class Unconnected(Record):
    """A source that says nothing from first to last: nothing is connected to it, or it is switched off."""

    kind: FindingKind
    title: str
    evidence: str
    source: str
    """The message or topic, with its number where it is not the first of its kind."""


def unconnected(found: Iterable[Unconnected], end_s: float) -> Iterator[Finding]:
    """What is said of sources that say nothing all along: no part of it failed in this run."""
    for one in found:
        yield Finding(
            kind=one.kind,
            title=one.title,
            onset_s=0.0,
            end_s=end_s,
            severity="info",
            evidence=one.evidence,
            source=one.source,
            suspect="parameter",
            probability=PROBABILITY,
            mission_lost=ASIDE,
        )


def says_nothing(column: Floats, most: float = 0.0) -> bool:
    """Whether what a source says, shape (n,), never leaves 0 by more than so much; of a few samples nobody can tell."""
    known = column[np.isfinite(column)]
    return len(known) >= _RECORDS and float(np.abs(known).max()) <= most


def no_pack(volts: Floats, aloft: Floats) -> str:
    """Why a voltage is of no pack, in words; "" where it may be.

    Args:
        volts: all that the monitor says, shape (n,) in V.
        aloft: what it says while its multicopter flies; empty where it does not, or something else flies.
    """
    known = volts[np.isfinite(volts)]
    if says_nothing(known, UNPOWERED_V):
        return f"never more than {known.max():.1f} V, and no vehicle runs on that"
    flying = aloft[np.isfinite(aloft)]
    is_of_none = len(flying) >= _RECORDS and bool(np.all((flying > _ONE_CELL_V) & (flying < _TWO_CELLS_V)))
    if _rises_aloft(known, flying):
        return f"{known[0]:.2f} V at first and {flying[-1]:.2f} V in the air: no pack gains by flying"
    if not is_of_none or float(known.max()) >= _TWO_CELLS_V:
        return ""
    least = f"{flying.min():.1f} to {flying.max():.1f} V in the air"
    return f"{least}: one cell has {_ONE_CELL_V:g} V at most, and two lift nothing below {_TWO_CELLS_V:g} V"


def _rises_aloft(volts: Floats, aloft: Floats) -> bool:
    """Whether what two empty cells may have only grows, in the air, too."""
    few = max(len(aloft) // 10, 1)
    return (
        len(aloft) >= _RECORDS
        and _ONE_CELL_V < float(volts.min()) <= float(volts.max()) < _TWO_LOW_V
        and float(aloft.min()) >= float(volts[0])
        and float(aloft[-few:].mean()) > float(aloft[:few].mean())
    )


def turned(degrees: Floats) -> float:
    """The range of an angle, shape (n,) in degrees, over any number of turns."""
    known = degrees[np.isfinite(degrees)]
    return float(np.ptp(np.unwrap(known, period=360.0))) if len(known) else 0.0


def ranged(*columns: Floats) -> float:
    """The diagonal of what columns span together, 0 where they say nothing."""
    known = (column[np.isfinite(column)] for column in columns)
    return float(math.hypot(*(float(np.ptp(one)) if len(one) else 0.0 for one in known)))
