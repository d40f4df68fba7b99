"""ROS 1 bags. Times are the bag's record times; only chunks that hold a wanted topic are touched."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import datetime, timezone
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from care_core.errors import LogError
from care_core.logs.base import Channel, LogFormat, Table, Wanted
from care_core.logs.ros1_message import MalformedMessageError, MessageDecoder, message_decoder
from care_core.logs.ros1_records import MAGIC, BrokenRecordError, Chunk, Contents, locate, read_contents
from care_core.run import Damage, Setting

_EPOCH_OF_ROS = datetime(2005, 1, 1, tzinfo=timezone.utc)
"""No bag is older: an earlier time comes from a simulated clock."""

_CONFIG = "dynamic_reconfigure/Config"
_CONFIG_DESCRIPTION = "dynamic_reconfigure/ConfigDescription"
_KINDS = ("bools", "ints", "strs", "doubles")
_UNBOUNDED = 2**31 - 1
"""dynamic_reconfigure writes the largest number of the type, or infinity, where a parameter has no bound."""


class Ros1Bag:
    """A ROS 1 bag of format 2.0, fulfilling `care_core.logs.base.Log`.

    `t` of a table, and every field that is a ROS time (`header.stamp`), count seconds from the first message's
    record time; a stamp that was never set is nan. Several publishers of a topic come in one table, in time
    order; where their types differ, a field that one lacks is nan (numbers) or None.
    """

    format = LogFormat.ROS1_BAG

    def __init__(self, path: Path) -> None:
        """Walk over the record headers. Raises LogError when it is no readable bag at all."""
        self.path = path
        with self._open() as bag:
            self._contents: Contents = read_contents(bag)
        if self._contents.is_encrypted:
            raise LogError("The bag is encrypted.", hint="Decrypt it with 'rosbag decrypt' first.", where=str(path))
        self._times = {number: _times_ns(parts) for number, parts in _by_connection(self._contents.chunks).items()}
        self._start_ns = min((int(times.min()) for times in self._times.values()), default=0)
        self._unreadable: dict[str, Damage] = {}

    @property
    def start(self) -> str | None:
        """ISO 8601 UTC time of the first message, None for a simulated clock."""
        if self._start_ns / 1e9 < _EPOCH_OF_ROS.timestamp():
            return None
        return datetime.fromtimestamp(self._start_ns / 1e9, timezone.utc).isoformat(timespec="seconds")

    @property
    def duration_s(self) -> float:
        end_ns = max((int(times.max()) for times in self._times.values()), default=self._start_ns)
        return (end_ns - self._start_ns) / 1e9

    @property
    def damage(self) -> tuple[Damage, ...]:
        """Broken records found by the walk, and what could not be unpacked or decoded by the reads so far."""
        return (*self._contents.damage, *self._unreadable.values())

    @property
    def facts(self) -> Mapping[str, str]:
        """`stack`: move_base, where its action or its configuration was recorded."""
        types = {connection.type for connection in self._contents.connections.values()}
        topics = {connection.topic for connection in self._contents.connections.values()}
        is_move_base = "move_base_msgs/MoveBaseActionGoal" in types or "/move_base/parameter_updates" in topics
        return {"ros": "1", **({"stack": "move_base"} if is_move_base else {})}

    def channels(self) -> tuple[Channel, ...]:
        by_topic: dict[str, list[int]] = {}
        for number, connection in sorted(self._contents.connections.items()):
            by_topic.setdefault(connection.topic, []).append(number)
        return tuple(self._channel(topic, numbers) for topic, numbers in sorted(by_topic.items()))

    def read(self, wanted: Wanted) -> Mapping[str, Table]:
        """Decode the wanted fields in one pass; see the class for times, `message_decoder` for values."""
        decoders = self._decoders(wanted)
        parts: dict[int, list[_Part]] = {number: [] for number in decoders}
        with self._open() as bag:
            for chunk in self._contents.chunks:
                numbers = [number for number in chunk.index if number in decoders]
                if numbers:
                    self._read_chunk(bag, chunk, {number: decoders[number] for number in numbers}, parts)
        tables = {}
        for topic in wanted:
            own = {n: d for n, d in decoders.items() if self._contents.connections[n].topic == topic}
            if own:
                tables[topic] = _table(own, parts, self._start_ns)
        return tables

    def settings(self) -> Mapping[str, tuple[Setting, ...]]:
        """Every value of every dynamic_reconfigure parameter, by `<namespace>/<parameter>`; booleans as 0 or 1."""
        of_type = {c.topic: c.type for c in self._contents.connections.values()}
        updates = [topic for topic, kind in of_type.items() if kind == _CONFIG]
        descriptions = [topic for topic, kind in of_type.items() if kind == _CONFIG_DESCRIPTION]
        tables = self.read(
            {topic: _config_fields("") for topic in updates}
            | {topic: [p for part in ("min.", "max.", "dflt.") for p in _config_fields(part)] for topic in descriptions}
        )
        settings: dict[str, tuple[Setting, ...]] = {}
        for topic in sorted(updates):
            namespace = topic.rpartition("/")[0]
            described = tables.get(f"{namespace}/parameter_descriptions")
            settings.update(_histories(topic, namespace, tables[topic], _Bounds(described)))
        return settings

    @contextmanager
    def _open(self) -> Iterator[mmap]:
        try:
            with self.path.open("rb") as stream:
                if stream.read(len(MAGIC)) != MAGIC:
                    raise LogError("Not a ROS 1 bag of format 2.0.", hint="Name a .bag file.", where=str(self.path))
                with mmap(stream.fileno(), 0, access=ACCESS_READ) as bag:
                    yield bag
        except OSError as err:
            raise LogError(f"Cannot read the bag: {err.strerror or err}.", where=str(self.path)) from err

    def _channel(self, topic: str, numbers: Sequence[int]) -> Channel:
        types = dict.fromkeys(self._contents.connections[number].type for number in numbers)
        recorded = [self._times[number] for number in numbers if number in self._times]
        count = sum(len(times) for times in recorded)
        rate_hz = None
        if count > 1:
            span_s = (max(int(t.max()) for t in recorded) - min(int(t.min()) for t in recorded)) / 1e9
            rate_hz = (count - 1) / span_s if span_s > 0 else None
        return Channel(topic, ", ".join(types), count, rate_hz)

    def _decoders(self, wanted: Wanted) -> dict[int, MessageDecoder]:
        """A decoder per connection that has wanted fields. Publishers of one type share it."""
        made: dict[Any, MessageDecoder] = {}
        decoders: dict[int, MessageDecoder] = {}
        for number, connection in self._contents.connections.items():
            fields = tuple(wanted.get(connection.topic, ()))
            if not fields:
                continue
            key = (connection.type, connection.definition, fields)
            try:
                if key not in made:
                    made[key] = message_decoder(connection.type, connection.definition, fields, self._start_ns)
            except MalformedMessageError as err:
                self._unreadable.setdefault(connection.topic, Damage(f"{connection.topic}: {err}"))
                continue
            if made[key].paths:
                decoders[number] = made[key]
        return decoders

    def _read_chunk(
        self, bag: mmap, chunk: Chunk, decoders: Mapping[int, MessageDecoder], parts: Mapping[int, list[_Part]]
    ) -> None:
        try:
            buffer, begin, end = chunk.open(bag)
        except BrokenRecordError as err:
            self._unreadable.setdefault(f"chunk {chunk.pos}", Damage(str(err), chunk.pos))
            return
        for number, decoder in decoders.items():
            entries = chunk.index[number]
            rows: list[list[Any]] = []
            kept: list[int] = []
            for row, offset in enumerate(entries["offset"].tolist()):
                try:
                    rows.append(decoder.decode(buffer, *locate(buffer, begin, end, offset)))
                    kept.append(row)
                except (BrokenRecordError, MalformedMessageError) as err:
                    topic = self._contents.connections[number].topic
                    self._unreadable.setdefault(topic, Damage(f"{topic}: {err}", chunk.pos))
            if rows:
                parts[number].append(_Part(_entry_times_ns(entries[kept]), _columns(decoder, rows)))


class _Part:
    """Decoded messages of one connection in one chunk: record times in ns, and a column per path."""

    __slots__ = ("columns", "times_ns")

    def __init__(self, times_ns: NDArray[np.int64], columns: Mapping[str, NDArray[Any]]) -> None:
        self.times_ns = times_ns
        self.columns = columns


class _Bounds:
    """What `parameter_descriptions` says of a node's parameters, by name."""

    def __init__(self, table: Table | None) -> None:
        self.low = _values(table, "min.", 0)
        self.high = _values(table, "max.", 0)
        self.default = _values(table, "dflt.", 0)


