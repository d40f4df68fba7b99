"""Does the profile travel? Missions, vehicles and sites that training never saw, beside a plain classifier.

    python -m benchmarks.travel --shared DIR --table arducopter.parquet [--platform NAME] [--profiles DIR] [--folds N]
    python -m benchmarks.travel --platform px4 --unseen

With `--unseen` the profile itself is held against the flights of `benchmarks/unseen`, of vehicles and missions that it
was not learned from. Else two parts. *Missions left out whole*: the table (`benchmarks.tools.train_profiles --tables`)
is split by mission; each part is predicted by a model of the others: time and energy with their intervals, what the
reference configuration needs for the mission (against the flight that flew it), and the probability that all
objectives are met. *Faults*: failed flights of other settings, whose resets were flown: causes, fixes, and the
probabilities promised for each reset.

The plain classifier (extremely randomised trees averaged with gradient boosting) reads the same options and contexts,
and is given the same abduction.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from benchmarks.diagnosis import abducted
from benchmarks.peers import PlainClassifier, classifier_of
from care_core.causal.all_objectives import AllObjectives
from care_core.causal.counterfactual import CounterfactualQuery
from care_core.causal.model import Model, Training
from care_core.diagnose.judging import Judged, query_of, read_and_judge
from care_core.diagnose.ranking import deviating
from care_core.diagnose.records import Diagnosis
from care_core.diagnose.triage import triage
from care_core.ecosystems.registry import run_model
from care_core.extract.select import choose_profile
from care_core.learn.fitting import Effort
from care_core.learn.outcomes import fit_outcomes, groups_that_move_together
from care_core.learn.relative import missions_of, needs, relative
from care_core.learn.skill import all_met, calibration_error, reliability
from care_core.learn.structure import learn_structure
from care_core.learn.table import read_table
from care_core.logs.opening import open_log
from care_core.numbers import Bools, Floats
from care_core.profile.schema import Schema
from care_core.profile.store import Profile, load_profile
from care_core.records import Struct, field

EFFORT = Effort(points=500, iterations=40, folds=5)
MEASURED = ("mission_time", "energy")
UNSEEN = Path(__file__).parent / "unseen"
"""Tables of runs that no profile was learned from."""
APART = {
    "arducopter": (
        "path_length", "legs", "hold_time", "commanded_speed", "takeoff_height", "return_distance", "hover_power",
    ),
    "ardurover": ("path_length", "legs", "hold_time", "commanded_speed", "sharp_turns", "steering_kind"),
    "arduplane": ("way_out", "legs", "hold_time", "loiter_turns", "rises", "sharpest_corner", "level_power"),
    "quadplane": ("way_out", "legs", "hold_time", "loiter_turns", "rises", "sharpest_corner", "returns"),
    "ardusub": ("path_length", "legs", "hold_time", "climb", "descent", "corner_turn"),
    "px4": ("path_length", "legs", "hold_time", "commanded_speed", "takeoff_height", "return_distance", "hover_power"),
}  # fmt: skip
"""Contexts by which the distance of a mission from those of training is told, each in standard deviations."""
FAULTS = {
    "arducopter": "varied", "ardurover": "rover", "arduplane": "plane", "quadplane": "quadplane", "ardusub": "sub",
    "px4": "px4",
}  # fmt: skip
"""Folder of each platform's failed runs of settings that training never saw."""
FAR = (0.5, 1.0)
"""Distances that part near, farther and far missions."""


def measured(schema: Schema) -> tuple[str, ...]:
    """The objectives that are predicted as numbers; a simulated QuadPlane's battery measures no energy."""
    return tuple(name for name in MEASURED if name in schema.variables)


class LeftOut(NamedTuple):
    """Predictions of runs whose missions the model never saw, each of shape (n,). A tuple: worker processes know the
    classes of a module that is run as a program by their fields alone."""

    distance: Floats
    error: dict[str, Floats]
    """Logarithm of measured over predicted."""
    inside: dict[str, Floats]
    """1 where the measured value lies in the 80% interval, NaN where there is none."""
    need_error: dict[str, Floats]
    """Logarithm of what the reference flight took over what was said that it needs."""
    need_inside: dict[str, Floats]
    predicted: Floats
    """Product of what is expected of each objective."""
    promised: Floats
    """What a profile makes of that product, by the runs of the other parts."""
    plain: Floats


