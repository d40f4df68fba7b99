"""What explains this failure: a parameter, a part that failed, what the robot met, or chance, in one ranking.

Each is a cause of one noisy-OR (`noisy_or`), with the probability that it is there and loses such a mission by itself:

- a parameter: the share of the missions that its value alone takes from those that the rest keeps, before anything of
  this run is known, and of those that meet what this run met; what training may have missed of it, most where this
  run's symptoms point and training says least; and what a finding says of it;
- a part, or what was met: the probability that it really failed, seeing this run's signals, times the probability that
  a mission fails with it;
- chance: the share of the missions that the reference configuration loses, as counted and as learned;
- a parameter that the profile does not know, or whose value neither the log nor a file tells.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from care_core.causal.counterfactual import CounterfactualQuery
from care_core.causal.model import ReferenceRuns
from care_core.diagnose.estimates import (
    BY_CHANCE_REFUSED,
    BY_THIS_RUN,
    DOUBT,
    LATE,
    LEARNED_WEIGHT,
    MISSED,
    MISSION_LOST_CRITICAL,
    MISSION_LOST_INFO,
    MISSION_LOST_WARNING,
    REFUSED_ITSELF,
    REFUSING,
    SPOKEN_FOR,
    UNMODELLED,
    UNSAID,
    UNTOLD,
    USED_UP,
)
from care_core.diagnose.noisy_or import CHANCE, UNKNOWN, Key, NoisyOr, What
from care_core.diagnose.parts import OUTLASTED, is_late, never_flew, set_wrong, was_refused
from care_core.diagnose.ranking import Suspect, back_at_reference, deviating
from care_core.diagnose.records import Hypothesis, ObjectiveResult
from care_core.ecosystems.explains import EXPLAINS
from care_core.ecosystems.findings import (
    BATTERY_FAILSAFE,
    SAGS,
    Finding,
    FindingKind,
    Severity,
    SuspectKind,
    every_finding,
)
from care_core.ecosystems.ranking import LIKELY, may_refuse
from care_core.numbers import Floats, six_digits
from care_core.profile.schema import Schema
from care_core.records import Record, replace
from care_core.run import Evidence, FitVerdict

MISSION_LOST: Mapping[Severity, float] = {
    "critical": MISSION_LOST_CRITICAL.value, "warning": MISSION_LOST_WARNING.value, "info": MISSION_LOST_INFO.value,
}  # fmt: skip
"""Probability that a mission fails with what a finding shows, by how severe it is, where the finding does not say."""
UNTOLD_BY_FIT: Mapping[FitVerdict, float] = {"fits": UNTOLD.value / 2, "partly": UNTOLD.value, "no": UNTOLD.value}
"""Probability of what no log shows, where no model can be asked."""
LEAST = 0.005
"""Hypotheses less likely than this have no line of their own."""
UNNAMED = "chance, or what no log shows"
"""What chance is called where there is no reference configuration that could fail as well."""
NOT_SHOWN = "nothing that this log shows"
"""The same where it stands alone."""
NONE_OUTSIDE: Mapping[str, float] = MappingProxyType({})
_SMALL = 1e-9
_ENDING: frozenset[FindingKind] = frozenset(("battery", "log"))
"""Kinds that end a run which goes on for too long."""
_WHAT: Mapping[SuspectKind, What] = {"hardware": "hardware", "world": "world", "operation": "world"}


def evidence_of_findings(
    findings: Iterable[Finding], schema: Schema, config: Mapping[str, float]
) -> dict[str, Evidence]:
    """By its title, what each finding that speaks of how the robot was set says of the options that the profile's rules
    read out of it; those of which they read none are left out."""
    said = {}
    for finding in filter(set_wrong, findings):
        kind = "found" if finding.severity == "critical" else "noticed"
        evidence = Evidence(finding.onset_s, f"{finding.title}: {finding.evidence}", kind, is_concluded=True)
        # its numbers stand with the findings
        said[finding.title] = replace(schema.pointed(evidence, config), text=finding.title)
    return {title: evidence for title, evidence in said.items() if evidence.options}


class Arming(Record):
    """What options had to do with whether it armed."""

    refused_by: frozenset[str]
    """Those that the check reads which refused this mission: they explain it whole."""
    idle: frozenset[str]
    """Those that can do nothing but keep it from arming, where nothing did: they explain nothing."""


def failure_of(
    query: CounterfactualQuery,
    broken: Sequence[ObjectiveResult],
    found: Mapping[str, Sequence[Suspect]],
    arming: Arming,
    findings: Sequence[Finding],
    shown: Mapping[str, Evidence],
    outside: Mapping[str, float] = NONE_OUTSIDE,
    untold: float = 0.0,
) -> NoisyOr:
    """The causes that may have broken these objectives.

    Args:
        found: per objective the options that may have moved it, with their weights.
        shown: by title, the findings that say which options they speak of (`evidence_of_findings`).
        outside: how likely each parameter outside the profile is wrong and loses a mission in this way.
        untold: share of the options whose value is not known.
    """
    before = query.before()
    names = [result.variable.name for result in broken]
    options, chance = _lost_by_options(before, names)
    if never_flew(findings):
        options = dict.fromkeys(options, 0.0)  # what acts in flight kept no vehicle from arming, and hardly chance
        chance = min(chance, BY_CHANCE_REFUSED.value)
    else:
        unlearned = float(before.epistemic_ratio([before.config], names)[0])
        pointed = _pointed_at(found)
        options = {n: _either(q, MISSED.value, unlearned * pointed.get(n, 0.0)) for n, q in options.items()}
        options = _set_wrong_by(findings, {n: 0.0 if n in arming.idle else q for n, q in options.items()})
        able = {n: q for n, q in options.items() if n not in arming.idle}
        options |= _as_it_went(query, names, able, _unspoken(findings))
    for finding in (one for one in findings if one.title in shown):
        for option, share in _named_by(finding, shown[finding.title].options, found).items():
            options[option] = _either(options.get(option, 0.0), share)
    suspected = {one.option for group in found.values() for one in group}
    options.update(dict.fromkeys(sorted(suspected & arming.refused_by), REFUSING.value))
    causes: dict[Key, float] = {("parameter", name): q for name, q in {**outside, **options}.items()}
    return NoisyOr(
        {
            CHANCE: chance,
            UNKNOWN: _either(UNMODELLED.value, UNSAID.value * untold),
            **with_findings(causes, findings, outlasts=any(result.variable.grows for result in broken)),
        }
    )


def hypotheses_of(failure: NoisyOr) -> tuple[Hypothesis, ...]:
    """Every explanation, the likeliest first: the probability that it acted and none above it did; they add up to 1.
    What is less likely than `LEAST` is told with what the profile does not know, or with chance where it knows nothing.
    They are as a report keeps them, so that it says the same when it is read again.
    """
    told = {key: (1.0 - DOUBT.value) * share for key, share in failure.ranking().items()}
    rest = UNKNOWN if UNKNOWN in told else CHANCE
    shares = {key: share for key, share in told.items() if share >= LEAST and key != rest}
    shares[rest] = 1.0 - sum(shares.values())
    ranked = sorted(shares.items(), key=lambda entry: (-entry[1], entry[0]))
    return tuple(
        Hypothesis(
            what, name, six_digits(share), six_digits(max(share, (1.0 - DOUBT.value) * failure.acts((what, name))))
        )
        for (what, name), share in ranked
    )


def of_battery(missed: Sequence[ObjectiveResult], findings: Iterable[Finding]) -> bool:
    """Whether all that went wrong is a failsafe of the battery, whatever else was noticed on the way."""
    others = any(one.severity == "critical" and (one.kind != "battery" or one.parameters) for one in findings)
    only = [one for one in missed if one.variable.name == "no_failsafe"]
    return not others and len(missed) == len(only) == 1 and only[0].reason.startswith(BATTERY_FAILSAFE)


def used_up(findings: Iterable[Finding]) -> bool:
    """Whether a battery that failed a run was flown until it had no more to give: its failsafe says no other reason."""
    return all(one.title in (BATTERY_FAILSAFE, SAGS) for one in findings if one.severity == "critical")


def hypotheses_without_model(
    findings: Sequence[Finding],
    *,
    missed: Sequence[ObjectiveResult] = (),
    shown: Mapping[str, Evidence] | None = None,
    verdict: FitVerdict = "no",
    outside: Mapping[str, float] = NONE_OUTSIDE,
) -> tuple[Hypothesis, ...]:
    """What explains a failure of which no model can be asked; empty where nothing failed, by a check of the run
    (`missed`) or by a critical finding. Options are those that such a finding names (`shown`, as for `failure_of`)."""
    critical = [finding for finding in findings if finding.severity == "critical"]
    if not missed and not critical:
        return ()
    options: dict[Key, float] = {("parameter", name): share for name, share in outside.items()}
    if not missed:  # what is critical is then all that failed
        findings = [one for one in findings if one in critical or _may_bring_about(one, *(c.kind for c in critical))]
    if of_battery(missed, findings):
        if used_up(findings):
            options["world", OUTLASTED] = USED_UP.value
        findings = [one for one in findings if one.kind == "battery" or _may_bring_about(one, "battery")]
    for finding in critical:
        named = shown[finding.title].options if shown and finding.title in shown else ()
        for option in named:
            share = finding.probability * mission_lost(finding) / len(named)
            options["parameter", option] = max(options.get(("parameter", option), 0.0), share)
    failure = NoisyOr({CHANCE: UNTOLD_BY_FIT[verdict], **with_findings(options, findings)})
    told = hypotheses_of(failure)
    rest = UNNAMED if len(told) > 1 else NOT_SHOWN
    return tuple(replace(one, name=rest) if one.what == "chance" else one for one in told)


def _named_by(finding: Finding, names: Container[str], found: Mapping[str, Sequence[Suspect]]) -> dict[str, float]:
    """The weight of a finding, shared by the suspects that it names as their own weights are."""
    weight: dict[str, float] = {}
    for suspect in (one for group in found.values() for one in group if one.option in names):
        weight[suspect.option] = max(weight.get(suspect.option, 0.0), suspect.weight)
    total = sum(weight.values())
    whole = finding.probability * mission_lost(finding)
    return {option: whole * share / total for option, share in weight.items() if total}


class _ByTurns(NamedTuple):
    """Probability that what broke is kept, as each option off its reference goes back by turns."""

    off: Sequence[str]
    driven: float
    back: float
    """With all of them back."""
    first: Floats
    """With each as the only one that is back, shape (options,)."""
    last: Floats
    """With each as the only one that is off."""

    @classmethod
    def ask(cls, query: CounterfactualQuery, broken: Sequence[str]) -> _ByTurns:
        off = deviating(query.config, query.reference)
        back = back_at_reference(query, frozenset(off))
        configs = [query.config, back, *(back_at_reference(query, frozenset((name,))) for name in off)]
        kept = _kept(query, broken, [*configs, *({**back, name: query.config[name]} for name in off)])
        return cls(off, float(kept[0]), float(kept[1]), kept[2 : 2 + len(off)], kept[2 + len(off) :])

    def lost(self, first: Floats) -> dict[str, float]:
        """What each option takes, in the mean of what it does as the first that goes back and as the last: where two
        are needed to keep a mission, or two to lose it, one of the answers shows it."""
        mean = (np.clip(first, 0.0, 1.0) + np.clip(1.0 - self.last / self.back, 0.0, 1.0)) / 2
        return dict(zip(self.off, map(float, mean), strict=True))


def _lost_by_options(before: CounterfactualQuery, broken: Sequence[str]) -> tuple[dict[str, float], float]:
    """What each option off its reference loses by itself, and what the reference loses, before anything of this run is
    known."""
    turns = _ByTurns.ask(before, broken)
    lost = turns.lost(1.0 - turns.driven / turns.first)
    return lost, _chance(1.0 - turns.back, before.model.training.reference)


def _as_it_went(
    query: CounterfactualQuery, broken: Sequence[str], options: dict[str, float], unspoken: float
) -> dict[str, float]:
    """The options with what each loses of missions that meet what this run met, where that is more: a run that was
    slow where its option makes it slow says more than that option's missions do together.

    Args:
        unspoken: probability that what this run met is nothing that the log shows: what came of that would be laid to
            options.
    """
    if not query.model.outcomes.keys() & broken:
        return options
    turns = _ByTurns.ask(query, broken)
    lost = turns.lost((turns.first - turns.driven) / max(1.0 - turns.driven, _SMALL))
    weight = BY_THIS_RUN.value * unspoken
    return {name: max(q, (1.0 - weight) * q + weight * lost.get(name, 0.0)) for name, q in options.items()}


def _unspoken(findings: Sequence[Finding]) -> float:
    """Probability that nothing which the log shows lost the run, whatever brought that about."""
    shown = (one for one in _acting(findings) if one.severity != "info" and one.suspect in _WHAT)
    return float(np.prod([1.0 - mission_lost(one) for one in shown]))


def _kept(query: CounterfactualQuery, broken: Sequence[str], configs: Sequence[Mapping[str, float]]) -> Floats:
    """Probability that what broke is kept, shape (m,), off 0; a coin's toss where training had too few runs to say."""
    odds = query.all_kept([name for name in broken if name in query.model.outcomes], configs)
    return np.full(len(configs), 0.5) if odds is None else np.clip(odds, 1e-4, 1.0)


