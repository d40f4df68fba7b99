"""States that the vehicle itself holds for wrong, from when they set in while it was armed."""

from __future__ import annotations

from typing import NamedTuple

from care_core.ecosystems.findings import Finding, FindingKind, Severity, SuspectKind
from care_core.ecosystems.px4.flight import Px4Flight
from care_core.ecosystems.spans import Span, seconds_in, unbroken
from care_core.logs.base import Table
from care_core.numbers import Bools, Floats
from care_core.records import Record
from care_core.text import times_until

_BLOW_S = 0.5
_SHORTEST_SHOWN_S = 0.05


class State(Record):
    """Something that can be wrong: the field that says so, and what a finding of it is (no kind: only an event)."""

    topic: str
    field: str
    means: str
    kind: FindingKind | None = None
    severity: Severity = "warning"
    suspect: SuspectKind = "hardware"
    probability: float = 0.5
    """That the part really failed, seeing this."""
    mission_lost: float | None = None
    """That a mission fails with it; None: as its severity says."""


class Episode(NamedTuple):
    """A state that set in while the vehicle was armed."""

    state: State
    start_s: float
    end_s: float
    """Of the last time."""
    text: str
    """What it was and for how long, or how often."""
    source: str
    lasts_s: float
    """All times together."""

    def finding(self) -> Finding | None:
        """The finding that it is, None where its state is only an event: a blow is no vibration."""
        if self.state.kind is None or (self.state.kind == "vibration" and self.lasts_s < _BLOW_S):
            return None
        return Finding(
            kind=self.state.kind,
            title=self.state.means,
            onset_s=self.start_s,
            end_s=self.end_s,
            severity=self.state.severity,
            evidence=f"{self.text}, by the vehicle's own check",
            source=self.source,
            suspect=self.state.suspect,
            probability=self.state.probability,
            mission_lost=self.state.mission_lost,
        )


def episode(
    flight: Px4Flight, table: Table, bad: Bools, state: State, source: str, at_least_s: float = 0.0
) -> Episode | None:
    """A state that set in while armed and lasted long enough. One that holds from its first record on was there before:
    a vehicle flown by a ground station alone never had a radio to lose."""
    first_s = table.t[0]
    spans = [
        (start, end)
        for start, end in _spans(table.t, bad)
        if end - start >= at_least_s and start > first_s and flight.began_armed(start)
    ]
    if not spans:
        return None
    start = spans[0][0]
    lasts_s = seconds_in(spans)
    lasting = (
        times_until(len(spans), spans[-1][0]) if len(spans) > 1
        else f" for {lasts_s:.1f} s" if lasts_s >= _SHORTEST_SHOWN_S
        else " for an instant"
    )  # fmt: skip
    return Episode(state, start, spans[-1][1], state.means + lasting, source, lasts_s)


def _spans(t: Floats, mask: Bools) -> list[Span]:
    """Spans in which a mask holds, each until the next row in which it does not."""
    return [(float(t[first]), float(t[min(last + 1, len(t) - 1)])) for first, last in unbroken(mask)]
