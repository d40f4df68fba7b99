"""The battery: its voltage drops further than its load explains, or is empty."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.findings import Finding, Severity
from care_core.ecosystems.ros import plan
from care_core.ecosystems.ros.checks.drive import obeys
from care_core.ecosystems.ros.recording import Battery, Recording
from care_core.numbers import median, quantile

DROP, DROP_IN_S = 0.08, 5.0
"""Share of the voltage lost within this time, with the load's own part taken out. A charged battery, lead-acid or
lithium, loses about a fifth from full to empty, over an hour. The largest step of 301 healthy missions: 0.1 %."""

MOVED_M, FROZEN = 1.0, 20
"""A robot that went so far drew more than one that stands, which so many messages would show."""


def check(recording: Recording) -> Iterator[Finding]:
    yield from _frozen(recording)
    for battery in recording.batteries:
        yield from _drops(recording, battery)


def _frozen(recording: Recording) -> Iterator[Finding]:
    """A battery that measures current, yet says the same throughout a drive. A voltage alone is a simple one's."""
    moves = recording.odometry is not None and np.ptp(recording.odometry.x) + np.ptp(recording.odometry.y) > MOVED_M
    for topic, table in recording.of(plan.BATTERY):
        columns = [np.asarray(table[name], np.float64) for name in plan.FIELDS[plan.BATTERY] if name in table.columns]
        if not moves or len(table) < FROZEN or len(columns) < 3 or not np.isfinite(columns[1]).all():
            continue
        if all(not np.isfinite(one).any() or np.ptp(one) == 0 for one in columns):
            yield Finding(
                "battery", "the battery says the same throughout: it measures nothing", 0.0, recording.duration_s,
                "info", f"{columns[0][0]:.3g} V and {columns[1][0]:.3g} A in {len(table)} messages on a drive",
                topic, probability=0.9,
            )  # fmt: skip


def _drops(recording: Recording, battery: Battery) -> Iterator[Finding]:
    t, open_circuit = battery.t, battery.voltage + _resistance(battery) * np.nan_to_num(battery.current)
    if len(t) < 10:
        return
    first = np.searchsorted(t, t - DROP_IN_S)
    fell = open_circuit[first] - open_circuit
    limit = DROP * float(median(battery.voltage[: max(5, len(t) // 20)]))
    for row in np.flatnonzero(fell > limit):
        after = open_circuit[row:]
        # A drop stays: one sample that reads low is a bad reading.
        if len(after) >= 5 and quantile(after, 0.8) < open_circuit[first[row]] - 0.7 * limit:
            steps = np.diff(open_circuit[first[row] : row + 1])
            at = float(t[first[row] + 1 + int(np.argmin(steps))])
            before, now = float(battery.voltage[first[row]]), float(median(battery.voltage[row : row + 5]))
            # A robot that drives on as commanded was not stopped by it.
            severity: Severity = "warning" if obeys(recording, at) else recording.severity(at, "critical")
            yield Finding(
                "battery", "the battery's voltage drops", at, float(t[-1]), severity,
                f"{before:.1f} V to {now:.1f} V within {max(float(t[row] - at), 1.0):.0f} s, more than its load"
                " explains",
                f"{battery.topic}; healthy missions fall by 0.1 % a second at most", probability=0.9,
            )  # fmt: skip
            return


def _resistance(battery: Battery) -> float:
    """Volt per ampere of the load, from how voltage and current change together; 0 where they do not."""
    step_v, step_a = np.diff(battery.voltage), np.diff(battery.current)
    known = np.isfinite(step_a) & (np.abs(step_a) > 0)
    if np.count_nonzero(known) < 10:
        return 0.0
    ratios = -step_v[known] / step_a[known]
    resistance = float(median(ratios[np.abs(step_a[known]) >= median(np.abs(step_a[known]))]))
    nominal = float(median(battery.voltage))
    return resistance if 0 < resistance < 0.1 * nominal else 0.0
