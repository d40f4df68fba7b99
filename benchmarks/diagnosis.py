"""Are the causes and fixes right? Diagnoses failed missions whose true fixes are known, beside three peers.

    python -m benchmarks.diagnosis --shared DIR [--platform arducopter] [--tables DIR] [--profiles DIR] [--verbose]

`--tables` holds the training runs (made by `care ingest` on the training logs): for the peers, and for the
probabilities of training missions held out of graph and mechanisms, which join those of the resets in the calibration
error. Every truth row says which resets were really flown and which fixed the mission.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import tempfile
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from benchmarks.peers import PlainClassifier, largest_deviation
from care_core.causal.abduction import ErrorCovariance, next_passes
from care_core.causal.counterfactual import CounterfactualQuery
from care_core.causal.graph import CausalGraph
from care_core.causal.model import UNKNOWN_CARRY_OVER
from care_core.diagnose.judging import query_of, read_and_judge
from care_core.diagnose.ranking import deviating
from care_core.diagnose.records import Diagnosis, ObjectiveResult
from care_core.diagnose.reference import profile_config
from care_core.diagnose.triage import triage
from care_core.ecosystems.registry import run_model
from care_core.extract.select import choose_profile
from care_core.learn.bug_isolation import cooperative_bug_isolation
from care_core.learn.skill import all_met, calibration_error, held_out_probabilities, reliability
from care_core.learn.structure import learn_structure
from care_core.learn.table import read_table
from care_core.logs.opening import open_log
from care_core.numbers import Floats
from care_core.profile.schema import Schema
from care_core.profile.store import Profile, load_profile
from care_core.records import Record, Struct, field, replace

PLATFORMS = ("arducopter", "move_base")
TRUTH_NAMES = {
    "arducopter": {"mission_success": "mission_success", "mission_time": "mission_time_s", "energy": "energy_wh",
                   "path_error_max": "path_error_max_m"},
    "move_base": {"mission_success": "mission_success", "mission_time": "mission_time", "energy": "energy_j"},
}  # fmt: skip
LIMITS: Mapping[str, Mapping[str, float]] = {
    "arducopter": {"mission_time": 150.0, "energy": 14.0, "path_error_max": 2.0},
    "move_base": {},
}
"""The bounds that the truth was flown against, where the profile sets none of its own."""
CORE = Path(__file__).parent.parent / "care_core"
FOLDS = 5
JOULES_PER_WH = 3600.0
CLUSTER_RESAMPLES = 300
LOWERED = 0.98
"""What the operator makes of a threshold that the log just meets although the mission was measured to miss it."""


class HeldOut(Record):
    """Training missions: probability by models that had not seen them, and whether all was met; shape (n,) each."""

    care: Floats
    plain: Floats
    met: Floats


def _graph(schema: Schema, runs: pd.DataFrame, rng: np.random.Generator) -> CausalGraph:
    return learn_structure(runs, schema, rng=rng).graph


def held_out(table: Path, schema: Schema, cache: Path) -> HeldOut:
    """Cross-validated probabilities, all learned anew in each fold; kept in `cache` by table and code."""
    code = [path.read_bytes() for room in ("learn", "causal") for path in sorted((CORE / room).glob("*.py"))]
    key = hashlib.sha256(b"".join([table.read_bytes(), repr(schema).encode(), *code])).hexdigest()[:16]
    kept = cache / f"{schema.name}-{key}.npz"
    if not kept.exists():
        frame = read_table(table, schema)
        truth = all_met(frame, schema)
        probabilities = held_out_probabilities(
            frame,
            schema,
            partial(_graph, schema),
            np.random.default_rng(0),
            folds=FOLDS,
            n_jobs=2,
        )
        plain = np.full(len(frame), np.nan)
        fold = np.random.default_rng(0).permutation(len(frame)) % FOLDS
        for k in range(FOLDS):
            peer = PlainClassifier(frame[fold != k], truth[fold != k] == 1.0, [o.name for o in schema.options])
            plain[fold == k] = peer.probability(frame[fold == k].to_dict("records"))
        cache.mkdir(parents=True, exist_ok=True)
        np.savez(kept, care=probabilities["all"], plain=plain, met=truth)
    with np.load(kept) as arrays:
        return HeldOut(arrays["care"], arrays["plain"], arrays["met"])


class Hits(Struct, eq=False):
    """How often a ranking was right."""

    first: int = 0
    three: int = 0
    single: int = 0

    def count(self, ranking: Sequence[str], fixing: Sequence[frozenset[str]]) -> None:
        true = frozenset().union(*fixing)
        self.first += bool(ranking) and ranking[0] in true
        self.three += any(name in true for name in ranking[:3])
        self.single += bool(ranking) and frozenset({ranking[0]}) in fixing


class Tally(Struct, eq=False):
    """One platform's figures."""

    faults: int = 0
    with_fix: int = 0
    with_single: int = 0
    wrong_objectives: list[str] = field(default_factory=list)
    hits: dict[str, Hits] = field(default_factory=dict)
    unflown: list[str] = field(default_factory=list)
    """Suggested sets whose reset nobody flew."""
    fix_flown: int = 0
    fix_confirmed: int = 0
    fix_sizes: list[int] = field(default_factory=list)
    abstained: int = 0
    too_close: list[str] = field(default_factory=list)
    """Faults that the log shows just inside the threshold."""
    probabilities: dict[str, list[float]] = field(default_factory=dict)
    outcomes: list[float] = field(default_factory=list)
    """Of the flown resets: met everything, in two missions in a row where the platform is not repeatable."""
    next_outcomes: list[float] = field(default_factory=list)
    """Of the same: the one mission that was recorded, which is what is promised."""
    clusters: list[str] = field(default_factory=list)
    """The fault of each: resets of one fault stand and fall together."""
    held_out: HeldOut | None = None


