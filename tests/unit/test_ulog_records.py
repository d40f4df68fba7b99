"""The records of a ULog: what was written is found, whatever the fields, the order and the damage."""

from __future__ import annotations

import struct
import time
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from care_core import limits
from care_core.logs import file_windows
from care_core.logs.file_windows import FileArray
from care_core.logs.px4_ulog import Px4Log
from care_core.logs.ulog_formats import TYPES, Format, Layouts, UnusableFormatError, read_value
from care_core.logs.ulog_records import UlogContents, each_of, read_contents
from tests.rewritten import ULOG_MAGIC, ulog_keyed, ulog_record
from tests.whole import examples

START_US = 1_000_000
SYNC = ulog_record(b"S", bytes((0x2F, 0x73, 0x13, 0x20, 0x25, 0x0C, 0xBB, 0x12)))
FLAGS = ulog_record(b"B", bytes(40))
NAMES = ("alpha", "beta_status", "gamma")
FIELDS = st.lists(st.tuples(st.sampled_from([*TYPES]), st.none() | st.integers(1, 4)), min_size=1, max_size=5)


def head(*formats: str, flags: bytes = FLAGS) -> bytes:
    return (
        ULOG_MAGIC + struct.pack("<Q", START_US) + flags + b"".join(ulog_record(b"F", one.encode()) for one in formats)
    )


def subscription(number: int, name: str, multi_id: int = 0) -> bytes:
    return ulog_record(b"A", struct.pack("<BH", multi_id, number) + name.encode())


def message(number: int, stamp_us: int, more: bytes = b"") -> bytes:
    return ulog_record(b"D", struct.pack("<HQ", number, stamp_us) + more)


def contents_of(raw: bytes) -> UlogContents:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "a.ulg"
        path.write_bytes(raw)
        return read_contents(FileArray.open(path))


def stamps_of(raw: bytes) -> dict[str, list[int]]:
    return {topic.channel: stamps.tolist() for topic, _, stamps in each_of(contents_of(raw))}


def log_of(tmp_path: Path, raw: bytes) -> Px4Log:
    path = tmp_path / "a.ulg"
    path.write_bytes(raw)
    return Px4Log(path)


@given(st.data())
@settings(max_examples=examples(60), suppress_health_check=[HealthCheck.too_slow], deadline=None)
def test_what_was_written_is_found(data: st.DataObject) -> None:
    declared = {name: data.draw(FIELDS, name) for name in NAMES}
    texts = [
        f"{name}:uint64_t timestamp;" + "".join(
            f"{kind}{'' if count is None else f'[{count}]'} f{at};" for at, (kind, count) in enumerate(fields)
        ) for name, fields in declared.items()
    ]  # fmt: skip
    sizes = [sum(TYPES[kind].itemsize * (count or 1) for kind, count in fields) for fields in declared.values()]
    ids = data.draw(st.lists(st.integers(0, 65_535), min_size=3, max_size=3, unique=True), "ids")
    order = data.draw(st.lists(st.sampled_from(range(5)), max_size=60), "order")
    parts = [head(*texts), *(subscription(*pair) for pair in zip(ids, NAMES, strict=True))]
    written: dict[str, list[tuple[int, bytes]]] = {name: [] for name in NAMES}
    others = 0
    for at, which in enumerate(order):
        if which < len(NAMES):
            body = data.draw(st.binary(min_size=sizes[which], max_size=sizes[which]), "body")
            parts.append(message(ids[which], START_US + at, body))
            written[NAMES[which]].append((START_US + at, body))
        else:
            parts.append(SYNC if which == 3 else ulog_record(b"O", b"\1\0"))
            others += which == 4
    contents = contents_of(b"".join(parts))
    found = {topic.name: stamps.tolist() for topic, _, stamps in each_of(contents)}
    assert found == {name: [stamp for stamp, _ in own] for name, own in written.items() if own}
    assert len(contents.others) == others
    assert (contents.damage, contents.misfits) == ([], [])
    for topic in contents.topics:
        offset = 8
        for at, (kind, count) in enumerate(declared[topic.name]):
            for row in range(count or 1):
                field = topic.layout.find(f"f{at}" if count is None else f"f{at}[{row}]")
                assert field is not None
                assert (field.offset, field.dtype) == (offset, TYPES[kind])
                offset += field.dtype.itemsize


