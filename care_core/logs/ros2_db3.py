"""ROS 2 bags in SQLite (.db3). Times are the recorder's; the file, and what lies beside it, is never written to."""

from __future__ import annotations

import errno
import os
import shutil
import sqlite3
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from itertools import chain
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import local
from typing import Any, Protocol
from weakref import finalize

import numpy as np
from numpy.typing import NDArray

from care_core.errors import LogError
from care_core.files import open_regular
from care_core.logs import formats
from care_core.logs.compression import DISK_MARGIN, ZSTD_MAGIC, CannotUnpackError, PlainFile, Unpacker
from care_core.logs.file_windows import opened
from care_core.logs.message_index import Places
from care_core.logs.recording import recording_at
from care_core.logs.ros_log import Connection, Flaw, Message, RosLog
from care_core.logs.ros_metadata import Metadata, parse_metadata
from care_core.logs.sqlite_pages import MAGIC, BrokenCellError, Pages, StoredRow, is_blob, is_text, promised_size
from care_core.records import Struct, field

_WHAT = "a SQLite file"
_SOUND = " AND ".join(f"typeof({column}) = 'integer'" for column in ("id", "topic_id", "timestamp"))
_FETCHED = 10_000
"""Rows without data that are fetched at a time."""
_ASKED = 50_000
"""Rows that one statement names, which may be a megabyte long: a table whose ids are no key is passed seldom."""
_CACHED_KIB = 24 << 10
"""Pages that SQLite keeps: all small messages of a short recording, which lie between the pictures."""
_JOURNAL_HEAD, _FRAME_HEAD = 32, 24
_PAGES = [1 << power for power in range(9, 17)]
"""Bytes of a write-ahead log's header and of each frame's, and of pages (sqlite.org/fileformat2.html, 4.1)."""
_NONE = np.empty(0, np.int64)
_STEPS = 100_000
"""Of SQLite, which walks a whole table by itself, between two chances to be interrupted: some ms."""
_NOT_SOUND = (sqlite3.Error, UnicodeDecodeError)
"""What the sqlite3 module raises for a damaged file; names in a broken schema need not be text."""
_SMALLEST_ROW, _SHARED = 8, 2
"""No row takes fewer bytes, so a damaged tree whose rows are twice as large as the file runs in circles."""
_COLUMNS = {
    "topics": {"id", "name", "type", "serialization_format"},
    "messages": {"id", "topic_id", "timestamp", "data"},
}
"""What a bag has; a column that is computed is not listed by SQLite, and so no bag's."""

_MESSAGE_COLUMNS, _DEFINITION_COLUMNS, _DISTRO_COLUMNS, _METADATA_COLUMNS = 4, 5, 2, 3
_LANGUAGES = ("ros2msg", "ros2idl", "unknown")


class Ros2Db3(RosLog):
    """A ROS 2 bag of one or more SQLite files."""

    def __init__(self, path: Path) -> None:
        """Read topics and record times. Raises LogError when it is no ROS 2 bag."""
        recording = recording_at(path)
        parts = [Db3Part(file, is_alone=len(recording.files) == 1) for file in recording.files]
        super().__init__(
            path, formats.ROS2_DB3, parts,
            metadata=recording.metadata, missing=recording.missing, notes=recording.notes,
        )  # fmt: skip


