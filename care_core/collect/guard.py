"""Runs one command and outlives nobody: `python -I guard.py GRACE_S RECORD COMMAND...`.

The command has a process group of its own. When the guard's standard input is closed, because whoever started it is
done with it or was killed, the group is ended: asked first, and after GRACE_S made to. When the command ends by itself,
what it leaves running is ended too, and RECORD is written: `{"code": 0, "time_s": 1.2}`, or `{"error": "..."}` where it
could not be started. There is no RECORD of a command that was ended from here.

Only the standard library is imported: this starts with every mission.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path


def main(grace_s: float, record: Path, command: list[str]) -> None:
    """Run the command until it ends or standard input is closed."""
    started = time.monotonic()
    try:
        # The pipe whose end is awaited must not be the command's too.
        child = subprocess.Popen(command, stdin=subprocess.DEVNULL, start_new_session=True)
    except OSError as err:
        _write(record, {"error": f"{err.strerror}: {command[0]}"})
        return
    stopped = threading.Event()

    def attend() -> None:
        code = child.wait()
        if not stopped.is_set():
            time_s = time.monotonic() - started
            _end(child.pid, grace_s)
            _write(record, {"code": code, "time_s": round(time_s, 3)})
            os._exit(0)

    threading.Thread(target=attend, daemon=True).start()
    while os.read(0, 1024):
        pass
    stopped.set()
    _end(child.pid, grace_s)
    os._exit(0)


def _end(group: int, grace_s: float) -> None:
    """End every process of a group; one that does not within the grace is killed."""
    deadline = time.monotonic() + grace_s
    for sign in (signal.SIGTERM, 0, signal.SIGKILL):
        try:
            os.killpg(group, sign)
            while sign == 0 and time.monotonic() < deadline:
                time.sleep(0.02)
                os.killpg(group, 0)
        except (ProcessLookupError, PermissionError):  # nobody is left; or only what is dead and not yet reaped
            return


def _write(record: Path, found: dict[str, float | str]) -> None:
    new = record.with_name(f".{record.name}")
    new.write_text(json.dumps(found), encoding="utf-8")
    new.replace(record)


if __name__ == "__main__":
    main(float(sys.argv[1]), Path(sys.argv[2]), sys.argv[3:])
