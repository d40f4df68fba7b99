"""An attitude that leaves its demand in the air and comes back: what is lost for good is the crash check's."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.px4 import upset
from care_core.ecosystems.px4.flight import Px4Flight
from care_core.ecosystems.spans import Span, runs, seconds_in
from care_core.logs.base import Wanted

READS: Wanted = upset.READS
LIMITS = Limits()
_LASTS_S = LIMITS.add("shortest time off its demand, all in all", 1.0, "s", "a choice: flicks of a stick take less")
_CALM_S = LIMITS.add("pause that parts two such times", 5.0, "s", "a choice: what swings leaves it in turn")
_TUMBLES_DEG = LIMITS.add("off its demand in a tumble", 75.0, "deg", "a choice: no stick and no gust leads there")
_OFF_P = LIMITS.add("probability of a part, off its demand", 0.25, "", "a choice: gains and wind show alike")


def find(flight: Px4Flight) -> Iterator[Finding]:
    """The first such time, with those that followed at once."""
    lean, lost = flight.lean, upset.lost_control(flight)
    if lean is None or lost is not None or not flight.hovers:
        return
    off = np.nan_to_num(lean.error_deg) > upset.LEFT_DEG
    spans = [span for span in runs(lean.t, off) if upset.is_aloft(flight, span[0])]
    left = next((together for together in _groups(spans) if seconds_in(together) >= _LASTS_S), None)
    if left is None:
        return
    start, end = left[0][0], left[-1][1]
    most = float(np.nanmax(lean.error_deg[(lean.t >= start) & (lean.t <= end)]))
    tumbled = most > _TUMBLES_DEG
    yield Finding(
        kind="attitude",
        title="it tumbled in the air and caught itself" if tumbled else "the attitude does not follow its demand",
        onset_s=start,
        end_s=end,
        severity="critical" if tumbled else "warning",
        evidence=f"up to {most:.0f} degrees off it (limit {upset.LEFT_DEG:g}) in {end - start:.1f} s; it came back",
        source="vehicle_attitude, vehicle_attitude_setpoint",
        probability=_OFF_P,
    )


def _groups(spans: Sequence[Span]) -> Iterator[list[Span]]:
    """Spans that follow each other within the pause, together."""
    group: list[Span] = []
    for span in spans:
        if group and span[0] - group[-1][1] > _CALM_S:
            yield group
            group = []
        group.append(span)
    if group:
        yield group


CHECK = Check("attitude", "an attitude that leaves its demand in the air and comes back", READS, LIMITS, find)
