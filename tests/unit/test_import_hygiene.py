"""What may not be imported where: `care --help` stays quick, and a robot's computer needs no learning libraries."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
HEAVY = {"mcap", "numpy", "pandas", "pydantic", "pymavlink", "rich", "rosbags", "ruamel", "textual"}
LEARNING = {"ananke", "causallearn", "joblib", "pandas", "pyarrow", "scipy", "sklearn"}
TERMINAL = {"care_tui", "rich", "textual", "typer"}
DIAGNOSIS = "care_core.diagnose.triage, care_core.report.html, care_core.extract.select, care_core.application.api"


def imported_by(code: str) -> set[str]:
    """Top-level modules in a fresh process after running `code`."""
    report = f"{code}\nimport sys; print('MODULES', *{{name.split('.')[0] for name in sys.modules}})"
    answer = subprocess.run(
        [sys.executable, "-c", report],
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )
    return set(answer.stdout.rpartition("MODULES")[2].split())


@pytest.mark.parametrize("word", ["--help", "--version"])
def test_help_and_version_import_nothing_heavy(word: str) -> None:
    code = f"from care_tui.cli import command_line\ntry:\n    command_line()([{word!r}])\nexcept SystemExit:\n    pass"
    assert not imported_by(code) & (HEAVY | LEARNING)


def test_diagnosis_imports_neither_learning_nor_a_terminal_nor_what_checks_files_of_people() -> None:
    assert not imported_by(f"import {DIAGNOSIS}") & (LEARNING | TERMINAL | {"pydantic", "ruamel"})


def test_a_triage_imports_what_its_own_log_needs() -> None:
    """A DataFlash log and profiles that were checked before: readers of other logs and of YAML stay outside, as do the
    templates of a page that nobody asked for."""
    sample = ROOT / "samples" / "arducopter_failed.BIN"
    code = f"import care_core; care_core.triage({str(sample)!r}).report()"
    imported_by(code)  # the cache of profiles is filled
    others = {"jinja2", "lz4", "mcap", "pydantic", "pymavlink", "rosbags", "ruamel", "zstandard"}
    assert not imported_by(code) & (others | LEARNING | TERMINAL)


def test_the_core_is_light_until_it_is_used() -> None:
    assert not imported_by("import care_core") & (HEAVY | LEARNING)


def test_the_app_draws_its_first_frame_without_what_reading_a_log_needs() -> None:
    assert not imported_by("import care_tui.app") & (HEAVY - {"rich", "textual"} | LEARNING)
