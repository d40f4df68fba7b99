"""How long `care triage` takes on large logs and what memory it needs, beside decoding all of them and beside `cat`.

    python -m benchmarks.ingest [--runs 3] [--only bag,mcap,BIN]

The logs are made in a temporary folder (1.1 GB): a 450 MB ROS 1 bag, the same messages as MCAP, and DataFlash logs of
6 and 100 MB. The bag holds a real mission of move_base with its configuration, between the camera, lasers, IMU, joints
and transforms of a robot that stood for five minutes before it drove. The DataFlash logs are the bundled sample with
every telemetry record repeated at evenly spaced times, as a log that was not thinned would have it.

Every process is cold, the file is in the cache. "its reading" opens the log, chooses the profile and reads the mission;
"inside" are its seconds, and those of decoding everything, without starting Python and importing: the two that are
compared. The digest of the log, which triage works out in a thread beside, is not reading. Printed are wall seconds,
those of the processor (which other work on the machine disturbs less), the peak of anonymous memory (`RssAnon` of
/proc, sampled; pages of a mapped file are the kernel's to take back and do not count), and the time as a share of
triage's.
"""

from __future__ import annotations

import argparse
import heapq
import math
import os
import resource
import statistics
import struct
import subprocess
import sys
import tempfile
import time
from bisect import bisect_left
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from care_core.application.case import choose
from care_core.extract.read import reading_plan
from care_core.files import bundled
from care_core.logs.opening import open_log
from care_core.records import Record

MB = 1e6
GOOD_BAG = Path(__file__).parents[1] / "tests" / "data" / "move_base_good.bag"
SAMPLE = bundled("samples", "arducopter_failed.BIN")

INSTALLED = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
"""The environment: an installed package is compiled, a checkout that may not be is slower to start."""

TRIAGE = [sys.executable, "-c", "from care_tui.start import main; main()", "triage", "--json"]
READ = """
import sys, time
from pathlib import Path
import care_core.diagnose.triage
from care_core.ecosystems.registry import run_model
from care_core.extract.read import read_run
from care_core.application.case import choose
from care_core.logs.opening import open_log
started = time.perf_counter()
log = open_log(Path(sys.argv[1]))
profile, _ = choose(log)
read_run(run_model(log), profile.schema, sha256=str)
print(time.perf_counter() - started)
"""
SELECT = """
import sys, time
from pathlib import Path
from care_core.application.case import choose
from care_core.extract.read import reading_plan
from care_core.logs.opening import open_log
profile, _ = choose(open_log(Path(sys.argv[1])))
plan = reading_plan(profile.schema)
started = time.perf_counter()
log = open_log(Path(sys.argv[1]))
for table in log.read(plan).values():
    for column in table.columns.values():  # some are decoded when they are asked for
        len(column)
print(time.perf_counter() - started)
"""
"""Our reader, opening the log and reading the channels and fields of the profile that fits."""
DECODE_BAG = """
import sys, time
from pathlib import Path
from rosbags.highlevel import AnyReader
wanted = sys.argv[2:]
started = time.perf_counter()
with AnyReader([Path(sys.argv[1])]) as bag:
    chosen = [one for one in bag.connections if not wanted or one.topic in wanted]
    for connection, _, raw in bag.messages(connections=chosen):
        bag.deserialize(raw, connection.msgtype)
print(time.perf_counter() - started)
"""
DECODE_MCAP = """
import sys, time
from mcap.reader import make_reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
started = time.perf_counter()
store, names = get_typestore(Stores.EMPTY), {}
with open(sys.argv[1], "rb") as stream:
    for schema, channel, message in make_reader(stream).iter_messages(topics=sys.argv[2:] or None):
        if schema.id not in names:
            names[schema.id] = schema.name.replace("/", "/msg/")
            store.register({k: v for k, v in get_types_from_msg(schema.data.decode(), names[schema.id]).items()
                            if k not in store.fielddefs})
        store.deserialize_ros1(message.data, names[schema.id])
print(time.perf_counter() - started)
"""
DECODE_BIN = """
import sys, time
from pymavlink import DFReader
started = time.perf_counter()
log = DFReader.DFReader_binary(sys.argv[1])
while (log.recv_match(type=sys.argv[2:]) if sys.argv[2:] else log.recv_msg()) is not None:
    pass
print(time.perf_counter() - started)
"""


class Cost(NamedTuple):
    """Wall and processor seconds of a process, the peak of its anonymous memory in MB, and the seconds it says that its
    work took (NaN: it says none)."""

    seconds: float
    cpu_s: float
    anonymous_mb: float
    inside_s: float