@given(st.binary(max_size=2000), st.integers(0, 2000))
@settings(max_examples=examples(150), deadline=None)
def test_no_bytes_raise(garbage: bytes, at: int) -> None:
    sound = head("alpha:uint64_t timestamp;float x;") + subscription(1, "alpha")
    sound += b"".join(message(1, START_US + row, bytes(4)) for row in range(20))
    contents_of(sound[: min(at, len(sound))] + garbage + sound[min(at, len(sound)) :])


@given(st.binary(min_size=1, max_size=300), st.integers(0, 39))
@example(b"\xcc\x00L\x00", 0)  # a text of 204 bytes, which ends where the seventh message does
@example(b"\xcc\x00D\x00", 0)
@settings(max_examples=examples(150), deadline=None)
def test_what_stands_between_records_costs_none(garbage: bytes, at: int) -> None:
    rows = [message(700, START_US + row, struct.pack("<4f", *range(4))) for row in range(40)]
    begin = head("alpha:uint64_t timestamp;float[4] x;") + subscription(700, "alpha")
    found = contents_of(begin + b"".join(rows[:at]) + garbage + b"".join(rows[at:]))
    # Garbage may begin as a record does that ends in the middle of the next.
    assert len(found.places) >= 39
    assert found.damage or found.misfits or found.others


def test_records_of_a_kind_that_is_not_known_are_left_out() -> None:
    rows = [message(3, START_US + row, bytes(16)) for row in range(40)]
    begin = head("alpha:uint64_t timestamp;float[4] x;") + subscription(3, "alpha")
    newer = ulog_record(b"Z", bytes(287))
    assert len(contents_of(begin + b"".join(rows[:9]) + newer + b"".join(rows[9:])).places) == 40
    # What looks like such a record, but has ten others in it, is none.
    assert len(contents_of(begin + newer[:8] + b"".join(rows)).places) == 40


@given(st.integers(0, 10_000))
@settings(max_examples=examples(100), deadline=None)
def test_a_cut_costs_the_record_that_it_is_in(size: int) -> None:
    rows = [message(700, START_US + row, bytes(6)) for row in range(50)]
    begin = head("alpha:uint64_t timestamp;uint8_t[6] x;") + subscription(700, "alpha")
    whole = begin + b"".join(rows)
    size = len(begin) + size % (len(whole) - len(begin))
    contents = contents_of(whole[:size])
    count, rest = divmod(size - len(begin), len(rows[0]))
    assert len(contents.places) == count
    assert [(one.what, one.byte) for one in contents.damage] == (
        [(f"cut in a record, {rest} bytes of it are there", size - rest)] if rest else []
    )


def broken(place: int, value: int, count: int = 30) -> tuple[dict[str, list[int]], Sequence[str]]:
    """A log whose tenth message has another byte at a place: its stamps, and what is said to be broken."""
    rows = [message(5, START_US + row, struct.pack("<f", 0.5)) for row in range(count)]
    raw = bytearray(rows[10])
    raw[place] = value
    rows[10] = bytes(raw)
    contents = contents_of(head("alpha:uint64_t timestamp;float x;") + subscription(5, "alpha") + b"".join(rows))
    damage = [*(one.what for one in contents.damage), *("misfit" for _ in contents.misfits)]
    return {topic.name: stamps.tolist() for topic, _, stamps in each_of(contents)}, damage


def test_a_wrong_length_costs_no_message() -> None:
    found, damage = broken(0, 200)
    assert len(found["alpha"]) == 30
    assert damage == ["the length of a record is wrong"]


def test_a_wrong_kind_and_a_wrong_id_cost_one_message() -> None:
    found, damage = broken(2, ord("!"))
    assert (len(found["alpha"]), damage) == (29, ["17 bytes are not readable records"])
    found, damage = broken(3, 99)
    assert (len(found["alpha"]), damage) == (29, ["misfit"])


