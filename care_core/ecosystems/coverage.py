"""Whether samples cover the span that a measure is of: what it saw half of, it does not judge as a whole.

A measure says which samples it rests on, where they are needed, and how much of that it can miss. A pause between two
samples is a hole where it is longer than the message's own habit: a ground station that hears a battery every two
seconds misses nothing. So is what a sensor repeats that has died, see `liveness`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from care_core.ecosystems.spans import Span, inside, seconds_in
from care_core.numbers import Floats, ascending, median, quantile
from care_core.records import Record
from care_core.run import Unavailable
from care_core.text import log_time

_HOLE_PERIODS, _HOLE_S = 3.0, 2.0
"""A pause of more than both is a hole: memory cards stall for a second, radios lose two messages in a row."""
_FEWEST = 10
"""Pauses that tell how long a message's usual ones are; of fewer the middle one does."""
_MOST_PAUSES = 0.9


class Bears(Record):
    """How much of its span a measure can miss and still be the span's: a share of it, and always some seconds."""

    share: float
    seconds: float

    def of(self, total_s: float) -> float:
        """Seconds that may be missing of so many."""
        return max(self.share * total_s, min(self.seconds, total_s / 2))


SUM = Bears(0.05, 3.0)
"""Energy, distance: what lies in a hole is taken to be like what is around it, a twentieth of it."""
EXTREME = Bears(0.05, 2.0)
"""A greatest or least value may lie in any hole."""
MEAN = Bears(0.1, 3.0)
"""Means, shares of the time, percentiles."""
USUAL = Bears(0.25, 5.0)
"""Medians of what hardly changes in a run: resistance, power to stay up."""


class Samples(Record, eq=False):
    """Samples that a measure rests on."""

    name: str
    """What was sampled, as a reader reads it: "the battery (BAT)"."""
    t: Floats
    """When there were any, in the whole log, shape (n,)."""
    spans: Sequence[Span] = ()
    """Where they are needed throughout."""
    bears: Bears = SUM
    moments: Sequence[float] = ()
    """Where one is needed as near as they usually come."""
    dead: Sequence[Span] = ()
    """Where they say nothing: the sensor only repeats itself."""
    dead_name: str = ""
    """The sensor that does, where it is another: estimates follow a receiver."""


def doubt(samples: Samples) -> Unavailable | None:
    """Why a number that rests on these samples is none of its span; None where they cover it."""
    t = ascending(samples.t)
    usual_s = usual_pause(t)
    total_s = seconds_in(samples.spans)
    missed_s = unseen(t, samples.spans, usual_s)
    if missed_s > samples.bears.of(total_s):
        seen_s = max(total_s - missed_s, 0.0)
        return Unavailable(
            f"{samples.name} was recorded for {seen_s:.0f} of {total_s:.0f} s", "record it from start to end"
        )
    far = next((moment for moment in samples.moments if _is_far(t, moment, usual_s)), None)
    if far is not None:
        off = f"its nearest record is {np.abs(t - far).min():.0f} s off" if len(t) else "nothing of it is there"
        return Unavailable(f"{samples.name} was not recorded when it counts: {off}", "record it from start to end")
    return _repeated(samples, t, usual_s, total_s) if samples.dead else None


def _repeated(samples: Samples, t: Floats, usual_s: float, total_s: float) -> Unavailable | None:
    """The same of samples of which some only repeat what was said before."""
    live = t[~inside(samples.dead, t)]
    missed_s = unseen(live, samples.spans, usual_s)
    if missed_s <= samples.bears.of(total_s) and not any(_is_far(live, one, usual_s) for one in samples.moments):
        return None
    said = " and ".join(f"from {log_time(start, 0)} to {log_time(end, 0)}" for start, end in samples.dead[:2])
    return Unavailable(
        f"{samples.dead_name or samples.name} says the same {said}, so it measures nothing then", "check the sensor"
    )


def usual_pause(t: Floats) -> float:
    """The longest pause that is usual between ascending samples, s; nan where there is none."""
    pauses = np.diff(t)
    return quantile(pauses, _MOST_PAUSES) if len(pauses) >= _FEWEST else float(median(pauses))


def unseen(t: Floats, spans: Iterable[Span], usual_s: float) -> float:
    """Seconds of spans that lie in holes between ascending samples, before the first or behind the last."""
    before, after = np.concatenate(([-np.inf], t)), np.concatenate((t, [np.inf]))
    limit_s = np.nanmax([_HOLE_PERIODS * usual_s, _HOLE_S])
    holes = after - before > limit_s
    missed_s = 0.0
    for start, end in spans:
        low, high = np.maximum(before[holes], start), np.minimum(after[holes], end)
        within = np.maximum(high - low, 0.0)
        is_edge = np.isinf(before[holes]) | np.isinf(after[holes])
        missed_s += float(within[~is_edge | (within > limit_s)].sum())
    return missed_s


def _is_far(t: Floats, moment: float, usual_s: float) -> bool:
    limit_s = np.nanmax([_HOLE_PERIODS * usual_s, _HOLE_S])
    return not len(t) or float(np.abs(t - moment).min()) > limit_s
