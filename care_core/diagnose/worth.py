"""Which of the fixes that were found is advised, if any: by what it adds to the odds of running the mission again."""

from __future__ import annotations

import math
from collections.abc import Sequence

from care_core.diagnose.estimates import CHANCY, COST, NECESSARY, WORTH
from care_core.diagnose.fixes import as_likely
from care_core.diagnose.parts import LATE_S, set_wrong
from care_core.diagnose.promise import Promise
from care_core.diagnose.records import Cause, Fault, Fix, Hypothesis, ObjectiveResult
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.ranking import LIKELY, SYMPTOMS
from care_core.records import replace
from care_core.run import FitVerdict
from care_core.text import log_time, percent
from care_core.variables import Change

TOLD_APART = 4.0
"""How many times likelier good runs have to be with the change than without for it to be known that it works."""
MOST_RUNS = 10
"""More than so many runs in a row nobody makes to know."""

LITTLE = 0.5
"""Share of its cause's probability below which what a change adds has to be explained."""
LOOK_FIRST = "look at it first"
"""How it is said that something is looked at before any parameter is changed."""
ALIKE = 0.02
"""Shares of a limit that are no difference to an operator."""


def promised(fixes: Sequence[Fix], promise: Promise) -> tuple[Fix, ...]:
    """The fixes of the profile's options with what they promise for the next run."""
    if not fixes:
        return ()
    driven = promise.query.config
    configs = [{**driven, **{one.option.name: one.suggested for one in fix.changes}} for fix in fixes]
    odds = map(float, promise.odds(configs))
    return tuple(
        replace(
            fix,
            p_fixed=share,
            predicted={name: as_likely(one, share) for name, one in fix.predicted.items()},
            changes=_likeliest_first(fix, promise),
        )
        for fix, share in zip(fixes, odds, strict=True)
    )


def _likeliest_first(fix: Fix, promise: Promise) -> tuple[Change, ...]:
    """The changes in the order of how likely what they change acted: of several the first is the one that is read."""
    acts = {one.option.name: promise.failure.acts(("parameter", one.option.name)) for one in fix.changes}
    return tuple(sorted(fix.changes, key=lambda one: -round(acts[one.option.name], 2)))


def promised_causes(faults: Sequence[Fault], promise: Promise) -> tuple[Fault, ...]:
    """The faults with what each cause promises where only that is changed."""

    def alone(cause: Cause) -> Cause:
        if cause.p_fixed is None or cause.suggested is None:
            return cause
        changed = {**promise.query.config, cause.option.name: cause.suggested}
        return replace(cause, p_fixed=float(promise.odds([changed])[0]))

    return tuple(replace(fault, causes=tuple(map(alone, fault.causes))) for fault in faults)


def outweighed(hypotheses: Sequence[Hypothesis], findings: Sequence[Finding] = ()) -> str | None:
    """Why no parameter is to be changed, where something else explains the failure better than all of them together.

    A part that, by no sure sign, failed well after the robot was failing by how it was set may be what that led to:
    motors at their limit for an oscillation have too little thrust. Then it is not what to look at first.
    """
    rival = next((one for one in hypotheses if one.what in ("hardware", "world") and one.name), None)
    parameters = sum(one.probability for one in hypotheses if one.what == "parameter" and one.name)
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
    if any(one.title == rival.name and one.kind in SYMPTOMS for one in findings):
        return f"{rival.name}, and neither this log nor training says why"
    return f"{rival.name}; that explains this failure better than any parameter: {LOOK_FIRST}"


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


def no_stand_out(fix: Fix, as_driven: float, hypotheses: Sequence[Hypothesis], necessary: float) -> str | None:
    """Why a fix is not advised that changes no cause which stands in the ranking, else None.

    Args:
        as_driven: probability that the next run meets every limit without it, as the fix's.
        necessary: share of this configuration's failures that it takes away.
    """
    chance = sum(one.probability for one in hypotheses if one.what == "chance")
    unknown = sum(one.probability for one in hypotheses if one.what == "parameter" and not one.name)
    least = max(chance, unknown)
    changed = {change.option.name for change in fix.changes}
    leader = _leader(hypotheses)
    is_cause = any(one.name in changed and one.probability > least for one in hypotheses if one.what == "parameter")
    if is_cause and (leader in changed or necessary >= NECESSARY.value):
        return None
    odds = f"with {_changes(fix)} the odds are {percent(fix.p_fixed)}, as driven {percent(as_driven)}"
    return f"no parameter stands out: {odds}, and nothing in this run says that it was the cause"


