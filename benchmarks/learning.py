"""How long does learning take, and how much memory?

    python -m benchmarks.learning [--shared DIR] [--limit SECONDS] [--only PART]...

`published`: graph and 100 bootstrap resamples on the CURE Husky table (1000 runs, 42 variables), beside one call of
causal-learn's FCI with the published script's settings (Fisher's z, alpha = 0.8, the same constraints) on that table.
`options`: whole training on 622 options, 12 metrics, 3 objectives, 2000 runs. `runs`: on 10,000 runs of 60 variables.
`paths`: the ten best paths through a dense graph with 40 metrics.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import multiprocessing
import os
import threading
import time
from collections.abc import Callable, Iterator
from itertools import pairwise, permutations
from pathlib import Path

import numpy as np
import pandas as pd
from causallearn.graph.GraphNode import GraphNode
from causallearn.search.ConstraintBased.FCI import fci
from causallearn.utils.PCUtils.BackgroundKnowledge import BackgroundKnowledge
from threadpoolctl import threadpool_limits

from care_core.causal.graph import CausalGraph
from care_core.causal.paths import Ways
from care_core.files import bundled
from care_core.learn.bootstrap import support
from care_core.learn.constraints import ALWAYS
from care_core.learn.structure import learn_structure
from care_core.learn.table import read_table
from care_core.learn.train import TrainSettings, train
from care_core.profile.reading import read_schema
from care_core.profile.schema import Schema
from tests.simulated import simulate

PUBLISHED_ALPHA = 0.8
RESAMPLES = 100
BARS_S = {"options": 30.0, "runs": 120.0}
BAR_MB = 2048.0
JOBS = 2


def published(shared: Path, limit: float) -> None:
    schema = read_schema(bundled("profiles", "husky") / "profile.yaml")
    frame = read_table(shared / "data" / "care" / "cure_husky_1000.csv", schema)
    print(f"published: {len(frame)} runs x {frame.shape[1]} variables")
    with _measured(f"graph and {RESAMPLES} resamples on {JOBS} processes") as took, threadpool_limits(1):
        learn_structure(frame, schema, rng=np.random.default_rng(0))
        support(frame, schema, resamples=RESAMPLES, rng=np.random.default_rng(0), n_jobs=JOBS)
    peer = multiprocessing.get_context("spawn").Process(target=_published_fci, args=(frame, schema))
    started = time.monotonic()
    peer.start()
    peer.join(limit)
    peer_s = time.monotonic() - started
    stopped = peer.is_alive()
    if stopped:
        peer.terminate()
        peer.join()
    more = "more than " if stopped else ""
    print(f"  one call of causal-learn's FCI, alpha = {PUBLISHED_ALPHA}: {more}{peer_s:.1f} s"
          + (f" (stopped at --limit {limit:g})" if stopped else ""))  # fmt: skip
    print(f"  ratio: {more}{peer_s / took():.1f} times faster")


def _published_fci(frame: pd.DataFrame, schema: Schema) -> None:
    varying = frame.loc[:, frame.nunique() > 1].dropna()
    nodes = {str(name): GraphNode(str(name)) for name in varying}
    knowledge = BackgroundKnowledge()
    for a, b in permutations(nodes, 2):
        if (schema.variables[a].role, schema.variables[b].role) in ALWAYS:
            knowledge.add_forbidden_by_node(nodes[a], nodes[b])
    with contextlib.redirect_stdout(io.StringIO()), threadpool_limits(1):
        fci(
            varying.to_numpy(dtype=float), "fisherz", PUBLISHED_ALPHA, background_knowledge=knowledge,
            node_names=list(nodes), show_progress=False,
        )  # fmt: skip


def options(shared: Path, limit: float) -> None:
    _training("options", *simulate(2000, np.random.default_rng(0), options=40, inert=582, metrics=12, objectives=3)[:2])


def runs(shared: Path, limit: float) -> None:
    sizes = {"options": 25, "inert": 15, "metrics": 16, "contexts": 1, "objectives": 3}
    _training("runs", *simulate(10_000, np.random.default_rng(0), **sizes)[:2])


def _training(part: str, frame: pd.DataFrame, schema: Schema) -> None:
    resamples = TrainSettings().resamples
    print(f"{part}: {len(schema.options)} options, {len(schema.contexts)} contexts, {len(schema.metrics)} metrics, "
          f"{len(schema.objectives)} objectives x {len(frame)} runs")  # fmt: skip
    steps: list[tuple[str, float]] = []
    with _measured(f"whole training, {resamples} resamples, {JOBS} processes") as took:
        train(frame, schema, TrainSettings(n_jobs=JOBS), lambda step, _share: steps.append((step, time.monotonic())))
        steps.append(("", time.monotonic()))
    for (step, began), (_, ended) in pairwise(steps):
        print(f"    {step}: {ended - began:.1f} s")
    print(f"  bar {BARS_S[part]:.0f} s: {took() / BARS_S[part]:.2f} of it")


def paths(shared: Path, limit: float) -> None:
    rng = np.random.default_rng(0)
    metrics = [f"m{i:02d}" for i in range(40)]
    sources = [f"o{i}" for i in range(20)]
    later = [(a, b) for i, a in enumerate(metrics) for b in metrics[i + 1 :]]
    edges = [*((o, m) for o in sources for m in metrics), *later, *((m, "y") for m in metrics)]
    graph = CausalGraph((*sources, *metrics, "y"), frozenset(edges))
    weight = {edge: float(w) for edge, w in zip(sorted(edges), rng.uniform(0.05, 1.0, len(edges)), strict=True)}
    print(
        f"paths: {len(sources)} options, {len(metrics)} metrics, all {len(edges)} edges, {len(sources) << 40:.1e} paths"
    )
    with _measured("the ten best"):
        Ways(graph, weight).ranked("y", sources, 10)


@contextlib.contextmanager
def _measured(what: str) -> Iterator[Callable[[], float]]:
    """Prints wall and processor time and the largest resident memory of this process and those it started.

    On a machine that others use as well, wall time says little; processor time over `JOBS` bounds it from below.
    """
    peak, over = [0.0], threading.Event()
    busy: dict[int, float] = {}

    def watch() -> None:
        before: dict[int, float] | None = None
        while not over.wait(0.1):
            now = _family()
            before = before or {pid: cpu_s for pid, (_, cpu_s) in now.items()}
            peak[0] = max(peak[0], sum(mb for mb, _ in now.values()))
            busy.update({pid: cpu_s - before.get(pid, 0.0) for pid, (_, cpu_s) in now.items()})

    watcher = threading.Thread(target=watch)
    watcher.start()
    started = time.monotonic()
    took = 0.0
    try:
        yield lambda: took
    finally:
        took = time.monotonic() - started
        over.set()
        watcher.join()
    print(f"  {what}: {took:.2f} s, processors {sum(busy.values()):.1f} s, peak {peak[0]:.0f} MB (bar {BAR_MB:.0f})",
          flush=True)  # fmt: skip


def _family() -> dict[int, tuple[float, float]]:
    """Resident memory in MB and processor seconds of this process and its descendants (Linux)."""
    parents: dict[int, int] = {}
    used: dict[int, tuple[float, float]] = {}
    for folder in Path("/proc").iterdir():
        if folder.name.isdigit():
            with contextlib.suppress(OSError):  # a process may end while it is read
                pid = int(folder.name)
                stat = (folder / "stat").read_text().rpartition(")")[2].split()
                resident = int((folder / "statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20
                parents[pid] = int(stat[1])
                used[pid] = resident, (int(stat[11]) + int(stat[12])) / os.sysconf("SC_CLK_TCK")
    family = {os.getpid()}
    while grown := {pid for pid, parent in parents.items() if parent in family and pid in used} - family:
        family |= grown
    return {pid: used[pid] for pid in family}


PARTS = {part.__name__: part for part in (published, options, runs, paths)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--shared", type=Path, default=os.environ.get("CARE_SHARED"), help="folder that holds data/")
    parser.add_argument("--limit", type=float, default=600.0, help="seconds after which causal-learn is stopped")
    parser.add_argument("--only", action="append", choices=sorted(PARTS), help="default: all")
    args = parser.parse_args()
    if args.shared is None and "published" in (args.only or PARTS):
        parser.error("give --shared DIR or set CARE_SHARED")
    for name in args.only or PARTS:
        PARTS[name](args.shared, args.limit)


if __name__ == "__main__":
    main()
