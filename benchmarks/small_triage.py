"""Where the time of a small triage goes, beside importing numpy alone.

    python -m benchmarks.small_triage [LOG] [--runs 9] [--profile FILE] [--checkout DIR]

Seconds of the processor (user and system, so that other work on the machine disturbs little) of whole cold processes,
the bytecode compiled and the cache of profiles warm: medians of so many runs, and in turns with numpy's import. The
shares come from the same command in a process that takes the time between the steps: Python's start, importing (by
modules that are not there yet), reading (choose a profile, what happened, the run), judging, diagnosing, printing (with
the entry in the history), and the command's own work: its line, opening the log and its digest. `--profile` writes what
cProfile sees, `--checkout` measures another checkout with the same clock.
"""

from __future__ import annotations

import argparse
import os
import resource
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

ROOT = Path(__file__).parents[1]
SAMPLE = ROOT / "samples" / "arducopter_failed.BIN"
MOST_CPU_S = 0.4

COMMAND = "from care_tui.start import main; main()"
STEPS = """
import builtins, importlib, os, sys, time
spent, inside = {"importing": 0.0}, [0]
def counted(original):
    def timed(*args, **kwargs):
        if inside[0]:
            return original(*args, **kwargs)
        inside[0], began = 1, time.process_time()
        try:
            return original(*args, **kwargs)
        finally:
            inside[0] = 0
            spent["importing"] += time.process_time() - began
    return timed
builtins.__import__, importlib.import_module = counted(builtins.__import__), counted(importlib.import_module)
began_all = time.process_time()
import care_tui.start, care_tui.cli
from care_core.application import case as cases
import care_core.diagnose.judging as judging
import care_core.ecosystems.examine as examining
import care_tui.commands.diagnosing as diagnosing
names = {
    "reading": [(cases, "choose"), (cases, "_read"), (examining, "examine")],
    "judging": [(judging, "judge")],
    "diagnosing": [(cases, "_diagnose")],
    "printing": [(cases, "report_of"), (diagnosing, "remember_triage")],
}
stack = []
def clocked(step, function):
    def call(*args, **kwargs):
        began, imported = time.process_time(), spent["importing"]
        stack.append(0.0)
        try:
            return function(*args, **kwargs)
        finally:
            whole = time.process_time() - began - (spent["importing"] - imported)
            spent[step] = spent.get(step, 0.0) + whole - stack.pop()
            if stack:
                stack[-1] += whole
    return call
for step, found in names.items():
    for module, name in found:
        setattr(module, name, clocked(step, getattr(module, name)))
sys.argv, shown = ["care", "triage", sys.argv[1]], sys.stdout
sys.stdout = sys.stderr = open(os.devnull, "w")
try:
    care_tui.start.main()
except SystemExit:
    sys.stdout = shown
spent["the command"] = time.process_time() - began_all - sum(spent.values())
spent["Python's start"] = began_all
for step, seconds in spent.items():
    print(step, seconds)
"""


def cpu_s(code: str, *words: str, env: Mapping[str, str]) -> float:
    """Processor seconds of one Python process."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(
        [sys.executable, "-c", code, *words],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        check=False,
        env=env,
        cwd=env["PYTHONPATH"],
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def shares(log: Path, env: Mapping[str, str], runs: int) -> dict[str, float]:
    """Median seconds by step."""
    found: dict[str, list[float]] = {}
    for _ in range(runs):
        ended = subprocess.run(
            [sys.executable, "-c", STEPS, str(log)],
            stdout=subprocess.PIPE, text=True, check=True, env=env, cwd=env["PYTHONPATH"],
        )  # fmt: skip
        for line in ended.stdout.splitlines():
            step, _, seconds = line.rpartition(" ")
            found.setdefault(step, []).append(float(seconds))
    return {step: statistics.median(seconds) for step, seconds in found.items()}


def profile(log: Path, env: Mapping[str, str], out: Path) -> None:
    """What cProfile sees of one triage, the most expensive first."""
    with tempfile.TemporaryDirectory() as folder:
        raw = Path(folder) / "profile"
        code = f"import cProfile; cProfile.run({COMMAND!r}, {str(raw)!r})"
        words: Sequence[str] = (sys.executable, "-c", code, "triage", str(log))
        subprocess.run(
            words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False, env=env, cwd=env["PYTHONPATH"]
        )
        import pstats

        with out.open("w", encoding="utf-8") as stream:
            pstats.Stats(str(raw), stream=stream).strip_dirs().sort_stats("cumulative").print_stats(60)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("log", type=Path, nargs="?", default=SAMPLE)
    parser.add_argument("--runs", type=int, default=9)
    parser.add_argument("--profile", type=Path)
    parser.add_argument("--checkout", type=Path, default=ROOT)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as home:
        env = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
        env |= {"PYTHONPATH": str(args.checkout.resolve()), "OPENBLAS_NUM_THREADS": "1"}
        env |= {f"XDG_{kind}_HOME": home for kind in ("CACHE", "DATA", "CONFIG")}
        triage = (COMMAND, "triage", str(args.log.resolve()))
        cpu_s(*triage, env=env)  # compiles, and fills the cache of profiles
        pairs = [(cpu_s(*triage, env=env), cpu_s("import numpy", env=env)) for _ in range(args.runs)]
        whole, numpy_s = (statistics.median(column) for column in zip(*pairs, strict=True))
        ratio = statistics.median(ours / theirs for ours, theirs in pairs)
        print(f"{args.log.name}, {args.log.stat().st_size / 1e6:.1f} MB, load {os.getloadavg()[0]:.1f}")
        print(f"  care triage      {whole:.2f} s of processor")
        print(f"  import numpy     {numpy_s:.2f} s, {ratio:.1f} times as quick")
        for step, seconds in shares(args.log.resolve(), env, args.runs).items():
            print(f"    {step:16} {seconds:.3f} s  {seconds / whole:4.0%}")
        print(f"  {'kept  ' if whole <= MOST_CPU_S else 'MISSED'} {whole:.2f} s of processor, at most {MOST_CPU_S:g}")
        if args.profile is not None:
            profile(args.log.resolve(), env, args.profile)


if __name__ == "__main__":
    main()
