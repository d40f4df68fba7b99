"""Motors that lose their power in the air: lift is asked for, the battery gives no current any more, and it falls."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.px4 import motors, upset
from care_core.ecosystems.px4.flight import Px4Flight
from care_core.ecosystems.spans import inside, runs
from care_core.logs.base import Wanted, merge_needs

_BATTERY = "battery_status"
READS: Wanted = merge_needs((motors.READS, upset.READS, {_BATTERY: ("current_a",)}))
LIMITS = Limits()
_ASKS = LIMITS.add("output of the hardest motor", 0.5, "of the range", "a choice: lift is asked for, or balance")
_DRAWS = LIMITS.add("current while it lifts", 5.0, "A", "a choice: less is hardly measured")
_NOTHING = LIMITS.add("current of motors without power", 1.0, "A", "a choice: the autopilot draws that, too")
_LASTS_S = LIMITS.add("shortest time without current", 0.3, "s", "half a metre of fall")
_SOON_S = LIMITS.add("time from that to the fall", 1.0, "s", "a choice: a current is told a few times a second")
_TRUE_P = LIMITS.add("probability that the power was lost", 0.9, "", "physics: lift takes power")


def find(flight: Px4Flight) -> Iterator[Finding]:
    """The first such time."""
    battery, asked = flight.table(_BATTERY, "current_a"), motors.commands(flight)
    felt = flight.table(upset.COMBINED, *upset.FORCES)
    if battery is None or asked is None or felt is None or not flight.hovers:
        return
    t, amps = battery.t, np.nan_to_num(battery["current_a"])
    hardest = np.interp(t, asked.t, np.nan_to_num(asked.share.max(axis=0)))
    lifts = inside(flight.armed, t) & (hardest > _ASKS) & (t < min(flight.kills, default=np.inf))
    force = upset.force_of(felt)
    for since, until in runs(t, lifts & (amps < _NOTHING)):
        falls = force[(felt.t >= since) & (felt.t <= since + _SOON_S)]
        before = amps[(t < since) & (t >= since - _SOON_S)]
        drew = float(before.max()) if len(before) else 0.0
        if drew > _DRAWS and until - since >= _LASTS_S and len(falls) and float(falls.min()) < upset.FALLING:
            most = float(hardest[(t >= since) & (t <= until)].max())
            yield Finding(
                kind="thrust",
                title="the motors lost their power in the air",
                onset_s=since,
                end_s=until,
                severity="critical",
                evidence=(
                    f"{drew:.0f} A, then {amps[t == since][0]:.1f} A for {until - since:.1f} s while a motor is asked "
                    f"for {most:.0%}, and it falls: the battery's plug, the wiring or the controllers' supply"
                ),
                source=f"{_BATTERY}.current_a, {upset.COMBINED}, actuator_motors or actuator_outputs",
                probability=_TRUE_P,
            )
            return


CHECK = Check("power", "motors that lose their power in the air", READS, LIMITS, find)
