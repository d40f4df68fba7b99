"""Which files make up a recording: one file, a ROS 2 bag folder, or a folder with the parts of a split ROS 1 bag."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from care_core.errors import LogError
from care_core.files import read_small_text
from care_core.folders import files_in, may_list
from care_core.logs.formats import log_suffixes
from care_core.logs.ros_log import Flaw
from care_core.logs.ros_metadata import FILE_NAME, PARAMETERS_NAME, Metadata, parse_metadata
from care_core.records import Record, field, replace
from care_core.text import command

ROS2_SUFFIXES = (".db3", ".mcap", ".db3.zstd", ".mcap.zstd")
ROS1_SUFFIXES = (".bag", ".bag.active")

RENAMED = "named in metadata.yaml but not there"
"""The fact about a recording whose files were renamed since."""

PART = "part"
"""The fact about a file which part of a recording it is."""

_PART = re.compile(r"^(?P<series>.+)_(?P<number>0|[1-9]\d*)\.bag(\.active)?$")
_ROS2_PART = re.compile(r"(_\d+)?\.(db3|mcap)$")
_DATE = re.compile(r"\d{4}(-\d\d){5}")
"""What `rosbag record` puts into the name of each part: when that part was begun."""


class Recording(Record):
    """The files of a recording in order, what is said beside them, and the files that are missing."""

    files: tuple[Path, ...]
    metadata: Metadata = field(default_factory=Metadata)
    missing: tuple[Flaw, ...] = ()
    notes: dict[str, str] = field(default_factory=dict)
    beside: tuple[Path, ...] = ()
    """The files before and after it that by their names are parts of the same recording."""


def recording_at(path: Path) -> Recording:
    """The recording that a file or folder is.

    A file stands for itself, even where it is a part of a split recording; the others are noted.

    Raises:
        LogError: a folder that holds no recording, or several.
    """
    if path.is_dir():
        return _in_folder(path)
    metadata = _metadata_beside(path.parent)
    siblings = _siblings(path, metadata)
    if path.name not in siblings:
        return Recording((path,))
    if len(siblings) == 1:
        return Recording((path,), metadata)
    at = siblings.index(path.name)
    place = f"{at + 1} of {len(siblings)}; name the folder to read all as one run"
    beside = tuple(path.with_name(name) for name in (*siblings[max(at - 1, 0) : at], *siblings[at + 1 : at + 2]))
    return Recording((path,), metadata.of_one_file(), notes={PART: place}, beside=beside)


def whole_recording(path: Path) -> Path:
    """The folder of a ROS 2 bag that was split into several files, given one of them; any other file itself."""
    if not path.name.lower().endswith(ROS2_SUFFIXES):
        return path
    listed = [Path(name).name for name in _metadata_beside(path.parent).files]
    return path.parent if len(listed) > 1 and path.name in listed else path


def _in_folder(folder: Path) -> Recording:
    if not may_list(folder):
        raise LogError("You may not look into this folder.", hint="Ask whose it is.", where=str(folder))
    names = sorted((path.name for path in files_in(folder)), key=_natural)
    bags = [name for name in names if name.lower().endswith(ROS1_SUFFIXES)]
    stores = [name for name in names if name.lower().endswith(ROS2_SUFFIXES)]
    if stores:
        return _ros2_bag(folder, stores)
    if bags and len({_series(name) for name in bags}) == 1:
        return Recording(tuple(folder / name for name in bags), missing=_gaps(bags))
    if bags:
        raise _several(folder, len(bags))
    if FILE_NAME in names:
        raise LogError(
            "A ROS 2 bag folder without .db3 or .mcap files.",
            hint="Copy them beside metadata.yaml.",
            where=str(folder),
        )
    holds_logs = any(Path(name).suffix.lower() in log_suffixes() for name in names)
    hint = _one_or_all(folder) if holds_logs else "No log lies right in it; name a log file."
    raise LogError("A folder, not a log.", hint=hint, where=str(folder))


def _several(folder: Path, count: int) -> LogError:
    return LogError(f"The folder holds {count} recordings, not one.", hint=_one_or_all(folder), where=str(folder))


def _one_or_all(folder: Path) -> str:
    return f"Name one log file in it; '{command('care', 'triage', str(folder))}' has a line for each."


def _ros2_bag(folder: Path, present: Sequence[str]) -> Recording:
    """The files that metadata.yaml lists, as far as they are there; without it, or where renamed, what is there."""
    metadata = _metadata_beside(folder)
    listed = [Path(name).name for name in metadata.files]
    files = [name for name in listed if name in present]
    missing = [name for name in listed if name not in present]
    others = [name for name in present if name not in listed]
    if missing and others:
        renamed = min(len(missing), len(others))
        files, missing = sorted([*files, *others], key=_natural), missing[renamed:]
    elif not listed:
        files = list(present)
        if len({_ros2_series(name) for name in files}) > 1:
            raise _several(folder, len(files))
    if len({_bare_suffix(name) for name in files}) > 1:
        raise LogError("The folder holds both .db3 and .mcap files.", hint="Name the one to read.", where=str(folder))
    flaws = tuple(Flaw(f"{name} is missing from the folder") for name in missing)
    gone = [name for name in listed if name not in present]
    notes = {RENAMED: f"{', '.join(gone)}, read instead: {', '.join(others)}"} if gone and others else {}
    return Recording(tuple(folder / name for name in files), metadata, flaws, notes)


def _siblings(path: Path, metadata: Metadata) -> list[str]:
    """Names of the files of the recording that a file belongs to, in order; the file alone where it belongs to none."""
    listed = [Path(name).name for name in metadata.files]
    if path.name in listed:
        return listed
    if _PART.match(path.name) is None:
        return [] if listed else [path.name]
    return sorted(
        (other.name for other in path.parent.glob("*.bag*") if _series(other.name) == _series(path.name)), key=_natural
    )


def _metadata_beside(folder: Path) -> Metadata:
    """What the recorder wrote of a recording, and the parameters that `care record` wrote beside it."""
    try:
        metadata = parse_metadata(read_small_text(folder / FILE_NAME, errors="replace"))
    except OSError:
        metadata = Metadata()
    try:
        parameters = read_small_text(folder / PARAMETERS_NAME, errors="replace")
    except OSError:
        return metadata
    return replace(metadata, custom={**metadata.custom, PARAMETERS_NAME: parameters})


def parse_part(name: str) -> tuple[str, int] | None:
    """Series and number of a part of a split ROS 1 bag whose recorder dated it, None of any other file."""
    match = _PART.match(name)
    if match is None or not _DATE.search(match["series"]):
        return None
    return _DATE.sub("", match["series"]), int(match["number"])


def _series(name: str) -> str:
    """What the parts of one split bag share: the name without number and time; the name itself of any other file."""
    match = _PART.match(name)
    return name if match is None else _DATE.sub("", match["series"])


def _ros2_series(name: str) -> str:
    """What the parts of one split ROS 2 bag share: the name without its number; its format is told apart elsewhere."""
    return _ROS2_PART.sub("", name.lower().removesuffix(".zstd"))


def _gaps(names: Sequence[str]) -> tuple[Flaw, ...]:
    """The numbers that a series of parts lacks between its first and last."""
    numbers = [int(match["number"]) for name in names if (match := _PART.match(name))]
    lacking = sorted(set(range(numbers[0], numbers[-1])) - set(numbers)) if len(numbers) > 1 else []
    return (Flaw(f"{len(lacking)} parts are missing, the first is number {lacking[0]}"),) if lacking else ()


def _bare_suffix(name: str) -> str:
    return Path(name.lower().removesuffix(".zstd")).suffix


def _natural(name: str) -> list[tuple[int, int | str]]:
    """A key that sorts part 10 behind part 2."""
    return [(0, int(piece)) if piece.isdigit() else (1, piece) for piece in re.split(r"(\d+)", name)]
