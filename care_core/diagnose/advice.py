"""Which of the fixes that were found is advised, if any: right, or silent."""

from __future__ import annotations

import math
from collections.abc import Sequence

from care_core.diagnose.hypotheses import LATE_S, set_wrong
from care_core.diagnose.records import Fix, Hypothesis, ObjectiveResult
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.ranking import LIKELY
from care_core.records import replace

ENOUGH = 0.5
"""A change less likely than this to repair the run is no advice."""
CHANCY = 0.75
"""Odds of the reference configuration below which missions fail by chance as well: less is then enough, in proportion,
and one good run after a change proves little, nor one bad run much."""

ALIKE = 0.02
"""Shares of a limit that are no difference to an operator."""


def believed(fixes: Sequence[Fix], hypotheses: Sequence[Hypothesis]) -> tuple[Fix, ...]:
    """The fixes with the probability that something failed which no parameter repairs taken off their promise."""
    broken = sum(one.probability for one in hypotheses if one.what in ("hardware", "world") and one.name)
    return tuple(replace(fix, p_fixed=fix.p_fixed * (1.0 - broken)) for fix in fixes)


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
            f"{earliest.title} from {earliest.onset_s:.0f} s on, before {rival.name}: that speaks of how the robot is "
            "set, and training does not tell which parameter does it"
        )
    return f"{rival.name}, which explains this failure better than any parameter: look at it first"


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


def untried(fix: Fix, learned_elsewhere: str) -> str | None:
    """Why a fix is not advised that rests on other robots alone, with what it suspects, else None."""
    if not learned_elsewhere:
        return None
    suspected = ", ".join(change.option.name for change in fix.changes)
    return f"{learned_elsewhere}, so no change is advised; look at {suspected}, and carry it over with 'care update'"


def enough(odds: float) -> float:
    """Probability of meeting every limit from which on a change is advice.

    Args:
        odds: probability that the reference configuration meets every limit in such a mission. Where missions fail by
            chance no change is surer than that, and one that comes near it is what there is to be done.
    """
    return ENOUGH * min(1.0, odds / CHANCY)


def falls_short(fix: Fix, broken: Sequence[ObjectiveResult], odds: float) -> str | None:
    """Why a fix is not advised that is too unlikely to repair the run, with what it reaches, else None.

    Args:
        odds: as for `enough`.
    """
    if fix.p_fixed >= enough(odds):
        return None
    changes = ", ".join(map(str, fix.changes))
    reached = "; ".join(filter(None, (_reached(fix, result) for result in broken)))
    limit = f"; with it {reached}" if reached else ""
    return f"no change is likely enough to meet every limit: the best found, {changes}, has {fix.p_fixed:.0%}{limit}"


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
