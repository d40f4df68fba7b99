"""Are the causes and fixes right? Diagnoses failed missions whose true fixes are known, beside three peers.

    python benchmarks/diagnosis.py --shared DIR [--platform arducopter] [--tables DIR] [--verbose]

`--tables` holds the training runs for the peers (made by `care ingest` on the training logs). Every truth row says
which resets were really flown and which fixed the mission.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from care_core.causal.counterfactual import World
from care_core.diagnose.faults import thresholds_in_force
from care_core.diagnose.ranking import deviating, reference_config
from care_core.diagnose.records import Diagnosis, ObjectiveResult
from care_core.diagnose.triage import triage
from care_core.learn.baselines import PlainClassifier, cooperative_bug_isolation, largest_deviation
from care_core.learn.outcomes import met
from care_core.learn.skill import calibration_error, reliability
from care_core.learn.table import read_table
from care_core.logs import open_log
from care_core.profile.select import describe_fit
from care_core.profile.store import Profile, load_profile

PLATFORMS = ("arducopter", "move_base")
TRUTH_NAMES = {
    "arducopter": {"mission_success": "mission_success", "mission_time": "mission_time_s", "energy": "energy_wh",
                   "path_error_max": "path_error_max_m"},
    "move_base": {"mission_success": "mission_success", "mission_time": "mission_time", "energy": "energy_j"},
}  # fmt: skip
JOULES_PER_WH = 3600.0
LOWERED = 0.98
"""What the operator makes of a threshold that the log just meets although the mission was measured to miss it."""


@dataclass
class Hits:
    """How often a ranking was right."""

    first: int = 0
    three: int = 0
    single: int = 0

    def count(self, ranking: Sequence[str], fixing: Sequence[frozenset[str]]) -> None:
        true = frozenset().union(*fixing)
        self.first += bool(ranking) and ranking[0] in true
        self.three += any(name in true for name in ranking[:3])
        self.single += bool(ranking) and frozenset({ranking[0]}) in fixing


@dataclass
class Tally:
    """One platform's figures."""

    faults: int = 0
    with_fix: int = 0
    with_single: int = 0
    wrong_objectives: list[str] = field(default_factory=list)
    hits: dict[str, Hits] = field(default_factory=dict)
    fix_flown: int = 0
    fix_confirmed: int = 0
    fix_sizes: list[int] = field(default_factory=list)
    abstained: int = 0
    too_close: list[str] = field(default_factory=list)
    """Faults that the log shows just inside the threshold."""
    odds: dict[str, list[float]] = field(default_factory=dict)
    outcomes: list[float] = field(default_factory=list)


def ranking_of(diagnosis: Diagnosis) -> list[str]:
    """The options of every fault, best first: by contribution, an option counted where it weighs most."""
    causes = [cause for fault in diagnosis.faults for cause in fault.causes]
    causes.sort(key=lambda cause: (cause.is_lead, -cause.contribution if not cause.is_lead else cause.rank))
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
        near = abs(true - result.threshold.value) <= (
            0.35 if name == "path_error_max" else 0.05 * result.threshold.value
        )
        if result.status != expected and not (near and result.status in ("ok", "fault")):
            differ.append(f"{name}: {result.status} {result.value}, truth {true}")
    return differ


def evaluate(platform: str, shared: Path, table: Path | None, verbose: bool) -> Tally:
    profile = load_profile(platform)
    folder = shared / "data" / platform / "faults"
    truths = [json.loads(line) for line in (folder / "truth.jsonl").read_text().splitlines()]
    reference = reference_config(profile.schema, profile.model)
    tally = Tally()
    peers = None if table is None else _Peers(table, profile)
    for truth in truths:
        log = open_log(folder / truth["log"])
        choice = describe_fit(log, profile)
        diagnosis = triage(log, profile, choice, top=10)
        if not diagnosis.faults:
            # The outside measurement says failed, the log says just inside: the operator lowers the threshold to match.
            tally.too_close.append(truth["tag"])
            near = [r for r in diagnosis.objectives if _is_near(r, truth, platform)]
            tightened = {r.variable.name: LOWERED * r.value for r in near if r.value is not None}
            diagnosis = triage(log, profile, choice, top=10, thresholds=tightened)
        _count(tally, diagnosis, truth, platform, reference, profile, peers, verbose)
    return tally


