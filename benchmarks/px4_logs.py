"""What the triage of a large PX4 log costs beside pyulog, which reads all of it.

    python -m benchmarks.px4_logs [--runs 5] [--mb 48] [--log FILE]

The log is made in a temporary folder: topics in the formats and at the rates of PX4 1.15 in its simulator, with noise
in their fields and a flight of one hover. `--log` takes a recorded one. Each round runs `care triage` and pyulog's
`ULog(path)` one after the other, whole cold processes with the file in the system's cache. Printed are seconds of the
processor (user and system) and the peak of resident memory, medians of the rounds, and the median of their ratios;
*reading* is our reader alone, opened and asked for all that the checks read, against the call of `ULog` alone.
"""

from __future__ import annotations

import argparse
import os
import statistics
import struct
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.ingest import INSTALLED
from tests.rewritten import ULOG_MAGIC, ulog_keyed, ulog_record

MOST_RATIO, MOST_MB = 0.7, 150
MB = 1e6
START_US = 1_000_000
TRIAGE = "from care_tui.start import main; main()"
PYULOG = "import sys; from pyulog import ULog; ULog(sys.argv[2])"
OURS = """
import sys, time
from pathlib import Path
from care_core.ecosystems.px4.examining import reads
from care_core.logs.px4_ulog import Px4Log
began, plan = time.process_time(), reads()
Px4Log(Path(sys.argv[2])).read(plan)
print(time.process_time() - began)
"""
THEIRS = """
import sys, time
from pyulog import ULog
began = time.process_time()
ULog(sys.argv[2])
print(time.process_time() - began)
"""

MAKE = """
import sys
from pathlib import Path
from benchmarks.px4_logs import write_flight
write_flight(Path(sys.argv[1]), float(sys.argv[2]))
"""

TOPICS: dict[str, tuple[int, str]] = {
    "sensor_combined": (250, "float[3] gyro_rad;uint32_t gyro_integral_dt;int32_t accelerometer_timestamp_relative;"
                             "float[3] accelerometer_m_s2;uint32_t accelerometer_integral_dt;uint8_t clipping;"),
    "vehicle_attitude": (210, "uint64_t timestamp_sample;float[4] q;float[4] delta_q_reset;uint8_t reset_counter;"),
    "vehicle_angular_velocity": (200, "uint64_t timestamp_sample;float[3] xyz;float[3] xyz_derivative;"),
    "vehicle_local_position": (125, "uint64_t timestamp_sample;float x;float y;float z;float vx;float vy;float vz;"
                                    "float heading;float[32] more;bool xy_valid;"),
    "estimator_innovations": (125, "uint64_t timestamp_sample;float[33] innovations;"),
    "estimator_innovation_variances": (125, "uint64_t timestamp_sample;float[33] variances;"),
    "estimator_innovation_test_ratios": (125, "uint64_t timestamp_sample;float[33] ratios;"),
    "estimator_states": (125, "uint64_t timestamp_sample;float[24] states;float[23] covariances;uint8_t n_states;"),
    "estimator_status": (125, "uint64_t timestamp_sample;float[24] output;float vel_test_ratio;float pos_test_ratio;"
                              "float hgt_test_ratio;float mag_test_ratio;float hdg_test_ratio;"),
    "yaw_estimator_status": (125, "uint64_t timestamp_sample;float[21] yaw;"),
    "vehicle_global_position": (105, "uint64_t timestamp_sample;double lat;double lon;float alt;float[3] errors;"),
    "vehicle_rates_setpoint": (42, "float roll;float pitch;float yaw;float[3] thrust_body;"),
    "vehicle_attitude_setpoint": (20, "float yaw_sp_move_rate;float[4] q_d;float[3] thrust_body;"),
    "actuator_outputs": (10, "uint32_t noutputs;float[16] output;"),
    "actuator_motors": (10, "uint64_t timestamp_sample;float[12] control;"),
    "sensor_gps": (8, "double latitude_deg;double longitude_deg;float hdop;uint64_t time_utc_usec;"
                      "uint8_t fix_type;uint8_t satellites_used;"),
    "battery_status": (5, "float voltage_v;float current_a;uint8_t cell_count;uint8_t warning;bool connected;"),
    "vehicle_air_data": (5, "float baro_alt_meter;float baro_pressure_pa;"),
    "vehicle_status": (2, "uint8_t arming_state;uint8_t nav_state;bool failsafe;uint8_t vehicle_type;"),
    "vehicle_land_detected": (2, "bool landed;"),
}  # fmt: skip
"""By name how often a second, and the fields behind the time stamp."""
HOVER_S = (5.0, 5.0)
"""Seconds before the vehicle is armed, and after it was disarmed."""
_KINDS = {"float": "<f4", "double": "<f8", "bool": "u1", "uint8_t": "u1", "uint32_t": "<u4", "int32_t": "<i4",
          "uint64_t": "<u8"}  # fmt: skip