def ranking_of(diagnosis: Diagnosis) -> list[str]:
    """The options of every fault by their rank, between faults by contribution; an option counts where it is first."""
    causes = [cause for fault in diagnosis.faults for cause in fault.causes]
    causes.sort(key=lambda cause: (cause.rank, -cause.contribution))
    return list(dict.fromkeys(cause.option.name for cause in causes))


def objectives_differ(diagnosis: Diagnosis, truth: Mapping[str, Any], platform: str) -> list[str]:
    """Objectives whose verdict differs from the truth's by more than the log can tell."""
    differ = []
    accomplished = truth["objectives"]["mission_success"] == 1
    for result in diagnosis.objectives:
        name = result.variable.name
        true = truth["objectives"].get(TRUTH_NAMES[platform][name])
        if name != "mission_success" and not accomplished:
            if result.status != "not_evaluated":
                differ.append(f"{name}: judged although the mission was not accomplished")
            continue
        if platform == "move_base" and name == "energy":
            true = true / JOULES_PER_WH
        assert result.threshold is not None
        expected = "ok" if result.threshold.met(true) else "fault"
        near = abs(true - result.threshold.bound) <= (
            0.35 if name == "path_error_max" else 0.05 * result.threshold.bound
        )
        if result.status != expected and not (near and result.status in ("ok", "fault")):
            differ.append(f"{name}: {result.status} {result.value}, truth {true}")
    return differ


def evaluate(profile: Profile, shared: Path, peers: Peers | None, *, verbose: bool = False) -> Tally:
    """Diagnose every fault of the profile's platform."""
    platform = profile.schema.name
    folder = shared / "data" / platform / "faults"
    truths = [json.loads(line) for line in (folder / "truth.jsonl").read_text().splitlines()]
    reference = profile_config(profile.schema, profile.model)
    tally = Tally()
    for truth in truths:
        log = open_log(folder / truth["log"])
        choice = choose_profile(log, [profile])[1]
        judged = read_and_judge(run_model(log), profile, thresholds=LIMITS[platform])
        diagnosis = triage(judged, profile, choice, top=10)
        if not diagnosis.faults:
            # The outside measurement says failed, the log says just inside: the operator lowers the threshold to match.
            tally.too_close.append(truth["tag"])
            near = [r for r in diagnosis.objectives if _is_near(r, truth, platform)]
            tightened = {r.variable.name: LOWERED * r.value for r in near if r.value is not None}
            judged = read_and_judge(run_model(log), profile, thresholds={**LIMITS[platform], **tightened})
            diagnosis = triage(judged, profile, choice, top=10)
        _count(tally, diagnosis, truth, platform, reference, query_of(judged, profile), peers, verbose)
    return tally


def _is_near(result: ObjectiveResult, truth: Mapping[str, Any], platform: str) -> bool:
    """Whether the truth misses this objective's threshold although the log keeps it."""
    true = truth["objectives"].get(TRUTH_NAMES[platform][result.variable.name])
    if result.value is None or result.threshold is None or result.variable.kind == "functional" or true is None:
        return False
    scale = 1 / JOULES_PER_WH if platform == "move_base" and result.variable.name == "energy" else 1.0
    return result.status == "ok" and not result.threshold.met(true * scale)


class Peers:
    """The three rankings without a graph, trained on the same table."""

    def __init__(self, frame: pd.DataFrame, schema: Schema) -> None:
        self.schema, self.frame = schema, frame
        self.met_all = all_met(frame, schema) == 1.0
        self.classifier = PlainClassifier(frame, self.met_all, [o.name for o in schema.options])

    def rankings(self, config: Mapping[str, float], reference: Mapping[str, float]) -> dict[str, list[str]]:
        off = deviating(config, reference)
        return {
            "largest deviation": largest_deviation(config, reference, self.schema, off),
            "CBI": list(cooperative_bug_isolation(self.frame, ~self.met_all, config, self.schema, off)),
            "plain classifier": self.classifier.rank(config, reference, off),
        }


