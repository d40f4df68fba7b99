"""A mode that needs a position, asked for where the vehicle knows none: the firmware falls back to another one."""

from __future__ import annotations

import math
from collections.abc import Iterator

from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import NO_POSITION_FOR, Finding
from care_core.ecosystems.px4 import failsafes
from care_core.ecosystems.px4.flight import FLAGS, SAID_WITHIN_S, STATUS, Px4Flight
from care_core.ecosystems.vehicles import mode_name
from care_core.logs.base import Wanted, merge_needs

READS: Wanted = merge_needs((failsafes.READS, {STATUS: ("failsafe",), FLAGS: ("attitude_invalid",)}))
LIMITS = Limits()
_SURE_P = LIMITS.add("probability that the mode was the mistake", 0.9, "", "the firmware's own flags, up all along")
_UNKNOWN = {"local_position_invalid": "no local position", "global_position_invalid": "no global position"}


def find(flight: Px4Flight) -> Iterator[Finding]:
    """The first failsafe that acted on such a mode, of a position that was never known before."""
    for span in flight.armed:
        acted_s = flight.first_s(STATUS, "failsafe", 1, span)
        intended = None if acted_s is None else flight.last(STATUS, failsafes.INTENDED, acted_s)
        if acted_s is None or intended is None:
            continue
        lacks = [
            words
            for flag, words in _UNKNOWN.items()
            if flight.last(FLAGS, flag, acted_s) == 1
            and flight.last(FLAGS, "attitude_invalid", acted_s) != 1  # what lacks that lacks more than a position
            and not flight.ever(FLAGS, flag, 0, (-math.inf, acted_s + SAID_WITHIN_S))
            and failsafes.matters(flight, flag, acted_s)
        ]
        if lacks:
            fallback = flight.last(STATUS, "nav_state", acted_s)
            yield Finding(
                kind="software",
                title=f"{mode_name('px4', int(intended))}{NO_POSITION_FOR}",
                onset_s=acted_s,
                end_s=span[1],
                severity="critical",
                evidence=f"the firmware says {lacks[0]} from the first record on"
                + ("" if fallback is None else f", and falls back to {mode_name('px4', int(fallback))}"),
                source=f"{FLAGS}, {STATUS}.{failsafes.INTENDED}",
                suspect="operation",
                probability=_SURE_P,
            )
            return


CHECK = Check("unplaced", "a mode that needs a position where none is known", READS, LIMITS, find)
