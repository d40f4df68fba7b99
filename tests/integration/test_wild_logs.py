"""Every log from the wild is read, read with damage, or refused with a sentence: no traceback, no false 'ok'."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.wild_logs import outcome_of, wild_files
from care_core.errors import ExitCode
from tests.conftest import Care
from tests.whole import one_in

pytestmark = pytest.mark.long

WENT_WELL = {"px4_events.ulg"}
"""A simulated take-off, return and landing."""
SECONDS = 60.0
"""None hangs; how quick they are is measured elsewhere."""
EVERY = 4
"""The commands add words to what is tried on every log: so many of them will do."""


def test_every_wild_log_has_an_outcome(recorded: Path) -> None:
    outcomes = {path: outcome_of(path) for path in wild_files(recorded / "logs")}
    assert len(outcomes) > 100
    for path, outcome in outcomes.items():
        assert outcome.sentence.strip(), path
        assert outcome.seconds < SECONDS, path
        # None of them is a mission of an installed profile; of all the others few went well from start to end.
        assert outcome.triage_code in set(ExitCode), path
        assert outcome.triage_code != ExitCode.OK or path.name in WENT_WELL, path
        assert (outcome.kind == "refused") <= (outcome.triage_code == ExitCode.UNREADABLE), path
    kinds = {outcome.kind for outcome in outcomes.values()}
    assert kinds == {"read", "damage", "refused"}


def test_no_configuration_file_is_taken_for_a_log(recorded: Path) -> None:
    for path in wild_files(recorded / "logs" / "configs"):
        outcome = outcome_of(path)
        assert outcome.kind == "refused", path


def test_the_commands_say_it_in_one_sentence(care: Care, recorded: Path) -> None:
    for path in one_in(EVERY, wild_files(recorded / "logs")):
        for command in ("inspect", "params", "triage"):
            outcome = care(command, path)
            assert "Traceback" not in outcome.stderr, (command, path)
            assert "unexpected" not in outcome.stderr, (command, path)
            if outcome.code in (ExitCode.USAGE, ExitCode.UNREADABLE):
                assert outcome.stdout == "", (command, path)
                assert outcome.stderr.startswith("care: ") or "\ncare: " in outcome.stderr, (command, path)