def _count(
    tally: Tally,
    diagnosis: Diagnosis,
    truth: Mapping[str, Any],
    platform: str,
    reference: Mapping[str, float],
    query: CounterfactualQuery,
    peers: Peers | None,
    verbose: bool,
) -> None:
    tally.faults += 1
    tally.wrong_objectives += [f"{truth['tag']} {line}" for line in objectives_differ(diagnosis, truth, platform)]
    tally.abstained += diagnosis.abstained is not None
    _count_probabilities(tally, truth, reference, query, peers)
    _count_fix(tally, diagnosis, truth)  # of every fault: one without a known fix can be given one that fails
    fixing = [frozenset(options) for options in truth["fixing"]]
    if not fixing:
        return
    tally.with_fix += 1
    rankings = {"care": ranking_of(diagnosis)}
    config = {**reference, **diagnosis.run.config}
    if peers is not None:
        rankings |= peers.rankings(config, reference)
    has_single = any(len(options) == 1 for options in fixing)
    tally.with_single += has_single
    for name, ranking in rankings.items():
        tally.hits.setdefault(name, Hits()).count(ranking, fixing)
    if verbose:
        fix = (
            [f"{c.option.name} {c.current:g}->{c.suggested:g}" for c in diagnosis.fix.changes]
            if diagnosis.fix
            else None
        )
        print(truth["tag"], "care:", rankings["care"][:3], "true:", truth["fixing"], "fix:", fix,
              f"{diagnosis.fix.p_fixed:.2f}" if diagnosis.fix else diagnosis.abstained)  # fmt: skip


def _count_fix(tally: Tally, diagnosis: Diagnosis, truth: Mapping[str, Any]) -> None:
    if diagnosis.fix is None:
        return
    suggested = frozenset(change.option.name for change in diagnosis.fix.changes)
    tally.fix_sizes.append(len(suggested))
    flown = {frozenset(row["reset"]): row["ok"] for row in truth["tried"]}
    tally.fix_flown += suggested in flown
    tally.fix_confirmed += flown.get(suggested, False)
    if suggested not in flown:
        tally.unflown.append(f"{truth['tag']} {'+'.join(sorted(suggested))}")


def _count_probabilities(
    tally: Tally,
    truth: Mapping[str, Any],
    reference: Mapping[str, float],
    query: CounterfactualQuery,
    peers: Peers | None,
) -> None:
    """Predicted probabilities of every reset that was flown, against whether it met all objectives."""
    changed = [{**query.config, **{name: reference[name] for name in row["reset"]}} for row in truth["tried"]]
    probabilities = {"care": query.probability(changed)}
    if truth.get("repeatable"):  # what the second failure measured was not kept: it is taken to be like the first
        probabilities["care, told of the second failure"] = replace(query, repeats=(query.observed,)).probability(
            changed
        )
    if peers is not None:
        probabilities["plain classifier"] = peers.classifier.probability(changed)
        probabilities["plain classifier, same abduction"] = abducted(peers.classifier, query.config, changed, 1)
        if truth.get("repeatable"):
            probabilities["plain classifier, told of it too"] = abducted(peers.classifier, query.config, changed, 2)
    for name, predicted in probabilities.items():
        tally.probabilities.setdefault(name, []).extend(predicted)
    tally.outcomes.extend(float(row["ok"]) for row in truth["tried"])
    tally.next_outcomes.extend(_next_outcome(row, truth, query) for row in truth["tried"])
    tally.clusters.extend([truth["tag"]] * len(changed))


def abducted(
    classifier: PlainClassifier, config: Mapping[str, float], changed: Sequence[Mapping[str, float]], failures: int
) -> Floats:
    """The classifier's probabilities given the failures, as the engine's; nothing is known of its errors."""
    same, ones = UNKNOWN_CARRY_OVER.same, np.ones(len(changed))
    errors = ErrorCovariance(variance=ones, covariance=same * ones, here=1.0, repeated=same)
    return next_passes(
        errors, classifier.probability(changed), float(classifier.probability([config])[0]), [False] * failures
    )


def _next_outcome(row: Mapping[str, Any], truth: Mapping[str, Any], query: CounterfactualQuery) -> float:
    """Whether the recorded mission met everything: `ok` asks it of two in a row where missions are not repeatable."""
    if not truth.get("repeatable"):
        return float(row["ok"])
    met = []
    for objective, bound in query.thresholds.items():
        name = TRUTH_NAMES["move_base"][objective]
        scale = 1 / JOULES_PER_WH if name == "energy_j" else 1.0
        value = row.get(name)
        met.append(value is not None and bound.met(value * scale))
    return float(all(met))


