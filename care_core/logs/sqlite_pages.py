"""Rows out of a damaged SQLite file, page by page: whatever leaf pages are there are read, in whatever tree they hang.

Source: sqlite.org/fileformat2.html. Only what a recorder writes is understood: tables with a row id, text in UTF-8.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from care_core.logs.mapped import FileBytes

MAGIC = b"SQLite format 3\0"

_LEAF = 0x0D
_SIGN = 1 << 63
_AT_ONCE = 1 << 20
"""Bytes that are looked through at a time: whole pages."""
_FIRST_PAGE_HEADER = 100
_PAGE_HEADER = 8
_PAGE_SIZES = tuple(1 << power for power in range(9, 17))
_USUAL_PAGE_SIZE = 4096
_MOST_COLUMNS = 12
_SMALLEST_CELL = 8
"""Bytes of a row on its page, with the two that say where it lies."""
_SHARED = 2
"""So many times the bytes of a file may be in its rows: pages that were given up are still there."""
_INTEGER_SIZES = {0: 0, 1: 1, 2: 2, 3: 3, 4: 4, 5: 6, 6: 8, 8: 0, 9: 0}
_FIRST_BLOB, _FIRST_TEXT = 12, 13


def promised_size(path: Path) -> int:
    """Bytes that a file should have, as its header says; 0 where the header is missing or not up to date."""
    with path.open("rb") as stream:
        head = stream.read(_FIRST_PAGE_HEADER)
    if len(head) < _FIRST_PAGE_HEADER or head[24:28] != head[92:96]:
        return 0
    return _page_size(head) * int.from_bytes(head[28:32], "big")


def _page_size(head: bytes | FileBytes) -> int:
    size = int.from_bytes(head[16:18], "big")
    size = 65536 if size == 1 else size
    return size if size in _PAGE_SIZES else _USUAL_PAGE_SIZE


class BrokenCellError(Exception):
    """Bytes that are no row. Stays inside the reader."""


class StoredRow(NamedTuple):
    """A row of some table: its id, the columns' serial types, and where its payload begins."""

    id: int
    types: tuple[int, ...]
    place: int
    """The byte of the file at which it begins."""
    size: int
    head: int
    """Bytes of the payload before the first column."""
    local: bytes
    """What its page holds of the payload, and maybe more."""

    def numbers(self) -> list[int | None]:
        """The columns before the first text or blob, which lie in the row's own page."""
        values: list[int | None] = []
        pos = self.head
        for kind in self.types:
            if kind >= _FIRST_BLOB:
                break
            size = _size(kind)
            value = _value(kind, self.local[pos : pos + size])
            values.append(value if isinstance(value, int) else None)
            pos += size
        return values


