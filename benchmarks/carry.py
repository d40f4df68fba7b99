"""A profile carried to a vehicle that training never saw, with none, 10 and 30 of its runs.

    python -m benchmarks.carry --shared DIR --table arducopter.parquet [--kinds NAME...] [--quick]

Each kind of vehicle (`settings.jsonl`) is left out of training with all its runs. The profile of the others is carried
to it as `care update` does, with runs of some of its settings, and asked about the flights of its other settings: their
time and energy with intervals, the verdict of each flight that was accomplished, and the probability that a
configuration meets all objectives. Flights with failing hardware are left out throughout. Last, the failed flights of
that kind (`faults/`) and the resets that were flown. `--quick` is about time, energy and path alone, with the graph of
the bundled profile and smaller mechanisms.
"""

from __future__ import annotations

import argparse
import json
import re
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from benchmarks.travel import MEASURED
from care_core.causal.counterfactual import CounterfactualQuery
from care_core.causal.graph import CausalGraph
from care_core.causal.mechanisms import Mechanism
from care_core.causal.model import Model, OutcomeRecord, Training
from care_core.diagnose.judging import query_of, read_and_judge
from care_core.ecosystems.registry import run_model
from care_core.learn.fitting import Effort
from care_core.learn.outcomes import fit_outcomes, fit_total, groups_that_move_together, met
from care_core.learn.relative import relative
from care_core.learn.skill import all_met, calibration_error
from care_core.learn.structure import learn_structure
from care_core.learn.table import read_table
from care_core.learn.train import summaries
from care_core.learn.transfer import transfer_to
from care_core.logs.opening import open_log
from care_core.profile.schema import Schema
from care_core.profile.store import Profile, load_profile
from care_core.records import Struct, field
from care_core.variables import Threshold

KINDS = ("hexa", "payload", "draggy", "old_battery", "light")
RUNS = (0, 10, 30)
EFFORT = Effort(points=350, iterations=25, folds=5)
QUICK = Effort(points=250, iterations=15, folds=5)
DRAWS = 3


class Carried(Struct, eq=False):
    """What came of one kind (or all) with one number of its runs."""

    error: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))
    """Logarithm of measured over predicted."""
    inside: dict[str, list[bool]] = field(default_factory=lambda: defaultdict(list))
    """Of the 80% interval."""
    healthy: int = 0
    alarms: int = 0
    broken: int = 0
    missed: int = 0
    odds: list[float] = field(default_factory=list)
    kept: list[float] = field(default_factory=list)
    reset_odds: list[float] = field(default_factory=list)
    reset_kept: list[float] = field(default_factory=list)


def learn(frame: pd.DataFrame, schema: Schema, known: CausalGraph | None) -> Model:
    """A model of these runs, as far as predictions need one; with a known graph without the functional objectives."""
    rng = np.random.default_rng(0)
    graph = learn_structure(frame, schema, rng=rng).graph if known is None else known
    outcomes, mechanisms = _outcomes(frame, schema, graph, rng, quick=known is not None)
    together = groups_that_move_together(schema, relative(frame, schema))
    training = Training(origin="", runs=len(frame), seed=0, alpha=0.01, resamples=0, moves_together=together)
    return Model(
        schema_digest=schema.digest, graph=graph, edges={}, bidirected=(), effects={}, paths={}, outcomes=outcomes,
        summaries=summaries(relative(frame, schema), schema), skill={}, training=training, mechanisms=mechanisms,
    )  # fmt: skip


def _outcomes(
    frame: pd.DataFrame, schema: Schema, graph: CausalGraph, rng: np.random.Generator, *, quick: bool
) -> tuple[dict[str, OutcomeRecord], dict[str, Mechanism]]:
    if not quick:
        return fit_outcomes(frame, schema, graph, rng, effort=EFFORT)
    fitted = {
        v.name: fit_total(v.name, frame, schema, graph, rng, effort=QUICK) for v in schema.objectives if v.relative
    }
    found = {name: mechanism for name, mechanism in fitted.items() if mechanism is not None}
    return {name: OutcomeRecord(objective=name, mechanism=name) for name in found}, found


