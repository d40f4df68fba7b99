"""Parameters that somebody changed in flight, and those after which the vehicle was upset: ArduPilot and PX4 alike.

What flew well until a parameter was changed, and was upset within seconds, was most likely upset by it. A change with
nothing after it is an event and no more.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

from care_core.ecosystems.base import Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.spans import Span, within
from care_core.ecosystems.timeline import is_telemetry_rate
from care_core.ecosystems.vehicles import Motor, is_self_written, switched_off
from care_core.ecosystems.vehicles.self_written import SIMULATOR_PREFIX
from care_core.run import Setting, shown
from care_core.text import listed, log_time

LIMITS = Limits()
SOON_S = LIMITS.add(
    "time from a change to the upset", 10.0, "s", "a choice: control loops answer within seconds, an integrator in ten"
)
_PROBABILITY_P = LIMITS.add(
    "probability that it did it",
    0.9,
    "",
    "all 5 flights at hand that were upset so soon after a change were upset by it",
)
_NAMED = 3
_IDLE = re.compile(
    r"(LOG|SR\d|NTF|CAM\d?|MNT\d?|GCS|SDLOG|SYSID|MIS|RALLY|OSD\d?|VTX|ADSB|STAT|LGR|GRIP|SCR|SERIAL\d|MAV|RTL|"
    r"FENCE|GF|BATT\d?|BAT\d?|NAV|COM)_"
)
"""Beginnings of parameters that move no vehicle at once: logs, cameras, links, and what a failsafe or a mission may
use later."""


class Change(NamedTuple):
    """A parameter that was changed in flight."""

    time_s: float
    name: str
    before: float | str
    after: float | str

    def __str__(self) -> str:
        return f"{self.name} from {shown(self.before)} to {shown(self.after)}"


class Upset(NamedTuple):
    """A time at which the vehicle did what nobody asked for, and what, in a clause."""

    time_s: float
    what: str


def changes(settings: Mapping[str, tuple[Setting, ...]], flown: Sequence[Span]) -> list[Change]:
    """The changes in the air of what somebody chose, in order of time."""
    found = []
    for name, history in settings.items():
        if is_self_written(name) or is_telemetry_rate(name) or name.startswith(SIMULATOR_PREFIX) or _IDLE.match(name):
            continue
        for before, after in pairwise(history):
            t = after.changed_at_s
            if t is not None and math.isfinite(t) and before.value != after.value and within(flown, t):
                found.append(Change(t, name, before.value, after.value))
    return sorted(found)


def find(
    changed: Sequence[Change], upsets: Iterable[Upset], motors: Sequence[Motor], *, is_lost: bool, source: str
) -> Iterator[Finding]:
    """A finding for the changes before each upset. What was upset already when it was changed was not upset by that.

    Args:
        upsets: in any order.
        is_lost: whether the flight ended in it.
        source: which messages tell of the changes.
    """
    left, troubled_s, explained_s = list(changed), -math.inf, -math.inf
    for upset in sorted(upsets):
        soon = [one for one in left if upset.time_s - SOON_S <= one.time_s <= upset.time_s]
        left = [one for one in left if one not in soon]
        standing = list(_standing([one for one in soon if one.time_s > troubled_s + SOON_S]))
        if standing:
            explained_s = upset.time_s
            yield _finding(standing, upset, motors, is_lost=is_lost, source=source)
        elif upset.time_s > explained_s + SOON_S:
            troubled_s = upset.time_s


def _standing(several: Sequence[Change]) -> Iterator[Change]:
    """Changes of each parameter as one, without what was put back."""
    for name in dict.fromkeys(one.name for one in several):
        own = [one for one in several if one.name == name]
        if own[0].before != own[-1].after:
            yield own[0]._replace(after=own[-1].after)


def _finding(
    several: Sequence[Change], upset: Upset, motors: Sequence[Motor], *, is_lost: bool, source: str
) -> Finding:
    names = [one.name for one in several]
    named = listed(names if len(names) <= _NAMED else [*names[: _NAMED - 1], f"{len(names) - _NAMED + 1} more"])
    stopped = [n for one in several if (n := switched_off(one.name, one.before, one.after)) is not None]
    places = {motor.number: f" ({motor.place})" for motor in motors if motor.place}
    off = listed([f"motor {n}{places.get(n, '')}" for n in stopped])
    since_s, later_s = several[0].time_s, upset.time_s - several[-1].time_s
    told = [f"{one}{f' at {log_time(one.time_s)}' if len(several) > 1 else ''}" for one in several[:_NAMED]]
    back = ", ".join(f"'param set {one.name} {shown(one.before)}'" for one in several[:_NAMED])
    return Finding(
        kind="tuning",
        title=f"{named} {'was' if len(names) == 1 else 'were'} changed in flight"
        + (f", which switched {off} off" if off else ""),
        onset_s=since_s,
        end_s=max(upset.time_s, several[-1].time_s),
        severity="critical" if is_lost else "warning",
        evidence=f"{'; '.join(told)}; {upset.what} {later_s:.1f} s later "
        f"({log_time(upset.time_s)}). To put it back: {back}",
        source=source,
        suspect="parameter",
        probability=_PROBABILITY_P,
        parameters=tuple(names),
        wanted=tuple((one.name, float(one.before)) for one in several if isinstance(one.before, (int, float))),
    )