class Pages:
    """The pages of a SQLite file."""

    def __init__(self, log: FileBytes) -> None:
        self.log = log
        self.size = _page_size(log)
        self.usable = self.size - (log.byte(20) if len(log) > _FIRST_PAGE_HEADER else 0)
        self._left = _SHARED * len(log)

    def rows(self) -> Iterator[StoredRow]:
        """Every row of every table, in the order of the pages; what is no row is passed over."""
        whole = len(self.log) // self.size * self.size
        for begin in range(0, whole, _AT_ONCE):
            block = self.log[begin : min(begin + _AT_ONCE, whole)]
            kinds = np.frombuffer(block, np.uint8)[:: self.size] == _LEAF
            kinds[0] |= begin == 0  # the file's own header comes first there
            for page in np.flatnonzero(kinds).tolist():
                yield from self._rows_of(block[page * self.size : (page + 1) * self.size], begin + page * self.size)

    def row(self, place: int) -> StoredRow:
        """The row that begins at a byte of the file. Raises BrokenCellError or IndexError where none does."""
        begin = place - place % self.size
        return self._row(self.log[begin : begin + self.size], place - begin, begin)

    def _rows_of(self, page: bytes, begin: int) -> Iterator[StoredRow]:
        header = _FIRST_PAGE_HEADER if begin == 0 else 0
        first = header + _PAGE_HEADER
        count = int.from_bytes(page[header + 3 : header + 5], "big")
        if page[header] != _LEAF or first + _SMALLEST_CELL * count > self.size:
            return
        for (place,) in struct.iter_unpack(">H", page[first : first + 2 * count]):
            try:
                yield self._row(page, place, begin)
            except (BrokenCellError, IndexError):
                continue

    def values(self, row: StoredRow) -> list[int | bytes | None]:
        """The columns of a row; text as its bytes. Raises BrokenCellError."""
        payload = self._payload(row)
        values: list[int | bytes | None] = []
        pos = row.head
        for kind in row.types:
            size = _size(kind)
            piece = payload[pos : pos + size]
            if len(piece) < size:
                raise BrokenCellError("a row is cut short")
            values.append(_value(kind, piece))
            pos += size
        return values

    def _row(self, page: bytes, pos: int, begin: int) -> StoredRow:
        place = begin + pos
        size, pos = _varint(page, pos)
        rowid, start = _varint(page, pos)
        head, pos = _varint(page, start)
        if not 0 < head <= min(size, 9 * _MOST_COLUMNS):
            raise BrokenCellError("a row's header is broken")
        types, length = _types(page[pos : start + head])
        if size > len(self.log) or head + length != size:
            raise BrokenCellError("a row's header is broken")
        rowid -= (rowid & _SIGN) << 1
        return StoredRow(rowid, types, place, size, head, page[start : start + size])

    def _payload(self, row: StoredRow) -> bytes:
        """A row's payload, gathered over its overflow pages, whose chain may run in circles."""
        self._left -= row.size
        if self._left < 0:
            raise BrokenCellError("the rows are larger than the file")
        most = self.usable - 35
        if row.size <= most:
            return row.local
        least = (self.usable - 12) * 32 // 255 - 23
        local = least + (row.size - least) % (self.usable - 4)
        local = local if local <= most else least
        pieces = [row.local[:local]]
        left = row.size - local
        following = int.from_bytes(row.local[local : local + 4], "big")
        while left > 0:
            base = (following - 1) * self.size
            if following < 2 or base + self.size > len(self.log):
                raise BrokenCellError("a row is cut short")
            pieces.append(self.log[base + 4 : base + min(4 + left, self.usable)])
            left -= self.usable - 4
            following = int.from_bytes(self.log[base : base + 4], "big")
        return b"".join(pieces)


def _varint(page: bytes, pos: int) -> tuple[int, int]:
    """A number of up to nine bytes and where it ends. Raises IndexError."""
    value = 0
    for place in range(pos, pos + 8):
        byte = page[place]
        value = value << 7 | byte & 0x7F
        if byte < 0x80:
            return value, place + 1
    return value << 8 | page[pos + 8], pos + 9


@lru_cache(maxsize=1024)
def _types(header: bytes) -> tuple[tuple[int, ...], int]:
    """The serial types that a row's header lists, and the bytes that its columns take. Raises BrokenCellError."""
    types, pos = [], 0
    while pos < len(header):
        kind, pos = _varint(header, pos)
        types.append(kind)
    if len(types) > _MOST_COLUMNS:
        raise BrokenCellError("a row's header is broken")
    return tuple(types), sum(map(_size, types))


def _size(kind: int) -> int:
    if kind >= _FIRST_BLOB:
        return (kind - _FIRST_BLOB) // 2
    if kind not in _INTEGER_SIZES:
        raise BrokenCellError("a column of a kind that no recorder writes")
    return _INTEGER_SIZES[kind]


def _value(kind: int, piece: bytes) -> int | bytes | None:
    if kind >= _FIRST_BLOB:
        return piece
    if kind == 0:
        return None
    return kind - 8 if kind >= 8 else int.from_bytes(piece, "big", signed=True)  # 8 and 9 stand for 0 and 1


def is_text(kind: int) -> bool:
    """Whether a serial type is text."""
    return kind >= _FIRST_TEXT and kind % 2 == 1


def is_blob(kind: int) -> bool:
    """Whether a serial type is a blob."""
    return kind >= _FIRST_BLOB and kind % 2 == 0
