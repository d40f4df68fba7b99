"""Every walk of folders finds the logs that are there, whatever else lies beside them."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import pytest

from care_core.errors import LogError, UsageError
from care_core.files import bundled
from care_core.fleet.sources import gather
from care_core.logs.digest import log_digest
from care_core.logs.finding import find_logs, logs_below
from care_core.logs.finished import look
from care_core.logs.opening import open_log
from care_tui.places import logs_in
from tests.ros_samples import write_mcap

SAMPLE = bundled("samples", "arducopter_failed.BIN")
DEEP = 1200
METADATA = "rosbag2_bagfile_information:\n  version: 5\n  relative_file_paths: [run_0.mcap]\n"

Walk = Callable[[Path], Iterable[Path]]


def _of_a_fleet(place: str) -> list[Path]:
    return [source.path for source in gather([place]) if source.path]


WALKS: dict[str, Walk] = {
    "of commands": lambda folder: find_logs([folder]),
    "of campaigns": logs_below,
    "of the watcher": lambda folder: [sight.path for sight in look([folder])],
    "of a fleet": lambda folder: _of_a_fleet(str(folder)),
    "of a fleet's pattern": lambda folder: _of_a_fleet(f"{folder}/**/*"),
    "of a fleet's URL": lambda folder: _of_a_fleet(folder.as_uri()),
    "of the app": logs_in,
}


def _spoil(folder: Path) -> None:
    """Put into a folder what cannot be looked at."""
    (folder / "0.BIN").symlink_to("0.BIN")
    (folder / "1loop").symlink_to("2loop")
    (folder / "2loop").symlink_to("1loop")
    (folder / "gone.BIN").symlink_to("nowhere")
    (folder / "up").symlink_to("..")
    (folder / "self").symlink_to(".")
    os.mkfifo(folder / "pipe.BIN")
    (folder / "long.BIN").symlink_to("x" * 255 + "/" + "y" * 255)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A log, one more below, and a recording, with such entries before and behind them."""
    folder = tmp_path / "logs"
    (folder / "below").mkdir(parents=True)
    shutil.copy(SAMPLE, folder / "good.BIN")
    shutil.copy(SAMPLE, folder / "below" / "good.BIN")
    for place in (folder, folder / "below"):
        _spoil(place)
    return folder


@pytest.fixture
def locked(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """With a folder that may not be looked into: said by the system itself, as root may look into any."""
    (folder / "a locked one").mkdir()
    scandir, access = os.scandir, os.access

    def refuse(place: Any = ".") -> Any:
        if "locked" in str(place):
            raise PermissionError(13, "Permission denied", str(place))
        return scandir(place)

    monkeypatch.setattr(os, "scandir", refuse)
    monkeypatch.setattr(os, "access", lambda place, mode: "locked" not in str(place) and access(place, mode))
    return folder


@pytest.mark.parametrize("name", WALKS)
def test_an_entry_that_cannot_be_looked_at_hides_no_other(name: str, locked: Path) -> None:
    if "URL" in name:
        pytest.importorskip("fsspec")
    assert {*WALKS[name](locked)} == {locked / "good.BIN", locked / "below" / "good.BIN"}


@pytest.mark.parametrize("name", WALKS)
def test_what_vanishes_while_it_is_looked_at_hides_no_other(
    name: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if "URL" in name:
        pytest.importorskip("fsspec")
    shutil.copy(SAMPLE, folder / "vanishing.BIN")
    scandir = os.scandir

    def vanish(place: Any = ".") -> Any:
        with scandir(place) as listed:
            found = list(listed)
        (folder / "vanishing.BIN").unlink(missing_ok=True)
        return _Listed(found)

    monkeypatch.setattr(os, "scandir", vanish)
    assert {folder / "good.BIN", folder / "below" / "good.BIN"} <= {*WALKS[name](folder)}


class _Listed(list[Any]):
    def __enter__(self) -> _Listed:
        return self

    def __exit__(self, *_: object) -> None:
        pass


@pytest.mark.parametrize("name", ["of commands", "of campaigns", "of the watcher", "of a fleet"])
def test_folders_in_folders_in_folders(name: str, tmp_path: Path) -> None:
    """More than Python calls itself."""
    before = Path.cwd()
    try:
        os.chdir(tmp_path)
        for _ in range(DEEP):
            os.mkdir("d")
            os.chdir("d")
        shutil.copy(SAMPLE, "good.BIN")
    finally:
        os.chdir(before)
    (found,) = WALKS[name](tmp_path)
    subprocess.run(["rm", "-r", str(tmp_path / "d")], check=True)  # pytest cannot go down so far
    assert found.name == "good.BIN"


def test_a_recording_with_such_entries_is_read(tmp_path: Path) -> None:
    recording = tmp_path / "run"
    recording.mkdir()
    write_mcap(recording / "run_0.mcap")
    (recording / "metadata.yaml").write_text(METADATA)
    before = log_digest(recording)
    _spoil(recording)
    assert log_digest(recording) == before
    assert open_log(recording).duration_s > 0
    assert [sight.path for sight in look([tmp_path])] == [recording]


def test_a_named_folder_that_may_not_be_looked_into_is_said(locked: Path) -> None:
    with pytest.raises(UsageError, match="may not look into"):
        find_logs([locked / "a locked one"])
    with pytest.raises(LogError, match="may not look into"):
        open_log(locked / "a locked one")


def test_a_folder_that_went_away_has_no_digest(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    for place in ("empty", "none"):
        with pytest.raises(LogError):
            log_digest(tmp_path / place)
