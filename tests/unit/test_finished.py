"""Which logs are finished: by names and sizes, at rest for long enough, on a clock that only goes forward."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from care_core.logs.finished import FileStatus, StabilityTimeout, is_as_it_was, look, not_closed

MCAP = b"\x89MCAP0\r\n"


def write(path: Path, content: bytes = b"x") -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)
    return path


def names(sights: list[FileStatus], folder: Path) -> dict[str, str]:
    return {str(sight.path.relative_to(folder)): sight.open_by for sight in sights}


def test_a_log_is_finished_when_it_rests(tmp_path: Path) -> None:
    log = write(tmp_path / "1.BIN")
    patience = StabilityTimeout(quiet_s=10.0, abandoned_s=100.0)
    assert patience.rested(look([tmp_path]), 0.0) == []
    assert patience.rested(look([tmp_path]), 9.9) == []
    write(log, b"xx")
    assert patience.rested(look([tmp_path]), 12.0) == [], "it grew"
    assert patience.rested(look([tmp_path]), 21.0) == []
    assert [sight.path for sight in patience.rested(look([tmp_path]), 22.0)] == [log]


def test_neither_the_clock_on_the_wall_nor_that_of_the_log_counts(tmp_path: Path) -> None:
    """A log of a robot without a clock is of 1970, or of next year; while a laptop sleeps its steady clock stands."""
    patience = StabilityTimeout(quiet_s=10.0)
    for number, stamp in enumerate((0, 4e9)):
        os.utime(write(tmp_path / f"{number}.BIN"), (stamp, stamp))
    assert patience.rested(look([tmp_path]), 0.0) == []
    assert len(patience.rested(look([tmp_path]), 10.0)) == 2


def test_a_folder_that_comes_back_is_waited_for_again(tmp_path: Path) -> None:
    stick = tmp_path / "stick"
    write(stick / "1.BIN")
    patience = StabilityTimeout(quiet_s=10.0)
    patience.rested(look([stick]), 0.0)
    stick.rename(tmp_path / "away")
    assert patience.rested(look([stick]), 5.0) == []
    (tmp_path / "away").rename(stick)
    assert patience.rested(look([stick]), 11.0) == [], "it was not there all the while"
    assert len(patience.rested(look([stick]), 21.0)) == 1


@pytest.mark.parametrize(
    ("log", "beside", "why"),
    [
        ("drive.bag.active", "other.txt", ".active"),
        ("1.BIN", "1.BIN.part", "1.BIN.part"),
        ("1.BIN", "1.xYz.BIN.part", "1.xYz.BIN.part"),
        ("1.BIN", "1.BIN.crdownload", "crdownload"),
        ("1.BIN", "1.BIN.filepart", "filepart"),
        ("1.tlog", "1.tlog.tmp", "tmp"),
        ("1.BIN", ".1.BIN.aB3x", ".1.BIN.aB3x"),
        ("1.db3", "1.db3-wal", "1.db3-wal"),
        ("1.db3", "1.db3-journal", "journal"),
    ],
)
def test_what_is_written_or_fetched_is_given_up_only_after_long(
    tmp_path: Path, log: str, beside: str, why: str
) -> None:
    write(tmp_path / log)
    write(tmp_path / beside)
    write(tmp_path / "12.BIN.part")  # of another log
    patience = StabilityTimeout(quiet_s=1.0, abandoned_s=60.0)
    patience.rested(look([tmp_path]), 0.0)
    assert patience.rested(look([tmp_path]), 59.0) == []
    (given_up,) = patience.rested(look([tmp_path]), 60.0)
    assert given_up.path == tmp_path / log
    assert why in given_up.open_by
    (tmp_path / beside).unlink()
    if not log.endswith(".active"):
        assert [sight.open_by for sight in patience.rested(look([tmp_path]), 61.0)] == [""]


def test_an_empty_file_is_the_place_of_one_that_comes(tmp_path: Path) -> None:
    write(tmp_path / "1.BIN", b"")
    assert names(look([tmp_path]), tmp_path) == {"1.BIN": "it is empty"}


def test_a_ros2_recording_is_finished_with_its_metadata_and_all_files(tmp_path: Path) -> None:
    bag = tmp_path / "rosbag2_x"
    write(bag / "rosbag2_x_0.mcap")
    assert names(look([tmp_path]), tmp_path) == {"rosbag2_x": "its recorder has not written metadata.yaml"}
    listed = "rosbag2_bagfile_information:\n  relative_file_paths: [rosbag2_x_0.mcap, rosbag2_x_1.mcap]\n"
    write(bag / "metadata.yaml", listed.encode())
    assert "rosbag2_x_1.mcap, which is not there" in look([tmp_path])[0].open_by
    write(bag / "rosbag2_x_1.mcap")
    assert names(look([tmp_path]), tmp_path) == {"rosbag2_x": ""}
    assert is_as_it_was(look([tmp_path])[0])


def test_a_split_bag_is_one_recording_and_open_while_its_last_part_is(tmp_path: Path) -> None:
    bag = tmp_path / "drive"
    write(bag / "d_2024-01-02-03-04-05_0.bag")
    write(bag / "d_2024-01-02-03-09-05_1.bag.active")
    assert ".active" in names(look([tmp_path]), tmp_path)["drive"]
    (bag / "d_2024-01-02-03-09-05_1.bag.active").rename(bag / "d_2024-01-02-03-09-05_1.bag")
    assert names(look([tmp_path]), tmp_path) == {"drive": ""}


def test_bags_that_people_numbered_are_runs_of_their_own(tmp_path: Path) -> None:
    for number in range(3):
        write(tmp_path / f"drive_{number}.bag")
    assert len(look([tmp_path])) == 3


def test_hidden_files_and_folders_hold_no_logs(tmp_path: Path) -> None:
    for place in (".Trash-1000/1.BIN", "._2.BIN", "sub/3.BIN"):
        write(tmp_path / place)
    assert names(look([tmp_path, tmp_path / "sub", tmp_path / "none"]), tmp_path) == {"sub/3.BIN": ""}


@pytest.mark.parametrize(
    ("content", "closed"),
    [
        (MCAP + b"data" + MCAP, True),
        (MCAP + b"data", False),
        (MCAP, False),
        (b"#ROSBAG V2.0\n\x45\0\0\0\x12\0\0\0index_pos=" + bytes(8), False),
        (b"#ROSBAG V2.0\n\x45\0\0\0\x12\0\0\0index_pos=" + bytes(7) + b"\1", True),
        (b"\xa3\x95\x80", True),
    ],
)
def test_what_a_recorder_writes_last(tmp_path: Path, content: bytes, closed: bool) -> None:
    log = write(tmp_path / "1.mcap", content)
    assert (not_closed(log) == "") is closed
    patience = StabilityTimeout(quiet_s=1.0, abandoned_s=5.0)
    patience.rested(look([tmp_path]), 0.0)
    assert bool(patience.rested(look([tmp_path]), 1.0)) is closed
    assert patience.rested(look([tmp_path]), 6.0)


def test_what_changed_or_is_gone_is_not_as_it_was(tmp_path: Path) -> None:
    log = write(tmp_path / "1.BIN")
    (sight,) = look([tmp_path])
    assert is_as_it_was(sight)
    write(log, b"longer")
    assert not is_as_it_was(sight)
    log.unlink()
    assert not is_as_it_was(sight)
