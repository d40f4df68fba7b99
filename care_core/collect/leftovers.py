"""What a mission left running whose guard was killed: it is ended before anything else is driven in its place.

A process belongs to a mission whose folder of logs its environment names (`CARE_LOGS`), which it hands on to whatever
it starts; or it is in the session of the mission's guard. Linux lists both; elsewhere nothing is found.
"""

from __future__ import annotations

import os
import signal
import time
from contextlib import suppress
from pathlib import Path

from care_core.collect import guard
from care_core.files import read_small_bytes

LOGS_VARIABLE = "CARE_LOGS"

_LOOK_S = 0.02


def end_leftovers(folder: Path, grace_s: float, *, session: int | None = None) -> None:
    """End the missions whose logs go below a folder: asked first, and after `grace_s` seconds made to.

    Args:
        session: of a guard that was killed; what is left in it is ended too.
    """
    deadline = time.monotonic() + grace_s
    sign = signal.SIGTERM
    asked: set[int] = set()
    while time.monotonic() < deadline + grace_s and (left := _left(folder, session)):
        if time.monotonic() >= deadline:
            sign, asked = signal.SIGKILL, set()
        for process in left - asked:
            with suppress(ProcessLookupError, PermissionError):
                os.kill(process, sign)
        asked |= left
        time.sleep(_LOOK_S)


def _left(folder: Path, session: int | None) -> set[int]:
    """The living processes of these missions, but for this one and those that started it."""
    listed = guard.processes()
    own, number = set(), os.getpid()
    while number in listed:
        own.add(number)
        number = listed[number].parent
    start = f"{LOGS_VARIABLE}={folder.absolute()}{os.sep}".encode()
    return {
        number
        for number, process in listed.items()
        if not process.is_dead and number not in own and (process.session == session or _names(number, start))
    }


def _names(process: int, start: bytes) -> bool:
    """Whether a variable in the environment of a process begins like this."""
    try:
        environment = read_small_bytes(Path(f"/proc/{process}/environ"))
    except OSError:  # it ended meanwhile, or is another user's
        return False
    return any(variable.startswith(start) for variable in environment.split(b"\0"))