def show(platform: str, tally: Tally) -> None:
    n, s = tally.with_fix, tally.with_single
    print(f"\n{platform}: {tally.faults} faults, {n} with a known fix, {s} with a single reset that fixes")
    print(f"  objectives that disagree with the truth: {tally.wrong_objectives or 'none'}")
    if tally.too_close:
        print(f"  just inside the threshold in the log, diagnosed with it lowered to match: {tally.too_close}")
    print(f"  {'ranking':20s} {'rank 1 true':>12s} {'in first 3':>12s} {'single reset':>13s}")
    for name, hits in tally.hits.items():
        print(f"  {name:20s} {hits.first:>8d}/{n:<3d} {hits.three:>8d}/{n:<3d} {hits.single:>9d}/{s:<3d}")
    median = np.median(tally.fix_sizes) if tally.fix_sizes else float("nan")
    print(f"  suggested sets that were flown as resets: {tally.fix_flown}, confirmed: {tally.fix_confirmed}; "
          f"median changes {median:g}; abstained {tally.abstained}")  # fmt: skip
    if tally.unflown:
        print(f"  suggested sets that nobody flew: {', '.join(tally.unflown)}")
    _show_probabilities(tally)


def _show_probabilities(tally: Tally) -> None:
    """By part, never pooled: a failed run's resets and new missions are different promises."""
    for name, predicted_all in tally.probabilities.items():
        p, clusters = np.array(predicted_all), np.array(tally.clusters)
        parts = {"flown resets": (p, np.array(tally.outcomes), clusters)}
        if tally.next_outcomes != tally.outcomes:
            parts["flown resets, next mission alone"] = (p, np.array(tally.next_outcomes), clusters)
        if tally.held_out is not None and name in ("care", "plain classifier"):
            kept = tally.held_out.care if name == "care" else tally.held_out.plain
            parts["held-out missions"] = (kept, tally.held_out.met, np.arange(len(kept)).astype(str))
        for what, (predicted, met, groups) in parts.items():
            errors = f"{_with_interval(calibration_error, predicted, met, groups)}"
            print(f"  probabilities, {name}, {len(predicted)} {what}: calibration error {errors}, "
                  f"Brier {_with_interval(brier, predicted, met, groups)}")  # fmt: skip
            if name == "care":
                print("    predicted  met    n")
                for mean, seen, count in reliability(predicted, met):
                    print(f"    {mean:9.2f} {seen:4.2f} {count:4d}")


def brier(p: Floats, met: Floats) -> float:
    return float(((p - met) ** 2).mean())


def _with_interval(measure: Callable[[Floats, Floats], float], p: Floats, met: Floats, groups: NDArray[np.str_]) -> str:
    """The measure with its 90% interval over resampled groups (faults are drawn whole)."""
    rng = np.random.default_rng(0)
    members = [np.flatnonzero(groups == group) for group in np.unique(groups)]
    drawn = []
    for _ in range(CLUSTER_RESAMPLES):
        rows = np.concatenate([members[i] for i in rng.integers(0, len(members), len(members))])
        drawn.append(measure(p[rows], met[rows]))
    low, high = np.quantile(drawn, [0.05, 0.95])
    return f"{measure(p, met):.3f} ({low:.3f} to {high:.3f})"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--shared", type=Path, required=True, help="folder that holds data/")
    parser.add_argument("--platform", choices=PLATFORMS, action="append", help="default: both")
    parser.add_argument(
        "--tables", type=Path, help="folder with PLATFORM.parquet or .csv, the training runs of the peers"
    )
    parser.add_argument("--verbose", action="store_true", help="one line a fault")
    parser.add_argument("--profiles", type=Path, help="folder of profiles to judge; default: the bundled ones")
    parser.add_argument("--cache", type=Path, default=Path(tempfile.gettempdir()) / "care-benchmarks",
                        help="where cross-validated probabilities are kept")  # fmt: skip
    args = parser.parse_args()
    for platform in args.platform or PLATFORMS:
        profile = load_profile(platform if args.profiles is None else args.profiles / platform)
        peers, kept = None, None
        if args.tables is not None:
            table = table_of(args.tables, platform)
            peers = Peers(read_table(table, profile.schema), profile.schema)
            kept = held_out(table, profile.schema, args.cache)
        tally = evaluate(profile, args.shared, peers, verbose=args.verbose)
        tally.held_out = kept
        show(platform, tally)


def table_of(folder: Path, platform: str) -> Path:
    """The training runs of a platform."""
    return next(path for path in (folder / f"{platform}.parquet", folder / f"{platform}.csv") if path.exists())


if __name__ == "__main__":
    main()
