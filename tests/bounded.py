"""The command in a process of its own, with what it took: 1 GB of memory and 20 s are the most for a small file."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

MOST_MB, MOST_S = 1000, 20


class Answer(NamedTuple):
    """What a process gave, and what it took: megabytes resident at most, and seconds of the processor."""

    code: int
    stdout: str
    stderr: str
    peak_mb: float
    cpu_s: float


def bounded(folder: Path, *args: object) -> Answer:
    """The command in a process of its own that may take no more than three times the bound."""
    environment = {**os.environ, "CARE_HISTORY": "off", "OPENBLAS_NUM_THREADS": "1", "TMPDIR": str(folder)}

    command = [sys.executable, "-m", "care_tui", *map(str, args)]
    out, err = folder / "out.txt", folder / "err.txt"
    with out.open("wb") as stdout, err.open("wb") as stderr:
        process = subprocess.Popen(command, stdout=stdout, stderr=stderr, env=environment)
        resource.prlimit(process.pid, resource.RLIMIT_AS, (3 * MOST_MB * 1_000_000,) * 2)
        resource.prlimit(process.pid, resource.RLIMIT_CPU, (3 * MOST_S,) * 2)
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = code = os.waitstatus_to_exitcode(status)
    return Answer(code, out.read_text(), err.read_text(), used.ru_maxrss / 1000, used.ru_utime + used.ru_stime)
