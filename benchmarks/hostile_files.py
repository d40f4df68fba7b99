"""What `care triage` says to files made to deceive or to exhaust it: `python -m benchmarks.hostile_files`.

Each small file claims or unpacks to far more than it holds, or tells a failed run with a broken clock or a dead sensor.
Each is triaged in a process of its own; prints a Markdown table with the exit code, what was said first, the seconds of
the processor and the memory taken (at most: this program's own, some 270 MB, is the least that is seen), and last how
many kept within the bounds.
"""

from __future__ import annotations

import argparse
import json
import re
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

from care_core.errors import ExitCode
from care_core.files import bundled
from tests import hostile, restamped
from tests.bounded import MOST_MB, MOST_S, Answer, bounded

FAILED = bundled("samples", "arducopter_failed.BIN")
DEAD = {"current and energy of 0": 0.0, "current and energy that are no number": float("nan")}
WORDS = 160
"""Characters of what was said that the table holds."""
FOLDER = re.compile(r"/\S*/(?=\S)")

Asked = Callable[[Path], tuple[Path, tuple[object, ...]]]
"""Writes a file into a folder; returns it with the arguments of `care triage`."""


def main() -> None:
    """Print the table."""
    argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0]).parse_args()
    print("| file | bytes | exit | what `care triage` says first | s | MB |\n|---|---|---|---|---|---|")
    within, total = 0, 0
    for name, asked in cases():
        with tempfile.TemporaryDirectory() as folder:
            path, arguments = asked(Path(folder))
            size = sum(one.stat().st_size for one in (path.rglob("*") if path.is_dir() else [path]) if one.is_file())
            answer = bounded(Path(folder), "triage", *arguments, "--json")
        print(f"| {name} | {size:,} | {answer.code} | {said(answer)} | {answer.cpu_s:.1f} | {answer.peak_mb:.0f} |")
        total += 1
        within += answer.cpu_s < MOST_S and answer.peak_mb < MOST_MB and "Traceback" not in answer.stderr
    print(f"\n{within} of {total} within {MOST_S} s and {MOST_MB} MB, without a traceback.")


def cases() -> Iterator[tuple[str, Asked]]:
    """Every file by name."""
    for name, make in hostile.LOGS.items():
        yield name, lambda folder, make=make: alone(make(folder))  # type: ignore[misc]
    for name, make in hostile.PROFILES.items():
        yield f"a profile with {name}", lambda folder, make=make: with_profile(make(folder))  # type: ignore[misc]
    for kind in ("BIN", "tlog"):
        for name, clock in restamped.CLOCKS.items():
            yield (
                f"a failed flight, {kind}, its clock {name}",
                lambda folder, kind=kind, clock=clock: alone(restamped.written(folder, FAILED, clock, kind)),  # type: ignore[misc]
            )
    for name, value in DEAD.items():
        yield f"a failed flight, {name}", lambda folder, value=value: alone(dead(folder, value))  # type: ignore[misc]


def alone(log: Path) -> tuple[Path, tuple[object, ...]]:
    """A log to triage by itself."""
    return log, (log,)


def with_profile(profile: Path) -> tuple[Path, tuple[object, ...]]:
    """A profile to triage the bundled flight with."""
    return profile, (FAILED, "--profile", profile)


def dead(folder: Path, value: float) -> Path:
    """The failed flight with a current sensor that always says the same."""
    path = folder / "dead.BIN"
    path.write_bytes(restamped.dataflash_with(FAILED, "BAT", Curr=value, EnrgTot=value))
    return path


def said(answer: Answer) -> str:
    """The verdict with what was not evaluated, or the sentence of the error."""
    if not answer.stdout.strip():
        words = answer.stderr.strip()
    else:
        told = json.loads(answer.stdout)
        unknown = [f"{one['name']}: {one['reason']}" for one in told["objectives"] if one["status"] == "not_evaluated"]
        verdict = {ExitCode.OK: "OK", ExitCode.FAULT: "FAULT"}.get(ExitCode(answer.code), "not evaluated")
        words = "; ".join([verdict, *unknown, *(one["title"] for one in told["findings"])])
    words = " ".join(words.split()).replace("|", "/").removeprefix("care: ")
    words = FOLDER.sub("", words)
    return words if len(words) <= WORDS else f"{words[:WORDS]}…"


if __name__ == "__main__":
    main()
