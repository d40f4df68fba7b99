"""Runs table + graph -> how each objective is predicted from the options that cause it.

A functional objective is taken apart into stages, the binary metrics that end a mission when they go wrong (a refused
arming, a failsafe): each is learned on the missions that reached it, so a mission that never flew still teaches what
refuses arming and does not blur what makes a flight fail. A non-functional objective is learned on the missions in
which it exists.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from care_core.causal.graph import CausalGraph
from care_core.causal.mechanisms import Averaging, Mechanism, transformed
from care_core.causal.model import OutcomeRecord, StageRecord
from care_core.causal.nominal import Nominal
from care_core.learn.fitting import (
    MIN_ROWS,
    WEAK,
    Effort,
    Fitted,
    Fold,
    Inputs,
    Rows,
    best_transform,
    drawn,
    drawn_folds,
    fit,
    held_out,
    logistic,
    tested_on_runs_left_out,
)
from care_core.learn.knowledge import with_known
from care_core.learn.relative import left_out_together, needs
from care_core.learn.table import varying
from care_core.numbers import Bools, Floats
from care_core.profile.schema import Schema
from care_core.records import Record, replace
from care_core.variables import Events, Role, Variable

MIN_CLASS = 5
"""Missions each way that a stage needs: with fewer there is nothing to learn about who fails it."""
MOVES_TOGETHER = 0.9
TELLING = 100
"""Runs from which those that are left out tell which inputs to take: 24 that are fitted and 6 that are asked do not."""
FEW_RUNS = 250
"""Runs below which what a search has not found is not taken to be absent. First causes on simulated robots, with it and
without it: 71 and 65 of 77 from 150 runs, 78 and 62 of 79 from 200, 78 and 76 of 78 from 300."""


class Stage(Record):
    """A stage as found in the table. `reached` and `passed` have shape (n,); the latter counts only where reached."""

    variable: str
    passes: float
    reached: Bools
    passed: Bools


def causes_of(name: str, graph: CausalGraph, schema: Schema, *, contexts: bool = False) -> tuple[str, ...]:
    """The exogenous variables that a mechanism for `name` reads: its option ancestors, and the `contexts` among its
    ancestors. Where options were chosen by what the run met, contexts are the adjustment and always read.

    What ends a mission also bends what is measured in it: the power of a vehicle that lies on its side says that it
    crashed, not why. So whether a stage is passed is told by what was asked, never by what was met on the way.
    """
    ancestors = graph.ancestors(name)
    ends = schema.variables[name].type == "bool" or schema.variables[name].kind == "functional"

    def is_read(variable: Variable) -> bool:
        if variable.role is Role.CONTEXT:
            return schema.observational or (contexts and (variable.about == "mission" or not ends))
        return variable.role is Role.OPTION

    return tuple(v.name for v in schema.variables.values() if v.name in ancestors and is_read(v))


def candidates(
    name: str, graph: CausalGraph, frame: pd.DataFrame, schema: Schema, effort: Effort
) -> list[tuple[str, ...]]:
    """Input sets to choose from: the options that the search found, those together with what people know, and those
    with the contexts that are known to act on it. Where runs are few, or runs that are left out choose among the sets,
    also all options: what a search has not found it has not ruled out, least where each option is seldom off its
    reference, and a regression under a sparse prior forgets what explains nothing."""
    sets = [causes_of(name, graph, schema)]
    if (len(frame) < FEW_RUNS or effort.folds) and not schema.observational:
        sets.append(varying_options(frame, schema))
    if schema.known:
        known = with_known(graph, frame, schema)
        sets += [causes_of(name, known, schema), causes_of(name, known, schema, contexts=True)]
    return list(dict.fromkeys(sets))


def varying_options(frame: pd.DataFrame, schema: Schema) -> tuple[str, ...]:
    """The options that the runs tell something about."""
    return varying(frame, [v.name for v in schema.options])


def inputs_of(names: Sequence[str], schema: Schema, nominal: Nominal | None = None) -> Inputs:
    """Inputs that a regression may read, and those that only a nominal needs."""
    every = tuple(dict.fromkeys((*names, *(nominal.inputs if nominal is not None else ()))))
    return Inputs(
        every,
        np.array([schema.variables[name].is_log_scaled for name in every], dtype=bool),
        np.array([name in names for name in every], dtype=bool),
        nominal,
    )


def met(objective: Variable, frame: pd.DataFrame, schema: Schema) -> Floats:
    """1 where the objective keeps its threshold, 0 where not, NaN where it has no value; shape (n,)."""
    values = frame[objective.name].to_numpy(dtype=float)
    if objective.fixed is None and objective.relative is not None:
        need = needs(objective, frame, schema)
        bounds = [None if np.isnan(n) else objective.relative.for_need(n) for n in need]
    else:
        bounds = [objective.fixed] * len(values)
    kept = [np.nan if np.isnan(v) else float(b.met(v)) if b else 1.0 for v, b in zip(values, bounds, strict=True)]
    return np.array(kept)


def badness(objective: Variable, frame: pd.DataFrame, schema: Schema) -> Floats:
    """How bad each run was: the value, turned so that more is worse, its logarithm where it has one; shape (n,)."""
    if objective.kind == "functional":
        return 1.0 - met(objective, frame, schema)
    values = frame[objective.name].to_numpy(dtype=float)
    known = values[np.isfinite(values)]
    scaled = transformed(values, best_transform(known)) if len(known) else values
    lower_is_worse = objective.threshold is not None and objective.threshold.op in (">=", ">")
    return -scaled if lower_is_worse else scaled


def find_stages(objective: Variable, schema: Schema, frame: pd.DataFrame) -> tuple[Stage, ...]:
    """The conditions on the way to a functional objective, in the order the profile declares them.

    A binary metric is a stage when every mission on its rarer-success side misses the objective. What the metrics
    leave unexplained is a last stage, the objective itself.
    """
    success = met(objective, frame, schema)
    reached = ~np.isnan(success)
    stages: list[Stage] = []
    for metric in schema.metrics:
        found = _stage(metric, frame, success, reached)
        if found is not None:
            stages.append(found)
            reached = reached & found.passed
    last = Stage(objective.name, 1.0, reached, reached & (success == 1.0))
    if _both_ways(last):
        stages.append(last)
    return tuple(stages)


def _stage(metric: Variable, frame: pd.DataFrame, success: Floats, reached: Bools) -> Stage | None:
    if metric.type != "bool":
        return None
    values = frame[metric.name].to_numpy(dtype=float)
    here = reached & ~np.isnan(values)
    for passes in (0.0, 1.0):
        stage = Stage(metric.name, passes, here, here & (values == passes))
        failed = here & (values != passes)
        if _both_ways(stage) and not (success[failed] == 1.0).any():
            # A mission without the metric's value is not stopped by it.
            return Stage(metric.name, passes, here, reached & ~failed)
    return None


def _both_ways(stage: Stage) -> bool:
    reached, passed = int(stage.reached.sum()), int((stage.reached & stage.passed).sum())
    return reached >= MIN_ROWS and MIN_CLASS <= passed <= reached - MIN_CLASS


Outcomes = tuple[dict[str, OutcomeRecord], dict[str, Mechanism]]


def fit_outcomes(
    frame: pd.DataFrame, schema: Schema, graph: CausalGraph, rng: np.random.Generator, *, effort: Effort
) -> Outcomes:
    """Mechanisms of every objective that the graph gives a cause and the table gives values."""
    of_objectives = questions_of_objectives(frame, schema, graph, rng, effort=effort)
    return put_together(of_objectives, [question.answer() for one in of_objectives for question in one.questions])


class ObjectiveQuestions(Record, eq=False):
    """An objective, its stages if it has any, and the questions whose answers are its mechanisms: one each."""

    objective: str
    stages: tuple[StageRecord, ...]
    questions: tuple[Question, ...]


def questions_of_objectives(
    frame: pd.DataFrame, schema: Schema, graph: CausalGraph, rng: np.random.Generator, *, effort: Effort
) -> list[ObjectiveQuestions]:
    """What has to be fitted for every objective that the graph gives a cause and the table gives values."""
    found = []
    for objective in schema.objectives:
        if objective.kind == "functional":
            found.append(_by_stages(objective, frame, schema, graph, rng, effort))
        else:
            question = ask_total(objective.name, frame, schema, graph, rng, effort=effort)
            found.append(ObjectiveQuestions(objective.name, (), () if question is None else (question,)))
    return found


def put_together(of_objectives: Sequence[ObjectiveQuestions], answers: Sequence[Mechanism]) -> Outcomes:
    """The outcomes from the answers to all their questions, in order."""
    outcomes: dict[str, OutcomeRecord] = {}
    mechanisms: dict[str, Mechanism] = {}
    left = iter(answers)
    for one in of_objectives:
        found = {question.target: next(left) for question in one.questions}
        if one.stages and any(mechanism.inputs for mechanism in found.values()):
            outcomes[one.objective] = OutcomeRecord(objective=one.objective, stages=one.stages)
            mechanisms.update(found)
        elif found and not one.stages:
            outcomes[one.objective] = OutcomeRecord(objective=one.objective, mechanism=one.objective)
            mechanisms.update(found)
    return outcomes, mechanisms


def _by_stages(
    objective: Variable,
    frame: pd.DataFrame,
    schema: Schema,
    graph: CausalGraph,
    rng: np.random.Generator,
    effort: Effort,
) -> ObjectiveQuestions:
    records, questions = [], []
    for stage in find_stages(objective, schema, frame):
        # A stage that no option moves stays in, with its base rate: else its failures would be laid to a later one.
        key = f"stage:{stage.variable}"
        one = stage.passed if stage.passes == 1.0 else ~stage.passed
        table = frame.assign(**{key: np.where(stage.reached, one.astype(float), np.nan)})
        sets = candidates(stage.variable, graph, frame, schema, effort)
        question = ask(sets, key, table, schema, rng, effort=effort)
        if question is not None:
            questions.append(question)
            records.append(StageRecord(variable=stage.variable, passes=stage.passes, mechanism=key))
    return ObjectiveQuestions(objective.name, tuple(records), tuple(questions))


def fit_total(
    name: str, frame: pd.DataFrame, schema: Schema, graph: CausalGraph, rng: np.random.Generator, *, effort: Effort
) -> Mechanism | None:
    """The answer to `ask_total`."""
    question = ask_total(name, frame, schema, graph, rng, effort=effort)
    return None if question is None else question.answer()


def fit_on(
    sets: Sequence[Sequence[str]],
    target: str,
    frame: pd.DataFrame,
    schema: Schema,
    rng: np.random.Generator,
    *,
    effort: Effort,
) -> Mechanism | None:
    """The answer to `ask`."""
    question = ask(sets, target, frame, schema, rng, effort=effort)
    return None if question is None else question.answer()


def ask_total(
    name: str, frame: pd.DataFrame, schema: Schema, graph: CausalGraph, rng: np.random.Generator, *, effort: Effort
) -> Question | None:
    """For the variable as a function of the exogenous variables that cause it; None where it has no cause or no
    values."""
    sets = [names for names in candidates(name, graph, frame, schema, effort) if names]
    if len(frame) >= FEW_RUNS and not causes_of(name, with_known(graph, frame, schema), schema, contexts=True):
        return None  # many runs, and nothing was found that acts on it, or is known to
    return ask(sets, name, frame, schema, rng, effort=effort)


class _Set(Record, eq=False):
    """Inputs that a target may be read from, their values in the known runs, shape (n, p), the runs that a fit keeps,
    and what is added to its loss."""

    inputs: Inputs
    x: Floats
    kept: Rows
    penalty: float
    is_whole: bool
    """Whether all options are among them, and the runs so many that this is no risk."""


class Question(Record, eq=False):
    """A target as a function of the input set that predicts left-out runs best.

    What chance decides was drawn when it was asked, so any process may answer it, in any order.
    """

    target: str
    y: Floats
    groups: NDArray[np.int64]
    sets: tuple[_Set, ...]
    folds: tuple[Fold, ...]
    effort: Effort
    parts: _Parts | None

    @property
    def binary(self) -> bool:
        """Whether the target is a yes or a no."""
        return _is_binary(self.y)

    def answer(self) -> Mechanism:
        """Fit it."""
        is_told = self.folds and len(self.y) >= TELLING
        mechanism = self._on_runs_left_out() if is_told else self._on_all_runs()
        return mechanism if self.parts is None else replace(mechanism, averaging=self.parts.averaging(mechanism))

    def _on_all_runs(self) -> Mechanism:
        """The set by the errors of each run without its own group, all runs together having chosen the relevances."""
        fitted = [self._fit(one) for one in self.sets]
        losses = [found.loss + one.penalty for found, one in zip(fitted, self.sets, strict=True)]
        place = int(np.argmin(np.nan_to_num(losses, nan=np.inf)))
        return self._with_errors(fitted[place].mechanism, self.sets[place])

    def _on_runs_left_out(self) -> Mechanism:
        """The set by runs that no fit has seen: of 320 missions under move_base the errors above chose sets for time
        and energy that were 0.9 nats a run worse on those than the ones that the search had found. How probabilities
        are calibrated, and how far values are off, is theirs, too."""
        held = [
            held_out(
                one.x, self.y, one.inputs, binary=self.binary, effort=self.effort, groups=self.groups, folds=self.folds
            )
            for one in self.sets
        ]
        place = chosen([one.loss for one in held], [one.is_whole for one in self.sets])
        best = self.sets[place]
        mechanism = self._fit(best).mechanism
        if self.binary:
            return replace(mechanism, calibration=logistic(held[place].latent, self.y))
        return self._with_errors(mechanism, best)

    def _with_errors(self, mechanism: Mechanism, one: _Set) -> Mechanism:
        if self.binary:
            return mechanism
        return tested_on_runs_left_out(
            mechanism, one.x, self.y, replace(one.inputs, least=0.0),
            effort=self.effort, groups=self.groups, folds=self.folds,
        )  # fmt: skip

    def _fit(self, one: _Set) -> Fitted:
        kept = one.kept
        groups = self.groups[kept]
        return fit(one.x[kept], self.y[kept], one.inputs, binary=self.binary, effort=self.effort, groups=groups)


def ask(
    sets: Sequence[Sequence[str]],
    target: str,
    frame: pd.DataFrame,
    schema: Schema,
    rng: np.random.Generator,
    *,
    effort: Effort,
) -> Question | None:
    """The question which of the input sets predicts the target best; None where too few runs hold it.

    A context that a run does not have is taken to be at its median, as where the mechanism is asked. The sets are
    compared on the runs that have all inputs of each; one with an input that no run has is left out.

    Args:
        rng: draws the runs that each fit keeps, and those that are left out in turn.
    """
    nominal = schema.nominal_of(target) if target in schema.variables else None
    met = {v.name: frame[v.name].fillna(frame[v.name].median()) for v in schema.contexts if v.name in frame}
    filled = frame.assign(**met)
    asked = [inputs_of(names, schema, nominal) for names in sets]
    asked = [inputs for inputs in asked if filled[list(inputs.names)].notna().any().all()]
    if not asked:
        return None
    every = list(dict.fromkeys(name for inputs in asked for name in inputs.names))
    known = filled[[*every, target]].notna().all(axis=1).to_numpy()
    if nominal is not None:
        known = known & (frame[target].to_numpy(dtype=float) > 0)
    y = frame.loc[known, target].to_numpy(dtype=float)
    if len(y) < MIN_ROWS or np.ptp(y) == 0:
        return None
    groups = left_out_together(frame, schema)[known]
    options = set(varying_options(frame, schema))
    compared = []
    for inputs in asked:
        read = [name for name, is_read in zip(inputs.names, inputs.read, strict=True) if is_read]
        x, kept = filled.loc[known, list(inputs.names)].to_numpy(dtype=float), drawn(len(y), effort, rng)
        is_whole, are_few = options.issubset(read), len(frame) < FEW_RUNS
        if is_whole and (are_few or effort.folds):
            # Their relevances were chosen on the runs that they are tested on: one nat each, as Akaike counts.
            penalty = len(read) / len(y)
            compared.append(_Set(replace(inputs, least=WEAK), x, kept, penalty, is_whole and not are_few))
        if not (is_whole and are_few):
            compared.append(_Set(inputs, x, kept, 0.0, is_whole))
    folds = drawn_folds(groups, effort, rng)
    events = schema.variables[target].events if target in schema.variables else None
    parts = None if events is None else _Parts.seen(events, target, filled)
    return Question(target, y, groups, tuple(compared), folds, effort, parts)


def chosen(losses: Sequence[Floats], is_whole: Sequence[bool]) -> int:
    """Place of the input set to take: the one with the least mean loss of the runs, shape (n,) each, or one of all
    options where that is no worse by more than a standard error. An option that is left out is never named."""
    order = np.argsort(np.nan_to_num([loss.mean() for loss in losses], nan=np.inf), kind="stable").tolist()
    best: int = order[0]
    for place in order:
        behind = losses[place] - losses[best]
        if is_whole[place] and behind.mean() <= behind.std() / np.sqrt(len(behind)):
            return int(place)
    return best


def _is_binary(y: Floats) -> bool:
    return set(np.unique(y)) <= {0.0, 1.0}


class _Parts(Record):
    """How many like parts the missions have that hold a target, and the variance of their mean that each part alone
    explains."""

    count: str
    usual: float
    own: float

    @classmethod
    def seen(cls, events: Events, target: str, frame: pd.DataFrame) -> _Parts | None:
        runs = frame.loc[frame[target].notna(), [events.count, events.variation]].dropna()
        usual = float(runs[events.count].median())
        if not len(runs) or not usual > 0:
            return None
        return cls(events.count, usual, float((runs[events.variation] ** 2 / runs[events.count]).mean()))

    def averaging(self, mechanism: Mechanism) -> Averaging | None:
        """How much of the noise belongs to each part of a mission alone: what its parts differ by, averaged over
        them."""
        if self.count not in mechanism.inputs:
            return None
        return Averaging(self.count, self.usual, min(1.0, self.own / max(mechanism.noise_sd**2, 1e-12)))


def groups_that_move_together(schema: Schema, frame: pd.DataFrame) -> tuple[tuple[str, ...], ...]:
    """Non-functional objectives that get worse together: rank correlation over the runs above 0.9, both taken in the
    direction of their thresholds."""
    names = [v.name for v in schema.objectives if v.kind == "non-functional"]
    if len(names) < 2:
        return ()
    sign = {
        v.name: -1.0 if v.threshold is not None and v.threshold.op in (">=", ">") else 1.0 for v in schema.objectives
    }
    # Ranks by pandas, so that Spearman's correlation needs no further library.
    badness = frame[names].mul([sign[name] for name in names]).rank()
    correlation: Mapping[str, Mapping[str, float]] = badness.corr().to_dict()
    groups: list[list[str]] = []
    for name in names:
        home = next((g for g in groups if all(correlation[name][other] > MOVES_TOGETHER for other in g)), None)
        if home is None:
            groups.append([name])
        else:
            home.append(name)
    return tuple(tuple(group) for group in groups if len(group) > 1)
