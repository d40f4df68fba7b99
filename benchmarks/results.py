"""All benchmarks in one go: writes benchmarks/RESULTS.md with machine, date, commit, and what each printed.

    python -m benchmarks.results [--shared DIR] [--tables DIR] [--only NAME]... [--list]

Each stands with its bar and the peer on the same input; a benchmark that fails, or whose data are not here, says so in
its place. A part that is not run keeps what it printed before, under the commit it was printed at.
"""

from __future__ import annotations

import argparse
import os
import platform
import re
import subprocess
import sys
import sysconfig
import time
from collections.abc import Iterable
from contextlib import suppress
from datetime import date
from pathlib import Path

from care_core.files import write_atomically
from care_core.records import Record

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "benchmarks" / "RESULTS.md"


class Benchmark(Record):
    """A command, with `{shared}` and `{tables}` where it needs recorded data, its bar and its peer."""

    name: str
    command: str
    bar: str
    peer: str
    settings: tuple[tuple[str, str], ...] = ()
    """Of its environment."""

    def words(self, shared: Path | None, tables: Path | None) -> list[str] | None:
        """The command as it is run; None where its data are not here."""
        if ("{shared}" in self.command and shared is None) or ("{tables}" in self.command and tables is None):
            return None
        return self.command.format(shared=shared, tables=tables).split()


BENCHMARKS = (
    Benchmark("planted", "benchmarks.planted", "no confident wrong answer", "plain classifier"),
    Benchmark(
        "graph_worth",
        "benchmarks.graph_worth",
        "a learned graph is worth more than a permuted one",
        "none, plain classifier",
    ),
    Benchmark(
        "reference_odds",
        "benchmarks.reference_odds",
        "less bias than where every run leaves the reference in as many options",
        "such a campaign",
    ),
    Benchmark("related", "benchmarks.related", "a related robot's profile helps below 100 runs", "from nothing"),
    Benchmark("discovery", "benchmarks.discovery --robots 16", "the default is not beaten", "other ways of the search"),
    Benchmark("observational", "benchmarks.observational", "fewer wrong field days than the peer", "plain classifier"),
    Benchmark(
        "odds",
        "benchmarks.odds {shared}/data/varied/faults {shared}/data/rover/faults {shared}/data/move_base/faults"
        " --tables {tables}",
        "calibration error <= 0.05; fewest missions until repaired",
        "plain classifier; largest deviation; everything at its reference",
    ),
    Benchmark(
        "measured",
        "benchmarks.measured {shared}/data/anyparam",
        "cause among the first three in 70% of any parameters",
        "without each measurement; each alone",
    ),
    Benchmark("fixes", "benchmarks.fixes", "suggested values do as well as resets", "reset to the reference"),
    Benchmark(
        "paper", "care_tui evaluate husky-care --faults {shared}/data/care", "F1 of the paper's rule 0.81", "CBI"
    ),
    Benchmark("artifact", "benchmarks.artifact --shared {shared}", "10 of 10 reproduced", "the published predictions"),
    Benchmark(
        "diagnosis",
        "benchmarks.diagnosis --shared {shared} --tables {tables}",
        "not worse than before: 25 of 25, 19 of 20 causes first",
        "CBI, largest deviation, plain classifier",
    ),
    Benchmark(
        "travel",
        "benchmarks.travel --shared {shared} --table {tables}/arducopter.parquet",
        "cause first in 80%",
        "plain classifier with the same contexts",
    ),
    Benchmark(
        "travel_rover",
        "benchmarks.travel --platform ardurover --shared {shared} --table {tables}/ardurover.parquet",
        "cause first in 80%",
        "plain classifier with the same contexts",
    ),
    Benchmark(
        "nav2_mppi",
        "benchmarks.flown {tables}/nav2-mppi/flown.yaml --profile profiles/nav2-mppi --table {tables}/nav2-mppi.csv"
        " --faults 30 --resets alone --seed 91001 -o {tables}/nav2-mppi/flown",
        "promised is true within 0.07; cause first above the peers",
        "furthest option, plain classifier",
    ),
    Benchmark(
        "nav2_rpp",
        "benchmarks.flown {tables}/nav2-rpp/flown.yaml --profile profiles/nav2-rpp --table {tables}/nav2-rpp.csv"
        " --faults 20 --resets pairs --seed 92001 -o {tables}/nav2-rpp/flown",
        "promised is true within 0.07; cause first above the peers",
        "furthest option, plain classifier",
    ),
    Benchmark("ros_health", "benchmarks.ros_health {shared}/data/ros_hardware", "kind in three in 70%", "none known"),
    Benchmark("wild_logs", "benchmarks.wild_logs --shared {shared}", "no crash, each refusal a sentence", "none known"),
    Benchmark("hostile_files", "benchmarks.hostile_files", "1000 MB and 20 s", "none known"),
    Benchmark("few_runs", "benchmarks.few_runs --shared {shared} --tables {tables}", "above the peers", "CBI, plain"),
    Benchmark(
        "learning",
        "benchmarks.learning --shared {shared}",
        "30 s (622 options), 120 s (10,000 runs), 2 GB",
        "causal-learn's FCI",
    ),
    Benchmark("fleet", "benchmarks.fleet", "peak grows by 15% at most; 0.8 of a loop on one worker", "a plain loop"),
    Benchmark("ingest", "benchmarks.ingest", "0.8, 2, 0.8 s; 300 MB; 5 times faster", "pymavlink, rosbags, mcap"),
    Benchmark("px4_logs", "benchmarks.px4_logs", "0.7 of the peer's time, 150 MB", "pyulog reading all of it"),
    Benchmark("small_triage", "benchmarks.small_triage", "0.4 s of processor", "importing numpy"),
    Benchmark(
        "big_files",
        "benchmarks.big_files",
        "300 MB, 5% of the bytes, twice the peer, stopped in 0.2 s",
        "rosbags, mcap, SQLite, numpy and cat on the same file",
    ),
    Benchmark("many_logs", "benchmarks.many_logs", "1.8 times by the second core, memory flat", "triage in a loop"),
    Benchmark("growth", "benchmarks.growth --picture docs/growth.svg", "2 GB", "none"),
    Benchmark("slow_link", "benchmarks.slow_link", "no key lost, still 1 s after the release", "none"),
    Benchmark(
        "own_code", "benchmarks.own_code", "3 x the library, or what it loses of a damaged file", "the libraries"
    ),
    Benchmark(
        "tui", "benchmarks.tui", "0.5 s to the first frame, 50 ms a key, 2 kB", "lazygit, harlequin, posting, btop"
    ),
    Benchmark("widgets", "benchmarks.widgets", "a third of the bytes or of the time", "Textual's own"),
    Benchmark("fuzz", "benchmarks.tools.fuzzing --seconds 60", "no finding in any target", "none"),
    Benchmark(
        "mutate",
        "benchmarks.tools.mutating --count 3000 samples/arducopter_failed.BIN samples/ardurover_failed.BIN"
        " samples/move_base_drive.bag samples/nav2_failed.mcap",
        "no traceback, no death, 1 GB and 20 s",
        "none",
    ),
    Benchmark(
        "kills",
        "pytest -q tests/integration/test_kills.py",
        "200 kills: nothing lost, nothing half-written",
        "none",
        settings=(("CARE_KILLS", "200"),),
    ),
    Benchmark("matrix", "benchmarks.tools.matrix", "Python 3.10 to 3.13, 420 MB, wheels for aarch64", "none"),
)


