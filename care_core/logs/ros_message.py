"""Decode only the wanted fields of a serialised ROS message, ROS 1 or ROS 2.

A message definition becomes a short list of steps once; nothing after the last wanted field is looked at. How values
lie in the bytes is the business of a `Wire`: `ros1_message` and `cdr_message` hold the two there are.
Definitions: wiki.ros.org/msg and docs.ros.org "About ROS 2 interfaces".
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import count
from typing import Any, NamedTuple, Protocol

import numpy as np

from care_core import limits
from care_core.records import Record, Struct, field

Buffer = bytes
Step = Callable[[Buffer, int, int, list[Any]], int]
"""Reads at a position of a buffer, not beyond `end`, appends what is wanted, and returns the next position."""

CODES = {
    "bool": "?", "byte": "B", "char": "B", "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i",
    "uint32": "I", "int64": "q", "uint64": "Q", "float32": "f", "float64": "d",
}  # fmt: skip
"""struct codes of the numbers; a `byte` of ROS 1 is signed, which its wire knows."""

_TEXTS = ("string", "wstring")
_TIMES = ("time", "builtin_interfaces/Time")
_DURATIONS = ("duration", "builtin_interfaces/Duration")
_SPAN_SIZE = 2
_LONGEST_LENGTH = 9
"""Digits of the length of an array."""
_BOUND = r"(?:<=\d+)?"
_FIELD = re.compile(rf"([\w/]+){_BOUND}(\[(?:<=\d+)?(\d*)\])?\s+(\w+)\s*(=(?!=))?")
_SEPARATOR = re.compile(r"^=+\s*\nMSG:\s*(\S+)\s*$", re.MULTILINE)


class MalformedMessageError(Exception):
    """Bytes that are not the message that its definition promises. Stays inside the reader."""


class Decoder(Protocol):
    """Reads one value per entry of `paths`; `is_number` says which of them are plain numbers."""

    @property
    def paths(self) -> tuple[str, ...]: ...

    @property
    def is_number(self) -> tuple[bool, ...]: ...

    def decode(self, buffer: Buffer, pos: int, end: int) -> list[Any]:
        """The wanted values of the message at buffer[pos:end]. Raises MalformedMessageError."""


class MessageDecoder(Record):
    """The steps of one message, fulfilling `Decoder` where the message begins at `pos` itself."""

    paths: tuple[str, ...]
    is_number: tuple[bool, ...]
    steps: tuple[Step, ...]

    def decode(self, buffer: Buffer, pos: int, end: int) -> list[Any]:
        """The wanted values of the message at buffer[pos:end]. Raises MalformedMessageError."""
        values: list[Any] = []
        self.end_of(buffer, pos, end, values)
        return values

    def end_of(self, buffer: Buffer, pos: int, end: int, values: list[Any]) -> int:
        """Where the last step leaves off; the wanted values are appended. Raises MalformedMessageError."""
        try:
            pos = self.run(buffer, pos, end, values)
        except (struct.error, ValueError, OverflowError) as err:
            raise MalformedMessageError(str(err)) from err
        if pos > end:
            raise MalformedMessageError("shorter than its definition")
        return pos

    def run(self, buffer: Buffer, pos: int, end: int, values: list[Any]) -> int:
        for step in self.steps:
            pos = step(buffer, pos, end, values)
        return pos


class Fixed(NamedTuple):
    """Neighbouring numbers of one type in a stretch of fixed size; only a wanted one is read (`length` is 1 then)."""

    code: str
    length: int
    wanted: bool


class Wire(Protocol):
    """How values lie in the bytes. `count` is None for a sequence, which carries its own; `keep`: it is wanted."""

    @property
    def codes(self) -> Mapping[str, str]: ...

    def fixed(self, run: Sequence[Fixed]) -> Step: ...

    def text(self, kind: str, *, keep: bool) -> Step: ...

    def time(self, zero_ns: int) -> Step: ...

    def duration(self) -> Step: ...

    def numbers(self, code: str, count: int | None, *, keep: bool) -> Step: ...

    def elements(self, each: MessageDecoder, count: int | None) -> Step: ...


class MessageField(NamedTuple):
    """A field of a message: `size` is None for one value, -1 for a sequence, else the length of an array."""

    name: str
    type: str
    size: int | None


Types = Mapping[str, Sequence[MessageField]]
"""Fields by message type (`package/Type`), of a message and all that it is made of."""


def short_name(type_name: str) -> str:
    """`package/Type` of a ROS 2 name such as `package/msg/Type`."""
    package, _, rest = type_name.partition("/")
    return f"{package}/{rest.rpartition('/')[2]}" if rest else type_name


def parse_definition(type_name: str, definition: str) -> Types:
    """Fields of a message and of the messages it is made of. Raises MalformedMessageError.

    A definition as logs hold it is the message's own text, then per message it needs a line of `=`, a line
    `MSG: package/Type` and that one's text.
    """
    if len(definition) > limits.DEFINITION_BYTES:
        raise MalformedMessageError(f"its definition is larger than {limits.megabytes(limits.DEFINITION_BYTES)}")
    first, *rest = _SEPARATOR.split(definition.replace("\r\n", "\n"))
    names = [short_name(name) for name in rest[::2]]
    texts = dict(zip(names, rest[1::2], strict=True)) | {short_name(type_name): first}
    return {name: _fields(name, text, texts) for name, text in texts.items()}


def _fields(owner: str, text: str, known: Mapping[str, str]) -> list[MessageField]:
    fields = []
    for line in text.splitlines():
        bare = line.partition("#")[0].strip()
        if not bare:
            continue
        match = _FIELD.match(bare)
        if match is None:
            raise MalformedMessageError(f"definition of {owner} not understood")
        base, is_array, length, name, is_constant = match.groups()
        if not is_constant:
            # A bounded sequence (`[<=3]`) is a sequence: its digits are outside the group.
            if length and len(length) > _LONGEST_LENGTH:
                raise MalformedMessageError("an array of its definition is too long")
            size = None if is_array is None else int(length or -1)
            fields.append(MessageField(name, _full_name(base, owner, known), size))
    return fields


def _full_name(base: str, owner: str, known: Mapping[str, str]) -> str:
    """The type with its package: a bare name is of the owner's package, but for Header."""
    if base in CODES or base in _TEXTS or base in ("time", "duration"):
        return base
    if "/" in base:
        return short_name(base)
    own = f"{owner.rpartition('/')[0]}/{base}"
    return "std_msgs/Header" if base == "Header" and own not in known else own


