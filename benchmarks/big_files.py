"""What `care triage` costs on files of gigabytes: seconds, memory, and the share of the bytes that is read.

    python -m benchmarks.big_files [--gb 5] [--runs 3] [--only bag,mcap,lz4,cut] [--folder DIR]

Made one after the other in a temporary folder, and deleted: ROS 1 bags and MCAP files (chunks not packed, lz4, zstd) of
a mission of move_base among two cameras (raw pictures), a lidar (point clouds), IMU, joints and transforms; a ROS 2
db3 of the same sensors; a DataFlash log. Bags, MCAP files and the db3 also without the index at their end, or cut.

`read` counts the bytes that the process asks the system for (`rchar` of /proc), less those of a triage of the small
sample, which are Python's own. Of packed chunks as much may be read as lies in chunks that hold something wanted: all,
where each holds a little of everything, since nobody unpacks the middle of a chunk. The peer reads the index and every
message of the topics that triage reads, with rosbags or mcap, and decodes none; of a file without its index the peer is
`cat`, once of a file in the cache and once from the disk. `stopped` is how long a triage takes to end after Ctrl+C in
the middle of its work. Every process is cold, the file in the cache where it fits and nothing else is said.
"""

from __future__ import annotations

import argparse
import heapq
import os
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Collection, Iterator, Sequence
from itertools import repeat
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks.ingest import (
    INSTALLED,
    MB,
    SAMPLE,
    SECOND_NS,
    STOOD_S,
    TRIAGE,
    Topic,
    make_bin,
    mission_messages,
    repeated,
    ros_types,
    sensor_messages,
)
from care_core.records import Record

CHUNK_BYTES = 768 * 1024
CAMERA_HZ, LIDAR_HZ = 5, 10
LIDAR_BYTES = 400_000
SPAN_S = 380
"""The mission of the bag with the time that the robot stood before it."""

PEER_BAG = """
import sys
from rosbags.rosbag1 import Reader
with Reader(sys.argv[1]) as bag:
    for _ in bag.messages([one for one in bag.connections if one.topic in sys.argv[2:]]):
        pass
"""
PEER_MCAP = """
import sys
from mcap.reader import make_reader
with open(sys.argv[1], "rb") as stream:
    for _ in make_reader(stream).iter_messages(topics=sys.argv[2:]):
        pass
"""
PEER_DB3 = """
import sqlite3, sys
with sqlite3.connect(f"file:{sys.argv[1]}?mode=ro&immutable=1", uri=True) as bag:
    bag.execute("select count(*), max(timestamp) from messages").fetchall()
    names = ",".join("?" * len(sys.argv[2:]))
    wanted = f"select data from messages where topic_id in (select id from topics where name in ({names}))"
    for _ in bag.execute(wanted, sys.argv[2:]):
        pass
"""
PEER_BIN = "import sys; import numpy; numpy.bincount(numpy.fromfile(sys.argv[1], dtype=numpy.uint8))"

MOST_MB, MOST_SHARE, MOST_RATIO, MOST_STOP_S = 300, 0.05, 2.0, 0.2


class Cost(NamedTuple):
    """Wall and processor seconds of a process, the peak of its anonymous memory, and the MB that it read."""

    seconds: float
    cpu_s: float
    anonymous_mb: float
    read_mb: float


class Case(Record):
    """A file to make, with the peer; `is_indexed`: at most a share of it is to be read."""

    name: str
    make: Callable[[Path, float], None]
    peer: Sequence[str]
    is_indexed: bool = True


def run_once(command: Sequence[str], forgotten: Path | None = None) -> Cost:
    """What one run of a command costs, with a file that the system's cache was told to forget. Raises where it ends
    otherwise than a triage may."""
    if forgotten is not None:
        with forgotten.open("rb") as stream:
            os.fsync(stream.fileno())
            os.posix_fadvise(stream.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)
    started, before = time.perf_counter(), os.times()
    peak_kb = read = 0
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=INSTALLED) as process:
        proc = Path(f"/proc/{process.pid}")
        while process.poll() is None:
            try:
                lines = (proc / "status").read_text().splitlines()
                peak_kb = max([peak_kb, *(int(line.split()[1]) for line in lines if line.startswith("RssAnon"))])
                read = max(read, int((proc / "io").read_text().split()[1]))
            except (OSError, IndexError):
                break
            time.sleep(0.005)
        process.wait()
    seconds = time.perf_counter() - started
    if process.returncode not in (0, 1, 3):
        raise SystemExit(f"ended with {process.returncode}: {' '.join(command)[:200]}")
    after = os.times()
    cpu_s = after.children_user + after.children_system - before.children_user - before.children_system
    return Cost(seconds, cpu_s, peak_kb * 1024 / MB, read / MB)


