"""Causes -> the smallest set of option changes that is likely to meet every threshold, and its alternatives."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from itertools import islice, product

import numpy as np

from care_core.causal.counterfactual import Config, CounterfactualQuery
from care_core.diagnose.records import Fix, Prediction
from care_core.numbers import Bools, Floats
from care_core.records import replace
from care_core.variables import Change, Role, Variable

MAX_CHANGES = 4
STEPS = 5
"""Values tried between the run's value and the reference, the reference included."""
BEAM = 8
"""Sets kept at each size."""
GAIN_FOR_ONE_MORE = 0.1
"""Probability that one more change, the first included, must add: each is something an operator has to do and to
believe."""
NEEDED = 0.8
"""Share of its odds that a set keeps without one of its changes, up to which that is among them. Of 73 failures of
copters, rovers, move_base and PX4 what is advised holds a set that repaired the run in 60, and one change more than
that in 15 (at 0.5: 58 and 7); planted robots meet everything after 0.92 of the changes (0.89)."""
DISTANCE_COST = 0.02
"""Probability given up for leaving a value where it is rather than moving it across its whole range."""
NEARLY = 0.02
"""Probabilities this close are the same: the surer set is taken, or the value nearer to the run's."""
GIVEN_UP = 0.1
"""Share of what a change gains that a nearer value may give up."""
MAX_ALTERNATIVES = 3

Assignment = Mapping[str, float]


def candidate_values(query: CounterfactualQuery, name: str) -> tuple[float, ...]:
    """Acceptable values inside the training support, from the reference towards the run's value: those between are of
    two digits, which is what somebody would set.

    An option marked `safety` is only moved towards its default, never past it, so no value here is looser; codes have
    no order, so of a safety option's codes only the default is left.
    """
    variable, current, reference = query.variables[name], query.config[name], query.reference[name]
    if variable.labels:
        codes = () if variable.safety else (code for code, _ in variable.labels)
        steps: Iterable[float] = (reference, *codes)
    elif variable.type == "bool":
        steps = (0.0, 1.0)
    elif variable.is_log_scaled and current > 0 and reference > 0:
        steps = _between(reference, current, np.geomspace(reference, current, STEPS + 1))
    else:
        steps = _between(reference, current, np.linspace(reference, current, STEPS + 1))
    snapped = dict.fromkeys(variable.snap(float(step)) for step in steps)
    return tuple(v for v in snapped if v != current and variable.accepts(v) and query.model.supports(name, v))


def _between(reference: float, current: float, steps: Floats) -> list[float]:
    """The reference, and the steps from it towards the run's value, rounded but neither past the one nor the other."""
    low, high = sorted((reference, current))
    return [reference, *(min(max(float(f"{step:.2g}"), low), high) for step in steps[1:-1])]


def search(query: CounterfactualQuery, candidates: Collection[str]) -> list[tuple[Assignment, float]]:
    """Best sets of changes by size (index 0: one change), each with the probability that all thresholds are met.

    Beam search: every option alone back to its reference (yes-or-no options and codes to any other value), then the
    best sets widened by one option at a time. `settled` then looks for values nearer to the run's.
    """
    values = {name: found for name in _with_partners(query, candidates) if (found := _starts(query, name))}
    singles = [{name: value} for name, found in values.items() for value in found]
    ranked = _ranked(query, singles)
    found_sets = []
    # What breaks a constraint alone may keep it with another change beside it: it is widened, and not suggested.
    while beam := list(islice((one for one in ranked if query.allows({**query.config, **one[0]})), BEAM)):
        found_sets.append(_surest(query, beam))
        if len(found_sets) == MAX_CHANGES:
            break
        ranked = _ranked(query, _widened((a for a, _ in ranked[:BEAM]), values))
    return found_sets


def _with_partners(query: CounterfactualQuery, candidates: Collection[str]) -> list[str]:
    """The options, and those that a constraint binds to one of them: it may only be changed together with them."""
    bound = (one.options for one in query.constraints if not one.options.isdisjoint(candidates))
    partners = sorted({name for options in bound for name in options} - set(candidates) - query.kept)
    return [*candidates, *partners]


def _starts(query: CounterfactualQuery, name: str) -> tuple[float, ...]:
    """The reference; where that alone breaks a constraint, the value next to it that does not as well."""
    values = candidate_values(query, name)
    if _is_unordered(query.variables[name]):
        return values
    allowed = (value for value in values if query.allows({**query.config, name: value}))
    return tuple(dict.fromkeys((*values[:1], *islice(allowed, 1))))


def _is_unordered(option: Variable) -> bool:
    return bool(option.labels) or option.type == "bool"


def settled(query: CounterfactualQuery, assignment: Assignment) -> tuple[Assignment, float]:
    """The same options with values as near to the run's as is safe, and the probability of that.

    The reference is known to work, a value on the way to it only as far as training shows. So a nearer one is taken
    where the value one step nearer still would do nearly as well, both for this run and, before anything of it was
    known, with each mechanism as bad between the two as it may be: the edge of what works, and of what was flown in
    training, is not known to a step.
    """
    chosen = dict(assignment)
    before = query.unobserved()
    wary = replace(before, wary_from={**query.config, **chosen})
    floor = _floor(query, chosen)
    for name in assignment:
        if _is_unordered(query.variables[name]):
            continue
        configs = [{**query.config, **chosen, name: value} for value in candidate_values(query, name)]
        configs = [config for config in configs if query.allows(config)]
        if not configs:
            continue
        does = query.probability(configs) >= floor
        edge = _edge(does)
        if edge:  # most often this run itself leaves nothing but the reference
            edge = _edge(does & (wary.probability(configs) >= _floor(before, assignment)))
        chosen[name] = configs[edge][name]
    return chosen, float(query.probability([{**query.config, **chosen}])[0])


