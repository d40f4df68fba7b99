"""What our own code is worth where a library does the same: the rule is three times as fast, or what the library loses.

    python -m benchmarks.own_code [--runs 3] [--damaged 40] [--only speed,damage,processes,triage]

*speed*: opening a log and decoding what the fitting profile reads of it, by our reader and by the library, seconds of
the processor in cold processes without starting Python and importing. The logs are those of `benchmarks.ingest` (a
450 MB bag and MCAP, DataFlash of 100 MB), a telemetry log of the bundled flight, repeated, and a PX4 log of
`benchmarks.px4_logs`, of which the checks' messages are read and pyulog reads all.
*damage*: logs cut anywhere or with some bits turned; the share of their messages that each finds.
*processes*: many items, one of which ends the process that works on it; how many are answered.
*triage*: the small triage without a thing that is there for its speed.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import multiprocessing
import os
import signal
import sqlite3
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.ingest import CASES, DECODE_BAG, DECODE_BIN, DECODE_MCAP, INSTALLED, SAMPLE, SELECT
from benchmarks.px4_logs import OURS, THEIRS, write_flight
from benchmarks.small_triage import COMMAND, cpu_s
from care_core.application.case import choose
from care_core.errors import CareError
from care_core.extract.read import reading_plan
from care_core.logs.opening import open_log
from care_core.parallel import Failed, each
from care_core.records import Record
from tests import nav2_drive, restamped
from tests.groundstation import write_tlog

DATA = Path(__file__).parents[1] / "tests" / "data"
FLIGHT, DRIVE = DATA / "arducopter_good.BIN", DATA / "move_base_good.bag"
REPEATS = 20
TURNED_BITS = 20
ULOG_BYTES, LARGE_ULOG_BYTES = 1_000_000, 48_000_000
ITEMS, DEADLY = 20, 3
DECODE_TLOG = """
import sys, time
from pymavlink import mavutil
started = time.perf_counter()
log = mavutil.mavlink_connection(sys.argv[1])
while (log.recv_match(type=sys.argv[2:]) if sys.argv[2:] else log.recv_msg()) is not None:
    pass
print(time.perf_counter() - started)
"""

WITHOUT = {
    "as it is": "",
    "without posteriors kept": """
from care_core.causal.posteriors import PosteriorCache
PosteriorCache.at = lambda self, mechanism, x: mechanism.posterior(x)
""",
    "without answers kept": """
import numpy
from care_core.causal.counterfactual import CounterfactualQuery
CounterfactualQuery._once = lambda self, key, mechanism, x, ask: numpy.array(ask(x))
""",
    "without either": """
