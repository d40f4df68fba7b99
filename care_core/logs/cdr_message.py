"""The serialisation of ROS 2: CDR with its encapsulation header, either endianness, values aligned to their size.

Positions are counted from behind the four bytes of the header, as alignment is. Source: OMG DDS-RTPS, "Data
Encapsulation"; OMG CORBA, "CDR Transfer Syntax". Middlewares differ in one thing: a character of a `wstring` takes
four bytes with older Fast DDS and two with others, so a decoder is told which.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from care_core.logs.ros_message import (
    CODES,
    Buffer,
    Fixed,
    MalformedMessageError,
    MessageDecoder,
    Step,
    Types,
    compile_decoder,
    read_elements,
    read_numbers,
)
from care_core.records import Struct

HEADER_SIZE = 4
_BIG, _LITTLE = b"\x00\x00", b"\x00\x01"
_ENDIAN = {_BIG: ">", _LITTLE: "<"}
_WIDTHS = (4, 2)
_MAX_PADDING = 3


class CdrDecoder(Struct, eq=False, dict=True):
    """Fulfils `Decoder` for messages with an encapsulation header; the steps of an endianness are made when met."""

    type_name: str
    types: Types
    wanted: Sequence[str]
    zero_ns: int
    wide: int = 4

    def __post_init__(self) -> None:
        _ = self._by_header  # a type that nobody can decode is an error here

    @cached_property
    def _by_header(self) -> dict[bytes, MessageDecoder]:
        return {_LITTLE: self._compile("<")}

    @property
    def paths(self) -> tuple[str, ...]:
        return self._by_header[_LITTLE].paths

    @property
    def is_number(self) -> tuple[bool, ...]:
        return self._by_header[_LITTLE].is_number

    def decode(self, buffer: Buffer, pos: int, end: int) -> list[Any]:
        """The wanted values of the message at buffer[pos:end]. Raises MalformedMessageError."""
        body = buffer[pos + HEADER_SIZE : end]
        steps = self._by_header.get(buffer[pos : pos + 2])
        if steps is None:
            steps = self._by_header[buffer[pos : pos + 2]] = self._compile(endianness(buffer[pos:end]))
        return steps.decode(body, 0, len(body))

    def _compile(self, endian: str) -> MessageDecoder:
        return compile_decoder(self.type_name, self.types, self.wanted, self.zero_ns, _Cdr(endian, self.wide))


def endianness(message: bytes) -> str:
    """The struct code of a message's byte order. Raises MalformedMessageError for other encapsulations than CDR."""
    endian = _ENDIAN.get(message[:2])
    if endian is None:
        raise MalformedMessageError(f"an encapsulation {message[:2].hex()} that is not CDR")
    return endian


def wide_size(type_name: str, types: Types, message: bytes) -> int | None:
    """Bytes per character of a wstring with which the definition takes exactly this message; None: with neither."""
    for wide in _WIDTHS:
        try:
            body = message[HEADER_SIZE:]
            decoder = compile_decoder(type_name, types, (), 0, _Cdr(endianness(message), wide), whole=True)
            if len(body) - decoder.end_of(body, 0, len(body), []) <= _MAX_PADDING:
                return wide
        except MalformedMessageError:
            continue
    return None