def _edge(does: Bools) -> int:
    """Place of the last value but one, from the reference on, up to which all do; 0 where there are fewer."""
    return max(0, int(np.argmin(np.append(does, False))) - 2)


def _floor(query: CounterfactualQuery, assignment: Assignment) -> float:
    """What a nearer value may come down to; where the change gains next to nothing, the model cannot tell its values
    apart, and there is none."""
    here, reset = map(float, query.probability([query.config, {**query.config, **assignment}]))
    return np.inf if reset - here < NEARLY else reset - min(NEARLY, GIVEN_UP * (reset - here))


def best_alone(query: CounterfactualQuery, name: str) -> tuple[float, float] | None:
    """The value of one option to suggest when nothing else changes, and its probability."""
    allowed = (value for value in _starts(query, name) if query.allows({**query.config, name: value}))
    ranked = _ranked(query, [{name: value} for value in allowed])
    if not ranked:
        return None
    assignment, probability = settled(query, ranked[0][0])
    return assignment[name], probability


def needs_unsafe(query: CounterfactualQuery, enough: float) -> str | None:
    """A `safety` option that would fix the run only if it were moved past its default, which is never suggested."""
    for name, option in sorted(query.variables.items()):
        if option.role is not Role.OPTION or name in query.kept or not option.safety or option.range is None:
            continue
        values = {option.snap(float(value)) for value in np.linspace(*option.range, STEPS + 1)}
        default = query.reference[name]
        past = [v for v in values if v != default and (v - default) * (query.config[name] - default) <= 0]
        if past and query.probability([{**query.config, name: value} for value in past]).max() >= enough:
            return name
    return None


def _widened(sets: Iterable[Assignment], values: Mapping[str, tuple[float, ...]]) -> list[Assignment]:
    wider: dict[tuple[tuple[str, float], ...], Assignment] = {}
    for assignment, name in product(sets, values):
        for value in () if name in assignment else values[name]:
            new = {**assignment, name: value}
            wider[tuple(sorted(new.items()))] = new
    return list(wider.values())


def _surest(query: CounterfactualQuery, beam: Sequence[tuple[Assignment, float]]) -> tuple[Assignment, float]:
    """The first of the sets, or the one among its equals in probability and fewer in doubt about the mechanisms."""
    equals = [pair for pair in beam if pair[1] >= beam[0][1] - NEARLY]
    if len(equals) == 1:
        return equals[0]
    doubt = query.epistemic_ratio([{**query.config, **assignment} for assignment, _ in equals])
    return equals[int(np.argmin(np.round(doubt, 2)))]


def _ranked(query: CounterfactualQuery, sets: Sequence[Assignment]) -> list[tuple[Assignment, float]]:
    if not sets:
        return []
    reached = query.probability([{**query.config, **assignment} for assignment in sets])
    moved = [
        sum(query.variables[name].distance(query.config[name], value) for name, value in assignment.items())
        for assignment in sets
    ]
    order = np.argsort(-(reached - DISTANCE_COST * np.array(moved)), kind="stable")
    return [(sets[i], float(reached[i])) for i in order]


def smallest_good(found: list[tuple[Assignment, float]]) -> int:
    """Index of the set to suggest: one more change only where it adds enough."""
    chosen = 0
    for i in range(1, len(found)):
        if is_needed(found[chosen][1], found[i][1], more=i - chosen):
            chosen = i
    return chosen


def is_needed(without: float, together: float, more: int = 1) -> bool:
    """Whether so many more changes are, by the odds that all limits are met with the others alone and with all."""
    return together >= without + GAIN_FOR_ONE_MORE * more and without <= together * NEEDED


def to_fix(query: CounterfactualQuery, assignment: Assignment, probability: float) -> Fix:
    """The set as a record, with every objective's predicted outcome; changes in the order of what each does alone."""
    alone = {name: query.probability([{**query.config, name: value}])[0] for name, value in assignment.items()}
    options = query.variables
    order = sorted(assignment, key=lambda name: (-alone[name], name))
    config = {**query.config, **assignment}
    return Fix(
        changes=tuple(
            Change(
                options[name],
                query.config[name],
                assignment[name],
                change_notes(options[name], assignment[name]),
                is_assumed=name in query.assumed,
            )
            for name in order
        ),
        p_fixed=probability,
        predicted={name: as_likely(prediction(query, name, config), probability) for name in query.model.outcomes},
    )


def prediction(query: CounterfactualQuery, objective: str, config: Config) -> Prediction:
    """The objective's predicted outcome under one configuration."""
    p = query.predict(objective, [config])
    p_ok = float(p.p_ok[0])
    return Prediction(float(p.value[0]), float(p.low[0]), float(p.high[0]), None if np.isnan(p_ok) else p_ok)


def as_likely(predicted: Prediction, together: float) -> Prediction:
    """What is predicted of one objective, which is no less likely to be met than all of them: of these the causes of
    the failure and the runs that were left out of training tell more than one mechanism."""
    return predicted if predicted.p_ok is None else replace(predicted, p_ok=max(predicted.p_ok, together))


def change_notes(option: Variable, to: float | None = None) -> tuple[str, ...]:
    """What an operator has to know before changing this option. `to`: the new value, whose meaning may be special."""
    notes = [] if to is None or not option.told_of(to) else [option.told_of(to)]
    if option.reboot_required:
        notes.append("takes effect after a reboot")
    if len(option.parameters) > 1:
        notes.append(f"sets {len(option.parameters)} keys: {', '.join(option.parameters)}")
    return tuple(notes)
