"""Small hostile files: every one is answered or refused with a sentence, in 1 GB of memory and 20 s."""

from __future__ import annotations

from pathlib import Path

import pytest

from care_core.errors import ExitCode
from tests import hostile
from tests.bounded import MOST_MB, MOST_S, Answer, bounded


def check(answer: Answer) -> None:
    assert "Traceback" not in answer.stderr
    assert "unexpected" not in answer.stderr
    assert answer.peak_mb < MOST_MB
    assert answer.cpu_s < MOST_S


@pytest.mark.parametrize("name", hostile.LOGS)
def test_a_hostile_log(name: str, tmp_path: Path) -> None:
    path = hostile.LOGS[name](tmp_path)
    triaged, inspected = (bounded(tmp_path, command, path) for command in ("triage", "inspect"))
    check(triaged)
    check(inspected)
    assert triaged.code in (ExitCode.USAGE, ExitCode.NOT_EVALUATED, ExitCode.UNREADABLE), triaged
    assert inspected.code in (ExitCode.OK, ExitCode.NOT_EVALUATED, ExitCode.UNREADABLE), inspected


@pytest.mark.parametrize("name", hostile.PROFILES)
def test_a_hostile_profile(name: str, tmp_path: Path) -> None:
    answer = bounded(tmp_path, "triage", hostile.FLIGHT, "--profile", hostile.PROFILES[name](tmp_path))
    check(answer)
    assert answer.code == ExitCode.USAGE, answer
