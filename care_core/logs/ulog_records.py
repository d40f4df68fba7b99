"""The records of a ULog: where each lies, what it declares, and where the chain of them is broken.

A record is the length of its body (two bytes), a letter for its kind, and the body; there is no checksum. A message has
the length that its topic declares, so the places that look like such a message are found for a whole window at once,
and those of which each ends where the next begins are taken together. Everything else is looked at record by record.
Where a record's end is no place at which one can begin, the walk goes on at the next place from which several
follow each other. Source: the ULog file format, docs.px4.io/main/en/dev_log/ulog_file_format.html.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from care_core import limits
from care_core.logs import file_windows
from care_core.logs.file_windows import Bytes, FileArray, Offsets
from care_core.logs.ulog_formats import Format, Layout, Layouts, UnusableFormatError
from care_core.numbers import Bools
from care_core.records import Record, Struct, field
from care_core.run import Damage

FILE_HEADER = 16
"""Bytes: magic, version, and when logging began, in microseconds since the vehicle booted."""
HEADER = 3
MESSAGE_HEADER = HEADER + 2
"""Bytes ahead of the fields of a topic's message: the record's header and the message id."""
FLAGS, FORMAT, INFO, INFO_MULTIPLE, PARAMETER, DEFAULT = (ord(kind) for kind in "BFIMPQ")
SUBSCRIPTION, UNSUBSCRIPTION, DATA, TEXT, TAGGED_TEXT, SYNC, DROPOUT = (ord(kind) for kind in "ARDLCSO")
_SYNC_MAGIC = bytes((0x2F, 0x73, 0x13, 0x20, 0x25, 0x0C, 0xBB, 0x12))
_HAS_DEFAULTS, _HAS_APPENDED = 1, 1

_LENGTHS = {
    FLAGS: (40, 40), FORMAT: (4, 65_535), INFO: (4, 65_535), INFO_MULTIPLE: (5, 65_535), PARAMETER: (4, 600),
    DEFAULT: (5, 600), SUBSCRIPTION: (4, 300), UNSUBSCRIPTION: (2, 2), DATA: (3, 65_535), TEXT: (9, 4_000),
    TAGGED_TEXT: (11, 4_000), SYNC: (8, 8), DROPOUT: (2, 2),
}  # fmt: skip
"""Bytes of a body that a record of each kind can have."""
_LEAST = np.full(256, 65_535, np.uint16)
_MOST = np.zeros(256, np.uint16)
for _kind, (_low, _high) in _LENGTHS.items():
    _LEAST[_kind], _MOST[_kind] = _low, _high
_IS_KIND = _LEAST <= _MOST
_IS_LENGTH = tuple(zip(_LEAST.tolist(), _MOST.tolist(), strict=True))

_MORE = 1 << 13
"""Bytes behind a window that are looked at with it: a record that begins in it has its stamp there."""
_FURTHEST_STAMP = 4_000
_AHEAD, _FAR_AHEAD = 5, 50
"""So many records that can follow each other make a place where the walk goes on; so many are looked at together."""
_MAX_IDS = 1 << 16


class Topic(NamedTuple):
    """A topic that is logged: the messages of one `multi_id` of it."""

    name: str
    multi_id: int
    layout: Layout

    @property
    def channel(self) -> str:
        return f"{self.name}#{self.multi_id}" if self.multi_id else self.name


class Other(NamedTuple):
    """A record that is no message of a topic: the byte at which it begins, its kind, and its body."""

    byte: int
    kind: int
    body: bytes


class UlogContents(Record, eq=False):
    """What a walk over a file finds. Messages are in the order of the file."""

    start_us: int
    has_defaults: bool
    """Whether the log names the defaults of the parameters that differ from them."""
    topics: Sequence[Topic]
    places: Offsets
    """The byte at which each message begins, shape (n,)."""
    numbers: NDArray[np.uint16]
    """Which of the topics it is of, shape (n,)."""
    stamps_us: NDArray[np.uint64]
    """Its time, microseconds since the vehicle booted, shape (n,)."""
    others: Sequence[Other]
    logging_byte: int
    """Where the definitions end: a parameter behind it was changed in flight."""
    damage: Sequence[Damage]
    misfits: Sequence[int]
    """The bytes at which messages begin that fit no declaration."""


def read_contents(data: FileArray) -> UlogContents:
    """Walk over a file's records."""
    walk = _Walk(data)
    for low, piece in data.pieces(_MORE):
        walk.through(low, piece)
    return walk.contents()


