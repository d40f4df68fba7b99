"""How well the health checks of ROS recordings find what fails, on missions whose truth is known.

python -m benchmarks.ros_health DIR [--healthy DIR] [--list]

DIR: truth.jsonl and the bags of its `tag`s; --healthy: a folder of bags on which no hardware failed. Prints per kind of
failure how often it is found, found first, and among the first three, and how far off its onset is; per kind of finding
how often it is right (what `Finding.probability` should say; with half a success and half a failure added) and how
often missions that met everything, and those on which nothing failed, get one.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from care_core.ecosystems.findings import Finding
from care_core.ecosystems.ros.drive import Drive
from care_core.ecosystems.ros.examining import examine
from care_core.logs.opening import open_log
from care_core.logs.ros_log import RosLog
from care_core.records import Record

RIGHT = {
    "laser_dead": {"laser"},
    "laser_noise": {"laser"},
    "laser_stuck": {"laser"},
    "odom_jump": {"localisation"},
    "odom_drift": {"localisation", "drive"},
    "drive_weak": {"drive", "commands"},
    "drive_one_side": {"drive", "commands"},
    "stall": {"drive", "commands"},
    "blocked": {"blocked", "planner"},
    "battery": {"battery"},
    "command_loss": {"commands", "drive"},
}


class Driven(Record):
    """One mission with its truth and what was found."""

    tag: str
    failure: str
    began_s: float
    met: bool
    cause: str
    findings: tuple[Finding, ...]
    seconds: float

    @property
    def matters(self) -> bool:
        """Whether the mission failed because of what failed on it."""
        return bool(self.failure) and self.cause in ("hardware", "both")


def driven_in(path: Path) -> Drive:
    """The drive that a bag holds."""
    log = open_log(path)
    assert isinstance(log, RosLog)
    return Drive(log)


def driven(folder: Path) -> Iterator[Driven]:
    """The missions of a folder with its truth."""
    for line in (folder / "truth.jsonl").read_text().splitlines():
        row = json.loads(line)
        places = (folder / f"{row['tag']}.bag", folder / "logs" / f"{row['tag']}.bag")
        path = next((one for one in places if one.exists()), None)
        if path is None or row.get("dropped"):
            continue
        failed = row["hardware"] or {}
        start = time.perf_counter()
        drive = driven_in(path)
        findings = examine(drive).findings
        took = time.perf_counter() - start
        began_s = (float(drive.commands.t[0]) if drive.commands else 0.0) + failed.get("fail_at", 0.0)
        yield Driven(row["tag"], failed.get("fail_kind", ""), began_s, row["ok"], row.get("cause", ""), findings, took)


def by_failure(missions: list[Driven]) -> Iterator[str]:
    """A line per kind of failure: all on which it happened, then those that failed because of it."""
    yield "failure         all found | lost first three | onset off by s (median, worst)"
    total: Counter[str] = Counter()
    for kind in sorted({one.failure for one in missions if one.failure}):
        own = [one for one in missions if one.failure == kind]
        lost = [one for one in own if one.matters]
        hits = {one.tag: [f for f in every(one.findings) if f.kind in RIGHT[kind]] for one in own}
        first = sum(bool(one.findings) and one.findings[0].kind in RIGHT[kind] for one in lost)
        three = sum(any(f.kind in RIGHT[kind] for f in one.findings[:3]) for one in lost)
        off = [min(abs(f.onset_s - one.began_s) for f in hits[one.tag]) for one in own if hits[one.tag]]
        errors = f"{np.median(off):5.1f} {max(off):5.1f}" if off else ""
        yield f"{kind:15s} {len(own):3d} {len(off):5d} | {len(lost):4d} {first:5d} {three:5d} | {errors}"
        total.update(all=len(own), found=len(off), lost=len(lost), first=first, three=three)
    counts = [total[name] for name in ("all", "found", "lost", "first", "three")]
    yield "{:15s} {:3d} {:5d} | {:4d} {:5d} {:5d} |".format("together", *counts)


def by_finding(missions: list[Driven]) -> Iterator[str]:
    """A line per kind of finding that names hardware or the world, consequences left out: they are explained."""
    yield f"{'finding':40s} {'told':>4s} {'right':>5s} {'is':>5s} {'says':>5s}"
    told: dict[str, list[tuple[Finding, Driven]]] = defaultdict(list)
    for one in missions:
        for finding in one.findings:
            if finding.suspect in ("hardware", "world"):
                told[f"{finding.kind}: {finding.title}"[:40]].append((finding, one))
    for name, pairs in sorted(told.items()):
        right = sum(finding.kind in RIGHT.get(one.failure, ()) for finding, one in pairs)
        says = float(np.mean([finding.probability for finding, _ in pairs]))
        yield f"{name:40s} {len(pairs):4d} {right:5d} {(right + 0.5) / (len(pairs) + 1):5.2f} {says:5.2f}"


def false_alarms(missions: Iterable[tuple[str, tuple[Finding, ...]]], of: str) -> str:
    """How many missions on which nothing failed, or which met everything, are told of a part that failed."""
    every_one = list(missions)
    named = [tag for tag, found in every_one if any(_accuses(finding) for finding in found)]
    critical = sum(any(f.severity == "critical" for f in found) for _, found in every_one)
    return f"{of}: {len(every_one)}; told of hardware or world {len(named)} {named[:5]}, critical findings {critical}"


def _accuses(finding: Finding) -> bool:
    return finding.suspect in ("hardware", "world") and finding.severity != "info"


def every(findings: tuple[Finding, ...]) -> Iterator[Finding]:
    """Findings and their consequences."""
    for finding in findings:
        yield finding
        yield from every(finding.consequences)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--healthy", type=Path)
    parser.add_argument("--list", action="store_true", help="print each mission with its failure and findings")
    args = parser.parse_args()
    missions = list(driven(args.folder))
    for line in (*by_failure(missions), "", *by_finding(missions), ""):
        print(line)
    print(false_alarms(((one.tag, one.findings) for one in missions if one.met), "met everything"))
    print(false_alarms(((one.tag, one.findings) for one in missions if not one.failure), "nothing failed"))
    if args.healthy:
        bags = sorted(args.healthy.rglob("*.bag"))
        looks = ((bag.name, examine(driven_in(bag)).findings) for bag in bags)
        print(false_alarms(looks, "healthy hardware, any parameters"))
    took = [one.seconds for one in missions]
    print(f"reading, account and checks: {1000 * np.median(took):.0f} ms a mission, at most {1000 * max(took):.0f}")
    for one in missions if args.list else []:
        told = [(f.severity[0], f.kind, round(f.onset_s), f.title[:30]) for f in one.findings]
        print(one.tag, one.failure or "-", round(one.began_s), "met" if one.met else one.cause, told)


if __name__ == "__main__":
    main()
