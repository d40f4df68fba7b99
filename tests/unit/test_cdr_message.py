"""CDR messages of every type of a distribution, against rosbags; and the corners that no standard type has."""

from __future__ import annotations

import math
import struct
from typing import Any

import numpy as np
import pytest

from care_core.logs.cdr_message import CdrDecoder, wide_size
from care_core.logs.ros_message import MalformedMessageError, parse_definition
from care_core.logs.ros_types import cdr_types
from tests.ros_samples import ROS2, cdr, definition, is_same, leaves, random_message, value_at

ZERO_NS = 5_000_000_000


@pytest.mark.parametrize("name", sorted(name for name in ROS2.fielddefs if "/msg/" in name))
def test_every_type_is_read_as_rosbags_reads_it(name: str) -> None:
    rng = np.random.default_rng(0)
    paths = tuple(leaves(ROS2, name))
    for little in (True, False, True):
        message = random_message(ROS2, name, rng)
        raw = cdr(message, little=little)
        types, wide = cdr_types(name, definition(name), "ros2msg", "", raw)
        decoder = CdrDecoder(name, types, paths, ZERO_NS, wide)
        values = dict(zip(decoder.paths, decoder.decode(b"x" + raw, 1, 1 + len(raw)), strict=True))
        expected: Any = ROS2.deserialize_cdr(raw, name)
        assert set(values) == set(paths)
        assert [path for path in paths if not is_same(values[path], value_at(expected, path, ZERO_NS))] == []
        one = CdrDecoder(name, types, paths[-1:], ZERO_NS)
        assert is_same(one.decode(raw, 0, len(raw))[0], values[paths[-1]])


CORNERS = """\
# bounds, defaults, constants, comments
uint8 KIND=3
string NAME="a # b"
string<=5 label "x = y"
float64[<=3] few
int16[2] pair [1, 2]
pkg/msg/Inner[] inners
wstring wide
byte last 7
"""


def test_definitions_with_bounds_defaults_and_constants() -> None:
    text = CORNERS + "=" * 80 + "\nMSG: pkg/Inner\nbool flag false\nwstring[] words\n"
    types = parse_definition("pkg/msg/Outer", text)
    fields = [(one.name, one.type, one.size) for one in types["pkg/Outer"]]
    assert fields == [
        ("label", "string", None), ("few", "float64", -1), ("pair", "int16", 2), ("inners", "pkg/Inner", -1),
        ("wide", "wstring", None), ("last", "byte", None),
    ]  # fmt: skip


@pytest.mark.parametrize("endian", ["<", ">"])
@pytest.mark.parametrize("wide", [2, 4])
def test_wide_text_of_either_middleware(endian: str, wide: int) -> None:
    encoding = f"utf-{8 * wide}-{'le' if endian == '<' else 'be'}"
    types = parse_definition("pkg/A", "wstring text\nuint8 last\n")
    raw = b"\0" + (b"\1" if endian == "<" else b"\0") + b"\0\0"
    raw += struct.pack(endian + "I", 5) + "añb→c".encode(encoding) + b"\x2a"
    assert wide_size("pkg/A", types, raw) == wide
    assert CdrDecoder("pkg/A", types, ("text", "last"), 0, wide).decode(raw, 0, len(raw)) == ["añb→c", 42]


def test_an_empty_message_takes_a_byte() -> None:
    text = "std_msgs/Empty nothing\nuint8 value\n" + "=" * 80 + "\nMSG: std_msgs/Empty\n"
    types, _ = cdr_types("pkg/A", text, "ros2msg", "", b"")
    assert CdrDecoder("pkg/A", types, ("value",), 0).decode(b"\0\1\0\0\0\x07", 0, 6) == [7]


def test_types_from_idl() -> None:
    text = (
        "=" * 80 + "\nIDL: pkg/msg/Outer\n#include \"pkg/msg/Inner.idl\"\nmodule pkg { module msg {\n"
        "  struct Outer { pkg::msg::Inner inner; sequence<double, 4> few; string name; };\n}; };\n"
        + "=" * 80 + "\nIDL: pkg/msg/Inner\nmodule pkg { module msg {\n"
        "  struct Inner { uint8 small; long number; };\n}; };\n"
    )  # fmt: skip
    types, _ = cdr_types("pkg/msg/Outer", text, "ros2idl", "", b"")
    raw = b"\0\1\0\0" + struct.pack("<B3xiI4xd", 1, -7, 1, 2.5) + struct.pack("<I", 3) + b"ab\0"
    small, number, few, name = CdrDecoder(
        "pkg/msg/Outer", types, ("inner.small", "inner.number", "few", "name"), 0
    ).decode(raw, 0, len(raw))
    assert (small, number, few.tolist(), name) == (1, -7, [2.5], "ab")


def test_definition_of_the_distribution_that_fits_the_message() -> None:
    name = "sensor_msgs/msg/RegionOfInterest"
    raw = cdr(random_message(ROS2, name, np.random.default_rng(1)))
    types, _ = cdr_types("sensor_msgs/RegionOfInterest", "", "", "galactic", raw)
    assert [one.name for one in types["sensor_msgs/RegionOfInterest"]][:2] == ["x_offset", "y_offset"]
    with pytest.raises(MalformedMessageError, match="no definition"):
        cdr_types("pkg/msg/Unknown", "", "", "humble", raw)


@pytest.mark.parametrize(
    ("text", "raw"),
    [
        ("string a", b"\0\1\0\0\xff\xff\xff\xff"),
        ("float64[] a", b"\0\1\0\0\xff\xff\xff\x7f"),
        ("string[] a", b"\0\1\0\0\x05\0\0\0\xff\0\0\0"),
        ("float64 a", b"\0\1\0\0\0"),
        ("float64 a", b"\0\3\0\0" + bytes(8)),
        ("float64 a", b""),
        ("float64[99999999999999999999] b\nfloat64 a", bytes(8)),
        ("a b c d", bytes(8)),
        ("Lost a", bytes(8)),
    ],
)
def test_bytes_that_are_no_message(text: str, raw: bytes) -> None:
    with pytest.raises(MalformedMessageError):
        CdrDecoder("pkg/A", parse_definition("pkg/A", text), ("a",), 0).decode(raw, 0, len(raw))


def test_a_definition_that_doubles_itself_is_refused() -> None:
    parts = [f"MSG: p/T{n}\n" + f"T{n + 1} a\nT{n + 1} b\n" for n in range(40)] + ["MSG: p/T40\nuint8 a\n"]
    text = "T0 a\n" + "".join("=" * 80 + f"\n{part}" for part in parts)
    with pytest.raises(MalformedMessageError, match="more than 5000 fields"):
        CdrDecoder("p/T", parse_definition("p/T", text), ("a.a",), 0)


def test_an_unset_time_is_nan() -> None:
    types = parse_definition("p/T", "builtin_interfaces/Time t\nbuiltin_interfaces/Duration d\n")
    unset, span = CdrDecoder("p/T", types, ("t", "d"), 0).decode(b"\0\1\0\0" + struct.pack("<iIiI", 0, 0, -1, 5), 0, 20)
    assert math.isnan(unset)
    assert span == pytest.approx(-1 + 5e-9)
