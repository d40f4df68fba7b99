"""What is advised of runs whose cause is known, because every reset of them was flown or driven."""

from __future__ import annotations

from pathlib import Path

import pytest

import care_core
from care_core.diagnose.next_step import next_step
from care_core.diagnose.records import Diagnosis


def diagnosed(recorded: Path, log: str) -> Diagnosis:
    return care_core.triage(recorded / "data" / log).diagnosis


@pytest.mark.parametrize(("log", "changes"), [
    ("varied/faults/h45_10_02.BIN", {"ATC_RAT_PIT_D"}),  # of two ways to repair it, the one that promises more
    ("anyparam/a5501_17_00.BIN", {"ATC_ANG_RLL_P", "EK3_SRC1_POSZ"}),  # each keeps it from arming
    ("anyparam/a5501_14_08.BIN", {"RTL_ALT_TYPE", "PSC_VELXY_P"}),
    ("anyparam/a5501_13_00.BIN", {"INS_GYRO_FILTER"}),  # a warning names what is likelier than all else
    ("rover/faults/h62_06_01.BIN", {"ATC_STR_RAT_P"}),  # no objective was judged, and a critical finding names it
])  # fmt: skip
def test_what_repaired_the_run_is_advised(recorded: Path, log: str, changes: set[str]) -> None:
    fix = diagnosed(recorded, log).fix
    assert fix is not None
    assert {change.option.name for change in fix.changes} == changes
    least = 0.35 if changes == {"INS_GYRO_FILTER"} else 0.5  # of a value far beyond training little is promised
    assert fix.odds is None or fix.odds > least


def test_a_part_that_is_mended_first_does_not_hide_the_likelier_parameter(recorded: Path) -> None:
    diagnosis = diagnosed(recorded, "varied/faults/h45_13_00.BIN")
    assert diagnosis.fix is None
    assert "mend that first; then put BATT_LOW_VOLT back from 11.4 to 10.5" in (diagnosis.abstained or "")


def test_no_cause_of_the_profile_stands_beside_a_parameter_that_explains_it_all(recorded: Path) -> None:
    diagnosis = diagnosed(recorded, "anyparam/a5501_08_01.BIN")
    assert diagnosis.hypotheses[0].name == "RTL_SPEED"
    assert not [cause for fault in diagnosis.faults for cause in fault.causes if not cause.is_lead]


def test_next_says_what_the_check_asks_for(recorded: Path) -> None:
    said = next_step(diagnosed(recorded, "anyparam/a5501_02_00.BIN"), has_failed=True)
    assert said == "INS_ACC3OFFS_X is 3.5 (default 0), must be 0: calibrate again"
