"""How other interpreters and helper programs are started: nothing in the folder they are started in is run.

An operator stands in a stranger's folder of logs and says `care ingest .`. An interpreter that is started there with
`-c` or `-m` looks into that folder first, and would run a `multiprocessing.py` that lies beside the logs. So every
interpreter that this program starts is isolated (`-I`), and is told where this one imports from: that keeps what was
installed with `pip install --user` or lies on PYTHONPATH, which isolation alone would hide.
"""

from __future__ import annotations

import errno
import os
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock

_lock = Lock()
_open = 0
"""How many blocks of `isolated_children` are open: threads may have one each."""


def script_command(script: str, *words: str) -> list[str]:
    """The command that runs a file of this program; it can import the standard library alone."""
    return [sys.executable, *_flags(), script, *words]


def interpreter() -> str:
    """Where the interpreter is that runs this program."""
    return sys.executable


def python_command(code: str, *words: str) -> list[str]:
    """The command that runs `code` in an interpreter that imports from where this one does."""
    places = [place for place in sys.path if os.path.isabs(place)]
    return script_command("-c", f"import sys; sys.path[:] = {places!r}; {code}", *words)


def program_path(name: str) -> str:
    """Where a helper program is: a path as it is, a name by the absolute folders of PATH alone, as `.` and an empty
    part of it are the folder of a stranger's logs. Raises FileNotFoundError."""
    if os.sep in name:
        return name
    folders = [folder for folder in os.environ.get("PATH", os.defpath).split(os.pathsep) if os.path.isabs(folder)]
    found = shutil.which(name, path=os.pathsep.join(folders)) if folders else None
    if found is None:
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), name)
    return found


@contextmanager
def isolated_children() -> Iterator[None]:
    """While a block of this is open, every interpreter that `multiprocessing` starts is isolated.

    What it starts (a spawned process, the server to fork from, the tracker of resources) gets its flags from one
    function, and then `sys.path` from its parent. There is no public way to add a flag.
    """
    from multiprocessing import util
    from subprocess import _args_from_interpreter_flags as own_flags  # type: ignore[attr-defined]

    global _open  # noqa: PLW0603  # as is what it counts the users of
    with _lock:
        _open += 1
        util._args_from_interpreter_flags = lambda: [*own_flags(), *_flags()]  # type: ignore[attr-defined]
    try:
        yield
    finally:
        with _lock:
            _open -= 1
            if not _open:
                util._args_from_interpreter_flags = own_flags  # type: ignore[attr-defined]


def _flags() -> list[str]:
    """Isolation, and what it would forget of the environment that changes what is written."""
    is_kept = {"-B": sys.flags.dont_write_bytecode, "-Xutf8": sys.flags.utf8_mode}
    return ["-I", *(flag for flag, is_set in is_kept.items() if is_set)]
