"""The logs of a fleet: files, folders and patterns here, and URLs that fsspec opens (`s3://bucket/robots/*/*.BIN`).

Readers need files, so a log behind a URL is copied into a temporary folder where it is read, and the copy is deleted.
"""

from __future__ import annotations

import re
import shutil
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from glob import has_magic
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import urlsplit

from care_core.errors import LogError, UsageError
from care_core.extras import install_hint
from care_core.limits import MEBIBYTE, megabytes
from care_core.logs.finding import SHARED_SUFFIX, find_logs, is_log, is_recorder_folder
from care_core.logs.formats import log_suffixes
from care_core.records import Record

COPIED_BYTES = 2048 * MEBIBYTE
"""The largest log that is copied from behind a URL."""
LEFT_BYTES = 512 * MEBIBYTE
"""So much of the temporary folder's disk stays free."""
_BLOCK = 4 * MEBIBYTE
_METADATA = "metadata.yaml"


class Source(Record):
    """A log and how to come by it; it can be sent to another machine."""

    name: str
    """How it is told; a URL without its user, password and query."""
    path: Path | None = None
    """Where it lies, None behind a URL."""
    store: Any = None
    """The fsspec file system of a URL."""
    parts: tuple[str, ...] = ()
    """The files of the log in it: several where a recorder split one recording."""

    @property
    def folder(self) -> str:
        """The name of the folder that holds the log."""
        parent = self.path.absolute().parent if self.path else PurePosixPath(self.parts[0]).parent
        return parent.name


def gather(places: Iterable[str]) -> tuple[Source, ...]:
    """Every log at these places, each once, in a stable order.

    Args:
        places: files, folders (with all below them), patterns with `*`, `?`, `**`, and URLs of all three.

    Raises:
        UsageError: a place does not exist or cannot be listed, or there is no log at all.
    """
    found: dict[str, Source] = {}
    for place in places:
        for source in _behind_url(place) if "://" in place else _here(place):
            found.setdefault(source.name, source)
    return tuple(found.values())


@contextmanager
def fetched(source: Source) -> Iterator[Path]:
    """The log as a file or folder that readers can open; a copy goes when the context ends.

    Raises:
        LogError: it cannot be copied: it is gone, too large, or the disk is full.
    """
    if source.path is not None:
        yield source.path
        return
    with tempfile.TemporaryDirectory(prefix="care-") as name:
        folder = Path(name)
        try:
            _copy(source, folder)
        except OSError as err:
            why = err.strerror or str(err) or type(err).__name__
            raise LogError(f"The log cannot be copied: {why}.", where=source.name) from err
        yield folder if len(source.parts) > 1 else folder / PurePosixPath(source.parts[0]).name


def _here(place: str) -> list[Source]:
    path = Path(place)
    if not path.exists() and has_magic(place):
        logs = [one for one in _matching(path) if is_log(one) or is_recorder_folder(one)]
        if not logs:
            raise UsageError("No log is named like that.", hint=_endings(), where=place)
        return [Source(str(log), log) for log in find_logs(logs)]
    return [Source(str(log), log) for log in find_logs([path])]


def _matching(pattern: Path) -> list[Path]:
    """What a pattern names, by name. `**` goes into no link, which may lead in a circle; hidden is what begins with a
    dot, unless the pattern says it."""
    first = next(place for place, part in enumerate(pattern.parts) if has_magic(part))
    root, parts = Path(*pattern.parts[:first]), [*pattern.parts[first:]]
    parts = [part if part == "**" else re.sub(r"\*+", "*", part) for part in parts]
    if parts[-1] == "**":
        parts.append("*")
    says_hidden = any(part.startswith(".") for part in parts)
    found = []
    with suppress(OSError):  # a folder that cannot be listed holds none
        for one in root.glob("/".join(parts)):
            if says_hidden or not any(part.startswith(".") for part in one.relative_to(root).parts):
                found.append(one)
    return sorted(found)