class _Cdr:
    """Fulfils `Wire`."""

    codes: Mapping[str, str] = CODES

    def __init__(self, endian: str, wide: int) -> None:
        self.endian = endian
        self.wide = wide
        self.count = struct.Struct(endian + "I")

    def fixed(self, run: Sequence[Fixed]) -> Step:
        """Padding depends on where the stretch begins, so there is a layout for each of the eight remainders."""
        layouts = [struct.Struct(_padded(self.endian, start, run)) for start in range(8)]
        unpacks = [layout.unpack_from for layout in layouts]
        sizes = [layout.size for layout in layouts]

        def numbers(buffer: Buffer, pos: int, _end: int, values: list[Any]) -> int:
            start = pos & 7
            values.extend(unpacks[start](buffer, pos))
            return pos + sizes[start]

        def skip(_buffer: Buffer, pos: int, _end: int, _values: list[Any]) -> int:
            return pos + sizes[pos & 7]

        return numbers if any(one.wanted for one in run) else skip

    def text(self, kind: str, *, keep: bool) -> Step:
        unpack = self.count.unpack_from
        if kind == "wstring":
            return self._wide_text(keep=keep)

        def text(buffer: Buffer, pos: int, end: int, values: list[Any]) -> int:
            pos = (pos + 3) & -4
            after = pos + 4 + int(unpack(buffer, pos)[0])
            if after > end:
                raise MalformedMessageError("a text reaches beyond the message")
            if keep:
                values.append(buffer[pos + 4 : after].rstrip(b"\0").decode("utf-8", "replace"))
            return after

        return text

    def _wide_text(self, *, keep: bool) -> Step:
        unpack, wide = self.count.unpack_from, self.wide
        encoding = f"utf-{8 * wide}-{'le' if self.endian == '<' else 'be'}"

        def wide_text(buffer: Buffer, pos: int, end: int, values: list[Any]) -> int:
            pos = (pos + 3) & -4
            after = pos + 4 + wide * int(unpack(buffer, pos)[0])
            if after > end:
                raise MalformedMessageError("a text reaches beyond the message")
            if keep:
                values.append(buffer[pos + 4 : after].decode(encoding, "replace").rstrip("\0"))
            return after

        return wide_text

    def time(self, zero_ns: int) -> Step:
        unpack = struct.Struct(self.endian + "iI").unpack_from

        def time(buffer: Buffer, pos: int, _end: int, values: list[Any]) -> int:
            pos = (pos + 3) & -4
            seconds, nanoseconds = unpack(buffer, pos)
            stamp_ns = seconds * 1_000_000_000 + nanoseconds
            values.append((stamp_ns - zero_ns) / 1e9 if stamp_ns else math.nan)
            return pos + 8

        return time

    def duration(self) -> Step:
        unpack = struct.Struct(self.endian + "iI").unpack_from

        def duration(buffer: Buffer, pos: int, _end: int, values: list[Any]) -> int:
            pos = (pos + 3) & -4
            seconds, nanoseconds = unpack(buffer, pos)
            values.append(seconds + nanoseconds / 1e9)
            return pos + 8

        return duration

    def numbers(self, code: str, count: int | None, *, keep: bool) -> Step:
        dtype = np.dtype(self.endian + code)
        mask = dtype.itemsize - 1

        def numbers(buffer: Buffer, pos: int, end: int, values: list[Any]) -> int:
            pos, size = self._counted(buffer, pos, count)
            if size:
                pos = (pos + mask) & ~mask
            return read_numbers(dtype, buffer, pos, end, size, values if keep else None)

        return numbers

    def elements(self, each: MessageDecoder, count: int | None) -> Step:
        def elements(buffer: Buffer, pos: int, end: int, values: list[Any]) -> int:
            pos, size = self._counted(buffer, pos, count)
            return read_elements(each, buffer, pos, end, size, values)

        return elements

    def _counted(self, buffer: Buffer, pos: int, count: int | None) -> tuple[int, int]:
        """Where an array's elements begin, but for their own alignment, and how many there are."""
        if count is not None:
            return pos, count
        pos = (pos + 3) & -4
        return pos + 4, int(self.count.unpack_from(buffer, pos)[0])


def _padded(endian: str, start: int, run: Sequence[Fixed]) -> str:
    """The struct layout of a stretch that begins at `start` (modulo 8)."""
    codes, pos = [endian], start
    for one in run:
        size = struct.calcsize("<" + one.code)
        padding = -pos % size if one.length else 0
        codes.append("x" * padding + (one.code if one.wanted else f"{size * one.length}x"))
        pos += padding + size * one.length
    return "".join(codes)