def median_of(command: Sequence[str], runs: int, forgotten: Path | None = None) -> Cost:
    """The medians of so many runs after a first one."""
    costs = [run_once(command, forgotten) for _ in range(runs + 1)][1:]
    return Cost(*map(statistics.median, zip(*costs, strict=True)))


def stop_s(path: Path, after_s: float) -> float:
    """Seconds from Ctrl+C to the end of a triage that has worked for so long."""
    with subprocess.Popen(
        [*TRIAGE, str(path)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=INSTALLED
    ) as process:
        time.sleep(after_s)
        began = time.perf_counter()
        process.send_signal(signal.SIGINT)
        process.wait()
        return time.perf_counter() - began


# Files


def big_messages(gb: float) -> Iterator[tuple[int, Topic, bytes]]:
    """(time in ns, topic, serialised message) in time order: a mission among sensors that make up so many GB."""
    store = ros_types()
    mission, begin, end = mission_messages(STOOD_S)
    streams = [mission]
    for name, message, rate in [*sensor_messages(store.types)[2:5], *large_messages(store.types, gb)]:
        kind = message.__msgtype__
        topic = Topic(name, kind, *store.generate_msgdef(kind))
        raw = bytes(store.serialize_ros1(message, kind))
        streams.append(repeated(topic, raw, range(begin, end, SECOND_NS // rate)))
    return heapq.merge(*streams, key=lambda part: part[0])


def large_messages(make: Any, gb: float) -> list[tuple[str, Any, int]]:
    """(topic, message, messages a second) of two cameras and a lidar; they pack to about half."""
    import numpy as np

    rng = np.random.default_rng(0)
    header = make["std_msgs/msg/Header"](0, make["builtin_interfaces/msg/Time"](0, 0), "camera")
    each = int((gb * 1e9 / SPAN_S - LIDAR_HZ * LIDAR_BYTES) / (2 * CAMERA_HZ))
    pixels = np.repeat(rng.integers(0, 256, max(1, each // 2), dtype=np.uint8), 2)
    picture = make["sensor_msgs/msg/Image"](header, 1, len(pixels), "mono8", 0, len(pixels), pixels)
    points = np.repeat(rng.integers(0, 256, LIDAR_BYTES // 2, dtype=np.uint8), 2)
    cloud = make["sensor_msgs/msg/PointCloud2"](header, 1, len(points) // 16, [], False, 16, len(points), points, True)
    return [
        ("/camera/left/image_raw", picture, CAMERA_HZ),
        ("/camera/right/image_raw", picture, CAMERA_HZ),
        ("/lidar/points", cloud, LIDAR_HZ),
    ]


def make_bag(packed: str) -> Callable[[Path, float], None]:
    def make(path: Path, gb: float) -> None:
        from rosbags.rosbag1 import Writer

        connections: dict[str, Any] = {}
        writer = Writer(path)
        writer.chunk_threshold = CHUNK_BYTES
        if packed != "none":
            writer.set_compression(Writer.CompressionFormat[packed.upper()])
        with writer:
            for time_ns, topic, raw in big_messages(gb):
                if topic.name not in connections:
                    connections[topic.name] = writer.add_connection(
                        topic.name, topic.type, msgdef=topic.definition, md5sum=topic.digest
                    )
                writer.write(connections[topic.name], time_ns, raw)

    return make


def make_mcap(packed: str) -> Callable[[Path, float], None]:
    def make(path: Path, gb: float) -> None:
        from mcap.writer import CompressionType, Writer

        channels: dict[str, int] = {}
        with path.open("wb") as stream:
            writer = Writer(stream, chunk_size=CHUNK_BYTES, compression=CompressionType[packed.upper()])
            writer.start(profile="ros1", library="care benchmark")
            for time_ns, topic, raw in big_messages(gb):
                if topic.name not in channels:
                    kind = topic.type.replace("/msg/", "/")
                    schema = writer.register_schema(kind, "ros1msg", topic.definition.encode())
                    channels[topic.name] = writer.register_channel(topic.name, "ros1", schema)
                writer.add_message(channels[topic.name], time_ns, raw, time_ns)
            writer.finish()  # type: ignore[no-untyped-call]

    return make


def make_db3(path: Path, gb: float) -> None:
    """The sensors alone, as ROS 2 writes them: move_base has no messages there."""
    import sqlite3

    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    make = store.types
    stamp = make["builtin_interfaces/msg/Time"](0, 0)
    header = make["std_msgs/msg/Header"](stamp, "camera")
    kinds = {"Header": lambda _seq, _stamp, _frame: header}
    types = {name: kinds.get(name.rpartition("/")[2], made) for name, made in make.items()}
    with sqlite3.connect(path) as bag:
        bag.executescript(
            "create table topics(id integer primary key, name text not null, type text not null,"
            " serialization_format text not null, offered_qos_profiles text not null);"
            "create table messages(id integer primary key, topic_id integer not null, timestamp integer not null,"
            " data blob not null); create index timestamp_idx on messages (timestamp asc);"
        )
        streams = []
        for number, (name, message, rate) in enumerate([*sensor_messages(types)[2:4], *large_messages(types, gb)], 1):
            bag.execute("insert into topics values (?, ?, ?, 'cdr', '')", (number, name, message.__msgtype__))
            raw = bytes(store.serialize_cdr(message, message.__msgtype__))
            times = range(SECOND_NS, SPAN_S * SECOND_NS, SECOND_NS // rate)
            streams.append(zip(times, repeat(number), repeat(raw)))
        rows = ((number, time_ns, raw) for time_ns, number, raw in heapq.merge(*streams, key=lambda part: part[0]))
        bag.executemany("insert into messages (topic_id, timestamp, data) values (?, ?, ?)", rows)


def cut(make: Callable[[Path, float], None], share: float) -> Callable[[Path, float], None]:
    """The same file without what lies behind this share of it."""

    def made(path: Path, gb: float) -> None:
        make(path, gb)
        os.truncate(path, int(path.stat().st_size * share))

    return made


def make_log(path: Path, gb: float) -> None:
    make_bin(int(gb * 1e9))(path)


PYTHON = (sys.executable, "-c")
BAG, MCAP, DB3, BIN = ((*PYTHON, peer) for peer in (PEER_BAG, PEER_MCAP, PEER_DB3, PEER_BIN))
CASES = (
    Case("none.bag", make_bag("none"), BAG),
    Case("lz4.bag", make_bag("lz4"), BAG),
    Case("none.mcap", make_mcap("none"), MCAP),
    Case("lz4.mcap", make_mcap("lz4"), MCAP),
    Case("zstd.mcap", make_mcap("zstd"), MCAP),
    Case("two.db3", make_db3, DB3),
    Case("one.BIN", make_log, BIN, is_indexed=False),
    Case("noindex_none.bag", cut(make_bag("none"), 0.9995), ("cat",), is_indexed=False),
    Case("cut_lz4.bag", cut(make_bag("lz4"), 0.5), ("cat",), is_indexed=False),
    Case("cut_none.mcap", cut(make_mcap("none"), 0.5), ("cat",), is_indexed=False),
    Case("cut_zstd.mcap", cut(make_mcap("zstd"), 0.5), ("cat",), is_indexed=False),
    Case("cut_two.db3", cut(make_db3, 0.5), ("cat",), is_indexed=False),
)
SHARE_OF_5_GB = {"two.db3": 0.4, "cut_two.db3": 0.4, "one.BIN": 0.2}
"""Of the size that is asked for."""


def topics_of(path: Path) -> list[str]:
    """The topics that a triage reads of a log."""
    import care_core
    from care_core.logs import ros_log
    from care_core.logs.base import Wanted

    found: dict[str, None] = {}
    original = ros_log.RosLog.read

    def read(self: Any, wanted: Wanted, *args: Any) -> Any:
        found.update(dict.fromkeys(wanted))
        return original(self, wanted, *args)

    ros_log.RosLog.read = read  # type: ignore[method-assign,assignment]
    try:
        care_core.triage(path)
    finally:
        ros_log.RosLog.read = original  # type: ignore[method-assign]
    return list(found)


def packed_share(path: Path, topics: Collection[str]) -> float:
    """Share of an indexed file's bytes in packed chunks that hold a message of these topics: nobody unpacks the middle
    of a chunk, so what leads to the last of them has to be read. 0 where chunks are not packed."""
    if path.suffix == ".bag":
        from rosbags.rosbag1 import Reader

        with Reader(path) as bag:
            numbers = {one.id for one in bag.connections if one.topic in topics}
            held = [one.pos for one in bag.chunk_infos if numbers & one.connection_counts.keys()]
            return sum(bag.chunks[pos].datasize for pos in held) / path.stat().st_size
    from mcap.reader import make_reader

    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
        assert summary is not None
        wanted = {number for number, channel in summary.channels.items() if channel.topic in topics}
        chunks = [one for one in summary.chunk_indexes if wanted & one.message_index_offsets.keys()]
        return sum(one.compressed_size for one in chunks) / path.stat().st_size


def report(case: Case, path: Path, runs: int, start: Cost) -> None:
    """The table of one file, and which bars it keeps."""
    topics = topics_of(path) if path.suffix in (".bag", ".mcap", ".db3") and case.peer[0] != "cat" else []
    triage = median_of([*TRIAGE, str(path)], runs)
    peer = median_of([*case.peer, str(path), *topics], runs)
    size_mb = path.stat().st_size / MB
    share = max(0.0, triage.read_mb - start.read_mb) / size_mb
    stopped = statistics.median(stop_s(path, triage.seconds * part) for part in (0.3, 0.5, 0.7))
    ratio = triage.seconds / peer.seconds
    print(f"{case.name}, {size_mb:.0f} MB")
    for name, cost in {"care triage": triage, "peer": peer}.items():
        print(
            f"  {name:12s} {cost.seconds:7.2f} s {cost.cpu_s:7.2f} s cpu {cost.anonymous_mb:6.0f} MB memory"
            f" {cost.read_mb:8.1f} MB read"
        )
    beyond_s = max(0.0, triage.seconds - start.seconds)
    print(f"  {beyond_s:.2f} s longer than the small sample: {beyond_s / peer.seconds:.2f} times the peer")
    bars = [
        (f"{triage.anonymous_mb:.0f} MB of memory, at most {MOST_MB}", triage.anonymous_mb <= MOST_MB),
        (f"{ratio:.2f} times the peer's seconds, at most {MOST_RATIO:g}", ratio <= MOST_RATIO),
        (f"stopped in {stopped:.2f} s, at most {MOST_STOP_S:g}", stopped <= MOST_STOP_S),
    ]
    if case.is_indexed:
        is_packed = any(packing in case.name for packing in ("lz4", "zstd"))
        most = max(MOST_SHARE, packed_share(path, topics) if is_packed else 0.0)
        why = " (the packed chunks that hold what is wanted)" if most > MOST_SHARE else ""
        bars.append((f"{share:.2%} of its bytes read, at most {most:.0%}{why}", share <= most))
    if case.peer[0] == "cat":
        cold, read = (median_of([*words, str(path)], runs, forgotten=path) for words in (TRIAGE, case.peer))
        print(f"  from the disk: {cold.seconds:.2f} s, the peer {read.seconds:.2f} s")
        slower = cold.seconds / read.seconds
        bars.append(
            (f"{slower:.2f} times the peer's seconds from the disk, at most {MOST_RATIO:g}", slower <= MOST_RATIO)
        )
    for bar, is_kept in bars:
        print(f"  {'kept  ' if is_kept else 'MISSED'} {bar}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--gb", type=float, default=5.0, help="size of the bags and MCAP files before packing")
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--only", default="", help="names of files, or parts of them, with commas")
    parser.add_argument("--folder", type=Path, help="where the files are made; they go again")
    args = parser.parse_args()
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job ignores it, and so its children
    start = median_of([*TRIAGE, str(SAMPLE)], args.runs)
    print(f"{SAMPLE.name}: {start.seconds:.2f} s, {start.cpu_s:.2f} s cpu, {start.read_mb:.1f} MB read, Python's own")
    for case in CASES:
        if not any(part in case.name for part in args.only.split(",")):
            continue
        with tempfile.TemporaryDirectory(dir=args.folder) as folder:
            path = Path(folder) / case.name
            case.make(path, args.gb * SHARE_OF_5_GB.get(case.name, 1.0))
            report(case, path, args.runs, start)


if __name__ == "__main__":
    main()