def _behind_url(url: str) -> list[Source]:
    try:
        from fsspec.core import url_to_fs
    except ModuleNotFoundError as err:
        raise UsageError("URLs cannot be opened here.", hint=f"{install_hint('fleet')}.", where=shown(url)) from err
    try:
        store, path = url_to_fs(url)
        if _is_local(store):
            return _here(path)
        names = sorted(store.glob(path) if has_magic(path) else [path])
        is_file = len(names) == 1 and not store.isdir(names[0])
        files = names if is_file else [name for one in names for name in _below(store, one)]
    except UsageError:
        raise
    except ImportError as err:
        raise UsageError(f"URLs of this kind cannot be opened here: {err}.", hint="", where=shown(url)) from err
    except Exception as err:  # every kind of store has errors of its own
        why = str(err).strip().partition("\n")[0].rstrip(".") or type(err).__name__
        raise UsageError(f"It cannot be listed: {why}.", hint="Check the URL.", where=shown(url)) from err
    if is_file and not store.exists(files[0]):
        raise UsageError("No such file or folder.", hint="Check the URL.", where=shown(url))
    sources = _recordings(url, store, files if is_file else [name for name in files if _looks_like_a_log(name)])
    return sources or _nothing(url)


def _below(store: Any, path: str) -> list[str]:
    return sorted(store.find(path)) if store.isdir(path) else [path]


def _recordings(url: str, store: Any, files: Sequence[str]) -> list[Source]:
    """The files as logs: those in a folder that a ROS 2 recorder made are one."""
    by_folder: dict[str, list[str]] = {}
    for name in files:
        by_folder.setdefault(str(PurePosixPath(name).parent), []).append(name)
    found = []
    for folder, names in by_folder.items():
        metadata = f"{folder}/{_METADATA}"
        if len(names) > 1 and store.exists(metadata):
            found.append(Source(_url_of(url, folder), None, store, (metadata, *names)))
        else:
            found += [Source(_url_of(url, name), None, store, (name,)) for name in names]
    return found


def _url_of(url: str, path: str) -> str:
    """A file of a store as its URL."""
    scheme = url.partition("://")[0]
    if scheme in ("http", "https"):
        return shown(path)
    return f"{scheme}://{path.lstrip('/')}"


def shown(url: str) -> str:
    """A URL without what is nobody's business: user, password, query."""
    parts = urlsplit(url)
    return f"{parts.scheme}://{parts.netloc.rpartition('@')[2]}{parts.path}"


def _looks_like_a_log(name: str) -> bool:
    suffix = PurePosixPath(name).suffix.lower()
    return suffix in log_suffixes() and suffix != SHARED_SUFFIX


def _is_local(store: Any) -> bool:
    kinds = (store.protocol,) if isinstance(store.protocol, str) else tuple(store.protocol)
    return "file" in kinds


def _copy(source: Source, folder: Path) -> None:
    """Copy the parts, never more than is allowed, whatever the store says of their sizes. Raises LogError, OSError."""
    room = shutil.disk_usage(folder).free - LEFT_BYTES
    said = sum(int(source.store.size(part) or 0) for part in source.parts)
    if said > min(COPIED_BYTES, room):
        raise _too_large(source, said, room)
    copied = 0
    for part in source.parts:
        with source.store.open(part, "rb") as reader, (folder / PurePosixPath(part).name).open("wb") as writer:
            while block := reader.read(_BLOCK):
                copied += len(block)
                if copied > min(COPIED_BYTES, room):
                    raise _too_large(source, copied, room)
                writer.write(block)


def _too_large(source: Source, size: int, room: int) -> LogError:
    if size > COPIED_BYTES:
        limit = f"at most {megabytes(COPIED_BYTES)} are copied from behind a URL"
        return LogError(f"The log has {megabytes(size)}: {limit}.", hint="Copy it here first.", where=source.name)
    free = megabytes(max(0, room))
    return LogError(
        f"The log has {megabytes(size)}, and {free} of the temporary folder are left for it.",
        hint="Set TMPDIR to a larger disk.",
        where=source.name,
    )


def _nothing(url: str) -> list[Source]:
    raise UsageError("There is no log there.", hint=_endings(), where=shown(url))


def _endings() -> str:
    return f"Logs end in {', '.join(log_suffixes())}."
