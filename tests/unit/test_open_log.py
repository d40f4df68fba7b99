"""Choosing a reader by content, and saying what is wrong with a file that has none."""

from __future__ import annotations

import hashlib
import os
import struct
import sys
from pathlib import Path

import pytest

from care_core.errors import ExitCode, LogError
from care_core.logs import formats
from care_core.logs.digest import log_digest
from care_core.logs.opening import open_log, sniff


@pytest.mark.parametrize(
    ("head", "says"),
    [
        (b"SQLite format 3\0" + b"\0" * 80, "ROS 2 bag"),
        (b"\x28\xb5\x2f\xfd" + b"\0" * 80, "zstd"),
        (b"ULog\x01\x12\x35" + b"\0" * 80, "no message"),
        (b"\x1f\x8b\x08" + b"\0" * 80, "gzip"),
        (b"PK\x03\x04" + b"\0" * 80, "zip"),
        (b"\x89MCAP0\n" + b"\0" * 80, "line ends were changed"),
        (b"#ROSBAG V1.2\n" + b"\0" * 80, "format 1.x"),
        (b"#ROSRECORD V1.2\n" + b"\0" * 80, "format 1.x"),
        (b"FMT, 128, 89, FMT, BBnNZ, Type,Length\n", "no message"),
        (struct.pack(">Q", 1_600_000_000_000_000) + b"\xfd\x09\0\0" + b"\0" * 80, "no sound MAVLink packet"),
        ((b"\xfe\x01" + b"\0" * 7) * 9, "without time stamps"),
        (b"hello, this is no log at all", "known format"),
        (b"", "empty"),
    ],
)
def test_names_what_cannot_be_read(tmp_path: Path, head: bytes, says: str) -> None:
    path = tmp_path / "run.BIN"
    path.write_bytes(head)
    with pytest.raises(LogError, match=says) as caught:
        open_log(path)
    assert caught.value.exit_code is ExitCode.UNREADABLE
    assert caught.value.hint
    assert caught.value.where == str(path)


def test_the_name_of_a_file_does_not_matter(tmp_path: Path) -> None:
    bag, log = tmp_path / "a.BIN", tmp_path / "b.bag"
    bag.write_bytes(b"#ROSBAG V2.0\n" + b"\0" * 80)
    log.write_bytes(b"\xa3\x95\x80" + b"\0" * 86)
    assert sniff(bag) is formats.ROS1_BAG
    assert sniff(log) is formats.DATAFLASH_BIN


def test_a_damaged_first_byte_does_not_hide_a_dataflash_log(tmp_path: Path) -> None:
    path = tmp_path / "a.BIN"
    path.write_bytes((b"\0" + b"\x95\x80" + b"\0" * 86) + b"\xa3\x95\x80" + b"\0" * 86)
    assert sniff(path) is formats.DATAFLASH_BIN


def test_a_missing_file_and_a_folder(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="No such file"):
        open_log(tmp_path / "none.BIN")
    with pytest.raises(LogError, match="folder"):
        open_log(str(tmp_path))
    (tmp_path / "metadata.yaml").write_text("rosbag2_bagfile_information: {}")
    with pytest.raises(LogError, match="ROS 2 bag folder"):
        open_log(tmp_path)


@pytest.mark.skipif(sys.platform == "win32" or os.geteuid() == 0, reason="root may read everything")
def test_no_permission(tmp_path: Path) -> None:
    path = tmp_path / "a.BIN"
    path.write_bytes(b"\xa3\x95\x80")
    path.chmod(0)
    with pytest.raises(LogError, match="permission"):
        open_log(path)


def test_digest(tmp_path: Path) -> None:
    path = tmp_path / "a.BIN"
    path.write_bytes(b"abc" * 500_000)
    assert log_digest(path) == hashlib.sha256(b"abc" * 500_000).hexdigest()
    with pytest.raises(LogError, match="No such file"):
        log_digest(tmp_path / "none")