def _is_near(result: ObjectiveResult, truth: Mapping[str, Any], platform: str) -> bool:
    """Whether the truth misses this objective's threshold although the log keeps it."""
    true = truth["objectives"].get(TRUTH_NAMES[platform][result.variable.name])
    if result.value is None or result.threshold is None or result.variable.kind == "functional" or true is None:
        return False
    scale = 1 / JOULES_PER_WH if platform == "move_base" and result.variable.name == "energy" else 1.0
    return result.status == "ok" and not result.threshold.met(true * scale)


class _Peers:
    """The three rankings without a graph, trained on the same table."""

    def __init__(self, table: Path, profile: Profile) -> None:
        self.schema = profile.schema
        self.frame = read_table(table, profile.schema)
        kept = [np.nan_to_num(met(o, self.frame), nan=0.0) == 1.0 for o in profile.schema.objectives]
        self.met_all = np.all(kept, axis=0)
        self.classifier = PlainClassifier(self.frame, self.met_all, [o.name for o in profile.schema.options])

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
    profile: Profile,
    peers: _Peers | None,
    verbose: bool,
) -> None:
    tally.faults += 1
    tally.wrong_objectives += [f"{truth['tag']} {line}" for line in objectives_differ(diagnosis, truth, platform)]
    tally.abstained += diagnosis.abstained is not None
    _count_odds(tally, diagnosis, truth, reference, profile, peers)
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
    if diagnosis.fix is not None:
        suggested = frozenset(change.option.name for change in diagnosis.fix.changes)
        tally.fix_sizes.append(len(suggested))
        flown = {frozenset(row["reset"]): row["ok"] for row in truth["tried"]}
        tally.fix_flown += suggested in flown
        tally.fix_confirmed += flown.get(suggested, False)
    if verbose:
        fix = (
            [f"{c.option.name} {c.current:g}->{c.suggested:g}" for c in diagnosis.fix.changes]
            if diagnosis.fix
            else None
        )
        print(truth["tag"], "care:", rankings["care"][:3], "true:", truth["fixing"], "fix:", fix,
              f"{diagnosis.fix.p_fixed:.2f}" if diagnosis.fix else diagnosis.abstained)  # fmt: skip


def _count_odds(
    tally: Tally,
    diagnosis: Diagnosis,
    truth: Mapping[str, Any],
    reference: Mapping[str, float],
    profile: Profile,
    peers: _Peers | None,
) -> None:
    """Predicted odds of every reset that was flown, against whether it met all objectives."""
    config = {**reference, **diagnosis.run.config}
    bounds = thresholds_in_force(profile.schema, {})
    world = World(profile.model, config, {**diagnosis.run.metrics, **diagnosis.run.objectives}, bounds)
    changed = [{**config, **{name: reference[name] for name in row["reset"]}} for row in truth["tried"]]
    tally.odds.setdefault("care", []).extend(world.odds(changed))
    if peers is not None:
        tally.odds.setdefault("plain classifier", []).extend(peers.classifier.odds(changed))
    tally.outcomes.extend(float(row["ok"]) for row in truth["tried"])


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
    outcomes = np.array(tally.outcomes)
    for name, odds in tally.odds.items():
        p = np.array(odds)
        print(f"  odds of {len(p)} flown resets, {name}: calibration error {calibration_error(p, outcomes):.3f}, "
              f"Brier {((p - outcomes) ** 2).mean():.3f}")  # fmt: skip
    print(
        "  reliability (predicted, met, n): "
        + "; ".join(f"{a:.2f} {b:.2f} {c}" for a, b, c in reliability(np.array(tally.odds["care"]), outcomes))
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--shared", type=Path, required=True, help="folder that holds data/")
    parser.add_argument("--platform", choices=PLATFORMS, action="append", help="default: both")
    parser.add_argument(
        "--tables", type=Path, help="folder with PLATFORM.parquet or .csv, the training runs of the peers"
    )
    parser.add_argument("--verbose", action="store_true", help="one line a fault")
    args = parser.parse_args()
    for platform in args.platform or PLATFORMS:
        table = None
        if args.tables is not None:
            table = next(
                p for p in (args.tables / f"{platform}.parquet", args.tables / f"{platform}.csv") if p.exists()
            )
        show(platform, evaluate(platform, args.shared, table, args.verbose))


if __name__ == "__main__":
    main()
