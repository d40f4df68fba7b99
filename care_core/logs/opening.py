"""Open a log by what it holds, not by what it is called."""

from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path
from typing import BinaryIO

from care_core.errors import LogError
from care_core.logs.base import Log, LogFormat

READERS = {
    LogFormat.DATAFLASH_BIN: ("care_core.logs.dataflash", "DataFlashLog"),
    LogFormat.DATAFLASH_TEXT: ("care_core.logs.dataflash_text", "DataFlashTextLog"),
    LogFormat.MAVLINK_TLOG: ("care_core.logs.mavlink", "MavlinkLog"),
    LogFormat.PX4_ULG: ("care_core.logs.px4_ulog", "Px4Log"),
    LogFormat.ROS1_BAG: ("care_core.logs.ros1_bag", "Ros1Bag"),
    LogFormat.ROS2_DB3: ("care_core.logs.ros2_db3", "Ros2Db3"),
    LogFormat.MCAP: ("care_core.logs.mcap_log", "McapLog"),
}
"""Module and class per format, imported only when a log of that format is opened."""

READABLE = (
    "ArduPilot DataFlash (.BIN, .log), MAVLink telemetry (.tlog), PX4 ULog (.ulg), ROS 1 bags (.bag) and ROS 2 bags"
    " (.db3, .mcap)"
)

ROS_MAGIC = (
    (b"#ROSBAG V2.0", LogFormat.ROS1_BAG),
    (b"SQLite format 3\0", LogFormat.ROS2_DB3),
    (b"\x89MCAP0\r\n", LogFormat.MCAP),
)
"""How the files of a ROS recording begin; each may be packed with zstd."""

_ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"

UNREADABLE_MAGIC = (
    (b"#ROSBAG V1", "a ROS bag of format 1.x", "Bring it to format 2.0 with 'rosbag fix' of ROS 1."),
    (b"#ROSRECORD V1", "a ROS bag of format 1.x", "Bring it to format 2.0 with 'rosbag fix' of ROS 1."),
    (b"\x1f\x8b", "a gzip archive", "Unpack it first."),
    (b"PK\x03\x04", "a zip archive", "Unpack it first."),
    (_ZSTD_MAGIC, "a zstd archive", "Unpack it first."),
)
"""Formats that are recognised but not read: how the file begins, what it is, what to do."""

_CONFIGURATION = (".yaml", ".yml", ".param", ".params", ".parm")
_SNIFF_BYTES = 4096
_PIECE_BYTES = 1 << 20
_ZSTD_BYTES = 1 << 18
"""Enough for the first block of a zstd file, which unpacks as a whole."""
_TEXT_FORMAT = re.compile(rb"(?m)^FMT, ?\d+, ?\d+, ?\w+")
_MAVLINK_MARKERS = (0xFD, 0xFE)


def open_log(path: str | Path) -> Log:
    """Open a log with the reader that its first bytes ask for.

    Raises:
        LogError: no such file, a folder, no permission, an empty file, or content that no reader knows.
    """
    path = Path(path)
    return open_as(sniff(path), path)


def open_as(format: LogFormat, path: Path) -> Log:
    """Open a log whose format was told already. Raises LogError."""
    module, reader = READERS[format]
    log: Log = getattr(import_module(module), reader)(path)
    return log


def sniff(path: Path) -> LogFormat:
    """The format of a file, or of the recording in a folder, by its first bytes. Raises LogError as `open_log`."""
    head = _read_head(path)
    plain = _unpacked(path) if head.startswith(_ZSTD_MAGIC) else head
    for magic, ros_format in ROS_MAGIC:
        if plain.startswith(magic):
            return ros_format
    for magic, what, hint in UNREADABLE_MAGIC:
        if head.startswith(magic):
            raise _unreadable(path, what, hint)
    if head.startswith(b"ULog\x01\x12\x35"):
        return LogFormat.PX4_ULG
    # A DataFlash log declares its message types first; damage at its very start must not hide them.
    if b"\xa3\x95\x80" in head:
        return LogFormat.DATAFLASH_BIN
    if _TEXT_FORMAT.search(head):
        return LogFormat.DATAFLASH_TEXT
    if is_raw_mavlink(head):
        return LogFormat.MAVLINK_TLOG
    is_lone_packet = len(head) > 8 and head[0] == 0 and head[8] in _MAVLINK_MARKERS
    if is_lone_packet or any(_frame_is_followed(head, at + 8) for at in range(len(head) - 8) if head[at] == 0):
        return LogFormat.MAVLINK_TLOG
    raise LogError("Not a log of a known format.", hint=_what_then(path), where=str(path))


