"""One run of a log that holds several, as if it were a log of its own: what one flight did says nothing of another."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from care_core.ecosystems.ardupilot.held_missions import READS as OF_MISSIONS
from care_core.ecosystems.base import RunModel
from care_core.ecosystems.spans import Span
from care_core.logs.base import Table, Wanted
from care_core.records import Record
from care_core.run import Damage, Setting

_SAID_AFTER_S = 5.0
"""What is recorded so shortly after a disarming belongs to the run before it: an impact, and what is said of it."""
_KEPT = frozenset((*OF_MISSIONS, "MISE", "ORGN", "FMT", "FMTU", "MULT", "UNIT", "VER"))
"""Said once, and true until it is said anew."""
_IN_FORCE = frozenset(("MODE",))
"""Of these the last one before is in force."""
_ENDS_ONE = frozenset(("ERR",))
"""Of what has no time of its own, and is read with that of the arming after it, this ended the run before."""
MOST = 30
"""A log of more runs is looked at as a whole: such are armings on a bench."""


def windows_of(armed: Sequence[Span], end_s: float) -> tuple[Span, ...]:
    """What belongs to each run: from the end of the one before it to its own end, what is said shortly after included.
    One window of the whole log where it holds no two runs."""
    if not 2 <= len(armed) <= MOST:
        return ((-math.inf, end_s),)
    ends = [
        min(own[1] + _SAID_AFTER_S, float(np.nextafter(following[0], -math.inf))) for own, following in pairwise(armed)
    ]
    starts = [-math.inf, *(float(np.nextafter(end, math.inf)) for end in ends)]
    return tuple(zip(starts, [*ends, end_s], strict=True))


class OneRun(Record, eq=False, dict=True):
    """The log of one run; what it does not cut is the whole log's. Times stay seconds since the start of that."""

    whole: RunModel
    window: Span
    armed_s: float

    def __getattr__(self, name: str) -> Any:
        return getattr(self.whole.log, name)

    @property
    def duration_s(self) -> float:
        """When the run's part of the log ends."""
        return self.window[1]

    @property
    def damage(self) -> tuple[Damage, ...]:
        """What is broken in it."""
        start, end = self.window
        return tuple(one for one in self.whole.log.damage if one.time_s is None or start <= one.time_s <= end)

    def settings(self) -> Mapping[str, tuple[Setting, ...]]:
        """The parameters as they were when it was armed, and what was changed since."""
        return {name: self._since_armed(history) for name, history in self.whole.log.settings().items()}

    def read(self, wanted: Wanted) -> Mapping[str, Table]:
        """Its rows of the messages."""
        cut = {name: self._cut(name, table) for name, table in self.whole.tables(wanted).items()}
        return {name: table for name, table in cut.items() if len(table)}

    def _cut(self, name: str, table: Table) -> Table:
        start, end = self.window
        if name in _KEPT:
            start = -math.inf
        elif name in _IN_FORCE:
            before = table.t[table.t < start]
            start = float(before.max()) if len(before) else start
        elif name in _ENDS_ONE:
            start, end = (float(np.nextafter(t, math.inf)) for t in self.window)
        return table.between(start, end)

    def _since_armed(self, history: tuple[Setting, ...]) -> tuple[Setting, ...]:
        changed = [(-math.inf if one.changed_at_s is None else one.changed_at_s, one) for one in history]
        before = [one for t, one in changed if t <= self.armed_s]
        later = [one for t, one in changed if self.armed_s < t <= self.window[1]]
        return (*before[-1:], *later) or history[:1]
