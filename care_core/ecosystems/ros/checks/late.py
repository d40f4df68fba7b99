"""Messages of a sensor that come late: a link that holds them back, and sends them in a burst."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.plausible import STAMP
from care_core.ecosystems.ros.checks.topics import stalls
from care_core.ecosystems.ros.drive import Drive
from care_core.ecosystems.ros.messages import STAMPED, reading
from care_core.ecosystems.ros.motion import MOSTLY, PUNCTUAL_S
from care_core.logs.base import Table
from care_core.numbers import quantile
from care_core.records import replace

LIMITS = Limits()
LATE_S = LIMITS.add("lateness beyond the usual", 1.0, "s", "Nav2 and amcl keep no transform longer back than a second")
MOST_S = LIMITS.add("largest lateness", 2.0, "s", "a choice: of 50 healthy missions under load the largest was 2.6 s")
LATE = LIMITS.add("messages that are late", 10, "", "at most 4 of 50 healthy missions under load")
LIMITS.add("share that comes in time", MOSTLY, "", "else the two clocks run apart")


class Lateness(NamedTuple):
    """How late a topic's messages came, beyond what is usual for it."""

    topic: str
    start_s: float
    end_s: float
    late: int
    messages: int
    most_s: float


def find(drive: Drive) -> Iterator[Finding]:
    """Sensors whose messages come late. Where several topics stall that is told, and says more."""
    found = [one for topic, table in drive.of(*STAMPED) if (one := _late(topic, table)) is not None]
    if not found or stalls(drive):
        return
    worst = max(found, key=lambda one: one.most_s)
    others = [one.topic for one in found if one is not worst]
    finding = Finding(
        kind="radio",
        title=f"{worst.topic} comes up to {worst.most_s:.1f} s late, in bursts",
        onset_s=min(one.start_s for one in found),
        end_s=max(one.end_s for one in found),
        severity=drive.severity(worst.start_s),
        evidence=f"{worst.late} of {worst.messages} messages are more than {LATE_S:g} s later than usual",
        source=f"{worst.topic}: header.stamp against times of recording",
        suspect="operation",
        probability=0.7,
    )
    yield replace(finding, evidence=f"{finding.evidence}; {', '.join(others)} as well") if others else finding


def _late(topic: str, table: Table) -> Lateness | None:
    """None where its clock is not the recorder's, was set, or few messages are late."""
    stamp = np.asarray(table.columns.get(STAMP, ()), np.float64)
    if not len(stamp) or not np.isfinite(stamp).all() or not np.ptp(stamp):
        return None
    late = table.t - stamp
    beyond = late - quantile(late, 0.1)
    rows = np.flatnonzero(beyond > LATE_S)
    is_set = bool(beyond[-1] > LATE_S)
    if is_set or len(rows) < LATE or beyond.max() < MOST_S or float(np.mean(beyond < PUNCTUAL_S)) < MOSTLY:
        return None
    start_s, end_s = float(stamp[rows[0]] + table.t[0] - stamp[0]), float(table.t[rows[-1]])
    return Lateness(topic, max(0.0, start_s), end_s, len(rows), len(stamp), float(beyond.max()))


CHECK = Check("late", "sensors whose messages are held back and come in bursts", reading(*STAMPED), LIMITS, find)
