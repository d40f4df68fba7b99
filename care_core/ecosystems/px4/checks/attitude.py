"""An attitude that leaves its demand in the air and comes back: what is lost for good is the crash check's."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.px4 import upset
from care_core.ecosystems.px4.attitude import Lean
from care_core.ecosystems.px4.flight import Px4Flight
from care_core.ecosystems.spans import Span, runs, seconds_in
from care_core.logs.base import Wanted

READS: Wanted = upset.READS
LIMITS = Limits()
_LASTS_S = LIMITS.add("shortest time off its demand, all in all", 1.0, "s", "a choice: flicks of a stick take less")
_CALM_S = LIMITS.add("pause that parts two such times", 5.0, "s", "a choice: what swings leaves it in turn")
_TUMBLES_DEG = LIMITS.add("off its demand in a tumble", 75.0, "deg", "a choice: no stick and no gust leads there")
_OFF_P = LIMITS.add("probability of a part, off its demand", 0.25, "", "a choice: gains and wind show alike")
_LEANS_S = LIMITS.add("time for which it leans before it ever flew", 3.0, "s", "a choice: a gust is over sooner")
_OVER_P = LIMITS.add(
    "probability of how it is set up, leaned over", 0.6, "", "a choice: rotors, outputs, gains, or a leg"
)


def find(flight: Px4Flight) -> Iterator[Finding]:
    """The first such time, with those that followed at once; or how it leaned over before it ever flew."""
    lean, lost = flight.lean, upset.lost_control(flight)
    if lean is None or lost is not None or not flight.hovers or not flight.armed:
        return
    yield from _leans_over(flight, lean)
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


def _leans_over(flight: Px4Flight, lean: Lean) -> Iterator[Finding]:
    """As it is to lift, in the first armed time, and stays so to its end."""
    start, end = flight.armed[0]
    standing = (lean.t >= start) & (lean.t <= end)
    off = np.nan_to_num(lean.error_deg) > upset.HELD_DEG
    span = next((one for one in runs(lean.t, off & standing) if end - one[1] < _LASTS_S), None)
    heights = None if span is None else flight.heights((start, end))
    if span is None or span[1] - span[0] < _LEANS_S or heights is None or not len(heights):
        return
    if float(np.max(heights["height"])) - float(heights["height"][0]) < upset.ALOFT_M:
        within = (lean.t >= span[0]) & (lean.t <= span[1])
        yield Finding(
            kind="attitude",
            title="it leaned over on the ground and did not lift",
            onset_s=span[0],
            end_s=span[1],
            severity="critical",
            evidence=f"up to {float(np.nanmax(lean.error_deg[within])):.0f} degrees off its demand for "
            f"{span[1] - span[0]:.0f} s, which its motors did not bring back",
            source="vehicle_attitude, vehicle_attitude_setpoint",
            suspect="parameter",
            probability=_OVER_P,
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
