"""Events of a timeline put together: repeats told once, changes of parameters, gaps and damage, order and length."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise

import numpy as np

from care_core.ecosystems.findings import Event
from care_core.ecosystems.spans import Span, within
from care_core.ecosystems.vehicles import is_self_written
from care_core.logs.base import Table
from care_core.numbers import Floats, ascending, distinct, median, pauses
from care_core.run import Damage, Setting, shown
from care_core.text import but_for_numbers, first_of, times_until

MOST = 40
"""Lines of a timeline; of a longer one the least telling are left out."""

_KEPT_LONGEST = ("vehicle", "crash", "failsafe", "arming", "error", "log", "flight", "battery", "gps", "radio", "mode",
                 "parameter", "event", "message", "mission")  # fmt: skip
_AT_ONCE = ("vehicle", "crash", "failsafe", "error", "event", "arming", "battery", "gps", "radio", "mode", "flight",
            "mission", "message", "parameter", "log")  # fmt: skip
"""Kinds of events as they stand where several happen at once: what happened before what followed from it."""

_TELLING = re.compile(
    r"fail|error|lost|loss|crash|glitch|variance|unhealthy|not healthy|inconsistent|critical|low\b|emergency|reset"
    r"|lane|switch|breach|stop|clip|vibration|brown|watchdog|internal|overload|timeout|refus|denied|aborted|warn"
    r"|bad\b|yaw imbalance|thrust|terminat|parachute|EKF|compass|battery|land",
    re.IGNORECASE,
)
_CHANGES_NAMED = 4
_TELEMETRY_RATE = re.compile(
    r"SR\d+_|MAV\d*_(\w*RATE|RAW_SENS|EXT_STAT|RC_CHAN|RAW_CTRL|POSITION|EXTRA\d|PARAMS|ADSB)\b"
)
"""Rates that ground stations set by themselves when they connect."""
_PAUSE_S, _GAP_MEDIANS, _IDLE_S = 2.0, 20.0, 60.0
_CLEARLY = 3.0
"""Where so many times as many steps as fit into a span would be too long, more than half of them are not."""
_SWITCHED_WITHIN_S = 2.0


def timeline_of(events: Iterable[Event], introduction: Event, most: int = MOST) -> tuple[Event, ...]:
    """A timeline: the introduction, then everything in order of time, the most telling where there is too much."""
    return (introduction, *_kept(sorted(events, key=_place), most - 1))


def repeats(events: Sequence[Event]) -> Iterator[Event]:
    """Events that differ in nothing but numbers as one, with their count and when the last one was."""
    groups: dict[tuple[str, str], list[Event]] = {}
    for event in events:
        groups.setdefault((event.kind, but_for_numbers(event.text)), []).append(event)
    for several in groups.values():
        first = several[0]
        again = times_until(len(several), several[-1].time_s)
        yield Event(first.time_s, first.kind, first.text + again, first.source)


def parameter_changes(
    settings: Mapping[str, tuple[Setting, ...]], armed: Sequence[Span], source: str
) -> Iterator[Event]:
    """Parameters changed while armed one by one, those changed on the ground together."""
    ground: dict[str, tuple[float, str]] = {}
    for name, history in settings.items():
        if is_self_written(name) or is_telemetry_rate(name):
            continue
        for before, after in pairwise(history):
            t = after.changed_at_s
            if t is None or not math.isfinite(t):
                continue
            change = f"from {shown(before.value)} to {shown(after.value)}"
            if within(armed, t):
                yield Event(t, "parameter", f"{name} changed {change} while armed", source)
            else:
                ground[name] = (ground.get(name, (t,))[0], f"{name} {change}")
    if ground:
        named = sorted(ground.values())
        what = "parameter changed" if len(named) == 1 else f"{len(named)} parameters changed"
        text = f"{what} while disarmed: {first_of([change for _, change in named], _CHANGES_NAMED)}"
        yield Event(named[0][0], "parameter", text, source)


def is_telemetry_rate(name: str) -> bool:
    """Whether a ground station sets a parameter by itself, for the rate of what it is sent."""
    return _TELEMETRY_RATE.match(name) is not None


def gaps(tables: Iterable[Table], armed: Sequence[Span]) -> Iterator[Event]:
    """The longest time in which nothing at all was recorded while armed, and while disarmed if it is long."""
    told = [table for table in tables if len(table) > _GAP_MEDIANS]
    starts, ends = pauses(map(_known, told), _PAUSE_S)
    limit = max(_PAUSE_S, _GAP_MEDIANS * _usual_step(told)) if len(starts) else _PAUSE_S
    edges = [edge for span in armed for edge in span]  # a log may be written while armed only
    flown, idle = [], []
    for low, high in zip(starts.tolist(), ends.tolist(), strict=True):
        if high - low <= limit:
            continue
        is_switch = any(low - _SWITCHED_WITHIN_S <= edge <= high + _SWITCHED_WITHIN_S for edge in edges)
        if within(armed, low) and within(armed, high) and not is_switch:
            flown.append((low, high))
        elif high - low > _IDLE_S:
            idle.append((low, high))
    for lasted, when in ((flown, " while armed"), (idle, "")):
        if lasted:
            start, end = max(lasted, key=lambda pause: pause[1] - pause[0])
            more = f", the longest of {len(lasted)} gaps" if len(lasted) > 1 else ""
            yield Event(start, "log", f"nothing is recorded for {end - start:.1f} s{when}{more}", "the log")


def _known(table: Table) -> Floats:
    t = table.t
    known = np.isfinite(t)
    return t if known.all() else t[known]


def _usual_step(tables: Sequence[Table]) -> float:
    """Median step of all times together; 0 where it is clearly too short to matter, which the longest series says. The
    times of a large log are looked at one message after the other."""
    first_s, last_s, longest, count = math.inf, -math.inf, 0, 0
    for t in map(_known, tables):
        if len(t):
            first_s, last_s = min(first_s, float(np.min(t))), max(last_s, float(np.max(t)))
        if len(t) > longest:
            ordered = ascending(t)
            longest, count = len(t), int(np.count_nonzero(ordered[1:] != ordered[:-1]))
    if count * _PAUSE_S / _GAP_MEDIANS > _CLEARLY * (last_s - first_s):
        return 0.0
    steps = np.diff(distinct(np.concatenate([np.empty(0), *map(_known, tables)])))
    return float(median(steps)) if len(steps) else 0.0


def damage_of(damage: Sequence[Damage]) -> Iterator[Event]:
    """What is broken in a log, in one line."""
    if damage:
        first = damage[0]
        text = first.what if first.what.startswith("the log") else f"damage in the log: {first.what}"
        more = f", and {counted(len(damage) - 1, 'more place')}" if len(damage) > 1 else ""
        yield Event(math.nan if first.time_s is None else first.time_s, "log", text + more, "the log")


def counted(number: int, what: str, plural: str = "s") -> str:
    """A number with its noun: "1 refusal", "2 switches"."""
    return f"{number} {what}{'' if number == 1 else plural}"


def _place(event: Event) -> tuple[bool, float, int]:
    """Where an event stands: by time to a tenth of a second, then by kind; what has no time comes last."""
    known = math.isfinite(event.time_s)
    return not known, round(event.time_s, 1) if known else 0.0, _AT_ONCE.index(event.kind)


def _kept(events: Sequence[Event], most: int) -> list[Event]:
    """At most so many events in their order, the most telling ones."""
    if len(events) <= most:
        return list(events)
    order = {kind: place for place, kind in enumerate(_KEPT_LONGEST)}

    def weight(at: int) -> tuple[float, int]:
        event = events[at]
        is_promoted = event.kind == "message" and _TELLING.search(event.text) is not None
        return (order["error"] + 0.5 if is_promoted else order[event.kind]), at

    chosen = set(sorted(range(len(events)), key=weight)[: most - 1])
    rest = Event(events[-1].time_s, "message", f"and {len(events) - len(chosen)} more events of less weight", "the log")
    return [*(event for at, event in enumerate(events) if at in chosen), rest]
