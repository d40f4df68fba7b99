"""How well the health checks find failing hardware on flights whose truth is known.

python -m benchmarks.health LOGS TABLE.csv [--list]

LOGS: a folder of <tag>.BIN; TABLE.csv: `tag`, `hardware`, `hardware_after_s`, `hardware_parameters`, `success`. Prints
per kind of hardware how often the check that should find it does, how late the onset is told, and how often it is told
first; per kind of finding how often it is right (which is what `Finding.probability` should say, in bins) and how often
healthy flights get one. Hardware counts only from when it began, in flights that were armed by then.
"""

from __future__ import annotations

import argparse
import csv
import json
import time
from collections import defaultdict
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np

from care_core.ecosystems.ardupilot.examining import find
from care_core.ecosystems.ardupilot.flight import as_flight
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.registry import run_model
from care_core.errors import LogError
from care_core.logs.opening import open_log
from care_core.records import Record

RIGHT = {
    "motor": {"motor", "thrust"}, "gps_glitch": {"gps"}, "gps_few": {"gps"}, "compass": {"compass"},
    "vibration": {"vibration", "imu"}, "battery": {"battery"}, "baro": {"barometer"}, "imu_noise": {"imu", "vibration"},
}  # fmt: skip
_BINS = (0.0, 0.3, 0.6, 0.8, 0.9, 0.96, 1.0)


class Flown(Record):
    """One flight with its truth and what was found."""

    tag: str
    hardware: str
    strength: str
    began_s: float | None
    """When the hardware failed, seconds of the log; None where it never did (no arming by then)."""
    is_healthy: bool
    findings: tuple[Finding, ...]
    seconds: float


def every(findings: tuple[Finding, ...]) -> Iterator[Finding]:
    """Findings and their consequences."""
    for finding in findings:
        yield finding
        yield from every(finding.consequences)


def read(logs: Path, table: Path) -> Iterator[Flown]:
    """The flights of a table, one by one."""
    for row in csv.DictReader(table.open(encoding="utf-8")):
        try:
            log = open_log(logs / f"{row['tag']}.BIN")
        except LogError:
            continue
        flight = as_flight(run_model(log))
        start = time.perf_counter()
        findings = find(flight)
        took = time.perf_counter() - start
        after = float(row["hardware_after_s"] or 0)
        began = (
            flight.armed[0][0] + after if flight.armed and flight.armed[-1][1] > flight.armed[0][0] + after else None
        )
        strength = row["hardware_parameters"]
        healthy = not row["hardware"] and row["success"] == "1"
        yield Flown(row["tag"], row["hardware"], strength, began, healthy, findings, took)


def by_hardware(flights: list[Flown]) -> Iterator[str]:
    yield f"{'hardware':12s} {'began':>5s} {'found':>5s} {'first':>5s} {'three':>5s}  onset error s (median, 90%)"
    for kind in sorted({one.hardware for one in flights if one.hardware}):
        own = [one for one in flights if one.hardware == kind and one.began_s is not None]
        found = first = three = 0
        late: list[float] = []
        for one in own:
            hits = [f for f in every(one.findings) if f.kind in RIGHT[kind]]
            found += bool(hits)
            kinds = [f.kind for f in one.findings]
            first += bool(kinds) and kinds[0] in RIGHT[kind]
            three += bool(set(kinds[:3]) & RIGHT[kind])
            if hits and one.began_s is not None:
                late.append(min(f.onset_s for f in hits) - one.began_s)
        errors = f"{np.median(np.abs(late)):6.1f} {np.quantile(np.abs(late), 0.9):6.1f}" if late else ""
        yield f"{kind:12s} {len(own):5d} {found:5d} {first:5d} {three:5d}  {errors}"


def by_kind(flights: list[Flown]) -> Iterator[str]:
    healthy = [one for one in flights if one.is_healthy]
    yield f"{'finding':12s} {'told':>5s} {'right':>5s} {'healthy':>7s} {'critical':>8s}   right of told by probability"
    found: dict[str, list[tuple[Finding, Flown]]] = defaultdict(list)
    for one in flights:
        for finding in every(one.findings):
            found[finding.kind].append((finding, one))
    for kind, pairs in sorted(found.items()):
        right = [kind in RIGHT.get(one.hardware, ()) for _, one in pairs]
        warned = sum(one.is_healthy and finding.severity != "info" for finding, one in pairs)
        critical = sum(one.is_healthy and finding.severity == "critical" for finding, one in pairs)
        said = np.array([finding.probability for finding, _ in pairs])
        bins = []
        for low, high in pairwise(_BINS):
            inside = (said > low) & (said <= high)
            if inside.any():
                bins.append(f"{said[inside].mean():.2f}: {int(np.sum(np.array(right)[inside]))}/{int(inside.sum())}")
        yield f"{kind:12s} {len(pairs):5d} {sum(right):5d} {warned:7d} {critical:8d}   {', '.join(bins)}"
    yield f"healthy flights {len(healthy)}, with a critical finding " + str(
        sum(any(f.severity == "critical" for f in every(one.findings)) for one in healthy)
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("logs", type=Path)
    parser.add_argument("table", type=Path)
    parser.add_argument("--list", action="store_true", help="print each flight with hardware, or with a finding")
    args = parser.parse_args()
    flights = list(read(args.logs, args.table))
    for line in (*by_hardware(flights), "", *by_kind(flights)):
        print(line)
    took = [one.seconds for one in flights]
    print(f"checks: {1000 * np.median(took):.0f} ms a flight, at most {1000 * max(took):.0f}")
    for one in flights if args.list else []:
        if one.hardware or one.findings:
            told = [(f.severity[0], f.kind, round(f.onset_s), round(f.probability, 2)) for f in one.findings]
            strength = json.loads(one.strength) if one.strength else ""
            print(one.tag, one.hardware or "-", strength, one.began_s and round(one.began_s), told)


if __name__ == "__main__":
    main()
