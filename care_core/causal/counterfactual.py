"""What this run would have done under other options: abduct its noise, intervene, predict.

Every objective is predicted from the options alone (its mechanism solved for the exogenous variables, which is what
interventions set); what the run met, its noise, is read off this run's own outcome and carried over (`abduction`). How
much of it the next run meets again was estimated from repeated runs where training had them, for the same conditions
and for another day apart (`Model.training.carry_over`).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from functools import cached_property
from typing import Literal

import numpy as np

from care_core.causal.abduction import (
    FARTHEST,
    ErrorCovariance,
    by_mediators,
    error_covariance,
    next_passes,
    next_value,
)
from care_core.causal.all_objectives import AllObjectives
from care_core.causal.mechanisms import LEAST, TAIL, Mechanism, Posterior, columns, restored, transformed
from care_core.causal.model import UNKNOWN_CARRY_OVER, Mediation, Model, NoiseCarryOver, OutcomeRecord, StageRecord
from care_core.causal.posteriors import PosteriorCache
from care_core.constraints import Constraint
from care_core.numbers import Floats
from care_core.records import Record, field, replace
from care_core.run import is_known
from care_core.variables import Threshold, Variable

INTERVAL = (0.1, 0.9)
UPPER_Z = 1.2815515655446004
"""The standard normal quantile of the upper end."""
_HALVINGS = 30

Config = Mapping[str, float]
Conditions = Literal["same", "another day"]


class Predicted(Record, eq=False):
    """An objective under m configurations: expected value, 80% interval, probability of being met; shape (m,)."""

    value: Floats
    low: Floats
    high: Floats
    p_ok: Floats


_Answers = dict[bytes, tuple[float, ...]]
"""The inputs of a mechanism, as the bytes of their values -> what it says of the next run there."""


class CounterfactualQuery(Record, eq=False, dict=True):
    """This run, ready to be asked "what if": its configuration, its outcome, and the thresholds in force."""

    model: Model
    config: Config
    """A value for every option that any mechanism reads."""
    observed: Mapping[str, object]
    """Metrics and objectives of the run; unknown ones are absent or `Unavailable`."""
    thresholds: Mapping[str, Threshold]
    repeats: Sequence[Mapping[str, object]] = ()
    """Metrics and objectives of other runs of the same configuration under the same conditions."""
    conditions: Conditions = "same"
    """Which next run is promised: one under the conditions of this run, or one on another day."""
    reference: Config = field(default_factory=dict)
    """The configuration that the run is held against, under what this run met."""
    variables: Mapping[str, Variable] = field(default_factory=dict)
    """What the profile says of each variable, by name."""
    kept: frozenset[str] = frozenset()
    """Options that stay as they are."""
    constraints: tuple[Constraint, ...] = ()
    """What the options have to keep together."""
    assumed: frozenset[str] = frozenset()
    """Options that no source of the run holds: taken to be at their reference."""
    wary_from: Config | None = None
    """Where set, each mechanism counts as bad as it may be (90%) at other configurations, given what it does at this
    one: what training did not show between the two is not taken for granted."""
    posteriors: PosteriorCache = field(default_factory=PosteriorCache)
    """What mechanisms predict whatever this run did: queries made of this one need most of it again."""

    @cached_property
    def _answers(self) -> dict[str, _Answers]:
        """What was worked out already: the search asks for most configurations many times over."""
        return {}

    def allows(self, config: Config) -> bool:
        """Whether a configuration keeps every constraint that the run's own keeps."""
        return all(one.holds(config) or not one.holds(self.config) for one in self.constraints)

    def predict(self, objective: str, configs: Sequence[Config]) -> Predicted:
        """The objective under each configuration, given what this run met."""
        outcome = self.model.outcomes[objective]
        told = self._functional(outcome, configs) if outcome.stages else self._continuous(outcome, configs)
        return replace(told, p_ok=np.maximum(told.p_ok, self.probability(configs)))  # what is kept with all is kept

    def p_ok(self, objective: str, configs: Sequence[Config]) -> Floats:
        """The probability of `predict` alone, shape (m,): NaN where the objective has no threshold."""
        outcome = self.model.outcomes[objective]
        if outcome.stages:
            return self._all_stages(outcome, configs)
        bound, mechanism = self.thresholds.get(objective), self.model.mechanisms[outcome.mechanism]
        if bound is None:
            return np.full(len(configs), np.nan)
        return _probability_of(mechanism, bound, self._next(outcome, configs))

    def probability(self, configs: Sequence[Config]) -> Floats:
        """Probability that every objective keeps its threshold, shape (m,).

        Objectives that move together (DESIGN: time and energy) share one cause: the least likely of a group counts
        once; the rest multiply, and runs that were left out say what to make of the product. What no mechanism
        predicts counts with its base rate.
        """
        base = float(np.prod(list(self.base_rates().values())))
        kept = self.all_kept(list(self.model.outcomes), configs)
        return np.full(len(configs), base) if kept is None else base * self._all_objectives.of_product(kept)

    @cached_property
    def _all_objectives(self) -> AllObjectives:
        """What to make of the product of the single probabilities: as it is where other objectives are asked about
        than those of the runs that were left out."""
        held_out = self.model.skill.get("all")
        is_all = self.model.outcomes.keys() <= self.thresholds.keys()
        return AllObjectives.of(held_out.curve) if held_out is not None and is_all else AllObjectives()

    def all_kept(self, objectives: Sequence[str], configs: Sequence[Config]) -> Floats | None:
        """Probability that each of these keeps its threshold, shape (m,), those that move together counted once; None
        where none has one."""
        p_ok = {name: self.p_ok(name, configs) for name in objectives if name in self.thresholds}
        if not p_ok:
            return None
        total = np.ones(len(configs))
        for group in self._groups(p_ok):
            total *= np.min([p_ok[name] for name in group], axis=0)
        return total

    def unobserved(self) -> CounterfactualQuery:
        """The same for any run in such a mission, whatever this one met."""
        return replace(self, observed={}, repeats=())

    def before(self) -> CounterfactualQuery:
        """The same before anything of this run is known but which stages of its mission it passed: what did not fail
        there has lost it there in no way."""
        passed = {
            stage.variable: self.observed[stage.variable]
            for outcome in self.model.outcomes.values()
            for stage in outcome.stages
            if stage.variable != outcome.objective and self._passed(outcome.objective, stage, self.observed)
        }
        return replace(self, observed=passed, repeats=())

    def base_rates(self) -> dict[str, float]:
        """Share of the training runs that kept the threshold, of the objectives that no mechanism predicts."""
        rates = {}
        for name, bound in self.thresholds.items():
            summary = self.model.summaries.get(name)
            if name not in self.model.outcomes and summary is not None:
                rates[name] = summary.share_meeting(bound)
        return rates

    def epistemic_ratio(self, configs: Sequence[Config], objectives: Collection[str] | None = None) -> Floats:
        """How little training says about the objectives there (all when None): 0 (known) to 1, the least known one's;
        shape (m,). Of one that no mechanism predicts it says nothing."""
        if objectives is not None and not self.model.outcomes.keys() & objectives:
            return np.ones(len(configs))
        keys = [
            key
            for name, outcome in self.model.outcomes.items()
            if name in self.thresholds and (objectives is None or name in objectives)
            for key in ([stage.mechanism for stage in outcome.stages] or [outcome.mechanism])
        ]
        least: Floats = np.max([self._epistemic_ratio(key, configs) for key in keys], axis=0)
        return least

    def _epistemic_ratio(self, key: str, configs: Sequence[Config]) -> Floats:
        mechanism = self.model.mechanisms[key]
        return self.posteriors.at(mechanism, columns(configs, mechanism.inputs)).epistemic_ratio

    def _groups(self, names: Mapping[str, Floats]) -> list[list[str]]:
        together = [[name for name in group if name in names] for group in self.model.training.moves_together]
        grouped = {name for group in together for name in group}
        return [group for group in together if group] + [[name] for name in names if name not in grouped]

    def known(self, name: str) -> float | None:
        """This run's value of a metric or an objective, None where it has none."""
        return known_value(self.observed, name)

    def _carry_over(self, objective: str) -> float:
        carry_over = self._measured(objective)
        return carry_over.same if self.conditions == "same" else carry_over.another

    def _measured(self, objective: str) -> NoiseCarryOver:
        return self.model.training.carry_over.get(objective, UNKNOWN_CARRY_OVER)

    def _functional(self, outcome: OutcomeRecord, configs: Sequence[Config]) -> Predicted:
        p_ok = self._all_stages(outcome, configs)
        zero, one = np.zeros_like(p_ok), np.ones_like(p_ok)
        return Predicted(p_ok, np.where(p_ok > INTERVAL[1], one, zero), np.where(p_ok < INTERVAL[0], zero, one), p_ok)

    def _all_stages(self, outcome: OutcomeRecord, configs: Sequence[Config]) -> Floats:
        p_ok = np.ones(len(configs))
        runs = [(seen, True) for seen in (self.observed, *self.repeats)]
        graph, ended = self.model.graph, list[str]()
        for stage in outcome.stages:
            follows = stage.variable in graph.descendants(*ended)
            passed = []
            for i, (seen, reached) in enumerate(runs):
                ok = self._passed(outcome.objective, stage, seen)
                if not reached and (ok or follows or stage.variable == outcome.objective):
                    ok = None  # what came after the failure, or of it, says nothing about this stage
                passed += [] if ok is None else [ok]
                runs[i] = seen, reached and ok is not False
            if False in passed and stage.variable in graph.nodes:
                ended.append(stage.variable)
            p_ok *= self._stage_probability(outcome.objective, stage, passed, configs)
        return p_ok

    def _stage_probability(
        self, objective: str, stage: StageRecord, passed: Sequence[bool], configs: Sequence[Config]
    ) -> Floats:
        """Probability of passing one stage, given which runs of this configuration passed it."""
        mechanism = self.model.mechanisms[stage.mechanism]

        def ask(x: Floats) -> tuple[Floats]:
            there = self.posteriors.at(mechanism, x)
            chance = _chance(there, stage.passes, -self._worse(stage.mechanism, there))
            if not passed:
                return (chance,)
            here = self._at(stage.mechanism, self.config)
            errors = error_covariance(there, here, self._carry_over(objective))
            expected = float(_chance(here, stage.passes)[0])
            return (np.clip(next_passes(errors, chance, expected, passed), TAIL, 1 - TAIL),)

        x = columns(configs, mechanism.inputs)
        probability: Floats = self._once(f"{objective}/{stage.mechanism}", mechanism, x, ask)[0]
        return probability

    def _once(self, key: str, mechanism: Mechanism, x: Floats, ask: Callable[[Floats], tuple[Floats, ...]]) -> Floats:
        """What `ask` answers for each row of x, asked once for each that is new: an array of each of its answers.

        Args:
            x: shape (m, p). ask: k arrays of shape (n,) for n of the rows.

        Returns:
            Shape (k, m).
        """
        told = self._answers.setdefault(key, {})
        rows = mechanism.active_inputs(x)
        new = {row: i for i, row in enumerate(rows) if row not in told}
        if new:
            told.update(zip(new, zip(*ask(x[list(new.values())]), strict=True), strict=True))
        answers: Floats = np.array([told[row] for row in rows]).T
        return answers

    def _passed(self, objective: str, stage: StageRecord, observed: Mapping[str, object]) -> bool | None:
        """Whether a run passed the stage, None where it never came to it."""
        seen = known_value(observed, stage.variable)
        if seen is None:
            return None
        bound = self.thresholds.get(objective) if stage.variable == objective else None
        return bound.met(seen) if bound is not None else seen == stage.passes

    def _continuous(self, outcome: OutcomeRecord, configs: Sequence[Config]) -> Predicted:
        mechanism, after = self.model.mechanisms[outcome.mechanism], self._next(outcome, configs)
        low, high = restored(after.quantiles(mechanism, INTERVAL), mechanism.transform)
        return Predicted(restored(after.mean, mechanism.transform), low, high, self.p_ok(outcome.objective, configs))

    def _next(self, outcome: OutcomeRecord, configs: Sequence[Config]) -> _Next:
        """The next outcome on the transformed scale."""
        mechanism = self.model.mechanisms[outcome.mechanism]
        least = LEAST[mechanism.transform]
        values = [known_value(seen, outcome.objective) for seen in (self.observed, *self.repeats)]
        seen = transformed(np.array([v for v in values if v is not None and v > least]), mechanism.transform)
        shares, weights = self._measured(outcome.objective).shares(same=self.conditions == "same")
        bound = self.thresholds.get(outcome.objective)
        bad = 1.0 if bound is None or bound.op in ("<=", "<") else -1.0

        def ask(x: Floats) -> tuple[Floats, ...]:
            there = self.posteriors.at(mechanism, x)
            latent = there.latent + bad * self._worse(outcome.mechanism, there)
            if not len(seen):
                return latent, np.sqrt(there.variance + mechanism.noise_at(x) ** 2)
            here = self._at(outcome.mechanism, self.config)
            errors = error_covariance(there, here, 0.0)
            pairs = [next_value(errors.sharing(share), latent, float(here.latent[0]), seen) for share in shares]
            return tuple(part for pair in pairs for part in pair)

        told = self._once(outcome.objective, mechanism, columns(configs, mechanism.inputs), ask)
        centre, sd = told[0::2], told[1::2]
        if len(seen):
            return _Next(centre, sd, weights)
        shift, left = self._by_mediators(outcome.mediation, configs)
        return _Next(centre + sd * shift, sd * np.sqrt(left), np.ones(1))

    def _at(self, key: str, config: Config) -> Posterior:
        """A mechanism at this run's configuration or at the one that is known, which every question asks about."""
        mechanism = self.model.mechanisms[key]
        return self.posteriors.at(mechanism, columns([config], mechanism.inputs))

    def _worse(self, key: str, there: Posterior) -> Floats:
        """What a mechanism may do beyond what it is expected to, from the configuration that is known; shape (m,)."""
        if self.wary_from is None:
            return np.zeros(len(there.x))
        return UPPER_Z * there.change_sd(self._at(key, self.wary_from))

    def _by_mediators(self, mediation: Mediation | None, configs: Sequence[Config]) -> tuple[Floats, Floats]:
        """What the metrics of runs that ended before an objective had a value say of it: centre of its error and what
        is left of its variance, as shares; shape (m,) each.

        A metric that the graph puts behind what ended a run says how it ended, not what its objective would have been.
        """
        nothing = np.zeros(len(configs)), np.ones(len(configs))
        if mediation is None or not self._behind_the_end().isdisjoint(mediation.metrics):
            return nothing
        covariances, errors = [], []
        for name in mediation.metrics:
            mechanism = self.model.mechanisms[name]
            values = [known_value(seen, name) for seen in (self.observed, *self.repeats)]
            seen = np.array([v for v in values if v is not None and v > LEAST[mechanism.transform]])
            if len(seen) < len(values):
                return nothing
            covariances.append(self._error_covariance(name, columns(configs, mechanism.inputs)))
            error = transformed(seen, mechanism.transform) - self._at(name, self.config).latent
            far = FARTHEST * np.sqrt(covariances[-1].here)
            errors.append(np.clip(error, -far, far))
        return by_mediators(covariances, np.array(errors).T, np.array(mediation.weights), np.array(mediation.among))

    def _error_covariance(self, metric: str, x: Floats) -> ErrorCovariance:
        """Of the metric's errors at x (m, p) with those here."""
        here, carry_over = self._at(metric, self.config), self._carry_over(metric)

        def ask(rows: Floats) -> tuple[Floats, ...]:
            errors = error_covariance(self.posteriors.at(here.mechanism, rows), here, carry_over)
            return errors.variance, errors.covariance

        variance, covariance = self._once(f"on its way/{metric}", here.mechanism, x, ask)
        return replace(error_covariance(here, here, carry_over), variance=variance, covariance=covariance)

    def _behind_the_end(self) -> frozenset[str]:
        """Metrics that the graph puts behind a stage that this run failed."""
        failed = [
            stage.variable
            for outcome in self.model.outcomes.values()
            for stage in outcome.stages
            if self._passed(outcome.objective, stage, self.observed) is False
        ]
        return self.model.graph.descendants(*failed)


