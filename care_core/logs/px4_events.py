"""What PX4 says by number: events, whose texts a log brings with it since v1.13, compressed.

An event is an id and the bytes of its arguments; the texts by id, with the types and names of the values that arguments
can have, are the JSON of `metadata_events`. Source: the events interface, docs.px4.io/main/en/concept/events_interface,
and its metadata, github.com/mavlink/libevents.
"""

from __future__ import annotations

import json
import lzma
import re
import struct
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from care_core import limits
from care_core.records import Record

TOPIC = "event"
ARGUMENT_BYTES = 25
"""Of an event's arguments, whatever they are (msg/Event.msg)."""
FIELDS = ("id", "log_levels", *(f"arguments[{byte}]" for byte in range(ARGUMENT_BYTES)))
CHECK = "Arming check: "
"""What comes before what the health and arming checks say; they go on in flight."""
_CHECKS = frozenset(("arming_check", "health"))
"""The groups of what they say: the first argument has a bit for each mode in which it counts."""
_MISSION = 1 << 3
"""The bit of the mission mode. What counts in other modes alone (no sticks, no offboard signal) is none of it."""

_CODES = {"uint8_t": "B", "int8_t": "b", "uint16_t": "H", "int16_t": "h", "uint32_t": "I", "int32_t": "i",
          "uint64_t": "Q", "int64_t": "q", "float": "f"}  # fmt: skip
_COMPONENT_BITS = 24
_PLACEHOLDER = re.compile(r"\{(\d{1,2})(?::(?:\.(\d))?)?([^{}\d:.][^{}]*)?\}")
_TAG = re.compile(r"(?<!\\)<[^<>]*>")
_ESCAPE = re.compile(r"\\(.)")
_UNITS = {"m_v": "m", "m_h": "m"}
"""Metres upwards and along the ground are both metres."""


class _Enum(NamedTuple):
    """Names of the values of an argument, and how the value is stored."""

    code: str
    names: Mapping[int, str]
    is_bitfield: bool

    def name(self, value: int) -> str:
        if not self.is_bitfield:
            return self.names.get(value, str(value))
        return ", ".join(name for bit, name in self.names.items() if bit and value & bit == bit) or str(value)


class _Event(NamedTuple):
    """The text of an event and the types of its arguments."""

    text: str
    arguments: Sequence[_Enum]
    is_check: bool


class EventTexts(Record, eq=False):
    """The texts of a log's events."""

    events: Mapping[int, _Event]

    @classmethod
    def parse(cls, metadata: bytes) -> EventTexts | None:
        """The texts of `metadata_events` as a log has it; None where they cannot be read."""
        try:
            unpacked = lzma.LZMADecompressor().decompress(metadata, limits.EVENT_TEXTS_BYTES)
            return cls(dict(_events(json.loads(unpacked)["components"])))
        except (lzma.LZMAError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
            return None

    def text(self, number: int, arguments: bytes) -> str:
        """What an event says; "" of one that is not known, and of a check that no mission asks for."""
        event = self.events.get(number)
        if event is None or (event.is_check and not int.from_bytes(arguments[:4], "little") & _MISSION):
            return ""
        values = list(_values(event.arguments, arguments))
        filled = _PLACEHOLDER.sub(lambda match: _filled(match, values), _TAG.sub("", event.text))
        return (CHECK if event.is_check else "") + _ESCAPE.sub(r"\1", filled).rstrip(" :")


def _events(components: Mapping[str, Any]) -> Iterator[tuple[int, _Event]]:
    """The events of all components by their id."""
    enums = {f"{one['namespace']}::{name}": _enum(declared)
             for one in components.values() for name, declared in one.get("enums", {}).items()}  # fmt: skip
    for component, one in components.items():
        for group, declared in one.get("event_groups", {}).items():
            for number, event in declared["events"].items():
                types = (_type(argument["type"], one["namespace"], enums) for argument in event.get("arguments", ()))
                known = _Event(str(event["message"]), tuple(types), group in _CHECKS)
                yield (int(component) << _COMPONENT_BITS) + int(number), known


def _enum(declared: Mapping[str, Any]) -> _Enum:
    names = {int(value): str(entry["description"]) for value, entry in declared["entries"].items()}
    return _Enum(_CODES[declared["type"]], names, bool(declared.get("is_bitfield")))


def _type(name: str, namespace: str, enums: Mapping[str, _Enum]) -> _Enum:
    """A type of arguments. Enums of another component have its name ahead of theirs."""
    own = enums.get(name) or enums.get(f"{namespace}::{name}")
    return own or _Enum(_CODES[name], {}, False)


def _values(types: Sequence[_Enum], arguments: bytes) -> Iterator[str | float]:
    """The arguments one after another without padding, up to the first that is not there."""
    at = 0
    for one in types:
        size = struct.calcsize(f"<{one.code}")
        if at + size > len(arguments):
            return
        (value,) = struct.unpack_from(f"<{one.code}", arguments, at)
        yield one.name(value) if one.names else value
        at += size


def _filled(match: re.Match[str], values: Sequence[str | float]) -> str:
    """An argument as a text has it: with its decimals and its unit."""
    number = int(match[1]) - 1
    if not 0 <= number < len(values):
        return "?"
    value = values[number]
    told = value if isinstance(value, str) else f"{value:.{match[2] or 1}f}" if isinstance(value, float) else str(value)
    unit = (match[3] or "").strip()
    return f"{told} {_UNITS.get(unit, unit)}" if unit else told
