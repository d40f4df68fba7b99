"""Fault and model -> causes of this run: the options whose values moved the objective the wrong way."""

from __future__ import annotations

import math
from collections.abc import Collection, Container, Mapping, Sequence

import numpy as np

from care_core.causal.counterfactual import Config, CounterfactualQuery
from care_core.causal.graph import Edge
from care_core.causal.mechanisms import columns
from care_core.causal.model import EffectRecord, Model
from care_core.causal.paths import CausalPath, Ways
from care_core.diagnose.records import PathNode
from care_core.diagnose.symptoms import NOTHING, ROUNDING, better_than_expected, pointers
from care_core.records import Record
from care_core.run import Evidence, Run, is_known
from care_core.variables import Role

FELT = 0.05
"""Effect times support, in standard deviations, from which an edge is taken to carry something of this run."""
ROUNDED = 1e-3
"""Share of a value that no vehicle feels: tools write four digits."""
HARDLY = 0.01
"""Share of its acceptable range by which an option may be off its reference and be as good as at it."""


class Suspect(Record):
    """An option off its reference on a directed path to a faulty objective, with what it costs this run."""

    option: str
    contribution: float
    path: CausalPath
    effect: EffectRecord | None
    """None when no effect was found in training."""
    weight: float = 0.0
    """What suspects are ranked by: the contribution, and of the probability that no contribution explains the share
    that this run's own symptoms lay to the option."""
    symptom: str | None = None
    """The metric of this run that points at the option most."""
    not_borne_out: tuple[str, ...] = ()
    """Metrics on the path that were better in this run than the reference would give."""
    by_physics: bool = False
    """Whether what physics says of the objective reads the option, where training found no path by way of a metric."""

    @property
    def is_identified(self) -> bool:
        """Whether the training runs can tell what the option does: if not, what it costs may be another's doing."""
        return self.by_physics or self.effect is None or self.effect.identified

    @property
    def total_effect(self) -> float:
        return 0.0 if self.effect is None else self.effect.effect


def deviating(config: Config, reference: Config) -> tuple[str, ...]:
    """Options whose value in this run is not the reference's, but for what rounding leaves."""
    shared = ((name, config[name], value) for name, value in reference.items() if name in config)
    return tuple(n for n, own, value in shared if not math.isclose(own, value, rel_tol=ROUNDED, abs_tol=1e-12))


def suspects(
    query: CounterfactualQuery, objective: str, known: Container[Edge] = (), said: Sequence[Evidence] = ()
) -> tuple[Suspect, ...]:
    """Options off their reference that have a causal path to the objective, the likeliest cause first.

    The contribution is how much the probability of keeping the threshold rises when the option goes back to its
    reference: the mean of what it brings as the first that goes back and as the last, so an interaction counts for
    those who take part in it. What the contributions leave unexplained, much where training runs were few, is laid to
    the options that this run's symptoms point at. Of options with the same share, the one goes first whose reset alone
    meets every objective.

    Options whose effect is not identified are among them, to be told and not to be ranked (`is_identified`): theirs is
    an association.

    Args:
        known: direct effects that people know of, learned or not.
        said: what this run's messages say.
    """
    off = deviating(query.config, query.reference)
    better = better_than_expected(query, objective)
    paths = best_paths(query.model, objective, off, _mediators(query) - better)
    physics = {name: CausalPath((name, objective), 0.0) for name in _in_physics(query.model, objective, off)}
    by_physics = {name for name in physics if len(paths.get(name, physics[name]).nodes) == 2}
    paths = physics | paths
    effects = {name: query.model.effects.get((name, objective)) for name in paths}
    names = list(paths)
    can_say = [name for name in names if effects[name] is not None or name in by_physics]
    learned = can_say if objective in query.model.outcomes else []
    contribution = {**dict.fromkeys(names, 0.0), **_contributions(query, objective, learned)}
    unexplained = max(0.0, 1.0 - sum(max(0.0, share) for share in contribution.values()))
    pointer = pointers(query, objective, _acting_where_it_failed(query, objective, names, said), known, said)
    found = [
        Suspect(
            option=name,
            contribution=contribution[name],
            path=paths[name],
            effect=effects[name],
            weight=contribution[name] + unexplained * pointer.get(name, NOTHING).share,
            symptom=pointer.get(name, NOTHING).metric,
            not_borne_out=tuple(node for node in paths[name].nodes if node in better),
            by_physics=name in by_physics,
        )
        for name in names
    ]
    alone = query.probability([back_at_reference(query, frozenset((name,))) for name in names]) if names else ()
    repairs = dict(zip(names, map(float, alone), strict=True))
    return tuple(
        sorted(found, key=lambda s: (-round(s.weight, 2), -round(repairs[s.option], 2), -s.total_effect, s.option))
    )


def _in_physics(model: Model, objective: str, options: Sequence[str]) -> list[str]:
    """The options that what physics says of the objective reads: they act on it whatever a search found."""
    outcome = model.outcomes.get(objective)
    nominal = model.mechanisms[outcome.mechanism].nominal if outcome is not None and not outcome.stages else None
    return [] if nominal is None else [name for name in options if name in nominal.inputs]


