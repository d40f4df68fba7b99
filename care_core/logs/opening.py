"""Open a log by what it holds, not by what it is called."""

from __future__ import annotations

import errno
import os
from importlib import import_module
from pathlib import Path
from typing import BinaryIO

from care_core.errors import LogError
from care_core.files import open_regular
from care_core.logs import formats
from care_core.logs.base import Log
from care_core.logs.formats import LogFormat

_ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"

UNREADABLE_MAGIC = (
    (b"#ROSBAG V1", "a ROS bag of format 1.x", "Bring it to format 2.0 with 'rosbag fix' of ROS 1."),
    (b"#ROSRECORD V1", "a ROS bag of format 1.x", "Bring it to format 2.0 with 'rosbag fix' of ROS 1."),
    (b"\x1f\x8b", "a gzip archive", "Unpack it first."),
    (b"PK\x03\x04", "a zip archive", "Unpack it first."),
    (_ZSTD_MAGIC, "a zstd archive", "Unpack it first."),
    (
        b"\x89MCAP0\n",
        "an MCAP recording whose line ends were changed on its way",
        "Copy it once more as binary: git or FTP took it for text.",
    ),
)
"""Formats that are recognised but not read: how the file begins, what it is, what to do."""

_CONFIGURATION = (".yaml", ".yml", ".param", ".params", ".parm")
_PIECE_BYTES = 1 << 20
_ZSTD_BYTES = 1 << 18
"""Enough for the first block of a zstd file, which unpacks as a whole."""


def open_log(path: str | Path) -> Log:
    """Open a log with the reader that its first bytes ask for.

    Raises:
        LogError: no such file, a folder, no permission, an empty file, or content that no reader knows.
    """
    path = Path(path)
    return open_as(sniff(path), path)


def open_as(format: LogFormat, path: Path) -> Log:
    """Open a log whose format was told already. Raises LogError."""
    module, reader = format.reader
    log: Log = getattr(import_module(module), reader)(path)
    return log


def sniff(path: Path) -> LogFormat:
    """The format of a file, or of the recording in a folder, by its first bytes. Raises LogError as `open_log`."""
    head = _read_head(path)
    is_packed = head.startswith(_ZSTD_MAGIC)
    plain = _unpacked(path) if is_packed else head
    for format in formats.FORMATS:
        if format.magic and plain.startswith(format.magic) and (format.may_be_packed or not is_packed):
            return format
    for magic, what, hint in UNREADABLE_MAGIC:
        if head.startswith(magic):
            raise _unreadable(path, what, hint)
    for format in formats.FORMATS:
        if format.looks_like is not None and format.looks_like(head):
            return format
    raise LogError("Not a log of a known format.", hint=_what_then(path), where=str(path))


def _what_then(path: Path) -> str:
    """What to do with a file that is no log."""
    if path.name == "metadata.yaml":
        return "Name the folder of the bag instead."
    if path.suffix.lower() in _CONFIGURATION:
        return "A configuration file goes with a log: --config FILE."
    return f"Readable are {formats.readable()}."


def is_recording(path: Path) -> bool:
    """Whether a file begins like a log or an archive, readable or not: what nobody wants overwritten."""
    try:
        return _read_head(path).startswith(tuple(magic for magic, *_ in UNREADABLE_MAGIC)) or bool(sniff(path))
    except LogError:
        return False


def _read_head(path: Path, size: int = formats.SNIFF_BYTES) -> bytes:
    if path.is_dir():
        from care_core.logs.recording import recording_at

        path = recording_at(path).files[0]
    try:
        if path.exists() and not path.is_file():  # reading a pipe could wait for ever
            raise LogError("This is no file but a pipe or a device.", hint="Save the log to a file.", where=str(path))
        with open_regular(path) as stream:
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
    at = _next_data(stream, 0)
    stream.seek(at)
    while piece := stream.read(_PIECE_BYTES):
        rest = piece.lstrip(b"\0")
        if rest:
            return max(at + len(piece) - len(rest) - 8, 0)
        at = _next_data(stream, at + len(piece))
        stream.seek(at)
    return at


def _next_data(stream: BinaryIO, at: int) -> int:
    """Where a file was written to from here on, its end where nowhere: of a hole of terabytes no byte is read."""
    if not hasattr(os, "SEEK_DATA"):
        return at
    handle = stream.fileno()
    here = os.lseek(handle, 0, os.SEEK_CUR)  # the stream's buffer counts on it
    try:
        return os.lseek(handle, at, os.SEEK_DATA)
    except OSError as err:
        return os.fstat(handle).st_size if err.errno == errno.ENXIO else at
    finally:
        os.lseek(handle, here, os.SEEK_SET)


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
        f"This is {what}, which cannot be read yet.",
        hint=hint or f"Readable are {formats.readable()}.",
        where=str(path),
    )