def _chance(learned: float, counted: ReferenceRuns) -> float:
    """The share of missions that the reference loses: as learned, and as counted where training flew it."""
    weight = LEARNED_WEIGHT.value
    return (weight * learned + counted.failed) / (weight + counted.runs)


def _set_wrong_by(findings: Iterable[Finding], options: Mapping[str, float]) -> dict[str, float]:
    """The options with what a finding says that speaks of how the robot was set and of no parameter: that one of them
    loses the mission, each as likely as it is by itself; nothing where they hardly lose any."""
    unnamed = (one for one in findings if set_wrong(one) and not one.parameters)
    said, total = max((one.probability * mission_lost(one) for one in unnamed), default=0.0), sum(options.values())
    if total < SPOKEN_FOR.value:
        return dict(options)
    return {name: _either(q, said * q / total) for name, q in options.items()}


def _pointed_at(found: Mapping[str, Sequence[Suspect]]) -> dict[str, float]:
    """Per option the largest share of a broken objective that this run's own signs lay to it, 0 to 1."""
    shares: dict[str, float] = {}
    for group in found.values():
        total = max(1.0, sum(max(0.0, one.weight) for one in group))
        for one in group:
            shares[one.option] = max(shares.get(one.option, 0.0), one.weight / total)
    return shares


