"""Are a profile's causes the true ones? Accuracy, precision, recall, F1 and RMSE over faults whose causes are known.

The protocol is the paper's (Hossen et al. 2023, RQ1): every option of every fault is a cell, predicted a cause or not,
truly one or not. Beside the profile stands cooperative bug isolation (Liblit et al. 2005) on the same runs, and, where
the folder holds them, the predictions that were published with the faults.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from care_core.causal.model import Model
from care_core.errors import LearningError
from care_core.learn.baselines import cooperative_bug_isolation
from care_core.learn.outcomes import met
from care_core.profile.schema import Schema

CAUSES = 3
"""Causes named per fault, one rule for all faults; `ALSO` are reported beside it."""
ALSO = (2, 3, 4)
FAULTY_RUNS = 2
"""The first rows of a fault file are the faulty runs; the others were given with them."""
METHODS = ("care", "cbi", "published")

_FAULT_FILE = re.compile(r"(?P<robot>.+)_fault_(?P<objective>.+)_(?P<number>\d+)\.csv")


@dataclass(frozen=True, eq=False)
class FaultFile:
    """One fault: its runs (the faulty ones first), the objective that it breaks, and what is known of its causes."""

    name: str
    objective: str
    runs: pd.DataFrame
    true: frozenset[str]
    published: frozenset[str] | None
    fixed: frozenset[str]
    """True causes that do not vary in the file, so that no method can find them in it."""


@dataclass(frozen=True)
class Scores:
    """The paper's measures over all cells, as fractions. `rmse` is in spreads of the objective, see `score`."""

    accuracy: float
    precision: float
    recall: float
    f1: float
    rmse: float


@dataclass(frozen=True, eq=False)
class Evaluation:
    """`scores` by number of causes named per fault and by method; `predicted` for `CAUSES`, per fault and method."""

    faults: tuple[FaultFile, ...]
    scores: Mapping[int, Mapping[str, Scores]]
    predicted: Mapping[str, Mapping[str, frozenset[str]]]

    @property
    def methods(self) -> tuple[str, ...]:
        return tuple(self.scores[CAUSES])


def evaluate(schema: Schema, model: Model, faults: Sequence[FaultFile]) -> Evaluation:
    """Name the causes of every fault with each method, and compare them with the true ones."""
    care = {fault.name: rank_causes(schema, model, fault) for fault in faults}
    cbi = {fault.name: rank_by_cbi(schema, fault) for fault in faults}
    published = {fault.name: fault.published for fault in faults if fault.published is not None}
    scores, predicted = {}, {}
    for count in sorted({CAUSES, *ALSO}):
        named: dict[str, Mapping[str, frozenset[str]]] = {
            "care": {name: frozenset(ranking[:count]) for name, ranking in care.items()},
            "cbi": {name: frozenset(ranking[:count]) for name, ranking in cbi.items()},
        }
        if len(published) == len(faults):
            named["published"] = published
        scores[count] = {method: score(schema, model, faults, answers) for method, answers in named.items()}
        if count == CAUSES:
            predicted = named
    return Evaluation(tuple(faults), scores, predicted)


def rank_causes(schema: Schema, model: Model, fault: FaultFile) -> list[str]:
    """Options by the share of the faulty runs in which they are off what the other runs mostly had (an option off in
    every faulty run can explain them all), then by their total effect on the objective in the model (Eq. 1), then by
    how far off they are. An option that was never off and has no effect in the model is not named."""
    faulty, reference = fault.runs[:FAULTY_RUNS], usual_values(schema, fault)
    keys: dict[str, tuple[float, float, float, str]] = {}
    for option in schema.options:
        values = faulty[option.name].to_numpy(dtype=float)
        off = values != reference[option.name]
        record = model.effects.get((option.name, fault.objective))
        effect = record.effect if record is not None and record.identified else 0.0
        if off.any() or effect > 0:
            spread = model.summaries[option.name].spread or 1.0
            far = float(np.abs(values - reference[option.name]).max()) / spread
            keys[option.name] = (-float(off.mean()), -effect, -far, option.name)
    return sorted(keys, key=lambda name: keys[name])


def usual_values(schema: Schema, fault: FaultFile) -> dict[str, float]:
    """The value that most of the runs given with a fault had, per option."""
    others = fault.runs[FAULTY_RUNS:]
    return {option.name: float(others[option.name].mode().iloc[0]) for option in schema.options}


