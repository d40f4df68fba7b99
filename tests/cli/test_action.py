"""The steps of action.yml, run as a runner would run them: summary, pages, exit code."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from care_core import plain_yaml

ROOT = Path(__file__).parents[2]
FAILED = ROOT / "samples" / "move_base_drive.bag"

pytestmark = pytest.mark.skipif(shutil.which("bash") is None, reason="the steps are for bash")


class Job(NamedTuple):
    code: int
    output: str
    summary: str
    folder: Path
    text: str


def action() -> dict[str, Any]:
    found = plain_yaml.load((ROOT / "action.yml").read_text(encoding="utf-8"))
    assert isinstance(found, dict)
    return found


REAL = f'exec "{sys.executable}" -c "from care_tui.start import main; main()" "$@"'
"""This program."""
ENDS_WITH_ITS_LOGS_NAME = """
log=$2
while [ $# -gt 0 ]; do [ "$1" = --out ] && echo "# Triage of $log" > "$2"; shift; done
exit "${log%.bag}"
"""
"""One that says what its log is called: 3.bag was not evaluated."""


def run_step(name: str, tmp_path: Path, *, logs: str, care: str = REAL, **inputs: str) -> Job:
    """Run a step with the inputs that it takes from its environment."""
    tools = tmp_path / "runner" / "care" / "bin"
    tools.mkdir(parents=True)
    (tools / "care").write_text(f"#!/bin/bash\n{care}\n", encoding="utf-8")
    (tools / "care").chmod(0o755)
    whole = {key: str(one.get("default", "")) for key, one in action()["inputs"].items()} | {"logs": logs} | inputs
    step = next(one for one in action()["runs"]["steps"] if one["name"] == name)
    environment = {key: str(value).replace("${{ inputs.", "").replace(" }}", "") for key, value in step["env"].items()}
    environment = {key: whole.get(value, value) for key, value in environment.items()}
    files = {key: tmp_path / key for key in ("GITHUB_STEP_SUMMARY", "GITHUB_OUTPUT")}
    done = subprocess.run(
        ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", step["run"]],
        cwd=tmp_path, capture_output=True, text=True, check=False,
        env={**os.environ, **environment, **{key: str(path) for key, path in files.items()},
             "RUNNER_TEMP": str(tmp_path / "runner"), "PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    read = {key: path.read_text(encoding="utf-8") if path.exists() else "" for key, path in files.items()}
    return Job(done.returncode, read["GITHUB_OUTPUT"], read["GITHUB_STEP_SUMMARY"], tmp_path, done.stdout + done.stderr)


@pytest.mark.long
def test_a_failed_run_fails_the_job_with_its_answer_in_the_summary_and_pages_kept(tmp_path: Path) -> None:
    logs = tmp_path / "my logs"
    (logs / "deep").mkdir(parents=True)
    shutil.copy(FAILED, logs / "deep" / "failed drive.bag")
    (logs / "notes.txt").write_text("no log", encoding="utf-8")
    job = run_step("Triage", tmp_path, logs="my logs\n")
    assert job.code == 1, job.text
    assert job.output == "exit-code=1\n"
    assert job.summary.startswith("# Triage of failed drive.bag")
    assert "**FAULT**: too slow: " in job.summary
    kept = {path.name for path in (tmp_path / "care-reports").iterdir()}
    assert kept == {f"my_logs_deep_failed_drive.bag.{suffix}" for suffix in ("json", "html", "md")}


def test_an_unreadable_log_is_said_and_fails_and_never_forgives_it(tmp_path: Path) -> None:
    (tmp_path / "broken.mcap").write_bytes(b"no log at all")
    job = run_step("Triage", tmp_path, logs="*.mcap", **{"fail-on": "never"})
    assert (job.code, job.output) == (0, "exit-code=4\n"), job.text
    assert "# broken.mcap could not be triaged" in job.summary


@pytest.mark.parametrize(
    ("codes", "fail_on", "worst", "code"),
    [
        ("0", "fault", 0, 0),
        ("0 3", "fault", 3, 0),
        ("0 3", "not-evaluated", 3, 3),
        ("3 4", "fault", 4, 4),
        ("1 3 4", "fault", 1, 1),
        ("1 2", "never", 2, 2),
        ("0 2", "never", 2, 2),
    ],
)
def test_the_gravest_log_decides_as_it_is_asked_to(
    tmp_path: Path, codes: str, fail_on: str, worst: int, code: int
) -> None:
    for one in codes.split():
        (tmp_path / f"{one}.bag").touch()
    job = run_step("Triage", tmp_path, logs="*.bag", care=ENDS_WITH_ITS_LOGS_NAME, **{"fail-on": fail_on})
    assert (job.output, job.code) == (f"exit-code={worst}\n", code), job.text


def test_a_recording_of_several_files_is_one_log(tmp_path: Path) -> None:
    run = tmp_path / "runs" / "0"
    run.mkdir(parents=True)
    for name in ("metadata.yaml", "run_0.mcap", "run_1.mcap"):
        (run / name).touch()
    job = run_step("Triage", tmp_path, logs="runs", care='echo "$2"; exit 0')
    assert "runs/0: exit code 0" in job.text
    assert "run_1" not in job.text


def test_a_place_without_logs_is_wrong_use(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    job = run_step("Triage", tmp_path, logs="empty")
    assert (job.code, job.output) == (2, "exit-code=2\n")
    assert "::error title=care::There is no log in empty" in job.text


def test_the_action_names_each_input_and_pins_what_it_uses() -> None:
    found = action()
    text = (ROOT / "action.yml").read_text(encoding="utf-8")
    assert found["runs"]["using"] == "composite"
    assert all(f"inputs.{name}" in text for name in found["inputs"])
    assert not any("${{" in step.get("run", "") for step in found["runs"]["steps"]), "no input is code"
    assert all("@v" in step["uses"] for step in found["runs"]["steps"] if "uses" in step)
