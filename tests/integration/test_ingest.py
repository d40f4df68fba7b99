"""Ingesting goes on where it was: after it was killed, and after Ctrl+C, the table is the same to the byte."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from care_core.profile.schema import Schema
from care_core.profile.store import load_profile
from care_core.tables.ingest import by_reason, ingest, journal_of
from care_core.tables.rows import TableRow
from tests.conftest import Care

ROOT = Path(__file__).parents[2]
FLIGHT = ROOT / "tests" / "data" / "arducopter_good.BIN"
COUNT = 9


@pytest.fixture
def logs(tmp_path: Path) -> Path:
    folder = tmp_path / "logs"
    folder.mkdir()
    for number in range(COUNT):
        (folder / f"{number:02}.BIN").symlink_to(FLIGHT)
    (folder / "broken.bag").write_bytes(b"no log")
    return folder


def start(logs: Path, out: Path) -> subprocess.Popen[str]:
    code = (
        "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); from care_tui.cli import main; main()"
    )
    command = [
        sys.executable,
        "-c",
        code,
        "ingest",
        str(logs),
        "-o",
        str(out),
        "--profile",
        "arducopter",
        "--workers=1",
    ]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=environment)


def stop_in_the_middle(process: subprocess.Popen[str], journal: Path, how: signal.Signals, done: int = 0) -> str:
    """Send the signal when a log more than `done` is read."""
    for _ in range(600):
        if journal.exists() and journal.read_text().count("\n") > done + 1:
            break
        time.sleep(0.05)
    process.send_signal(how)
    return process.communicate(timeout=30)[1]


@pytest.mark.long
@pytest.mark.parametrize("suffix", [".csv", pytest.param(".parquet", marks=pytest.mark.long)])
def test_killed_and_interrupted_it_ends_with_the_same_table(logs: Path, suffix: str, care: Care) -> None:
    if suffix == ".parquet":
        pytest.importorskip("pyarrow")
    whole, out = logs.with_name(f"whole{suffix}"), logs.with_name(f"resumed{suffix}")
    assert care("ingest", logs, "-o", whole, "--profile", "arducopter").code == 3

    killed = start(logs, out)
    stop_in_the_middle(killed, journal_of(out), signal.SIGKILL)
    assert killed.returncode == -signal.SIGKILL
    assert not out.exists()
    done = journal_of(out).read_text().count("\n") - 1
    assert 0 < done < COUNT
    with journal_of(out).open("a") as stream:
        stream.write('{"log": "cut o')

    interrupted = start(logs, out)
    told = stop_in_the_middle(interrupted, journal_of(out), signal.SIGINT, done)
    assert interrupted.returncode == 130
    assert "give the same command again to go on" in told

    outcome = care("ingest", logs, "-o", out, "--profile", "arducopter")
    assert outcome.code == 3
    assert "logs were read before the interruption" in outcome.stderr
    assert out.read_bytes() == whole.read_bytes()
    assert not journal_of(out).exists()


def unlucky(path: Path, schema: Schema) -> list[TableRow]:
    if path.name == "01.BIN":
        os._exit(9)
    return [{"log": path.name, "mission": 1}]


def test_a_log_that_crashes_is_tried_again_and_the_others_are_not(logs: Path, tmp_path: Path) -> None:
    schema, out = load_profile("arducopter").schema, tmp_path / "runs.csv"
    paths = sorted(logs.glob("*.BIN"))[:4]
    for resumed in (0, 3):
        found = ingest(paths, schema, out, workers=2, progress=lambda _step, _share: None, read=unlucky)
        assert [row["log"] for row in found.rows] == ["00.BIN", "02.BIN", "03.BIN"]
        assert [failure.path.name for failure in found.failures] == ["01.BIN"]
        assert found.resumed == resumed
    assert by_reason(found.failures) == [("reading it ended the process (exit code 9)", 1, paths[1])]


def test_a_log_that_was_replaced_is_read_again(tmp_path: Path) -> None:
    schema, out, log = load_profile("arducopter").schema, tmp_path / "runs.csv", tmp_path / "00.BIN"
    for resumed, content in ((0, "a"), (1, "a"), (0, "longer")):
        if not log.exists() or log.read_text() != content:
            log.write_text(content)
        assert ingest([log], schema, out, progress=lambda _s, _d: None, read=unlucky).resumed == resumed
    assert ingest([log], load_profile("move_base").schema, out, progress=lambda _s, _d: None, read=unlucky).resumed == 0
    first, *_ = journal_of(out).read_text().splitlines()
    assert json.loads(first)["profile"] == "move_base"