def is_raw_mavlink(head: bytes) -> bool:
    """Whether a file is a stream of MAVLink packets without the time stamps of a ground station (.rlog, .tlog.raw)."""
    return _frame_is_followed(head, 0, stamp=0)


def _what_then(path: Path) -> str:
    """What to do with a file that is no log."""
    if path.name == "metadata.yaml":
        return "Name the folder of the bag instead."
    if path.suffix.lower() in _CONFIGURATION:
        return "A configuration file goes with a log: --config FILE."
    return f"Readable are {READABLE}."


def is_recording(path: Path) -> bool:
    """Whether a file begins like a log or an archive, readable or not: what nobody wants overwritten."""
    try:
        return _read_head(path).startswith(tuple(magic for magic, *_ in UNREADABLE_MAGIC)) or bool(sniff(path))
    except LogError:
        return False


def _frame_is_followed(head: bytes, at: int, stamp: int = 8) -> bool:
    """Whether a MAVLink packet begins here, and after it and a stamp of this many bytes the next, or the file's end."""
    if at + 3 > len(head) or head[at] not in _MAVLINK_MARKERS:
        return False
    is_v2 = head[at] == 0xFD
    if is_v2 and head[at + 2] & ~1:
        return False
    end = at + head[at + 1] + (12 + 13 * head[at + 2] if is_v2 else 8)
    follows = end + stamp < len(head) and head[end + stamp] in _MAVLINK_MARKERS
    return follows or (len(head) < _SNIFF_BYTES and len(head) - 8 <= end <= len(head))


def _read_head(path: Path, size: int = _SNIFF_BYTES) -> bytes:
    if path.is_dir():
        from care_core.logs.recording import recording_at

        path = recording_at(path).files[0]
    try:
        if path.exists() and not path.is_file():  # reading a pipe could wait for ever
            raise LogError("This is no file but a pipe or a device.", hint="Save the log to a file.", where=str(path))
        with path.open("rb") as stream:
            head = stream.read(size)
            if head and not head.strip(b"\0"):
                stream.seek(_first_written(stream))
                head = stream.read(size)
                if not head:
                    hint = "Was the recorder switched off before it wrote?"
                    raise LogError("The file holds nothing but zeros.", hint=hint, where=str(path))
    except OSError as err:
        raise cannot_open(path, err) from err
    if not head:
        raise LogError("The file is empty.", hint="Was the recording stopped properly?", where=str(path))
    return head


def _first_written(stream: BinaryIO) -> int:
    """The byte from which on a file is more than zeros, with room for the zeros that a time stamp begins with: what
    was set aside for a log and never written, or lost. The file's end where there is none."""
    stream.seek(0)
    at = 0
    while piece := stream.read(_PIECE_BYTES):
        rest = piece.lstrip(b"\0")
        if rest:
            return max(at + len(piece) - len(rest) - 8, 0)
        at += len(piece)
    return at


def _unpacked(path: Path) -> bytes:
    """The first bytes of what a zstd file holds."""
    from care_core.logs.compression import unpack_head

    return unpack_head(_read_head(path, _ZSTD_BYTES))


def cannot_open(path: Path, err: OSError) -> LogError:
    if isinstance(err, FileNotFoundError):
        return LogError("No such file.", hint="Check the path.", where=str(path))
    if isinstance(err, PermissionError):
        return LogError("No permission to read the file.", hint="Check its owner and mode.", where=str(path))
    return LogError(f"Cannot read the file: {err.strerror or err}.", where=str(path))


def _unreadable(path: Path, what: str, hint: str) -> LogError:
    return LogError(
        f"This is {what}, which cannot be read yet.", hint=hint or f"Readable are {READABLE}.", where=str(path)
    )
