"""One option has one suggested value: in the fix, and as a cause."""

from __future__ import annotations

from pathlib import Path

import care_core


def test_the_fix_and_the_causes_suggest_the_same_value(recorded: Path) -> None:
    fixed = 0
    for log in sorted((recorded / "data" / "arducopter" / "faults").glob("*.BIN"))[:12]:
        diagnosis = care_core.triage(log).diagnosis
        changes = {} if diagnosis.fix is None else {one.option.name: one.suggested for one in diagnosis.fix.changes}
        for cause in (cause for fault in diagnosis.faults for cause in fault.causes):
            if cause.suggested is not None and cause.option.name in changes:
                assert cause.suggested == changes[cause.option.name], (log.name, cause.option.name)
        fixed += len(changes) > 1
    assert fixed, "fixes of several changes are among them"
