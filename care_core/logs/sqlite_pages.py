"""Rows out of a damaged SQLite file, page by page: whatever leaf pages are there are read, in whatever tree they hang.

Source: sqlite.org/fileformat2.html. Only what a recorder writes is understood: tables with a row id, text in UTF-8.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from care_core.files import open_regular
from care_core.logs.file_windows import FileBytes

MAGIC = b"SQLite format 3\0"

_LEAF = 0x0D
_SIGN = 1 << 63
_AT_ONCE = 1 << 22
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
_INTEGER_LENGTHS = np.array([_INTEGER_SIZES.get(kind, -1) if kind else -1 for kind in range(256)])
"""By serial type, -1 for what is none."""
_FIRST_BLOB, _FIRST_TEXT = 12, 13
_LONGEST_HEAD = 64
"""Bytes from where a row begins to the end of its integers, and more."""


def promised_size(path: Path) -> int:
    """Bytes that a file should have, as its header says; 0 where the header is missing or not up to date."""
    with open_regular(path) as stream:
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

    def rows(self) -> Iterator[tuple[NDArray[np.int64], list[StoredRow]]]:
        """The rows of every table, some pages at a time: of those that begin as `_plain_rows` says row id, the two
        integers and the byte of the file, shape (n, 4), and the others; what is no row is passed over."""
        whole = len(self.log) // self.size * self.size
        for begin in range(0, whole, _AT_ONCE):
            size = min(_AT_ONCE, whole - begin)
            block = self.log[begin : begin + size + _LONGEST_HEAD].ljust(size + _LONGEST_HEAD, b"\0")
            there = np.frombuffer(block, np.uint8)
            cells = self._cells(there[:size], is_first=begin == 0)
            plain, others = _plain_rows(there, cells, self.size, len(self.log))
            plain[:, 3] += begin
            found = []
            for place in others.tolist():
                with suppress(BrokenCellError, IndexError):
                    found.append(self._row(block, place, begin))
            yield plain, found

    def row(self, place: int) -> StoredRow:
        """The row that begins at a byte of the file. Raises BrokenCellError or IndexError where none does."""
        begin = place - place % self.size
        return self._row(self.log[begin : begin + self.size], place - begin, begin)

    def _cells(self, block: NDArray[np.uint8], *, is_first: bool) -> NDArray[np.int64]:
        """Where rows begin in a block of pages, shape (n,)."""
        pages = np.arange(0, len(block), self.size)
        headers = pages.copy()
        headers[0] += _FIRST_PAGE_HEADER * is_first
        counts = _pairs(block, headers + 3)
        room = pages + self.size - headers - _PAGE_HEADER
        leaves = np.flatnonzero((block[headers] == _LEAF) & (_SMALLEST_CELL * counts <= room))
        counts = counts[leaves]
        ordinals = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
        inside = _pairs(block, np.repeat(headers[leaves] + _PAGE_HEADER, counts) + 2 * ordinals)
        return (np.repeat(pages[leaves], counts) + inside)[inside < self.size]

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

    def last_value(self, row: StoredRow) -> int | bytes | None:
        """The last column of a row; text as its bytes. Raises BrokenCellError."""
        payload = self._payload(row)
        if len(payload) < row.size:
            raise BrokenCellError("a row is cut short")
        kind = row.types[-1]
        return _value(kind, payload[row.size - _size(kind) :])

    def _row(self, block: bytes, pos: int, begin: int) -> StoredRow:
        """The row at a place of a block of pages, which begins at a byte of the file."""
        place, page = begin + pos, block[pos - pos % self.size : pos - pos % self.size + self.size]
        pos %= self.size
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


def _plain_rows(
    block: NDArray[np.uint8], cells: NDArray[np.int64], page_size: int, most: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Of rows that begin at cells, those of a key, two integers and a blob that lie as usual: row id, the integers and
    the cell, shape (n, 4); and the cells of the others. No row takes more than `most` bytes."""
    size, pos = _varints(block, cells)
    ids, start = _varints(block, pos)
    blob, pos = _varints(block, start + 4)
    head, key, first, second = (block[start + place] for place in range(4))
    sizes = _INTEGER_LENGTHS[first], _INTEGER_LENGTHS[second]
    end = pos + np.abs(sizes[0]) + np.abs(sizes[1])
    is_plain = (head == pos - start) & (key == 0) & (sizes[0] >= 0) & (sizes[1] >= 0)
    is_plain &= (blob >= _FIRST_BLOB) & (blob % 2 == 0) & (size == end - start + (blob - _FIRST_BLOB) // 2)
    is_plain &= (size <= most) & (ids >= 0) & (end <= cells - cells % page_size + page_size)
    pos, kinds = pos[is_plain], (first[is_plain], second[is_plain])
    numbers = _integers(block, pos, kinds[0]), _integers(block, pos + sizes[0][is_plain], kinds[1])
    return np.column_stack([ids[is_plain], *numbers, cells[is_plain]]), cells[~is_plain]


def _varints(block: NDArray[np.uint8], places: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The numbers at places, -1 where they are longer than five bytes, and where they end."""
    values, pos = np.zeros(len(places), np.int64), places.copy()
    goes_on = np.ones(len(places), bool)
    for _ in range(5):
        byte = block[pos]
        values = np.where(goes_on, values << 7 | byte & 0x7F, values)
        pos += goes_on
        goes_on &= byte >= 0x80
        if not goes_on.any():
            break
    return np.where(goes_on, -1, values), pos


def _integers(block: NDArray[np.uint8], places: NDArray[np.int64], kinds: NDArray[np.uint8]) -> NDArray[np.int64]:
    """The integers of some serial types that are stored at places."""
    stored = block[places[:, None] + np.arange(8)].view(">i8")[:, 0].astype(np.int64)
    values: NDArray[np.int64] = stored >> (64 - 8 * np.maximum(_INTEGER_LENGTHS[kinds], 1))
    return np.where(kinds >= 8, kinds.astype(np.int64) - 8, values)


def _pairs(block: NDArray[np.uint8], places: NDArray[np.int64]) -> NDArray[np.int64]:
    """The numbers of two bytes at places."""
    return block[places].astype(np.int64) << 8 | block[places + 1]


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