class Case(Record):
    """A log to make, who decodes all of it, and the seconds that triage may take."""

    name: str
    make: Callable[[Path], None]
    decode_all: str
    decoder: str
    bar_s: float


def run_once(command: list[str], *, says: bool = False) -> Cost:
    """What one run of a command costs; `says`: its output are its own seconds.

    Raises where it ends with another code than 0 or 1 (a fault was found).
    """
    started, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
    peak_kb = 0
    output = subprocess.PIPE if says else subprocess.DEVNULL
    with subprocess.Popen(command, stdout=output, stderr=subprocess.DEVNULL, env=INSTALLED) as process:
        status = Path(f"/proc/{process.pid}/status")
        while process.poll() is None:
            lines = status.read_text().splitlines()
            peak_kb = max([peak_kb, *(int(line.split()[1]) for line in lines if line.startswith("RssAnon"))])
            time.sleep(0.005)
        seconds = time.perf_counter() - started
        inside_s = float(process.stdout.read()) if process.stdout is not None else math.nan
    if process.returncode not in (0, 1):  # a log of which nothing could be judged measures nothing
        raise SystemExit(f"ended with {process.returncode}: {' '.join(command)}")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return Cost(seconds, cpu_s, peak_kb * 1024 / MB, inside_s)


def median_of(costs: list[Cost]) -> Cost:
    return Cost(*(statistics.median(values) for values in zip(*costs, strict=True)))


# DataFlash

HEADER = b"\xa3\x95"
FORMAT = 0x80
TELEMETRY = {
    b"ATT", b"BAT", b"CTUN", b"MOTB", b"POS", b"PSCD", b"PSCE", b"PSCN", b"RATE", b"RCOU", b"VIBE",
    b"XKF3", b"XKF4",
}  # fmt: skip
"""What is repeated; GPS is not, for its messages carry the satellites' time as well."""
THINNED_US = 400_000
OFTENEST = 700
"""Repeats that keep a message below 2 kHz: the log has it 2.5 times a second."""
OFTENEST_OF = {b"ATT": 300, b"POS": 300, b"BAT": 30, b"RATE": 7000}
"""Below 1 kHz, 100 Hz and 20 kHz."""


def records(raw: bytes) -> Iterator[tuple[bytes, bytes]]:
    """(name, whole record) of every record of a sound DataFlash log, in order."""
    lengths, names, pos = {FORMAT: 89}, {FORMAT: b"FMT"}, 0
    while raw[pos : pos + 2] == HEADER and raw[pos + 2] in lengths:
        kind = raw[pos + 2]
        record = raw[pos : pos + lengths[kind]]
        if kind == FORMAT:
            described, length, name = struct.unpack_from("<BB4s", record, 3)
            lengths[described], names[described] = length, name.rstrip(b"\0")
        yield names[kind], record
        pos += lengths[kind]


