"""How to find out more, where no cause is sure: metrics that were not recorded, and the experiment that separates."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations

import numpy as np

from care_core.causal.counterfactual import CounterfactualQuery
from care_core.diagnose.fixes import candidate_values
from care_core.diagnose.next_step import AGAIN
from care_core.diagnose.ranking import Suspect
from care_core.diagnose.records import Experiment, Fault
from care_core.numbers import Floats
from care_core.records import Record, replace
from care_core.run import Run, Unavailable
from care_core.text import percent

TELLING = 0.15
"""Probability by which an experiment's outcome must differ between two causes to be worth a run."""
HYPOTHESES = 3
"""Leading causes that are compared in pairs."""
MOST_METRICS = 3
SAME_AGAIN = (
    "run the same configuration again: if it fails again, the cause persists (a parameter outside the profile, or the "
    "vehicle); if not, it is something in the environment (wind, obstacle, load)"
)
TELL = "triage the log again with '--config FILE', the file that sets the robot's parameters, and record them next time"
MET = "something in the environment"
"""The rival of a cause that stands alone."""


class AllBack(Record):
    """Every option that is off its reference put back at once: what is left where no few changes promise enough."""

    options: int
    odds: float

    def told(self, again: str) -> str:
        return (
            f"put all {self.options} parameters back that are off their reference and {again}: {percent(self.odds)} "
            "probability that all objectives are met; if they are, change half of them at a time again"
        )


def tell_more(
    query: CounterfactualQuery,
    faults: Sequence[Fault],
    run: Run,
    unranked: Mapping[str, Sequence[Suspect]],
    *,
    observational: bool = False,
    again: str = AGAIN,
    nothing_else: str = SAME_AGAIN,
    all_back: AllBack | None = None,
) -> tuple[str, ...]:
    """Sentences for an operator, the most useful first; empty where nothing would help.

    Args:
        unranked: per objective the options whose effect the training runs cannot tell, the likeliest first.
        observational: operators chose the options of the training runs.
        again: how a change is tried.
        nothing_else: what is left to be done where nothing of this would help.
        all_back: everything at its reference, where that promises more than what is advised.
    """
    advice = [*([] if all_back is None else [all_back.told(again)]), *to_record(faults, run)]
    for fault in faults:
        objective = fault.objective.variable.name
        advice += [
            f"{_change_back(query, name)} and {again}: the training runs cannot tell what it does to {objective}"
            for name in [suspect.option for suspect in unranked[objective]][:HYPOTHESES]
            if name not in query.kept
        ]
        advice += [
            f"{_change_back(query, name)} and {again}: a change that nobody chose for a reason would settle whether "
            f"{name} causes it"
            for name in (_first(fault) if observational else ())
            if name not in query.kept
        ]
        found = experiment(query, fault)
        if found is not None:
            advice.append(str(found).replace(AGAIN, again))
    if not advice:
        advice.append(nothing_else)
    return tuple(dict.fromkeys(advice))


def to_record(faults: Sequence[Fault], run: Run) -> tuple[str, ...]:
    """The sentences that call for no other run: where a part is mended first, nothing runs again before."""
    return tuple(dict.fromkeys([*([] if run.config else [TELL]), *_unrecorded(faults, run)]))


def _change_back(query: CounterfactualQuery, name: str) -> str:
    return f"change only {name} to {query.variables[name].show(query.reference[name])}"


def _first(fault: Fault) -> list[str]:
    """The option that is named first, if any."""
    return [cause.option.name for cause in fault.causes if not cause.is_lead][:1]


def _unrecorded(faults: Sequence[Fault], run: Run) -> Iterator[str]:
    """Metrics on the path of some leading causes and not of others that this log could not give."""
    for fault in faults:
        paths = [{node.name for node in cause.path} for cause in fault.causes[:HYPOTHESES]]
        if len(paths) < 2:
            continue
        separating = [name for name in run.metrics if 0 < sum(name in path for path in paths) < len(paths)]
        unknown = [(name, value) for name in separating if isinstance(value := run.metrics[name], Unavailable)]
        # Without a hint nobody could have recorded it: the flight did not come so far.
        for name, value in [(name, value) for name, value in unknown if value.hint][:MOST_METRICS]:
            told = f"{name} would tell the causes of {fault.objective.variable.name} apart"
            yield f"{told}: {value.reason} ({value.hint})"


def experiment(query: CounterfactualQuery, fault: Fault) -> Experiment | None:
    """The single change whose outcome differs most between the leading causes, None where none differs enough.

    The first pair of causes that any change separates is taken; a cause that stands alone is set against what the run
    met.
    """
    leading = [cause.option.name for cause in fault.causes if not cause.is_lead][:HYPOTHESES]
    pairs = list(combinations(leading, 2)) or [(name, MET) for name in leading]
    found = (_separating(query, fault.objective.variable.name, pair) for pair in pairs)
    return next((one for one in found if one is not None), None)


def _separating(query: CounterfactualQuery, objective: str, pair: tuple[str, str]) -> Experiment | None:
    changes = [
        (name, value)
        for name in pair
        if name in query.variables and name not in query.kept
        for value in candidate_values(query, name)
    ]
    if not changes or objective not in query.model.outcomes:
        return None
    promised = [_probability_if(query, objective, cause, pair, changes) for cause in pair]
    best = int(np.argmax(np.abs(promised[0] - promised[1])))
    if abs(promised[0][best] - promised[1][best]) < TELLING:
        return None
    name, value = changes[best]
    return Experiment(
        objective, query.variables[name], value, ((pair[0], promised[0][best]), (pair[1], promised[1][best]))
    )


def _probability_if(
    query: CounterfactualQuery, objective: str, cause: str, pair: tuple[str, str], changes: Sequence[tuple[str, float]]
) -> Floats:
    """Probability of a good outcome after each change, shape (m,), if one of the pair is the cause, the other not.

    The other did nothing, so it is taken to have been at its reference all along, and changing it changes nothing. The
    run's noise is abducted anew: what the other cost in the model is put down to the cause and to what the run met.
    """
    inert = {name: query.reference[name] for name in pair if name != cause and name in query.reference}
    there = replace(query, config={**query.config, **inert})
    configs = [{**there.config, **({name: value} if name == cause else {})} for name, value in changes]
    return there.p_ok(objective, configs)
