"""A ROS recording, whatever files it is made of: what its channels hold, decoded into tables, with its damage.

The files (`Part`) know where messages lie; this module knows what they mean.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from datetime import datetime, timezone
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from care_core import limits
from care_core.logs import formats
from care_core.logs.base import Channel, Table, Wanted
from care_core.logs.cdr_message import CdrDecoder
from care_core.logs.file_windows import FileBytes
from care_core.logs.formats import LogFormat
from care_core.logs.json_message import json_decoder
from care_core.logs.message_index import MessageIndex, Places
from care_core.logs.ros1_message import message_decoder
from care_core.logs.ros_message import Buffer, Decoder, MalformedMessageError, short_name
from care_core.logs.ros_metadata import Metadata
from care_core.logs.ros_settings import setting_fields, settings_in
from care_core.logs.ros_types import cdr_types
from care_core.numbers import Floats
from care_core.records import Record, Struct, field, replace
from care_core.run import Damage, Setting
from care_core.text import log_time

_EPOCH_OF_ROS = datetime(2005, 1, 1, tzinfo=timezone.utc)
"""No recording is older: an earlier time comes from a simulated clock."""

_SECOND_NS = 1_000_000_000
_DAY_NS = 86_400 * _SECOND_NS
_STRAY_SHARE = 0.01
"""So few messages, more than a day from all others, carry broken times rather than a clock that was set."""

_ROWS = 4096
"""Decoded rows kept as Python objects before they become arrays."""

_STACKS = (
    ("move_base", ("move_base_msgs/MoveBaseActionGoal",), ("/move_base/parameter_updates",)),
    ("nav2", ("nav2_msgs/BehaviorTreeLog",), ("/navigate_to_pose/_action/status", "/behavior_tree_log")),
)
"""Name of a stack, and the types or topics that only it has."""

Message = tuple[int, int, Buffer, int, int]
"""Connection number, record time in ns, and where the message lies: buffer, begin, end."""


class Connection(Record):
    """A publisher's side of a topic; the same topic may have several, even of different types."""

    topic: str
    type: str
    definition: str
    encoding: str = "ros1"
    """How messages are serialised: `ros1` and `cdr` are decoded."""
    language: str = ""
    """What the definition is written in, where there is a choice: `ros2msg` or `ros2idl`."""
    publisher: str = ""
    """The node that sends it; empty where the recording does not say."""


class Flaw(Record):
    """What is broken in a part, at which byte, at which record time; `cuts`: nothing after it is known.

    Attributes:
        until_ns: the last record time of what is cut off, where the file says it.
    """

    what: str
    byte: int | None = None
    time_ns: int | None = None
    cuts: bool = False
    until_ns: int | None = None


class BrokenRecordError(Exception):
    """Bytes that are no record. Stays inside the reader of a container."""


Source = bytes | FileBytes
"""What a container's records are read from: an unpacked chunk, or the file itself."""


def piece_of(source: Source, pos: int, end: int) -> tuple[bytes, int, int]:
    """Where a message lies, as `Message` tells it: in the chunk that holds it, or alone."""
    return (source, pos, end) if isinstance(source, bytes) else (source[pos:end], 0, end - pos)


def check_room(left: int) -> None:
    """Raise BrokenRecordError where an index names more bytes of a chunk than it has: the same ones again and again."""
    if left < 0:
        raise BrokenRecordError("the messages of a chunk lie over one another")


class Part(Protocol):
    """One file of a recording."""

    @property
    def path(self) -> Path: ...

    @property
    def connections(self) -> Mapping[int, Connection]: ...

    @property
    def times_ns(self) -> Mapping[int, NDArray[np.int64]]:
        """Record times per connection that has messages, in the order of the file."""

    @property
    def flaws(self) -> Mapping[str, Flaw]:
        """What is broken, each place once; reading may find more."""

    @property
    def metadata(self) -> Metadata:
        """What the file itself says of the recording."""

    def messages(self, wanted: Places) -> Iterator[Message]:
        """The wanted messages, in any order of the connections."""