def _histories(topic: str, namespace: str, table: Table, bounds: _Bounds) -> dict[str, tuple[Setting, ...]]:
    """Per parameter of one node the values it had, without repeats."""
    histories: dict[str, list[Setting]] = {}
    for row, time_s in enumerate(table.t.tolist()):
        for name, value in _values(table, "", row).items():
            history = histories.setdefault(f"{namespace}/{name}", [])
            if history and history[-1].value == value:
                continue
            history.append(
                Setting(
                    name=f"{namespace}/{name}",
                    value=value,
                    source=topic,
                    default=bounds.default.get(name),
                    low=_bound(bounds.low.get(name)),
                    high=_bound(bounds.high.get(name)),
                    changed_at_s=time_s if history else None,
                )
            )
    return {name: tuple(history) for name, history in histories.items()}


def _config_fields(prefix: str) -> list[str]:
    return [f"{prefix}{kind}.{part}" for kind in _KINDS for part in ("name", "value")]


def _values(table: Table | None, prefix: str, row: int) -> dict[str, float | str]:
    """Name to value of a dynamic_reconfigure Config found under `prefix` in a row of a table."""
    if table is None or not len(table):
        return {}
    values: dict[str, float | str] = {}
    for kind in _KINDS:
        names, given = table[f"{prefix}{kind}.name"][row], table[f"{prefix}{kind}.value"][row]
        pairs = zip(names, given, strict=True)
        values.update({name: value if isinstance(value, str) else float(value) for name, value in pairs})
    return values


