"""Unpacking, always with a bound on what comes out: a broken or hostile size never fills the memory or the disk."""

from __future__ import annotations

import bz2
import shutil
from collections.abc import Callable, Iterator
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import IO

from care_core import limits
from care_core.errors import LogError
from care_core.files import open_regular
from care_core.logs.file_windows import FileBytes

ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"

_BLOCK = 1 << 14
"""Packed bytes taken at a time: small, since a hostile block unpacks to thousands of times its size."""

_FRAME_BLOCK = 1 << 17
"""Bytes of a block of zstd at most, and mostly of lz4: nothing of a block comes out before its end."""

_AT_ONCE = 1 << 20
"""Bytes unpacked at a time of what is slow to unpack: 46 ms of bz2."""

DISK_MARGIN = 64 << 20
"""What is left free of the disk of temporary files."""


class CannotUnpackError(Exception):
    """Bytes that cannot be unpacked. Stays inside the readers."""


class Unpacker:
    """Unpacks the chunks and messages of a file in one pass over it, and no more of them than limits allow."""

    def __init__(self, file_size: int) -> None:
        self._most = limits.unpacked_bytes(file_size)
        self._left = self._most
        self._takes_parts = file_size > limits.WHOLE_BYTES

    @property
    def takes_parts(self) -> bool:
        """Whether the file is so large that a chunk is unpacked only as far as it is asked for."""
        return self._takes_parts

    def stretch(self, start: int, end: int, size: int, needed: int) -> tuple[int, int]:
        """About where the bytes of a chunk lie that are read to unpack the first `needed` of its `size`; 0: all."""
        if not self.takes_part(needed, size):
            return start, end
        return start, min(end, start + (end - start) * needed // size + _FRAME_BLOCK)

    def takes_part(self, needed: int, size: int) -> bool:
        """Whether the first `needed` bytes of a chunk of `size` are unpacked alone, since that is quicker."""
        return self._takes_parts and 0 < 2 * needed < size

    def head(self, compression: str, packed: FileBytes, start: int, end: int, wanted: int) -> bytes:
        """The first bytes, `wanted` at least where it has so many, of what lies packed between two places of a file.

        Raises:
            CannotUnpackError: as when called.
        """
        if wanted > limits.CHUNK_BYTES or wanted > self._left:
            raise CannotUnpackError(f"its chunks unpack to more than {limits.megabytes(self._most)}")
        plain = bytearray()
        try:
            unpack = _unpacking(compression)
            while start < end and len(plain) < wanted:
                plain += unpack(packed[start : min(start + _BLOCK, end)])
                start += _BLOCK
        except (OSError, RuntimeError, EOFError, ValueError, MemoryError) as err:
            raise CannotUnpackError(f"a {compression} chunk cannot be unpacked") from err
        self._left -= len(plain)
        return bytes(plain)

    def __call__(self, compression: str, data: bytes, size: int = 0) -> bytes:
        """Plain data; of data that was cut short, or broken in the middle, what comes before.

        Args:
            compression: bz2, lz4 or zstd.
            size: of the plain data, as the file says; 0 where it does not.

        Raises:
            CannotUnpackError: nothing could be unpacked, the compression is unknown, or a limit is reached.
        """
        unpackers = {"bz2": _unpack_bz2, "lz4": _unpack_lz4, "zstd": _unpack_zstd}
        if compression not in unpackers:
            raise CannotUnpackError(f"a chunk of unknown compression '{compression}'")
        if size > limits.CHUNK_BYTES:
            raise CannotUnpackError(f"a chunk that claims to be {_more_than(size, limits.CHUNK_BYTES)}")
        most = min(size or limits.CHUNK_BYTES, self._left)
        if most <= 0:
            raise CannotUnpackError(f"its chunks unpack to more than {limits.megabytes(self._most)}")
        try:
            plain = unpackers[compression](data, most)
        except (OSError, RuntimeError, EOFError, ValueError, MemoryError) as err:
            raise CannotUnpackError(f"a {compression} chunk cannot be unpacked") from err
        if not plain:
            raise CannotUnpackError(f"a {compression} chunk cannot be unpacked")
        self._left -= len(plain)
        if len(plain) == limits.CHUNK_BYTES > size:
            raise CannotUnpackError(f"a chunk that unpacks to {_more_than(0, limits.CHUNK_BYTES)}")
        return plain


def _more_than(size: int, most: int) -> str:
    claimed = f"{limits.megabytes(size)} large, " if size else ""
    return f"{claimed}more than the {limits.megabytes(most)} that are read"


class PlainFile:
    """A log file to read from: itself, or, of a zstd file, a plain copy in a temporary folder that goes with this."""

    def __init__(self, path: Path) -> None:
        """Unpack the file where need be. Raises LogError when it cannot be read or the disk has no room."""
        self.path = path
        self.is_cut = False
        try:
            with open_regular(path) as stream:
                if stream.read(len(ZSTD_MAGIC)) == ZSTD_MAGIC:
                    stream.seek(0)
                    self._unpack(stream)
        except OSError as err:
            raise LogError(f"Cannot read the log: {err.strerror or err}.", where=str(path)) from err

    def _unpack(self, packed: IO[bytes]) -> None:
        self._folder = TemporaryDirectory(prefix="care-")
        where, self.path = self.path, Path(self._folder.name) / self.path.stem
        self.is_cut = True
        left = most = limits.unpacked_bytes(where.stat().st_size)
        with self.path.open("wb") as target:
            for piece in _zstd_pieces(packed):
                self.is_cut = bool(piece)
                target.write(piece)
                left -= len(piece)
                if left < 0:
                    raise LogError(
                        f"The log unpacks to more than {limits.megabytes(most)}.",
                        hint="Unpack it with 'zstd -d' where there is room for it, and name the unpacked file.",
                        where=str(where),
                    )
                if shutil.disk_usage(self._folder.name).free < DISK_MARGIN:
                    raise LogError(
                        "There is no room to unpack the log.",
                        hint="Free some of the temporary folder, or set TMPDIR to a larger one.",
                        where=str(where),
                    )


def unpack_head(packed: bytes) -> bytes:
    """The first bytes of a zstd file whose own first bytes are given; empty where they do not suffice."""
    return next(_zstd_pieces(BytesIO(packed)), b"")


def _unpacking(compression: str) -> Callable[[bytes], bytes]:
    """What unpacks a stream piece by piece, with what each gives."""
    if compression == "lz4":
        from lz4.frame import LZ4FrameDecompressor  # type: ignore[import-untyped]

        frame = LZ4FrameDecompressor()
        return lambda piece: b"" if frame.eof else bytes(frame.decompress(piece))
    if compression == "zstd":
        import zstandard

        stream = zstandard.ZstdDecompressor().decompressobj()

        def decompress(piece: bytes) -> bytes:
            try:
                return b"" if stream.eof else stream.decompress(piece)
            except zstandard.ZstdError as err:
                raise ValueError("not zstd") from err

        return decompress
    if compression == "bz2":
        blocks = bz2.BZ2Decompressor()
        return lambda piece: b"" if blocks.eof else blocks.decompress(piece)
    raise CannotUnpackError(f"a chunk of unknown compression '{compression}'")


def _unpack_bz2(data: bytes, limit: int) -> bytes:
    """In pieces, between which an interruption is heeded: the largest chunk takes seconds."""
    blocks, plain = bz2.BZ2Decompressor(), bytearray()
    while len(plain) < limit and not blocks.eof:
        piece = blocks.decompress(b"" if plain else data, min(_AT_ONCE, limit - len(plain)))
        if not piece:
            break
        plain += piece
    return bytes(plain)


def _unpack_lz4(data: bytes, limit: int) -> bytes:
    from lz4.frame import LZ4FrameDecompressor

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