def known_value(observed: Mapping[str, object], name: str) -> float | None:
    """A run's value of a metric or an objective, None where it has none."""
    value = observed.get(name)
    return float(value) if is_known(value) else None  # type: ignore[arg-type]


class _Next(Record, eq=False):
    """The next outcome of m configurations: what it is for each of k shares of the noise that may carry over, (k, m),
    and how likely each share is, (k,)."""

    centre: Floats
    sd: Floats
    weights: Floats

    @property
    def mean(self) -> Floats:
        return np.asarray(self.weights @ self.centre)

    def share_below(self, mechanism: Mechanism, values: Floats) -> Floats:
        """Distribution function, shape (m,); of values (..., 1, m) of shape (..., m)."""
        below: Floats = self.weights @ mechanism.share_below((values - self.centre) / self.sd)
        return below

    def quantiles(self, mechanism: Mechanism, shares: Sequence[float]) -> Floats:
        """Of so many shares, shape (len(shares), m), by halving: between the least and the largest of those of the
        single shares of noise."""
        each = self.centre + np.array([mechanism.error_quantile(share) for share in shares])[:, None, None] * self.sd
        low, high = each.min(axis=1), each.max(axis=1)
        wanted = np.array(shares)[:, None]
        for _ in range(_HALVINGS if len(self.weights) > 1 else 0):
            middle = (low + high) / 2
            beyond = self.share_below(mechanism, middle[:, None]) >= wanted
            low, high = np.where(beyond, low, middle), np.where(beyond, middle, high)
        return np.asarray((low + high) / 2)


def _chance(there: Posterior, passes: float, beyond: Floats | float = 0.0) -> Floats:
    """Probability of passing, the regression moved by `beyond` towards it."""
    one = there.mechanism.probability_of(there.latent + (beyond if passes == 1.0 else -np.asarray(beyond)))
    return one if passes == 1.0 else 1.0 - one


def _probability_of(mechanism: Mechanism, bound: Threshold, after: _Next) -> Floats:
    # A bound that no value of the target can go below (a time of 0 s) lies infinitely far on a log scale.
    reachable = bound.bound > LEAST[mechanism.transform]
    limit = transformed(np.array(bound.bound), mechanism.transform) if reachable else np.array(-np.inf)
    below = after.share_below(mechanism, limit)
    return below if bound.op in ("<=", "<") else 1.0 - below
