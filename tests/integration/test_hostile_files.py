"""Small hostile files: every one is answered or refused with a sentence, in 1 GB of memory and 20 s."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

from care_core.errors import ExitCode
from tests import hostile

MOST_MB, MOST_S = 1000, 20


class Answer(NamedTuple):
    """What a process gave, and what it took: megabytes resident at most, and seconds of the processor."""

    code: int
    stdout: str
    stderr: str
    peak_mb: float
    cpu_s: float


def care(folder: Path, *args: object) -> Answer:
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


def check(answer: Answer) -> None:
    assert "Traceback" not in answer.stderr
    assert "unexpected" not in answer.stderr
    assert answer.peak_mb < MOST_MB
    assert answer.cpu_s < MOST_S


@pytest.mark.parametrize("name", hostile.LOGS)
def test_a_hostile_log(name: str, tmp_path: Path) -> None:
    path = hostile.LOGS[name](tmp_path)
    triaged, inspected = (care(tmp_path, command, path) for command in ("triage", "inspect"))
    check(triaged)
    check(inspected)
    assert triaged.code in (ExitCode.USAGE, ExitCode.NOT_EVALUATED, ExitCode.UNREADABLE), triaged
    assert inspected.code in (ExitCode.OK, ExitCode.NOT_EVALUATED, ExitCode.UNREADABLE), inspected


@pytest.mark.parametrize("name", hostile.PROFILES)
def test_a_hostile_profile(name: str, tmp_path: Path) -> None:
    answer = care(tmp_path, "triage", hostile.FLIGHT, "--profile", hostile.PROFILES[name](tmp_path))
    check(answer)
    assert answer.code == ExitCode.USAGE, answer
