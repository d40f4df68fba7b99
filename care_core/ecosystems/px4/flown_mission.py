"""What became of the mission that a PX4 vehicle flew, as its navigator says.

The navigator publishes its result on each change, for take-off, return and landing as well: only what it says while
the mode is Mission is about a mission.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from care_core.ecosystems.px4.flight import LANDED, RESULT, SAID_WITHIN_S, Px4Flight, changes
from care_core.ecosystems.spans import Span
from care_core.ecosystems.vehicles import mode_name, way_of
from care_core.run import Unavailable, Value
from care_core.text import log_time

_IDS = ("mission_id", "instance_count")
"""What changes with each upload: since 1.15, and before."""


def mission_outcome(flight: Px4Flight, span: Span) -> Value:
    """1 where the mission was flown to its end, 0 where it failed."""
    if flight.during(RESULT, "finished", span) is None:
        return Unavailable("the log does not say how the mission ended", f"record {RESULT}", RESULT)
    flown = list(_flown(flight, span))
    if any(flight.ever(RESULT, "failure", 1, part) for part in flown):
        return 0.0
    replaced_s = _replaced(flight, flown)
    if replaced_s is not None:
        reason = f"the mission was replaced under way, at {log_time(replaced_s, 0)}"
        return Unavailable(reason, "judge a run whose mission stays as it was uploaded")
    if any(flight.ever(RESULT, "finished", 1, part) for part in flown) or did_last_item(flight, span):
        return 1.0
    modes = flight.modes_during(span)
    last = f", the last mode was {mode_name('px4', modes[-1])}" if modes else ""
    return Unavailable(f"the mission was not flown to its end{last}")


def _replaced(flight: Px4Flight, flown: Sequence[Span]) -> float | None:
    """When the mission was replaced while it was flown. One that was finished is done, unless the new one was begun."""
    for t, _ in uploads(flight):
        part = next((one for one in flown if one[0] < t <= one[1]), None)
        if part is None:
            continue
        was_done = any(flight.ever(RESULT, "finished", 1, (start, min(end, t))) for start, end in flown if start < t)
        after = (t, part[1])
        was_begun = flight.at_least(RESULT, "seq_reached", 0, after) and not flight.ever(RESULT, "finished", 1, after)
        if not was_done or was_begun:
            return t
    return None


def uploads(flight: Px4Flight) -> Iterator[tuple[float, int | None]]:
    """When another mission took the place of one, and how many items it has."""
    name = next((one for one in _IDS if flight.table(RESULT, one) is not None), None)
    table = None if name is None else flight.table(RESULT, name)
    if name is None or table is None:
        return
    known = iter(changes(table, name))
    before = next(known, None)
    for t, number in known:
        if before is not None and before[1] != 0:  # from none is what it reads at start
            total = flight.last(RESULT, "seq_total", t)
            yield t, None if total is None else int(total)
        before = t, number


def _flown(flight: Px4Flight, span: Span) -> Iterator[Span]:
    """The parts of a span in the mode that flies missions, with what is published a moment after."""
    entered = [(t, mode) for t, mode in flight.modes if t <= span[1]]
    for (start, mode), (end, _) in pairwise((*entered, (span[1], None))):
        if mode is not None and way_of("px4", mode) == "mission" and end > span[0]:
            yield max(start, span[0]), end + SAID_WITHIN_S


def did_last_item(flight: Px4Flight, span: Span) -> bool:
    """Whether all items were reached, or all but a last one that is the return or the landing itself, on which it left
    the mission at once, and it landed. Disarming resets what the navigator says."""
    return any(_did_last_item(flight, span, part) for part in _flown(flight, span))


def _did_last_item(flight: Px4Flight, span: Span, flown: Span) -> bool:
    rows = flight.table(RESULT, "seq_reached", "seq_total")
    part = None if rows is None else rows.between(*flown)
    if part is None or not len(part):
        return False
    left = part["seq_total"] - 1 - part["seq_reached"]
    if np.any((left <= 0) & (part["seq_total"] > 0)):
        return True
    after = [(t, mode) for t, mode in flight.modes if flown[0] < t <= span[1]]
    goes_home = bool(after) and way_of("px4", after[0][1]) in ("return", "land")
    one_left = part.t[(left == 1) & (part["seq_total"] > 1)]
    waited_s = after[0][0] - float(one_left[0]) if goes_home and len(one_left) else math.inf
    at_once = -SAID_WITHIN_S / 2 <= waited_s <= 2 * SAID_WITHIN_S  # the mode is told twice a second
    return at_once and flight.last(LANDED, "landed", span[1]) == 1
