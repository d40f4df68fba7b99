"""Small hostile files: every one is answered or refused with a sentence, in 1 GB of memory and 20 s."""

from __future__ import annotations

from pathlib import Path

import pytest

from care_core.errors import ExitCode
from tests import hostile
from tests.bounded import MOST_MB, MOST_S, Answer, bounded
from tests.whole import one_in

pytestmark = pytest.mark.long

INSPECTED = one_in(3, hostile.LOGS, first=2)
"""What triage reads of a log, inspection reads as well: so many will do."""


def check(answer: Answer) -> None:
    assert "Traceback" not in answer.stderr
    assert "unexpected" not in answer.stderr
    assert answer.peak_mb < MOST_MB
    assert answer.cpu_s < MOST_S


@pytest.mark.parametrize("name", hostile.LOGS)
def test_a_hostile_log(name: str, tmp_path: Path) -> None:
    path = hostile.LOGS[name](tmp_path)
    triaged = bounded(tmp_path, "triage", path)
    check(triaged)
    assert triaged.code in (ExitCode.USAGE, ExitCode.NOT_EVALUATED, ExitCode.UNREADABLE), triaged


@pytest.mark.parametrize("name", INSPECTED)
def test_a_hostile_log_is_inspected(name: str, tmp_path: Path) -> None:
    inspected = bounded(tmp_path, "inspect", hostile.LOGS[name](tmp_path))
    check(inspected)
    assert inspected.code in (ExitCode.OK, ExitCode.NOT_EVALUATED, ExitCode.UNREADABLE), inspected


@pytest.mark.parametrize("name", hostile.PROFILES)
def test_a_hostile_profile(name: str, tmp_path: Path) -> None:
    answer = bounded(tmp_path, "triage", hostile.FLIGHT, "--profile", hostile.PROFILES[name](tmp_path))
    check(answer)
    assert answer.code == ExitCode.USAGE, answer
