"""Decode only the wanted fields of a serialised ROS 1 message.

A message definition becomes a short list of steps once; runs of numbers between two strings are read with one
`struct` call, and nothing after the last wanted field is looked at. Serialisation: little endian, no padding,
strings and sequences led by a uint32 count (wiki.ros.org/ROS/Technical Overview).
"""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from mmap import mmap
from typing import Any, NamedTuple

import numpy as np

Buffer = bytes | mmap
Step = Callable[[Buffer, int, int, list[Any]], int]
"""Reads at a position of a buffer, not beyond `end`, appends what is wanted, and returns the next position."""

_CODES = {
    "bool": "?", "byte": "b", "char": "B", "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i",
    "uint32": "I", "int64": "q", "uint64": "Q", "float32": "f", "float64": "d",
}  # fmt: skip
_SPAN_TYPES = ("time", "duration")
_FIELD = re.compile(r"([\w/]+)(\[(\d*)\])?\s+(\w+)\s*(=)?")
_SEPARATOR = re.compile(r"^=+\s*\nMSG:\s*(\S+)\s*$", re.MULTILINE)
_COUNT = struct.Struct("<I")
_STAMP = struct.Struct("<II")
_SPAN = struct.Struct("<ii")


class MalformedMessageError(Exception):
    """Bytes that are not the message that its definition promises. Stays inside the reader."""


@dataclass(frozen=True, slots=True)
class MessageDecoder:
    """Reads one value per entry of `paths`; `is_number` says which of them are plain numbers."""

    paths: tuple[str, ...]
    is_number: tuple[bool, ...]
    steps: tuple[Step, ...]

    def decode(self, buffer: Buffer, pos: int, end: int) -> list[Any]:
        """The wanted values of the message at buffer[pos:end]. Raises MalformedMessageError."""
        values: list[Any] = []
        try:
            pos = self.run(buffer, pos, end, values)
        except (struct.error, ValueError) as err:
            raise MalformedMessageError(str(err)) from err
        if pos > end:
            raise MalformedMessageError("shorter than its definition")
        return values

    def run(self, buffer: Buffer, pos: int, end: int, values: list[Any]) -> int:
        for step in self.steps:
            pos = step(buffer, pos, end, values)
        return pos


class Field(NamedTuple):
    """A field of a message: `size` is None for one value, -1 for a sequence, else the length of an array."""

    name: str
    type: str
    size: int | None


Types = Mapping[str, Sequence[Field]]
"""Fields by message type, of a message and all that it is made of."""


def parse_definition(type_name: str, definition: str) -> Types:
    """Fields of a message and of the messages it is made of (wiki.ros.org/msg). Raises MalformedMessageError.

    A definition as bags hold it is the message's own text, then per message it needs a line of `=`, a line
    `MSG: package/Type` and that one's text.
    """
    first, *rest = _SEPARATOR.split(definition.replace("\r\n", "\n"))
    texts = {type_name: first} | dict(zip(rest[::2], rest[1::2], strict=True))
    return {name: _fields(name, text, texts) for name, text in texts.items()}


def _fields(owner: str, text: str, known: Mapping[str, str]) -> list[Field]:
    fields = []
    for line in text.splitlines():
        bare = line.partition("#")[0].strip()
        if not bare:
            continue
        match = _FIELD.match(bare)
        if match is None:
            raise MalformedMessageError(f"definition of {owner} not understood")
        base, is_array, count, name, is_constant = match.groups()
        if not is_constant:
            size = None if is_array is None else int(count or -1)
            fields.append(Field(name, _full_name(base, owner, known), size))
    return fields


def _full_name(base: str, owner: str, known: Mapping[str, str]) -> str:
    """The type with its package: a bare name is of the owner's package, but for Header."""
    if base in _CODES or base == "string" or base in _SPAN_TYPES or "/" in base:
        return base
    own = f"{owner.rpartition('/')[0]}/{base}"
    return "std_msgs/Header" if base == "Header" and own not in known else own


def message_decoder(type_name: str, definition: str, wanted: Sequence[str], zero_ns: int) -> MessageDecoder:
    """Compile a decoder for the `wanted` fields (dotted paths) of a message type.

    Numbers and strings come as such; a ROS time as seconds since `zero_ns` (nan where it is unset, which ROS
    writes as zero); a duration as seconds; an array of numbers as a numpy array; a path through an array of
    messages (`doubles.value`) as the list of its elements' values. Paths that lead nowhere are left out.

    Raises:
        MalformedMessageError: the definition cannot be understood.
    """
    plan = _Plan(parse_definition(type_name, definition), frozenset(wanted), zero_ns)
    plan.message(type_name, "", ())
    return plan.decoder(whole=False)


