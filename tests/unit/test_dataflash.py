"""The DataFlash reader against pymavlink message by message, on logs written here, and on damaged ones."""

from __future__ import annotations

import math
import os
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from care_core.errors import LogError
from care_core.logs.ardupilot import parameters_of, shortest
from care_core.logs.base import Table
from care_core.logs.dataflash import DataFlashLog
from tests.whole import examples

HEAD = b"\xa3\x95"


def fmt(number: int, name: str, code: str, columns: str, length: int) -> bytes:
    """An FMT record."""
    body = struct.pack("<BB4s16s64s", number, length, name.encode(), code.encode(), columns.encode())
    return HEAD + b"\x80" + body


def record(number: int, layout: str, *values: object) -> bytes:
    return HEAD + bytes([number]) + struct.pack("<" + layout, *values)


HEADER = (
    fmt(0x80, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns", 89)
    + fmt(1, "MSG", "QZ", "TimeUS,Message", 75)
    + fmt(2, "PARM", "QNff", "TimeUS,Name,Value,Default", 35)
    + fmt(3, "TST", "QBc", "TimeUS,I,Angle", 14)
)


def samples(count: int, since_us: int = 1_000_000) -> list[bytes]:
    return [record(3, "QBh", since_us + i * 100_000, i % 2, 150 * i) for i in range(count)]


def write(path: Path, *parts: bytes) -> Path:
    path.write_bytes(b"".join(parts))
    return path


def test_reads_times_and_scaled_fields_from_the_first_timestamp(tmp_path: Path) -> None:
    log = DataFlashLog(write(tmp_path / "a.BIN", HEADER, *samples(4)))
    table = log.read({"TST": ("I", "Angle", "NoSuchField"), "NONE": ("X",)})["TST"]
    np.testing.assert_allclose(table.t, [0.0, 0.1, 0.2, 0.3])
    np.testing.assert_allclose(table["Angle"], [0.0, 1.5, 3.0, 4.5])
    assert set(table.columns) == {"I", "Angle"}
    assert log.duration_s == pytest.approx(0.3)
    assert log.damage == ()
    assert log.start is None


def test_channels_count_and_rate(tmp_path: Path) -> None:
    log = DataFlashLog(write(tmp_path / "a.BIN", HEADER, *samples(11)))
    channel = next(one for one in log.channels() if one.name == "TST")
    assert (channel.count, channel.type) == (11, "QBc")
    assert channel.rate_hz == pytest.approx(10.0)


def test_settings_keep_every_value_and_the_default(tmp_path: Path) -> None:
    parms = [
        record(2, "Q16sff", 1_000_000, b"ANGLE_MAX", 3000.0, 3000.0),
        record(2, "Q16sff", 1_000_000, b"PSC_VELXY_P", 0.135, math.nan),
        record(2, "Q16sff", 2_000_000, b"ANGLE_MAX", 3000.0, 3000.0),
        record(2, "Q16sff", 3_000_000, b"ANGLE_MAX", 1200.0, 3000.0),
    ]
    found = DataFlashLog(write(tmp_path / "a.BIN", HEADER, *parms)).settings()
    assert [(one.value, one.changed_at_s, one.default) for one in found["ANGLE_MAX"]] == [
        (3000.0, None, 3000.0),
        (1200.0, 2.0, 3000.0),
    ]
    assert found["PSC_VELXY_P"][0].value == 0.135
    assert found["PSC_VELXY_P"][0].default is None


def test_facts_name_firmware_and_frame(tmp_path: Path) -> None:
    texts = (b"Frame: QUAD/PLUS", b"ArduCopter V4.5.4 (fd1bcc61)", b"Mission: 1 Takeoff")
    log = DataFlashLog(write(tmp_path / "a.BIN", HEADER, *(record(1, "Q64s", 5, text) for text in texts)))
    assert log.facts == {
        "firmware": "ArduCopter V4.5.4 (fd1bcc61)", "vehicle": "multicopter", "frame": "QUAD/PLUS"
    }  # fmt: skip


def test_wall_clock_comes_from_the_gps(tmp_path: Path) -> None:
    gps = fmt(4, "GPS", "QIH", "TimeUS,GMS,GWk", 17)
    fixes = [record(4, "QIH", 1_000_000, 0, 0), record(4, "QIH", 3_000_000, 20_000, 2086)]
    log = DataFlashLog(write(tmp_path / "a.BIN", HEADER, gps, *fixes))
    # Week 2086 began on 2019-12-29; 18 leap seconds, and the first timestamp two seconds earlier.
    assert log.start == "2019-12-29T00:00:00+00:00"


def test_header_bytes_inside_a_record_are_not_a_record(tmp_path: Path) -> None:
    tricky_us = 0x95A3_03_95A3
    tricky = record(3, "QBh", tricky_us, 1, 0)
    log = DataFlashLog(
        write(tmp_path / "a.BIN", HEADER, *samples(2, tricky_us - 200_000), tricky, *samples(2, tricky_us + 100_000))
    )
    assert len(log.read({"TST": ("I",)})["TST"]) == 5
    assert log.damage == ()


def test_a_gap_is_reported_and_what_follows_is_read(tmp_path: Path) -> None:
    before, after = samples(3), samples(3, 2_000_000)
    log = DataFlashLog(write(tmp_path / "a.BIN", HEADER, *before, b"\0" * 50, *after))
    assert len(log.read({"TST": ("I",)})["TST"]) == 6
    (gap,) = log.damage
    assert gap.what == "50 bytes are not readable records"
    assert gap.byte == len(HEADER) + 3 * 14
    assert gap.time_s == pytest.approx(0.2)


def test_a_record_cut_in_the_middle_is_dropped(tmp_path: Path) -> None:
    rows = samples(6)
    rows[2] = rows[2][:8]
    log = DataFlashLog(write(tmp_path / "a.BIN", HEADER, *rows))
    np.testing.assert_allclose(log.read({"TST": ("Angle",)})["TST"]["Angle"], [0.0, 1.5, 4.5, 6.0, 7.5])
    assert len(log.damage) == 1


def test_a_type_declared_again_is_reported_and_read_both_ways(tmp_path: Path) -> None:
    again = fmt(3, "TST", "QBcf", "TimeUS,I,Angle,Extra", 18)
    new = record(3, "QBhf", 9_000_000, 1, 200, 7.0)
    log = DataFlashLog(write(tmp_path / "a.BIN", HEADER, *samples(2), again, new))
    table = log.read({"TST": ("Angle", "Extra")})["TST"]
    np.testing.assert_allclose(table["Angle"], [0.0, 1.5, 2.0])
    np.testing.assert_allclose(table["Extra"], [np.nan, np.nan, 7.0])
    assert "declared again" in log.damage[0].what


def test_definitions_alone_are_no_log(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="no message"):
        DataFlashLog(write(tmp_path / "a.BIN", HEADER))


def test_reading_is_silent_and_does_not_write(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "logs"
    folder.mkdir()
    path = write(folder / "a.BIN", HEADER, *samples(3), b"junk" * 300, *samples(2))
    stamp = path.stat().st_mtime_ns
    log = DataFlashLog(path)
    log.read({"TST": ("I",)})
    assert capfd.readouterr() == ("", "")
    assert (path.stat().st_mtime_ns, [one.name for one in folder.iterdir()]) == (stamp, ["a.BIN"])


def test_a_file_cut_while_open_is_read_to_its_end(tmp_path: Path) -> None:
    path = write(tmp_path / "a.BIN", HEADER, *samples(3))
    log = DataFlashLog(path)
    path.write_bytes(HEADER)
    assert len(log.read({"TST": ("I",)})["TST"]) == 3


@settings(max_examples=examples(60), deadline=None)
@given(st.data())
def test_damage_never_raises_anything_but_log_error(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    whole = bytearray(HEADER + b"".join(samples(20)))
    for _ in range(data.draw(st.integers(0, 6))):
        at = data.draw(st.integers(0, len(whole) - 1))
        action = data.draw(st.sampled_from(("flip", "drop", "insert")))
        if action == "flip":
            whole[at] ^= data.draw(st.integers(1, 255))
        elif action == "drop":
            del whole[at : at + data.draw(st.integers(1, 40))]
        else:
            whole[at:at] = data.draw(st.binary(min_size=1, max_size=40))
        if not whole:
            whole = bytearray(b"\0")
    path = tmp_path_factory.mktemp("damaged") / "a.BIN"
    path.write_bytes(bytes(whole[: data.draw(st.integers(1, len(whole)))]))
    try:
        log = DataFlashLog(path)
    except LogError:
        return
    tables = log.read({one.name: ("I", "Angle", "Message") for one in log.channels()})
    assert all(len(column) == len(table) for table in tables.values() for column in table.columns.values())
    assert log.settings() is not None
    assert log.facts is not None


SHARED = os.environ.get("CARE_SHARED")
needs_logs = pytest.mark.skipif(SHARED is None, reason="CARE_SHARED names no folder of recorded logs")
SOUND = ("all_field_types", "ardusub_small", "copter402_chibios_sample01", "copter41_sitl", "copter46_cut_80k",
         "copter47_sitl_adgfuzz")  # fmt: skip


@needs_logs
@pytest.mark.parametrize("name", SOUND)
def test_agrees_with_pymavlink_message_by_message(name: str) -> None:
    reader = pytest.importorskip("pymavlink.DFReader")
    path = next(Path(SHARED or "", "logs", "dataflash_bin").glob(f"{name}.*"))
    log = DataFlashLog(path)
    theirs: dict[str, list[dict[str, Any]]] = {}
    with reader.DFReader_binary(str(path)) as peer:
        while (message := peer.recv_match()) is not None:
            theirs.setdefault(message.get_type(), []).append(message.to_dict())
    ours = log.read({kind: tuple(rows[0]) for kind, rows in theirs.items()})
    assert set(ours) == set(theirs)
    assert {one.name: one.count for one in log.channels()} == {kind: len(rows) for kind, rows in theirs.items()}
    for kind, rows in theirs.items():
        for field, column in ours[kind].columns.items():
            expected = [row[field] for row in rows]
            if field == "mavpackettype" or kind == "FILE":
                continue
            if column.dtype == object:
                plain = [value if isinstance(value, str) else tuple(value) for value in expected]
                assert column[: len(rows)].tolist() == plain, (kind, field)
            else:
                numbers = np.array(expected, dtype=float)
                np.testing.assert_allclose(column[: len(rows)], numbers, err_msg=f"{kind}.{field}")


@needs_logs
def test_reads_a_wild_log_with_a_broken_tail() -> None:
    log = DataFlashLog(Path(SHARED or "", "logs", "dataflash_bin", "copter402_chibios_sample01.bin"))
    assert log.facts["firmware"] == "ArduCopter V4.0.2 (2cb4b85a)"
    assert log.start == "2020-03-03T11:49:20+00:00"
    assert len(log.settings()) == 1027
    assert [one.what for one in log.damage] == ["the log breaks off inside a record, its last 38 bytes"]


def test_a_parameter_that_is_not_a_number_is_one_as_driven() -> None:
    names = np.array(["A", "B", "A"], dtype=object)
    table = Table(np.arange(3.0), {"Name": names, "Value": np.array([np.nan, np.inf, np.nan])})
    found = parameters_of(table, shortest)
    assert [(name, len(history)) for name, history in found.items()] == [("A", 1), ("B", 1)], "said again, no change"
    assert math.isnan(float(found["A"][0].value))