def _acting_where_it_failed(
    query: CounterfactualQuery, objective: str, names: Sequence[str], said: Sequence[Evidence]
) -> list[str]:
    """The options that the graph lets act on the stage at which the run failed, and those that a message names; all
    where it tells of none.

    One that is hardly off its reference shows in no symptom.
    """
    outcome = query.model.outcomes.get(objective)
    names = [n for n in names if query.variables[n].distance(query.config[n], query.reference[n]) > HARDLY]
    for stage in outcome.stages if outcome is not None else ():
        seen = query.known(stage.variable)
        if stage.variable != objective and seen is not None and seen != stage.passes:
            acting = query.model.graph.ancestors(stage.variable).union(*(message.options for message in said))
            return [name for name in names if name in acting] or names
    return names


def not_ruled_out(query: CounterfactualQuery, objective: str, found: Sequence[Suspect]) -> tuple[Suspect, ...]:
    """Other options off their reference, the farthest first: a few hundred runs do not show every effect.

    They have no path in the graph, and get a direct one of no effect.
    """
    named = {suspect.option for suspect in found}
    others = [
        name
        for name in deviating(query.config, query.reference)
        if name not in named and (name, objective) not in query.model.effects
    ]
    others.sort(key=lambda name: -query.variables[name].distance(query.config[name], query.reference[name]))
    return tuple(Suspect(name, 0.0, CausalPath((name, objective), 0.0), None) for name in others)


def best_paths(
    model: Model, objective: str, options: Sequence[str], mediators: Collection[str] | None = None
) -> dict[str, CausalPath]:
    """Per option the directed path to the objective with the largest mean of effect times support.

    The path ACE that is reported is Eq. 2 of that path; an edge seen in few resamples only counts less in the choice,
    since metrics that repeat each other offer many paths. Where there is another way, none leads over what did not
    carry this fault, nor over an edge that hardly carries anything: in a mean, a strong last edge hides it.

    Args:
        mediators: metrics that may have carried this run's fault; all when None.
    """
    whole = {edge: record.effect * record.support for edge, record in model.edges.items()}
    felt = {edge: value for edge, value in whole.items() if value >= FELT}

    def met(weight: Mapping[Edge, float]) -> dict[Edge, float]:
        return {e: v for e, v in weight.items() if mediators is None or e[1] in mediators or e[1] == objective}

    ways = [Ways(model.graph, weight) for weight in (met(felt), met(whole), felt, whole)]
    found: dict[str, CausalPath] = {}
    for option in options:
        paths = next(filter(None, (way.ranked(objective, [option], top=1) for way in ways)), None)
        if paths:
            effects = [model.edges[edge].effect for edge in paths[0].edges]
            found[option] = CausalPath(paths[0].nodes, sum(effects) / len(effects))
    return found


def _mediators(query: CounterfactualQuery) -> frozenset[str]:
    """Metrics and objectives that may have carried this run's fault: known, and no event that stayed away as usual."""
    found = set()
    for variable in query.variables.values():
        if variable.role not in (Role.METRIC, Role.OBJECTIVE):
            continue
        value, summary = query.observed.get(variable.name), query.model.summaries.get(variable.name)
        is_usual = variable.type == "bool" and summary is not None and value == round(summary.quantile(0.5))
        if isinstance(value, (int, float)) and not is_usual:
            found.add(variable.name)
    return frozenset(found)


def back_at_reference(query: CounterfactualQuery, names: frozenset[str]) -> dict[str, float]:
    """This run's configuration with these options at their reference."""
    return {**query.config, **{name: query.reference[name] for name in names}}


def _contributions(query: CounterfactualQuery, objective: str, names: Sequence[str]) -> dict[str, float]:
    """Of each option: the mean of what it brings as the first that goes back and as the last."""
    if not names:
        return {}
    every = frozenset(names)
    sets = [frozenset(), every, *(frozenset((name,)) for name in names), *(every - {name} for name in names)]
    driven, back, *each = query.p_ok(objective, [back_at_reference(query, one) for one in sets])
    first, last = np.array(each[: len(names)]) - driven, back - np.array(each[len(names) :])
    mean = (first + last) / 2
    return dict(zip(names, map(float, np.where(np.abs(mean) > ROUNDING, mean, 0.0)), strict=True))


def describe_path(
    path: CausalPath, query: CounterfactualQuery, run: Run, *, by_physics: bool = False
) -> tuple[PathNode, ...]:
    """The path as this run met it: at each node its value, and what the reference configuration would give."""
    nodes = []
    for i, name in enumerate(path.nodes):
        value = run.value(name)
        edge = query.model.edges.get(path.edges[i]) if i < len(path.edges) else None
        nodes.append(
            PathNode(
                name=name,
                unit=query.variables[name].unit,
                value=value if is_known(value) else None,
                expected=_expected(name, query),
                effect=None if edge is None else edge.signed_effect,
                support=None if by_physics or i == len(path.edges) else 0.0 if edge is None else edge.support,
            )
        )
    return tuple(nodes)


def _expected(name: str, query: CounterfactualQuery) -> float | None:
    reference = query.reference
    if name in reference:
        return reference[name]
    if name in query.model.outcomes:
        return float(query.predict(name, [reference]).value[0])
    mechanism = query.model.mechanisms.get(name)
    return None if mechanism is None else float(mechanism.expected(columns([reference], mechanism.inputs))[0])
