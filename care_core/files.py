"""Files of the program: where those lie that come with it, and how one is written whole or not at all."""

from __future__ import annotations

import os
import re
import tempfile
from codecs import getincrementaldecoder
from pathlib import Path
from typing import Literal

from care_core.errors import UsageError
from care_core.logs.formats import log_suffixes
from care_core.logs.opening import is_recording

PROFILE_FILE = "profile.yaml"

_PACKAGE = Path(__file__).parent
_HEAD_BYTES = 4096
_OWN_DOCUMENT = re.compile(r'\{\s*"(schema": "care\.|\$defs"|\$schema")')
_KINDS = {
    "html": re.compile(r"<!doctype html|<html", re.IGNORECASE),
    "markdown": re.compile(r"# \S"),
    "comment": re.compile(r"#|--- "),
    "parameters": re.compile(r"[A-Z][A-Z0-9_]*(\s*,\s*|\s+)[-+.\w]+$"),
    "yaml": re.compile(r"[\w/.-]+:(\s|$)"),
    "table": re.compile(r"[^,\s]+(,[^,\s]+)+$"),
}
"""How the first line of a text shows what it is."""


_FIRST_WORD = re.compile(r"[^\W\d_]+")
"""Plain text is told by how it begins: "12 logs of 3 robots" and "Profile rover fits" are not somebody's notes."""


def bundled(kind: Literal["profiles", "samples"], name: str = "") -> Path:
    """The path of a bundled profile or sample, or of the folder that holds them all; it may not exist."""
    checkout = _PACKAGE.parent
    folder = checkout / kind if (checkout / "pyproject.toml").is_file() else _PACKAGE / f"_{kind}"
    return folder / name if name else folder


def profile_folders() -> dict[str, Path]:
    """Folders of the installed profiles by name, in order: those that came with this installation, and the user's own,
    which stand for those of the same name."""
    places = (bundled("profiles"), own_profiles())
    found = {path.parent.name: path.parent for place in places for path in place.glob(f"*/{PROFILE_FILE}")}
    return {name: found[name] for name in sorted(found)}


def own_profiles() -> Path:
    """The folder for profiles of the user's own; it may not exist."""
    from platformdirs import user_data_path

    return user_data_path("care", appauthor=False) / "profiles"


def write_atomically(path: Path, text: str, mode: int | None = None) -> None:
    """Write a file through a temporary one beside it: a reader sees the old file or the new one, never half.

    What a link leads to is written, and the link stays. A pipe or a device is written to as it is. `mode` is that of
    the new file; without it, it keeps that of the file it replaces.

    Raises:
        UsageError: the folder does not exist or may not be written to, or the file is a log.
    """
    refuse_recording(path)
    try:
        if path.exists() and not path.is_file() and not path.is_dir():
            path.write_text(text, encoding="utf-8")
            return
        replace_file(path, text.encode(), mode)
    except OSError as err:
        raise UsageError(
            f"Cannot write the file: {err.strerror}.", hint="Choose another place.", where=str(path)
        ) from err


def replace_file(path: Path, content: bytes, mode: int | None = None) -> None:
    """Put a file in another's place: after a crash or a power cut either the old one is there, or the new one whole.

    Raises OSError.
    """
    path = path.resolve()
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(content)
            stream.flush()
            Path(temporary).chmod(_mode(path) if mode is None else mode)
            os.fsync(stream.fileno())
        Path(temporary).replace(path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise
    sync_folder(path.parent)


def sync_folder(folder: Path) -> None:
    """Have the names in a folder on the disk, where the system can: a rename is not before its folder is."""
    try:
        handle = os.open(folder, os.O_RDONLY)
    except OSError:  # Windows opens no folders
        return
    try:
        os.fsync(handle)
    except OSError:  # nor does every file system sync one
        pass
    finally:
        os.close(handle)


def check_replaceable(path: Path, text: str) -> None:
    """Raise UsageError for a file that is there and is not of the kind of the text that is to replace it.

    A log whose head is damaged is no log to look at, so an ending that logs have counts as well.
    """
    refuse_recording(path)
    if not path.is_file() or not path.stat().st_size:
        return
    with path.open("rb") as stream:
        head = stream.read(_HEAD_BYTES)
    if path.suffix.lower() in log_suffixes() or b"\0" in head or _kind(_decoded(head)) != _kind(text):
        raise UsageError(
            "There is a file of another kind, which is kept.",
            hint="Name another file, or replace it with --force.",
            where=str(path),
        )


BUNDLE_FOLDER = "care-bundle"
_ZIP_HEAD, _ZIP_NAME_AT = b"PK\x03\x04", 30
"""How a zip begins, and where the name of its first file stands (PKWARE APPNOTE 4.3.7)."""


def write_bundle(path: Path, content: bytes, *, force: bool = False) -> None:
    """Write a bundle whole or not at all.

    Raises:
        UsageError: something else is there, or the folder may not be written to.
    """
    check_bundle(path, force=force)
    try:
        replace_file(path, content)
    except OSError as err:
        raise UsageError(
            f"Cannot write the file: {err.strerror}.", hint="Choose another place.", where=str(path)
        ) from err


def check_bundle(path: Path, *, force: bool = False) -> None:
    """Raise UsageError for a file that no bundle may replace: any but a bundle; with `force`, a log or an archive."""
    if not path.is_file() or _is_bundle(path):
        return
    refuse_recording(path)
    if not force and path.stat().st_size:
        raise UsageError(
            "There is a file of another kind, which is kept.",
            hint="Name another file, or replace it with --force.",
            where=str(path),
        )


def _is_bundle(path: Path) -> bool:
    """Whether a file is a zip whose first file lies in a bundle's folder."""
    with path.open("rb") as stream:
        head = stream.read(_ZIP_NAME_AT + len(BUNDLE_FOLDER) + 1)
    return head.startswith(_ZIP_HEAD) and head.endswith(f"{BUNDLE_FOLDER}/".encode())


def _decoded(head: bytes) -> str:
    """The first bytes of a file as text, which may end inside a character; empty where they are none."""
    try:
        return getincrementaldecoder("utf-8")().decode(head)
    except UnicodeDecodeError:
        return ""


def _kind(text: str) -> str:
    """What a text is, by its first line that is not empty; of a document of this program, whose it is."""
    start = text.lstrip("\ufeff \t\r\n")
    if not start:
        return "no text"
    line = start.partition("\n")[0].rstrip()
    if start[:1] in ("{", "["):
        return "care document" if _OWN_DOCUMENT.match(start) else "json"
    kind = next((kind for kind, shape in _KINDS.items() if shape.match(line)), "text")
    return f"text {_FIRST_WORD.findall(line)[:1]}" if kind == "text" else kind


def refuse_recording(path: Path) -> None:
    """Raise UsageError for a path that holds a log: logs are never written to."""
    if path.is_file() and is_recording(path):
        raise UsageError("This is a log, and logs are never overwritten.", hint="Name another file.", where=str(path))


def _mode(path: Path) -> int:
    """The mode a plain `open` would give: that of the file it replaces, else what the umask allows."""
    if path.exists():
        return path.stat().st_mode & 0o777
    mask = os.umask(0)
    os.umask(mask)
    return 0o666 & ~mask
