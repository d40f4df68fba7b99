"""How a ULog declares its topics and keys: layouts of the fields of a topic, and single values with their type.

Source: the ULog file format, docs.px4.io/main/en/dev_log/ulog_file_format.html. Numbers are little-endian.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from care_core.records import Record

TYPES: Mapping[str, np.dtype[Any]] = {
    name: np.dtype(code)
    for name, code in {
        "int8_t": "i1", "uint8_t": "u1", "int16_t": "<i2", "uint16_t": "<u2", "int32_t": "<i4", "uint32_t": "<u4",
        "int64_t": "<i8", "uint64_t": "<u8", "float": "<f4", "double": "<f8", "bool": "i1", "char": "i1",
    }.items()
}  # fmt: skip
PADDING = "_padding"
MAX_BYTES = 65_533
"""Of a topic's message: the length of a record is two bytes, and the message id takes two."""
_DEEPEST = 10
"""Topics within topics; PX4 nests two."""

_FIELD = re.compile(r"(\w+)(?:\[(\d{1,5})\])? (\w+)")
_KEY = re.compile(r"(\w+)(?:\[(\d{0,5})\])? (.+)", re.DOTALL)
_STEP = re.compile(r"(\w+)(?:\[(\d{1,5})\])?")


class Declared(NamedTuple):
    """A field of a format: its type, how many of it (None: no array), and the bytes ahead of it."""

    type: str
    number: int | None
    offset: int


class RecordField(NamedTuple):
    """Where a number lies in a message (bytes from its first) and how it is stored."""

    offset: int
    dtype: np.dtype[Any]


class Format(Record):
    """A declared type. What its fields take is known once all formats are."""

    name: str
    fields: tuple[tuple[str, int | None, str], ...]
    """Type, how many of it (None: no array), name."""

    @classmethod
    def parse(cls, body: bytes) -> Format | None:
        """A format as an F record has it, `NAME:TYPE FIELD;TYPE[N] FIELD;...`; None where it is no such text."""
        try:
            name, colon, declared = body.decode("ascii").partition(":")
        except UnicodeDecodeError:
            return None
        matches = [_FIELD.fullmatch(part) for part in declared.rstrip("\0").split(";") if part]
        if not colon or not name or not matches or None in matches:
            return None
        fields = tuple((m[1], None if m[2] is None else int(m[2]), m[3]) for m in matches if m is not None)
        return cls(name, fields)


class UnusableFormatError(ValueError):
    """A format of which no message can be read."""


class Layouts:
    """The layouts of declared formats, each worked out once when it is asked for."""

    def __init__(self, formats: Mapping[str, Format]) -> None:
        self._formats = formats
        self._known: dict[str, Layout] = {}
        self._open: list[str] = []

    def of(self, name: str) -> Layout:
        """The layout of a format. Raises UnusableFormatError."""
        if name not in self._known:
            if name not in self._formats:
                raise UnusableFormatError(f"{name} is not declared")
            if name in self._open or len(self._open) == _DEEPEST:
                raise UnusableFormatError(f"{name} holds itself")
            self._open.append(name)
            try:
                self._known[name] = Layout(self._formats[name], self)
            finally:
                self._open.pop()
        return self._known[name]


class Layout:
    """Where the fields of a type lie. Names are dotted paths with numbers: `q[0]`, `esc[3].esc_rpm`.

    Raises:
        UnusableFormatError: a type that nobody declares, or one that holds itself or takes more bytes than a record
            has.
    """

    def __init__(self, format: Format, layouts: Layouts) -> None:
        self._fields: dict[str, Declared] = {}
        self._nested: dict[str, Layout] = {}
        self.size = self.size_unpadded = 0
        """Bytes of it, and without the padding at its end, which is not logged of a topic."""
        for kind, count, name in format.fields:
            if kind not in TYPES and kind not in self._nested:
                self._nested[kind] = layouts.of(kind)
            self._fields.setdefault(name, Declared(kind, count, self.size))
            self.size += self._bytes(kind) * (1 if count is None else count)
            if not name.startswith(PADDING):
                self.size_unpadded = self.size
            if self.size > MAX_BYTES:
                raise UnusableFormatError(f"{format.name} takes more bytes than a record has")

    def _bytes(self, kind: str) -> int:
        return TYPES[kind].itemsize if kind in TYPES else self._nested[kind].size

    def find(self, path: str) -> RecordField | None:
        """A number by its name, None where there is none of that name."""
        step, _, rest = path.partition(".")
        match = _STEP.fullmatch(step)
        declared = self._fields.get(match[1]) if match is not None else None
        if match is None or declared is None or (match[2] is None) != (declared.number is None):
            return None
        number = int(match[2] or 0)
        if declared.number is not None and number >= declared.number:
            return None
        offset = declared.offset + number * self._bytes(declared.type)
        if declared.type in TYPES:
            return None if rest else RecordField(offset, TYPES[declared.type])
        inner = self._nested[declared.type].find(rest)
        return None if inner is None else RecordField(offset + inner.offset, inner.dtype)

    @cached_property
    def stamp_offset(self) -> int | None:
        """Bytes ahead of the time, in microseconds since the vehicle booted; None where a topic does not say it. It
        comes first, also where its name is damaged."""
        first = next(iter(self._fields), "")
        found = self.find("timestamp") or self.find(first)
        return found.offset if found is not None and found.dtype == TYPES["uint64_t"] else None


Value = int | float | str | bytes
"""What a key holds: a number, a text (`char[n]`), or the bytes of whatever else was declared."""


def read_value(body: bytes) -> tuple[str, Value] | None:
    """Key and value of an I, P or Q record from its byte of the key's length on, None where they are not whole."""
    if not body or len(body) < 1 + body[0]:
        return None
    match = _KEY.fullmatch(body[1 : 1 + body[0]].decode("utf-8", "replace"))
    if match is None:
        return None
    raw = body[1 + body[0] :]
    if match[1] == "char" and match[2] is not None:
        return match[3], raw.decode("utf-8", "replace").rstrip("\0")
    kind = TYPES.get(match[1])
    if kind is None or match[2] is not None:
        return match[3], raw
    if len(raw) != kind.itemsize:
        return None
    number: int | float = np.frombuffer(raw, kind)[0].item()
    return match[3], number