def full_rate(raw: bytes, size: int) -> bytes:
    """The log with its telemetry repeated until it has about `size` bytes, none faster than a vehicle records it as far
    as that is enough."""
    parts = list(records(raw))
    telemetry = Counter[bytes]()
    for name, record in parts:
        telemetry[name] += len(record) if name in TELEMETRY else 0
    wanted = size - len(raw)
    most = dict.fromkeys(TELEMETRY, OFTENEST) | OFTENEST_OF
    spare = wanted - sum(length * most.get(name, 0) for name, length in telemetry.items())
    steps = range(1, max(most.values()) + 1)
    as_often = bisect_left(
        steps, wanted, key=lambda k: sum(length * min(k, most.get(name, 0)) for name, length in telemetry.items())
    )
    more = max(0, round(spare / sum(telemetry.values())))
    made = bytearray()
    for name, record in parts:
        repeats = min(as_often + 1, most.get(name, 1)) + (more if name in TELEMETRY else 0)
        for k in range(repeats):
            (stamp,) = struct.unpack_from("<Q", record, 3) if name in TELEMETRY else (0,)
            shifted = struct.pack("<Q", stamp + k * THINNED_US // repeats) if name in TELEMETRY else record[3:11]
            made += record[:3] + shifted + record[11:]
    return bytes(made)


def make_bin(size: int) -> Callable[[Path], None]:
    def make(path: Path) -> None:
        path.write_bytes(full_rate(SAMPLE.read_bytes(), size))

    return make


# ROS

SECOND_NS = 1_000_000_000
STOOD_S = 300


class Topic(NamedTuple):
    """A topic as both containers need it; `definition` is the message's with those that it is made of."""

    name: str
    type: str
    definition: str
    digest: str


def ros_types() -> Any:
    """The message types of noetic with that of `/tf`."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage"))
    return store


def sensor_messages(make: Mapping[str, Any]) -> list[tuple[str, Any, int]]:
    """(topic, message, messages a second) of what a robot records beside its navigation; `make` holds the types."""
    import numpy as np

    rng = np.random.default_rng(0)
    header = make["std_msgs/msg/Header"](0, make["builtin_interfaces/msg/Time"](0, 0), "base_link")
    vector = make["geometry_msgs/msg/Vector3"](0.1, 0.2, 9.8)
    turn = make["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
    square = np.zeros(9)
    beams = rng.random(1081).astype(np.float32)
    scan = make["sensor_msgs/msg/LaserScan"](header, -2.4, 2.4, 0.004, 0.0, 0.025, 0.1, 30.0, beams, beams)
    imu = make["sensor_msgs/msg/Imu"](header, turn, square, vector, square, vector, square)
    names = ["front_left", "front_right", "rear_left", "rear_right"]
    joints = make["sensor_msgs/msg/JointState"](header, names, np.zeros(4), np.zeros(4), np.zeros(4))
    moved = make["geometry_msgs/msg/TransformStamped"](
        header, "odom", make["geometry_msgs/msg/Transform"](vector, turn)
    )
    transforms = make["tf2_msgs/msg/TFMessage"]([moved, moved])
    picture = make["sensor_msgs/msg/CompressedImage"](header, "jpeg", rng.integers(0, 256, 60_000, dtype=np.uint8))
    return [
        ("/front/scan", scan, 20), ("/rear/scan", scan, 20), ("/imu/data", imu, 200), ("/joint_states", joints, 50),
        ("/tf", transforms, 100), ("/camera/image_raw/compressed", picture, 15),
    ]  # fmt: skip


def repeated(topic: Topic, raw: bytes, times: range) -> Iterator[tuple[int, Topic, bytes]]:
    return ((time_ns, topic, raw) for time_ns in times)


def mission_messages(stood_s: int) -> tuple[Iterator[tuple[int, Topic, bytes]], int, int]:
    """The mission of `GOOD_BAG` after so many seconds, and the times in ns at which the log begins and ends."""
    from rosbags.rosbag1 import Reader

    with Reader(GOOD_BAG) as bag:
        begin, end = bag.start_time, bag.end_time + stood_s * SECOND_NS
        topics = {c.id: Topic(c.topic, c.msgtype, c.msgdef.data, c.digest) for c in bag.connections}
        mission = [(time_ns + stood_s * SECOND_NS, topics[c.id], bytes(raw)) for c, time_ns, raw in bag.messages()]
    return iter(mission), begin, end


def robot_messages() -> Iterator[tuple[int, Topic, bytes]]:
    """(time in ns, topic, serialised message) in time order: the mission of `GOOD_BAG` among the sensors' messages."""
    store = ros_types()
    mission, begin, end = mission_messages(STOOD_S)
    streams = [mission]
    for name, message, rate in sensor_messages(store.types):
        kind = message.__msgtype__
        topic = Topic(name, kind, *store.generate_msgdef(kind))
        raw = bytes(store.serialize_ros1(message, kind))
        streams.append(repeated(topic, raw, range(begin, end, SECOND_NS // rate)))
    return heapq.merge(*streams, key=lambda part: part[0])


def make_bag(path: Path) -> None:
    """As 'rosbag record' writes it: chunks of 768 kB, not compressed."""
    from rosbags.rosbag1 import Writer

    connections: dict[str, Any] = {}
    writer = Writer(path)
    writer.chunk_threshold = 768 * 1024
    with writer:
        for time_ns, topic, raw in robot_messages():
            if topic.name not in connections:
                connections[topic.name] = writer.add_connection(
                    topic.name, topic.type, msgdef=topic.definition, md5sum=topic.digest
                )
            writer.write(connections[topic.name], time_ns, raw)


def make_mcap(path: Path) -> None:
    """The same messages in the ros1 profile, in chunks of 768 kB, not compressed."""
    from mcap.writer import CompressionType, Writer

    channels: dict[str, int] = {}
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=768 * 1024, compression=CompressionType.NONE)
        writer.start(profile="ros1", library="care benchmark")
        for time_ns, topic, raw in robot_messages():
            if topic.name not in channels:
                schema = writer.register_schema(topic.type.replace("/msg/", "/"), "ros1msg", topic.definition.encode())
                channels[topic.name] = writer.register_channel(topic.name, "ros1", schema)
            writer.add_message(channels[topic.name], time_ns, raw, time_ns)
        writer.finish()  # type: ignore[no-untyped-call]


CASES = (
    Case("six.BIN", make_bin(6_000_000), DECODE_BIN, "pymavlink", 0.8),
    Case("hundred.BIN", make_bin(100_000_000), DECODE_BIN, "pymavlink", 2.0),
    Case("robot.bag", make_bag, DECODE_BAG, "rosbags", 0.8),
    Case("robot.mcap", make_mcap, DECODE_MCAP, "mcap and rosbags", 0.8),
)
MOST_ANONYMOUS_MB = 300
MOST_MB_PER_MB = 0.5
LEAST_RATIO = 5


class Measured(NamedTuple):
    """One log: its size, what each costs, and how much longer decoding everything takes than reading."""

    size_mb: float
    triage: Cost
    read: Cost
    decode: Cost
    cat: Cost
    ratio: float
    selected: float
    """How much longer the library takes for the messages that the profile reads than our reader does."""


def measure(case: Case, path: Path, runs: int) -> Measured:
    """Medians of `runs` rounds after a warm-up; a round runs the four one after the other."""
    python = [sys.executable, "-c"]
    programs = (TRIAGE, [*python, READ], [*python, case.decode_all], ["cat"])
    commands = [[*program, str(path)] for program in programs]
    rounds = [[run_once(command, says=i in (1, 2)) for i, command in enumerate(commands)] for _ in range(runs + 1)][1:]
    triage, read, decode, cat = (median_of([costs[i] for costs in rounds]) for i in range(4))
    ratio = statistics.median(costs[2].inside_s / costs[1].inside_s for costs in rounds)
    return Measured(path.stat().st_size / MB, triage, read, decode, cat, ratio, selected(case, path, runs))


def selected(case: Case, path: Path, runs: int) -> float:
    """The library over our reader, each opening the log and decoding the channels that the fitting profile reads."""
    profile, _ = choose(open_log(path))
    channels = [] if profile is None else list(reading_plan(profile.schema))
    ours, theirs = [sys.executable, "-c", SELECT, str(path)], [sys.executable, "-c", case.decode_all, str(path)]
    rounds = [(run_once([*theirs, *channels], says=True), run_once(ours, says=True)) for _ in range(runs + 1)][1:]
    return statistics.median(their.inside_s / our.inside_s for their, our in rounds)


def report(case: Case, found: Measured, start: Cost) -> None:
    """The table of one log, and which bars it keeps. Memory that grows is counted against the smallest log's triage."""
    triage, per_mb = found.triage, (found.triage.anonymous_mb - start.anonymous_mb) / found.size_mb
    bars = (
        (f"{triage.seconds:.2f} s, at most {case.bar_s:g}", triage.seconds <= case.bar_s),
        (f"{triage.anonymous_mb:.0f} MB, at most {MOST_ANONYMOUS_MB}", triage.anonymous_mb <= MOST_ANONYMOUS_MB),
        (f"{per_mb:.2f} MB more a MB of log, at most {MOST_MB_PER_MB}", per_mb <= MOST_MB_PER_MB),
        (
            f"reads {found.ratio:.1f} times faster than all is decoded, at least {LEAST_RATIO}",
            found.ratio >= LEAST_RATIO,
        ),
    )
    costs = {"care triage": triage, "its reading": found.read, f"{case.decoder}, all": found.decode, "cat": found.cat}
    print(f"{case.name}, {found.size_mb:.1f} MB")
    for name, cost in costs.items():
        times = f"{cost.seconds / triage.seconds:7.2f}"
        inside = "" if math.isnan(cost.inside_s) else f"   inside {cost.inside_s:.2f} s"
        print(f"  {name:22s} {cost.seconds:7.2f} s {cost.cpu_s:7.2f} s cpu {cost.anonymous_mb:5.0f} MB {times}{inside}")
    print(f"  {case.decoder}, only what the profile reads: {found.selected:.1f} times as long as our reader")
    for bar, is_kept in bars:
        print(f"  {'kept  ' if is_kept else 'MISSED'} {bar}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--only", default="", help="names of logs, or parts of them, with commas")
    args = parser.parse_args()
    start = median_of([run_once([*TRIAGE, str(SAMPLE)]) for _ in range(args.runs + 1)][1:])
    print(f"{SAMPLE.name}, {SAMPLE.stat().st_size / MB:.1f} MB: {start.seconds:.2f} s {start.anonymous_mb:.0f} MB")
    for case in CASES:
        if not any(part in case.name for part in args.only.split(",")):
            continue
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / case.name
            case.make(path)
            report(case, measure(case, path, args.runs), start)


if __name__ == "__main__":
    main()
