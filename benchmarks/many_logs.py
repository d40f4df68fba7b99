"""`care ingest` of many logs with one process and with two, beside triages in a loop.

    python -m benchmarks.many_logs [--logs 1000] [--loop 20]

The logs are the bundled sample under as many names. Printed are wall seconds, the peak of
the memory of all processes together early and late (flat: it does not grow with the logs), what the second process
gains, and what a triage of each log in a process of its own would take (of `--loop` of them, scaled). The machine needs
two idle cores for the gain to mean anything: its load is printed.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

from benchmarks.ingest import INSTALLED, SAMPLE, TRIAGE

LEAST_GAIN, MOST_GROWTH = 1.8, 1.1
INGEST = (sys.executable, "-c", "from care_tui.start import main; main()", "ingest")


class Cost(NamedTuple):
    """Wall seconds, and the peak of memory in MB of the first and of the last third of the time."""

    seconds: float
    early_mb: float
    late_mb: float


def resident_mb(pid: int) -> float:
    """Anonymous memory of a process and its descendants."""
    total, left = 0, [pid]
    while left:
        one = Path("/proc") / str(left.pop())
        try:
            lines = (one / "status").read_text().splitlines()
            total += sum(int(line.split()[1]) for line in lines if line.startswith("RssAnon"))
            left += [
                int(child) for task in (one / "task").iterdir() for child in (task / "children").read_text().split()
            ]
        except OSError:
            continue
    return total / 1024


def ingested(folder: Path, workers: int) -> Cost:
    """One `care ingest` of a folder."""
    out = folder / f"runs{workers}.csv"
    words = (*INGEST, str(folder), "-o", str(out), "--workers", str(workers), "--profile", "arducopter")
    seen: list[tuple[float, float]] = []
    began = time.perf_counter()
    with subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=INSTALLED) as process:
        while process.poll() is None:
            seen.append((time.perf_counter() - began, resident_mb(process.pid)))
            time.sleep(0.1)
    seconds = time.perf_counter() - began
    if process.returncode != 0:
        raise SystemExit(f"ended with {process.returncode}")
    out.unlink()
    early = max((mb for at, mb in seen if at < seconds / 3), default=0.0)
    return Cost(seconds, early, max((mb for at, mb in seen if at > 2 * seconds / 3), default=0.0))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--logs", type=int, default=1000)
    parser.add_argument("--loop", type=int, default=20, help="triages that the loop is scaled from")
    args = parser.parse_args()
    content = SAMPLE.read_bytes()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for number in range(args.logs):
            (folder / f"log{number:05d}.BIN").write_bytes(content)
        print(
            f"{args.logs} logs of {len(content) / 1e6:.1f} MB, load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores"
        )
        one, two = ingested(folder, 1), ingested(folder, 2)
        began = time.perf_counter()
        for number in range(args.loop):
            path = str(folder / f"log{number:05d}.BIN")
            subprocess.run(
                [*TRIAGE, path], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=INSTALLED, check=False
            )
        loop_s = (time.perf_counter() - began) * args.logs / args.loop
    for what, cost in (("one process", one), ("two", two)):
        print(f"  {what:12s} {cost.seconds:7.1f} s, {cost.early_mb:5.0f} MB early, {cost.late_mb:5.0f} MB late")
    print(f"  triages in a loop {loop_s:.0f} s: {loop_s / two.seconds:.1f} times as long as two processes")
    gain, growth = one.seconds / two.seconds, max(cost.late_mb / max(cost.early_mb, 1.0) for cost in (one, two))
    print(
        f"  {'kept  ' if gain >= LEAST_GAIN else 'MISSED'} {gain:.2f} times by the second core, at least {LEAST_GAIN}"
    )
    print(f"  {'kept  ' if growth <= MOST_GROWTH else 'MISSED'} memory grows {growth:.2f} times, at most {MOST_GROWTH}")


if __name__ == "__main__":
    main()
