"""A fleet of 1,000 logs on one and on two workers: throughput beside triage in a plain loop, memory as it goes on.

    python -m benchmarks.fleet [--logs 1000] [--workers 1 2] [--tasks 5000]

The logs are made in a temporary folder (0.4 GB): the bundled DataFlash logs, each with another robot's name and another
value of one parameter written over the recorded one, so that no two are the same. The loop triages a hundred of them.
The peak of a worker is its largest resident memory so far (`ru_maxrss`) after a tenth, half and all of the logs; what
the process takes that hands out the work and keeps the rows stands beside it.

What a million logs cost is computed from what is measured here: seconds of processor a log, bytes of a row, what
handing out an item takes, and what a task would take in a scheduler that is given all of them at once.
"""

from __future__ import annotations

import argparse
import pickle
import resource
import struct
import tempfile
import time
import tracemalloc
from collections.abc import Iterator, Sequence
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any

from care_core.application.case import Request
from care_core.application.fleet import triage_one
from care_core.files import bundled
from care_core.fleet.cluster import connected, each
from care_core.fleet.fleet_report import together
from care_core.fleet.rows import Row
from care_core.fleet.sources import Source, gather
from care_core.parallel import Failed

MILLION = 1_000_000
FLAT, WORTH = 1.15, 0.8
"""The bars: growth of a worker's peak from a tenth of the logs to all, and throughput of one worker beside the loop."""

ROBOTS = 50
_MACHINE = b"d1219c7c4c5404aaa1f6d2a48adfda4"
"""The id of the machine that flew the samples, as their logs say it."""
_NAME_BYTES = 16
ORIGINALS = (
    (bundled("samples", "arducopter_failed.BIN"), b"LAND_SPEED", (16.0, 60.0)),
    (bundled("samples", "arducopter_motor.BIN"), b"LAND_SPEED", (40.0, 60.0)),
    (bundled("samples", "ardurover_failed.BIN"), b"ATC_ACCEL_MAX", (0.3, 1.5)),
    (Path(__file__).parents[1] / "tests" / "data" / "arducopter_good.BIN", b"LAND_SPEED", (40.0, 60.0)),
)
"""Logs, and the parameter that is varied within what may be flown."""


def make_logs(folder: Path, count: int) -> None:
    """So many logs of 50 robots, no two alike."""
    for number in range(count):
        source, parameter, (low, high) = ORIGINALS[number % len(ORIGINALS)]
        raw = source.read_bytes().replace(_MACHINE, f"{number % ROBOTS:08x}".ljust(len(_MACHINE), "0").encode())
        value = low + (high - low) * number / count
        at = raw.find(parameter.ljust(_NAME_BYTES, b"\0"))
        if at < 0:
            raise SystemExit(f"{source} records no {parameter.decode()}")
        written = bytearray(raw)
        while at >= 0:
            struct.pack_into("<f", written, at + _NAME_BYTES, value)
            at = raw.find(parameter.ljust(_NAME_BYTES, b"\0"), at + 1)
        (folder / f"{number:04}_{source.name}").write_bytes(written)


def in_a_loop(sources: Sequence[Source]) -> tuple[float, float]:
    """Logs a second, and seconds of processor a log, of plain triage in this process."""
    triage_one(sources[0], Request(Path()))  # what is read once is read
    began, cpu = time.perf_counter(), time.process_time()
    for source in sources:
        triage_one(source, Request(Path()))
    return len(sources) / (time.perf_counter() - began), (time.process_time() - cpu) / len(sources)


def on_workers(sources: Sequence[Source], workers: int) -> tuple[float, list[tuple[int, float, float]], list[Row]]:
    """Logs a second, (logs, peak of a worker in MB, this process in MB) now and then, and the rows."""
    rows: list[Row] = []
    peaks = []
    stops = {max(1, round(len(sources) * share)) for share in (0.1, 0.5, 1.0)}
    with connected(workers=workers) as client:
        list(each(client, triage_one_of, [sources[0]] * workers, limit_s=600.0))
        began = time.perf_counter()
        with closing(each(client, triage_one_of, sources, limit_s=600.0)) as answers:
            for _, row in answers:
                if isinstance(row, Failed):
                    raise SystemExit(row.reason)
                rows.append(row)
                if len(rows) in stops:
                    peaks.append((len(rows), max(client.run(peak_mb).values()), resident_mb()))
        return len(sources) / (time.perf_counter() - began), peaks, rows


def triage_one_of(source: Source) -> Row:
    return triage_one(source, Request(Path()))


