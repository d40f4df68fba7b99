"""A short pass of the fuzzer over every target; `make fuzz` takes a minute for each."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.tools import fuzzing

SECONDS = 0.15


@pytest.mark.parametrize("name", fuzzing.TARGETS)
def test_nothing_but_a_sentence(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    executions, findings = fuzzing.fuzz(name, SECONDS, 0, tmp_path)
    assert executions
    assert findings == 0, capsys.readouterr().err
