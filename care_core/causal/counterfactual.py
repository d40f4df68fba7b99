"""What this run would have done under other options: abduct its noise, intervene, predict.

Every objective is predicted from the options alone (its mechanism solved for the exogenous variables, which is what
interventions set); what the run met, its noise, is read off this run's own outcome and carried over. Noise persists in
part: the wind and the clutter of the next run are like, not equal to, those of this one (`PERSISTENCE`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from care_core.causal.mechanisms import LEAST, TAIL, FloatArray, Mechanism, columns, restored, transformed
from care_core.causal.model import Model, OutcomeRecord, StageRecord
from care_core.run import is_known
from care_core.variables import Threshold

PERSISTENCE = 0.7
"""Share of a run's noise variance that the next run under the same conditions meets again."""
INTERVAL = (0.1, 0.9)

Config = Mapping[str, float]


@dataclass(frozen=True, slots=True, eq=False)
class Predicted:
    """An objective under m configurations: expected value, 80 % interval, odds of keeping its threshold; shape (m,)."""

    value: FloatArray
    low: FloatArray
    high: FloatArray
    p_ok: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class World:
    """This run, ready to be asked "what if": its configuration, its outcome, and the thresholds in force."""

    model: Model
    config: Config
    """A value for every option that any mechanism reads."""
    observed: Mapping[str, object]
    """Metrics and objectives of the run; unknown ones are absent or `Unavailable`."""
    thresholds: Mapping[str, Threshold]

    def predict(self, objective: str, configs: Sequence[Config]) -> Predicted:
        """The objective under each configuration, given what this run met."""
        outcome = self.model.outcomes[objective]
        return self._functional(outcome, configs) if outcome.stages else self._continuous(outcome, configs)

    def odds(self, configs: Sequence[Config]) -> FloatArray:
        """Odds that every objective keeps its threshold, shape (m,).

        Objectives that move together (DESIGN: time and energy) share one cause: the least likely of a group counts
        once; the rest multiply.
        """
        p_ok = {name: self.predict(name, configs).p_ok for name in self.model.outcomes if name in self.thresholds}
        total = np.ones(len(configs))
        for group in self._groups(p_ok):
            total *= np.min([p_ok[name] for name in group], axis=0)
        return total

    def ignorance(self, configs: Sequence[Config]) -> FloatArray:
        """How little training says about the objectives there: 0 (known) to 1, the least known one's; shape (m,)."""
        keys = [
            key
            for name, outcome in self.model.outcomes.items()
            if name in self.thresholds
            for key in ([stage.mechanism for stage in outcome.stages] or [outcome.mechanism])
        ]
        used = [self.model.mechanisms[key] for key in keys]
        least: FloatArray = np.max([m.ignorance(columns(configs, m.inputs)) for m in used], axis=0)
        return least

    def _groups(self, names: Mapping[str, FloatArray]) -> list[list[str]]:
        together = [[name for name in group if name in names] for group in self.model.training.moves_together]
        grouped = {name for group in together for name in group}
        return [group for group in together if group] + [[name] for name in names if name not in grouped]

    def known(self, name: str) -> float | None:
        """This run's value of a metric or an objective, None where it has none."""
        value = self.observed.get(name)
        return float(value) if is_known(value) else None  # type: ignore[arg-type]

    def _functional(self, outcome: OutcomeRecord, configs: Sequence[Config]) -> Predicted:
        p_ok = np.ones(len(configs))
        reached = True
        for stage in outcome.stages:
            passed = self._passed(outcome.objective, stage)
            if not reached and (passed or stage.variable == outcome.objective):
                passed = None  # what came after the failure says nothing about this stage
            p_ok *= self._stage_odds(stage, passed, configs)
            reached = reached and passed is not False
        zero, one = np.zeros_like(p_ok), np.ones_like(p_ok)
        return Predicted(p_ok, np.where(p_ok > INTERVAL[1], one, zero), np.where(p_ok < INTERVAL[0], zero, one), p_ok)

    def _stage_odds(self, stage: StageRecord, passed: bool | None, configs: Sequence[Config]) -> FloatArray:
        """Odds of passing one stage, given whether this run passed it (None: it never came to it).

        A run passes when its propensity exceeds its noise (a monotone threshold model), so with the noise of this run
        the odds given that it passed are min(1, q'/q), given that it failed max(0, (q' - q)/(1 - q)).
        """
        mechanism = self.model.mechanisms[stage.mechanism]
        chance = self._chance(mechanism, stage.passes, configs)
        here = self._chance(mechanism, stage.passes, [self.config])[0]
        if passed is None:
            return chance
        same_noise = np.minimum(1.0, chance / here) if passed else np.maximum(0.0, (chance - here) / (1.0 - here))
        blended: FloatArray = PERSISTENCE * same_noise + (1 - PERSISTENCE) * chance
        return np.clip(blended, TAIL, 1 - TAIL)

    def _passed(self, objective: str, stage: StageRecord) -> bool | None:
        """Whether this run passed the stage, None where it never came to it."""
        seen = self.known(stage.variable)
        if seen is None:
            return None
        bound = self.thresholds.get(objective) if stage.variable == objective else None
        return bound.met(seen) if bound is not None else seen == stage.passes

    @staticmethod
    def _chance(mechanism: Mechanism, passes: float, configs: Sequence[Config]) -> FloatArray:
        one = mechanism.odds(columns(configs, mechanism.inputs))
        return one if passes == 1.0 else 1.0 - one

    def _continuous(self, outcome: OutcomeRecord, configs: Sequence[Config]) -> Predicted:
        mechanism = self.model.mechanisms[outcome.mechanism]
        x = columns(configs, mechanism.inputs)
        seen = self.known(outcome.objective)
        if seen is not None and seen > LEAST[mechanism.transform]:
            # This run's noise is carried over, y' = y + f(x') - f(x), but for the share that does not persist.
            change, unsure = mechanism.change(x, columns([self.config], mechanism.inputs))
            centre = float(transformed(np.array(seen), mechanism.transform)) + change
            spread = np.sqrt(unsure**2 + 2 * (1 - PERSISTENCE) * mechanism.noise_spread**2)
        else:
            centre = mechanism.latent(x)
            spread = np.sqrt(mechanism.latent_spread(x) ** 2 + mechanism.noise_spread**2)
        bound = self.thresholds.get(outcome.objective)
        low, high = (restored(centre + mechanism.error_quantile(q) * spread, mechanism.transform) for q in INTERVAL)
        p_ok = np.full(len(configs), np.nan) if bound is None else _odds_of(mechanism, bound, centre, spread)
        return Predicted(restored(centre, mechanism.transform), low, high, p_ok)


def _odds_of(mechanism: Mechanism, bound: Threshold, centre: FloatArray, spread: FloatArray) -> FloatArray:
    # A bound that no value of the target can go below (a time of 0 s) lies infinitely far on a log scale.
    reachable = bound.value > LEAST[mechanism.transform]
    limit = float(transformed(np.array(bound.value), mechanism.transform)) if reachable else -np.inf
    below = mechanism.share_below((limit - centre) / spread)
    return below if bound.op in ("<=", "<") else 1.0 - below