def layout(fields: str) -> np.dtype[np.void]:
    """A message of a topic as it is stored, with the header of its record."""
    own = []
    for kind, name in (part.split() for part in fields.split(";") if part):
        single, _, many = kind.rstrip("]").partition("[")
        own.append((name, np.dtype((_KINDS[single], int(many))) if many else np.dtype(_KINDS[single])))
    return np.dtype([("length", "<u2"), ("kind", "u1"), ("id", "<u2"), ("timestamp", "<u8"), *own])


def messages(number: int, rate_hz: int, fields: str, end_s: float, rng: np.random.Generator) -> NDArray[np.void]:
    """The messages of a topic in a flight of so many seconds, noise in what says nothing of the flight."""
    found = np.zeros(max(int(end_s * rate_hz), 1), layout(fields))
    t = np.arange(len(found)) / rate_hz
    is_armed = (t >= HOVER_S[0]) & (t <= end_s - HOVER_S[1])
    for name in found.dtype.names or ():
        if found[name].dtype.kind == "f":
            found[name] = rng.normal(0, 0.01, found[name].shape)
    given: dict[str, Any] = {
        "z": -10.0 * is_armed, "arming_state": 1 + is_armed, "nav_state": 4, "landed": ~is_armed, "vehicle_type": 1,
        "voltage_v": 16.2, "cell_count": 4, "connected": 1, "fix_type": 3, "satellites_used": 10, "hdop": 0.7,
        "time_utc_usec": 1_700_000_000_000_000 + (t * 1e6).astype(np.int64),
    }  # fmt: skip
    for name, values in given.items():
        if name in (found.dtype.names or ()):
            found[name] = values + (found[name] if found[name].dtype.kind == "f" else 0)
    for axis, force in (("accelerometer_m_s2", (0, 0, -9.81)), ("q", (1, 0, 0, 0)), ("q_d", (1, 0, 0, 0))):
        if axis in (found.dtype.names or ()):
            found[axis] += force
    found["length"], found["kind"], found["id"] = found.dtype.itemsize - 3, ord("D"), number
    found["timestamp"] = START_US + (t * 1e6).astype(np.int64)
    return found


def write_flight(path: Path, size: float) -> Path:
    """A PX4 log of about so many bytes."""
    rng = np.random.default_rng(0)
    end_s = size / sum(rate * layout(fields).itemsize for rate, fields in TOPICS.values())
    parts = [ULOG_MAGIC + struct.pack("<Q", START_US), ulog_record(b"B", bytes(40))]
    parts += [ulog_record(b"F", f"{name}:uint64_t timestamp;{fields}".encode()) for name, (_, fields) in TOPICS.items()]
    parts.append(ulog_keyed(b"I", b"uint32_t ver_sw_release", struct.pack("<I", 0x010F04FF)))
    parts.append(ulog_keyed(b"I", b"char[8] ver_sw", b"99c40407"))
    for number in range(900):
        parts.append(ulog_keyed(b"P", f"float TEST_{number}".encode(), struct.pack("<f", number)))
    parts += [ulog_record(b"A", struct.pack("<BH", 0, number) + name.encode()) for number, name in enumerate(TOPICS)]
    with path.open("wb") as stream:
        stream.write(b"".join(parts))
        stream.writelines(in_order(end_s, rng))
    return path


