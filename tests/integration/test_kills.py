"""Kills at random moments: nothing that was kept is lost, and nothing is half-written.

`CARE_KILLS` says how many there are in all; `make kills` asks for 200.
"""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from care_core.errors import ExitCode
from tests.conftest import Care
from tests.killing import JOBS

ROOT = Path(__file__).parents[2]
FLIGHT = ROOT / "tests" / "data" / "arducopter_good.BIN"
KILLS = int(os.environ.get("CARE_KILLS", "24"))
LONGEST_S = 0.6


def started(*words: str) -> subprocess.Popen[str]:
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1"}
    return subprocess.Popen([sys.executable, "-m", *words], stdout=subprocess.PIPE, text=True, env=environment)


@pytest.mark.parametrize("name", JOBS)
def test_a_writer_that_is_killed(name: str, tmp_path: Path) -> None:
    if name == "table":
        pytest.importorskip("pyarrow")
    moments, promised = random.Random(name), 0
    for _ in range(KILLS // (len(JOBS) + 1)):
        writer = started("tests.killing", name, str(tmp_path))
        assert writer.stdout is not None
        first = writer.stdout.readline()
        time.sleep(moments.uniform(0, LONGEST_S))
        writer.kill()
        rest, _ = writer.communicate()
        assert first, "the writer met what is not whole"
        promised = max(promised, *(int(line) for line in (first + rest).split("\n") if line.strip()))
        assert JOBS[name].check(tmp_path) >= promised


def test_an_ingest_that_is_killed_is_resumed(care: Care, tmp_path: Path) -> None:
    logs, out = tmp_path / "logs", tmp_path / "runs.csv"
    logs.mkdir()
    for number in range(6):
        (logs / f"{number}.BIN").symlink_to(FLIGHT)
    moments = random.Random(0)
    for _ in range(KILLS // (len(JOBS) + 1)):
        process = started("care_tui", "ingest", str(logs), "-o", str(out), "--profile", "arducopter", "--workers=1")
        time.sleep(moments.uniform(0.3, 2.5))
        process.send_signal(moments.choice([signal.SIGKILL, signal.SIGTERM, signal.SIGINT]))
        process.communicate(timeout=30)
        assert not out.exists() or len(out.read_text().splitlines()) == 7
    assert care("ingest", logs, "-o", out, "--profile", "arducopter").code == ExitCode.OK
    assert len(out.read_text().splitlines()) == 7
    assert not list(tmp_path.glob(".runs*"))