def left_out(frame: pd.DataFrame, schema: Schema, folds: int) -> LeftOut:
    """Every run predicted by a model of the other missions."""
    missions = missions_of(frame, schema)
    assert missions is not None, "the profile has no context about the mission"
    fold = (np.random.default_rng(0).permutation(missions.max() + 1) % folds)[missions]
    parts = Parallel(n_jobs=2)(delayed(_predict)(frame, schema, fold == k) for k in range(folds))
    order = np.argsort(np.concatenate([np.flatnonzero(fold == k) for k in range(folds)]))

    def joined(of: Sequence[Floats]) -> Floats:
        return np.concatenate(of)[order]

    def by_name(of: Sequence[Mapping[str, Floats]]) -> dict[str, Floats]:
        return {name: joined([one[name] for one in of]) for name in measured(schema)}

    predicted = joined([p.predicted for p in parts])
    return LeftOut(
        distance=joined([p.distance for p in parts]),
        error=by_name([p.error for p in parts]),
        inside=by_name([p.inside for p in parts]),
        need_error=by_name([p.need_error for p in parts]),
        need_inside=by_name([p.need_inside for p in parts]),
        predicted=predicted,
        promised=_promised(predicted, all_met(frame, schema), fold),
        plain=joined([p.plain for p in parts]),
    )


def _promised(predicted: Floats, truth: Floats, fold: NDArray[np.int64]) -> Floats:
    made = np.empty_like(predicted)
    for part in np.unique(fold):
        others = fold != part
        curve = reliability(predicted[others], truth[others])
        made[~others] = AllObjectives.of(curve).of_product(predicted[~others])
    return made


def _predict(frame: pd.DataFrame, schema: Schema, test: Bools) -> LeftOut:
    with threadpool_limits(1):
        rng = np.random.default_rng(0)
        train, rows = frame[~test].reset_index(drop=True), frame[test].reset_index(drop=True)
        graph = learn_structure(train, schema, rng=rng).graph
        outcomes, mechanisms = fit_outcomes(train, schema, graph, rng, effort=EFFORT)
        together = groups_that_move_together(schema, relative(train, schema))
        training = Training(origin="", runs=len(train), seed=0, alpha=0.01, resamples=0, moves_together=together)
        model = Model(
            schema_digest="", graph=graph, edges={}, bidirected=(), effects={}, paths={}, outcomes=outcomes,
            summaries={}, skill={}, training=training, mechanisms=mechanisms,
        )  # fmt: skip
        medians = {v.name: train[v.name].median() for v in schema.contexts}
        peer = classifier_of(train, schema)
        flown = {name: needs(schema.variables[name], frame, schema)[test] for name in measured(schema)}
        return _asked(
            model, schema, rows, rows.fillna(medians), flown, peer, _distance(train, rows, APART[schema.name])
        )


def _asked(
    model: Model, schema: Schema, rows: pd.DataFrame, filled: pd.DataFrame, flown: Mapping[str, Floats],
    peer: PlainClassifier | None, distance: Floats,
) -> LeftOut:  # fmt: skip
    n = len(rows)
    error, inside, need_error, need_inside = ({name: np.full(n, np.nan) for name in measured(schema)} for _ in range(4))
    found = LeftOut(
        distance=distance,
        error=error,
        inside=inside,
        need_error=need_error,
        need_inside=need_inside,
        predicted=np.full(n, np.nan),
        promised=np.full(n, np.nan),
        plain=np.full(n, np.nan),
    )
    reference = {v.name: v.default for v in schema.options if v.default is not None}
    named = filled[[*schema.variables]]  # a table may tell the day as well
    configs = [{str(k): float(v) for k, v in row.items()} for row in named.to_dict("records")]
    if peer is not None:
        found.plain[:] = peer.probability(configs)
    for i, config in enumerate(configs):
        there = {**config, **reference}
        before = CounterfactualQuery(model, config, {}, {})
        after = CounterfactualQuery(model, config, {str(k): v for k, v in rows.iloc[i].dropna().items()}, {})
        bounds = {v.name: v.fixed for v in schema.objectives if v.fixed is not None}
        for objective in schema.objectives:
            if objective.relative is not None and objective.name in model.outcomes:
                need = float(before.predict(objective.name, [there]).value[0])
                bounds[objective.name] = objective.relative.for_need(need)
        found.predicted[i] = CounterfactualQuery(model, config, {}, bounds).probability([config])[0]
        for name in measured(schema):
            value = rows[name].iloc[i]
            if not value > 0:
                continue
            own, needed = before.predict(name, [config]), after.predict(name, [there])
            found.error[name][i] = np.log(value / own.value[0])
            found.inside[name][i] = own.low[0] <= value <= own.high[0]
            found.need_error[name][i] = np.log(flown[name][i] / needed.value[0])
            found.need_inside[name][i] = needed.low[0] <= flown[name][i] <= needed.high[0]
    return found


