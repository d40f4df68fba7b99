"""The battery: its voltage drops further than its load explains, or it measures nothing."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.ros.checks.drive import obeys
from care_core.ecosystems.ros.drive import Drive
from care_core.ecosystems.ros.messages import BATTERY, COMMANDS, GOALS, ODOMETRY, reading
from care_core.ecosystems.ros.sensors import Battery
from care_core.numbers import median, quantile

LIMITS = Limits()
DROP = LIMITS.add(
    "share of the voltage lost", 0.08, "",
    "a charged battery loses a fifth from full to empty, over an hour; the largest step of 301 healthy missions: 0.1%",
)  # fmt: skip
DROP_IN_S = LIMITS.add("time in which it is lost", 5.0, "s", "healthy missions fall by 0.1% a second at most")
STAYS = LIMITS.add("share of the drop that stays", 0.7, "", "one sample that reads low is a bad reading")
STAYS_SAMPLES = LIMITS.add("samples after a drop", 5, "", "fewer do not show that it stays")
STAYS_SHARE = LIMITS.add("share of later samples that stay low", 0.8, "", "a load that goes is no drop")
SAMPLES = LIMITS.add("samples of a battery", 10, "", "fewer tell no trend")
MOVED_M = LIMITS.add("way of a drive", 1.0, "m", "a robot that went so far drew more than one that stands")
FROZEN = LIMITS.add("messages of a frozen battery", 20, "", "so many on a drive would show a change")
CHANGES = LIMITS.add("changes of current", 10, "", "fewer do not tell the battery's resistance")
RESISTANCE = LIMITS.add("share of the voltage that an ampere takes", 0.1, "", "more is no resistance of a battery")


def find(drive: Drive) -> Iterator[Finding]:
    """Batteries that are frozen, and voltages that drop."""
    yield from _frozen(drive)
    for battery in drive.batteries:
        yield from _drops(drive, battery)


def _frozen(drive: Drive) -> Iterator[Finding]:
    """A battery that measures current, yet says the same throughout a drive. A voltage alone is a simple one's."""
    moves = drive.odometry is not None and np.ptp(drive.odometry.x) + np.ptp(drive.odometry.y) > MOVED_M
    fields = ("voltage", "current", "percentage")
    for topic, table in drive.of(BATTERY):
        columns = [np.asarray(table[name], np.float64) for name in fields if name in table.columns]
        if not moves or len(table) < FROZEN or len(columns) < len(fields) or not np.isfinite(columns[1]).all():
            continue
        if all(not np.isfinite(column).any() or np.ptp(column) == 0 for column in columns):
            yield Finding(
                kind="battery",
                title="the battery reports the same values throughout: it measures nothing",
                onset_s=0.0,
                end_s=drive.duration_s,
                severity="info",
                evidence=f"{columns[0][0]:.3g} V and {columns[1][0]:.3g} A in {len(table)} messages on a drive",
                source=topic,
                probability=0.9,
            )


def _drops(drive: Drive, battery: Battery) -> Iterator[Finding]:
    t, open_circuit = battery.t, battery.voltage + _resistance(battery) * np.nan_to_num(battery.drawn)
    if len(t) < SAMPLES:
        return
    first = np.searchsorted(t, t - DROP_IN_S)
    fell = open_circuit[first] - open_circuit
    limit = DROP * float(median(battery.voltage[: max(5, len(t) // 20)]))
    for row in np.flatnonzero(fell > limit):
        after = open_circuit[row:]
        if len(after) < STAYS_SAMPLES or quantile(after, STAYS_SHARE) >= open_circuit[first[row]] - STAYS * limit:
            continue
        steps = np.diff(open_circuit[first[row] : row + 1])
        at = float(t[first[row] + 1 + int(np.argmin(steps))])
        before, now = float(battery.voltage[first[row]]), float(median(battery.voltage[row : row + 5]))
        took_s = max(float(t[row] - at), 1.0)
        yield Finding(
            kind="battery",
            title="the battery's voltage drops",
            onset_s=at,
            end_s=float(t[-1]),
            # A robot that drives on as commanded was not stopped by it.
            severity="warning" if obeys(drive, at) else drive.severity(at, "critical"),
            evidence=f"{before:.1f} V to {now:.1f} V within {took_s:.0f} s, more than its load explains",
            source=f"{battery.topic}; healthy missions fall by 0.1% a second at most",
            probability=0.9,
        )
        return


def _resistance(battery: Battery) -> float:
    """Volt per ampere of the load, from how voltage and current change together; 0 where they do not."""
    step_v, step_a = np.diff(battery.voltage), np.diff(battery.drawn)
    known = np.isfinite(step_a) & (np.abs(step_a) > 0)
    if np.count_nonzero(known) < CHANGES:
        return 0.0
    ratios = -step_v[known] / step_a[known]
    resistance = float(median(ratios[np.abs(step_a[known]) >= median(np.abs(step_a[known]))]))
    return resistance if 0 < resistance < RESISTANCE * float(median(battery.voltage)) else 0.0


READS = reading(BATTERY, ODOMETRY, *COMMANDS, *GOALS)
CHECK = Check("battery", "a voltage that drops more than its load explains, a frozen battery", READS, LIMITS, find)