class Db3Part:
    """One SQLite file, fulfilling `Part`."""

    def __init__(self, path: Path, *, is_alone: bool = True) -> None:
        self.path = path
        self._file = PlainFile(path)
        self.flaws: dict[str, Flaw] = {}
        database = _Database(self._file.path, stays_open=is_alone)
        self._store: _Store = database
        try:
            database.check_size()
            contents = database.contents()
        except _NOT_SOUND as err:
            contents = self._salvage(str(err)).contents()
        if not contents.is_bag:
            raise LogError(
                "A SQLite file, but no ROS 2 bag.", hint="Name a .db3 of 'ros2 bag record'.", where=str(path)
            )
        if self._file.is_cut:
            self.flaws["zstd"] = Flaw("the zstd file is cut short or broken")
        self.connections: Mapping[int, Connection] = contents.connections()
        known = [number for number in contents.messages if number in self.connections]
        self._ids = {number: contents.messages[number][:, 0] for number in known}
        self.times_ns = {number: contents.messages[number][:, 1] for number in known}
        self.metadata = Metadata.merged(
            [Metadata(distro=contents.distro), *(parse_metadata(text) for text in contents.metadata)]
        )

    def messages(self, wanted: Places) -> Iterator[Message]:
        """The wanted messages; behind a place that SQLite cannot read, what the pages hold."""
        unpack = Unpacker(self._file.path.stat().st_size)
        for number, time_ns, data in self._rows(wanted):
            if number not in wanted:  # another row of the same id
                continue
            if not isinstance(data, bytes):
                self.flaws.setdefault("row", Flaw("a message is not there", time_ns=time_ns))
                continue
            try:
                plain = unpack("zstd", data) if data.startswith(ZSTD_MAGIC) else data
            except CannotUnpackError as err:
                self.flaws.setdefault("packed", Flaw(f"a packed message: {err}", time_ns=time_ns))
            else:
                yield number, time_ns, plain, 0, len(plain)

    def _rows(self, wanted: Places) -> Iterator[list[Any]]:
        """Topic id, record time and data of the wanted messages."""
        ids = np.unique(np.concatenate([_NONE, *(self._ids[number][places] for number, places in wanted.items())]))
        last = np.iinfo(np.int64).min
        try:
            for row, *message in self._store.rows(ids):
                last = row
                yield message
            return
        except _NOT_SOUND as err:
            salvaged = self._salvage(str(err))
        for _, *message in salvaged.rows(ids[ids > last]):
            yield message

    def _salvage(self, why: str) -> _Store:
        self._store = pages = _SalvagedPages(self._file.path)
        size = self._file.path.stat().st_size
        promised = promised_size(self._file.path)
        if size < promised:
            self.flaws["cut"] = Flaw(f"{promised - size} bytes are missing", size, cuts=True)
        else:
            self.flaws.setdefault("broken", Flaw(f"the database is damaged ({why}); what its pages hold is read"))
        return pages


class _Contents(Struct, eq=False):
    """What a bag's tables hold beside the messages' data; `topics` has name, type and serialisation by id."""

    topics: dict[int, tuple[str, str, str]] = field(default_factory=dict)
    definitions: dict[str, tuple[str, str]] = field(default_factory=dict)
    """Language and text by type."""
    metadata: list[str] = field(default_factory=list)
    distro: str = ""
    messages: dict[int, NDArray[np.int64]] = field(default_factory=dict)
    """Row id and record time in ns by topic id, of shape (n, 2), in the order of row ids."""
    is_bag: bool = True

    def connections(self) -> dict[int, Connection]:
        made = {}
        for number, (name, kind, encoding) in self.topics.items():
            language, definition = self.definitions.get(kind, ("", ""))
            made[number] = Connection(name, kind, definition, encoding, language if definition else "")
        return made

    def take_messages(self, table: NDArray[np.int64]) -> None:
        """Take row id, topic id and record time of messages, of shape (n, 3), in the order of row ids."""
        ordered = table[np.argsort(table[:, 1], kind="stable")]
        numbers, firsts = np.unique(ordered[:, 1], return_index=True)
        each = np.split(ordered[:, ::2], firsts[1:])
        self.messages = dict(zip(numbers.tolist(), each, strict=False))


_DataRow = tuple[int, int, int, Any]
"""Row id, topic id, record time in ns, data."""


class _Store(Protocol):
    def contents(self) -> _Contents: ...

    def rows(self, ids: NDArray[np.int64]) -> Iterator[_DataRow]:
        """The messages of these row ids, ascending; raises one of `_NOT_SOUND` behind the last that can be read."""


