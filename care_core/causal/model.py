"""What was learned of a platform: graph, effects, mechanisms, and what the training runs held.

Files hold these records as they are (`care_core.records`); nothing here knows of files.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Literal

import numpy as np

from care_core.causal.effects import Direction
from care_core.causal.graph import CausalGraph
from care_core.causal.mechanisms import TAIL, Mechanism, columns
from care_core.numbers import Floats
from care_core.records import Record, field, replace
from care_core.variables import Threshold


class EdgeRecord(Record, kw_only=True):
    """An edge with the share of bootstrap resamples that hold it, and its effect (Eq. 1, scaled) with its interval."""

    source: str
    target: str
    kind: Literal["directed", "bidirected"]
    support: float
    effect: float = 0.0
    low: float = 0.0
    high: float = 0.0
    direction: Direction = "none"

    @property
    def signed_effect(self) -> float:
        """The effect as an operator reads it: negative where more of the source makes less of the target."""
        return -self.effect if self.direction == "decreasing" else self.effect


class EffectRecord(Record, kw_only=True):
    """Total effect of an option on an objective: identification and Eq. 1 with its bootstrap interval."""

    option: str
    objective: str
    identified: bool
    functional: str
    adjustment: tuple[str, ...] = ()
    effect: float
    low: float
    high: float
    direction: Direction
    support: float | None = None
    """Share of bootstrap resamples in which the option has a directed path to the objective; None: not measured."""
    robustness: float | None = None
    """Observational tables: share of both that a hidden cause must explain to explain the effect away; None: options
    were drawn at random."""
    strongest: float | None = None
    """Observational tables: share of the objective that the strongest other recorded cause explains."""

    @property
    def doubtful(self) -> float:
        """Observational tables: share of the effect, 0 to 1, that a hidden cause as strong as the strongest recorded
        one could be behind; all of it where the runs were too few to say.

        The bias of one that explains a share R of option and objective goes with R / sqrt(1 - R) (Cinelli and Hazlett
        2020); at the robustness value it is the whole effect.
        """
        if self.robustness is None or self.strongest is None:
            return 1.0
        shares = (min(share, 0.99) for share in (self.strongest, self.robustness))
        hidden, needed = (share / (1.0 - share) ** 0.5 for share in shares)
        return 1.0 if hidden >= needed else hidden / needed


class PathRecord(Record, kw_only=True):
    """A ranked path (Eq. 2) with its bootstrap interval, which way it moves the objective, and each edge's support."""

    objective: str
    nodes: tuple[str, ...]
    ace: float
    low: float
    high: float
    direction: Direction = "none"
    edge_support: tuple[float, ...] = ()


class Summary(Record, kw_only=True):
    """What the training runs held of one variable: `quantiles` at 0, 5, ... 100%; `sd` is "spread" in the file."""

    count: int
    mean: float
    sd: float = field(name="spread")
    quantiles: tuple[float, ...]

    def __post_init__(self) -> None:
        if len(self.quantiles) < 2:
            raise ValueError("quantiles should be two at least")

    @property
    def low(self) -> float:
        return self.quantiles[0]

    @property
    def high(self) -> float:
        return self.quantiles[-1]

    def percentile(self, value: float) -> float:
        """Share (0 to 1) of the training runs with a smaller value."""
        levels = np.linspace(0, 1, len(self.quantiles))
        above = int(np.searchsorted(self.quantiles, value, side="right"))
        # Between quantiles that hardly differ the slope is infinite, so a share stays within their levels.
        least, most = levels[max(above - 1, 0)], levels[min(above, len(levels) - 1)]
        return float(np.clip(np.interp(value, self.quantiles, levels), least, most))

    def share_meeting(self, bound: Threshold) -> float:
        """Share (0 to 1) of the training runs that kept a threshold, by the quantiles; kept off 0 and 1."""
        levels = np.interp(np.linspace(0, 1, 201), np.linspace(0, 1, len(self.quantiles)), self.quantiles)
        if bound.op == "==":
            levels = np.round(levels)
        return float(np.clip(np.mean([bound.met(float(level)) for level in levels]), TAIL, 1 - TAIL))

    def with_values(self, values: Iterable[float]) -> Summary:
        """The same with its ends drawn out to a few more values."""
        known = [value for value in values if np.isfinite(value)]
        low, high = min((self.low, *known)), max((self.high, *known))
        return replace(self, quantiles=(low, *self.quantiles[1:-1], high))

    def times(self, factor: float) -> Summary:
        """The same in another unit."""
        quantiles = tuple(q * factor for q in self.quantiles)
        return replace(self, mean=self.mean * factor, sd=self.sd * factor, quantiles=quantiles)

    def quantile(self, share: float) -> float:
        """The value that this share of the training runs stays below."""
        return float(np.interp(share, np.linspace(0, 1, len(self.quantiles)), self.quantiles))


class Mediation(Record, kw_only=True):
    """Metrics whose errors in a run are part of an objective's, all in standard deviations around the predictions."""

    metrics: tuple[str, ...]
    weights: tuple[float, ...]
    """Of each metric's error in the objective's."""
    among: tuple[tuple[float, ...], ...]
    """Correlations of the metrics' errors."""

    def __post_init__(self) -> None:
        if not self.metrics:
            raise ValueError("no metric mediates")
        if {len(self.metrics)} != {len(self.weights), len(self.among), *map(len, self.among)}:
            raise ValueError("metrics, weights and correlations differ in number")