def main() -> None:
    """Run what was asked for and renew its sections."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    shared = os.environ.get("CARE_SHARED")
    parser.add_argument("--shared", type=Path, default=Path(shared) if shared else None, help="folder with `data`")
    parser.add_argument("--tables", type=Path, help="tables of runs (benchmarks.tools.train_profiles --tables)")
    parser.add_argument("--only", action="append", choices=[one.name for one in BENCHMARKS])
    parser.add_argument("--list", action="store_true")
    asked = parser.parse_args()
    if asked.list:
        print("\n".join(f"{one.name:14} {one.command}" for one in BENCHMARKS))
        return
    sections = kept(RESULTS.read_text(encoding="utf-8") if RESULTS.is_file() else "")
    for one in BENCHMARKS:
        if not asked.only or one.name in asked.only:
            print(one.name, flush=True)
            sections[one.name] = section(one, one.words(asked.shared, asked.tables))
            write_atomically(RESULTS, document(sections[each.name] for each in BENCHMARKS if each.name in sections))


def kept(text: str) -> dict[str, str]:
    """The sections of an earlier run, by name."""
    return {part.splitlines()[0].strip(): f"## {part.rstrip()}\n" for part in re.split(r"^## ", text, flags=re.M)[1:]}


def section(one: Benchmark, words: list[str] | None) -> str:
    """One benchmark with what it printed."""
    head = f"## {one.name}\n\nBar: {one.bar}. Peer: {one.peer}.\n\n"
    if words is None:
        return f"{head}Not run at {commit()}: its data are not here.\n"
    began = time.monotonic()
    ended = subprocess.run(
        [sys.executable, "-m", *words],
        capture_output=True,
        text=True,
        cwd=ROOT,
        stdin=subprocess.DEVNULL,
        env={**os.environ, **dict(one.settings)},
        check=False,
    )
    told = f"{machine()}, {date.today().isoformat()}, commit {commit()}, {time.monotonic() - began:.0f} s"
    printed = _anywhere(ended.stdout.rstrip()) or "(nothing)"
    failed = (
        "" if ended.returncode == 0 else f"\nEnded with {ended.returncode}: {_anywhere(ended.stderr.strip()[-300:])}\n"
    )
    set_to = "".join(f"{name}={value} " for name, value in one.settings)
    return f"{head}`{set_to}python -m {one.command}` ({told}):\n\n```\n{printed}\n```\n{failed}"


def _anywhere(printed: str) -> str:
    """A text without the folders of this machine: paths begin at the checkout, and at the packages."""
    packages = sysconfig.get_path("purelib")
    return printed.replace(f"{ROOT}/", "").replace(f"{packages}/", "")


def document(sections: Iterable[str]) -> str:
    """The whole file."""
    return "# Results of all benchmarks\n\nWritten by `make bench`.\n\n" + "\n".join(sections)


def machine() -> str:
    """What the figures were taken on."""
    load = os.getloadavg()[0]
    cores = f"{os.cpu_count()} cores {platform.machine()}{_processor()}"
    return f"{cores}, Python {platform.python_version()}, load {load:.1f}"


def _processor() -> str:
    """The processor's name, and whether it has what numpy's quick exponentials need: both explain a factor of two."""
    with suppress(OSError):
        told = Path("/proc/cpuinfo").read_text()
        name = re.search(r"^model name\s*: (.*)$", told, re.MULTILINE)
        lacks = "" if "avx512f" in told else " without AVX-512"
        return f" ({name[1]}{lacks})" if name else ""
    return ""


def commit() -> str:
    """The commit that is checked out."""
    found = subprocess.run(
        ("git", "rev-parse", "--short", "HEAD"), capture_output=True, text=True, cwd=ROOT, check=False
    )
    return found.stdout.strip() or "unknown"


if __name__ == "__main__":
    main()
