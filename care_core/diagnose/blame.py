"""Which causes may have broken a judged run: what a report and a what-if both begin with."""

from __future__ import annotations

from collections.abc import Mapping

from care_core.causal.counterfactual import CounterfactualQuery
from care_core.diagnose.hypotheses import Arming, evidence_of_findings, failure_of
from care_core.diagnose.judging import Judged
from care_core.diagnose.noisy_or import NoisyOr
from care_core.diagnose.outside import suspects_outside
from care_core.diagnose.ranking import Suspect, suspects
from care_core.diagnose.records import OutsideSuspect
from care_core.ecosystems.findings import Health
from care_core.profile.schema import Schema
from care_core.profile.store import Profile
from care_core.records import Record
from care_core.run import Run, Setting

_REFUSAL = "arming_refused"
"""How the extraction of a refusal to arm ends, of whatever ecosystem."""


class Blame(Record, eq=False):
    """What may have broken a run."""

    run: Run
    """The run with what its findings say of its options as evidence."""
    suspects: Mapping[str, tuple[Suspect, ...]]
    """Per objective that it missed the options that may have moved it, the likeliest first."""
    outside: tuple[OutsideSuspect, ...]
    failure: NoisyOr

    @property
    def ranked(self) -> dict[str, tuple[Suspect, ...]]:
        """The suspects of which training tells what they do."""
        return {name: tuple(one for one in group if one.is_identified) for name, group in self.suspects.items()}

    @property
    def unranked(self) -> dict[str, tuple[Suspect, ...]]:
        """The others."""
        return {name: tuple(one for one in group if not one.is_identified) for name, group in self.suspects.items()}


def blame(
    judged: Judged,
    profile: Profile,
    query: CounterfactualQuery,
    health: Health,
    good: Mapping[str, Setting] | None = None,
) -> Blame:
    """The causes of a run that missed an objective. `good`: the parameters of the last good run, where one is known."""
    schema, broken = profile.schema, judged.broken
    said = evidence_of_findings(health.findings, schema, judged.run.config)
    run = judged.run.with_evidence(*said.values())
    found = {
        result.variable.name: suspects(query, result.variable.name, schema.known, run.evidence) for result in broken
    }
    outside = suspects_outside(run, broken, health, schema, query, good)
    weights = {one.name: one.weight for one in outside}
    untold = 1.0 - sum(option.name in run.config for option in schema.options) / max(1, len(schema.options))
    arming = Arming(run.refused_by, _idle(run, schema))
    failure = failure_of(query, broken, found, arming, health.findings, said, weights, untold)
    return Blame(run, found, outside, failure)


def _idle(run: Run, schema: Schema) -> frozenset[str]:
    """The options that, by what is known of them, keep a vehicle from arming and do nothing else, where none did."""
    refusals = {one.name for one in schema.metrics if one.extract is not None and one.extract.kind.endswith(_REFUSAL)}
    armed = {name for name in refusals if run.metrics.get(name) == 0}
    acts = {one.name: {effect for cause, effect in schema.known if cause == one.name} for one in schema.options}
    return frozenset(name for name, effects in acts.items() if effects and effects <= armed)