import numpy
from care_core.causal.counterfactual import CounterfactualQuery
from care_core.causal.posteriors import PosteriorCache
PosteriorCache.at = lambda self, mechanism, x: mechanism.posterior(x)
CounterfactualQuery._once = lambda self, key, mechanism, x, ask: numpy.array(ask(x))
""",
    "looking for cycles at its end": "import gc\ngc.freeze = lambda: None\n",
}


# --- speed


def repeated_tlog(path: Path) -> None:
    """The flight as a ground station heard it, so often one after the other as makes some megabytes."""
    write_tlog(path, FLIGHT, np.random.default_rng(0))
    path.write_bytes(path.read_bytes() * REPEATS)


def seconds_of(program: str, *words: str) -> float:
    """What a program says that its work took. Its clock is that of the processor."""
    program = program.replace("perf_counter", "process_time")
    ended = subprocess.run(
        [sys.executable, "-c", program, *words], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=INSTALLED,
        check=True,
    )  # fmt: skip
    return float(ended.stdout.split()[-1])


def speed(runs: int) -> None:
    programs = {"pymavlink": DECODE_BIN, "rosbags": DECODE_BAG, "mcap and rosbags": DECODE_MCAP}
    cases = [(case.name, case.make, case.decoder, programs[case.decoder]) for case in CASES]
    for name, make, library, program in [*cases, ("flight.tlog", repeated_tlog, "pymavlink", DECODE_TLOG)]:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / name
            make(path)
            profile, _ = choose(open_log(path))
            channels = [] if profile is None else list(reading_plan(profile.schema))
            pairs = [
                (seconds_of(SELECT, str(path)), seconds_of(program, str(path), *channels)) for _ in range(runs + 1)
            ][1:]
            ours, theirs = (statistics.median(column) for column in zip(*pairs, strict=True))
            size = path.stat().st_size / 1e6
            print(f"  {name:12s} {size:6.1f} MB: {ours:.2f} s, {library} {theirs:.2f} s: {theirs / ours:.1f} x")
    with tempfile.TemporaryDirectory() as folder:
        path = write_flight(Path(folder) / "flight.ulg", LARGE_ULOG_BYTES)
        pairs = [(seconds_of(OURS, "", str(path)), seconds_of(THEIRS, "", str(path))) for _ in range(runs + 1)][1:]
        ours, theirs = (statistics.median(column) for column in zip(*pairs, strict=True))
        size = path.stat().st_size / 1e6
        print(f"  {path.name:12s} {size:6.1f} MB: {ours:.2f} s, pyulog {theirs:.2f} s: {theirs / ours:.1f} x")


# --- damage


class Format(Record):
    """A sound log, and how many messages a library counts in a file."""

    name: str
    make: Callable[[Path], bytes]
    peer: str
    count: Callable[[Path], Iterator[Any]]


def by_dfreader(path: Path) -> Iterator[Any]:
    from pymavlink import DFReader

    log = DFReader.DFReader_binary(str(path))
    yield from iter(log.recv_msg, None)


def by_mavutil(path: Path) -> Iterator[Any]:
    from pymavlink import mavutil

    log = mavutil.mavlink_connection(str(path), robust_parsing=True)
    yield from (message for message in iter(log.recv_msg, None) if message.get_type() != "BAD_DATA")


def by_rosbags(path: Path) -> Iterator[Any]:
    from rosbags.rosbag1 import Reader

    with Reader(path) as bag:
        yield from bag.messages()


def by_mcap(path: Path) -> Iterator[Any]:
    """By the reader that needs no index: it goes through the file, as far as it gets."""
    from mcap.reader import NonSeekingReader

    with path.open("rb") as stream:
        yield from NonSeekingReader(stream).iter_messages(log_time_order=False)


def by_sqlite(path: Path) -> Iterator[Any]:
    with contextlib.closing(sqlite3.connect(f"file:{path}?mode=ro&immutable=1", uri=True)) as base:
        yield from base.execute("select topic_id, timestamp, data from messages")


def by_pyulog(path: Path) -> Iterator[Any]:
    """All messages at once: it gives all that it found, or none."""
    from pyulog import ULog

    ulog = ULog(str(path))
    yield from (stamp for topic in ulog.data_list for stamp in topic.data["timestamp"])
    yield from ulog.logged_messages


def ulog_bytes(folder: Path) -> bytes:
    return write_flight(folder / "sound.ulg", ULOG_BYTES).read_bytes()


def tlog_bytes(folder: Path) -> bytes:
    return write_tlog(folder / "sound.tlog", FLIGHT, np.random.default_rng(0)).read_bytes()


def db3_bytes(folder: Path) -> bytes:
    from rosbags.rosbag2 import StoragePlugin

    nav2_drive.recorded(folder / "drive", StoragePlugin.SQLITE3)
    return Path(next((folder / "drive").glob("*.db3"))).read_bytes()


FORMATS = (
    Format("flight.BIN", lambda _: FLIGHT.read_bytes(), "pymavlink", by_dfreader),
    Format("flight.tlog", tlog_bytes, "pymavlink", by_mavutil),
    Format("flight.ulg", ulog_bytes, "pyulog", by_pyulog),
    Format("drive.bag", lambda _: DRIVE.read_bytes(), "rosbags", by_rosbags),
    Format("drive.mcap", lambda _: restamped.mcap(DRIVE, lambda time_ns: time_ns), "mcap", by_mcap),
    Format("drive.db3", db3_bytes, "sqlite3", by_sqlite),
)


def found_by_library(form: Format, path: Path) -> int:
    """How many messages come before the library gives up, whatever it raises."""
    count = 0
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said), contextlib.suppress(Exception):
        for _ in form.count(path):
            count += 1
    return count


def found_by_us(path: Path) -> int:
    try:
        return sum(channel.count for channel in open_log(path).channels())
    except CareError:
        return 0


def damaged(sound: bytes, number: int, rng: np.random.Generator) -> bytes:
    """Cut anywhere, or every other time with some bits turned."""
    if number % 2:
        return sound[: int(rng.integers(len(sound) // 20, len(sound)))]
    raw: NDArray[np.uint8] = np.frombuffer(sound, np.uint8).copy()
    raw[rng.integers(0, len(raw), TURNED_BITS)] ^= np.uint8(1) << rng.integers(0, 8, TURNED_BITS, dtype=np.uint8)
    return raw.tobytes()


def damage(copies: int) -> None:
    for form in FORMATS:
        rng = np.random.default_rng(0)
        with tempfile.TemporaryDirectory() as folder:
            sound, path = form.make(Path(folder)), Path(folder) / form.name
            path.write_bytes(sound)
            whole = found_by_us(path)
            ours, theirs, more, less = [], [], 0, 0
            for number in range(copies):
                path.write_bytes(damaged(sound, number, rng))
                ours.append(found_by_us(path))
                theirs.append(found_by_library(form, path))
                more += ours[-1] > theirs[-1]
                less += ours[-1] < theirs[-1]
        cut, turned = (
            f"{np.mean(ours[of::2]) / whole:4.0%} and {np.mean(theirs[of::2]) / whole:4.0%}" for of in (1, 0)
        )
        print(
            f"  {form.name:12s} of {whole} messages we and {form.peer} find {cut} cut, {turned} with bits turned; "
            f"more in {more} of {copies}, fewer in {less}"
        )


# --- processes


def work(item: int) -> int:
    """What a log may do to the process that reads it."""
    if item == DEADLY:
        os.kill(os.getpid(), signal.SIGKILL)
    return item


def processes() -> None:
    """How many of so many items are answered where one ends its process."""
    items = range(ITEMS)
    ours = sum(not isinstance(answer, Failed) for _, answer in each(work, items, workers=2))
    with ProcessPoolExecutor(2, multiprocessing.get_context("spawn")) as pool:
        theirs = sum(future.exception() is None for future in [pool.submit(work, item) for item in items])
    print(f"  of {ITEMS} items, one of which ends its process, we answer {ours}, concurrent.futures {theirs}")


# --- triage


def triage(runs: int) -> None:
    with tempfile.TemporaryDirectory() as home:
        env = {**INSTALLED, "PYTHONPATH": str(Path(__file__).parents[1]), "OPENBLAS_NUM_THREADS": "1"}
        env |= {f"XDG_{kind}_HOME": home for kind in ("CACHE", "DATA", "CONFIG")}
        words = ("triage", str(SAMPLE))
        cpu_s(COMMAND, *words, env=env)
        rounds = [[cpu_s(code + COMMAND, *words, env=env) for code in WITHOUT.values()] for _ in range(runs)]
    for place, name in enumerate(WITHOUT):
        ratio = statistics.median(one[place] / one[0] for one in rounds)
        print(f"  {name:30s} {statistics.median(one[place] for one in rounds):.2f} s, {ratio:.2f} x")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--damaged", type=int, default=40)
    parser.add_argument("--only", default="speed,damage,processes,triage")
    args = parser.parse_args()
    print(f"load {os.getloadavg()[0]:.1f}")
    parts: dict[str, Callable[[], None]] = {
        "speed": lambda: speed(args.runs), "damage": lambda: damage(args.damaged),
        "processes": processes, "triage": lambda: triage(5 * args.runs),
    }  # fmt: skip
    for name, part in parts.items():
        if name in args.only.split(","):
            print(name)
            part()


if __name__ == "__main__":
    main()
