"""How times, findings and explanations are put, in reports and in the app. Needs nothing that is slow to import."""

from __future__ import annotations

from typing import TYPE_CHECKING

from care_core.diagnose.records import Hypothesis
from care_core.health.records import Finding, Health, Severity

if TYPE_CHECKING:
    from care_core.report.happened import HypothesisEntry

SEVERITY_WORDS: dict[Severity, str] = {"critical": "CRITICAL", "warning": "WARNING", "info": "note"}


def critical(health: Health) -> list[Finding]:
    """Findings that would stop a mission, those after the impact left out."""
    return [one for one in health.findings if one.severity == "critical" and not one.after_impact]


def hypothesis_text(one: Hypothesis | HypothesisEntry) -> str:
    """An explanation in a clause."""
    if one.what == "parameter":
        return f"the parameter {one.name}"
    if one.name:
        return one.name
    unnamed = {"hardware": "a part whose failure left no trace in this log", "world": "something the robot met"}
    return unnamed.get(one.what, "chance: the reference configuration fails like this as well")
