"""Which logs below some folders are finished: nobody writes to them any more, nobody still brings them.

Looks at names, sizes and times of writing alone, which works on network mounts and memory cards as well; of a log that
has come to rest, the few bytes are read that a recorder writes last. No wall clock is asked: how long a log has been at
rest is counted from when it was first seen so, on a clock that nobody sets.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path

from care_core.files import open_regular, read_small_text
from care_core.folders import entries_in
from care_core.logs.finding import SHARED_SUFFIX, begins_like_a_log
from care_core.logs.formats import log_suffixes
from care_core.logs.recording import ROS1_SUFFIXES, ROS2_SUFFIXES, parse_part
from care_core.logs.ros_metadata import FILE_NAME, parse_metadata
from care_core.records import Record, Struct, field

QUIET_S = 10.0
"""A recorder that writes less often than this, and a mount that tells of a change later, want a longer time: NFS keeps
what it knows of a file for 3 s and more (`acregmin` in nfs(5)), sshfs for 20 s (`dcache_timeout`)."""
ABANDONED_S = 600.0
"""What was not closed and has rested for so long, nobody goes on with: the recorder crashed, or the copy was broken
off."""

_BRINGING = (".part", ".partial", ".crdownload", ".download", ".filepart", ".tmp", ".!qb", ".aria2")
"""Endings of what is still being fetched, of browsers, WinSCP, ground stations."""
_OPEN_STORE = ("-wal", "-journal")
"""What lies beside a SQLite file while a writer has it open (sqlite.org/tempfiles.html)."""
_MCAP_END = b"\x89MCAP0\r\n"
_BAG_START = b"#ROSBAG V2.0\n"
_BAG_HEAD_BYTES = 4096
_INDEX_POS = re.compile(rb"index_pos=(.{8})", re.DOTALL)


class FileStatus(Record):
    """A log as it lies there: a file, or the folder of one recording."""

    path: Path
    stamp: str
    """Names, sizes and times of writing of its files: as long as it stays, nothing was written."""
    open_by: str = ""
    """What says that it is not finished; empty where nothing does."""


class _File(Record):
    name: str
    size: int
    written_ns: int


class StabilityTimeout(Struct, eq=False):
    """How long each log has been at rest. Times are seconds of a clock that only goes forward."""

    quiet_s: float = QUIET_S
    abandoned_s: float = ABANDONED_S
    _since: dict[Path, tuple[str, float]] = field(default_factory=dict)

    def rested(self, sights: Iterable[FileStatus], now_s: float) -> list[FileStatus]:
        """Those that are finished, and those given up, whose `open_by` says why they are not."""
        seen = {sight.path: sight for sight in sights}
        self._since = {path: since for path, since in self._since.items() if path in seen}
        found = []
        for path, sight in seen.items():
            if self._since.get(path, ("",))[0] != sight.stamp:
                self._since[path] = (sight.stamp, now_s)
            rest_s = now_s - self._since[path][1]
            if rest_s < self.quiet_s:
                continue
            why = sight.open_by or not_closed(path)
            if not why or rest_s >= self.abandoned_s:
                found.append(FileStatus(path, sight.stamp, why))
        return found


def look(folders: Iterable[Path]) -> list[FileStatus]:
    """Every log below these folders, finished or not, by name. A folder that is not there holds none."""
    found = {sight.path: sight for folder in folders for sight in _below(folder)}
    return [found[path] for path in sorted(found)]


def is_as_it_was(sight: FileStatus) -> bool:
    """Whether nothing was written to a log since it was seen; not where it is gone."""
    return any(again.path == sight.path and again.stamp == sight.stamp for again in _in(sight.path.parent, [])) or any(
        again.path == sight.path and again.stamp == sight.stamp for again in _in(sight.path, [])
    )


def _below(folder: Path) -> Iterator[FileStatus]:
    left = [folder]
    while left:
        below: list[Path] = []
        yield from _in(left.pop(), below)
        left += reversed(below)


def _in(folder: Path, below: list[Path]) -> Iterator[FileStatus]:
    """The logs in a folder; the folders in it are put into `below`, unless it is one recording itself."""
    files: dict[str, _File] = {}
    hidden: list[str] = []
    folders = []
    for path, is_folder in entries_in(folder):
        name = path.name
        if name.startswith("."):  # the trash of a memory card, halves of files from a Mac
            hidden.append(name)
        elif is_folder:
            folders.append(path)
        else:
            with suppress(OSError):  # gone meanwhile
                about = path.stat()
                files[name] = _File(name, about.st_size, about.st_mtime_ns)
    logs = {name: file for name, file in files.items() if Path(name).suffix.lower() in log_suffixes()}
    whole = _one_recording(folder, files, logs)
    if whole is not None:
        yield whole
        return
    below += folders
    for name, file in logs.items():
        yield FileStatus(folder / name, _stamp([file]), _open_by(file, [*files, *hidden]))


def _one_recording(folder: Path, files: Mapping[str, _File], logs: Mapping[str, _File]) -> FileStatus | None:
    """The recording that a folder is as a whole, None where its logs are one each."""
    own = [name for name in logs if name.lower().endswith(ROS2_SUFFIXES)]
    stamp = _stamp(files.values())
    if FILE_NAME in files:
        return FileStatus(folder, stamp, _unlisted(folder, files) or _any_open(own, files))
    if own and all(re.match(rf"{re.escape(folder.name)}_\d+\.", name) for name in own):  # as a ROS 2 recorder names
        return FileStatus(folder, stamp, f"its recorder has not written {FILE_NAME}")
    bags = [name for name in logs if name.lower().endswith(ROS1_SUFFIXES)]
    parts = [parse_part(name) for name in bags]
    # Dated by the recorder and numbered from 0: other bags with numbers are runs of their own.
    if len(bags) > 1 and len(bags) == len(logs) and len({part and part[0] for part in parts}) == 1 and parts[0]:
        numbers = sorted(part[1] for part in parts if part)
        if numbers == list(range(len(numbers))):
            return FileStatus(folder, stamp, _any_open(bags, files))
    return None


def _unlisted(folder: Path, files: Mapping[str, _File]) -> str:
    """What the metadata of a ROS 2 recording names and is not there; empty where all is."""
    try:
        text = read_small_text(folder / FILE_NAME, errors="replace")
    except OSError:
        return f"{FILE_NAME} cannot be read"
    metadata = parse_metadata(text)
    missing = [name for name in (Path(listed).name for listed in metadata.files) if name not in files]
    if missing:
        return f"{FILE_NAME} names {missing[0]}, which is not there"
    return "" if metadata.files else f"{FILE_NAME} names no file"


def _any_open(names: Iterable[str], files: Mapping[str, _File]) -> str:
    return next((why for name in names if (why := _open_by(files[name], list(files)))), "")


def _open_by(file: _File, beside: Iterable[str]) -> str:
    """What says by its name or beside it that a file is still being written or fetched."""
    name, stem = file.name, file.name.partition(".")[0]
    if name.lower().endswith(".active"):
        return "its recorder has not closed it (.active)"
    for other in beside:
        fetched = other.lower().endswith(_BRINGING) and other.startswith((f"{name}.", f"{stem}."))
        if fetched or other.startswith(f".{name}."):  # rsync writes beside it
            return f"{other} lies beside it"
        if other in tuple(f"{name}{ending}" for ending in _OPEN_STORE):
            return f"{other} lies beside it"
    return "" if file.size else "it is empty"


def not_closed(path: Path) -> str:
    """What a file's own bytes say against its being closed: only bags and MCAP files tell, and only the plain ones."""
    try:
        if not path.is_file():
            return ""
        with open_regular(path) as stream:
            head = stream.read(_BAG_HEAD_BYTES)
            if head.startswith(_MCAP_END):
                stream.seek(-len(_MCAP_END), os.SEEK_END)
                return "" if stream.read() == _MCAP_END and stream.tell() > len(_MCAP_END) else "it was not closed"
    except OSError:  # gone, or not ours: reading it says so
        return ""
    if head.startswith(_BAG_START):
        index = _INDEX_POS.search(head)
        return "it was not closed" if index is not None and not int.from_bytes(index[1], "little") else ""
    return ""


def is_one(path: Path) -> bool:
    """Whether a file that rests begins like a log where others end like that too."""
    return path.suffix.lower() != SHARED_SUFFIX or begins_like_a_log(path)


def _stamp(files: Iterable[_File]) -> str:
    return ";".join(f"{file.name}:{file.size}:{file.written_ns}" for file in sorted(files, key=lambda one: one.name))
