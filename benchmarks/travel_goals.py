"""Does what is learned on some goals hold on others? Drives cut to goals 1 to 3 predict goals 4 and 5 of other drives.

    python -m benchmarks.travel_goals --shared DIR [--folds N]

The training drives of the `move_base` profile all had the same five goals. Each is cut into two missions; time and
energy of the second are predicted by mechanisms of the first, learned on other runs: error (rms and mean of the
logarithm) and share in the 80% interval, with the noise of as many goals as the mission has and with that of training;
beside it the same for missions of the first kind.
"""

from __future__ import annotations

import argparse
import os
import tarfile
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from care_core.causal.counterfactual import CounterfactualQuery
from care_core.causal.graph import CausalGraph
from care_core.causal.mechanisms import Mechanism
from care_core.causal.model import Model, OutcomeRecord, Training
from care_core.configs.driven import configuration, in_force
from care_core.ecosystems.measures import Mission, find_extractor
from care_core.ecosystems.registry import run_model
from care_core.extract.read import mission_kind, reading_plan
from care_core.files import bundled
from care_core.learn.fitting import OUTCOME
from care_core.learn.outcomes import fit_on
from care_core.logs.finding import find_logs
from care_core.logs.opening import open_log
from care_core.profile.reading import read_schema
from care_core.profile.schema import Schema
from care_core.records import replace
from care_core.run import is_known

MEASURED = ("mission_time", "energy")
PARTS = {"goals 1 to 3": (0, 3), "goals 4 and 5": (3, 5)}


def rows_of(path: Path, schema: Schema) -> dict[str, dict[str, float]]:
    """One row for each part of a drive whose goals were all reached."""
    log = open_log(path)
    model = run_model(log)
    tables = model.tables(reading_plan(schema))
    sent = tables["/move_base/goal"]
    spec = {name: value for name, value in schema.mission.items() if name != "goals"}
    settings = log.settings()
    found = {}
    for part, (first, end) in PARTS.items():
        goals = sent.where(slice(first, end))
        cut = mission_kind(schema).missions(model, {**tables, "/move_base/goal": goals}, spec)
        if len(goals) < end - first or len(cut) != 1:
            continue
        driven = {name: in_force(history, cut[0].end_s) for name, history in settings.items()}
        config, _, _ = configuration(schema.options, driven, {})
        values = _values(cut[0], schema)
        if values.get("mission_success") == 1:
            found[part] = {**config, **values}
    return found


def _values(mission: Mission, schema: Schema) -> dict[str, float]:
    wanted = [v for v in (*schema.contexts, *schema.metrics, *schema.objectives) if v.extract is not None]
    values = {}
    for variable in wanted:
        if variable.extract is not None:
            value = find_extractor(variable.extract.kind).compute(mission, variable.extract.args)
            values[variable.name] = float(value) if is_known(value) else np.nan
    return values


def predicted(
    mechanism: Mechanism, name: str, schema: Schema, rows: pd.DataFrame
) -> tuple[np.ndarray[tuple[int], np.dtype[np.float64]], np.ndarray[tuple[int], np.dtype[np.bool_]]]:
    """Logarithm of measured over predicted, and whether the 80% interval holds the measured; shape (n,) each."""
    training = Training(origin="", runs=0, seed=0, alpha=0.01, resamples=0)
    model = Model(
        schema_digest="", graph=CausalGraph((), frozenset(), frozenset()), edges={}, bidirected=(), effects={},
        paths={}, outcomes={name: OutcomeRecord(objective=name, mechanism=name)}, summaries={}, skill={},
        training=training, mechanisms={name: mechanism},
    )  # fmt: skip
    configs: Sequence[Mapping[str, float]] = [
        {str(key): float(value) for key, value in row.items()} for row in rows.to_dict("records")
    ]
    query = CounterfactualQuery(model, configs[0], {}, {}, reference=configs[0], variables=schema.variables)
    found = query.predict(name, configs)
    seen = rows[name].to_numpy(dtype=float)
    return np.log(seen / found.value), (found.low <= seen) & (seen <= found.high)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--shared", type=Path, default=os.environ.get("CARE_SHARED"), help="folder that holds data/")
    parser.add_argument("--folds", type=int, default=5, help="parts of the runs")
    args = parser.parse_args()
    if args.shared is None:
        parser.error("give --shared DIR or set CARE_SHARED")
    schema = read_schema(bundled("profiles", "move_base") / "profile.yaml")
    with tempfile.TemporaryDirectory() as scratch:
        with tarfile.open(args.shared / "data/move_base/train.tar.xz") as archive:
            archive.extractall(scratch, filter="data")
        runs = [rows_of(path, schema) for path in find_logs([Path(scratch)])]
    fold = np.random.default_rng(0).permutation(len(runs)) % args.folds
    tables = {
        part: pd.DataFrame([{**run[part], "fold": k} for run, k in zip(runs, fold, strict=True) if part in run])
        for part in PARTS
    }
    learned, _ = PARTS
    print(f"{len(runs)} drives; {', '.join(f'{len(table)} reached {part}' for part, table in tables.items())}")
    options = [option.name for option in schema.options]
    for name in MEASURED:
        for part, table in tables.items():
            errors, inside, as_training = [], [], []
            for k in range(args.folds):
                train, rows = tables[learned][tables[learned]["fold"] != k], table[table["fold"] == k]
                mechanism = fit_on([options], name, train, schema, np.random.default_rng(0), effort=OUTCOME)
                assert mechanism is not None
                error, held = predicted(mechanism, name, schema, rows)
                errors.append(error)
                inside.append(held)
                as_training.append(predicted(replace(mechanism, averaging=None), name, schema, rows)[1])
            error = np.concatenate(errors)
            print(
                f"  {name:12s} learned on {learned}, asked of {part}: rms {np.sqrt(np.mean(error**2)):.1%}, "
                f"mean {error.mean():+.1%}, in the 80% interval {np.concatenate(inside).mean():.0%} "
                f"(without the noise of each goal {np.concatenate(as_training).mean():.0%}), n {len(error)}"
            )


if __name__ == "__main__":
    main()
