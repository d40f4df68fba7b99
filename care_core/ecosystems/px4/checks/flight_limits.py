"""A limit that somebody set, and a failsafe that broke the flight off at it.

As shipped there is none of these (commander_params.c): where one acts, its parameter was set for another flight, or
this one was too long, too windy or too poorly placed for it. Which of the two, only the operator can tell.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.px4.failsafes import rose_with
from care_core.ecosystems.px4.flight import FLAGS, STATUS, Px4Flight
from care_core.logs.base import Wanted


class _Limit(NamedTuple):
    """A flag of failsafe_flags (FailsafeFlags.msg), the parameter that sets it off, and what that means."""

    flag: str
    parameter: str
    unit: str
    title: str


_LIMITS = (
    _Limit("flight_time_limit_exceeded", "COM_FLT_TIME_MAX", "s", "its limit of flight time was reached"),
    _Limit("wind_limit_exceeded", "COM_WIND_MAX", "m/s", "the wind was above its limit"),
    _Limit("local_position_accuracy_low", "COM_POS_LOW_EPH", "m", "its position was less accurate than its limit"),
    _Limit("position_accuracy_low", "COM_POS_LOW_EPH", "m", "its position was less accurate than its limit"),
)
READS: Wanted = {FLAGS: tuple(one.flag for one in _LIMITS), STATUS: ("failsafe",)}
LIMITS = Limits()
_ACTED_P = LIMITS.add("probability of the limit", 0.95, "", "the firmware's own flag, as its failsafe acts")


def find(flight: Px4Flight) -> Iterator[Finding]:
    """The first failsafe of each armed time that acted on such a limit."""
    for span in flight.armed:
        acted_s = flight.first_s(STATUS, "failsafe", 1, span)
        limit = next((one for one in _LIMITS if acted_s is not None and rose_with(flight, one.flag, acted_s)), None)
        if acted_s is not None and limit is not None:
            value = flight.parameter(limit.parameter)
            known = "" if value is None else f"{limit.parameter} is {value:g} {limit.unit}: "
            yield Finding(
                kind="commands",
                title=limit.title,
                onset_s=acted_s,
                end_s=span[1],
                severity="critical",
                evidence=f"{known}the failsafe broke the flight off; the limit or the flight is wrong, and which only "
                "its operator can tell",
                source=f"{FLAGS}.{limit.flag}",
                suspect="parameter",
                probability=_ACTED_P,
                parameters=(limit.parameter,),
            )


CHECK = Check(
    "flight limits", "a limit of time, wind or accuracy at which a failsafe broke the flight off", READS, LIMITS, find
)