class _Database:
    """A sound SQLite file, read with SQLite; every method raises one of `_NOT_SOUND` for another.

    Where it stays open, so do the pages that were read last: not those of hundreds of files of one recording.
    """

    def __init__(self, path: Path, *, stays_open: bool = False) -> None:
        self.path = path
        self._stays_open, self._own = stays_open, local()
        self.is_own = False
        self.size = path.stat().st_size
        journal = path.with_name(f"{path.name}-wal")
        if journal.is_file() and journal.stat().st_size:
            self._copy_with(journal)

    def _copy_with(self, journal: Path) -> None:
        """SQLite writes to the files when it takes the last transactions from a journal, so it gets copies."""
        self._folder = TemporaryDirectory(prefix="care-")
        copy = Path(self._folder.name) / self.path.name
        try:
            if shutil.disk_usage(self._folder.name).free < self.size + DISK_MARGIN:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            shutil.copyfile(self.path, copy)
            self.size += _copy_frames(journal, copy.with_name(journal.name))
        except OSError as err:
            raise LogError(
                f"The log's journal cannot be copied: {err.strerror or err}.",
                hint="Free some of the temporary folder, or set TMPDIR to a larger one.",
                where=str(journal),
            ) from err
        self.path, self.is_own = copy, True

    def check_size(self) -> None:
        """Raise sqlite3.Error for a file that is cut short: SQLite reads zeros for the missing rest of a page."""
        if not self.is_own and self.path.stat().st_size < promised_size(self.path):
            raise sqlite3.DatabaseError("it is cut short")

    def contents(self) -> _Contents:
        with self._connected() as database:
            columns = {
                name: [column for _, column, *_ in database.execute(f"PRAGMA table_info({name})")]
                for name in ("topics", "messages", "message_definitions", "metadata", "schema")
            }
            if not columns["topics"] or not columns["messages"]:
                return _Contents(is_bag=False)
            if not all(needed <= set(columns[name]) for name, needed in _COLUMNS.items()):
                raise sqlite3.DatabaseError("its tables lack columns")

            def rows(query: str) -> Iterator[Any]:
                return self._bounded(database.execute(query))

            contents = _Contents()
            query = "SELECT id, name, type, serialization_format FROM topics"
            contents.topics = {row: (str(a), str(b), str(c)) for row, a, b, c in rows(query)}
            if columns["message_definitions"]:
                query = "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
                contents.definitions = {str(a): (str(b), str(c)) for a, b, c in rows(query)}
            if columns["metadata"]:
                contents.metadata = [str(text) for (text,) in rows("SELECT metadata FROM metadata ORDER BY id")]
            if "ros_distro" in columns["schema"]:
                contents.distro = "".join(str(name) for (name,) in rows("SELECT ros_distro FROM schema"))
            contents.take_messages(self._heads(database))
            return contents

    def rows(self, ids: NDArray[np.int64]) -> Iterator[_DataRow]:
        with self._connected() as database:
            for first in range(0, len(ids), _ASKED):
                places = ", ".join(map(str, ids[first : first + _ASKED].tolist()))
                query = f"SELECT id, topic_id, timestamp, data FROM messages WHERE id IN ({places}) AND {_SOUND}"
                yield from self._bounded(database.execute(f"{query} ORDER BY id"))

    def _heads(self, database: sqlite3.Connection) -> NDArray[np.int64]:
        """Row id, topic id and record time of every message, shape (n, 3), in the order of row ids.

        The last come first, so that the pages of the first are still there when messages are read in their order.
        """
        asked = database.execute(f"SELECT id, topic_id, timestamp FROM messages WHERE {_SOUND} ORDER BY id DESC")
        left = _SHARED * self.size // _SMALLEST_ROW
        found = [np.empty((0, 3), np.int64)]
        while rows := asked.fetchmany(_FETCHED):
            left -= len(rows)
            if left < 0:
                raise sqlite3.DatabaseError("its tree runs in circles")
            found.append(np.fromiter(chain.from_iterable(rows), np.int64, 3 * len(rows)).reshape(-1, 3))
        return np.concatenate(found)[::-1]

    def _bounded(self, rows: Iterable[Any]) -> Iterator[Any]:
        left = _SHARED * self.size
        for row in rows:
            left -= _SMALLEST_ROW + sum([len(value) for value in row if isinstance(value, (bytes, str))])
            if left < 0:
                raise sqlite3.DatabaseError("its tree runs in circles")
            yield row

    @property
    def _kept(self) -> sqlite3.Connection:
        """The connection of this thread. Two threads on one would wait for each other: SQLite holds its lock while it
        asks Python whether to go on, and Python its own while it waits for that of SQLite."""
        if not hasattr(self._own, "database"):
            self._own.database = self._connect()
            finalize(self, self._own.database.close)
        database: sqlite3.Connection = self._own.database
        return database

    def _connect(self) -> sqlite3.Connection:
        mode = "" if self.is_own else "?mode=ro&immutable=1"
        uri = f"{self.path.resolve().as_uri()}{mode}"
        database = sqlite3.connect(uri, uri=True, check_same_thread=False)  # the last of the app's threads closes it
        database.execute(f"PRAGMA cache_size = -{_CACHED_KIB}")
        database.set_authorizer(_authorised)
        database.text_factory = lambda raw: raw.decode("utf-8", "replace")
        database.set_progress_handler(lambda: 0, _STEPS)
        return database

    @contextmanager
    def _connected(self) -> Iterator[sqlite3.Connection]:
        database = self._kept if self._stays_open else self._connect()
        try:
            yield database
        except sqlite3.OperationalError as err:
            if str(err) == "interrupted":  # all that SQLite says of what the handler met
                raise KeyboardInterrupt from err
            raise
        finally:
            if not self._stays_open:
                database.close()


