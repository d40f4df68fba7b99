"""The artifact behind the paper, recomputed: its predictions digit by digit, its measures, its trials of ranks.

    python -m benchmarks.artifact --shared DIR

1. The ten Husky faults: every column scaled, the slope of the objective on each option alone by the same solver, the
   options of the three largest distinct magnitudes. What it rests on: the predictions that name constant columns.
2. The TurtleBot 3: its fault files were not published, so only the measures can be recomputed.
3. The trials of ranks: does the objective really vary more for a higher rank (Levene 1960, about the median)?
"""

from __future__ import annotations

import argparse
import warnings
from itertools import combinations
from pathlib import Path

import numpy as np
import pandas as pd
import statsmodels.api as sm
from scipy.stats import levene
from sklearn.preprocessing import scale

from care_core.learn.fault_files import FaultFile, read_faults
from care_core.learn.naming import SLOPES
from care_core.numbers import Floats
from care_core.profile.schema import Schema
from care_core.profile.store import load_profile

ROUNDING = 1e-12
"""Slopes on scaled columns below this are rounding."""
OBJECTIVES = {"Battery_percentage": "energy", "Mission_success": "mission_success"}
TRIALS = {"energy": "Energy (Whr)", "mission_success": "RNS"}
"""What the trials recorded of each objective; of success, the share of narrow passages that were passed."""
LEVEL = 0.05


def slopes(schema: Schema, fault: FaultFile) -> dict[str, float]:
    """Magnitude of the slope per option, as the artifact's solver rounds it: a Gaussian linear model, predicted at 1
    and at 0. Columns that never vary get what rounding leaves of them."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # constant columns: the design is singular, which is the point
        values: Floats = scale(fault.runs.to_numpy(dtype=float))
        table = dict(zip(fault.runs.columns, values.T, strict=True))
        return {option.name: _slope(table[option.name], table[fault.objective]) for option in schema.options}


def _slope(x: Floats, y: Floats) -> float:
    ones = np.ones(len(x))
    model = sm.GLM(y, np.column_stack([ones, x]), family=sm.families.Gaussian()).fit()
    at_one, at_zero = (model.predict(np.column_stack([ones, level])).mean() for level in (ones, 0 * ones))
    return float(abs(at_one - at_zero))


def named(slope: dict[str, float]) -> frozenset[str]:
    """Options of the three largest distinct values, compared to the last bit."""
    least = sorted(set(slope.values()), reverse=True)[:SLOPES][-1]
    return frozenset(name for name, value in slope.items() if value >= least)


def reproduce(schema: Schema, faults: tuple[FaultFile, ...]) -> None:
    print("the artifact's predictions, from its rule to the last bit")
    same = 0
    for fault in faults:
        slope = slopes(schema, fault)
        same += named(slope) == fault.published
        rounding = sorted(name for name in named(slope) if slope[name] < ROUNDING)
        if rounding:
            print(f"  {fault.name}: {', '.join(rounding)} never vary; both 'slopes' round to {slope[rounding[0]]:.1e}")
    print(f"  {same} of {len(faults)} faults reproduced exactly")


def measures(data: Path, robot: str) -> None:
    """The artifact's averages over both objectives, from its published truth and predictions."""
    rows, sizes = [], {}
    for objective, stem in OBJECTIVES.items():
        true = pd.read_csv(data / f"{robot}_ground_truth_{stem}.csv").to_numpy() == 1
        said = pd.read_csv(data / f"{robot}_predictions_{objective}.csv").to_numpy() == 1
        hits = (true & said).sum()
        precision, recall = hits / said.sum(), hits / true.sum()
        rows.append([(true == said).mean(), precision, recall, 2 * precision * recall / (precision + recall)])
        sizes[stem] = (int(true.sum(axis=1).max()), true.shape[1])
    accuracy, precision, recall, f1 = 100 * np.mean(rows, axis=0)
    most = ", ".join(f"{stem} {n} of {of}" for stem, (n, of) in sizes.items())
    print(f"  {robot:12s} accuracy {accuracy:.1f}, precision {precision:.1f}, recall {recall:.1f}, F1 {f1:.1f}")
    print(f"    most true causes of one fault: {most}")


def ranks(data: Path) -> None:
    print("\nthe trials of ranks: standard deviation of the objective, and Levene's test of each pair")
    for stem, target in TRIALS.items():
        frame = pd.read_csv(data / f"care_rank_trials_{stem}.csv")
        for where, trials in frame.groupby("Husky"):
            groups = {str(rank): group[target].to_numpy(dtype=float) for rank, group in trials.groupby("Rank")}
            deviation = ", ".join(f"{rank} {values.std(ddof=1):.3f}" for rank, values in groups.items())
            print(f"  {stem}, {target}, {where} ({min(len(v) for v in groups.values())} a rank): {deviation}")
            for a, b in combinations(groups, 2):
                p = float(levene(groups[a], groups[b], center="median").pvalue)
                print(f"    {a} against {b}: p = {p:.3f}{'' if p < LEVEL else ', not supported'}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--shared", type=Path, required=True, help="folder that holds data/")
    args = parser.parse_args()
    data = args.shared / "data" / "care"
    schema = load_profile("husky-care").schema
    reproduce(schema, read_faults(data, schema))
    print("\nthe published measures, recomputed from the published truth and predictions")
    measures(data, "husky")
    measures(data, "turtlebot3")
    print("  turtlebot3 is not reproducible: the runs behind its faults were not published")
    ranks(data)


if __name__ == "__main__":
    main()
