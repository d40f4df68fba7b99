"""Unpacking, always with a bound on what comes out: a broken or hostile size never fills the memory or the disk."""

from __future__ import annotations

import bz2
import shutil
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import IO

from care_core.errors import LogError

ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"

MOST_BYTES = 1 << 30
"""No chunk or message of a log is larger."""

_BLOCK = 1 << 14
"""Packed bytes taken at a time: small, since a hostile block unpacks to thousands of times its size."""

_DISK_MARGIN = 64 << 20


class CannotUnpackError(Exception):
    """Bytes that cannot be unpacked. Stays inside the readers."""


def unpack(compression: str, data: bytes, limit: int = MOST_BYTES) -> bytes:
    """Plain data of at most `limit` bytes; of data that was cut short, or broken in the middle, what comes before.

    Args:
        compression: bz2, lz4 or zstd.

    Raises:
        CannotUnpackError: nothing could be unpacked, or the compression is unknown.
    """
    unpackers = {"bz2": _unpack_bz2, "lz4": _unpack_lz4, "zstd": _unpack_zstd}
    if compression not in unpackers:
        raise CannotUnpackError(f"a chunk of unknown compression '{compression}'")
    try:
        plain = unpackers[compression](data, min(limit, MOST_BYTES))
    except (OSError, RuntimeError, EOFError, ValueError, MemoryError) as err:
        raise CannotUnpackError(f"a {compression} chunk cannot be unpacked") from err
    if limit and not plain:
        raise CannotUnpackError(f"a {compression} chunk cannot be unpacked")
    return plain


class PlainFile:
    """A log file to read from: itself, or, of a zstd file, a plain copy in a temporary folder that goes with this."""

    def __init__(self, path: Path) -> None:
        """Unpack the file where need be. Raises LogError when it cannot be read or the disk has no room."""
        self.path = path
        self.is_cut = False
        try:
            with path.open("rb") as stream:
                if stream.read(len(ZSTD_MAGIC)) == ZSTD_MAGIC:
                    stream.seek(0)
                    self._unpack(stream)
        except OSError as err:
            raise LogError(f"Cannot read the log: {err.strerror or err}.", where=str(path)) from err

    def _unpack(self, packed: IO[bytes]) -> None:
        self._folder = TemporaryDirectory(prefix="care-")
        where, self.path = self.path, Path(self._folder.name) / self.path.stem
        self.is_cut = True
        with self.path.open("wb") as target:
            for piece in _zstd_pieces(packed):
                self.is_cut = bool(piece)
                target.write(piece)
                if shutil.disk_usage(self._folder.name).free < _DISK_MARGIN:
                    raise LogError(
                        "There is no room to unpack the log.",
                        hint="Free some of the temporary folder, or set TMPDIR to a larger one.",
                        where=str(where),
                    )


def unpack_head(packed: bytes) -> bytes:
    """The first bytes of a zstd file whose own first bytes are given; empty where they do not suffice."""
    return next(_zstd_pieces(BytesIO(packed)), b"")


def _unpack_bz2(data: bytes, limit: int) -> bytes:
    return bz2.BZ2Decompressor().decompress(data, limit)


def _unpack_lz4(data: bytes, limit: int) -> bytes:
    from lz4.frame import LZ4FrameDecompressor  # type: ignore[import-untyped]

    return bytes(LZ4FrameDecompressor().decompress(data, limit))


def _unpack_zstd(data: bytes, limit: int) -> bytes:
    """In one call where the data is sound and says its size, else block by block."""
    import zstandard

    try:
        if 0 < zstandard.frame_content_size(data) <= limit:
            return zstandard.ZstdDecompressor().decompress(data)
    except zstandard.ZstdError:
        pass
    plain = bytearray()
    for piece in _zstd_pieces(BytesIO(data)):
        plain += piece
        if len(plain) >= limit:
            break
    return bytes(plain[:limit])


def _zstd_pieces(packed: IO[bytes]) -> Iterator[bytes]:
    """Plain pieces up to the end, told by an empty piece, or up to where the data breaks off, without one."""
    import zstandard

    frame = zstandard.ZstdDecompressor().decompressobj()
    is_complete = False
    while block := packed.read(_BLOCK):
        while block:
            try:
                piece = frame.decompress(block)
            except zstandard.ZstdError:
                return
            if piece:
                yield piece
            block, is_complete = frame.unused_data, frame.eof
            if is_complete:
                frame = zstandard.ZstdDecompressor().decompressobj()
    if is_complete:
        yield b""