class _Candidates(Struct, eq=False):
    """Places of a window that look like messages of a topic, by the declarations that were known."""

    at: Offsets
    """Bytes behind the window's first."""
    ends: Offsets
    numbers: NDArray[np.uint16]
    breaks: NDArray[np.intp]
    """Those behind which, by their length, the next does not begin."""
    is_record: Bools
    """Which of them the walk came to."""


class _Found(Struct):
    """What was found so far."""

    places: bytearray = field(default_factory=bytearray)
    numbers: bytearray = field(default_factory=bytearray)
    stamps: bytearray = field(default_factory=bytearray)
    loose: list[tuple[int, int]] = field(default_factory=list)
    """Messages that were looked at one by one: byte and topic."""
    others: list[Other] = field(default_factory=list)
    damage: list[Damage] = field(default_factory=list)
    misfits: list[int] = field(default_factory=list)
    logging_byte: int = -1


class _Walk:
    """A walk over the records, window by window."""

    def __init__(self, data: FileArray) -> None:
        self._data = data
        self._offset = np.dtype(np.int32 if len(data) < 1 << 31 else np.int64)
        self._found = _Found()
        self._formats: dict[str, Format] = {}
        self._layouts = Layouts(self._formats)
        self._topics: list[Topic] = []
        self._known: dict[tuple[str, int], int] = {}
        self._ids: dict[int, Topic] = {}
        self._removed: set[int] = set()
        self._declared: dict[tuple[int, int], int] = {}
        """Topic by message id and length of a body."""
        self._lengths = np.zeros(_MAX_IDS, np.uint16)
        self._topic_of = np.zeros(_MAX_IDS, np.uint16)
        self._stamp_at = np.zeros(limits.ULOG_TOPICS, np.int64)
        self._declarations = 0
        self._chain_end, self._chain_rows = 0, dict[int, int]()
        """What `_follow` found last, with the rows of its places."""
        self._resumes: tuple[int, int, list[int]] = (0, 0, [])
        self._window: tuple[int, int, memoryview] = (0, 0, memoryview(b""))
        """The bytes of the window that the walk is in, and between which of the file's these are."""
        self._pos = FILE_HEADER
        head = data.between(0, FILE_HEADER).tobytes()
        self._start_us = int.from_bytes(head[8:16], "little")
        self._has_defaults = False
        self._stops = [*self._read_flags(), len(data)]

    def contents(self) -> UlogContents:
        found = self._found
        places = np.frombuffer(found.places, self._offset)
        numbers, stamps = np.frombuffer(found.numbers, np.uint16), np.frombuffer(found.stamps, np.uint64)
        if found.loose:
            own = np.array([byte for byte, _ in found.loose], self._offset)
            topics = np.array([number for _, number in found.loose], np.uint16)
            own_stamps = np.array(
                [int.from_bytes(self._bytes(at := byte + int(self._stamp_at[number]), at + 8), "little")
                 for byte, number in found.loose], np.uint64,
            )  # fmt: skip
            places = np.concatenate((places, own))
            order = np.argsort(places, kind="stable")
            places = places[order]
            numbers, stamps = np.concatenate((numbers, topics))[order], np.concatenate((stamps, own_stamps))[order]
        logging = len(self._data) if found.logging_byte < 0 else found.logging_byte
        return UlogContents(
            self._start_us, self._has_defaults, self._topics, places, numbers, stamps, found.others, logging,
            found.damage, found.misfits,
        )  # fmt: skip

    def _bytes(self, low: int, high: int) -> bytes:
        first, last, piece = self._window
        if first <= low and high <= last:
            return bytes(piece[low - first : high - first])
        return self._data.between(low, high).tobytes()

    def _read_flags(self) -> list[int]:
        """The bytes at which data was appended (the file ahead of each may end inside a record), from the flags that
        come first."""
        head = self._bytes(FILE_HEADER, FILE_HEADER + HEADER + 40)
        if len(head) < HEADER + 40 or head[:HEADER] != bytes((40, 0, FLAGS)):
            return []
        compatible, incompatible = head[3:11], head[11:19]
        self._has_defaults = bool(compatible[0] & _HAS_DEFAULTS)
        if incompatible[0] & ~_HAS_APPENDED or any(incompatible[1:]):
            text = "the log says that only newer programs can read it: its values may be wrong"
            self._found.damage.append(Damage(text, FILE_HEADER))
        if not incompatible[0] & _HAS_APPENDED:
            return []
        offsets = sorted({int.from_bytes(head[at : at + 8], "little") for at in (19, 27, 35)} - {0})
        inside = [offset for offset in offsets if FILE_HEADER + len(head) <= offset < len(self._data)]
        if len(inside) < len(offsets):
            self._found.damage.append(Damage("data was appended beyond the end of the file", FILE_HEADER))
        return inside

    # --- a window

    def through(self, low: int, piece: Bytes) -> None:
        """Walk on to the end of a window that begins at a byte of the file, with what is behind it."""
        high = min(low + file_windows.WINDOW, len(self._data))
        self._window = low, low + len(piece), piece.data
        if low + len(piece) == len(self._data):
            piece = np.append(piece, np.zeros(8, np.uint8))
        candidates, known = None, (0, 0)
        while self._pos < high:
            if self._pos >= self._stops[0]:
                self._stops = [stop for stop in self._stops if stop > self._pos]
            at = self._pos - low
            if piece[at + 2] != DATA:
                self._pos = self._step(self._pos)
                continue
            if known != (self._declarations, self._stops[0]):
                self._keep(candidates, low, piece)
                candidates, known = self._candidates(low, piece, at), (self._declarations, self._stops[0])
            assert candidates is not None
            self._pos = self._run(candidates, at, low) or self._step(self._pos)
        self._keep(candidates, low, piece)

    def _candidates(self, low: int, piece: Bytes, begin: int) -> _Candidates:
        """Those that begin in the window, from a byte of it on."""
        end = min(file_windows.WINDOW, len(piece) - 8, self._stops[0] - low)
        at = np.flatnonzero(piece[begin + 2 : end + 2] == DATA) + begin
        pairs = _every(piece, "<u2")
        ids, length = pairs[at + HEADER], pairs[at]
        fits = (self._lengths[ids] == length) & (length > 0)
        at, ids = at[fits], ids[fits]
        ends = at + length[fits] + HEADER
        if len(ends) and ends[-1] + low > self._stops[0] - 65_535:
            whole = ends + low <= self._stops[0]
            at, ids, ends = at[whole], ids[whole], ends[whole]
        breaks = np.append(np.flatnonzero(at[1:] != ends[:-1]), len(at) - 1) if len(at) else np.empty(0, np.intp)
        return _Candidates(at, ends, self._topic_of[ids], breaks, np.zeros(len(at), bool))

    @staticmethod
    def _run(found: _Candidates, at: int, low: int) -> int | None:
        """Take the messages that follow each other from a byte of the window on; answers where the last of them ends,
        None where none begins here."""
        first = int(found.at.searchsorted(at))
        if first == len(found.at) or found.at[first] != at:
            return None
        last = int(found.breaks[found.breaks.searchsorted(first)])
        found.is_record[first : last + 1] = True
        return low + int(found.ends[last])

    def _keep(self, found: _Candidates | None, low: int, piece: Bytes) -> None:
        """Write down the messages that the walk came to."""
        if found is None:
            return
        at, numbers = found.at[found.is_record], found.numbers[found.is_record]
        # Of what is not in the window no stamp is asked: `_declare` takes none that is so far behind.
        stamps = _every(piece, "<u8")[at + self._stamp_at[numbers]]
        self._found.places += (at + low).astype(self._offset).tobytes()
        self._found.numbers += numbers.tobytes()
        self._found.stamps += stamps.tobytes()

    # --- record by record

    def _step(self, pos: int) -> int:
        """Take or leave the record at a byte; answers where the next begins."""
        stop = self._stops[0]
        if pos + HEADER > stop:
            return self._leave(pos, stop)
        length, kind, number = self._header(pos)
        over = pos + HEADER + length
        is_sound = _IS_LENGTH[kind][0] <= length <= _IS_LENGTH[kind][1] and over <= stop
        if kind == DATA and number not in self._declared:
            is_sound = False
            if self._mended(pos, number, over):
                return pos + HEADER + int(self._lengths[number[0]])
        follows = self._followed(over)
        # Where a topic's subscription is lost, its messages still hold the chain together.
        if follows and (is_sound or (kind == DATA and (follows == 2 or number[0] not in self._ids))):
            if not (kind == DATA and is_sound) and self._holds_messages(pos + HEADER, over):
                return self._leave(pos, self._resume(pos))
            self._take(pos, kind, over, number)
            return over
        resumed = self._resume(pos)
        if not _IS_KIND[kind] and follows == 2:  # of a newer logger, unless records lie in what would be its body
            return self._leave(pos, min(over, resumed))
        if is_sound and resumed >= over:  # what is broken lies behind it
            self._take(pos, kind, over, number)
            return over
        return self._leave(pos, resumed)

    def _header(self, pos: int) -> tuple[int, int, tuple[int, int]]:
        """Length, kind, and of a message its id with the length."""
        head = self._bytes(pos, pos + MESSAGE_HEADER)
        length = head[0] | head[1] << 8
        return length, head[2], (int.from_bytes(head[3:5], "little"), length)

    def _mended(self, pos: int, number: tuple[int, int], over: int) -> bool:
        """Whether a message has another length than its topic's, and the next record begins where it has that."""
        declared = int(self._lengths[number[0]])
        end = pos + HEADER + declared
        if not declared or end > self._stops[0] or self._followed(end) <= self._followed(over):
            return False
        self._found.damage.append(Damage("the length of a record is wrong", pos))
        self._found.loose.append((pos, int(self._topic_of[number[0]])))
        return True

    def _holds_messages(self, low: int, high: int) -> bool:
        """Whether messages of declared topics fill what would be the rest of a record's body: garbage may begin as a
        record does that ends where one of theirs does."""
        body = self._bytes(low, high)
        at = body.find(DATA, 2)
        while at >= 0:
            end = self._message_end(low + at - 2)
            if end == high or (end and end < high and self._message_end(end)):
                return True
            at = body.find(DATA, at + 1)
        return False

    def _message_end(self, pos: int) -> int:
        """The byte behind the message of a declared topic that begins at a byte, 0 where none does."""
        length, kind, number = self._header(pos)
        return pos + HEADER + length if kind == DATA and number in self._declared else 0

    def _followed(self, pos: int) -> int:
        """How sure it is that a record begins at a byte: 0 not, 1 several can follow each other from there, 2 one with
        the id and length of a topic, or the end, is among them."""
        row = self._chain_rows.get(pos)
        if row is None or not (self._chain_end or len(self._chain_rows) - row >= _AHEAD):
            self._chain_end, chain = self._follow(pos)
            self._chain_rows = {byte: row for row, byte in enumerate(chain)}
            row = 0
            if not self._chain_end and len(chain) < _AHEAD:
                return 0
        return self._chain_end or 1

    def _follow(self, pos: int) -> tuple[int, list[int]]:
        """What is sure of the end of the records that follow each other from a byte, and where they begin: 2 and 1 as
        `_followed`, 0 where no record follows the last of them or they are many."""
        stop = self._stops[0]
        chain: list[int] = []
        while len(chain) < _FAR_AHEAD:
            if pos == stop:
                return 2, chain
            if pos > stop:
                break
            if pos + HEADER > stop:
                return 1, chain
            length, kind, number = self._header(pos)
            if not _IS_LENGTH[kind][0] <= length <= _IS_LENGTH[kind][1]:
                break
            chain.append(pos)
            if kind == DATA and number in self._declared:
                return 2, chain
            pos += HEADER + length
            if pos > stop:
                return 1, chain  # the last one is cut
            if kind == SYNC and self._bytes(pos - 8, pos) == _SYNC_MAGIC:
                return 2, chain
        return 0, chain

    def _leave(self, low: int, high: int) -> int:
        """Bytes that are no record; answers where they end."""
        end = self._stops[0]
        left = high - low
        if high < end:
            text = f"{left} bytes are not readable records"
        elif left < HEADER or _IS_KIND[self._header(low)[1]]:
            text = f"cut in a record, {left} bytes of it are there"
        else:
            text = "what follows is no record"
        self._found.damage.append(Damage(text, low))
        return high

    def _take(self, pos: int, kind: int, over: int, number: tuple[int, int]) -> None:
        """Take a record that ends at a byte."""
        if kind in (SUBSCRIPTION, TEXT, TAGGED_TEXT, DATA) and self._found.logging_byte < 0:
            self._found.logging_byte = pos
        if kind == DATA:
            topic = self._declared.get(number)
            if topic is None:
                self._found.misfits.append(pos)
            else:
                self._found.loose.append((pos, topic))
        elif kind == UNSUBSCRIPTION:
            self._removed.add(number[0])
        elif kind == FORMAT:
            self._take_format(pos, self._bytes(pos + HEADER, over))
        elif kind == SUBSCRIPTION:
            self._take_subscription(pos, self._bytes(pos + HEADER, over))
        elif kind not in (SYNC, FLAGS):
            self._found.others.append(Other(pos, kind, self._bytes(pos + HEADER, over)))

    # --- declarations

    def _take_format(self, pos: int, body: bytes) -> None:
        format = Format.parse(body)
        if format is None:
            self._found.damage.append(Damage("a format cannot be read", pos))
        elif self._formats.setdefault(format.name, format) != format:
            self._found.damage.append(Damage(f"the format of {format.name} is declared again", pos))

    def _take_subscription(self, pos: int, body: bytes) -> None:
        multi_id, number = body[0], body[1] | body[2] << 8
        name = self._declared_name(pos, body[3:].rstrip(b"\0").decode("utf-8", "replace"))
        try:
            topic = Topic(name, multi_id, self._layouts.of(name))
        except UnusableFormatError as err:
            self._found.damage.append(Damage(f"no message of {name} can be read: {err}", pos))
            return
        stamp_at = topic.layout.stamp_offset
        if stamp_at is None or stamp_at > _FURTHEST_STAMP:
            self._found.damage.append(Damage(f"no message of {name} can be read: it has no time", pos))
        elif number in self._ids and number not in self._removed:
            if self._ids[number] != topic:
                text = f"message id {number} ({self._ids[number].channel}) is declared again as {topic.channel}"
                self._found.damage.append(Damage(text, pos))
        elif self._declarations == limits.ULOG_TOPICS:
            self._found.damage.append(Damage(f"more than {limits.ULOG_TOPICS} topics", pos))
        else:
            self._declare(number, topic, MESSAGE_HEADER + stamp_at)

    def _declared_name(self, pos: int, name: str) -> str:
        """The name of a format: of one that nobody declares, what differs from it in one character."""
        if name in self._formats:
            return name
        near = [one for one in self._formats if len(one) == len(name)
                and sum(a != b for a, b in zip(one, name, strict=True)) == 1]  # fmt: skip
        if len(near) != 1:
            return name
        self._found.damage.append(Damage(f"topic {name} is not declared: read as {near[0]}", pos))
        return near[0]

    def _declare(self, number: int, topic: Topic, stamp_at: int) -> None:
        """Messages with an id are those of a topic from here on."""
        own = self._known.setdefault((topic.name, topic.multi_id), len(self._topics))
        if own == len(self._topics):
            self._topics.append(topic)
        self._removed.discard(number)
        self._ids[number] = topic
        for length in (topic.layout.size, topic.layout.size_unpadded):  # some loggers write the padding at the end
            self._declared[number, length + 2] = own
            self._lengths[number] = length + 2
        self._topic_of[number], self._stamp_at[own] = own, stamp_at
        self._declarations += 1

    # --- damage

    def _resume(self, pos: int) -> int:
        """The first byte behind a place where the walk can go on: the end where there is none."""
        stop, low = self._stops[0], pos + 1
        while low < stop:
            first, last, starts = self._resumes
            if not first <= low < last:
                first, last = low, min(low + file_windows.WINDOW, stop)
                starts = self._starts(first, last)
                self._resumes = first, last, starts
            row = bisect_right(starts, low - 1)
            if row < len(starts):
                return starts[row]
            low = last
        return stop

    def _starts(self, low: int, high: int) -> list[int]:
        """The bytes of a stretch at which a record can begin that others follow."""
        stop = self._stops[0]
        piece = np.append(self._data.between(low, min(high + _MORE, stop)), np.zeros(8, np.uint8))
        at = np.flatnonzero(_IS_KIND[piece[2:-6]])
        kinds, pairs = piece[at + 2], _every(piece, "<u2")
        length = pairs[at]
        fits = (_LEAST[kinds] <= length) & (length <= _MOST[kinds])
        at, kinds, length = at[fits], kinds[fits], length[fits]
        is_message = (kinds == DATA) & (self._lengths[pairs[at + HEADER]] == length)
        ends = at + HEADER + length
        is_last = ends + low == stop
        ends = np.minimum(ends, len(piece))
        begins = np.zeros(len(piece) + 1, bool)
        begins[at] = True
        sure = is_message & (begins[ends] | is_last)
        for _ in range(_AHEAD):
            following = np.zeros_like(begins)
            following[at] = is_last | begins[ends]
            begins = following
        return [start + low for start in at[(sure | begins[at]) & (at + low < high)].tolist()]


def _every(piece: Bytes, kind: str) -> NDArray[Any]:
    """A view of the number that is stored at every byte of a window."""
    dtype = np.dtype(kind)
    found: NDArray[Any] = np.ndarray((len(piece) - dtype.itemsize + 1,), dtype, piece.data, 0, (1,))
    return found


def each_of(contents: UlogContents) -> Iterator[tuple[Topic, Offsets, NDArray[np.uint64]]]:
    """Each topic with messages, where they are and their times, in the order of the subscriptions."""
    order = np.argsort(contents.numbers, kind="stable")
    bounds = np.cumsum(np.bincount(contents.numbers, minlength=len(contents.topics))).tolist()
    places, stamps = contents.places[order], contents.stamps_us[order]
    low = 0
    for topic, high in zip(contents.topics, bounds, strict=True):
        if high > low:
            yield topic, places[low:high], stamps[low:high]
        low = high