class _Broken(Record):
    """Messages of a topic that cannot be decoded: why the first one cannot, when it was, how many there are."""

    why: str
    time_ns: int | None
    count: int


_DECODED = ("ros1", "cdr", "json")
"""Encodings of messages."""
_OF_ROS = {"ros1", "cdr"}
"""Encodings of ROS alone; JSON may be anybody's, of types with a slash it is ROS's."""


_NUMBERS = frozenset((
    "x", "y", "z", "w", "stamp", "voltage", "current", "charge", "percentage", "level",
    "angle_min", "angle_max", "angle_increment", "range_min", "range_max",
))  # fmt: skip
_LISTS = frozenset(("ranges", "transforms", "status_list", "poses"))


class RosLog:
    """A recording of one or more files, fulfilling `care_core.logs.base.Log`.

    `t` of a table, and every field that is a ROS time (`header.stamp`), count seconds from the first message's
    record time; a stamp that was never set is nan. Several publishers of a topic come in one table, in time
    order; where their types differ, a field that one lacks is nan (numbers) or None.
    """

    def __init__(
        self,
        path: Path,
        kind: LogFormat,
        parts: Sequence[Part],
        *,
        metadata: Metadata | None = None,
        missing: Sequence[Flaw] = (),
        notes: Mapping[str, str] | None = None,
    ) -> None:
        """Take the parts in the order of recording.

        Args:
            metadata: of the whole recording, where a file beside it holds it.
            missing: files that the recording should have and has not.
            notes: facts about the files.
        """
        self.path = path
        self.format = kind
        self._parts = parts
        own = [part.metadata if len(parts) == 1 else part.metadata.of_one_file() for part in parts]
        self._metadata = Metadata.merged([*own, *([metadata] if metadata else [])])
        self._missing = missing
        self._notes = notes or {}
        self._broken: dict[str, _Broken] = {}
        self._broken_settings: Mapping[str, _Broken] = {}
        every = [times for part in parts for times in part.times_ns.values()]
        self._low_ns, self._high_ns, self._strays = _believable(every)

    @property
    def start(self) -> str | None:
        """ISO 8601 UTC time of the first message, None for a simulated clock."""
        if not _EPOCH_OF_ROS.timestamp() <= self._low_ns / 1e9 < _DAY_NS:
            return None
        return datetime.fromtimestamp(self._low_ns / 1e9, timezone.utc).isoformat(timespec="seconds")

    @property
    def duration_s(self) -> float:
        return (self._high_ns - self._low_ns) / 1e9

    @property
    def damage(self) -> tuple[Damage, ...]:
        """What the parts lack, and what could not be unpacked or decoded by the reads so far."""
        found = [self._damage(flaw, part) for part in self._parts for flaw in part.flaws.values()]
        found += [Damage(flaw.what, flaw.byte) for flaw in self._missing]
        count, promised = self._count, self._metadata.message_count
        if promised and count < promised and not found:
            found.append(Damage(f"{count} of the {promised} messages that were recorded are there"))
        found += self._clock
        for topic, broken in {**self._broken_settings, **self._broken}.items():
            times = f"{broken.count} messages" if broken.count else "its messages"
            found.append(
                Damage(f"{topic}: {times} cannot be decoded: {broken.why}", None, self._seconds(broken.time_ns))
            )
        return tuple(found)

    @property
    def facts(self) -> Mapping[str, str]:
        """`ros` (1 or 2), unless no message is encoded as ROS does, `stack` where it can be told, `distro`, what the
        recorder noted, and undecoded encodings."""
        every = [connection for part in self._parts for connection in part.connections.values()]
        types = {short_name(connection.type) for connection in every}
        topics = {connection.topic for connection in every}
        encodings = {connection.encoding for connection in every}
        facts = {}
        if self.format is not formats.MCAP or not encodings or encodings & _OF_ROS or any("/" in one for one in types):
            facts["ros"] = "1" if self.format is formats.ROS1_BAG or encodings == {"ros1"} else "2"
        stack = next((name for name, own, names in _STACKS if types & set(own) or topics & set(names)), None)
        if stack:
            facts["stack"] = stack
        if self._metadata.distro:
            facts["distro"] = self._metadata.distro
        for encoding, names in sorted(self._undecodable().items()):
            facts[f"not decoded ({encoding})"] = ", ".join(sorted(names))
        return {**facts, **self._metadata.notes(), **self._notes}

    def channels(self) -> tuple[Channel, ...]:
        by_topic: dict[str, tuple[dict[str, None], list[NDArray[np.int64]]]] = {}
        for part in self._parts:
            for number, connection in sorted(part.connections.items()):
                types, times = by_topic.setdefault(connection.topic, ({}, []))
                types[connection.type] = None
                if number in part.times_ns:
                    times.append(self._kept(part.times_ns[number]))
        return tuple(_channel(topic, types, times) for topic, (types, times) in sorted(by_topic.items()))

    def times(self) -> Mapping[str, Floats]:
        """Per topic the record times of its messages, s, in order. Nothing is decoded."""
        found: dict[str, list[NDArray[np.int64]]] = {}
        for part in self._parts:
            for number, connection in part.connections.items():
                own = found.setdefault(connection.topic, [])
                if number in part.times_ns:
                    own.append(self._kept(part.times_ns[number]))
        none = np.empty(0, np.int64)
        return {topic: (np.sort(np.concatenate([none, *own])) - self._low_ns) / 1e9 for topic, own in found.items()}

    def publishers(self) -> Mapping[str, frozenset[str]]:
        """Per topic the nodes that send it; none where the recording does not say."""
        found: dict[str, set[str]] = {}
        for part in self._parts:
            for connection in part.connections.values():
                found.setdefault(connection.topic, set()).update({connection.publisher} - {""})
        return {topic: frozenset(nodes) for topic, nodes in found.items()}

    def read(self, wanted: Wanted, at_most: Mapping[str, int] | None = None) -> Mapping[str, Table]:
        """Decode the wanted fields in one pass; see the class for times, `compile_decoder` for values.

        Args:
            at_most: per topic how many messages do; one with more gives every second, third, ... of each publisher.
        """
        self._broken.clear()
        pieces: dict[str, list[_Piece]] = {}
        kinds: dict[str, dict[str, bool]] = {}
        for part in self._parts:
            decoders = self._decoders(part, wanted)
            for number, decoder in decoders.items():
                topic = part.connections[number].topic
                kinds.setdefault(topic, {}).update(zip(decoder.paths, decoder.is_number, strict=True))
            for number, gathered in self._gather(part, decoders, at_most or {}).items():
                pieces.setdefault(part.connections[number].topic, []).extend(gathered.pieces())
        for topic, found in kinds.items():
            kinds[topic] = {
                path: kind for path, kind in found.items() if _is_as_named(path, kind, pieces.get(topic, ()))
            }
        return {topic: _table(kinds[topic], pieces.get(topic, []), self._low_ns) for topic in wanted if topic in kinds}

    def sampled_times(self, topic: str, at_most: int) -> Floats:
        """Record times, s, of the messages of a topic that `read` decodes where it may decode so many of it."""
        times = [
            part.times_ns[number][self._wanted(part, number, {topic: at_most})]
            for part in self._parts
            for number, connection in part.connections.items()
            if connection.topic == topic and number in part.times_ns
        ]
        return (np.concatenate([np.empty(0, np.int64), *times]) - self._low_ns) / 1e9

    def settings(self) -> Mapping[str, tuple[Setting, ...]]:
        """Every value of every parameter that the log tells.

        `<namespace>/<parameter>` for dynamic_reconfigure, `<node>.<parameter>` for `/parameter_events` and for
        parameters that the recorder was given (`custom_data`) or that `care record` wrote beside the recording;
        booleans as 0 or 1, lists as text.
        """
        return self._settings

    @cached_property
    def _settings(self) -> Mapping[str, tuple[Setting, ...]]:
        types = {c.topic: short_name(c.type) for part in self._parts for c in part.connections.values()}
        fields = setting_fields(types)
        told = settings_in(types, self.read(fields) if fields else {}, self._metadata.settings())
        self._broken_settings = dict(self._broken)
        return told

    def _gather(
        self, part: Part, decoders: Mapping[int, Decoder], at_most: Mapping[str, int]
    ) -> Mapping[int, _Gathered]:
        gathered = {number: _Gathered(decoder) for number, decoder in decoders.items()}
        wanted = {number: self._wanted(part, number, at_most) for number in decoders if number in part.times_ns}
        if not wanted:
            return gathered
        with_lists = {number for number, decoder in decoders.items() if not all(decoder.is_number)}
        left = most = limits.messages(part.path.stat().st_size)
        for number, time_ns, buffer, pos, end in part.messages(wanted):
            try:
                values = decoders[number].decode(buffer, pos, end)
                if number in with_lists:
                    left -= max((len(value) for value in values if isinstance(value, list)), default=0)
                    if left < 0:
                        raise MalformedMessageError(f"its lists hold more than {most} messages")
                gathered[number].add(time_ns, values)
            except MalformedMessageError as err:
                self._note_broken(part.connections[number].topic, str(err), time_ns)
        return gathered

    def _wanted(self, part: Part, number: int, at_most: Mapping[str, int]) -> NDArray[np.intp]:
        """Which messages of a publisher are decoded, by their places among its record times."""
        times_ns = part.times_ns[number]
        most = at_most.get(part.connections[number].topic, 0)
        stride = -(-len(times_ns) * len(self._parts) // most) if most > 0 else 1
        return np.flatnonzero((times_ns >= self._low_ns) & (times_ns <= self._high_ns))[::stride]

    def _decoders(self, part: Part, wanted: Wanted) -> dict[int, Decoder]:
        """A decoder per connection that has wanted fields. Publishers of one type share it."""
        made: dict[Any, Decoder] = {}
        decoders: dict[int, Decoder] = {}
        for number, connection in part.connections.items():
            fields = tuple(wanted.get(connection.topic, ()))
            if not fields:
                continue
            key = (connection.type, connection.definition, connection.encoding, fields)
            try:
                if key not in made:
                    if len(made) >= limits.TOPIC_DEFINITIONS:
                        raise MalformedMessageError(f"more than {limits.TOPIC_DEFINITIONS} definitions are asked for")
                    made[key] = self._decoder(part, number, fields)
            except MalformedMessageError as err:
                self._note_broken(connection.topic, str(err), None)
                continue
            if made[key].paths:
                decoders[number] = made[key]
        return decoders

    def _decoder(self, part: Part, number: int, fields: Sequence[str]) -> Decoder:
        one = part.connections[number]
        if one.encoding == "ros1":
            return message_decoder(one.type, one.definition, fields, self._low_ns)
        if one.encoding == "json":
            return json_decoder(_first(part, number), fields, self._low_ns)
        if one.encoding != "cdr":
            raise MalformedMessageError(f"they are {one.encoding or 'of no named encoding'}")
        types, wide = cdr_types(one.type, one.definition, one.language, self._metadata.distro, _first(part, number))
        return CdrDecoder(one.type, types, fields, self._low_ns, wide)

    def _note_broken(self, topic: str, why: str, time_ns: int | None) -> None:
        known = self._broken.get(topic, _Broken(why, time_ns, 0))
        self._broken[topic] = _Broken(known.why, known.time_ns, known.count + (time_ns is not None))

    def _undecodable(self) -> Mapping[str, set[str]]:
        """Topics by encoding that is not decoded."""
        topics: dict[str, set[str]] = {}
        for part in self._parts:
            for connection in part.connections.values():
                if connection.encoding not in _DECODED:
                    topics.setdefault(connection.encoding or "no named encoding", set()).add(connection.topic)
        return topics

    @cached_property
    def _count(self) -> int:
        return sum(len(times) for part in self._parts for times in part.times_ns.values())

    def _kept(self, times_ns: NDArray[np.int64]) -> NDArray[np.int64]:
        return times_ns[(times_ns >= self._low_ns) & (times_ns <= self._high_ns)]

    def _seconds(self, time_ns: int | None) -> float | None:
        return None if time_ns is None else (time_ns - self._low_ns) / 1e9

    def _damage(self, flaw: Flaw, part: Part) -> Damage:
        where = f"{part.path.name}: " if len(self._parts) > 1 else ""
        if not flaw.cuts:
            return Damage(where + flaw.what, flaw.byte, self._seconds(flaw.time_ns))
        own = [self._kept(times) for times in part.times_ns.values()]
        end_s = (max((int(times.max()) for times in own if len(times)), default=self._low_ns) - self._low_ns) / 1e9
        whole_s = self._metadata.duration_s
        least_s = self._seconds(flaw.until_ns)
        of = ""
        if whole_s and whole_s > end_s:
            of = f" of about {log_time(whole_s, 0)}"
        elif least_s and least_s > end_s:
            of = f" of at least {log_time(least_s, 0)}"
        what = f"{where}read to {log_time(end_s)}{of}, cut at byte {flaw.byte}: {flaw.what}"
        return Damage(what, flaw.byte, end_s)

    @cached_property
    def _clock(self) -> tuple[Damage, ...]:
        """Where the clock that stamped the messages was set, as far as the stamps tell."""
        found = []
        if self._strays:
            found.append(Damage(f"{self._strays} messages with impossible times are left out"))
        every = [self._kept(times) for part in self._parts for times in part.times_ns.values()]
        if not every:
            return tuple(found)
        ordered = np.sort(np.concatenate(every))
        gaps = np.diff(ordered)
        if len(gaps) and gaps.max() > _DAY_NS:
            at = int(ordered[gaps.argmax()])
            text = f"the clock jumps: no message for {gaps.max() / _DAY_NS:.1f} days"
            found.append(Damage(text, None, self._seconds(at), is_whole=True))
        found += self._steps_back()
        return tuple(found)

    def _steps_back(self) -> Iterator[Damage]:
        """The largest step back of a publisher's record times that is beyond what buffering does."""
        worst_ns, topic, at = -_SECOND_NS, "", 0
        for part in self._parts:
            for number, times in part.times_ns.items():
                kept = self._kept(times)
                steps = np.diff(kept)
                if len(steps) and int(steps.min()) < worst_ns:
                    worst_ns, topic = int(steps.min()), part.connections[number].topic
                    at = int(kept[steps.argmin()])
        if topic:
            text = f"messages were sorted by time: up to {-worst_ns / 1e9:.1f} s out of order ({topic})"
            yield Damage(text, None, self._seconds(at), is_whole=True)


class _Piece(Record, eq=False):
    """Decoded messages of one connection: record times in ns, and a column per path."""

    times_ns: NDArray[np.int64]
    columns: Mapping[str, NDArray[Any]]


class _Gathered(Struct, eq=False):
    """Decoded messages of one connection as they come."""

    decoder: Decoder
    times_ns: list[int] = field(default_factory=list)
    rows: list[list[Any]] = field(default_factory=list)
    done: list[_Piece] = field(default_factory=list)

    def add(self, time_ns: int, values: list[Any]) -> None:
        self.times_ns.append(time_ns)
        self.rows.append(values)
        if len(self.rows) >= _ROWS:
            self.pieces()

    def pieces(self) -> list[_Piece]:
        """What was added so far, as arrays."""
        if self.rows:
            self.done.append(_Piece(np.array(self.times_ns, np.int64), _columns(self.decoder, self.rows)))
            self.times_ns, self.rows = [], []
        return self.done


def timed(flaws: Mapping[str, Flaw], index: MessageIndex) -> dict[str, Flaw]:
    """The flaws of a file with times: a place that has none is as late as the messages that lie before it."""
    return {
        key: replace(flaw, time_ns=index.last_ns_before(flaw.byte))
        if flaw.time_ns is None and flaw.byte is not None
        else flaw
        for key, flaw in flaws.items()
    }


def _first(part: Part, number: int) -> bytes:
    """The bytes of a connection's first message, none where it has none."""
    count = len(part.times_ns.get(number, ()))
    first, last = 0, 1  # the first is mostly there: few are asked for until one is
    while first < count:
        for _, _, buffer, pos, end in part.messages({number: np.arange(first, min(last, count))}):
            return buffer[pos:end]
        first, last = last, 2 * last
    return b""


def _believable(every: Sequence[NDArray[np.int64]]) -> tuple[int, int, int]:
    """First and last believable record time in ns, and how many messages lie outside.

    A flipped bit in one time would stretch the log over years. Times more than a day away from nearly all others
    are not believed; where no such crowd exists, all are.
    """
    if not every:
        return 0, 0, 0
    ordered = np.sort(np.concatenate(every))
    edges = np.flatnonzero(np.diff(ordered.astype(np.float64)) > _DAY_NS) + 1
    groups = np.split(ordered, edges)
    crowd = max(groups, key=len)
    if len(ordered) - len(crowd) > _STRAY_SHARE * len(ordered):
        crowd = ordered
    return int(crowd[0]), int(crowd[-1]), len(ordered) - len(crowd)


def _channel(topic: str, types: Mapping[str, None], recorded: Sequence[NDArray[np.int64]]) -> Channel:
    count = sum(len(times) for times in recorded)
    times = np.concatenate(recorded) if count else np.zeros(1, dtype=np.int64)
    return Channel.over(topic, ", ".join(types), count, (int(times.max()) - int(times.min())) / 1e9)


def _columns(decoder: Decoder, rows: Sequence[Sequence[Any]]) -> dict[str, NDArray[Any]]:
    columns = zip(*rows, strict=True)
    named = zip(decoder.paths, decoder.is_number, columns, strict=True)
    return {path: np.array(values, np.float64) if number else _objects(values) for path, number, values in named}


def _objects(values: Sequence[Any]) -> NDArray[Any]:
    """An object column; filled one by one, since numpy would turn equally long lists into a matrix."""
    column = np.empty(len(values), object)
    for row, value in enumerate(values):
        column[row] = value
    return column


def _is_as_named(path: str, is_number: bool, pieces: Sequence[_Piece]) -> bool:
    """Whether a field holds what its name says in all of ROS: a log brings its own definitions, and may bring broken
    ones. A field that does not is as good as absent; one inside a list of messages holds a list of what it says."""
    leaf = path.rpartition(".")[2]
    if leaf in _NUMBERS and not is_number:
        return all(isinstance(value, list) for piece in pieces for value in piece.columns.get(path, ()))
    return not (is_number and leaf in _LISTS)


def _table(kinds: Mapping[str, bool], pieces: Sequence[_Piece], start_ns: int) -> Table:
    """The messages of a topic in time order; `kinds` are its paths and whether they are numbers."""
    if not pieces:
        return Table(
            np.empty(0), {path: np.empty(0, np.float64 if number else object) for path, number in kinds.items()}
        )
    times_ns = np.concatenate([piece.times_ns for piece in pieces])
    order = np.argsort(times_ns, kind="stable")
    columns = {path: np.concatenate([_column(p, path, number) for p in pieces]) for path, number in kinds.items()}
    return Table((times_ns[order] - start_ns) / 1e9, {path: column[order] for path, column in columns.items()})


def _column(piece: _Piece, path: str, is_number: bool) -> NDArray[Any]:
    if path in piece.columns:
        return piece.columns[path]
    return np.full(len(piece.times_ns), np.nan if is_number else None, np.float64 if is_number else object)
