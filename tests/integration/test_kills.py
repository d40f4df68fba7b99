"""Kills at random moments: nothing that was kept is lost, and nothing is half-written.

`CARE_KILLS` says how many there are in all; `make kills` asks for 200.
"""

from __future__ import annotations

import csv
import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from care_core.collect.journal import FILE
from care_core.errors import ExitCode
from tests.campaigns import campaign_in
from tests.conftest import Care
from tests.killing import JOBS

pytestmark = pytest.mark.long

ROOT = Path(__file__).parents[2]
FLIGHT = ROOT / "tests" / "data" / "arducopter_good.BIN"
KILLS = int(os.environ.get("CARE_KILLS", "14"))
LONGEST_S = 0.6
TARGETS = len(JOBS) + 2
"""The jobs, `care ingest` and `care collect`."""


def started(*words: str) -> subprocess.Popen[str]:
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1"}
    return subprocess.Popen([sys.executable, "-m", *words], stdout=subprocess.PIPE, text=True, env=environment)


@pytest.mark.parametrize("name", JOBS)
def test_a_writer_that_is_killed(name: str, tmp_path: Path) -> None:
    if name == "table":
        pytest.importorskip("pyarrow")
    moments, promised = random.Random(name), 0
    for _ in range(KILLS // TARGETS):
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
    for _ in range(KILLS // TARGETS):
        process = started("care_tui", "ingest", str(logs), "-o", str(out), "--profile", "arducopter", "--workers=1")
        time.sleep(moments.uniform(0.3, 2.5))
        process.send_signal(moments.choice([signal.SIGKILL, signal.SIGTERM, signal.SIGINT]))
        process.communicate(timeout=30)
        assert not out.exists() or len(out.read_text().splitlines()) == 7
    assert care("ingest", logs, "-o", out, "--profile", "arducopter").code == ExitCode.OK
    assert len(out.read_text().splitlines()) == 7
    assert not list(tmp_path.glob(".runs*"))


@pytest.mark.long
def test_a_campaign_that_is_killed_is_resumed(tmp_path: Path) -> None:
    runs = KILLS // TARGETS + 3
    path = campaign_in(tmp_path, command="sh -c 'sleep 0.05; cp drive.bag \"$CARE_LOGS\"'", runs=runs, slots=2)
    moments, over = random.Random(0), set[int]()
    for _ in range(KILLS // TARGETS):
        process = started("care_tui", "collect", str(path))
        time.sleep(moments.uniform(0.3, 2.5))
        process.send_signal(moments.choice([signal.SIGKILL, signal.SIGTERM, signal.SIGINT]))
        process.communicate(timeout=60)
        assert over <= done_runs(tmp_path)
        over = done_runs(tmp_path)
        assert whole_tables(tmp_path)
    process = started("care_tui", "collect", str(path))
    process.communicate(timeout=120)
    assert process.returncode == ExitCode.OK
    assert done_runs(tmp_path) == set(range(1, runs + 1))
    assert len((tmp_path / "campaign" / "runs.csv").read_text().splitlines()) == runs + 1
    assert not list((tmp_path / "campaign").glob(".*"))


def done_runs(folder: Path) -> set[int]:
    path = folder / "campaign" / FILE
    lines = path.read_text().split("\n")[1:-1] if path.exists() else []
    found = [entry["run"] for entry in map(json.loads, lines) if "run" in entry]
    assert len(found) == len(set(found)), "a run that was over was made again"
    return set(found)


def whole_tables(folder: Path) -> bool:
    """Whether the table that is there, if any, has all its columns in each line."""
    path = folder / "campaign" / "runs.csv"
    lines = list(csv.reader(path.read_text().splitlines())) if path.exists() else []
    return len({len(line) for line in lines}) <= 1
