"""The serialisation of ROS 1: little endian, no padding, strings and sequences led by a uint32 count.

Source: wiki.ros.org/ROS/Technical Overview.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np

from care_core.logs.ros_message import (
    CODES,
    Buffer,
    Fixed,
    MalformedMessageError,
    MessageDecoder,
    Step,
    compile_decoder,
    parse_definition,
    read_elements,
    read_numbers,
)

_COUNT = struct.Struct("<I")
_STAMP = struct.Struct("<II")
_SPAN = struct.Struct("<ii")


def message_decoder(type_name: str, definition: str, wanted: Sequence[str], zero_ns: int) -> MessageDecoder:
    """A decoder of ROS 1 messages; see `compile_decoder` for the values. Raises MalformedMessageError."""
    return compile_decoder(type_name, parse_definition(type_name, definition), wanted, zero_ns, _Ros1())


class _Ros1:
    """Fulfils `Wire`."""

    codes: Mapping[str, str] = MappingProxyType({**CODES, "byte": "b"})

    def fixed(self, run: Sequence[Fixed]) -> Step:
        codes = [one.code if one.wanted else f"{struct.calcsize(one.code) * one.length}x" for one in run]
        layout = struct.Struct("<" + "".join(codes))
        unpack, size = layout.unpack_from, layout.size

        def numbers(buffer: Buffer, pos: int, _end: int, values: list[Any]) -> int:
            values.extend(unpack(buffer, pos))
            return pos + size

        return numbers if any(one.wanted for one in run) else lambda _buffer, pos, _end, _values: pos + size

    def text(self, kind: str, *, keep: bool) -> Step:
        return _text if keep else _skip_text

    def time(self, zero_ns: int) -> Step:
        def time(buffer: Buffer, pos: int, _end: int, values: list[Any]) -> int:
            seconds, nanoseconds = _STAMP.unpack_from(buffer, pos)
            stamp_ns = seconds * 1_000_000_000 + nanoseconds
            values.append((stamp_ns - zero_ns) / 1e9 if stamp_ns else math.nan)
            return pos + _STAMP.size

        return time

    def duration(self) -> Step:
        def duration(buffer: Buffer, pos: int, _end: int, values: list[Any]) -> int:
            seconds, nanoseconds = _SPAN.unpack_from(buffer, pos)
            values.append(seconds + nanoseconds / 1e9)
            return pos + _SPAN.size

        return duration

    def numbers(self, code: str, count: int | None, *, keep: bool) -> Step:
        dtype = np.dtype("<" + code)

        def numbers(buffer: Buffer, pos: int, end: int, values: list[Any]) -> int:
            pos, size = _counted(buffer, pos, count)
            return read_numbers(dtype, buffer, pos, end, size, values if keep else None)

        return numbers

    def elements(self, each: MessageDecoder, count: int | None) -> Step:
        def elements(buffer: Buffer, pos: int, end: int, values: list[Any]) -> int:
            pos, size = _counted(buffer, pos, count)
            return read_elements(each, buffer, pos, end, size, values)

        return elements


def _skip_text(buffer: Buffer, pos: int, _end: int, _values: list[Any]) -> int:
    return pos + 4 + int(_COUNT.unpack_from(buffer, pos)[0])


def _text(buffer: Buffer, pos: int, end: int, values: list[Any]) -> int:
    (size,) = _COUNT.unpack_from(buffer, pos)
    after = pos + 4 + int(size)
    if after > end:
        raise MalformedMessageError("a text reaches beyond the message")
    values.append(buffer[pos + 4 : after].decode("utf-8", "replace"))
    return after


def _counted(buffer: Buffer, pos: int, count: int | None) -> tuple[int, int]:
    """Where an array's elements begin and how many there are."""
    if count is not None:
        return pos, count
    return pos + 4, int(_COUNT.unpack_from(buffer, pos)[0])
