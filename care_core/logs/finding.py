"""The logs in folders, and those named, each once."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from care_core.errors import LogError, UsageError
from care_core.folders import Entry, entries_in, may_list
from care_core.logs.formats import log_suffixes
from care_core.logs.opening import sniff

SHARED_SUFFIX = ".log"
"""An ending that many files have: only those that begin like a log are taken out of a folder."""


def find_logs(places: Iterable[Path]) -> tuple[Path, ...]:
    """The logs named, and every log below the folders named, each once, in a stable order.

    A folder that is one recording of several files counts as one log.

    Raises:
        UsageError: a place does not exist, or there is no log at all.
    """
    from care_core.logs.recording import whole_recording  # numpy, which the list of logs in the app does without

    found: dict[Path, None] = {}
    for place in places:
        if not os.path.exists(place):
            raise UsageError("No such file or folder.", hint="Check the path.", where=str(place))
        is_folder = os.path.isdir(place)
        if is_folder and not may_list(place):
            raise UsageError("You may not look into this folder.", hint="Ask whose it is.", where=str(place))
        inside = map(whole_recording, logs_below(place)) if is_folder else [place]
        found.update(dict.fromkeys(inside))
    if not found:
        raise UsageError("There is no log there.", hint=f"Logs end in {', '.join(log_suffixes())}.")
    return tuple(found)


def logs_below(folder: Path) -> list[Path]:
    """Every log in a folder and in those below it, by name; the folder itself where it is one recording.

    What cannot be looked at is left out, and so are links to folders.
    """
    found: list[Path] = []
    left = [Entry(folder, is_folder=True)]
    while left:
        path, is_folder = left.pop()
        if is_folder and not is_recorder_folder(path):
            left += reversed(entries_in(path))
        elif is_folder or is_log(path):
            found.append(path)
    return found


def is_recorder_folder(folder: Path) -> bool:
    """Whether a ROS 2 recorder made this folder."""
    return os.path.isfile(folder / "metadata.yaml")


def is_log(path: Path) -> bool:
    """Whether a file in a folder is a log, by its ending, and by its beginning where others end like that too."""
    suffix = path.suffix.lower()
    if suffix not in log_suffixes() or not os.path.isfile(path):
        return False
    return suffix != SHARED_SUFFIX or begins_like_a_log(path)


def begins_like_a_log(path: Path) -> bool:
    """Whether the first bytes of a file are those of a log."""
    try:
        sniff(path)
    except LogError:
        return False
    return True