def carried(source: Model, schema: Schema, rows: pd.DataFrame) -> Model:
    """The source as `care update` carries it to a vehicle with a few runs."""
    if rows.empty:
        return source
    outcomes, mechanisms = transfer_to(source, schema, rows, source.graph, np.random.default_rng(0))
    return Model(
        schema_digest=source.schema_digest, graph=source.graph, edges={}, bidirected=(), effects={}, paths={},
        outcomes=outcomes, summaries=source.summaries, skill={}, training=source.training, mechanisms=mechanisms,
    )  # fmt: skip


def draws(rows: pd.DataFrame) -> Iterator[tuple[pd.DataFrame, pd.DataFrame]]:
    """Runs to carry with, at least as many as are needed, and those of other settings to be asked about."""
    for seed in range(DRAWS):
        rng = np.random.default_rng(seed)
        settings = rng.permutation(sorted(rows["setting"].unique()))
        taken = 1 + int(np.searchsorted(np.cumsum([(rows["setting"] == s).sum() for s in settings]), max(RUNS)))
        own = rows["setting"].isin(settings[:taken])
        yield rows[own].sample(frac=1.0, random_state=seed), rows[~own]


def ask(model: Model, schema: Schema, rows: pd.DataFrame, medians: Mapping[str, float], found: Carried) -> None:
    """Every run predicted from its configuration, and judged as triage does."""
    reference = {v.name: v.default for v in schema.options if v.default is not None}
    kept = {v.name: met(v, rows, schema) for v in schema.objectives if v.kind != "functional"}
    everything = all_met(rows, schema)
    for i, (_, row) in enumerate(rows.iterrows()):
        config = {n: float(row[n]) if pd.notna(row[n]) else medians.get(n, np.nan) for n in schema.variables}
        there = {**config, **reference}
        seen = {n: float(row[n]) for n in schema.variables if pd.notna(row[n])}
        before, after = CounterfactualQuery(model, config, {}, {}), CounterfactualQuery(model, config, seen, {})
        limits = {v.name: v.fixed for v in schema.objectives if v.fixed is not None}
        flagged = False
        for objective in schema.objectives:
            if objective.relative is None or objective.name not in model.outcomes:
                continue
            need = float(before.predict(objective.name, [there]).value[0])
            limits[objective.name] = objective.relative.for_need(need)
            if np.isfinite(kept[objective.name][i]):
                own: Threshold = objective.relative.for_need(float(after.predict(objective.name, [there]).value[0]))
                flagged |= not own.met(float(row[objective.name]))
        if "mission_success" in model.outcomes:
            found.odds.append(float(CounterfactualQuery(model, config, {}, limits).probability([config])[0]))
            found.kept.append(float(everything[i]))
        verdicts = [values[i] for values in kept.values()]
        if np.isfinite(verdicts).all() and row["mission_success"] == 1:
            fine = all(verdict == 1 for verdict in verdicts)
            found.healthy += fine
            found.alarms += fine and flagged
            found.broken += not fine
            found.missed += not fine and not flagged
        for name in MEASURED:
            if row[name] > 0:
                p = before.predict(name, [config])
                found.error[name].append(float(np.log(row[name] / p.value[0])))
                found.inside[name].append(bool(p.low[0] <= row[name] <= p.high[0]))


def ask_resets(profile: Profile, folder: Path, kind: str, found: Carried) -> None:
    """The resets that were flown after failed flights of a kind without failing hardware."""
    for line in (folder / "truth.jsonl").read_text().splitlines():
        truth = json.loads(line)
        if truth["ok"] or truth["hardware"] or truth["setting"]["vehicle"] != kind or not truth["tried"]:
            continue
        judged = read_and_judge(run_model(open_log(folder / f"{truth['tag']}.BIN")), profile)
        query = query_of(judged, profile)
        changed = [{**query.config, **{o: query.reference[o] for o in row["reset"]}} for row in truth["tried"]]
        found.reset_odds.extend(map(float, query.probability(changed)))
        found.reset_kept.extend(float(row["ok"]) for row in truth["tried"])