def peak_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3


def resident_mb() -> float:
    for line in Path("/proc/self/status").read_text(encoding="ascii").splitlines():
        if line.startswith("VmRSS:"):
            return int(line.split()[1]) / 1e3
    return 0.0


def nothing(number: int) -> int:
    return number


def handing_out(tasks: int) -> tuple[float, float]:
    """Seconds of processor that an item of no work takes of client and scheduler, which are this process; and bytes
    that a task takes in it where all are given to the scheduler at once."""
    with connected(workers=1) as client:
        list(each(client, nothing, range(100), limit_s=600.0))
        began = time.process_time()
        list(each(client, nothing, range(tasks // 10), limit_s=600.0))
        cpu_s = (time.process_time() - began) / (tasks // 10)
        before = resident_mb()
        futures = client.map(partial(slow, 3600.0), range(tasks), pure=False)
        while client.run_on_scheduler(known_tasks) < tasks:
            time.sleep(0.1)
        bytes_a_task = (resident_mb() - before) * 1e6 / tasks
        client.cancel(futures, force=True)
        return cpu_s, bytes_a_task


def slow(seconds: float, number: int) -> int:
    time.sleep(seconds)
    return number


def known_tasks(dask_scheduler: Any = None) -> int:
    return len(dask_scheduler.tasks)


def row_bytes(rows: Sequence[Row]) -> tuple[float, float]:
    """Of a row: bytes on the way, and in the memory of the process that keeps it."""
    sent = [pickle.dumps(row) for row in rows]
    tracemalloc.start()
    kept = [pickle.loads(one) for one in sent]
    held, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return sum(map(len, sent)) / len(sent), held / len(kept)


def report(logs: int, workers: Sequence[int], tasks: int) -> Iterator[str]:
    with tempfile.TemporaryDirectory(prefix="care-bench-") as name:
        make_logs(Path(name), logs)
        sources = gather([name])
        loop, cpu_s = in_a_loop(sources[:: max(1, len(sources) // 100)])
        yield f"{logs} logs of {ROBOTS} robots"
        yield f"plain loop: {loop:.2f} logs a second, {cpu_s:.2f} s of processor a log"
        rows: list[Row] = []
        for count in workers:
            rate, peaks, rows = on_workers(sources, count)
            yield f"{count} worker{'s' if count > 1 else ''}: {rate:.2f} logs a second, {rate / loop:.2f} of the loop"
            yield from (f"  after {done:>5} logs: worker {peak:.0f} MB, rows {own:.0f} MB" for done, peak, own in peaks)
            growth = peaks[-1][1] / peaks[0][1]
            yield f"  {_bar(growth <= FLAT)} the peak grows to {growth:.2f} of what it was, at most {FLAT}"
            if count == 1:
                yield f"  {_bar(rate >= WORTH * loop)} {rate / loop:.2f} of the loop, at least {WORTH}"
    together(rows)  # what is read and worked out once, is
    began = time.process_time()
    found = together(rows)
    shared_s = (time.process_time() - began) / len(rows)
    sent, held = row_bytes(rows)
    yield f"looking at {len(rows)} rows together: {shared_s * 1e3:.1f} ms a row; {len(found.shared)} things shared"
    yield f"a row: {sent:.0f} bytes sent, {held:.0f} kept"
    handed_s, task = handing_out(tasks)
    yield f"handing out: {handed_s * 1e3:.1f} ms of processor a log"
    yield f"a task given ahead: {task:.0f} bytes of the scheduler"
    yield "a million logs, computed:"
    yield f"  processor {MILLION * cpu_s / 3600:.0f} h on workers, {MILLION * handed_s / 3600:.1f} h here"
    yield f"  workers that can be kept busy from here: {cpu_s / handed_s:.0f}"
    yield f"  rows {MILLION * held / 1e9:.1f} GB here, {MILLION * sent / 1e9:.1f} GB sent"
    yield f"  tasks, if given all at once, {MILLION * task / 1e9:.1f} GB of the scheduler"
    yield f"  looking at them together {MILLION * shared_s / 3600:.1f} h"


def _bar(is_kept: bool) -> str:
    return "kept  " if is_kept else "MISSED"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--logs", type=int, default=1000)
    parser.add_argument("--workers", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--tasks", type=int, default=5000, help="How many show what a task takes in the scheduler.")
    given = parser.parse_args()
    for line in report(given.logs, given.workers, given.tasks):
        print(line, flush=True)


if __name__ == "__main__":
    main()