def _copy_frames(journal: Path, copy: Path) -> int:
    """Copy what SQLite reads of a journal, up to the first frame of another writing, and answer its bytes: behind that
    lies what was there before, or a hole as large as somebody wanted. Raises OSError."""
    with open_regular(journal) as source, copy.open("wb") as target:
        head = source.read(_JOURNAL_HEAD)
        page = int.from_bytes(head[8:12], "big")
        if page not in _PAGES:
            return 0
        target.write(head)
        left = shutil.disk_usage(copy.parent).free - DISK_MARGIN
        while len(frame := source.read(_FRAME_HEAD + page)) == _FRAME_HEAD + page and frame[8:16] == head[16:24]:
            left -= len(frame)
            if left < 0:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            target.write(frame)
        return target.tell()


def _authorised(action: int, what: str | None, name: str | None, _database: str | None, inside: str | None) -> int:
    """Allow SQLite to read plain tables; a view or a recursion that stands for one computes without end."""
    is_plain = inside is None and (
        action in (sqlite3.SQLITE_SELECT, sqlite3.SQLITE_READ)
        or (action == sqlite3.SQLITE_PRAGMA and what == "table_info")
        or (action == sqlite3.SQLITE_FUNCTION and name == "typeof")
    )
    return sqlite3.SQLITE_OK if is_plain else sqlite3.SQLITE_DENY


class _SalvagedPages:
    """A damaged SQLite file, read page by page; rows are told apart by what their columns are."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._heads = np.empty((0, 4), np.int64)
        """Row id, topic id, record time and the byte of the file of each message, the first of its row id."""

    def contents(self) -> _Contents:
        contents = _Contents()
        found = [np.empty((0, 4), np.int64)]
        with opened(self.path, MAGIC, _WHAT) as log:
            pages = Pages(log)
            for plain, others in pages.rows():
                found.append(plain)
                for row in others:
                    message = _message_head(row)
                    if message is not None:
                        found.append(np.array([[row.id, *message, row.place]], np.int64))
                        continue
                    with suppress(BrokenCellError):
                        _take_described(contents, row, pages.values(row))
        table = np.concatenate(found)
        table = table[np.lexsort(table.T[::-1])]
        is_new = np.ones(len(table), bool)  # what was given up is still there
        is_new[1:] = np.any(np.diff(table[:, :3], axis=0) != 0, axis=1)
        contents.take_messages(table[is_new, :3])
        table = table[np.lexsort((table[:, 3], table[:, 0]))]
        self._heads = table[np.unique(table[:, 0], return_index=True)[1]]
        contents.is_bag = bool(contents.topics)
        return contents

    def rows(self, ids: NDArray[np.int64]) -> Iterator[_DataRow]:
        if not len(self._heads):
            self.contents()
        with opened(self.path, MAGIC, _WHAT) as log:
            pages = Pages(log)
            for *message, place in self._heads[np.isin(self._heads[:, 0], ids)].tolist():
                try:
                    data = pages.last_value(pages.row(place))
                except BrokenCellError:
                    data = None
                yield *message, data


def _message_head(row: StoredRow) -> tuple[int, int] | None:
    """Topic id and record time of a row of `messages`, None for a row of another table."""
    if len(row.types) != _MESSAGE_COLUMNS or not is_blob(row.types[-1]) or row.types[0] != 0:
        return None
    _, *numbers = row.numbers()
    if len(numbers) != 2 or numbers[0] is None or numbers[1] is None:
        return None
    return numbers[0], numbers[1]


def _take_described(contents: _Contents, row: StoredRow, values: list[int | bytes | None]) -> None:
    """Take a row of `topics`, `message_definitions`, `metadata` or `schema`."""
    texts = [value.decode("utf-8", "replace") if isinstance(value, bytes) else "" for value in values]
    if not row.types or not is_text(row.types[-1]) or row.types[0] != 0:
        return
    if len(texts) == _DEFINITION_COLUMNS and texts[2] in _LANGUAGES:
        contents.definitions.setdefault(texts[1], (texts[2], texts[3]))
    elif len(texts) >= _MESSAGE_COLUMNS and all(is_text(kind) for kind in row.types[1:]):
        contents.topics.setdefault(row.id, (texts[1], texts[2], texts[3]))
    elif len(texts) == _METADATA_COLUMNS:
        contents.metadata.append(texts[-1])
    elif len(texts) == _DISTRO_COLUMNS:
        contents.distro = texts[-1]
