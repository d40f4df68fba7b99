"""How long `care triage` takes on a full-rate log, as a whole process, beside decoding every message with pymavlink.

    python -m benchmarks.speed [--megabytes 6] [--runs 5]

The log is made from the bundled sample: every telemetry record is repeated at evenly spaced times, as a log that was
not thinned would have it. Wall time and peak memory are medians over the runs; ratios are pair by pair in one run.
"""

from __future__ import annotations

import argparse
import os
import statistics
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from care_core.resources import bundled

HEADER = b"\xa3\x95"
FORMAT = 0x80
TELEMETRY = {
    b"ATT", b"BAT", b"CTUN", b"GPS", b"MOTB", b"POS", b"PSCD", b"PSCE", b"PSCN", b"RATE", b"RCOU", b"VIBE",
    b"XKF3", b"XKF4",
}  # fmt: skip
THINNED_US = 400_000
TRIAGE = [sys.executable, "-c", "from care_tui.cli import main; main()", "triage", "--json"]
DECODE_ALL = [
    sys.executable,
    "-c",
    "import sys; from pymavlink import DFReader; log = DFReader.DFReader_binary(sys.argv[1])\n"
    "while log.recv_msg() is not None: pass",
]


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
    """The log with its telemetry repeated until it has about `size` bytes."""
    parts = list(records(raw))
    telemetry = sum(len(record) for name, record in parts if name in TELEMETRY)
    repeats = max(1, round((size - len(raw)) / telemetry) + 1)
    made = bytearray()
    for name, record in parts:
        for k in range(repeats if name in TELEMETRY else 1):
            (stamp,) = struct.unpack_from("<Q", record, 3) if name in TELEMETRY else (0,)
            shifted = struct.pack("<Q", stamp + k * THINNED_US // repeats) if name in TELEMETRY else record[3:11]
            made += record[:3] + shifted + record[11:]
    return bytes(made)


def run_once(command: list[str]) -> tuple[float, float]:
    """Wall seconds and peak resident megabytes of a process."""
    started = time.perf_counter()
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        _, _, usage = os.wait4(process.pid, 0)
    return time.perf_counter() - started, usage.ru_maxrss / 1024


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--megabytes", type=float, default=6.0)
    parser.add_argument("--runs", type=int, default=5)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "full_rate.BIN"
        path.write_bytes(full_rate(bundled("samples", "arducopter_failed.BIN").read_bytes(), int(args.megabytes * 1e6)))
        results: dict[str, list[tuple[float, float]]] = {"care triage": [], "pymavlink, every message": []}
        for _ in range(args.runs + 1):
            results["care triage"].append(run_once([*TRIAGE, str(path)]))
            results["pymavlink, every message"].append(run_once([*DECODE_ALL, str(path)]))
        print(f"{path.stat().st_size / 1e6:.1f} MB DataFlash log, medians of {args.runs} runs after a warm-up")
        for name, runs in results.items():
            wall, peak = (statistics.median(run[i] for run in runs[1:]) for i in (0, 1))
            print(f"  {name:26s} {wall:6.2f} s  {peak:5.0f} MB peak resident")
        pairs = zip(results["pymavlink, every message"][1:], results["care triage"][1:], strict=True)
        print(f"  ratio, pair by pair: {statistics.median(a[0] / b[0] for a, b in pairs):.1f}")


if __name__ == "__main__":
    main()
