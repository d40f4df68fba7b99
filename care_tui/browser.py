"""A page in the browser of whoever calls: written where it was asked for, else to a file that nobody else can read."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from care_core.starting import program_path
from care_tui.console import emit, say

if TYPE_CHECKING:
    from care_core.run import LogInfo

_OPENERS = ("open",) if sys.platform == "darwin" else ("wslview", "xdg-open", "sensible-browser", "x-www-browser")
"""Programs that open a page with the browser of the desktop; the first is of Linux on Windows."""
_STARTS_S = 1.0
"""A program that ends sooner with an error has found no browser."""
_OWN_FOLDER, _OWN_FILE = 0o700, 0o600
_MOST = 20
"""Pages that are kept; the oldest go first."""
_UNSAFE = re.compile(r"[^\w.-]+")


def show_page(page: str, log: LogInfo, out: Path | None, *, force: bool = False) -> None:
    """Write a page and open it; where no browser can be, only where it is is said.

    Raises:
        UsageError: it cannot be written.
    """
    if out is None:
        path = _written(page, log)
        say(f"wrote {path}")
    else:
        path = out.absolute()
        emit(page, out, force=force)
    problem = _open(path.as_uri())
    if problem:
        say(f"{problem}, so no browser was opened: the page is {path}")


def _written(page: str, log: LogInfo) -> Path:
    """The page as a file of the user's own, the same for the same log."""
    from platformdirs import user_cache_path

    from care_core.files import cannot_write, write_atomically

    folder = user_cache_path("care", appauthor=False) / "pages"
    name = _UNSAFE.sub("-", Path(log.path).stem)[:60]
    try:
        folder.mkdir(mode=_OWN_FOLDER, parents=True, exist_ok=True)
        folder.chmod(_OWN_FOLDER)
        path = folder / f"{name}-{log.sha256[:8]}.html"
        write_atomically(path, page, _OWN_FILE)
        for old in sorted(folder.glob("*.html"), key=lambda one: -one.stat().st_mtime)[_MOST:]:
            old.unlink(missing_ok=True)
    except OSError as err:
        raise cannot_write(folder, err) from err
    return path


def _started(command: list[str]) -> subprocess.Popen[bytes]:
    """A program that outlives this one and says nothing in its terminal."""
    nothing = subprocess.DEVNULL
    return subprocess.Popen(command, stdin=nothing, stdout=nothing, stderr=nothing, start_new_session=True)


def _open(address: str) -> str:
    """Have the desktop open an address; answers why it cannot, else nothing."""
    if os.environ.get("SSH_CONNECTION") or os.environ.get("SSH_TTY"):
        return "This computer is reached over SSH"
    if sys.platform != "darwin" and not any(map(os.environ.get, ("DISPLAY", "WAYLAND_DISPLAY", "WSL_DISTRO_NAME"))):
        return "There is no display"
    for name in _OPENERS:
        try:
            command = [program_path(name), address]
            ended = _started(command).wait(_STARTS_S)
        except subprocess.TimeoutExpired:
            return ""
        except OSError:
            continue
        if ended == 0:
            return ""
    return "None was found"
