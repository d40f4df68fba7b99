"""One option has one suggested value: in the fix, and as a cause."""

from __future__ import annotations

from pathlib import Path

import care_core
from care_core.report.document import build_document
from tests.whole import one_in


def test_the_fix_and_the_causes_suggest_the_same_value(recorded: Path) -> None:
    fixed = 0
    logs = sorted((recorded / "data" / "arducopter" / "faults").glob("*.BIN"))
    for log in one_in(3, logs[9:21]):
        diagnosis = care_core.triage(log).diagnosis
        changes = {} if diagnosis.fix is None else {one.option.name: one.suggested for one in diagnosis.fix.changes}
        for cause in (cause for fault in diagnosis.faults for cause in fault.causes):
            if cause.suggested is not None and cause.option.name in changes:
                assert cause.suggested == changes[cause.option.name], (log.name, cause.option.name)
        fixed += len(changes) > 1
    assert fixed, "fixes of several changes are among them"


def test_a_finding_that_names_its_options_leads_to_them(recorded: Path) -> None:
    diagnosis = care_core.triage(recorded / "data" / "varied" / "faults" / "h45_12_02.BIN").diagnosis
    assert diagnosis.hypotheses[0].name == diagnosis.faults[0].causes[0].option.name == "ATC_RAT_PIT_D"
    assert any("pitch oscillates" in note.text for note in diagnosis.faults[0].causes[0].notes)
    assert diagnosis.fix is not None
    assert str(diagnosis.fix.changes[0]) == "ATC_RAT_PIT_D 0.008471 -> 0.0036"
    fix = build_document(diagnosis).fix
    assert fix is not None
    assert fix.changes[0].option == "ATC_RAT_PIT_D"
