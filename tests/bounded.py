"""The command in a process of its own, with what it took: 1 GB of memory and 20 s are the most for a small file."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

MOST_MB, MOST_S = 1000, 20

# Linux counts what the parent of a process held at its start as a peak of that process. So the command is started by a
# small process that sets the limits, and not by the test's own, which can hold more than the bound.
_STARTER = """
import json, os, resource, subprocess, sys
resource.setrlimit(resource.RLIMIT_AS, (int(sys.argv[2]),) * 2)
resource.setrlimit(resource.RLIMIT_CPU, (int(sys.argv[3]),) * 2)
code = subprocess.call(sys.argv[4:])
used = resource.getrusage(resource.RUSAGE_CHILDREN)
with open(sys.argv[1], "w") as taken:
    json.dump([code, used.ru_maxrss / 1000, used.ru_utime + used.ru_stime], taken)
"""


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
    out, err, taken = folder / "out.txt", folder / "err.txt", folder / "taken.json"
    limits = [str(3 * MOST_MB * 1_000_000), str(3 * MOST_S)]
    with out.open("wb") as stdout, err.open("wb") as stderr:
        starter = [sys.executable, "-I", "-S", "-c", _STARTER, str(taken), *limits, *command]
        subprocess.run(starter, stdout=stdout, stderr=stderr, env=environment, check=True)
    code, peak_mb, cpu_s = json.loads(taken.read_text())
    return Answer(code, out.read_text(), err.read_text(), peak_mb, cpu_s)
