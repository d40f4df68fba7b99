"""What PX4 says by number is told in the words that the log brings along."""

from __future__ import annotations

import json
import lzma
import struct
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_core.logs.px4_events import ARGUMENT_BYTES, EventTexts
from care_core.logs.px4_ulog import Px4Log
from tests.rewritten import ULOG_MAGIC, ulog_keyed, ulog_record

MISSION, OFFBOARD = 1 << 3, 1 << 14
COMPONENT = 1 << 24
ACTIONS = {"5": {"name": "hold", "description": "Hold"}, "6": {"name": "rtl", "description": "RTL"}}
SIDES = {"1": {"name": "left", "description": "Left"}, "4": {"name": "up", "description": "Up"}}


def events(**groups: dict[int, tuple[str, list[str]]]) -> bytes:
    """Packed texts of one component with two enums, by group: number to message and types of its arguments."""
    declared = {
        group: {"events": {str(number): {"name": "e", "message": text,
                                         "arguments": [{"name": "a", "type": one} for one in types]}
                           for number, (text, types) in own.items()}}
        for group, own in groups.items()
    }  # fmt: skip
    enums = {
        "action_t": {"type": "uint8_t", "entries": ACTIONS},
        "sides_t": {"type": "uint16_t", "is_bitfield": True, "entries": SIDES},
    }
    return lzma.compress(
        json.dumps({"components": {"1": {"namespace": "px4", "enums": enums, "event_groups": declared}}}).encode()
    )


def text_of(message: str, types: list[str], arguments: bytes, group: str = "default") -> str:
    texts = EventTexts.parse(events(**{group: {7: (message, types)}}))
    assert texts is not None
    return texts.text(COMPONENT + 7, arguments.ljust(ARGUMENT_BYTES, b"\0"))


@pytest.mark.parametrize(
    ("message", "types", "arguments", "text"),
    [
        ("{2}: switching to {1}", ["px4::action_t", "uint16_t"], struct.pack("<BH", 6, 9), "9: switching to RTL"),
        ("climb to {1:.1m_v}", ["float"], struct.pack("<f", 30.04), "climb to 30.0 m"),
        ("wind above {1:.0m/s}, land", ["float"], struct.pack("<f", 12.0), "wind above 12 m/s, land"),
        ("{1m} off", ["int32_t"], struct.pack("<i", -4), "-4 m off"),
        ("sides: {1}", ["sides_t"], struct.pack("<H", 5), "sides: Left, Up"),
        ("mode {1}", ["action_t"], b"\x63", "mode 99"),
        ("set <param>COM_X</param>: 3 \\\\< 4 \\\\{a\\\\}".replace("\\\\", "\\"), [], b"", "set COM_X: 3 < 4 {a}"),
        ("nothing there: {3}", ["uint8_t"], b"\x01", "nothing there: ?"),
    ],
)
def test_a_text_has_its_arguments(message: str, types: list[str], arguments: bytes, text: str) -> None:
    assert text_of(message, types, arguments) == text


def test_a_check_counts_where_missions_ask_for_it() -> None:
    types = ["uint32_t", "uint8_t", "uint8_t"]
    said = text_of("Gyro {3} missing", types, struct.pack("<IBB", MISSION | OFFBOARD, 0, 1), "health")
    assert said == "Arming check: Gyro 1 missing"
    assert text_of("No offboard signal", types, struct.pack("<IBB", OFFBOARD, 0, 0), "arming_check") == ""


def test_what_is_not_known_says_nothing() -> None:
    texts = EventTexts.parse(events(default={7: ("hello", [])}))
    assert texts is not None
    assert texts.text(7, b"") == ""


@pytest.mark.parametrize(
    "metadata",
    [b"", b"nothing packed", lzma.compress(b"[]"), lzma.compress(b"{}"),
     lzma.compress(b'{"components": {"a": {"enums": {"x": {}}}}}'), lzma.compress(b"[" * 100_000),
     events(default={7: ("hello", ["no_type_t"])}), events()[:200]],
    ids=["none", "not packed", "a list", "no components", "no namespace", "deep", "an unknown type", "cut"],
)  # fmt: skip
def test_texts_that_cannot_be_read_are_none(metadata: bytes) -> None:
    assert EventTexts.parse(metadata) is None


@given(st.binary(max_size=40), st.lists(st.sampled_from(["uint8_t", "float", "uint64_t", "action_t", "sides_t"])))
def test_no_arguments_raise(arguments: bytes, types: list[str]) -> None:
    texts = EventTexts.parse(events(default={7: ("{1} {2:.3} {9}", types)}))
    assert texts is not None
    assert texts.text(COMPONENT + 7, arguments)


def write_log(path: Path, metadata: bytes, *said: tuple[int, int, int, bytes], strings: Any = ()) -> Px4Log:
    """A log with events (time in ms, number, levels, arguments) and strings (time in ms, text)."""
    parts = [ULOG_MAGIC + struct.pack("<Q", 0), ulog_record(b"B", bytes(40))]
    declared = b"event:uint64_t timestamp;uint32_t id;uint16_t event_sequence;uint8_t[25] arguments;uint8_t log_levels;"
    parts.append(ulog_record(b"F", declared))
    parts.append(ulog_keyed(b"I", f"uint8_t[{len(metadata)}] metadata_events".encode(), metadata))
    parts.append(ulog_record(b"A", b"\0" + struct.pack("<H", 3) + b"event"))
    for ms, number, levels, arguments in said:
        body = struct.pack("<HQIH25sB", 3, ms * 1000, number, 0, arguments.ljust(25, b"\0"), levels)
        parts.append(ulog_record(b"D", body))
    parts += (ulog_record(b"L", b"4" + struct.pack("<Q", ms * 1000) + text.encode()) for ms, text in strings)
    path.write_bytes(b"".join(parts))
    return Px4Log(path)


def test_events_are_told_among_the_strings_of_a_log(tmp_path: Path) -> None:
    metadata = events(
        default={7: ("{1}: switching to {2}", ["uint8_t", "action_t"]), 8: ("Armed", []), 9: ("Low battery", [])},
        arming_check={10: ("GPS fix too low", ["uint32_t"])},
    )
    log = write_log(
        tmp_path / "a.ulg", metadata,
        (1000, COMPONENT + 7, 0x42, bytes((3, 5))),
        (2000, COMPONENT + 8, 0x66, b""),  # of a level that asks for no attention
        (3000, COMPONENT + 9, 0x38, b""),  # for programs
        (4000, COMPONENT + 9, 0x33, b""),
        (5000, COMPONENT + 10, 0x33, struct.pack("<I", MISSION)),
        (6000, COMPONENT + 99, 0x22, b""),
        strings=[(4200, "[checks] LOW battery level"), (5100, "[commander] Preflight Fail: GPS fix too low")],
    )  # fmt: skip
    words = log.read({"logged_messages": ("level", "message")})["logged_messages"]
    assert list(zip(words.t.tolist(), words["level"], words["message"], strict=True)) == [
        (1.0, "CRITICAL", "3: switching to Hold"),
        (4.2, "WARNING", "[checks] LOW battery level"),
        (5.1, "WARNING", "[commander] Preflight Fail: GPS fix too low"),
    ]


def test_a_log_without_texts_has_its_strings(tmp_path: Path) -> None:
    log = write_log(tmp_path / "a.ulg", b"broken", (1000, 7, 0x22, b""), strings=[(1000, "said")])
    assert log.read({"logged_messages": ("message",)})["logged_messages"]["message"].tolist() == ["said"]