@dataclass(slots=True)
class _Plan:
    """The steps of one message, gathered field by field; `pending` is a stretch of fixed size, in struct codes."""

    types: Types
    wanted: frozenset[str]
    zero_ns: int
    paths: list[str] = field(default_factory=list)
    is_number: list[bool] = field(default_factory=list)
    steps: list[Step] = field(default_factory=list)
    pending: list[str] = field(default_factory=list)
    last_useful: int = 0

    def decoder(self, *, whole: bool) -> MessageDecoder:
        """The finished decoder; `whole` keeps the steps after the last wanted field, to find the next array element."""
        self.flush()
        steps = self.steps if whole else self.steps[: self.last_useful]
        return MessageDecoder(tuple(self.paths), tuple(self.is_number), tuple(steps))

    def message(self, name: str, prefix: str, inside: tuple[str, ...]) -> None:
        """Plan all fields of a message; `inside` are the types around it, which it cannot hold again."""
        if name not in self.types or name in inside:
            raise MalformedMessageError(f"the definition lacks {name}")
        for one in self.types[name]:
            path = prefix + one.name
            if one.size is None:
                self.single(path, one.type, (*inside, name))
            else:
                self.array(path, one.type, None if one.size < 0 else one.size, (*inside, name))

    def single(self, path: str, base: str, inside: tuple[str, ...]) -> None:
        is_wanted = path in self.wanted
        if base == "string":
            self.step(_text_step if is_wanted else _skip_text_step, (path,) if is_wanted else ())
        elif base in _SPAN_TYPES and is_wanted:
            self.step(_time_step(self.zero_ns) if base == "time" else _duration_step, (path,), is_number=True)
        elif base in _SPAN_TYPES:
            self.pending.append(f"{_STAMP.size}x")
        elif base not in _CODES:
            self.message(base, path + ".", inside)
        elif is_wanted:
            self.pending.append(_CODES[base])
            self.paths.append(path)
            self.is_number.append(True)
        else:
            self.pending.append(f"{struct.calcsize(_CODES[base])}x")

    def array(self, path: str, base: str, count: int | None, inside: tuple[str, ...]) -> None:
        """An array of `count` elements, or a sequence that carries its own count (None)."""
        wanted = (path,) if path in self.wanted else ()
        if base in _CODES:
            dtype = np.dtype("<" + _CODES[base])
            if count is not None and not wanted:
                self.pending.append(f"{count * dtype.itemsize}x")
            else:
                self.step(_numbers_array_step(dtype, count, keep=bool(wanted)), wanted)
            return
        inner = _Plan(self.types, self.wanted, self.zero_ns)
        inner.single(path, base, inside)
        each = inner.decoder(whole=True)
        self.step(_elements_step(each, count), each.paths)

    def step(self, step: Step, paths: Sequence[str], *, is_number: bool = False) -> None:
        self.flush()
        self.steps.append(step)
        self.paths.extend(paths)
        self.is_number.extend([is_number] * len(paths))
        if paths:
            self.last_useful = len(self.steps)

    def flush(self) -> None:
        if not self.pending:
            return
        reads = any(not code.endswith("x") for code in self.pending)
        fixed = struct.Struct("<" + "".join(self.pending))
        self.pending.clear()
        self.steps.append(_numbers_step(fixed) if reads else _skip_step(fixed.size))
        if reads:
            self.last_useful = len(self.steps)


def _numbers_step(fixed: struct.Struct) -> Step:
    unpack, size = fixed.unpack_from, fixed.size

    def numbers(buffer: Buffer, pos: int, _end: int, values: list[Any]) -> int:
        values.extend(unpack(buffer, pos))
        return pos + size

    return numbers


def _skip_step(size: int) -> Step:
    return lambda _buffer, pos, _end, _values: pos + size


def _skip_text_step(buffer: Buffer, pos: int, _end: int, _values: list[Any]) -> int:
    return pos + 4 + int(_COUNT.unpack_from(buffer, pos)[0])


def _text_step(buffer: Buffer, pos: int, end: int, values: list[Any]) -> int:
    (size,) = _COUNT.unpack_from(buffer, pos)
    after = pos + 4 + int(size)
    if after > end:
        raise MalformedMessageError("a text reaches beyond the message")
    values.append(buffer[pos + 4 : after].decode("utf-8", "replace"))
    return after


def _time_step(zero_ns: int) -> Step:
    def time(buffer: Buffer, pos: int, _end: int, values: list[Any]) -> int:
        seconds, nanoseconds = _STAMP.unpack_from(buffer, pos)
        stamp_ns = seconds * 1_000_000_000 + nanoseconds
        values.append((stamp_ns - zero_ns) / 1e9 if stamp_ns else math.nan)
        return pos + _STAMP.size

    return time


def _duration_step(buffer: Buffer, pos: int, _end: int, values: list[Any]) -> int:
    seconds, nanoseconds = _SPAN.unpack_from(buffer, pos)
    values.append(seconds + nanoseconds / 1e9)
    return pos + _SPAN.size


def _numbers_array_step(dtype: np.dtype[Any], count: int | None, *, keep: bool) -> Step:
    def numbers_array(buffer: Buffer, pos: int, end: int, values: list[Any]) -> int:
        pos, size = _counted(buffer, pos, count)
        after = pos + size * dtype.itemsize
        if after > end:
            raise MalformedMessageError("an array reaches beyond the message")
        if keep:
            values.append(np.frombuffer(buffer[pos:after], dtype))
        return after

    return numbers_array


def _elements_step(each: MessageDecoder, count: int | None) -> Step:
    def elements(buffer: Buffer, pos: int, end: int, values: list[Any]) -> int:
        pos, size = _counted(buffer, pos, count)
        if size > end - pos:  # no element takes less than a byte, so the count itself is broken
            raise MalformedMessageError("an array reaches beyond the message")
        rows: list[list[Any]] = []
        for _ in range(size):
            row: list[Any] = []
            pos = each.run(buffer, pos, end, row)
            rows.append(row)
        values.extend([row[column] for row in rows] for column in range(len(each.paths)))
        return pos

    return elements


def _counted(buffer: Buffer, pos: int, count: int | None) -> tuple[int, int]:
    """Where an array's elements begin and how many there are."""
    if count is not None:
        return pos, count
    return pos + 4, int(_COUNT.unpack_from(buffer, pos)[0])