def _distance(train: pd.DataFrame, rows: pd.DataFrame, contexts: Sequence[str]) -> Floats:
    """Of each run's mission from the nearest of training, in standard deviations a context; shape (n,)."""
    scale = train[list(contexts)].std()
    known = (train[list(contexts)] / scale).fillna(0.0).drop_duplicates().to_numpy()
    asked = (rows[list(contexts)] / scale).fillna(0.0).to_numpy()
    apart: Floats = np.sqrt(((asked[:, None, :] - known[None, :, :]) ** 2).mean(axis=2)).min(axis=1)
    return apart


def show_left_out(found: LeftOut, frame: pd.DataFrame, schema: Schema) -> None:
    truth = all_met(frame, schema)
    print(f"missions left out whole: {len(frame)} runs")
    print(
        "  runs at a distance of    time: rms  in 80%   energy: rms  in 80%   all met: ECE   Brier  "
        "promised: ECE  Brier  plain: ECE  Brier"
    )
    bounds = (0.0, *FAR, np.inf)
    for low, high in ((0.0, np.inf), *pairwise(bounds)):
        part = (found.distance >= low) & (found.distance < high)
        if part.sum() < 20:
            continue
        cells = []
        for name in measured(schema):
            known = part & np.isfinite(found.error[name])
            cells.append(
                f"{np.sqrt(np.mean(found.error[name][known] ** 2)):9.1%} {found.inside[name][known].mean():8.0%}"
            )
        for predicted in (found.predicted, found.promised, found.plain):
            brier = float(((predicted[part] - truth[part]) ** 2).mean())
            cells.append(f"{calibration_error(predicted[part], truth[part]):9.3f} {brier:7.3f}")
        print(f"  {low:4.1f} to {high:4.1f} ({part.sum():4d})    {'    '.join(cells)}")
    for name in measured(schema):
        known = np.isfinite(found.need_error[name])
        error = found.need_error[name][known]
        print(f"  what the reference needs, {name}: rms {np.sqrt(np.mean(error**2)):.1%}, "
              f"in its 80% interval {found.need_inside[name][known].mean():.0%}, n {known.sum()}")  # fmt: skip
    for name, predicted in (("predicted", found.predicted), ("promised", found.promised)):
        print(f"    {name:9}  met    n")
        for p, seen, count in reliability(predicted, truth):
            print(f"    {p:9.2f} {seen:4.2f} {count:4d}")


def show_unseen(profile: Profile, frame: pd.DataFrame) -> None:
    """What the profile itself says of runs that it was not learned from, beside what came of them."""
    schema = profile.schema
    filled = frame.fillna({v.name: frame[v.name].median() for v in schema.contexts})
    flown = {name: needs(schema.variables[name], frame, schema) for name in measured(schema)}
    found = _asked(profile.model, schema, frame, filled, flown, None, np.zeros(len(frame)))
    truth = all_met(frame, schema)
    said = found.predicted
    print(f"runs that it was not learned from: {len(frame)}, all met in {truth.mean():.2f}, said {said.mean():.2f}; "
          f"calibration error {calibration_error(said, truth):.3f}, Brier {((said - truth) ** 2).mean():.3f}, "
          f"by the share alone {truth.mean() * (1 - truth.mean()):.3f}")  # fmt: skip
    for name in measured(schema):
        known = np.isfinite(found.error[name])
        print(f"  {name}: rms {np.sqrt(np.mean(found.error[name][known] ** 2)):.1%}, in its 80% interval "
              f"{found.inside[name][known].mean():.0%}, n {known.sum()}")  # fmt: skip
    for share, seen, count in reliability(said, truth):
        print(f"    {share:4.2f} {seen:4.2f} {count:4d}")


# --- faults whose resets were flown -----------------------------------------------------------------------------


class Faults(Struct, eq=False):
    """What came of the failed flights."""

    flights: int = 0
    flagged: int = 0
    first: dict[str, int] = field(default_factory=dict)
    three: dict[str, int] = field(default_factory=dict)
    advised: int = 0
    flown: int = 0
    confirmed: int = 0
    predicted: dict[str, list[float]] = field(default_factory=dict)
    kept: list[float] = field(default_factory=list)
    limits: list[float] = field(default_factory=list)
    """Logarithm of the true limit of time or energy over the one in force."""


def judge_faults(profile: Profile, folder: Path, peer: PlainClassifier) -> Faults:
    """Every failed flight that resetting options alone repairs."""
    found = Faults()
    for line in (folder / "truth.jsonl").read_text().splitlines():
        truth = json.loads(line)
        fixing = [frozenset(options) for options in truth.get("fixing") or () if "hardware" not in options]
        if truth["ok"] or not fixing:
            continue
        log = open_log(next(folder.glob(f"{truth['tag']}.*")))
        judged = read_and_judge(run_model(log), profile)
        diagnosis = triage(judged, profile, choose_profile(log, [profile])[1], top=10)
        _count(found, judged, diagnosis, profile, truth, fixing, peer)
    return found


