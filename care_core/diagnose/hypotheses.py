"""What explains this failure: a parameter, a part that failed, what the robot met, or chance, in one ranking.

Each weighs the probability that it is there and would fail such a mission by itself:

- a parameter: what it adds to the probability of this failure, over what the reference configuration has;
- a part, or what was met: the probability that it really failed, seeing this run's signals and that the run failed,
  times the probability that a mission fails with it;
- chance: the probability that the reference configuration fails as well;
- what no signal shows: a rest, larger where the profile partly fits.

Where two would each have done alone, both are told; the weights are brought to add up to 1.
"""

from __future__ import annotations

import math
from collections.abc import Container, Iterable, Mapping, Sequence
from types import MappingProxyType

from care_core.causal.counterfactual import CounterfactualQuery
from care_core.diagnose.parts import is_late, set_wrong
from care_core.diagnose.ranking import Suspect
from care_core.diagnose.records import Hypothesis, ObjectiveResult
from care_core.ecosystems.findings import Finding, Severity, SuspectKind
from care_core.profile.schema import Schema
from care_core.records import replace
from care_core.run import Evidence, FitVerdict

MISSION_LOST: Mapping[Severity, float] = {"critical": 0.95, "warning": 0.6, "info": 0.05}
"""Probability that a mission fails with what a finding shows, by how severe it is, where the finding does not say."""
UNSEEN = 0.05
"""Weight of a failed part, and of something met, that left no signal."""
DOUBT: Mapping[FitVerdict, float] = {"fits": 1.0, "partly": 0.5, "no": 0.0}
"""Share of what the model says that is believed."""
UNKNOWN = 0.3
"""What an option, and chance, weigh for an objective that too few training missions had to learn from."""
LATE = 0.1
"""Share of its weight that a part keeps which failed when the run was failing already, by a finding that speaks of how
it was set."""
POINTED, MOST_POINTED = 0.05, 4.0
"""A finding that speaks of how the robot was set, and not of which option, speaks for options that add this much
together, and raises them by this factor at most."""
LEAST = 0.005
"""Hypotheses less likely than this are told together with chance."""
UNNAMED = "chance, or what no log shows"
"""What chance is called where there is no reference configuration that could fail as well."""
NONE_OUTSIDE: Mapping[str, float] = MappingProxyType({})
_WHAT: Mapping[SuspectKind, str] = {"hardware": "hardware", "world": "world", "operation": "world"}


def speaking(findings: Iterable[Finding], schema: Schema, config: Mapping[str, float]) -> dict[str, Evidence]:
    """By its title, what each finding that speaks of how the robot was set says of the options that the profile's rules
    read out of it; those of which they read none are left out."""
    said = {}
    for finding in filter(set_wrong, findings):
        kind = "found" if finding.severity == "critical" else "noticed"
        evidence = Evidence(finding.onset_s, f"{finding.title}: {finding.evidence}", kind)
        said[finding.title] = schema.pointed(evidence, config)
    return {title: evidence for title, evidence in said.items() if evidence.options}


def explain(
    query: CounterfactualQuery,
    broken: Sequence[ObjectiveResult],
    found: Mapping[str, Sequence[Suspect]],
    refused: Container[str],
    findings: Sequence[Finding],
    shown: Mapping[str, Evidence],
    verdict: FitVerdict,
    outside: Mapping[str, float] = NONE_OUTSIDE,
) -> tuple[Hypothesis, ...]:
    """What explains the broken objectives of a run.

    What an option adds is its share (its weight among the suspects) of the probability that this configuration breaks
    the objective, over that of the reference; before anything of this run is known, for its outcome is what is to be
    explained.

    Args:
        found: per objective the options that may have moved it, with their weights.
        refused: options that the check reads which refused this mission: they explain it whole.
        shown: by title, the findings that say which options they speak of (`speaking`).
        outside: how likely each parameter outside the profile is wrong and loses a mission in this way.
    """
    before = replace(query, observed={})
    options: dict[str, float] = {}
    chance = []
    for name in (result.variable.name for result in broken):
        excess, by_chance = _added(before, name)
        chance.append(by_chance)
        total = sum(max(0.0, suspect.weight) for suspect in found[name])
        for suspect in found[name] if total else ():
            options[suspect.option] = max(options.get(suspect.option, 0.0), excess * suspect.weight / max(total, 1.0))
    if any(one.kind == "prearm" and one.severity == "critical" for one in findings):
        options.clear()  # what acts in flight kept no vehicle from arming
    for finding in findings:
        if finding.title in shown:
            for option, share in _named_by(finding, shown[finding.title].options, found).items():
                options[option] = max(options.get(option, 0.0), share)
    options.update({suspect.option: 1.0 for group in found.values() for suspect in group if suspect.option in refused})
    return weigh(options, min(chance, default=0.0), findings, verdict, outside)


