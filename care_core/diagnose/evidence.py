"""What the log itself says about a failure: a failed check names the options it reads."""

from __future__ import annotations

from care_core.run import Evidence, Run


def refused_by(run: Run) -> frozenset[str]:
    """Options that the check reads which refused this mission, and whose value sets it off.

    Only a refusal is proof: the mission ended there. A message in flight says what happened, not why.
    """
    return frozenset(option for e in run.evidence if e.kind == "refusal" for option in e.options)


def said(evidence: Evidence) -> str:
    """The message as a note on a cause, with what it means."""
    meaning = f" ({evidence.says})" if evidence.says else ""
    return f"this run says: {evidence.text}{meaning}"
