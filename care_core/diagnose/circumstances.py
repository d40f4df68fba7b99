"""'Not a parameter' is an answer too: what this run met (wind, battery, positioning) that training hardly ever did.

A context is judged by where training saw it. A metric is judged by what the run's own configuration explains: the
residual of its mechanism against the residuals of the training runs. No threshold is written by hand.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from care_core.causal.counterfactual import CounterfactualQuery
from care_core.causal.mechanisms import columns
from care_core.causal.model import Model, Summary
from care_core.diagnose.records import Circumstance
from care_core.profile.schema import Schema, Side
from care_core.profile.store import Profile
from care_core.run import Run, is_known
from care_core.text import figures, first_of
from care_core.variables import Role, Variable

BEYOND = 0.1
"""Share of the range that training saw by which a context may leave it before the profile fits only in part."""
NEAR = 0.02
"""Share of its value by which a context that hardly varied in training may differ."""
NO_MISSION = "no mission was flown"
RARE = 0.025
"""Share of the training runs that lie farther out than what is called unusual."""


def circumstances(run: Run, query: CounterfactualQuery, schema: Schema) -> tuple[Circumstance, ...]:
    """What this run met and no option set, the rarest first."""
    found = [*_shown(run, query, schema), *_of_messages(run), *_unsupported(run, query, schema)]
    named: dict[tuple[str, str], Circumstance] = {}
    for one in sorted(found, key=lambda one: one.share):
        named.setdefault((one.name, one.variable), one)
    return tuple(named.values())


def unusual(run: Run, profile: Profile) -> tuple[str, ...]:
    """What of this mission the profile does not know: another mission, conditions beyond its training."""
    found = [run.mission.mismatch] if run.mission.mismatch and not profile.schema.travels else []
    constant: list[str] = []
    for variable in profile.schema.contexts:
        value, summary = run.context.get(variable.name), profile.model.summaries.get(variable.name)
        is_asked = run.checks and variable.about == "mission"  # of a flight that followed no mission
        if summary is None or not is_known(value) or is_asked:
            continue
        low, high = _range_seen(variable, summary)
        margin = max(BEYOND * (high - low), NEAR * abs(high))
        if not low - margin <= value <= high + margin and figures(low) == figures(high):
            constant.append(f"{variable.doc or variable.name} ({figures(low)} {variable.unit}".rstrip() + ")")
        elif not low - margin <= value <= high + margin:
            what = f"{variable.doc or variable.name} of {figures(value)} {variable.unit}".rstrip()
            found.append(f"{what} is outside the training runs ({_seen(low, high)})")
    # A mission that was not flown, and what training could not learn anything of, say more of the odds than of the run.
    if constant:
        found.append(f"it was learned {_where_learned(profile)} that never varied {first_of(constant, 2)}")
    return (NO_MISSION, *found) if found and run.checks else tuple(found)


def _where_learned(profile: Profile) -> str:
    return "in a simulator" if "simulated" in profile.schema.doc else "from runs"


def battery_is_low(run: Run, model: Model, schema: Schema) -> bool | None:
    """Whether the battery held less before the start than in any training run, None where nothing tells."""
    found = None
    for name, side in schema.circumstances.get("battery", {}).items():
        value, summary = run.context.get(name), model.summaries.get(name)
        if side == "low" and summary is not None and is_known(value):
            found = bool(found) or value < summary.low * (1 - NEAR)
    return found


def _seen(low: float, high: float) -> str:
    least, most = figures(low), figures(high)
    return f"always {least}" if least == most else f"{least} to {most}"


def _shown(run: Run, query: CounterfactualQuery, schema: Schema) -> Iterator[Circumstance]:
    for name, sides in schema.circumstances.items():
        for variable, side in ((schema.variables[key], side) for key, side in sides.items()):
            value = run.value(variable.name)
            if not is_known(value):
                continue
            judge = _context if variable.role is Role.CONTEXT else _metric
            found = judge(name, variable, side, value, query)
            if found is not None:
                yield found


def _context(
    name: str, variable: Variable, side: Side, value: float, query: CounterfactualQuery
) -> Circumstance | None:
    summary = query.model.summaries.get(variable.name)
    if summary is None or _same(value, summary.high if side == "high" else summary.low):
        return None
    above = 1.0 - summary.percentile(value)
    share = above if side == "high" else 1.0 - above
    if share >= RARE:
        return None
    low, high = _span(summary)
    unit = f" {variable.unit}".rstrip()
    rarity = "no training run" if share == 0 else f"{share:.0%} of the training runs"
    text = f"{variable.doc or variable.name}: {figures(value)}{unit}; {rarity} had more"
    if side == "low":
        text = f"{text.removesuffix('more')}less"
    return Circumstance(name, variable.name, value, variable.unit, low, high, share, text)


def _metric(name: str, variable: Variable, side: Side, value: float, query: CounterfactualQuery) -> Circumstance | None:
    mechanism, summary = query.model.mechanisms.get(variable.name), query.model.summaries.get(variable.name)
    if mechanism is None or mechanism.binary or summary is None:
        return None
    below, expected = mechanism.residual_share(columns([query.config], mechanism.inputs), value)
    share = 1.0 - below if side == "high" else below
    if share >= RARE:
        return None
    low, high = _span(summary)
    unit = f" {variable.unit}".rstrip()
    explained = f"{figures(expected)}{unit}"
    text = f"{variable.doc or variable.name}: {figures(value)}{unit} where this configuration explains {explained}"
    return Circumstance(name, variable.name, value, variable.unit, low, high, share, text)


def _of_messages(run: Run) -> Iterator[Circumstance]:
    """What a message of the log speaks of, unless it points at an option whose value sets it off."""
    for evidence in run.evidence:
        if evidence.circumstance is not None and not evidence.options:
            yield Circumstance(evidence.circumstance, "", None, "", None, None, 0.0, f"the log says: {evidence.text}")


def _unsupported(run: Run, query: CounterfactualQuery, schema: Schema) -> Iterator[Circumstance]:
    """Contexts outside everything that training saw, on either side."""
    for variable in schema.contexts:
        value, summary = run.context.get(variable.name), query.model.summaries.get(variable.name)
        if summary is None or not is_known(value):
            continue
        least, most = _range_seen(variable, summary)
        if least <= value <= most or _same(value, least) or _same(value, most):
            continue
        low, high = _span(summary)
        text = f"{variable.doc or variable.name}: {figures(value)} {variable.unit}".rstrip()
        text += f" is outside the training runs ({_seen(least, most)})"
        yield Circumstance("outside support", variable.name, value, variable.unit, low, high, 0.0, text)


def _range_seen(variable: Variable, summary: Summary) -> tuple[float, float]:
    """What training saw of a context: its runs, and what the profile says of their parts."""
    low, high = variable.range or (summary.low, summary.high)
    return min(low, summary.low), max(high, summary.high)


def _span(summary: Summary) -> tuple[float, float]:
    """Where 95% of the training runs lie."""
    return summary.quantile(RARE), summary.quantile(1 - RARE)


def _same(a: float, b: float) -> bool:
    """Equal as far as a recorder resolves it."""
    return math.isclose(a, b, rel_tol=1e-3)
