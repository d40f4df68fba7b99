"""A barometer that came to be noisy."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.px4.flight import Px4Flight
from care_core.logs.base import Wanted
from care_core.numbers import median

_TOPIC, _HEIGHT = "vehicle_air_data", "baro_alt_meter"
READS: Wanted = {_TOPIC: (_HEIGHT,)}
LIMITS = Limits()
_ROUGHER = LIMITS.add("noise over that before arming", 3.5, "", "a real quadcopter's propellers make it 2.3")
_ROUGH_M = LIMITS.add("noise", 0.5, "m", "second differences of sound ones have a middle of 0.05 to 0.8 m")
_WINDOW = LIMITS.add("heights over which noise is taken", 25, "", "a choice: five seconds of a usual log")
_STAYS = LIMITS.add("share of the flight after it", 0.7, "", "a choice: a broken sensor stays so, a gust does not")
_TRUE_P = LIMITS.add("probability that it is so", 0.9, "", "training flights: 4 of 4, and none of 450 without")
_LOSES_P = LIMITS.add("probability that a mission fails with it", 0.3, "", "training flights: 1 of 5")


def find(flight: Px4Flight) -> Iterator[Finding]:
    table = flight.table(_TOPIC, _HEIGHT)
    if table is None or not flight.armed:
        return
    armed_s = flight.armed[0][0]
    width = int(_WINDOW)
    rough = np.abs(np.diff(table[_HEIGHT], 2))
    t = table.t[2:]
    if int(np.count_nonzero(t < armed_s)) < width or int(np.count_nonzero(t >= armed_s)) < width:
        return
    usual_m = float(median(rough[t < armed_s]))
    noise = median(sliding_window_view(rough, width), axis=1)
    at = t[width - 1 :]
    bad = (noise > max(_ROUGHER * usual_m, _ROUGH_M)) & (at >= armed_s)
    if not bad.any() or bad[(first := int(np.argmax(bad))) :].mean() < _STAYS:
        return
    value = float(median(noise[first:]))
    yield Finding(
        kind="barometer",
        title="the barometer is noisy",
        onset_s=float(t[first + width // 2]),
        end_s=float(t[-1]),
        severity="warning",
        evidence=f"its heights jump by {value:.1f} m from one to the next, by {usual_m:.1f} m before arming",
        source=f"{_TOPIC}.{_HEIGHT}",
        probability=_TRUE_P,
        mission_lost=_LOSES_P,
    )


CHECK = Check("barometer", "a barometer that came to be noisy", READS, LIMITS, find)