def in_order(end_s: float, rng: np.random.Generator) -> Iterator[bytes]:
    """The records of all topics by their time."""
    topics = [messages(number, *topic, end_s, rng) for number, topic in enumerate(TOPICS.values())]
    stamps = np.concatenate([one["timestamp"] for one in topics])
    number = np.repeat(np.arange(len(topics)), [len(one) for one in topics])
    row = np.concatenate([np.arange(len(one)) for one in topics])
    raw = [(memoryview(one.tobytes()), one.dtype.itemsize) for one in topics]
    order = np.argsort(stamps, kind="stable")
    for topic, at in zip(number[order].tolist(), row[order].tolist(), strict=True):
        view, length = raw[topic]
        yield bytes(view[at * length : (at + 1) * length])


class Cost(NamedTuple):
    """Seconds of the processor, and the peak of resident memory in MB, of a whole process; and what it printed last."""

    cpu_s: float
    peak_mb: float
    said: str


def cost(program: str, path: Path, home: str) -> Cost:
    env = {**INSTALLED, "OPENBLAS_NUM_THREADS": "1"}
    env |= {f"XDG_{kind}_HOME": home for kind in ("CACHE", "DATA", "CONFIG")}
    with subprocess.Popen([sys.executable, "-c", program, "triage", str(path)], stdout=subprocess.PIPE,
                          stderr=subprocess.DEVNULL, env=env, text=True) as process:  # fmt: skip
        assert process.stdout is not None
        said = process.stdout.read()
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode not in (0, 1, 3):  # 3: no profile judged it
        raise SystemExit(f"ended with {process.returncode}")
    return Cost(used.ru_utime + used.ru_stime, used.ru_maxrss * 1024 / MB, said)


def report(path: Path, runs: int) -> None:
    with tempfile.TemporaryDirectory() as home:
        rounds = [[cost(program, path, home) for program in (TRIAGE, PYULOG, OURS, THEIRS)] for _ in range(runs + 1)]
    rounds = rounds[1:]
    triage, pyulog = ([one[at] for one in rounds] for at in (0, 1))
    ratio = statistics.median(ours.cpu_s / theirs.cpu_s for ours, theirs in zip(triage, pyulog, strict=True))
    peak_mb = statistics.median(one.peak_mb for one in triage)
    print(f"{path.name}, {path.stat().st_size / MB:.1f} MB")
    for name, costs in (("care triage", triage), ("pyulog, all", pyulog)):
        seconds = statistics.median(one.cpu_s for one in costs)
        print(f"  {name:12s} {seconds:.2f} s cpu {statistics.median(one.peak_mb for one in costs):5.0f} MB")
    inside = [(float(one[2].said.split()[-1]), float(one[3].said.split()[-1])) for one in rounds]
    ours, theirs = (statistics.median(column) for column in zip(*inside, strict=True))
    quicker = statistics.median(their / our for our, their in inside)
    print(f"  reading      {ours:.2f} s, pyulog {theirs:.2f} s: {quicker:.1f} x")
    for text, is_kept in (
        (f"{ratio:.2f} of pyulog's time, at most {MOST_RATIO}", ratio <= MOST_RATIO),
        (f"{peak_mb:.0f} MB, at most {MOST_MB}", peak_mb <= MOST_MB),
    ):
        print(f"  {'kept  ' if is_kept else 'MISSED'} {text}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--mb", type=float, default=48)
    parser.add_argument("--log", type=Path)
    args = parser.parse_args()
    if args.log is not None:
        report(args.log, args.runs)
        return
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "flight.ulg"
        # In a process of its own: one that is started counts the peak of who starts it.
        subprocess.run([sys.executable, "-c", MAKE, str(path), str(args.mb * MB)], check=True)
        report(path, args.runs)


if __name__ == "__main__":
    main()
