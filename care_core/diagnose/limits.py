"""The limit of each objective that is judged by what the reference configuration needs for the mission of this run.

A need is known before the run: it comes from the mission, the vehicle and what the run met, never from what the run
took, which is what is judged. A limit that follows its own run passes whatever no parameter explains. Where mission or
vehicle are unlike all of the training, or not known, there is no limit, and the reason is said.
"""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping

import numpy as np

from care_core.causal.counterfactual import CounterfactualQuery
from care_core.causal.mechanisms import columns
from care_core.causal.model import Model
from care_core.diagnose.ranking import deviating
from care_core.diagnose.records import Need
from care_core.diagnose.reference import Reference
from care_core.profile.schema import Schema
from care_core.records import Record, replace
from care_core.run import Run, Unavailable, is_known
from care_core.text import figures
from care_core.variables import Threshold, Variable

UNLIKE = 4.0
"""A length that the mission asks for may be so many times larger or smaller than any that training saw: as far as that
what physics says of the rest is believed, where the profile fits only in part."""
_FIFTIETH = 2.054 / 1.282
"""Standard normal quantiles of one in fifty and one in ten: a need's interval is even in its logarithm."""
ANOTHER_VEHICLE = 1.5
"""The same of what physics reads of the vehicle."""


class Limits(Record):
    """Per objective that has a relative threshold: its bound and what it is a multiple of, or why there is none."""

    bounds: Mapping[str, Threshold]
    needs: Mapping[str, Need]
    unknown: Mapping[str, Unavailable]


def limits_of(run: Run, schema: Schema, model: Model, reference: Reference, fixed: Container[str]) -> Limits:
    """The limits of a run.

    Args:
        reference: the configuration to need, with the contexts that the run met.
        fixed: objectives that have a bound already.
    """
    bounds: dict[str, Threshold] = {}
    needs: dict[str, Need] = {}
    unknown: dict[str, Unavailable] = {}
    for objective in schema.objectives:
        name, relative = objective.name, objective.relative
        if relative is None or name in fixed:
            continue
        if why := next(_doubts(objective, run, schema, model), ""):
            unknown[name] = Unavailable(why, f"give this mission's bound with --threshold {name}=VALUE")
        elif need := need_of(name, reference, schema, model):
            needs[name] = replace(need, is_own=_was_driven_as(reference, run))
            bounds[name] = limit(relative, needs[name])
            if why := _excused(objective, run, bounds[name], reference, schema, model):
                unknown[name] = Unavailable(why, f"give this mission's bound with --threshold {name}=VALUE")
    return Limits(bounds, needs, unknown)


def _was_driven_as(reference: Reference, run: Run) -> bool:
    """Whether a run was driven as the reference, as far as is known of its options."""
    known = [name for name in reference.config if name in run.config]
    return bool(known) and not deviating({name: run.config[name] for name in known}, reference.config)


def limits_ahead(schema: Schema, model: Model, reference: Reference, fixed: Container[str]) -> dict[str, Threshold]:
    """The limits that a mission will have which was never begun, for the odds of it: by what its items and the vehicle
    tell, and the middle of the training runs where they tell nothing."""
    relative = {one.name: one.relative for one in schema.objectives if one.relative is not None}
    needs = {name: need_of(name, reference, schema, model) for name in relative if name not in fixed}
    return {name: limit(relative[name], need) for name, need in needs.items() if need is not None}


def need_of(name: str, reference: Reference, schema: Schema, model: Model) -> Need | None:
    """What the reference configuration takes of an objective for this mission; None where nothing tells."""
    if name not in model.outcomes:
        return None
    query = CounterfactualQuery(model, reference.config, {}, {}, variables=schema.variables)
    p = query.predict(name, [reference.config])
    value, low, high = (float(part[0]) for part in (p.value, p.low, p.high))
    return Need(value, low, high) if np.isfinite((value, low, high)).all() and value > 0 else None


def limit(relative: Threshold, need: Need) -> Threshold:
    """The bound of a multiple of a need. What one in ten runs of the reference configuration exceeds is no fault,
    unless the multiple is the operator's; of a run that was driven as the reference, what one in fifty exceeds: nothing
    of it is off that could have brought it there."""
    usual = relative.for_need(need.value)
    if relative.source is not None:
        return usual
    worst = need.high if usual.op in ("<=", "<") else need.low
    if need.is_own and need.low > 0:
        worst = need.value * (worst / need.value) ** _FIFTIETH
    return usual if usual.met(worst) else Threshold(usual.op, float(f"{worst:.4g}"))