def _count(
    found: Faults, judged: Judged, diagnosis: Diagnosis, profile: Profile, truth: Mapping[str, object],
    fixing: Sequence[frozenset[str]], peer: PlainClassifier,
) -> None:  # fmt: skip
    query = query_of(judged, profile)
    reference = query.reference
    off = deviating(query.config, reference)
    causes = sorted((c for fault in diagnosis.faults for c in fault.causes), key=lambda c: (c.rank, -c.contribution))
    rankings = {
        "care": list(dict.fromkeys(cause.option.name for cause in causes)),
        "plain classifier": peer.rank(query.config, reference, off),
    }
    true = frozenset().union(*fixing)
    found.flights += 1
    found.flagged += bool(judged.broken)
    for name, ranking in rankings.items():
        found.first[name] = found.first.get(name, 0) + (bool(ranking) and ranking[0] in true)
        found.three[name] = found.three.get(name, 0) + bool(true & set(ranking[:3]))
    tried = [row for row in truth["tried"] if "hardware" not in row["reset"]]  # type: ignore[attr-defined]
    if diagnosis.fix is not None:
        found.advised += 1
        outcome = {frozenset(row["reset"]): row["ok"] for row in tried}
        suggested = frozenset(change.option.name for change in diagnosis.fix.changes)
        found.flown += suggested in outcome
        found.confirmed += outcome.get(suggested, False)
    changed = [{**query.config, **{name: reference[name] for name in row["reset"]}} for row in tried]
    found.predicted.setdefault("care", []).extend(query.probability(changed))
    found.predicted.setdefault("plain classifier", []).extend(peer.probability(changed))
    found.predicted.setdefault("plain, same abduction", []).extend(abducted(peer, query.config, changed, 1))
    found.kept.extend(float(row["ok"]) for row in tried)
    limits: Mapping[str, float] = truth["limits"]  # type: ignore[assignment]
    for name, key in (("mission_time", "armed_time_s"), ("energy", "energy_wh")):
        if name in judged.bounds and any(r.variable.name == name and r.value is not None for r in judged.results):
            found.limits.append(float(np.log(limits[key] / judged.bounds[name].bound)))


def show_faults(found: Faults) -> None:
    n, kept = found.flights, np.array(found.kept)
    print(f"\nfailed flights of other settings that a reset of options repairs: {n}, flagged {found.flagged}")
    for name in found.first:
        print(f"  {name:24s} first {found.first[name]}/{n}, in three {found.three[name]}/{n}")
    print(f"  fixes advised {found.advised}, flown as resets {found.flown}, confirmed {found.confirmed}")
    rms = float(np.sqrt(np.mean(np.square(found.limits))))
    print(f"  limits of accomplished missions, time and energy, against the true ones: rms {rms:.1%}")
    for name, predicted in found.predicted.items():
        p = np.array(predicted)
        print(f"  probabilities of {len(p)} resets, {name}: calibration error {calibration_error(p, kept):.3f}, "
              f"Brier {((p - kept) ** 2).mean():.3f}")  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--shared", type=Path, help="folder that holds data/")
    parser.add_argument("--table", type=Path, help="runs of the profile's training")
    parser.add_argument("--unseen", action="store_true", help="hold the profile against benchmarks/unseen alone")
    parser.add_argument("--platform", choices=sorted(FAULTS), default="arducopter", help="default: arducopter")
    parser.add_argument("--profiles", type=Path, help="folder of profiles to judge; default: the bundled ones")
    parser.add_argument("--folds", type=int, default=5, help="parts of the missions; 0 leaves this out")
    args = parser.parse_args()
    profile = load_profile(args.platform if args.profiles is None else args.profiles / args.platform)
    schema = profile.schema
    if args.unseen:
        frame = read_table(UNSEEN / f"{schema.name}.csv", schema)[list(schema.variables)]
        show_unseen(profile, frame)
        return
    if args.shared is None or args.table is None:
        parser.error("give --shared and --table, or --unseen")
    frame = read_table(args.table, schema)[list(schema.variables)]
    peer = classifier_of(frame, schema)
    show_faults(judge_faults(profile, args.shared / "data" / FAULTS[args.platform] / "faults", peer))
    if args.folds:
        show_left_out(left_out(frame, schema, args.folds), frame, schema)


if __name__ == "__main__":
    main()
