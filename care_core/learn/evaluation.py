"""Are a profile's causes the true ones? Accuracy, precision, recall, F1 and RMSE over faults whose causes are known.

The protocol is the paper's (Hossen et al. 2023, RQ1): every option of every fault is a cell, predicted a cause or not,
truly one or not. Beside each other stand the engine that `care triage` runs, with and without the runs of the file; the
rule that the paper's artifact follows; a ranking by deviation from the other runs; cooperative bug isolation (Liblit
et al. 2005); and, where the folder holds them, the predictions that were published with the faults.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Literal

import numpy as np

from care_core.causal.model import Model
from care_core.learn.fault_files import FaultFile
from care_core.learn.naming import by_bug_isolation, by_deviation, by_engine, by_paper_rule, outside_support, taught_by
from care_core.profile.schema import Schema
from care_core.records import Record

CAUSES = 3
"""Causes named per fault, one rule for all faults; `ALSO` are reported beside it."""
ALSO = (2, 3, 4)
Method = Literal["paper", "engine", "all"]
WITHOUT_COUNT = frozenset({"paper", "published", "published_varying", "oracle"})
"""Methods that say themselves how many options they name."""

Answers = Mapping[str, frozenset[str]]
"""Fault to the options named."""


class Scores(Record):
    """The paper's measures over all cells, as fractions. `rmse`: standard deviations of the objective, see `score`."""

    accuracy: float
    precision: float
    recall: float
    f1: float
    rmse: float


class Evaluation(Record, eq=False):
    """`scores` by number of causes named per fault and by method; `predicted` for `CAUSES`, per method and fault.

    `outside` lists the (fault, true cause) pairs whose faulty value the profile's training never met.
    """

    faults: tuple[FaultFile, ...]
    scores: Mapping[int, Mapping[str, Scores]]
    predicted: Mapping[str, Answers]
    outside: tuple[tuple[str, str], ...]


def evaluate(schema: Schema, model: Model, faults: Sequence[FaultFile], method: Method = "all") -> Evaluation:
    """Name the causes of every fault with each method, and compare them with the true ones.

    Args:
        method: the paper's rule, the engine, or everything; bug isolation and what was published stand beside each.
    """
    rankings = _rankings(schema, model, faults, method)
    fixed = _published(faults)
    if method != "engine":
        fixed["paper"] = {fault.name: by_paper_rule(schema, fault) for fault in faults}
    scores, predicted = {}, {}
    for count in sorted({CAUSES, *ALSO}):
        named: dict[str, Answers] = {
            name: {fault: frozenset(ranking[:count]) for fault, ranking in answers.items()}
            for name, answers in rankings.items()
        }
        named |= fixed
        scores[count] = {name: score(schema, model, faults, answers) for name, answers in named.items()}
        if count == CAUSES:
            predicted = named
    return Evaluation(tuple(faults), scores, predicted, tuple(outside_support(schema, model, faults)))


def _rankings(
    schema: Schema, model: Model, faults: Sequence[FaultFile], method: Method
) -> dict[str, dict[str, list[str]]]:
    """Method to fault to options, the likeliest cause first."""
    found = {}
    if method != "paper":
        found["engine"] = {f.name: by_engine(schema, taught_by(schema, model, f), f) for f in faults}
        found["engine_without_file"] = {f.name: by_engine(schema, model, f) for f in faults}
    if method == "all":
        found["care"] = {f.name: by_deviation(schema, model, f) for f in faults}
    found["cbi"] = {f.name: by_bug_isolation(schema, f) for f in faults}
    return found


def _published(faults: Sequence[FaultFile]) -> dict[str, Answers]:
    """What was published with the faults, that without the options that never vary, and the best that those allow."""
    published = {fault.name: fault.published for fault in faults if fault.published is not None}
    if len(published) < len(faults):
        return {}
    return {
        "published": published,
        "published_varying": {f.name: frozenset(filter(f.varies, published[f.name])) for f in faults},
        "oracle": {f.name: frozenset(filter(f.varies, f.true)) for f in faults},
    }


def score(schema: Schema, model: Model, faults: Iterable[FaultFile], predicted: Answers) -> Scores:
    """The paper's measures. RMSE weighs every wrong cell with the option's ACE on the fault's objective in the model:
    sqrt(mean over cells of (ACE(o) ([o true] - [o predicted]))^2)."""
    true, named, weight = [], [], []
    for fault in faults:
        for option in schema.options:
            record = model.effects.get((option.name, fault.objective))
            true.append(option.name in fault.true)
            named.append(option.name in predicted[fault.name])
            weight.append(record.effect if record is not None else 0.0)
    y, p, ace = np.array(true), np.array(named), np.array(weight)
    hits = int((y & p).sum())
    precision = hits / p.sum() if p.any() else 0.0
    recall = hits / y.sum() if y.any() else 0.0
    return Scores(
        accuracy=float((y == p).mean()),
        precision=float(precision),
        recall=float(recall),
        f1=float(2 * hits / (y.sum() + p.sum())) if (y | p).any() else 0.0,
        rmse=float(np.sqrt(((ace * (y.astype(float) - p)) ** 2).mean())),
    )
