"""DataFlash logs as text: the same answers as the .BIN, old firmwares, broken lines, and pymavlink as the judge."""

from __future__ import annotations

import math
import os
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from care_core.ecosystems.registry import run_model
from care_core.errors import ProfileError
from care_core.extract.read import read_run
from care_core.logs.opening import open_log
from care_core.profile.store import load_profile
from tests.rewritten import write_text

SAMPLE = Path(__file__).parents[2] / "samples" / "arducopter_failed.BIN"
OLD = """ArduCopter V3.1

FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format
FMT, 129, 23, PARM, Nf, Name,Value
FMT, 130, 45, GPS, BIHL, Status,TimeMS,Week,T
FMT, 1, 19, ATT, cc, Roll,Pitch
FMT, 132, 67, MSG, Z, Message
FMT, 3, 6, MODE, Mh, Mode,ThrCrs
PARM, RTL_ALT, 1500
PARM, BAD, nan
GPS, 3, 56674000, 1777, 95000
ATT, 1.5, -2
MODE, Stabilize, 424
GPS, 3, 56675000, 1777, 96000
ATT, nan, 3
MSG, one, two
"""


def test_the_same_log_as_text_gives_the_same_answers(tmp_path: Path) -> None:
    wanted = {"ATT": ("Roll", "DesYaw"), "POS": ("Lat", "Lng"), "MSG": ("Message",), "BAT": ("Volt",), "CMD": ("CId",)}
    binary, text = open_log(SAMPLE), open_log(write_text(tmp_path / "a.log", SAMPLE, only=(*wanted, "PARM", "GPS")))
    for name, table in binary.read(wanted).items():
        other = text.read(wanted)[name]
        np.testing.assert_allclose(other.t, table.t, atol=2e-6)
        for field in wanted[name]:
            np.testing.assert_array_equal(other[field], table[field])
    assert text.facts == binary.facts
    assert text.start == binary.start
    assert {name: history[0].value for name, history in text.settings().items()} == {
        name: pytest.approx(history[0].value, rel=1e-6) for name, history in binary.settings().items()
    }
    assert text.damage == ()


def test_an_old_firmware_stamps_few_messages(tmp_path: Path) -> None:
    path = tmp_path / "old.log"
    path.write_bytes(OLD.replace("\n", "\r\n").encode())
    log = open_log(path)
    tables = log.read({"ATT": ("Roll",), "MSG": ("Message",), "MODE": ("Mode",), "PARM": ("Name",)})
    assert tables["ATT"].t.tolist() == [0.0, 1.0]
    assert [str(value) for value in tables["ATT"]["Roll"]] == ["1.5", "nan"]
    assert tables["MSG"]["Message"].tolist() == ["one, two"]
    assert tables["MODE"]["Mode"].tolist() == ["Stabilize"]
    values = {name: str(history[0].value) for name, history in log.settings().items()}
    assert values == {"BAD": "nan", "RTL_ALT": "1500.0"}
    assert log.facts == {"firmware": "ArduCopter V3.1", "vehicle": "multicopter"}
    assert log.start == "2014-01-26T15:44:16+00:00"
    assert (log.duration_s, log.damage) == (1.0, ())


def test_broken_lines_are_damage(tmp_path: Path) -> None:
    path = tmp_path / "broken.log"
    path.write_text(OLD + "ATT, 1\nXYZ, 4\nATT, x, 2\nGPS, 3, 1, 1777, 99000000000\nATT, 2, 2\nATT, 3")
    log = open_log(path)
    assert log.read({"ATT": ("Roll",)})["ATT"]["Roll"][-1] == 2.0
    assert [one.what for one in log.damage] == [
        "a line's time is impossible",
        "a line is no whole ATT",
        "a line is no message that the log declares",
        "a line is no whole ATT",
        "a line is no whole ATT",
    ]
    assert log.duration_s == 1.0
    assert log.damage[-1].byte == path.read_text().rindex("ATT")