def _either(*shares: float) -> float:
    """Probability that one of several reasons holds, each by itself."""
    return 1.0 - float(np.prod([1.0 - share for share in shares]))


def with_findings(
    causes: Mapping[Key, float], findings: Iterable[Finding], *, outlasts: bool = False
) -> dict[Key, float]:
    """The causes with what the log shows, in the order told; what came after the impact explains nothing.

    Args:
        outlasts: the run took more than its mission may take: a pack that gives out by no other sign, and a log that
            ends on the way, are late, too.
    """
    found = dict(causes)
    seen = [finding for finding in _acting(tuple(findings)) if finding.severity != "info"]
    by_setting = [finding for finding in seen if set_wrong(finding)]
    for finding in seen:
        whole = finding.probability * mission_lost(finding)
        named: list[Key] = [("parameter", name) for name in finding.parameters]
        shares = dict.fromkeys(named, whole / max(1, len(named)))
        if _is_the_reason_itself(finding, causes):
            shares["world", finding.title] = REFUSED_ITSELF.value
        if finding.suspect in _WHAT:
            gave_out = outlasts and finding.kind in _ENDING and finding.probability < LIKELY
            late = gave_out or is_late(finding, by_setting)
            shares[_WHAT[finding.suspect], finding.title] = whole * (LATE.value if late else 1.0)
        found |= {key: max(found.get(key, 0.0), share) for key, share in shares.items()}
    return found


