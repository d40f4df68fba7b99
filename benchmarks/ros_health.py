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
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from care_core.health.records import Finding
from care_core.health.ros.examining import examine
from care_core.health.ros.recording import Recording
from care_core.logs.opening import open_log
from care_core.logs.ros_log import RosLog

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


@dataclass(frozen=True)
class Driven:
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


def driven(folder: Path) -> Iterator[Driven]:
    """The missions of a folder with its truth."""
    for line in (folder / "truth.jsonl").read_text().splitlines():
        row = json.loads(line)
        places = (folder / f"{row['tag']}.bag", folder / "logs" / f"{row['tag']}.bag")
        path = next((one for one in places if one.exists()), None)
        if path is None or row.get("dropped"):
            continue
        failed = row["hardware"] or {}
        log = open_log(path)
        commands = Recording.read(log).commands if isinstance(log, RosLog) else None
        began_s = (float(commands.t[0]) if commands else 0.0) + failed.get("fail_at", 0.0)
        start = time.perf_counter()
        findings = examine(log).findings
        took = [one.seconds for one in missions]
    print(f"reading, account and checks: {1000 * np.median(took):.0f} ms a mission, at most {1000 * max(took):.0f}")
    for one in missions if args.list else []:
        told = [(f.severity[0], f.kind, round(f.onset_s), f.title[:30]) for f in one.findings]
        print(one.tag, one.failure or "-", round(one.began_s), "met" if one.met else one.cause, told)


if __name__ == "__main__":
    main()
