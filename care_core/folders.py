"""What is in a folder, however it is: one entry that cannot be looked at hides no other.

Such are a link that leads in a circle or nowhere, what vanishes while it is looked at, and what is another user's. No
link to a folder is followed, so every walk ends.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import NamedTuple


class Entry(NamedTuple):
    """A file, by itself or behind a link, or a folder."""

    path: Path
    is_folder: bool


def entries_in(folder: Path) -> list[Entry]:
    """The files and folders in a folder, by name; none where it cannot be listed."""
    found = []
    try:
        with os.scandir(folder) as listed:
            for one in listed:
                is_folder = _is_folder(one)
                if is_folder is not None:
                    found.append(Entry(folder / one.name, is_folder))
    except OSError:  # gone, unplugged, or not ours to look into
        pass
    return sorted(found, key=lambda entry: entry.path.name)


def files_in(folder: Path) -> list[Path]:
    """The files in a folder, by name."""
    return [entry.path for entry in entries_in(folder) if not entry.is_folder]


def may_list(folder: Path) -> bool:
    """Whether this user may look into a folder."""
    return os.access(folder, os.R_OK | os.X_OK)


def _is_folder(entry: os.DirEntry[str]) -> bool | None:
    """Whether an entry is a folder; None where it is neither that nor a file."""
    try:
        if entry.is_dir(follow_symlinks=False):
            return True
        return False if entry.is_file() else None
    except OSError:
        return None