class StageRecord(Record, kw_only=True):
    """One condition on the way to a functional objective: the mission passes when `variable` equals `passes`."""

    variable: str
    passes: float
    mechanism: str


class OutcomeRecord(Record, kw_only=True):
    """How an objective is predicted: `stages` for a functional one (all must pass, in order), else one mechanism."""

    objective: str
    stages: tuple[StageRecord, ...] = ()
    mechanism: str = ""
    mediation: Mediation | None = None
    """Of the one mechanism."""

    @property
    def mechanisms(self) -> tuple[str, ...]:
        """Those that predict it, in order."""
        return tuple(stage.mechanism for stage in self.stages) or (self.mechanism,)


class SkillRecord(Record, kw_only=True):
    """How well the predicted probabilities of an objective fit runs that were held out."""

    runs: int
    base_rate: float
    log_loss: float
    brier: float
    calibration_error: float
    auc: float | None = None
    """None where all runs met the threshold, or none did."""
    curve: tuple[tuple[float, float, int], ...] = ()
    """Calibration: mean predicted probability, share that met the threshold, runs; a row a tenth that has runs."""


class NoiseCarryOver(Record, kw_only=True):
    """Share of an objective's noise variance that a run of the same configuration meets again.

    `same`: under the same conditions. `another`: on another day. `pairs`: of repeated training runs that say so, for
    each; where there are none the value is the middle of what is possible.
    """

    same: float
    another: float
    pairs: tuple[int, int] = (0, 0)

    def shares(self, *, same: bool) -> tuple[Floats, Floats]:
        """Shares that it may be, and how likely each is: a beta distribution around the mean, as wide as the pairs
        leave it. Without any pair under the same conditions each is as likely as the next.

        The mean alone lets the error of a run, however far beyond all noise, go on to the next by just that share: a
        robot that took half as long again for how it was set would be sure to lose a quarter after its repair.
        """
        mean, pairs = (self.same, self.pairs[0]) if same else (self.another, self.pairs[1])
        strength = 2.0 + pairs / 2.0
        at = (np.arange(SHARES) + 0.5) / SHARES
        density = np.exp((strength * mean - 1) * np.log(at) + (strength * (1 - mean) - 1) * np.log(1 - at))
        return at, np.asarray(density / density.sum())


SHARES = 10
"""Shares of the noise that are told apart."""
UNKNOWN_CARRY_OVER = NoiseCarryOver(same=0.9, another=0.25)
"""Where no configuration was run twice. Under the same conditions: of 0.5, 0.75 and 0.9 the one with the least log
loss over 545 resets of failed missions of three simulated robots, each run under the conditions of the failure; on
another day it is not known."""


class ReferenceRuns(Record, kw_only=True):
    """Training runs at the reference configuration, and those of them that missed an objective."""

    runs: int = 0
    failed: int = 0


class Training(Record, kw_only=True):
    """Where the model came from."""

    origin: str
    runs: int
    seed: int
    alpha: float
    resamples: int
    screened_out: tuple[str, ...] = ()
    direct_edges: tuple[tuple[str, str, float], ...] = ()
    """Option -> objective edges that the metrics do not explain, with the p-value that kept them."""
    moves_together: tuple[tuple[str, ...], ...] = ()
    """Groups of non-functional objectives that rise and fall together (rank correlation above 0.9)."""
    carry_over: Mapping[str, NoiseCarryOver] = field(default_factory=dict, name="persistence")
    """Per objective, where training runs were repeated; "persistence" in the file."""
    reference: ReferenceRuns = ReferenceRuns()
    notes: tuple[str, ...] = ()


class Model(Record, eq=False):
    """What was learned of a platform. `mechanisms` are keyed by the variable they predict (stages: `stage:NAME`)."""

    schema_digest: str
    graph: CausalGraph
    edges: Mapping[tuple[str, str], EdgeRecord]
    """Directed edges only; confounded pairs are in the graph's bidirected edges."""
    bidirected: tuple[EdgeRecord, ...]
    effects: Mapping[tuple[str, str], EffectRecord]
    paths: Mapping[str, tuple[PathRecord, ...]]
    outcomes: Mapping[str, OutcomeRecord]
    summaries: Mapping[str, Summary]
    skill: Mapping[str, SkillRecord]
    """By objective, and for `all` of them together."""
    training: Training
    mechanisms: Mapping[str, Mechanism] = field(default_factory=dict)
    correlated_metrics: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    """Per objective the metrics that go with missing it: correlation over the training runs, on scaled values."""

    def summary_at(self, name: str, reference: Mapping[str, float]) -> Summary | None:
        """What training held of a variable, on the mission of the run that `reference` belongs to.

        Values that have a nominal were compared by their ratio to it; here they are what the training configurations
        would have taken.
        """
        summary, mechanism = self.summaries.get(name), self.mechanisms.get(name)
        if summary is None or mechanism is None or mechanism.nominal is None:
            return summary
        return summary.times(float(mechanism.nominal.of(columns([reference], mechanism.nominal.inputs))[0]))

    def supports(self, option: str, value: float) -> bool:
        """Whether the training runs reach this value of the option."""
        summary = self.summaries.get(option)
        return summary is None or summary.low <= value <= summary.high
