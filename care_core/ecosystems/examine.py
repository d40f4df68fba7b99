"""What happened in a log, whatever wrote it: the one door to the health of a log. Needs no profile."""

from __future__ import annotations

from care_core.ecosystems.base import RunModel
from care_core.ecosystems.findings import WHOLE_LOG, Finding, Health
from care_core.ecosystems.registry import ecosystem_of
from care_core.records import replace


def examine(model: RunModel) -> Health:
    """Timeline and findings of a log."""
    log = model.log
    health = ecosystem_of(log.format).examine(model)
    if not health.too_little or any(_says_more(one) for one in health.findings):
        return health
    # An answer too: whoever reads the findings must not take none for fine.
    nothing = Finding(
        kind="log",
        title=health.too_little,
        onset_s=0.0,
        end_s=log.duration_s,
        severity="info",
        evidence=f"{log.duration_s:.1f} s of log",
        source=WHOLE_LOG,
        suspect="world",
    )
    return replace(health, findings=(*health.findings, nothing))


def _says_more(finding: Finding) -> bool:
    """Whether a finding is an answer by itself: what kept the vehicle from arming, or what failed."""
    return finding.kind == "prearm" or finding.severity == "critical"
