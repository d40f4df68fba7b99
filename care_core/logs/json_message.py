"""Messages written as JSON, as some recorders put them into MCAP: values by dotted path, as other decoders give them.

Which paths there are, and which are numbers, is read off a sample: schemas are optional and often say less. A time is
an object of seconds and nanoseconds (`sec` with `nsec` or `nanosec`).
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from care_core.logs.ros_message import Buffer, MalformedMessageError
from care_core.records import Record

_NANOSECONDS = ("nsec", "nanosec", "nsecs")
_SECONDS = ("sec", "secs")


class JsonDecoder(Record):
    """Fulfils `Decoder`."""

    paths: tuple[str, ...]
    is_number: tuple[bool, ...]
    zero_ns: int

    def decode(self, buffer: Buffer, pos: int, end: int) -> list[Any]:
        """The wanted values of the message at buffer[pos:end]. Raises MalformedMessageError."""
        document = _parsed(bytes(buffer[pos:end]))
        found = (_at(document, path.split("."), self.zero_ns) for path in self.paths)
        return [_as(value, number) for value, number in zip(found, self.is_number, strict=True)]


def json_decoder(sample: bytes, wanted: Sequence[str], zero_ns: int) -> JsonDecoder:
    """A decoder of those wanted paths that a sample message holds.

    Raises:
        MalformedMessageError: the sample is no JSON.
    """
    document = _parsed(sample)
    values = {path: _at(document, path.split("."), zero_ns) for path in wanted}
    there = {path: value for path, value in values.items() if value is not None and not isinstance(value, dict)}
    return JsonDecoder(tuple(there), tuple(isinstance(value, float) for value in there.values()), zero_ns)


def _parsed(raw: bytes) -> Any:
    try:
        return json.loads(raw)
    except (ValueError, RecursionError) as err:
        raise MalformedMessageError("it is no JSON") from err


def _at(node: Any, path: Sequence[str], zero_ns: int) -> Any:
    """What a path leads to: a number, a text, an array of numbers, a list of what each element has, or None."""
    if isinstance(node, list) and path:
        return [_at(one, path, zero_ns) for one in node]
    if path:
        return _at(node[path[0]], path[1:], zero_ns) if isinstance(node, dict) and path[0] in node else None
    if isinstance(node, dict) and any(name in node for name in _SECONDS):
        return _seconds(node, zero_ns)
    if isinstance(node, (bool, int, float)):
        return _number(node)
    if isinstance(node, list):
        return np.array([_as(one, number=True) for one in node])
    return node


def _seconds(node: dict[str, Any], zero_ns: int) -> float:
    """A time in seconds since `zero_ns`, nan where it was never set."""
    whole, part = (next((node[name] for name in names if name in node), 0) for names in (_SECONDS, _NANOSECONDS))
    if not all(isinstance(one, (int, float)) for one in (whole, part)):
        return float("nan")
    return (_number(whole) - zero_ns / 1e9) + _number(part) / 1e9 if whole or part else float("nan")


def _as(value: Any, number: bool) -> Any:
    """The value as its column holds it: a number, nan where it is none; a text or an array as it is."""
    if number:
        return _number(value) if isinstance(value, (bool, int, float)) else float("nan")
    return "" if value is None else value


def _number(value: float) -> float:
    try:
        return float(value)
    except OverflowError:  # JSON's whole numbers have no end
        return float("nan")