def test_without_stamps_there_is_no_mission_to_judge(tmp_path: Path) -> None:
    path = tmp_path / "a.log"
    head = "FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format\nFMT, 13, 4, EV, B, Id\nFMT, 1, 19, ATT, cc, Roll,Pitch\n"
    path.write_text(head + "EV, 10\nATT, 1, 2\nEV, 11\n")
    with pytest.raises(ProfileError, match="No message of the log has a time stamp"):
        read_run(run_model(open_log(path)), load_profile("arducopter").schema)


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        (["1, 2", "3e-05,-4.5", "nan, inf"], [(1, 2), (3e-05, -4.5), (math.nan, math.inf)]),
        (["1, 2", "3, 4, 5"], [(1, 2), (3, 4)]),  # one value more than declared
        (["1, 2", "3", "4, 5, 6"], [(1, 2), (4, 5)]),  # as many values as there should be, but not on each line
        (["1, 2", "3, ", "4x, 5", "0x6, 7", "8 9, 1"], [(1, 2)]),
        (["1, 2", "1_0, 3"], [(1, 2), (10, 3)]),
    ],
)
def test_lines_are_parsed_together_as_they_are_one_by_one(
    tmp_path: Path, lines: list[str], expected: list[tuple[float, float]]
) -> None:
    path = tmp_path / "a.log"
    head = "FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\nFMT, 1, 19, ATT, Qff, TimeUS,Roll,Pitch\n"
    path.write_text(head + "".join(f"ATT, {1000 * row}, {line}\n" for row, line in enumerate(lines)))
    log = open_log(path)
    table = log.read({"ATT": ("Pitch", "Roll")})["ATT"]
    np.testing.assert_array_equal(np.column_stack([table["Roll"], table["Pitch"]]), expected)
    assert len(log.damage) == len(lines) - len(expected)


def test_without_any_stamp_time_is_counted_from_a_steady_message(tmp_path: Path) -> None:
    head = "FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format\nFMT, 13, 4, EV, B, Id\nFMT, 4, 19, CTUN, h, ThrIn\n"
    path = tmp_path / "apm.log"
    path.write_text(head + "EV, 10\n" + "CTUN, 500\n" * 51 + "EV, 11\n")
    log = open_log(path)
    tables = log.read({"EV": ("Id",), "CTUN": ("ThrIn",)})
    assert log.duration_s == pytest.approx(5.0)
    np.testing.assert_allclose(tables["EV"].t, [0.0, 5.0])
    np.testing.assert_allclose(tables["CTUN"].t, np.arange(51) / 10)
    assert log.facts["clock"] == "counted from CTUN, 10 a second"
    assert log.damage == ()


SHARED = os.environ.get("CARE_SHARED")


@pytest.mark.skipif(SHARED is None, reason="CARE_SHARED names no folder of recorded logs")
@pytest.mark.parametrize("name", ["mechanical_fail", "nan", "underpowered"])
def test_agrees_with_pymavlink_message_by_message(name: str) -> None:
    reader = pytest.importorskip("pymavlink.DFReader")
    path = Path(SHARED or "", "logs", "dataflash_text", f"{name}.log")
    theirs: dict[str, list[Any]] = defaultdict(list)
    peer = reader.DFReader_text(str(path))
    while (message := peer.recv_msg()) is not None:
        theirs[message.get_type()].append(message)
    log = open_log(path)
    assert {one.name: one.count for one in log.channels()} == {kind: len(rows) for kind, rows in theirs.items()}
    theirs.pop("FMT")
    tables = log.read({kind: tuple(rows[0]._fieldnames) for kind, rows in theirs.items()})
    for kind, rows in theirs.items():
        for field, column in tables[kind].columns.items():
            assert all(map(same, column, (getattr(row, field) for row in rows))), (kind, field)
    assert log.damage == ()


def same(ours: Any, their: Any) -> bool:
    return bool(ours == their) or (isinstance(their, float) and math.isnan(their) and math.isnan(ours))
