"""What the machine lacks (home, space, a steady clock) costs a sentence, never the answer or a file."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from care_core.errors import ExitCode
from care_core.files import bundled
from care_core.history import store
from care_core.report.document import build_document
from care_core.report.writers import published
from tests.made import made_diagnosis

SAMPLE = bundled("samples", "owlat_failed.bag")
ROOT = Path(__file__).parents[2]


def care(*words: object, blocks: int | None = None, **variables: str) -> subprocess.CompletedProcess[str]:
    """The command as a process; `blocks` bounds what it may write to a file, in units of 1 kB, as a full disk does."""
    command = [sys.executable, "-m", "care_tui", *map(str, words)]
    if blocks is not None:
        command = ["bash", "-c", f'ulimit -f {blocks}; exec "$@"', "-", *command]
    environment = {name: value for name, value in os.environ.items() if not name.startswith("XDG_")} | variables
    return subprocess.run(command, capture_output=True, text=True, cwd=ROOT, env=environment, check=False, timeout=60)


def test_no_home_to_write_to(tmp_path: Path) -> None:
    home = tmp_path / "file"
    home.write_text("")
    ended = care("triage", SAMPLE, "--json", HOME=str(home))
    assert ended.returncode == ExitCode.FAULT
    assert '"schema": "care.triage/1"' in ended.stdout
    assert "The history cannot be used" in ended.stderr


def test_a_full_disk_keeps_the_report_that_was_there(tmp_path: Path) -> None:
    out = tmp_path / "report.yaml"
    out.write_text("schema: care.triage/1\n")
    ended = care("triage", SAMPLE, "--no-history", "--out", out, blocks=1)
    assert ended.returncode == ExitCode.USAGE
    assert "report.yaml" in ended.stderr
    assert "Traceback" not in ended.stderr
    assert out.read_text() == "schema: care.triage/1\n"
    assert [path.name for path in tmp_path.iterdir() if path.is_file()] == ["report.yaml"]


def test_a_full_disk_costs_the_history_not_the_answer(tmp_path: Path) -> None:
    ended = care("triage", SAMPLE, "--json", blocks=4, HOME=str(tmp_path / "other"))
    assert ended.returncode == ExitCode.FAULT
    assert '"schema": "care.triage/1"' in ended.stdout
    assert "The history cannot be used" in ended.stderr


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_an_output_without_space_is_an_error() -> None:
    with open("/dev/full", "w", encoding="utf-8") as full:
        command = [sys.executable, "-m", "care_tui", "inspect", str(SAMPLE)]
        ended = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, cwd=ROOT, check=False)
    assert ended.returncode == ExitCode.USAGE
    assert "No space left" in ended.stderr


def test_a_clock_that_jumps_back_does_not_reorder_the_history(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    history, document = store.History(tmp_path / "history.sqlite3"), published(build_document(made_diagnosis()))
    for number, at in enumerate(
        ("2026-05-01T10:00:00+00:00", "1970-01-01T00:00:09+00:00", "2026-05-01T10:05:00+00:00")
    ):
        monkeypatch.setattr(store, "_now", lambda at=at: at)
        history.add_triage(document, number + 1)
    assert [one.mission for one in history.triages()] == [3, 2, 1]