def _acting(findings: Sequence[Finding]) -> Iterator[Finding]:
    """The findings that may have lost a run: what came after an impact did not, and a vehicle that was refused lost its
    run by what keeps one from arming."""
    is_refused = was_refused(findings)
    for one in findings:
        if not one.after_impact and (not is_refused or one.kind == "prearm" or _kept_from_arming(one, findings)):
            yield one


def _kept_from_arming(finding: Finding, findings: Sequence[Finding]) -> bool:
    """Whether a finding may have kept the vehicle from arming: of how it was set, where the refusal speaks of that."""
    refusals = (one for one in every_finding(findings) if one.kind == "prearm")
    speaks = not finding.parameters or any(may_refuse(finding, one) for one in refusals)
    return _may_bring_about(finding, "prearm") and speaks


def _may_bring_about(finding: Finding, *kinds: FindingKind) -> bool:
    return not EXPLAINS.get(finding.kind, frozenset()).isdisjoint(kinds)


def _is_the_reason_itself(finding: Finding, causes: Mapping[Key, float]) -> bool:
    """Whether it is a refusal to arm of which no parameter is likely to be the reason: what it says is."""
    likely = any(what == "parameter" and share > SPOKEN_FOR.value for (what, _), share in causes.items())
    return finding.kind == "prearm" and finding.suspect == "parameter" and not finding.parameters and not likely


def mission_lost(finding: Finding) -> float:
    """Probability that a mission fails with what a finding shows."""
    return MISSION_LOST[finding.severity] if finding.mission_lost is None else finding.mission_lost
