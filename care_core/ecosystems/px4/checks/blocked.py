"""A rover under PX4 that is driven and stands: it is blocked, or its motors do not answer."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.px4.errors import most_repeated
from care_core.ecosystems.px4.flight import MESSAGES, POSITION, ROVER, STATUS, Px4Flight
from care_core.ecosystems.spans import runs
from care_core.logs.base import Wanted

_MOTORS, _MOST = "actuator_motors", 4
READS: Wanted = {
    _MOTORS: tuple(f"control[{n}]" for n in range(_MOST)),
    POSITION: ("vx", "vy", "heading"),
    MESSAGES: ("level", "message"),
}
LIMITS = Limits()
_DRIVEN = LIMITS.add("least output of a motor", 0.15, "of the range", "a choice: below, friction holds a rover")
_STANDS_MS = LIMITS.add("speed of a rover that stands", 0.08, "m/s", "ArduPilot's Rover/crash_check.cpp; PX4 has none")
_TURNS_DPS = LIMITS.add("turn of a rover that stands", float(np.degrees(0.08)), "deg/s", "Rover/crash_check.cpp")
_LASTS_S = LIMITS.add("shortest time of it", 3.0, "s", "a choice: what starts against a slope takes a while")


def find(flight: Px4Flight) -> Iterator[Finding]:
    """The first time that it stood although its motors were driven."""
    motors, moved = flight.tables(READS).get(_MOTORS), flight.table(POSITION, "vx", "vy", "heading")
    if motors is None or moved is None or not len(motors) or len(moved) < 3:
        return
    outputs = [column for name, column in motors.columns.items() if name in READS[_MOTORS]]
    driven = np.max(np.abs(np.nan_to_num(outputs)), axis=0)
    speed = np.hypot(moved["vx"], moved["vy"])
    with np.errstate(divide="ignore", invalid="ignore"):  # damage gives records one time
        turn = np.abs(np.degrees(np.gradient(np.unwrap(np.nan_to_num(moved["heading"])), moved.t)))
    stands = (speed < _STANDS_MS) & (turn < _TURNS_DPS) & (np.interp(moved.t, motors.t, driven) > _DRIVEN)
    for start, end in runs(moved.t, stands):
        drives = flight.last(STATUS, "vehicle_type", start) == ROVER
        if drives and end - start >= _LASTS_S and any(a <= start and end <= b for a, b in flight.armed):
            yield _stood(flight, start, end, float(driven[(motors.t >= start) & (motors.t <= end)].max()))
            return


def _stood(flight: Px4Flight, start: float, end: float, most: float) -> Finding:
    said = most_repeated(flight, (start, end))
    return Finding(
        kind="blocked",
        title="the vehicle is driven and does not move",
        onset_s=start,
        end_s=end,
        severity="critical",
        evidence=(
            f"for {end - start:.0f} s below {_STANDS_MS:g} m/s at up to {most:.0%} of its motors' range"
            + (f"; meanwhile the firmware says: {said.shown}" if said else "")
        ),
        source=f"{_MOTORS}, {POSITION}",
        suspect="hardware" if said else "world",
    )


CHECK = Check("blocked", "a rover that is driven and does not move", READS, LIMITS, find)
