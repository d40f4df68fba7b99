"""Files of the program: where those lie that come with it, how a small one is read, and how one is written whole or
not at all.

Every small file (configurations, sites, campaigns, reports, profiles, what the program keeps for itself) is read by
`read_small_text` or `read_small_bytes`, and everything larger is opened by `open_regular`: what is no regular file, or
larger than such files are, is refused before a byte of it is read. A link may lead to a device without end, a pipe
waits for ever.
"""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Mapping, Sequence
from functools import cache
from io import BufferedRandom, BufferedReader, FileIO, StringIO
from pathlib import Path
from typing import Literal, overload

from care_core import limits
from care_core.errors import UsageError
from care_core.text import listed

PROFILE_FILE = "profile.yaml"

_PACKAGE = Path(__file__).parent
_OWN_PROJECT = 'name = "care-tui"'
_LONGEST_PREFIX = 60
"""Characters of a file's name that its temporary one begins with: a name of 255 has no room for more."""


@cache
def bundled_folder(kind: Literal["profiles", "samples"]) -> Path:
    """The folder of the profiles or samples that come with the program; it may not exist.

    It lies inside the package. Beside the package only in a checkout of this project: what lies beside an installed one
    may be anybody's.
    """
    inside, checkout = _PACKAGE / f"_{kind}", _PACKAGE.parent
    return checkout / kind if not inside.is_dir() and _is_checkout(checkout) else inside


def _is_checkout(folder: Path) -> bool:
    """Whether a folder is the project of this very package."""
    try:
        return _OWN_PROJECT in read_small_text(folder / "pyproject.toml").splitlines()
    except (OSError, UnicodeDecodeError):
        return False


def bundled(kind: Literal["profiles", "samples"], name: str = "") -> Path:
    """The path of a bundled profile or sample, or of the folder that holds them all; it may not exist."""
    return bundled_folder(kind) / name if name else bundled_folder(kind)


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


def read_small_bytes(path: Path, most: int = limits.SMALL_FILE_BYTES) -> bytes:
    """What a small file holds, in `most` bytes at most.

    Raises:
        OSError: it cannot be read, is no regular file or too large; `strerror` says which.
    """
    with open_regular(path, most=most) as stream:
        content = stream.read(most + 1)  # a file of /proc has no size, and one may grow
    _check_size(path, len(content), most)
    return content


def read_small_text(
    path: Path,
    *,
    encoding: str = "utf-8",
    errors: str = "strict",
    as_it_is: bool = False,
    most: int = limits.SMALL_FILE_BYTES,
) -> str:
    """The text of a small file.

    Args:
        as_it_is: keep the ends of its lines; else each is a newline.

    Raises:
        OSError: as `read_small_bytes`.
        UnicodeDecodeError: it is no text.
    """
    text = read_small_bytes(path, most).decode(encoding, errors)
    return text if as_it_is or "\r" not in text else StringIO(text, newline=None).read()


@overload
def open_regular(path: Path, *, most: int | None = None) -> BufferedReader: ...


@overload
def open_regular(path: Path, *, buffering: Literal[0]) -> FileIO: ...


def open_regular(path: Path, *, buffering: Literal[0, -1] = -1, most: int | None = None) -> BufferedReader | FileIO:
    """A file opened to be read, of any size or of `most` bytes.

    Raises:
        OSError: it cannot be opened, is no regular file or too large; `strerror` says which.
    """
    try:
        _check_regular(path, os.stat(path))  # to open a device may do something already
        handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    except ValueError as err:
        raise OSError(errno.EINVAL, "its name holds a character that no name can", repr(str(path))) from err
    try:
        found = os.fstat(handle)
        _check_regular(path, found)
        _check_size(path, found.st_size, most)
        raw = FileIO(handle)
        return raw if buffering == 0 else BufferedReader(raw)
    except BaseException:
        os.close(handle)
        raise


