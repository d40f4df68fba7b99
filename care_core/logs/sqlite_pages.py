"""Rows out of a damaged SQLite file, page by page: whatever leaf pages are there are read, in whatever tree they hang.

Source: sqlite.org/fileformat2.html. Only what a recorder writes is understood: tables with a row id, text in UTF-8.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from care_core.logs.mapped import FileBytes

MAGIC = b"SQLite format 3\0"

_LEAF = 0x0D
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


@dataclass(frozen=True, slots=True)
class StoredRow:
    """A row of some table: its id, the columns' serial types, and where its payload begins."""

    id: int
    types: tuple[int, ...]
    page: int
    start: int
    size: int
    head: int
    """Bytes of the payload before the first column."""


class Pages:
    """The pages of a SQLite file."""

    def __init__(self, log: FileBytes) -> None:
        self.log = log
        self.size = _page_size(log)
        self.usable = self.size - (log.byte(20) if len(log) > _FIRST_PAGE_HEADER else 0)
        self._left = _SHARED * len(log)

    def rows(self) -> Iterator[StoredRow]:
        """Every row of every table, in the order of the pages; what is no row is passed over."""
        for page in range(len(self.log) // self.size):
            base = page * self.size
            header = base + (_FIRST_PAGE_HEADER if page == 0 else 0)
            if self.log.byte(header) != _LEAF:
                continue
            count = int.from_bytes(self.log[header + 3 : header + 5], "big")
            first = header + _PAGE_HEADER
            if first + _SMALLEST_CELL * count > base + self.size:
                continue
            places = self.log[first : first + 2 * count]
            for place in range(0, 2 * count, 2):
                try:
                    yield self._row(page, base + int.from_bytes(places[place : place + 2], "big"))
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

    def numbers(self, row: StoredRow) -> list[int | None]:
        """The columns before the first text or blob, which lie in the row's own page."""
        values: list[int | None] = []
        pos = row.start + row.head
        for kind in row.types:
            if kind >= _FIRST_BLOB:
                break
            size = _size(kind)
            value = _value(kind, self.log[pos : pos + size])
            values.append(value if isinstance(value, int) else None)
            pos += size
        return values

    def _row(self, page: int, pos: int) -> StoredRow:
        size, pos = self._varint(pos)
        rowid, start = self._varint(pos)
        head, pos = self._varint(start)
        if not 0 < head <= min(size, 9 * _MOST_COLUMNS) or pos < page * self.size:
            raise BrokenCellError("a row's header is broken")
        types = []
        while pos < start + head:
            kind, pos = self._varint(pos)
            types.append(kind)
        if size > len(self.log) or len(types) > _MOST_COLUMNS or head + sum(_size(kind) for kind in types) != size:
            raise BrokenCellError("a row's header is broken")
        return StoredRow(rowid, tuple(types), page, start, size, head)

    def _payload(self, row: StoredRow) -> bytes:
        """A row's payload, gathered over its overflow pages, whose chain may run in circles."""
        self._left -= row.size
        if self._left < 0:
            raise BrokenCellError("the rows are larger than the file")
        most = self.usable - 35
        if row.size <= most:
            return self.log[row.start : row.start + row.size]
        least = (self.usable - 12) * 32 // 255 - 23
        local = least + (row.size - least) % (self.usable - 4)
        local = local if local <= most else least
        pieces = [self.log[row.start : row.start + local]]
        left = row.size - local
        following = int.from_bytes(self.log[row.start + local : row.start + local + 4], "big")
        while left > 0:
            base = (following - 1) * self.size
            if following < 2 or base + self.size > len(self.log):
                raise BrokenCellError("a row is cut short")
            pieces.append(self.log[base + 4 : base + min(4 + left, self.usable)])
            left -= self.usable - 4
            following = int.from_bytes(self.log[base : base + 4], "big")
        return b"".join(pieces)

    def _varint(self, pos: int) -> tuple[int, int]:
        value = 0
        for place in range(8):
            byte = self.log.byte(pos + place)
            value = value << 7 | byte & 0x7F
            if byte < 0x80:
                return value, pos + place + 1
        return value << 8 | self.log.byte(pos + 8), pos + 9


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