def compile_decoder(
    type_name: str, types: Types, wanted: Sequence[str], zero_ns: int, wire: Wire, *, whole: bool = False
) -> MessageDecoder:
    """Compile a decoder for the `wanted` fields (dotted paths) of a message type.

    Numbers and strings come as such; a ROS time as seconds since `zero_ns` (nan where it is unset, which ROS
    writes as zero); a duration as seconds; an array of numbers as a numpy array; a path through an array of
    messages (`doubles.value`) as the list of its elements' values. Paths that lead nowhere are left out.
    `whole` keeps the steps after the last wanted field.

    Raises:
        MalformedMessageError: the definition lacks a type.
    """
    plan = _Plan(types, frozenset(wanted), zero_ns, wire)
    try:
        plan.message(short_name(type_name), "", ())
        return plan.decoder(whole=whole)
    except struct.error as err:
        raise MalformedMessageError("an array of its definition is too long") from err


class _Plan(Struct, eq=False):
    """The steps of one message, gathered field by field; `pending` is a stretch of fixed size."""

    types: Types
    wanted: frozenset[str]
    zero_ns: int
    wire: Wire
    paths: list[str] = field(default_factory=list)
    is_number: list[bool] = field(default_factory=list)
    steps: list[Step] = field(default_factory=list)
    pending: list[Fixed] = field(default_factory=list)
    last_useful: int = 0
    visited: Iterator[int] = field(default_factory=count)

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
            if next(self.visited) >= limits.FIELDS:
                raise MalformedMessageError(f"its definition has more than {limits.FIELDS} fields")
            path = prefix + one.name
            if one.size is None:
                self.single(path, one.type, (*inside, name))
            else:
                self.array(path, one.type, None if one.size < 0 else one.size, (*inside, name))

    def single(self, path: str, base: str, inside: tuple[str, ...]) -> None:
        is_wanted = path in self.wanted
        if base in _TEXTS:
            self.step(self.wire.text(base, keep=is_wanted), (path,) if is_wanted else ())
        elif base in (*_TIMES, *_DURATIONS) and is_wanted:
            step = self.wire.time(self.zero_ns) if base in _TIMES else self.wire.duration()
            self.step(step, (path,), is_number=True)
        elif base in (*_TIMES, *_DURATIONS):
            self.pending.append(Fixed("I", _SPAN_SIZE, wanted=False))
        elif base not in CODES:
            self.message(base, path + ".", inside)
        else:
            self.pending.append(Fixed(self.wire.codes[base], 1, is_wanted))
            if is_wanted:
                self.paths.append(path)
                self.is_number.append(True)

    def array(self, path: str, base: str, length: int | None, inside: tuple[str, ...]) -> None:
        """An array of `length` elements, or a sequence that carries its own count (None)."""
        wanted = (path,) if path in self.wanted else ()
        if base in CODES:
            code = self.wire.codes[base]
            if length is not None and not wanted:
                self.pending.append(Fixed(code, length, wanted=False))
            else:
                self.step(self.wire.numbers(code, length, keep=bool(wanted)), wanted)
            return
        inner = _Plan(self.types, self.wanted, self.zero_ns, self.wire, visited=self.visited)
        inner.single(path, base, inside)
        each = inner.decoder(whole=True)
        self.step(self.wire.elements(each, length), each.paths)

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
        self.steps.append(self.wire.fixed(self.pending))
        if any(one.wanted for one in self.pending):
            self.last_useful = len(self.steps)
        self.pending = []


def read_numbers(dtype: np.dtype[Any], buffer: Buffer, pos: int, end: int, size: int, values: list[Any] | None) -> int:
    """Read `size` numbers from `pos`: appends them to `values` unless that is None, returns the next position."""
    after = pos + size * dtype.itemsize
    if after > end:
        raise MalformedMessageError("an array reaches beyond the message")
    if values is not None:
        values.append(np.frombuffer(buffer[pos:after], dtype))
    return after


def read_elements(each: MessageDecoder, buffer: Buffer, pos: int, end: int, size: int, values: list[Any]) -> int:
    """Run an element's decoder `size` times from `pos`: appends one list per wanted path, returns the next position."""
    if size > end - pos:  # no element takes less than a byte, so the count itself is broken
        raise MalformedMessageError("an array reaches beyond the message")
    if size > limits.ELEMENTS:
        raise MalformedMessageError(f"a list of {size} messages, more than the {limits.ELEMENTS} that are read")
    rows: list[list[Any]] = []
    for _ in range(size):
        row: list[Any] = []
        pos = each.run(buffer, pos, end, row)
        if pos > end:
            raise MalformedMessageError("an array reaches beyond the message")
        rows.append(row)
    values.extend([row[column] for row in rows] for column in range(len(each.paths)))
    return pos