def rank_by_cbi(schema: Schema, fault: FaultFile) -> list[str]:
    """Options whose predicate, true in a faulty run, has importance above zero in the runs of the file, best first."""
    failed: NDArray[np.bool_] = np.nan_to_num(met(schema.variables[fault.objective], fault.runs), nan=0.0) == 0.0
    failed[:FAULTY_RUNS] = True
    options = [option.name for option in schema.options]
    best: dict[str, float] = {}
    for row in fault.runs[:FAULTY_RUNS][options].to_dict("records"):
        config = {str(name): float(value) for name, value in row.items()}
        for name, importance in cooperative_bug_isolation(fault.runs, failed, config, schema, options).items():
            best[name] = max(best.get(name, 0.0), importance)
    return [name for name in sorted(best, key=lambda name: (-best[name], name)) if best[name] > 0]


def score(schema: Schema, model: Model, faults: Iterable[FaultFile], predicted: Mapping[str, frozenset[str]]) -> Scores:
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


def read_faults(folder: Path, schema: Schema, truths: Sequence[Path] = ()) -> tuple[FaultFile, ...]:
    """Every fault of the profile's objectives in a folder (`ROBOT_fault_OBJECTIVE_N.csv`), with its true causes.

    Truths (`ROBOT_ground_truth_*.csv`, row N for fault N, a column an option) and published predictions
    (`ROBOT_predictions_*.csv`) are found beside the faults, unless `truths` names the former.

    Raises:
        LearningError: no fault file, a file without the profile's columns, or no truth for an objective.
    """
    found: dict[str, dict[int, Path]] = {}
    robots = set()
    for path in sorted(folder.glob("*_fault_*.csv")):
        match = _FAULT_FILE.fullmatch(path.name)
        if match and match["objective"] in {objective.name for objective in schema.objectives}:
            found.setdefault(match["objective"], {})[int(match["number"])] = path
            robots.add(match["robot"])
    if not found:
        raise LearningError(
            f"The folder holds no fault of profile '{schema.name}'.",
            hint="Its files are called ROBOT_fault_OBJECTIVE_N.csv.",
            where=str(folder),
        )
    if len(robots) > 1:
        raise LearningError(
            f"The folder holds faults of several robots: {', '.join(sorted(robots))}.",
            hint="Put each robot's faults in a folder of its own.",
            where=str(folder),
        )
    robot = robots.pop()
    truth = _by_objective(truths or sorted(folder.glob(f"{robot}_ground_truth_*.csv")), list(found))
    published = _by_objective(sorted(folder.glob(f"{robot}_predictions_*.csv")), list(found))
    faults = []
    for objective, files in found.items():
        if objective not in truth:
            raise LearningError(
                f"There is no table of true causes for '{objective}'.", hint="Name it with --truth.", where=str(folder)
            )
        true = _causes(truth[objective], schema)
        answers = _causes(published[objective], schema) if objective in published else {}
        faults += [
            _fault(f"{objective} {n}", objective, path, schema, true.get(n), answers.get(n))
            for n, path in sorted(files.items())
        ]
    return tuple(faults)


def _by_objective(files: Sequence[Path], objectives: Sequence[str]) -> dict[str, Path]:
    """Which file belongs to which objective: by its name in the file's, the one left over to the one left over."""
    matched = {name: path for name in objectives for path in files if name.casefold() in path.stem.casefold()}
    left = [path for path in files if path not in matched.values()]
    missing = [name for name in objectives if name not in matched]
    if len(left) == len(missing) == 1:
        matched[missing[0]] = left[0]
    return matched


def _read(path: Path, wanted: Sequence[str]) -> pd.DataFrame:
    try:
        frame = pd.read_csv(path)
    except (OSError, ValueError, UnicodeDecodeError) as err:
        raise LearningError(f"Cannot read the table: {err}.", where=str(path)) from err
    absent = [name for name in wanted if name not in frame]
    if absent:
        raise LearningError(
            f"The table has no column '{absent[0]}'.", hint="It needs a column for every option.", where=str(path)
        )
    return frame


def _causes(path: Path, schema: Schema) -> dict[int, frozenset[str]]:
    """Fault number (from 1) to the options whose cell is 1."""
    names = [option.name for option in schema.options]
    frame = _read(path, names)
    return {n: frozenset(name for name in names if row[name] == 1) for n, (_, row) in enumerate(frame.iterrows(), 1)}


def _fault(
    name: str,
    objective: str,
    path: Path,
    schema: Schema,
    true: frozenset[str] | None,
    published: frozenset[str] | None,
) -> FaultFile:
    if true is None:
        raise LearningError(f"The table of true causes has no row for {name}.", where=str(path))
    runs = _read(path, [*(option.name for option in schema.options), objective])
    if len(runs) <= FAULTY_RUNS:
        raise LearningError(
            f"The file needs more than {FAULTY_RUNS} runs: the faulty ones, then others.", where=str(path)
        )
    fixed = frozenset(cause for cause in true if runs[cause].nunique() == 1)
    return FaultFile(name, objective, runs, true, published, fixed)