def test_padding_at_the_end_may_be_there_or_not(tmp_path: Path) -> None:
    begin = head("alpha:uint64_t timestamp;uint8_t x;uint8_t[3] _padding0;") + subscription(1, "alpha")
    rows = [message(1, START_US + row * 1000, b"\7" + bytes(3 * (row % 2))) for row in range(10)]
    log = log_of(tmp_path, begin + b"".join(rows))
    table = log.read({"alpha": ("x",)})["alpha"]
    assert table["x"].tolist() == [7.0] * 10
    np.testing.assert_allclose(table.t, np.arange(10) / 1000)
    assert log.damage == ()


def test_topics_within_topics_and_instances(tmp_path: Path) -> None:
    formats = (
        "esc:uint64_t timestamp;uint8_t count;report[2] esc;",
        "report:int16_t rpm;uint8_t state;uint8_t _padding0;",
    )
    begin = head(*formats) + subscription(1, "esc") + subscription(2, "esc", 1)
    body = struct.pack("<Bhbxhbx", 2, 100, 1, -200, 3)
    log = log_of(tmp_path, begin + message(1, START_US, body) + message(2, START_US, body))
    fields = ("count", "esc[0].rpm", "esc[1].rpm", "esc[1].state", "esc[2].rpm", "esc", "esc[0]", "nothing", "count[0]")
    tables = log.read({"esc": fields, "esc#1": ("esc[1].rpm",), "esc#2": ("count",)})
    assert {name: column.tolist() for name, column in tables["esc"].columns.items()} == {
        "count": [2.0], "esc[0].rpm": [100.0], "esc[1].rpm": [-200.0], "esc[1].state": [3.0],
    }  # fmt: skip
    assert tables["esc#1"]["esc[1].rpm"].tolist() == [-200.0]
    assert "esc#2" not in tables


def test_appended_data_begins_where_the_flags_say() -> None:
    rows = [message(1, START_US + row) for row in range(6)]
    format, own = "alpha:uint64_t timestamp;", subscription(1, "alpha")
    cut = rows[2][:7]
    at = len(head(format)) + len(own) + 2 * len(rows[0]) + len(cut)
    flags = ulog_record(b"B", bytes(8) + b"\1" + bytes(7) + struct.pack("<3Q", at, 0, 0))
    raw = head(format, flags=flags) + own + rows[0] + rows[1] + cut + rows[3] + rows[4]
    contents = contents_of(raw)
    assert (contents.stamps_us - START_US).tolist() == [0, 1, 3, 4]
    assert [(one.what, one.byte) for one in contents.damage] == [("cut in a record, 7 bytes of it are there", at - 7)]


def test_what_only_newer_programs_can_read_is_said() -> None:
    flags = ulog_record(b"B", bytes(8) + b"\2" + bytes(31))
    raw = head("alpha:uint64_t timestamp;", flags=flags) + subscription(1, "alpha") + message(1, START_US)
    assert [one.what for one in contents_of(raw).damage] == [
        "the log says that only newer programs can read it: its values may be wrong"
    ]


def test_a_parameter_is_held_against_the_default_of_its_airframe(tmp_path: Path) -> None:
    """A default of the firmware alone stands beside a value that is the airframe's own."""

    def parameter(kind: bytes, name: str, value: float, bits: int | None = None) -> bytes:
        whole = ulog_keyed(kind, f"float {name}".encode(), struct.pack("<f", value))
        return whole if bits is None else ulog_record(kind, bytes([bits]) + whole[3:])

    flags = ulog_record(b"B", b"\1" + bytes(39))
    begin = head("alpha:uint64_t timestamp;", flags=flags)
    begin += parameter(b"P", "A", 1.0) + parameter(b"P", "B", 2.0) + parameter(b"P", "C", 3.0)
    begin += parameter(b"Q", "A", 1.5, 1) + parameter(b"Q", "A", 1.25, 2) + parameter(b"Q", "B", 2.5, 3)
    begin += parameter(b"Q", "C", 4.5, 1)
    later = (
        message(1, START_US) + message(1, START_US + 2_000_000) + parameter(b"P", "A", 9.0) + parameter(b"P", "A", 9.0)
    )
    log = log_of(tmp_path, begin + subscription(1, "alpha") + later)
    known = log.settings()
    assert [(one.value, one.default, one.changed_at_s) for one in known["A"]] == [(1.0, 1.25, None), (9.0, None, 2.0)]
    assert [(one.value, one.default) for one in (*known["B"], *known["C"])] == [(2.0, 2.5), (3.0, 3.0)]


