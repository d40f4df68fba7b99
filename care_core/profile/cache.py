"""Profiles that were found sound, in the user's cache folder: checking a `profile.yaml` anew takes ten times as long.

An entry is named by a hash of the profile's text and of the program that checked it, and begins with the hash of its
own rest, so none is ever out of date or half written; all may be deleted at any time. It holds values, nothing that
runs.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from care_core.files import read_small_text
from care_core.records import UnfitError, plain, read_json

if TYPE_CHECKING:
    from care_core.profile.schema import Schema

_MOST = 64
"""Entries that are kept; the ones that were written first go first."""


def cached(text: str) -> Schema | None:
    """The schema of a `profile.yaml` with this text, None where it is not in the cache."""
    from care_core.profile.schema import Schema  # numpy, which the names of variables do without

    try:
        kept = cached_json(text)
        return None if kept is None else read_json(Schema, kept.encode())
    except UnfitError:
        return None


def cached_json(text: str) -> str | None:
    """The same as it is stored, an object of JSON."""
    try:
        digest, _, kept = read_small_text(_entry(text)).partition("\n")
    except (OSError, ValueError):
        return None
    return kept if hashlib.sha256(kept.encode()).hexdigest() == digest else None


def store(text: str, schema: Schema) -> None:
    """Keep a sound profile. A folder that cannot be written to costs time later, and nothing else."""
    from care_core.files import replace_file

    path = _entry(text)
    try:
        stored = json.dumps(plain(schema), ensure_ascii=False, separators=(",", ":"))
        path.parent.mkdir(parents=True, exist_ok=True)
        replace_file(path, f"{hashlib.sha256(stored.encode()).hexdigest()}\n{stored}".encode())
        for old in sorted(path.parent.glob("*.json"), key=lambda entry: -entry.stat().st_mtime)[_MOST:]:
            old.unlink(missing_ok=True)
    except (OSError, ValueError, TypeError):
        return


def _entry(text: str) -> Path:
    from platformdirs import user_cache_path

    name = hashlib.sha256(_program() + text.encode()).hexdigest()
    return user_cache_path("care", appauthor=False) / "profiles" / f"{name}.json"


@cache
def _program() -> bytes:
    """What tells one version of the program from another: the sizes and times of its source files."""
    return ",".join(_stamps(Path(__file__).parents[1])).encode()


def _stamps(folder: str | Path) -> Iterator[str]:
    with os.scandir(folder) as entries:
        for entry in sorted(entries, key=lambda entry: entry.name):
            if entry.name.endswith(".py"):
                stat = entry.stat()
                yield f"{stat.st_size}:{stat.st_mtime_ns}"
            elif entry.name != "__pycache__" and entry.is_dir():
                yield from _stamps(entry.path)