def unasked(
    findings: Sequence[Finding],
    *,
    failed: bool = False,
    shown: Mapping[str, Evidence] | None = None,
    verdict: FitVerdict = "no",
    outside: Mapping[str, float] = NONE_OUTSIDE,
) -> tuple[Hypothesis, ...]:
    """What explains a failure of which no model can be asked; empty where nothing failed, by a check of the run
    (`failed`) or by a critical finding. Options are those that such a finding names (`shown`, as for `explain`)."""
    critical = [finding for finding in findings if finding.severity == "critical"]
    if not failed and not critical:
        return ()
    options: dict[str, float] = {}
    for finding in critical:
        named = shown[finding.title].options if shown and finding.title in shown else ()
        for option in named:
            share = finding.probability * _mission_lost(finding) / len(named)
            options[option] = max(options.get(option, 0.0), share)
    weighed = weigh(options, 0.0, findings, verdict if options else "no", outside)
    return tuple(replace(one, name=UNNAMED) if one.what == "chance" else one for one in weighed)


def _named_by(finding: Finding, names: Container[str], found: Mapping[str, Sequence[Suspect]]) -> dict[str, float]:
    """The weight of a finding, shared by the suspects that it names as their own weights are."""
    weight: dict[str, float] = {}
    for suspect in (one for group in found.values() for one in group if one.option in names):
        weight[suspect.option] = max(weight.get(suspect.option, 0.0), suspect.weight)
    total = sum(weight.values())
    whole = finding.probability * _mission_lost(finding)
    return {option: whole * share / total for option, share in weight.items() if total}


def _added(before: CounterfactualQuery, objective: str) -> tuple[float, float]:
    """What this configuration adds to the probability that the objective breaks, and what the reference has of it."""
    if objective not in before.model.outcomes:
        return UNKNOWN, UNKNOWN
    asked = [before.config, before.reference]
    here, there = 1.0 - before.p_ok(objective, asked)
    added = float(here - there)
    if before.model.outcomes[objective].stages:
        # What makes a mission late or costly makes it fail as well, and then its time and energy are not known.
        here, all_there = 1.0 - before.probability(asked)
        added = max(added, float(here - all_there))
    return max(0.0, added), float(there)


def weigh(
    options: Mapping[str, float],
    chance: float,
    findings: Iterable[Finding],
    verdict: FitVerdict,
    outside: Mapping[str, float] = NONE_OUTSIDE,
) -> tuple[Hypothesis, ...]:
    """Every explanation with its probability, the likeliest first; they add up to 1.

    Args:
        options: per option how much it adds to the probability of this failure (0 to 1).
        chance: probability that the reference configuration fails in this way as well.
        findings: what the log shows, in the order told; what came after the impact explains nothing.
        verdict: how well the profile fits the log.
        outside: as for `explain`; they need no profile.
    """
    trust = DOUBT[verdict]
    weights: dict[tuple[str, str], float] = {("chance", ""): max(chance * trust, UNSEEN)}
    for what in ("hardware", "world"):
        weights[what, ""] = UNSEEN * (1.0 if verdict == "fits" else 3.0)
    seen = [finding for finding in findings if not finding.after_impact and finding.severity != "info"]
    by_setting = [finding for finding in seen if set_wrong(finding)]
    unnamed = [finding for finding in by_setting if not finding.parameters]
    for option, share in _raised(options, unnamed).items():
        if share * trust > 0:
            weights["parameter", option] = share * trust
    weights |= {("parameter", name): share for name, share in outside.items()}
    without = math.prod(1.0 - share for share in outside.values())
    other = 1.0 - (1.0 - min(1.0, sum(options.values()))) * (1.0 - chance) * without
    for finding in seen:
        if finding.suspect in _WHAT:
            key = _WHAT[finding.suspect], finding.title
            share = LATE if is_late(finding, by_setting) else 1.0
            weights[key] = max(weights.get(key, 0.0), share * _lost_by(finding, other))
        for name in finding.parameters:
            named = finding.probability * _mission_lost(finding) / len(finding.parameters)
            weights["parameter", name] = max(weights.get(("parameter", name), 0.0), named)
    return _normalised(weights)


def _mission_lost(finding: Finding) -> float:
    return MISSION_LOST[finding.severity] if finding.mission_lost is None else finding.mission_lost


def _raised(options: Mapping[str, float], by_setting: Sequence[Finding]) -> dict[str, float]:
    """What the options add, raised to what the findings say that speak of how the robot was set."""
    total = sum(options.values())
    said = max((one.probability * _mission_lost(one) for one in by_setting), default=0.0)
    factor = min(max(1.0, said / total), MOST_POINTED) if total >= POINTED else 1.0
    return {name: min(1.0, factor * share) for name, share in options.items()}


def _lost_by(finding: Finding, other: float) -> float:
    """Probability that what a finding shows is there and fails the mission, given that the run failed.

    Args:
        other: probability that the run fails without it.
    """
    lost = _mission_lost(finding)
    with_it = finding.probability * (1.0 - (1.0 - lost) * (1.0 - other))
    without = (1.0 - finding.probability) * max(other, UNSEEN)
    return lost * with_it / (with_it + without)


def _normalised(weights: Mapping[tuple[str, str], float]) -> tuple[Hypothesis, ...]:
    total = sum(weights.values())
    shares = {key: weight / total for key, weight in weights.items()}
    rest = sum(share for key, share in shares.items() if share < LEAST and key != ("chance", ""))
    shares = {key: share for key, share in shares.items() if share >= LEAST or key == ("chance", "")}
    shares["chance", ""] += rest
    ranked = sorted(shares.items(), key=lambda entry: (-entry[1], entry[0]))
    return tuple(Hypothesis(what, name, share) for (what, name), share in ranked)  # type: ignore[arg-type]