def test_an_id_is_given_to_another_topic_once_it_was_taken_back() -> None:
    formats = ("alpha:uint64_t timestamp;", "gamma:uint64_t timestamp;uint8_t x;")
    again = subscription(1, "gamma")
    raw = head(*formats) + subscription(1, "alpha") + message(1, START_US)
    taken = contents_of(raw + again + message(1, START_US))
    assert [one.what for one in taken.damage] == ["message id 1 (alpha) is declared again as gamma"]
    assert stamps_of(raw + ulog_record(b"R", b"\1\0") + again + message(1, START_US, b"\0")) == {
        "alpha": [START_US], "gamma": [START_US],
    }  # fmt: skip


def test_formats_that_hold_themselves_or_too_much_are_refused() -> None:
    declared = [
        Format.parse(text)
        for text in (b"a:b x;", b"b:a[2] x;", b"big:wide[9999] x;", b"wide:uint64_t[9] x;", b"c:none x;")
    ]
    layouts = Layouts({one.name: one for one in declared if one is not None})
    for name in ("a", "b", "big", "c", "unknown"):
        with pytest.raises(UnusableFormatError):
            layouts.of(name)
    assert layouts.of("wide").size == 72
    for text in (b"", b"name", b":float x;", b"a:float;", b"a:float[x] y;", b"\xff:float x;"):
        assert Format.parse(text) is None


def test_values_of_keys() -> None:
    def value(declared: bytes, raw: bytes) -> object:
        return read_value(bytes([len(declared)]) + declared + raw)

    assert value(b"char[3] name", b"abc") == ("name", "abc")
    assert value(b"uint32_t number", struct.pack("<I", 7)) == ("number", 7)
    assert value(b"float[2] many", bytes(8)) == ("many", bytes(8))
    assert value(b"strange thing", b"\1") == ("thing", b"\1")
    assert value(b"int32_t short", b"\1") is None
    assert read_value(b"\x20ab") is None
    assert read_value(b"") is None


def test_the_windows_of_the_walk_change_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(0)
    begin = head("alpha:uint64_t timestamp;uint8_t[30] x;", "gamma:uint64_t timestamp;uint8_t[300] x;")
    parts = [begin, subscription(1, "alpha"), subscription(0x4444, "gamma")]
    for row in range(3000):
        kind, size = ((1, 30), (0x4444, 300))[int(rng.integers(2))]
        parts.append(message(kind, START_US + row, rng.integers(0, 256, size, np.uint8).tobytes()))
        if row == 1500:
            parts.append(rng.integers(0, 256, 5000, np.uint8).tobytes())
    raw = b"".join(parts)
    whole = contents_of(raw)
    monkeypatch.setattr(file_windows, "WINDOW", 1000)
    monkeypatch.setattr(limits, "HELD_BYTES", 0)
    small = contents_of(raw)
    assert len(whole.places) >= 2999
    np.testing.assert_array_equal(whole.places, small.places)
    np.testing.assert_array_equal(whole.stamps_us, small.stamps_us)
    assert (whole.damage, whole.misfits) == (small.damage, small.misfits)


@pytest.mark.parametrize("what", ["zeros", "noise", "texts", "headers", "subscriptions"])
def test_no_file_is_looked_through_for_ever(what: str, tmp_path: Path) -> None:
    rng, size = np.random.default_rng(0), 1_000_000
    raw = {
        "zeros": bytes(size),
        "noise": rng.integers(0, 256, size, np.uint8).tobytes(),
        "texts": ulog_record(b"L", b"6" + bytes(8)) * (size // 12),
        "headers": (message(1, START_US) + b"\xff\xffD") * (size // 16),
        "subscriptions": b"".join(
            subscription(n % 65_536, "alpha", n >> 16) + message(1, 0) for n in range(size // 24)
        ),
    }[what]
    path = tmp_path / "a.ulg"
    path.write_bytes(head("alpha:uint64_t timestamp;") + subscription(1, "alpha") + message(1, START_US) + raw)
    began = time.process_time()
    Px4Log(path).settings()
    assert time.process_time() - began < 10.0