def _excused(
    objective: Variable, run: Run, bound: Threshold, reference: Reference, schema: Schema, model: Model
) -> str:
    """Why an objective meets its bound only because of what the run met and hardly any of the training did: what is
    needed then was not learned, and it may be no more than a sensor that is off. Empty where it does not."""
    value, relative = run.objectives.get(objective.name), objective.relative
    met = {
        name: (own, usual)
        for sides in schema.circumstances.values()
        for name, side in sides.items()
        if (own := reference.config.get(name)) is not None and name in run.context
        and (summary := model.summaries.get(name)) is not None
        and own != (usual := min(own, summary.quantiles[-2]) if side == "high" else max(own, summary.quantiles[1]))
    }  # fmt: skip
    if not met or relative is None or not is_known(value) or not bound.met(value):
        return ""
    config = {**reference.config, **{name: usual for name, (_, usual) in met.items()}}
    need = need_of(objective.name, replace(reference, config=config), schema, model)
    if need is None or limit(relative, replace(need, is_own=_was_driven_as(reference, run))).met(value):
        return ""
    far = ", ".join(
        f"{name} {figures(own)} {schema.variables[name].unit}".rstrip()
        + f", {'at most' if own > usual else 'at least'} {figures(usual)} in 19 of 20 training runs"
        for name, (own, usual) in met.items()
    )
    return f"it meets its limit only by what the run met: {far}"


def _doubts(objective: Variable, run: Run, schema: Schema, model: Model) -> Iterator[str]:
    """Why what the reference configuration needs of an objective is not known, in one clause each."""
    for option in schema.options:
        if option.ceiling and option.name not in run.config:
            yield f"how fast this robot may go is not known: nothing gives {' or '.join(option.parameters)}"
    for context in _read_by(objective, schema):
        value = run.context.get(context.name)
        if not is_known(value):
            why = f": {value.reason}" if isinstance(value, Unavailable) else ""
            yield f"{context.doc or context.name} is not known{why}"
        elif context.about == "vehicle":
            yield from _of_another_vehicle(context, value, run, schema, model)
    if another := beyond_training(run, schema, model):
        yield f"no mission of the training is like this one: {another}"


def _read_by(objective: Variable, schema: Schema) -> Iterator[Variable]:
    """The contexts that physics reads for an objective."""
    nominal = schema.nominal_of(objective.name)
    named = () if nominal is None else nominal.inputs
    yield from (context for context in schema.contexts if context.name in named)


def _of_another_vehicle(context: Variable, value: float, run: Run, schema: Schema, model: Model) -> Iterator[str]:
    """How a vehicle is unlike those of the training. What it takes is measured in the very run that is judged, so it is
    its own only as far as such vehicles have taken it."""
    what, unit = context.doc or context.name, f" {context.unit}".rstrip()
    summary, typical, usual = model.summaries.get(context.name), context.typical, schema.typical_of(context.name)
    if summary is not None and not summary.low / ANOTHER_VEHICLE <= value <= summary.high * ANOTHER_VEHICLE:
        seen = f"{figures(summary.low)} to {figures(summary.high)}"
        yield f"no vehicle of the training is like this one: {what} {figures(value)}{unit}, {seen} there"
    if usual is None or typical is None:
        return
    shown = {name: run.value(name) for name in usual.inputs}
    known = {name: float(one) for name, one in shown.items() if is_known(one)}
    if lacking := next((name for name in usual.inputs if name not in known), None):
        yield f"{what} cannot be held against other vehicles': {schema.variables[lacking].doc or lacking} is not known"
    elif not typical.believes(value, expected := float(usual.of(columns([known], usual.inputs))[0])):
        yield f"{what} is {figures(value)}{unit}, where vehicles of the training took {figures(expected)}{unit}"


def beyond_training(run: Run, schema: Schema, model: Model) -> str:
    """In what this mission is so unlike all that were trained on that what the reference needs for it is not known;
    empty where it is like them."""
    for variable in schema.contexts:
        value, summary = run.context.get(variable.name), model.summaries.get(variable.name)
        if variable.about != "mission" or variable.unit != "m" or summary is None or not is_known(value) or value == 0:
            continue  # a mission that asks for none of it, no climb or no way back, is no other for that
        if not _times(summary.low, least=True) <= value <= _times(summary.high, least=False):
            seen = f"{figures(summary.low)} to {figures(summary.high)}"
            return f"{variable.doc or variable.name} {figures(value)} {variable.unit}".rstrip() + f", {seen} there"
    return ""


def _times(end: float, *, least: bool) -> float:
    """How far beyond an end of what training saw is still alike; depths lie below 0."""
    return (min if least else max)(end / UNLIKE, end * UNLIKE)