def open_to_append(path: Path) -> BufferedRandom:
    """A table or journal opened to be read and appended to, made where it is not there.

    Raises:
        OSError: it cannot be opened, is a link, no regular file or too large; `strerror` says which.
    """
    if path.is_symlink():
        raise OSError(errno.ELOOP, "it is a link", str(path))
    if path.exists():
        found = os.stat(path)
        _check_regular(path, found)
        _check_size(path, found.st_size, limits.TABLE_BYTES)
    return open(path, "a+b", opener=_opened_unlinked)


def _opened_unlinked(path: str, flags: int) -> int:
    return os.open(path, flags | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0), 0o666)


def _check_regular(path: Path, found: os.stat_result) -> None:
    if stat.S_ISDIR(found.st_mode):
        raise IsADirectoryError(errno.EISDIR, "it is a folder", str(path))
    if not stat.S_ISREG(found.st_mode):
        raise OSError(errno.EINVAL, "this is no file but a pipe or a device", str(path))


def _check_size(path: Path, size: int, most: int | None) -> None:
    if most is not None and size > most:
        raise OSError(errno.EFBIG, f"it is larger than {limits.megabytes(most)}", str(path))


def write_atomically(path: Path, text: str, mode: int | None = None) -> None:
    """Write a file through a temporary one beside it: a reader sees the old file or the new one, never half.

    A link is refused: whoever made it chose another file than the one that was named. A pipe or a terminal is written
    to as it is. `mode` is that of the new file; without it, it keeps that of the file it replaces.

    Raises:
        UsageError: the folder does not exist or may not be written to, or the name is a link's or a device's.
    """
    try:
        if is_stream(path):
            with path.open("w", encoding="utf-8", errors="backslashreplace") as stream:
                stream.write(text)
            return
        refuse_link(path)
        replace_file(path, text.encode("utf-8", "backslashreplace"), mode)
    except OSError as err:
        raise cannot_write(path, err) from err


def cannot_write(path: Path, err: OSError) -> UsageError:
    """What to say of a file that could not be written."""
    return UsageError(f"Cannot write the file: {err.strerror}.", hint="Choose another place.", where=str(path))


def refuse_link(path: Path) -> None:
    """Raise UsageError for a link: nothing is written through one, and none is replaced."""
    if path.is_symlink():
        hint = f"Name the file itself: {os.path.realpath(path)}."
        raise UsageError("This is a link, and links are not written through.", hint=hint, where=str(path))


def format_by_ending(path: Path, formats: Mapping[str, Sequence[str]]) -> str:
    """Which of these formats, each with its endings, the name of a file chooses. Raises UsageError for none."""
    for name, endings in formats.items():
        if path.suffix.lower() in endings:
            return name
    usual = listed([endings[0] for endings in formats.values() if endings], "or")
    raise UsageError(f"The file name must end in {usual}.", where=path.name)


def is_stream(path: Path) -> bool:
    """Whether a name stands for something that is written to as it is: a pipe, a terminal, /dev/stdout, /dev/null."""
    try:
        mode = path.stat().st_mode
    except (OSError, ValueError):
        return False
    return stat.S_ISFIFO(mode) or stat.S_ISCHR(mode) or str(path) in ("/dev/stdout", "/dev/stderr")


def replace_file(path: Path, content: bytes, mode: int | None = None) -> None:
    """Put a file in another's place: after a crash or a power cut either the old one is there, or the new one whole.

    A link of this name is replaced itself, what it leads to stays as it is. Raises OSError.
    """
    import tempfile

    if path.exists() and not path.is_file():
        raise OSError(errno.EINVAL, "there is a folder, a pipe or a device of that name", str(path))
    # Its name is nobody's to guess, and it is made anew or not at all: no link waits there.
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name[:_LONGEST_PREFIX]}.")
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(content)
            stream.flush()
            os.chmod(stream.fileno(), _mode(path) if mode is None else mode)
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


def _mode(path: Path) -> int:
    """The mode a plain `open` would give: that of the file it replaces, else what the umask allows."""
    if path.exists():
        return path.stat().st_mode & 0o777
    mask = os.umask(0)
    os.umask(mask)
    return 0o666 & ~mask
