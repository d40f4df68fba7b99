"""Which of the fixes that were found is advised, if any: right, or silent."""

from __future__ import annotations

import math
from collections.abc import Container, Sequence

from care_core.diagnose.parts import LATE_S, set_wrong
from care_core.diagnose.records import Cause, Fault, Fix, Hypothesis, ObjectiveResult
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.ranking import LIKELY
from care_core.records import replace
from care_core.run import FitVerdict
from care_core.text import log_time

ENOUGH = 0.5
"""A change less likely than this to repair the run is no advice."""
CHANCY = 0.75
"""Odds of the reference configuration below which missions fail by chance as well: less is then enough, in proportion,
and one good run after a change proves little, nor one bad run much."""

STANDS_OUT = 0.12
"""Probability that a change must add to that of the run as driven: below it no parameter stands out."""
NECESSARY = 0.15
"""Share of the failures of this configuration, before anything of the run is known, that a change must take away where
it leaves the likeliest cause as it is: of 125 changes on recorded flights those below were wrong, 110 above right."""
LITTLE = 0.5
"""Share of its cause's probability below which what a change adds has to be explained."""
ALIKE = 0.02
"""Shares of a limit that are no difference to an operator."""


def believed(fixes: Sequence[Fix], hypotheses: Sequence[Hypothesis], modelled: Container[str]) -> tuple[Fix, ...]:
    """The fixes of the profile's options with the probability that something else did it taken off their promise.

    Args:
        modelled: the options of the profile.
    """
    share = _repairable(hypotheses) - _outside(hypotheses, modelled)
    return tuple(replace(fix, p_fixed=fix.p_fixed * share) for fix in fixes)


def _repairable(hypotheses: Sequence[Hypothesis]) -> float:
    return 1.0 - sum(one.probability for one in hypotheses if one.what in ("hardware", "world") and one.name)


def _outside(hypotheses: Sequence[Hypothesis], modelled: Container[str]) -> float:
    """Probability of a parameter that the profile does not model."""
    return sum(one.probability for one in hypotheses if one.what == "parameter" and one.name not in modelled)


def outweighed(hypotheses: Sequence[Hypothesis], findings: Sequence[Finding] = ()) -> str | None:
    """Why no parameter is to be changed, where something else explains the failure better than all of them together.

    A part that, by no sure sign, failed well after the robot was failing by how it was set may be what that led to:
    motors at their limit for an oscillation have too little thrust. Then it is not what to look at first.
    """
    rival = next((one for one in hypotheses if one.what in ("hardware", "world") and one.name), None)
    parameters = sum(one.probability for one in hypotheses if one.what == "parameter")
    if rival is None or rival.probability <= parameters:
        return None
    doubtful = (one for one in findings if one.title == rival.name and one.probability < LIKELY)
    since_s = min((one.onset_s for one in doubtful), default=-math.inf)
    sooner = [one for one in findings if set_wrong(one) and one.onset_s + LATE_S < since_s]
    if sooner:
        earliest = min(sooner, key=lambda one: one.onset_s)
        return (
            f"{earliest.title} from {log_time(earliest.onset_s, 0)} on, before {rival.name}: that speaks of how the "
            "robot is set, and training does not tell which parameter does it"
        )
    return f"{rival.name}; that explains this failure better than any parameter: look at it first"


def nearest(fixes: Sequence[Fix], broken: Sequence[ObjectiveResult]) -> Fix | None:
    """The smallest fix whose predicted values exceed the limits about least, as shares of them; None without any."""

    def excess(fix: Fix) -> float:
        return sum(max(0.0, _beyond(fix, result)) for result in broken)

    least = min(map(excess, fixes), default=0.0)
    near = [fix for fix in fixes if excess(fix) <= least + ALIKE]
    return min(near, key=lambda fix: len(fix.changes), default=None)


def _beyond(fix: Fix, result: ObjectiveResult) -> float:
    predicted, bound = fix.predicted.get(result.variable.name), result.threshold
    if predicted is None or bound is None or result.variable.kind == "functional":
        return 0.0
    sign = 1.0 if bound.op in ("<=", "<") else -1.0
    return sign * (predicted.value - bound.bound) / (abs(bound.bound) or 1.0)


def odds_as_driven(probability: float, hypotheses: Sequence[Hypothesis]) -> float:
    """Probability that the next run meets every limit as driven, given that this one failed: what a parameter or a
    failed part brought about stays as long as they do, whatever of this run's noise is drawn anew.

    Args:
        probability: what the mechanisms give the configuration as driven.
    """
    lasting = sum(one.probability for one in hypotheses if one.what == "parameter")
    return max(0.0, min(probability * _repairable(hypotheses), _repairable(hypotheses) - lasting))


def believed_causes(
    faults: Sequence[Fault], hypotheses: Sequence[Hypothesis], modelled: Container[str]
) -> tuple[Fault, ...]:
    """The faults with the same taken off what each cause promises alone."""
    share = _repairable(hypotheses) - _outside(hypotheses, modelled)

    def scaled(cause: Cause) -> Cause:
        return cause if cause.p_fixed is None else replace(cause, p_fixed=cause.p_fixed * share)

    return tuple(replace(fault, causes=tuple(map(scaled, fault.causes))) for fault in faults)


