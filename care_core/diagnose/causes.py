"""Suspects of a failed run -> the causes that are told of each objective, with what speaks for and against them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

from care_core.causal.model import EffectRecord
from care_core.diagnose.failed_run import FailedRun
from care_core.diagnose.fixes import best_alone, change_notes, prediction
from care_core.diagnose.noisy_or import NoisyOr
from care_core.diagnose.parts import never_flew
from care_core.diagnose.ranking import Suspect, describe_path, not_ruled_out
from care_core.diagnose.records import Cause, Confidence, Fault, Fix, Note, ObjectiveResult
from care_core.records import replace
from care_core.run import Evidence, gathered

MIN_CONTRIBUTION = 0.02
"""Probability an option must cost before it is called a cause of this run."""
CONVINCING, MOST_LEADS = 0.5, 3
"""A cause that costs less than this leaves room for others: up to so many options are then named in all."""
SURE, UNSURE = 0.4, 0.1
"""Contributions from which a cause may be called high confidence, and below which it is low."""
HIGH_SUPPORT, LOW_SUPPORT = 0.8, 0.5


def causes_of(
    failed: FailedRun, result: ObjectiveResult, found: tuple[Suspect, ...], top: int, needs: Mapping[str, float]
) -> tuple[Cause, ...]:
    """Options that cost this run, those that a failed check names first; where none of them convinces, a few leads
    that are not ruled out behind them; none of a vehicle that never armed, which no flight shows anything of.

    Args:
        needs: per objective what the reference configuration needs, which its limit is a multiple of.
    """
    others = not_ruled_out(failed.query, result.variable.name, found)
    refused = failed.run.refused_by if result.variable.kind == "functional" else frozenset()
    first = [suspect for suspect in (*found, *others) if suspect.option in refused]
    named = [suspect for suspect in found if suspect.contribution >= MIN_CONTRIBUTION]
    is_open = not named or named[0].contribution < CONVINCING
    if is_open and not first and not never_flew(failed.findings):
        weak = [suspect for suspect in found if suspect.contribution < MIN_CONTRIBUTION <= suspect.weight]
        named = [suspect for suspect in found if suspect in named or suspect in weak[: max(0, MOST_LEADS - len(named))]]
        weak = [suspect for suspect in found if 0 <= suspect.contribution < MIN_CONTRIBUTION > suspect.weight]
        named += [*weak, *others][: max(0, MOST_LEADS - len(named))]
    named = first + [suspect for suspect in named if suspect not in first]
    return tuple(_cause(failed, result, suspect, rank, needs) for rank, suspect in enumerate(named[:top], start=1))


def _cause(
    failed: FailedRun, result: ObjectiveResult, suspect: Suspect, rank: int, needs: Mapping[str, float]
) -> Cause:
    name, query = suspect.option, failed.query
    option = failed.profile.schema.variables[name]
    is_predictable = result.variable.name in query.model.outcomes and name not in query.kept
    best = best_alone(query, name) if is_predictable else None
    path = describe_path(suspect.path, query, failed.run, by_physics=suspect.by_physics)
    in_support = query.model.supports(name, query.config[name])
    support = 1.0 if suspect.by_physics else (suspect.effect.support if suspect.effect is not None else None) or 0.0
    changed = query.config if best is None else {**query.config, name: best[0]}
    return Cause(
        rank=rank,
        option=option,
        # What its limit is a multiple of: nobody is told two numbers for one thing.
        path=tuple(replace(node, expected=needs.get(node.name, node.expected)) for node in path),
        path_ace=suspect.path.ace,
        total_effect=suspect.total_effect,
        contribution=suspect.contribution,
        current=query.config[name],
        suggested=None if best is None else best[0],
        predicted=None if best is None else prediction(query, result.variable.name, changed),
        p_fixed=None if best is None else best[1],
        confidence=_confidence(failed, result, suspect, in_support, support),
        in_support=in_support,
        notes=_cause_notes(failed, suspect, in_support, support),
        is_assumed=name in query.assumed,
        is_lead=suspect.weight < MIN_CONTRIBUTION and name not in failed.run.refused_by,
    )


def as_in_fix(failed: FailedRun, fault: Fault, fix: Fix) -> tuple[Cause, ...]:
    """The causes with the values that the fix gives their options: nobody is told two values for one option.
    Beside a fix whose odds were not measured none has any: what training says of them was not enough to advise one."""
    values = {change.option.name: change.suggested for change in fix.changes}

    def as_in_fix(cause: Cause) -> Cause:
        value = values.get(cause.option.name, cause.suggested)
        if fix.shown_by:
            predicted = None if cause.option.name in values else cause.predicted
            return replace(cause, suggested=value, predicted=predicted, p_fixed=None)
        if value is None or value == cause.suggested:
            return cause
        changed = {**failed.query.config, cause.option.name: value}
        promised = prediction(failed.query, fault.objective.variable.name, changed)
        return replace(
            cause, suggested=value, predicted=promised, p_fixed=float(failed.query.probability([changed])[0])
        )

    return tuple(map(as_in_fix, fault.causes))


def as_ranked(faults: Sequence[Fault], failure: NoisyOr, least: float = 0.0) -> tuple[Fault, ...]:
    """The faults with their causes in the order of the hypotheses: which of them acted is told in one order alone.

    Args:
        least: probability that a cause acted from which it is told at all.
    """

    def ranked(causes: tuple[Cause, ...]) -> tuple[Cause, ...]:
        acted = [(round(failure.acts(("parameter", one.option.name)), 2), one) for one in causes]
        told = [(acts, one) for acts, one in acted if acts >= least]
        order = [one for _, one in sorted(told, key=lambda pair: (pair[1].is_lead, -pair[0]))]
        return tuple(replace(one, rank=rank) for rank, one in enumerate(order, start=1))

    return tuple(replace(fault, causes=ranked(fault.causes)) for fault in faults)


def _confidence(
    failed: FailedRun, result: ObjectiveResult, suspect: Suspect, in_support: bool, support: float
) -> Confidence:
    """High where the option explains most of a fault that is one wherever in its interval the threshold lies, nearly
    every resample gives it a path there, the log holds its value, and no option that the training runs cannot judge is
    off its reference too.

    A check that refused this run and reads the option's value is worth more than a doubt about the model.
    """
    contribution = suspect.contribution
    if failed.choice.fit.verdict != "fits":
        return "low"
    if not in_support or support < LOW_SUPPORT or contribution < UNSURE:
        return "medium" if suspect.option in failed.run.refused_by else "low"
    if failed.profile.schema.observational:
        # Operators chose the options: no table can rule a hidden reason out.
        return "low" if suspect.effect is None or suspect.effect.doubtful == 1.0 else "medium"
    is_rivalled = bool(failed.unranked[suspect.path.nodes[-1]])
    is_recorded = suspect.option not in failed.query.assumed
    if support >= HIGH_SUPPORT and contribution >= SURE and not is_rivalled and result.is_sure and is_recorded:
        return "high"
    return "medium"


def _cause_notes(failed: FailedRun, suspect: Suspect, in_support: bool, support: float) -> tuple[Note, ...]:
    notes: list[Note] = []
    left = ": not ruled out" if suspect.weight < MIN_CONTRIBUTION else ""
    if suspect.effect is None and not suspect.by_physics:
        notes.append(Note(f"no effect on {suspect.path.nodes[-1]} was seen in training{left}"))
    elif suspect.contribution < MIN_CONTRIBUTION:
        notes.append(Note(f"costs this run little, by what training says{left}"))
    if suspect.symptom is not None and suspect.contribution < MIN_CONTRIBUTION <= suspect.weight:
        notes.append(Note(f"this run's {suspect.symptom} points at it"))
    if not in_support:
        summary = failed.query.model.summaries[suspect.option]
        notes.append(Note(f"outside the training support ({summary.low:g} to {summary.high:g})", "outside_training"))
    if suspect.effect is not None and support < LOW_SUPPORT:
        notes.append(Note(f"a path to {suspect.path.nodes[-1]} was found in only {support:.0%} of resamples"))
    if suspect.not_borne_out:
        better = ", ".join(suspect.not_borne_out)
        notes.append(Note(f"better than expected in this run, so hardly the way it went: {better}"))
    if failed.profile.schema.observational:
        notes.append(Note(_chosen_by_operators(suspect.effect)))
    if suspect.option in failed.query.kept:
        notes.append(Note("pinned by --keep: not changed"))
    notes += map(Note, change_notes(failed.profile.schema.variables[suspect.option]))
    speaking = (evidence for evidence in failed.run.evidence if suspect.option in evidence.options)
    return (*notes, *_notes_of(gathered(speaking)))


def _notes_of(evidence: Iterable[Evidence]) -> Iterator[Note]:
    """What this run says of an option; what it means once, however many messages mean it."""
    told: set[str] = set()
    for one in evidence:
        yield Note(str(replace(one, says="") if one.says in told else one), "in_the_log")
        told.add(one.says)


def _chosen_by_operators(effect: EffectRecord | None) -> str:
    if effect is None or effect.robustness is None or effect.strongest is None:
        return "operators chose it, and the training runs are too few to say how strong a hidden cause would have to be"
    return (
        f"operators chose it: a hidden cause that explains {effect.robustness:.0%} of it and of "
        f"{effect.objective} would do as well (the strongest recorded one explains {effect.strongest:.0%})"
    )