def _bound(value: float | str | None) -> float | None:
    if value is None or isinstance(value, str) or not abs(value) < _UNBOUNDED:
        return None
    return value


def _by_connection(chunks: Sequence[Chunk]) -> dict[int, list[NDArray[Any]]]:
    parts: dict[int, list[NDArray[Any]]] = {}
    for chunk in chunks:
        for number, entries in chunk.index.items():
            if len(entries):
                parts.setdefault(number, []).append(entries)
    return parts


def _times_ns(parts: Sequence[NDArray[Any]]) -> NDArray[np.int64]:
    return np.concatenate([_entry_times_ns(entries) for entries in parts])


def _entry_times_ns(entries: NDArray[Any]) -> NDArray[np.int64]:
    times: NDArray[np.int64] = entries["seconds"].astype(np.int64) * 1_000_000_000 + entries["nanoseconds"]
    return times


def _columns(decoder: MessageDecoder, rows: Sequence[Sequence[Any]]) -> dict[str, NDArray[Any]]:
    columns = zip(*rows, strict=True)
    named = zip(decoder.paths, decoder.is_number, columns, strict=True)
    return {path: np.array(values, np.float64) if number else _objects(values) for path, number, values in named}


def _objects(values: Sequence[Any]) -> NDArray[Any]:
    """An object column; filled one by one, since numpy would turn equally long lists into a matrix."""
    column = np.empty(len(values), object)
    for row, value in enumerate(values):
        column[row] = value
    return column


def _table(decoders: Mapping[int, MessageDecoder], parts: Mapping[int, Sequence[_Part]], start_ns: int) -> Table:
    """The messages of a topic's connections in time order."""
    numeric: dict[str, bool] = {}
    for decoder in decoders.values():
        numeric.update(zip(decoder.paths, decoder.is_number, strict=True))
    pieces = [piece for number in decoders for piece in parts[number]]
    if not pieces:
        empty = {path: np.empty(0, np.float64 if number else object) for path, number in numeric.items()}
        return Table(np.empty(0), empty)
    times_ns = np.concatenate([piece.times_ns for piece in pieces])
    order = np.argsort(times_ns, kind="stable")
    columns = {path: np.concatenate([_piece(p, path, number) for p in pieces]) for path, number in numeric.items()}
    return Table((times_ns[order] - start_ns) / 1e9, {path: column[order] for path, column in columns.items()})


def _piece(piece: _Part, path: str, is_number: bool) -> NDArray[Any]:
    if path in piece.columns:
        return piece.columns[path]
    return np.full(len(piece.times_ns), np.nan if is_number else None, np.float64 if is_number else object)
