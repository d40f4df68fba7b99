"""What has to be known of a diagnosis beside its causes and its fix: what it was held against, what is not known."""

from __future__ import annotations

from collections.abc import Sequence

from care_core.causal.counterfactual import CounterfactualQuery
from care_core.diagnose.failed_run import FailedRun
from care_core.diagnose.implied import implied
from care_core.diagnose.judging import Judged, unread_options
from care_core.diagnose.ranking import deviating
from care_core.diagnose.records import Fix, ObjectiveResult
from care_core.diagnose.worth import by_chance


def reference_note(judged: Judged) -> str:
    """Whose configuration the run was judged against, and how far from it it was driven."""
    off, known = len(deviating(judged.run.config, judged.reference.config)), len(judged.run.config)
    count = f"{off} of the profile's {known} parameters differ{'s' * (off == 1)}"
    return f"compared with {judged.reference.source}; {count}"


def notes_of(
    failed: FailedRun, broken: Sequence[ObjectiveResult], fix: Fix | None, as_driven: float
) -> tuple[str, ...]:
    notes = [failed.reference]
    for name in (result.variable.name for result in broken):
        unknown = ", ".join(suspect.option for suspect in failed.unranked[name])
        if unknown:
            notes.append(f"not ranked, as the training runs cannot tell their effect on {name}: {unknown}")
    notes += [
        f"no mechanism predicts {name}: it counts with its base rate, {rate:.0%} of the training missions"
        for name, rate in failed.query.base_rates().items()
    ]
    notes.append(_promise(failed.query, [result.variable.name for result in broken]))
    if fix is not None and not fix.shown_by:
        notes += filter(None, [by_chance(fix, as_driven, _odds(failed.query))])
    if fix is not None and not fix.shown_by and failed.profile.schema.observational:
        notes.append(_if_hidden(failed, fix, as_driven))
    if not failed.run.mission.fits and failed.run.mission.mismatch not in notes:
        notes.append(failed.run.mission.mismatch)
    unread = unread_options(failed.profile.schema, failed.run) & set(failed.off)
    if unread:
        named = ", ".join(option.name for option in failed.profile.schema.options if option.name in unread)
        notes.append(f"no suspect, as no mode that reads it was entered: {named}")
    spoken_for = implied(failed.run, failed.profile.schema, failed.profile.model, failed.query.reference)
    notes += map(str, spoken_for.values())
    if names := sorted(failed.query.assumed - spoken_for.keys()):
        shown = ", ".join(names[:5]) + (f" and {len(names) - 5} more" if len(names) > 5 else "")
        notes.append(f"not in the log, taken to be at their reference: {shown}")
    return tuple(notes)


def _promise(query: CounterfactualQuery, broken: Sequence[str]) -> str:
    """Which next run the probabilities are for, and what is known of how it resembles this one."""
    known = [query.model.training.carry_over[name] for name in broken if name in query.model.training.carry_over]
    same, another = (max((carry_over.pairs[i] for carry_over in known), default=0) for i in (0, 1))
    measured = f"measured on {same} pairs of training runs" if same else "not measured"
    if another and not same:
        measured = f"measured only between days ({another} pairs of training runs)"
    seen = f", seen in {1 + len(query.repeats)} runs" if query.repeats else ""
    return f"these odds assume similar conditions{seen}; run-to-run variation was {measured}"


def _odds(query: CounterfactualQuery) -> float:
    """Probability that the reference configuration meets every limit in a mission like this, whatever this run met."""
    return float(query.unobserved().probability([query.reference])[0])


def _if_hidden(failed: FailedRun, fix: Fix, now: float) -> str:
    """What is left of a fix's promise where something unrecorded moved options and objectives together."""
    names = {change.option.name for change in fix.changes}
    effects = [effect for (option, _), effect in failed.query.model.effects.items() if option in names]
    doubt = max((effect.doubtful for effect in effects), default=1.0)
    left = min(fix.p_fixed, now + (1.0 - doubt) * (fix.p_fixed - now))
    return (
        f"operators chose the parameters of the training runs: the fix has {fix.p_fixed:.0%} if nothing unrecorded "
        f"made them choose so, {left:.0%} if something as strong as the strongest recorded cause did"
    )
