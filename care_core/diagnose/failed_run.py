"""A judged run that missed an objective, with what every step of its diagnosis needs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from care_core.causal.counterfactual import CounterfactualQuery
from care_core.diagnose.ranking import Suspect, deviating
from care_core.ecosystems.findings import Finding
from care_core.profile.store import Profile
from care_core.records import Record
from care_core.run import ProfileChoice, Run


class FailedRun(Record, eq=False):
    """A run, the profile that it is judged by, and the query that its options are asked by."""

    profile: Profile
    choice: ProfileChoice
    run: Run
    query: CounterfactualQuery
    reference: str
    """Whose the reference is."""
    unranked: Mapping[str, tuple[Suspect, ...]]
    """Per objective the options off their reference whose effect the training runs cannot tell, the likeliest first."""
    findings: Sequence[Finding]

    @property
    def off(self) -> frozenset[str]:
        """Options that were driven off their reference."""
        return frozenset(deviating(self.run.config, self.query.reference))
