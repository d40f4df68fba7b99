"""What the next run has, with changes or as driven, given that this one failed.

Two answers are joined, each with what the other lacks: the mechanisms know what options do together and how this run
differed from what they expect; the noisy-OR of its causes knows parts, what was met, parameters outside the profile and
chance. Their logits are averaged (Genest and Zidek 1986, section 3: a logarithmic pool). On the flown resets of the
development failures of four robots (545 of one option, or of what was advised) either answer alone has a larger Brier
score on some robot. Answers that know different things say too little together (Satopaa et al. 2014), and so did these:
what is promised of a change is moved up by what flown resets ask for.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from care_core.causal.counterfactual import Config, CounterfactualQuery
from care_core.configs.driven import same_value
from care_core.diagnose.estimates import BY_CAUSES, PROMISED_MORE
from care_core.diagnose.noisy_or import CHANCE, Key, NoisyOr
from care_core.numbers import Floats, logistic, logit
from care_core.records import Record

SURE = 0.002
"""No promise is nearer than this to 0 or 1."""


class Promise(Record, eq=False):
    """A run that failed, ready to be asked for the odds of the next one."""

    failure: NoisyOr
    query: CounterfactualQuery
    broken: Sequence[str]
    """The objectives that it missed."""

    def odds(self, configs: Sequence[Config]) -> Floats:
        """Probability that every objective is met under each configuration, shape (m,): no more than what is left of
        this run's failure once what a change does not touch is counted, and than what the changed causes explain."""
        gone = [self._changed(config) for config in configs]
        driven = self._pooled([self.query.config], [frozenset()])[0]
        explained = [driven + self.failure.acts_among(keys) for keys in gone]
        promised = logistic(logit(self._pooled(configs, gone), SURE) + PROMISED_MORE.value)
        return np.minimum(np.minimum(promised, explained), max(self._left(), SURE))

    def as_driven(self) -> float:
        """Probability that the next run meets every limit without a change."""
        return float(self.odds([self.query.config])[0])

    def without(self, parameters: Collection[str], config: Config) -> float:
        """Probability that the next run meets every limit under a configuration and with parameters right that no
        mechanism knows: of these the causes tell alone."""
        gone: frozenset[Key] = self._changed(config) | {("parameter", name) for name in parameters}
        odds = float(self.failure.repaired(gone) * self._others_kept([config])[0])
        return min(odds, self.as_driven() + self.failure.acts_among(gone))

    def necessity(self, changed: Config, given: Config) -> float:
        """The largest share of the failures of a broken objective that changes take away (Pearl's probability of
        necessity, where a change harms no run), before anything of this run is known.

        Args:
            changed: the configuration with all changes. given: with those that are made already.
        """
        before = self.query.unobserved()
        shares = [0.0]
        for name in self.broken:
            if name in before.model.outcomes:
                here, there = (float(one) for one in 1.0 - before.p_ok(name, [given, changed]))
                shares.append(1.0 - there / here if here > 0 else 0.0)
        return max(shares)

    def _changed(self, config: Config) -> frozenset[Key]:
        """The causes that a configuration takes away: options on their way back or past the reference, where the
        mechanisms tell what too much does, none that goes farther off."""
        driven = self.query.config
        names = (name for name in driven if not same_value(config.get(name, driven[name]), driven[name]))
        return frozenset(("parameter", name) for name in names if self._goes_back(name, config[name]))

    def _goes_back(self, name: str, value: float) -> bool:
        option, reference = self.query.variables.get(name), self.query.reference.get(name)
        if option is None or reference is None or option.labels or option.type == "bool":
            return True
        driven = self.query.config[name]
        is_past = (value - reference) * (driven - reference) < 0
        return is_past or option.distance(value, reference) < option.distance(driven, reference)

    def _pooled(self, configs: Sequence[Config], gone: Sequence[frozenset[Key]]) -> Floats:
        mechanisms = self.query.probability(configs) * self._left()
        causes = np.array([self.failure.repaired(keys) for keys in gone]) * self._others_kept(configs)
        return logistic((1.0 - BY_CAUSES.value) * logit(mechanisms, SURE) + BY_CAUSES.value * logit(causes, SURE))

    def _left(self) -> float:
        """Probability that nothing of what no option touches, parts and what was met, lost the run."""
        options = {("parameter", name) for name in self.query.config}
        untouched = {key for key in self.failure.loses if key not in options and key != CHANCE}
        return 1.0 - self.failure.acts_among(untouched)

    def _others_kept(self, configs: Sequence[Config]) -> Floats:
        """Probability that the objectives which this run did not miss are met."""
        kept = self.query.all_kept([name for name in self.query.model.outcomes if name not in self.broken], configs)
        return np.ones(len(configs)) if kept is None else kept