def explained(fix: Fix, as_driven: float, hypotheses: Sequence[Hypothesis], faults: Sequence[Fault]) -> str:
    """Why another parameter is changed than the likeliest cause, or why the change of a likely one adds little; empty
    where neither is so."""
    leader = _leader(hypotheses)
    weight = next((one.probability for one in hypotheses if leader and one.name == leader), 0.0)
    if leader and leader not in {change.option.name for change in fix.changes}:
        alone = next((c.p_fixed for fault in faults for c in fault.causes if c.option.name == leader), None)
        does = "no acceptable value of it" if alone is None else f"changing only that has {percent(alone)}"
        return f"{leader} is the likelier cause ({percent(weight)}), but {does}"
    if leader and fix.p_fixed - as_driven < LITTLE * weight:
        by_chance_alone = as_driven >= fix.p_fixed / 2
        but = "a run as driven may go well by chance" if by_chance_alone else "its change may not be all that it takes"
        return f"{leader} explains {percent(weight)}, but {but}"
    return ""


def _leader(hypotheses: Sequence[Hypothesis]) -> str:
    """The likeliest parameter, empty where none is told."""
    return next((one.name for one in hypotheses if one.what == "parameter" and one.name), "")


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


def adds_enough(odds: float, as_driven: float, changes: int) -> bool:
    """Whether so many changes add enough to the odds of running the same mission again, whatever those are: on robots
    that fail by chance no change is sure."""
    return odds - COST.value * changes - as_driven >= WORTH.value


def is_worth(fix: Fix, as_driven: float) -> bool:
    """Whether a fix adds enough to the odds as driven."""
    return adds_enough(fix.p_fixed, as_driven, len(fix.changes))


def falls_short(fix: Fix, broken: Sequence[ObjectiveResult], as_driven: float) -> str | None:
    """Why a fix is not advised that adds too little, with what it reaches, else None."""
    if is_worth(fix, as_driven):
        return None
    reached = "; ".join(filter(None, (_reached(fix, result) for result in broken)))
    limit = f"; with it {reached}" if reached else ""
    best = f"the best found, {_changes(fix)}, has {percent(fix.p_fixed)}, as driven {percent(as_driven)}"
    return f"no change adds enough to the odds of meeting every limit: {best}{limit}"


def by_chance(fix: Fix, now: float, odds: float) -> str | None:
    """What an operator has to know of a change where the reference configuration misses limits too, else None.

    Args:
        now: probability that the next run meets every limit as driven.
        odds: probability that a run with the reference settings does, before anything of this run is known.
    """
    if odds >= CHANCY.value:
        return None
    runs = MOST_RUNS + 1 if fix.p_fixed <= now else math.ceil(math.log(TOLD_APART) / math.log(fix.p_fixed / now))
    times = "once" if runs == 1 else f"{runs} times"
    to_know = f"run it {times} to know" if runs <= MOST_RUNS else "no few runs tell whether it helped"
    return (
        f"such missions fail by chance too, {_in_five(odds)} with the reference settings: this configuration fails "
        f"{_in_five(now)}, with the change {_in_five(fix.p_fixed)}; {to_know}"
    )


def _in_five(odds: float) -> str:
    """Failures in a few missions, in words that nobody takes for more than they are."""
    lost = 1.0 - odds
    few = min(range(2, 11), key=lambda n: abs(round(lost * n) / n - lost) + 0.005 * n)
    count = round(lost * few)
    return "nearly always" if count == few else "hardly ever" if count == 0 else f"{count} in {few}"


def _reached(fix: Fix, result: ObjectiveResult) -> str:
    """What the best change brings of an objective whose limit it does not reach."""
    name, unit, predicted = result.variable.name, result.variable.unit, fix.predicted.get(result.variable.name)
    if predicted is None or result.threshold is None or result.variable.kind == "functional":
        return ""
    if result.threshold.met(predicted.value):
        return ""
    likely = predicted.high if result.threshold.op in ("<=", "<") else predicted.low
    value, limit = (f"{number:.4g} {unit}".rstrip() for number in (likely, result.threshold.value))
    return f"{name} is 90% sure to reach {value}, the limit of {limit} is out of reach"
