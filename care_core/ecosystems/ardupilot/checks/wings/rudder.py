"""A plane that flies straight with a bank: its rudder is held over by its trim, and the ailerons hold against it.

Simulated planes bank by 0.07 to 0.09 degrees for each microsecond of the trim; with a right one by 2.3 at most.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.ardupilot.spans import Mask, during
from care_core.ecosystems.ardupilot.statistics import smooth
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.logs.base import Table, Wanted
from care_core.numbers import median
from care_core.run import shown

READS: Wanted = {
    "ATT": ("Roll", "Yaw"),
    "GPS": ("Spd",),
    "RCOU": tuple(f"C{n}" for n in range(1, 15)),
}
LIMITS = Limits()
_FLIES_MS = LIMITS.add("speed at which it flies on its wings", 12.0, "m/s", "a choice: a QuadPlane hovers slower")
_STRAIGHT_DPS = LIMITS.add("turn of what flies straight", 2.0, "deg/s", "a choice: a full turn takes three minutes")
_OVER_S = LIMITS.add("time over which the turn is taken", 2.0, "s", "a choice: gusts swing it faster")
_RECORDS = LIMITS.add("fewest records of straight flight", 20.0, "", "a choice: some seconds of it")
_BANK_DEG = LIMITS.add("bank of straight flight", 5.0, "deg", "twice what any simulated plane with a right trim has")
_FAR_DEG = LIMITS.add("bank that loses a mission", 20.0, "deg", "2 of 2 simulated planes; one of 15.5 flew its mission")
_OFF_US = LIMITS.add("trim off its default", 60.0, "us", "what banks it by 5 degrees")
_SURE = LIMITS.add("probability of the trim", 0.9, "", "it is measured")
_LOST = LIMITS.add("probability that a smaller bank loses the mission", 0.3, "", "a choice: its way is off in turns")
_NO_RATE_DPS = 1000.0
"""Where two records have one time: no straight flight."""
_RUDDER, _MIDDLE_US = 21, 1500.0
"""Function of the output (SRV_Channel.h), and what its trim is as shipped."""


def find(flight: Flight) -> Iterator[Finding]:
    leans, told = flight.one("ATT", "Roll", "Yaw"), flight.one("RCOU")
    output = next((n for n in range(1, 15) if flight.setting(f"SERVO{n}_FUNCTION") == _RUDDER), None)
    if not flight.is_winged or leans is None or told is None or output is None or f"C{output}" not in told.columns:
        return
    name = f"SERVO{output}_TRIM"
    trim, default = flight.setting(name), flight.default_left(name) or _MIDDLE_US
    straight = _straight(flight, leans)
    if trim is None or abs(trim - default) < _OFF_US or straight.sum() < _RECORDS:
        return
    bank = float(median(leans["Roll"][straight]))
    held = float(median(np.interp(leans.t[straight], told.t, told[f"C{output}"])))
    if abs(bank) < _BANK_DEG or abs(held - default) < _OFF_US:
        return
    is_far = abs(bank) > _FAR_DEG
    yield Finding(
        kind="surface",
        title="it flies straight with a bank: the rudder is held over",
        onset_s=float(leans.t[straight][0]),
        end_s=float(leans.t[straight][-1]),
        severity="critical" if is_far else "warning",
        evidence=(
            f"{bank:+.0f} deg of bank in straight flight (limit {_BANK_DEG:g}), with the rudder's output at "
            f"{held:.0f} us: {name} is {shown(trim)} (default {shown(default)})"
        ),
        source=f"ATT.Roll, ATT.Yaw, RCOU.C{output}",
        suspect="parameter",
        probability=_SURE,
        mission_lost=None if is_far else _LOST,
        parameters=(name,),
        wanted=((name, default),),
    )


def _straight(flight: Flight, leans: Table) -> Mask:
    """Where it flies on its wings and does not turn."""
    moved = flight.one("GPS", "Spd")
    if moved is None or len(leans) < _RECORDS:
        return np.zeros(len(leans), dtype=bool)
    t = leans.t
    with np.errstate(divide="ignore", invalid="ignore"):  # damage gives records one time
        rate = np.degrees(np.gradient(np.unwrap(np.radians(leans["Yaw"])), t))
    turn = smooth(t, np.where(np.isfinite(rate), rate, _NO_RATE_DPS), _OVER_S)
    flies = (np.interp(t, moved.t, moved["Spd"]) > _FLIES_MS) & during(flight.flown, t)
    return np.asarray(flies & (np.abs(turn) < _STRAIGHT_DPS))


CHECK = Check(
    "rudder", "a plane that flies straight with a bank, its rudder held over by its trim", READS, LIMITS, find
)
