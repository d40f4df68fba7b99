"""Motors that were driven while the vehicle did not stir: a bench run without propellers, or one that is held down.

What lifts, shakes. A copter that stands as still as before while its motors have a throttle that would lift it has no
propellers, or stands under a load that it cannot move; its controllers then wind up against an error that nothing
corrects, and what its outputs ask of each motor says nothing of the motors.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.ardupilot.statistics import lasting
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.spans import Span, during
from care_core.logs.base import Table, Wanted
from care_core.numbers import Floats

READS: Wanted = {"ATT": ("Roll", "Pitch"), "CTUN": ("ThO",), "BARO": ("Alt",)}
LIMITS = Limits()
_LIFTING = LIMITS.add("throttle that lifts", 0.2, "", "a choice: armed motors idle below it")
_LASTS_S = LIMITS.add("shortest time of driving", 3.0, "s", "a choice: a touch of the stick is over sooner")
_WINDOW_S = LIMITS.add("window in which it is to stir", 2.0, "s", "a choice: gyros drift by less in it")
_STIRS_DEG = LIMITS.add("change of lean of what stirs", 1.5, "deg", "a choice: what hovers sways by more")
_RISES_M = LIMITS.add("rise of what may fly", 2.0, "m", "a choice: barometers drift by a metre")
_FEWEST = 4
_NOTED_P = LIMITS.add("probability that it costs a mission", 0.0, "", "it says how the run was made")


def find(flight: Flight) -> Iterator[Finding]:
    """One note, which says how the run was made and blames nothing."""
    span = unmoved(flight)
    if span is None or flight.throttle is None:
        return
    t, throttle = flight.throttle
    most = float(np.max(throttle[(t >= span[0]) & (t <= span[1])]))
    yield Finding(
        kind="thrust",
        title="its motors were driven, and it did not stir",
        onset_s=span[0],
        end_s=span[1],
        severity="info",
        evidence=(
            f"its lean changed by less than {_STIRS_DEG:g} degrees at up to {100 * most:.0f}% throttle: "
            "without propellers, or held down"
        ),
        source="ATT, CTUN.ThO, BARO.Alt",
        suspect="operation",
        probability=_NOTED_P,
    )


def unmoved(flight: Flight) -> Span | None:
    """When a copter's motors were to lift it and nothing of it stirred; None where it did, or the log tells too little.
    A simulator's ground holds what stands on it."""
    attitude, driven = flight.one("ATT", "Roll", "Pitch"), flight.throttle
    if not flight.is_copter or flight.kind == "heli" or flight.is_simulated or attitude is None or driven is None:
        return None
    t, throttle = driven
    spans = lasting(t, (throttle > _LIFTING) & during(flight.armed, t), _LASTS_S)
    if not spans or any(_stirs(attitude.between(*span)) for span in spans) or _rises(flight, spans):
        return None
    return spans[0][0], spans[-1][1]


def _stirs(attitude: Table) -> bool:
    """Whether its lean changes within any window, or is told too seldom to know."""
    windows = ((attitude.t - attitude.t[0]) // _WINDOW_S).astype(int) if len(attitude) else np.empty(0, dtype=int)
    told = np.bincount(windows) if len(windows) else np.zeros(1)
    if float(np.max(told)) < _FEWEST:
        return True
    return any(_ranged(attitude[name], windows) > _STIRS_DEG for name in ("Roll", "Pitch"))


def _ranged(angle: Floats, windows: np.ndarray) -> float:
    """The greatest range of an angle in a window."""
    edges = np.flatnonzero(np.diff(windows, prepend=-1))
    return float(np.max(np.maximum.reduceat(angle, edges) - np.minimum.reduceat(angle, edges)))


def _rises(flight: Flight, spans: list[Span]) -> bool:
    """Whether its barometer, or where there is none its height, tells of more than a drift."""
    table = flight.one("BARO", "Alt")
    height = flight.height if table is None else (table.t, table["Alt"])
    if height is None:
        return True
    inside = height[1][during(spans, height[0])]
    return len(inside) < 2 or float(np.ptp(inside)) > _RISES_M


CHECK = Check("bench", "motors that were driven while nothing stirred", READS, LIMITS, find)
