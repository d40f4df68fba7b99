"""Are the probabilities estimates, and how many missions does it take until a robot is repaired?

    python -m benchmarks.odds FAULTS... [--most N] [--profile NAME] [--tables DIR]

Each folder holds failed missions with `truth.jsonl`: which resets were really flown or driven under the conditions of
the failure (`tried`), and which repaired it (`fixing`); or it is what `benchmarks.flown --resets` left. Nothing of them
was used for training. Told are

- hypotheses: of every option that was off, and of hardware where some failed, how likely it acted, against whether it
  is in a set that repaired the mission; the leading ones apart; none of a mission that only everything together is
  known to repair, three options and more: that tells nothing of which of them acted;
- promises: of every option that was put back alone the odds, against whether the mission then met everything;
- advised: the odds of what is advised, against whether that repaired the mission where it was flown, or else whether it
  holds a set that did: only the smallest sets were looked for, so counting those flown alone would leave out most that
  repair;
- calibration errors beside those of somebody whose every probability is true, on as many: in the mean, and in the
  worst of twenty;
- missions until repaired: each way proposes changes, one mission each, on top of those before, until a set that
  repaired the mission is among them; the last is everything at its reference and hardware mended.

    care        what is advised first, then the ranking; a part that is named is mended
    ranking     the ranking alone, from its first line
    classifier  the option that a plain classifier of the table that the profile learned from chooses first; it reads
                options and contexts (with `--tables`, where the folder holds the profile's)
    deviation   the option that is farthest off its reference first
    everything  all options back at once, then hardware
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import care_core
from benchmarks.flown import Done
from benchmarks.peers import PlainClassifier, classifier_of
from care_core.application.case import Case, Request
from care_core.causal.counterfactual import CounterfactualQuery
from care_core.diagnose.promise import Promise
from care_core.diagnose.ranking import deviating
from care_core.errors import CareError
from care_core.learn.skill import calibration_error, reliability
from care_core.learn.table import read_table
from care_core.logs.finding import logs_below
from care_core.numbers import Floats
from care_core.records import Record, Struct, field

HARDWARE = "hardware"
MOST_MISSIONS = 8
"""A way that has not repaired the robot by then puts everything back."""
FEW = 2
"""As many options at most were put back together, beside all of them."""
DRAWN = 1000
Truth = dict[str, Any]
Pairs = list[tuple[float, float]]


class Failure(Record, eq=False):
    """A failed mission as it was told, with its truth."""

    truth: Truth
    case: Case

    @property
    def query(self) -> CounterfactualQuery:
        assert self.case.reading is not None
        return self.case.reading.question.query

    @property
    def fixing(self) -> list[frozenset[str]]:
        return [frozenset(names) for names in self.truth.get("fixing") or ()]

    @property
    def acted(self) -> frozenset[str] | None:
        """What is in a set that repaired the mission; None where none but all that was off is known to."""
        whole = {HARDWARE, *deviating(self.query.config, self.query.reference)}
        if any(len(names) <= FEW or whole - names - {HARDWARE} for names in self.fixing):
            return frozenset().union(*self.fixing)
        return None

    @property
    def tried(self) -> dict[frozenset[str], bool]:
        """Whether the mission met everything, by what was put back."""
        rows = self.truth.get("tried") or ()
        pairs = ((row[0], row[2]) if isinstance(row, list) else (row["reset"], row["ok"]) for row in rows)
        return {frozenset(names): bool(ok) for names, ok in pairs}

    def repaired_by(self, changes: frozenset[str]) -> bool:
        """Whether a mission meets everything with these put back: as flown, else as it holds what repaired one."""
        return self.tried.get(changes, any(fixing <= changes for fixing in self.fixing))

    @property
    def promise(self) -> Promise | None:
        diagnosis = self.case.diagnosis
        broken = [fault.objective.variable.name for fault in diagnosis.faults]
        return None if diagnosis.failure is None else Promise(diagnosis.failure, self.query, broken)

    @property
    def advised(self) -> frozenset[str]:
        fix = self.case.diagnosis.fix
        return frozenset() if fix is None else frozenset(change.option.name for change in fix.changes)


class Told(Struct, eq=False):
    """What was said of the failures of one folder, beside what is true."""

    failures: int = 0
    flagged: int = 0
    hypotheses: Pairs = field(default_factory=list)
    leading: Pairs = field(default_factory=list)
    promises: Pairs = field(default_factory=list)
    advised: Pairs = field(default_factory=list)
    missions: dict[str, list[int]] = field(default_factory=dict)


def failures(folder: Path, most: int, profile: str | None) -> Iterator[Failure]:
    """Failed missions whose repair is known."""
    recorded = (folder / "truth.jsonl").exists()
    rows = _recorded(folder) if recorded else _flown(folder)
    known = [(row, log) for row, log in rows if row.get("fixing") and log is not None]
    for row, log in known[:most]:
        try:
            yield Failure(row, care_core.triage(Request(log, profile=profile)))
        except CareError as err:
            print(f"  {log}: {err.message}")


def _recorded(folder: Path) -> Iterator[tuple[Truth, Path | None]]:
    for row in map(json.loads, (folder / "truth.jsonl").read_text(encoding="utf-8").splitlines()):
        names = (folder / sub / f"{row['tag']}{end}" for sub in (".", "logs") for end in (".BIN", ".bag", ".ulg"))
        if not row["ok"]:
            yield row, next((path for path in names if path.exists()), None)


def _flown(folder: Path) -> Iterator[tuple[Truth, Path | None]]:
    """The faults of `benchmarks.flown`: where no option and no pair repairs one, all of them together may."""
    for fault in Done(folder / "faults.jsonl").faults():
        resets = fault.get("resets") or {}
        alone, pairs = resets.get("alone") or {}, resets.get("pairs") or ()
        fixing = [[name] for name, met in alone.items() if met] or [list(pair) for pair in pairs]
        if resets.get("all") and not fixing:
            fixing = [list(fault["off"])]
        tried = [[[name], None, met] for name, met in alone.items()]
        yield {"fixing": fixing, "tried": tried}, logs_below(folder / f"{fault['number']:04d}" / "fault" / "0")[0]


def judge(folder: Path, most: int, profile: str | None, tables: Path | None = None) -> Told:
    told = Told()
    peers: dict[str, PlainClassifier | None] = {}
    for one in failures(folder, most, profile):
        told.failures += 1
        diagnosis = one.case.diagnosis
        told.flagged += bool(diagnosis.faults) or any(f.severity == "critical" for f in diagnosis.health.findings)
        _count_hypotheses(told, one)
        _count_promises(told, one)
        ways = dict(WAYS)
        if tables is not None and (peer := _peer_of(one, tables, peers)) is not None:
            ways["classifier"] = partial(_by_classifier, peer)
        for way, proposals in ways.items():
            told.missions.setdefault(way, []).append(missions_until_repaired(one, proposals(one)))
    return told


def _peer_of(one: Failure, tables: Path, known: dict[str, PlainClassifier | None]) -> PlainClassifier | None:
    """A classifier of the table that the profile of a failure learned from, None where the folder does not hold it."""
    assert one.case.reading is not None
    schema = one.case.reading.profile.schema
    if schema.name not in known:
        table = next(iter(sorted(tables.glob(f"{schema.name}.*"))), None)
        known[schema.name] = None if table is None else classifier_of(read_table(table, schema), schema)
    return known[schema.name]


def _count_hypotheses(told: Told, one: Failure) -> None:
    if not one.case.diagnosis.hypotheses:  # it was not flagged, which is counted apart
        return
    true = one.acted
    if true is None:
        return
    hypotheses, failure = one.case.diagnosis.hypotheses, one.case.diagnosis.failure
    named = {h.name: h.acts for h in hypotheses if h.what == "parameter" and h.name}
    parts = max((h.acts for h in hypotheses if h.what == HARDWARE), default=0.0)
    if failure is not None:
        off = deviating(one.query.config, one.query.reference)
        named = {name: failure.acts(("parameter", name)) for name in off} | named
    if one.truth.get(HARDWARE) or HARDWARE in true or parts:
        named[HARDWARE] = parts
    told.hypotheses += [(share, float(name in true)) for name, share in named.items()]
    if named:
        first = max(named, key=lambda name: named[name])
        told.leading.append((named[first], float(first in true)))


def _count_promises(told: Told, one: Failure) -> None:
    promise, fix = one.promise, one.case.diagnosis.fix
    if promise is None:
        return
    for names, ok in one.tried.items():
        if len(names) == 1 and names <= one.query.config.keys():
            config = {**one.query.config, **{name: one.query.reference[name] for name in names}}
            told.promises.append((float(promise.odds([config])[0]), float(ok)))
    if fix is not None and fix.odds is not None:
        told.advised.append((fix.odds, float(one.repaired_by(one.advised))))


def missions_until_repaired(one: Failure, proposals: Sequence[frozenset[str]]) -> int:
    """How many missions are run until one meets everything, changes put on top of each other; all of them where nobody
    is told that it failed."""
    if not proposals:
        return MOST_MISSIONS
    done: frozenset[str] = frozenset()
    for count, changes in enumerate(proposals[:MOST_MISSIONS], start=1):
        done |= changes
        if one.repaired_by(done):
            return count
    return min(len(proposals), MOST_MISSIONS) + 1


def _by_ranking(one: Failure) -> list[frozenset[str]]:
    named = [h for h in one.case.diagnosis.hypotheses if h.name and h.what in ("parameter", HARDWARE)]
    return [frozenset((HARDWARE if h.what == HARDWARE else h.name,)) for h in named]


def _by_advice(one: Failure) -> list[frozenset[str]]:
    ranking = _by_ranking(one)
    if not one.advised:
        return ranking
    return [one.advised, *(changes for changes in ranking if not changes <= one.advised)]


def _by_deviation(one: Failure) -> list[frozenset[str]]:
    query = one.query
    off = deviating(query.config, query.reference)
    far = {name: query.variables[name].distance(query.config[name], query.reference[name]) for name in off}
    return [frozenset((name,)) for name in sorted(off, key=lambda name: -far[name])]


def _by_classifier(peer: PlainClassifier, one: Failure) -> list[frozenset[str]]:
    query = one.query
    return [
        frozenset((name,))
        for name in peer.rank(query.config, query.reference, deviating(query.config, query.reference))
    ]


def _everything(one: Failure) -> list[frozenset[str]]:
    return [frozenset(deviating(one.query.config, one.query.reference)), frozenset((HARDWARE,))]


WAYS: dict[str, Callable[[Failure], list[frozenset[str]]]] = {
    "care": _by_advice, "ranking": _by_ranking, "deviation": _by_deviation, "everything": _everything,
}  # fmt: skip


def show(folder: Path, told: Told) -> None:
    where = f"{folder.parent.name}/{folder.name}"
    print(f"{where}: {told.failures} failed missions that something repairs, {told.flagged} flagged")
    for name, pairs in (("hypotheses", told.hypotheses), ("leading", told.leading), ("promises", told.promises),
                        ("advised", told.advised)):  # fmt: skip
        if pairs:
            print(f"  {name:10s} {scores(pairs)}")
    for share, seen, count in reliability(*map(np.array, zip(*told.hypotheses, strict=True))):
        print(f"    acts {share:4.2f}  true {seen:4.2f}  {count:4d}")
    for way, counts in told.missions.items():
        print(f"  missions until repaired, {way:10s} mean {np.mean(counts):.2f}, at the first {counts.count(1)}")


def scores(pairs: Pairs) -> str:
    """How far probabilities are from what came true, in one line."""
    said, true = (np.clip(np.array(part, dtype=float), 0.002, 0.998) for part in zip(*pairs, strict=True))
    met = np.round(true)
    brier = float(np.mean((said - met) ** 2))
    loss = float(-np.mean(np.log(np.where(met == 1.0, said, 1.0 - said))))
    by_luck = errors_by_luck(said)
    return (
        f"{len(pairs):4d}: said {said.mean():.3f}, true {met.mean():.3f}, calibration error "
        f"{calibration_error(said, met):.3f} (by luck {by_luck.mean():.3f} to {np.quantile(by_luck, 0.95):.3f}), "
        f"Brier {brier:.4f}, log loss {loss:.3f}"
    )


def errors_by_luck(said: Floats) -> Floats:
    """Calibration errors of `DRAWN` worlds in which these probabilities are true: few pairs show none that is small."""
    rng = np.random.default_rng(0)
    return np.array([calibration_error(said, (rng.random(len(said)) < said).astype(float)) for _ in range(DRAWN)])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", type=Path, help="folders with truth.jsonl and logs")
    parser.add_argument("--most", type=int, default=10**9, help="so many failures of each")
    parser.add_argument("--profile", help="a folder or a name, in place of the one that fits best")
    parser.add_argument("--tables", type=Path, help="folder of NAME.parquet or NAME.csv that the profiles learned from")
    asked = parser.parse_args()
    os.environ["CARE_HISTORY"] = "off"  # simulated vehicles share a name, and a run of one is no good run of another
    for folder in asked.folders:
        show(folder, judge(folder, asked.most, asked.profile, asked.tables))


if __name__ == "__main__":
    main()
