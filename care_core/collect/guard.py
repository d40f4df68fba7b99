"""Runs one command and outlives nobody: `python -I guard.py GRACE_S RECORD COMMAND...`.

The command has a process group of its own. When the guard's standard input is closed, because whoever started it is
done with it or was killed, everything is ended that the command started: asked first, and after GRACE_S made to. When
the command ends by itself, what it leaves running is ended too, and RECORD is written: `{"code": 0, "time_s": 1.2}`, or
`{"error": "..."}` where it could not be started. There is no RECORD of a command that was ended from here. Where RECORD
cannot be written, the guard ends with NO_RECORD and the number of the system's error: the disk may be full.

A guard that is killed takes its command with it on Linux; what that had started, `leftovers` ends by its session, which
is the guard's.

Launchers of simulators give what they start sessions of its own (roslaunch does), which no signal to the group reaches.
On Linux the guard adopts what loses its parent, so that whatever was started stays below it.

Only the standard library is imported: this starts with every mission.
"""

from __future__ import annotations

import contextlib
import ctypes
import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import NamedTuple, NoReturn

NO_RECORD = 100
"""What is added to the number of an error (at most 133) that kept RECORD from being written."""

_ADOPT_ORPHANS, _DIE_WITH_PARENT = 36, 1
"""PR_SET_CHILD_SUBREAPER and PR_SET_PDEATHSIG of prctl(2)."""
_LOOK_S = 0.02


def main(grace_s: float, record: Path, command: list[str]) -> None:
    """Run the command until it ends or standard input is closed."""
    started = time.monotonic()
    control = ctypes.CDLL(None).prctl if sys.platform == "linux" else None
    if control is not None:
        control(_ADOPT_ORPHANS, 1, 0, 0, 0)
    guard = os.getpid()

    def in_child() -> None:
        os.setpgrp()
        if control is not None:
            control(_DIE_WITH_PARENT, signal.SIGKILL, 0, 0, 0)
            if os.getppid() != guard:  # it was killed meanwhile
                os._exit(1)

    try:
        # The pipe whose end is awaited must not be the command's too.
        child = subprocess.Popen(command, stdin=subprocess.DEVNULL, preexec_fn=in_child)  # noqa: PLW1509  # no threads yet
    except OSError as err:
        _write_and_end(record, {"error": f"{err.strerror}: {command[0]}"})
    stopped = threading.Event()

    def wait_for_child() -> None:
        code = child.wait()
        if not stopped.is_set():
            time_s = time.monotonic() - started
            _end(child.pid, grace_s)
            _write_and_end(record, {"code": code, "time_s": round(time_s, 3)})

    threading.Thread(target=wait_for_child, daemon=True).start()
    while os.read(0, 1024):
        pass
    stopped.set()
    _end(child.pid, grace_s)
    os._exit(0)


def _end(group: int, grace_s: float) -> None:
    """End every process of a group and everything below this one; what does not within the grace is killed."""
    deadline = time.monotonic() + grace_s
    left = _signal(group, signal.SIGTERM)
    while left and time.monotonic() < deadline:
        time.sleep(_LOOK_S)
        left = _signal(group, 0)
    while left and time.monotonic() < deadline + grace_s:  # what is killed may have started another meanwhile
        left = _signal(group, signal.SIGKILL)
        time.sleep(_LOOK_S)


def _signal(group: int, sign: int) -> bool:
    """Send a signal to the group and to what left it; whether anybody was there to get it."""
    _reap()
    is_left = False
    for send, target in [(os.killpg, group), *((os.kill, process) for process in _below(os.getpid()))]:
        try:
            send(target, sign)
            is_left = True
        except (ProcessLookupError, PermissionError):  # nobody is left; or only what is dead and not yet reaped
            continue
    return is_left


def _reap() -> None:
    """Take note of adopted processes that ended, so that none counts as left."""
    with contextlib.suppress(ChildProcessError):
        while os.waitpid(-1, os.WNOHANG)[0]:
            continue


def _below(process: int) -> list[int]:
    """Living processes that a process started, and what these did; none where the system does not list them."""
    listed = processes()
    children: dict[int, list[int]] = {}
    for number, one in listed.items():
        children.setdefault(one.parent, []).append(number)
    found = [process]
    for number in found:  # grows while it is read
        found += children.get(number, [])
    return [number for number in found[1:] if not listed[number].is_dead]


class Process(NamedTuple):
    """What the system lists of a process."""

    parent: int
    session: int
    is_dead: bool
    """It ended, and whoever started it did not yet take note."""


def processes() -> dict[int, Process]:
    """Every process by its number; none where the system does not list them."""
    found = {}
    for place in Path("/proc").glob("[0-9]*/stat"):
        try:
            words = place.read_text(encoding="utf-8", errors="replace").rpartition(")")[2].split()
            found[int(place.parent.name)] = Process(int(words[1]), int(words[3]), words[0] == "Z")
        except (OSError, ValueError, IndexError):  # it ended meanwhile
            continue
    return found


def _write_and_end(record: Path, found: dict[str, float | str]) -> NoReturn:
    new = record.with_name(f".{record.name}")
    try:
        new.write_text(json.dumps(found), encoding="utf-8")
        new.replace(record)
    except OSError as err:
        os._exit(NO_RECORD + (err.errno or 0))
    os._exit(0)


if __name__ == "__main__":
    main(float(sys.argv[1]), Path(sys.argv[2]), sys.argv[3:])
