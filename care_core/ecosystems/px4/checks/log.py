"""A log that ends while the vehicle is in the air: power was lost there, it came down, or the recording was stopped."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.px4 import upset
from care_core.ecosystems.px4.flight import LANDED, POSITION, Px4Flight
from care_core.logs.base import Wanted
from care_core.numbers import median

READS: Wanted = {POSITION: ("z", "vz"), LANDED: ("landed",)}
LIMITS = Limits()
_HIGH_M = LIMITS.add("height in the air", 2.0, "m", "a choice: estimates drift by less")
_SINKS_MS = LIMITS.add("descent that is told", 3.0, "m/s", "a fall from half a metre; MPC_LAND_SPEED is 0.7")
_LAST_S = LIMITS.add("end of the log over which it is taken", 0.5, "s", "a choice: what tumbles falls unsteadily")
_ENDS_P = LIMITS.add("probability that power was lost", 0.2, "", "a choice: mostly somebody stopped the recording")


def find(flight: Px4Flight) -> Iterator[Finding]:
    """One finding, where nothing says that it was lost or down before."""
    position = flight.table(POSITION, "z", "vz")
    if not flight.ends_armed or position is None or upset.hit(flight) is not None:
        return
    start_s, end_s = flight.armed[-1]
    height_m = flight.height_m(end_s)
    on_ground = flight.last(LANDED, "landed", end_s) != 0
    last = position.between(max(start_s, position.t[-1] - _LAST_S), np.inf)
    if on_ground or height_m is None or height_m < _HIGH_M or not len(last):
        return
    sinks = float(median(np.nan_to_num(last["vz"])))
    yield Finding(
        kind="log",
        title="the log ends in the air",
        onset_s=end_s,
        end_s=end_s,
        severity="warning",
        evidence=f"armed {height_m:.0f} m up"
        + (f", coming down at {sinks:.1f} m/s" if sinks > _SINKS_MS else "")
        + " at the last record: power was lost, it hit the ground, or the recording was stopped",
        source=f"{POSITION}.z, vz; {LANDED}",
        probability=_ENDS_P,
    )


CHECK = Check("log", "an end of the log in the air", READS, LIMITS, find)
