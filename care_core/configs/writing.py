"""Edited configuration files on the disk: read again after they are written, and the old one kept beside."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from care_core.configs.edit import EditedFile, check_written
from care_core.errors import ConfigError
from care_core.files import read_small_bytes, replace_file, write_atomically


def replace_with_backup(file: EditedFile) -> Path:
    """Change the file where it is; answers where the old one is kept. Raises ConfigError."""
    backup = next(path for path in _backups(file.path) if not os.path.lexists(path))
    write_atomically(backup, file.before, file.path.stat().st_mode & 0o777)
    write_checked(file, file.path)
    return backup


def _backups(path: Path) -> Iterator[Path]:
    yield path.with_name(f"{path.name}.bak")
    number = 1
    while True:
        yield path.with_name(f"{path.name}.bak{number}")
        number += 1


def write_checked(file: EditedFile, target: Path) -> None:
    """Write an edited file and read it again; where it does not hold the changes, what was there before is put back."""
    mode = file.path.stat().st_mode & 0o777
    before = read_small_bytes(target) if target.is_file() else None
    write_atomically(target, file.after, mode)
    if not target.is_file():  # a pipe, which says nothing of what it took
        return
    try:
        check_written(file, target)
    except ConfigError:
        if before is None:
            target.unlink()
        else:
            replace_file(target, before, mode)
        raise