def kind_left_out(
    frame: pd.DataFrame, schema: Schema, kind: str, profile: Profile, faults: Path, *, quick: bool
) -> dict[int, Carried]:
    """One kind of vehicle, by the number of its runs."""
    others = frame[frame["vehicle"] != kind].reset_index(drop=True)
    source = learn(others[list(schema.variables)], schema, profile.model.graph if quick else None)
    medians = {v.name: float(others[v.name].median()) for v in schema.contexts}
    found = {count: Carried() for count in RUNS}
    for own, rest in draws(frame[frame["vehicle"] == kind]):
        for count in RUNS:
            model = carried(source, schema, own[:count].reset_index(drop=True))
            ask(model, schema, rest, medians, found[count])
            if quick:
                continue
            there = Profile(profile.path, schema)
            there.__dict__["model"] = model
            ask_resets(there, faults, kind, found[count])
    return found


def show(kind: str, found: Mapping[int, Carried]) -> None:
    for count, one in found.items():
        cells = [f"{np.sqrt(np.mean(np.square(one.error[n]))):6.1%} {np.mean(one.inside[n]):5.0%}" for n in MEASURED]
        odds, kept = np.array(one.odds), np.array(one.kept)
        if len(odds):
            cells += [f"{calibration_error(odds, kept):.3f} {np.mean((odds - kept) ** 2):.3f}"]
        resets, fixed = np.array(one.reset_odds), np.array(one.reset_kept)
        if len(resets):
            cells += [
                f"{len(resets) // DRAWS:3d} {calibration_error(resets, fixed):.3f} {np.mean((resets - fixed) ** 2):.3f}"
            ]
        print(
            f"{kind:12s} {count:3d}  {one.alarms:3d} of {one.healthy:3d}  {one.missed:3d} of {one.broken:3d}  "
            f"{'   '.join(cells)}",
            flush=True,
        )


def together(parts: Sequence[Mapping[int, Carried]]) -> dict[int, Carried]:
    """All kinds as one."""
    whole = {count: Carried() for count in RUNS}
    for part in parts:
        for count, one in part.items():
            total = whole[count]
            for name in MEASURED:
                total.error[name] += one.error[name]
                total.inside[name] += one.inside[name]
            for key in ("healthy", "alarms", "broken", "missed", "odds", "kept", "reset_odds", "reset_kept"):
                setattr(total, key, getattr(total, key) + getattr(one, key))
    return whole


def with_vehicles(frame: pd.DataFrame, logs: pd.Series[str], settings: Path) -> pd.DataFrame:
    """The table with the setting of each run and its kind of vehicle, by the name of its log; none for other runs."""
    kinds = {}
    for line in settings.read_text().splitlines():
        setting = json.loads(line)
        kinds[setting["setting"]] = setting["vehicle"]
    names = [re.sub(r"_\d+$", "", Path(log).stem) for log in logs]
    known: pd.DataFrame = frame.assign(setting=names, vehicle=[kinds.get(name, "") for name in names])
    return known


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--shared", type=Path, required=True, help="folder that holds data/")
    parser.add_argument("--table", type=Path, required=True, help="runs of the arducopter profile's training")
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=KINDS)
    parser.add_argument("--quick", action="store_true", help="time, energy and path alone, in a minute")
    args = parser.parse_args()
    profile = load_profile("arducopter")
    schema = profile.schema
    varied = args.shared / "data" / "varied"
    frame = with_vehicles(read_table(args.table, schema), pd.read_parquet(args.table)["log"], varied / "settings.jsonl")
    print("kind         runs false alarms   missed      time       energy         all met      resets")
    print("                                        rms, in 80%  rms, in 80%  ECE, Brier   n, ECE, Brier")
    parts = []
    with threadpool_limits(1):
        for kind in args.kinds:
            parts.append(kind_left_out(frame, schema, kind, profile, varied / "faults", quick=args.quick))
            show(kind, parts[-1])
    show("all", together(parts))


if __name__ == "__main__":
    main()
