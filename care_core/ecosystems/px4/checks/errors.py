"""Errors that the firmware repeats while the vehicle is armed: a driver whose part does not answer."""

from __future__ import annotations

from collections.abc import Iterator

from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.px4 import errors as repeated
from care_core.ecosystems.px4.flight import MESSAGES, Px4Flight
from care_core.logs.base import Wanted

READS: Wanted = {MESSAGES: ("level", "message")}
LIMITS = Limits(repeated.LIMITS)
_TRUE_P = LIMITS.add("probability of a part", 0.5, "", "a choice: of what no other check knows, nobody can tell")
_LOSES_P = LIMITS.add("probability that a mission fails with it", 0.3, "", "a choice: many a rover drives on")


def find(flight: Px4Flight) -> Iterator[Finding]:
    for span in flight.armed:
        error = repeated.most_repeated(flight, span)
        if error is not None:
            yield Finding(
                kind="software",
                title=f"the firmware repeats an error: {error.text}",
                onset_s=error.times[0],
                end_s=error.times[-1],
                severity="warning",
                evidence=f"{len(error.times)} times while armed",
                source=MESSAGES,
                probability=_TRUE_P,
                mission_lost=_LOSES_P,
            )
            return


CHECK = Check("errors", "an error that the firmware repeats while it is armed", READS, LIMITS, find)
