"""How many missions must be flown before a diagnosis is right? Random subsets of the training runs, two seeds each.

    python -m benchmarks.few_runs --shared DIR --tables DIR [--platform arducopter] [--sizes 50 100] [--seeds 0 1]

Each subset trains a profile from nothing but its runs and `profile.yaml`; the fault set is diagnosed with it and with
the peers trained on the same runs. `flown` counts the suggested sets whose reset was flown, `fixed` those that met
every objective.
"""

from __future__ import annotations

import argparse
import shutil
import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks.diagnosis import PLATFORMS, Peers, Tally, evaluate, table_of
from care_core.files import PROFILE_FILE
from care_core.learn.table import read_table
from care_core.learn.train import TrainSettings, train
from care_core.profile.model import write_model
from care_core.profile.store import Profile, load_profile

SIZES = {"arducopter": (50, 100, 200, 400), "move_base": (50, 100, 200, 300)}
RESAMPLES = 5
"""Few: they say how sure an edge is, not what causes a run."""


def tally_of(profile: Profile, table: Path, size: int, seed: int, shared: Path) -> tuple[Tally, float]:
    """The fault set diagnosed after training on a random subset, and the seconds that training took."""
    frame = read_table(table, profile.schema)
    rows = np.random.default_rng([seed, size]).choice(len(frame), min(size, len(frame)), replace=False)
    subset = frame.iloc[np.sort(rows)].reset_index(drop=True)
    started = time.monotonic()
    model = train(subset, profile.schema, TrainSettings(seed=seed, resamples=RESAMPLES, folds=0))
    seconds = time.monotonic() - started
    with tempfile.TemporaryDirectory() as scratch:
        shutil.copy(profile.path / PROFILE_FILE, scratch)
        write_model(model, Path(scratch))
        tally = evaluate(Profile(Path(scratch), profile.schema), shared, Peers(subset, profile.schema))
    return tally, seconds


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--shared", type=Path, required=True, help="folder that holds data/")
    parser.add_argument("--tables", type=Path, required=True, help="folder with PLATFORM.parquet, the training runs")
    parser.add_argument("--platform", choices=PLATFORMS, action="append", help="default: both")
    parser.add_argument("--sizes", type=int, nargs="+", help="default: 50 100 200 400 (move_base 300)")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1])
    args = parser.parse_args()
    for platform in args.platform or PLATFORMS:
        profile, table = load_profile(platform), table_of(args.tables, platform)
        print(f"\n{platform}")
        print("  runs seed ranking            rank 1  first 3   single  flown  fixed  abstained  training")
        for size in args.sizes or SIZES[platform]:
            for seed in args.seeds:
                tally, seconds = tally_of(profile, table, size, seed, args.shared)
                show(size, seed, tally, seconds)


def show(size: int, seed: int, tally: Tally, seconds: float) -> None:
    """One line a ranking, as shares of the faults with a known fix."""
    for name, hits in tally.hits.items():
        line = f"  {size:4d} {seed:4d} {name:18s} {hits.first / tally.with_fix:7.2f} {hits.three / tally.with_fix:8.2f}"
        line += f" {hits.single / max(tally.with_single, 1):8.2f}"
        if name == "care":
            line += f" {tally.fix_flown:6d} {tally.fix_confirmed:6d} {tally.abstained:10d} {seconds:7.0f} s"
        print(line, flush=True)


if __name__ == "__main__":
    main()
