"""One model of a failure: independent causes, each of which loses the mission by itself where it acts.

A cause i is there and loses such a mission with probability q_i, whatever the others do, so a mission is kept with the
product of all 1 - q_i (a noisy-OR; Pearl 1988, section 4.3.2). Every figure on a page follows from it: which cause acts
in a run that failed, what is left where some are taken away, and what a run has that is driven as it was.

Causes are not exclusive: two may act in one run. What is told in a ranking is the probability that a cause acts and
none above it does, so that a ranking adds up to 1 and is the order in which to try.
"""

from __future__ import annotations

import math
from collections.abc import Container, Mapping
from typing import Literal

from care_core.diagnose.estimates import REPEATS
from care_core.records import Record

What = Literal["parameter", "hardware", "world", "chance"]
Key = tuple[What, str]
CHANCE: Key = ("chance", "")
"""What went wrong in this run without any of the other causes."""
UNKNOWN: Key = ("parameter", "")
"""A parameter that the profile does not know."""
ALIKE = 0.05
"""Of causes that are as likely as each other to this, a part that failed is told first: it is mended before anything
is changed."""
MOST = 0.99
"""No cause is surer than this to lose a mission by itself."""


class NoisyOr(Record):
    """The causes that may have lost a run, with what each loses by itself, 0 to 1."""

    loses: Mapping[Key, float]

    @property
    def failed(self) -> float:
        """Probability that such a mission is lost; the least that any cause can explain is not nothing."""
        return max(1.0 - self._kept(()), 1e-9)

    def acts(self, key: Key) -> float:
        """Probability that a cause acted, given that the mission was lost."""
        return min(1.0, self._share(key) / self.failed)

    def acts_among(self, keys: Container[Key]) -> float:
        """Probability that any of these causes acted, given that the mission was lost."""
        kept = math.prod(1.0 - self._share(key) for key in self.loses if key in keys)
        return min(1.0, (1.0 - kept) / self.failed)

    def without(self, names: Container[str]) -> NoisyOr:
        """The same where these parameters are known not to have acted."""
        return NoisyOr({key: q for key, q in self.loses.items() if key[0] != "parameter" or key[1] not in names})

    def ranking(self) -> dict[Key, float]:
        """Per cause, the likeliest first, the probability that it acted and none above it did; they add up to 1."""
        order = sorted(self.loses, key=lambda key: (-self._share(key) - self._first(key), key))
        told: dict[Key, float] = {}
        above = 1.0
        for key in order:
            told[key] = above * self._share(key) / self.failed
            above *= 1.0 - self._share(key)
        return told

    def repaired(self, gone: Container[Key]) -> float:
        """Probability that the next mission is kept where these causes are taken away, given that this one was lost.

        What went wrong by chance goes wrong again in `REPEATS` of such missions; every other cause stays.
        """
        left = self._kept((CHANCE,), gone)
        chance = self._share(CHANCE)
        by_causes = (1.0 - chance) * left - self._kept(())
        by_luck = (1.0 - REPEATS.value) * chance * left
        return min(1.0, max(0.0, (by_causes + by_luck) / self.failed))

    def _first(self, key: Key) -> float:
        return ALIKE if key[0] == "hardware" and self._share(key) >= 0.5 else 0.0

    def _share(self, key: Key) -> float:
        return min(self.loses.get(key, 0.0), MOST)

    def _kept(self, *gone: Container[Key]) -> float:
        """Probability that a mission is kept with all causes but those that are gone."""
        return math.prod(1.0 - self._share(key) for key in self.loses if not any(key in group for group in gone))