def no_stand_out(fix: Fix, as_driven: float, hypotheses: Sequence[Hypothesis], necessary: float) -> str | None:
    """Why a fix is not advised that changes no cause which stands in the ranking, or adds little, else None.

    Args:
        as_driven: probability that the next run meets every limit without it, as the fix's.
        necessary: share of this configuration's failures that it takes away.
    """
    odds = f"with {_changes(fix)} the odds are {fix.p_fixed:.0%}, as driven {as_driven:.0%}"
    if fix.p_fixed - as_driven < STANDS_OUT:
        return f"no parameter stands out: {odds}"
    chance = sum(one.probability for one in hypotheses if one.what == "chance")
    changed = {change.option.name for change in fix.changes}
    leader = _leader(hypotheses)
    is_cause = any(one.name in changed and one.probability > chance for one in hypotheses if one.what == "parameter")
    if is_cause and (leader in changed or necessary >= NECESSARY):
        return None
    return f"no parameter stands out: {odds}, and nothing in this run says that it was the cause"


def explained(fix: Fix, as_driven: float, hypotheses: Sequence[Hypothesis], faults: Sequence[Fault]) -> str:
    """Why another parameter is changed than the likeliest cause, or why the change of a likely one adds little; empty
    where neither is so."""
    leader = _leader(hypotheses)
    weight = next((one.probability for one in hypotheses if leader and one.name == leader), 0.0)
    if leader and leader not in {change.option.name for change in fix.changes}:
        alone = next((c.p_fixed for fault in faults for c in fault.causes if c.option.name == leader), None)
        does = "no acceptable value of it" if alone is None else f"changing only that has {alone:.0%}"
        return f"{leader} is the likelier cause ({weight:.0%}), but {does}"
    if leader and fix.p_fixed - as_driven < LITTLE * weight:
        return f"{leader} explains {weight:.0%}, but a run as driven may go well by chance"
    return ""


def _leader(hypotheses: Sequence[Hypothesis]) -> str:
    """The likeliest parameter, empty where none is told."""
    return next((one.name for one in hypotheses if one.what == "parameter"), "")


def _changes(fix: Fix) -> str:
    return ", ".join(map(str, fix.changes))


def untried(fix: Fix, learned_elsewhere: str) -> str | None:
    """Why a fix is not advised that rests on other robots alone, with what it suspects, else None."""
    if not learned_elsewhere:
        return None
    suspected = ", ".join(change.option.name for change in fix.changes)
    return f"{learned_elsewhere}, so no change is advised; look at {suspected}, and carry it over with 'care update'"


def unrecorded(fix: Fix, verdict: FitVerdict) -> str | None:
    """Why a fix is not advised that changes what the log does not hold, where the profile fits only in part."""
    names = [change.option.name for change in fix.changes if change.is_assumed]
    if verdict == "fits" or not names:
        return None
    return f"the log does not hold {', '.join(names)}: record it, or name the configuration with --config"


def enough(odds: float) -> float:
    """Probability of meeting every limit from which on a change is advice.

    Args:
        odds: probability that the reference configuration meets every limit in such a mission. Where missions fail by
            chance no change is surer than that, and one that comes near it is what there is to be done.
    """
    return ENOUGH * min(1.0, odds / CHANCY)


def falls_short(fix: Fix, broken: Sequence[ObjectiveResult], odds: float, as_driven: float | None = None) -> str | None:
    """Why a fix is not advised that is too unlikely to repair the run, with what it reaches, else None.

    Args:
        odds: as for `enough`.
        as_driven: what the promise stands beside.
    """
    if fix.p_fixed >= enough(odds):
        return None
    reached = "; ".join(filter(None, (_reached(fix, result) for result in broken)))
    limit = f"; with it {reached}" if reached else ""
    without = "" if as_driven is None else f", as driven {as_driven:.0%}"
    best = f"the best found, {_changes(fix)}, has {fix.p_fixed:.0%}{without}"
    return f"no change is likely enough to meet every limit: {best}{limit}"


def by_chance(fix: Fix, now: float, odds: float) -> str | None:
    """What an operator has to know of a change where the reference configuration misses limits too, else None."""
    if odds >= CHANCY:
        return None
    return (
        f"such missions fail by chance too: by the model the reference meets every limit in {odds:.0%} of them, this "
        f"change in {fix.p_fixed:.0%}, the run as it was in {now:.0%}; one run proves little, repeat it"
    )


def _reached(fix: Fix, result: ObjectiveResult) -> str:
    """What the best change brings of an objective whose limit it does not reach."""
    name, unit, predicted = result.variable.name, result.variable.unit, fix.predicted.get(result.variable.name)
    if predicted is None or result.threshold is None or result.variable.kind == "functional":
        return ""
    if result.threshold.met(predicted.value):
        return ""
    likely = predicted.high if result.threshold.op in ("<=", "<") else predicted.low
    value, limit = (f"{number:.4g} {unit}".rstrip() for number in (likely, result.threshold.value))
    return f"{name} is 90 % sure to reach {value}, the limit of {limit} is out of reach"
