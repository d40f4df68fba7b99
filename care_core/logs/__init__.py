"""Open a log by what it holds, not by what it is called."""

from __future__ import annotations

import hashlib
from importlib import import_module
from pathlib import Path

from care_core.errors import LogError
from care_core.logs.base import Log, LogFormat

READERS = {
    LogFormat.DATAFLASH_BIN: ("care_core.logs.dataflash", "DataFlashLog"),
    LogFormat.ROS1_BAG: ("care_core.logs.ros1_bag", "Ros1Bag"),
}
"""Module and class per format, imported only when a log of that format is opened."""

READABLE = "ArduPilot DataFlash (.BIN) and ROS 1 bags (.bag)"

UNREADABLE_MAGIC = (
    (b"#ROSBAG V1", "a ROS bag of format 1.x", "Convert it with 'rosbag fix' or 'rosbag reindex'."),
    (b"SQLite format 3\0", "a ROS 2 bag (SQLite)", "Convert it to a ROS 1 bag with 'rosbags-convert'."),
    (b"\x89MCAP0\r\n", "an MCAP file", "Convert it to a ROS 1 bag with 'rosbags-convert'."),
    (b"ULog\x01\x12\x35", "a PX4 ULog", ""),
    (b"\x1f\x8b", "a gzip archive", "Unpack it first."),
    (b"PK\x03\x04", "a zip archive", "Unpack it first."),
    (b"\x28\xb5\x2f\xfd", "a zstd archive", "Unpack it first."),
)
"""Formats that are recognised but not read: how the file begins, what it is, what to do."""

_SNIFF_BYTES = 4096


def open_log(path: str | Path) -> Log:
    """Open a log with the reader that its first bytes ask for.

    Raises:
        LogError: no such file, a folder, no permission, an empty file, or content that no reader knows.
    """
    path = Path(path)
    module, reader = READERS[sniff(path)]
    log: Log = getattr(import_module(module), reader)(path)
    return log


def sniff(path: Path) -> LogFormat:
    """The format of a file, told from its first bytes. Raises LogError as `open_log`."""
    head = _read_head(path)
    if head.startswith(b"#ROSBAG V2.0"):
        return LogFormat.ROS1_BAG
    for magic, what, hint in UNREADABLE_MAGIC:
        if head.startswith(magic):
            raise _unreadable(path, what, hint)
    # A DataFlash log declares its message types first; damage at its very start must not hide them.
    if b"\xa3\x95\x80" in head:
        return LogFormat.DATAFLASH_BIN
    if b"FMT, 128" in head:
        raise _unreadable(path, "a DataFlash log as text", "Use the .BIN that the vehicle wrote.")
    if len(head) > 8 and head[0] == 0 and head[8] in (0xFD, 0xFE):
        raise _unreadable(path, "a MAVLink telemetry log (.tlog)", "Use the .BIN from the vehicle's memory card.")
    raise LogError("Not a log of a known format.", hint=f"Readable are {READABLE}.", where=str(path))


def log_digest(path: str | Path) -> str:
    """SHA-256 of the file in hex, read in pieces."""
    digest = hashlib.sha256()
    try:
        with Path(path).open("rb") as stream:
            # Large pieces: after each the thread waits for its turn among those that compute.
            while piece := stream.read(1 << 23):
                digest.update(piece)
    except OSError as err:
        raise _cannot_open(Path(path), err) from err
    return digest.hexdigest()


def _read_head(path: Path) -> bytes:
    if path.is_dir():
        is_ros2 = (path / "metadata.yaml").is_file()
        if is_ros2:
            raise _unreadable(path, "a ROS 2 bag folder", "Convert it to a ROS 1 bag with 'rosbags-convert'.")
        raise LogError("A folder, not a log.", hint="Name one log file in it.", where=str(path))
    try:
        with path.open("rb") as stream:
            head = stream.read(_SNIFF_BYTES)
    except OSError as err:
        raise _cannot_open(path, err) from err
    if not head:
        raise LogError("The file is empty.", hint="Was the recording stopped properly?", where=str(path))
    return head


def _cannot_open(path: Path, err: OSError) -> LogError:
    if isinstance(err, FileNotFoundError):
        return LogError("No such file.", hint="Check the path.", where=str(path))
    if isinstance(err, PermissionError):
        return LogError("No permission to read the file.", hint="Check its owner and mode.", where=str(path))
    return LogError(f"Cannot read the file: {err.strerror or err}.", where=str(path))


def _unreadable(path: Path, what: str, hint: str) -> LogError:
    return LogError(
        f"This is {what}, which cannot be read yet.", hint=hint or f"Readable are {READABLE}.", where=str(path)
    )
