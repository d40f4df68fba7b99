"""Words that reports and the app have in common. Needs nothing that is slow to import."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

from care_core.diagnose.records import UNLIKELY
from care_core.diagnose.verdict import SeenFinding
from care_core.ecosystems.findings import WHOLE_LOG, Severity
from care_core.text import percent

SEVERITY_WORDS: dict[Severity, str] = {"critical": "CRITICAL", "warning": "WARNING", "info": "note"}

F = TypeVar("F", bound=SeenFinding)


def noted(findings: Sequence[F]) -> list[F]:
    """The findings but the one that says only that the log holds too little: the verdict says so."""
    return [one for one in findings if one.source != WHOLE_LOG]


def below(names: Sequence[str], *, after: int) -> str:
    """The causes that have their name alone, below so many of which all is told."""
    return f"{'others ' if after else ''}below {percent(UNLIKELY)}: {', '.join(names)}"
