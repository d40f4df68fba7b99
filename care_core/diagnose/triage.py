"""Judged run -> causes -> fix: nothing else strings these steps together.

What comes before them, `judging.read_and_judge`, is the one way from a log to a run that can be asked about: what-if,
comparison and verification come by it too.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence

from care_core.causal.counterfactual import CounterfactualQuery
from care_core.causal.model import EffectRecord
from care_core.diagnose import provenance
from care_core.diagnose.advice import (
    by_chance,
    explained,
    falls_short,
    is_worth,
    nearest,
    no_stand_out,
    outweighed,
    promised,
    promised_causes,
    unrecorded,
    untried,
)
from care_core.diagnose.blame import blame
from care_core.diagnose.circumstances import battery_is_low, circumstances, unusual
from care_core.diagnose.estimates import NECESSARY, WORTH
from care_core.diagnose.fixes import (
    GAIN_FOR_ONE_MORE,
    MAX_ALTERNATIVES,
    Assignment,
    best_alone,
    change_notes,
    needs_unsafe,
    prediction,
    search,
    settled,
    smallest_good,
    to_fix,
)
from care_core.diagnose.hypotheses import hypotheses_of, speaking, unasked
from care_core.diagnose.implied import implied
from care_core.diagnose.judging import Judged, check_wishes, query_of, unread_options
from care_core.diagnose.next_step import bench, trial, was_refused, was_upset
from care_core.diagnose.noisy_or import NoisyOr
from care_core.diagnose.outside import suspects_outside
from care_core.diagnose.outside.change import Advisable, check_first, leading_outside, outside_fix, shown_fix
from care_core.diagnose.parts import mend_first, unmended
from care_core.diagnose.promise import Promise
from care_core.diagnose.ranking import (
    Suspect,
    describe_path,
    deviating,
    not_ruled_out,
)
from care_core.diagnose.records import (
    Cause,
    Confidence,
    Diagnosis,
    Fault,
    Fix,
    Hypothesis,
    Note,
    ObjectiveResult,
    OutsideSuspect,
)
from care_core.diagnose.since import compare, with_evidence
from care_core.diagnose.tell_more import AGAIN, SAME_AGAIN, AllBack, tell_more
from care_core.ecosystems.findings import NOTHING_SEEN, Finding, Health, every_finding
from care_core.logs.base import Log
from care_core.profile.store import Profile
from care_core.records import Record, replace
from care_core.run import Evidence, LogInfo, MissionInfo, ProfileChoice, Run, Setting, is_known, shown
from care_core.text import listed
from care_core.variables import Variable

FROM_HISTORY = "what was changed since this robot's last good run in the history counts as evidence"
BESIDE = 0.3
"""Share of the leading parameter's probability from which an option is changed with it."""
MIN_CONTRIBUTION = 0.02
"""Probability an option must cost before it is called a cause of this run."""
MIN_PROBABILITY = 0.2
"""Best probability below which the engine abstains: a confident wrong answer costs a field day."""
CONVINCING, MOST_LEADS = 0.5, 3
"""A cause that costs less than this leaves room for others: up to so many options are then named in all."""
SURE, UNSURE = 0.4, 0.1
"""Contributions from which a cause may be called high confidence, and below which it is low."""
HIGH_SUPPORT, LOW_SUPPORT = 0.8, 0.5

Progress = Callable[[str, float], None]


class _Case(Record, eq=False):
    """What every step of one diagnosis needs."""

    profile: Profile
    choice: ProfileChoice
    run: Run
    query: CounterfactualQuery
    reference: str
    """Whose the reference is."""
    unranked: Mapping[str, tuple[Suspect, ...]]
    """Per objective the options off their reference whose effect the training runs cannot tell, the likeliest first."""
    findings: Sequence[Finding]


def triage(
    judged: Judged,
    profile: Profile,
    choice: ProfileChoice,
    *,
    keep: Collection[str] = (),
    since: Log | Mapping[str, Setting] | None = None,
    health: Health = NOTHING_SEEN,
    top: int = 5,
    progress: Progress | None = None,
) -> Diagnosis:
    """Diagnose a run that was read and judged.

    Args:
        health: what happened in the log, with the findings that compete with parameters.
        keep: options that must stay as they are.
        since: the log of a good run; what changed since then is told as evidence. Or the parameters of one that a
            history holds: what changed counts, and is told of those that may have lost this run.
        top: most causes to report per fault.

    Raises:
        CareError: the profile has no usable model, or no such option.
    """
    check_wishes(profile.schema, keep, {})
    remembered = since if isinstance(since, Mapping) else None
    log = None if isinstance(since, Mapping) else since
    good = remembered if log is None else {name: history[-1] for name, history in log.settings().items()}
    diagnosis = diagnose(judged, profile, choice, keep=keep, health=health, top=top, good=good, progress=progress)
    notes = provenance.notes(profile.schema, judged.run, judged.configs, judged.given)
    told = (FROM_HISTORY,) if remembered and diagnosis.outside else ()
    diagnosis = replace(diagnosis, notes=(*diagnosis.notes, *notes, *told))
    if log is None:
        return diagnosis
    if progress is not None:
        progress("comparing with the good log", 0.95)
    return with_evidence(diagnosis, compare(judged, log, profile))


def diagnose(
    judged: Judged,
    profile: Profile,
    choice: ProfileChoice,
    *,
    keep: Collection[str] = (),
    health: Health = NOTHING_SEEN,
    top: int = 5,
    good: Mapping[str, Setting] | None = None,
    progress: Progress | None = None,
) -> Diagnosis:
    """Causes and fix of a run that has been judged; the arguments are those of `triage`, and the parameters of the last
    good run, None where none is known."""
    report = progress or (lambda _step, _share: None)
    schema, broken = profile.schema, judged.broken
    said = speaking(health.findings, schema, judged.run.config)
    run = replace(judged.run, evidence=(*judged.run.evidence, *said.values()))
    objectives = (*judged.results, *judged.checks)
    choice = replace(choice, fit=choice.fit.with_objection(*unusual(run, profile)))
    if not broken:
        missed = [result for result in judged.checks if result.status == "fault"]
        outside = suspects_outside(run, missed, health, schema, good=good) if _failed(missed, health) else ()
        told = unasked(
            health.findings, failed=bool(missed), shown=said, verdict=choice.fit.verdict, outside=_weights(outside)
        )
        lead = leading_outside(told, outside, health.findings, run)
        fix = shown_fix(lead, run)
        return Diagnosis(
            choice,
            run,
            objectives,
            (),
            fix,
            notes=(*_set_wrong(judged, told, said), *(() if run.checks else (_reference(judged),))),
            missions=judged.missions,
            health=health,
            abstained=None if lead is None or fix is not None else check_first(lead),
            hypotheses=told,
            outside=outside,
        )
    report("ranking the causes", 0.7)
    query = query_of(judged, profile, keep)
    blamed = blame(judged, profile, query, health, good)
    weighed, outside, failure = blamed.suspects, blamed.outside, blamed.failure
    found = {name: tuple(one for one in group if one.is_identified) for name, group in weighed.items()}
    unranked = {name: tuple(one for one in group if not one.is_identified) for name, group in weighed.items()}
    case = _Case(profile, choice, run, query, _reference(judged), unranked, health.findings)
    refused = _refused_otherwise(case, health)
    unheard = {result.variable.name: refused or _out_of_reach(case, result) for result in broken}
    faults = tuple(
        Fault(result, () if unheard[name] else _causes(case, result, found[name], top))
        for name, result in ((result.variable.name, result) for result in broken)
    )
    hypotheses = hypotheses_of(failure)
    report("searching for a fix", 0.85)
    promise = Promise(failure, query, [result.variable.name for result in broken])
    as_driven = promise.as_driven()
    out_of_reach = next(filter(None, unheard.values()), None)
    part = _part(case, health.findings)
    lead = leading_outside(hypotheses, outside, health.findings, run)
    if lead is not None and (part is None or lead.is_found):
        advised = _of_outside(lead, case, hypotheses, promise)
    else:
        lead = None
        against = (part and unmended(part)) or out_of_reach or outweighed(hypotheses, health.findings)
        options = {s.option for group in found.values() for s in group}
        advised = _of_options(case, judged, faults, hypotheses, options, promise, against)
    fixes, abstained = advised.fixes, advised.abstained
    unsure = abstained is not None or any(fault.causes[0].confidence != "high" for fault in faults if fault.causes)
    if abstained is None and lead is None:
        faults = tuple(replace(fault, causes=_as_in_fix(case, fault, fixes[0])) for fault in faults)
    faults = _as_ranked(promised_causes(faults, promise), failure)
    all_back = _all_back(case, promise, as_driven if abstained or fixes[0].odds is None else fixes[0].odds)
    report("done", 1.0)
    return Diagnosis(
        profile=choice,
        run=run,
        objectives=objectives,
        faults=faults,
        fix=None if abstained else fixes[0],
        alternatives=() if abstained else tuple(fixes[1:]),
        odds_as_driven=as_driven,
        abstained=abstained,
        why_this=advised.why or _why_this(fixes, abstained, as_driven, hypotheses, faults),
        notes=_notes(case, broken, None if abstained or lead else fixes[0], as_driven),
        missions=judged.missions,
        rivals=circumstances(run, query, schema) if unsure else (),
        tell_more=_tell_more(case, faults, health, all_back) if unsure and not out_of_reach else (),
        health=health,
        hypotheses=hypotheses,
        failure=failure,
        outside=outside,
    )


class _Advised(Record):
    """The fixes, the advised one first, or why none is advised."""

    fixes: Sequence[Fix]
    abstained: str | None
    why: str = ""


def _of_outside(lead: Advisable, case: _Case, hypotheses: Sequence[Hypothesis], promise: Promise) -> _Advised:
    """What is advised of a parameter outside the profile that leads the ranking, with the options that stand beside it.
    A vehicle that never armed has its mission still before it: then the odds are those of the mission, too."""
    if not lead.is_advised:
        return _Advised((), check_first(lead))
    query = case.query
    beside = _beside(lead, case, hypotheses, promise)
    odds = promise.without(lead.name, {**query.config, **beside})
    if was_refused(case.findings):
        odds *= float(replace(query, observed={}, repeats=()).probability([query.config])[0])
    changes = to_fix(query, beside, odds).changes if beside else ()
    return _Advised((outside_fix(lead, odds, case.run, changes),), None, lead.why)


def _beside(lead: Advisable, case: _Case, hypotheses: Sequence[Hypothesis], promise: Promise) -> dict[str, float]:
    """The options that go back to their reference with a parameter outside the profile: those that are about as likely,
    and those without which its change promises much less."""
    query = case.query
    likely = {one.name for one in hypotheses if one.what == "parameter" and one.acts >= BESIDE * lead.probability}
    off = _off(case) - query.kept - _failsafes_held(case, case.findings)
    free = {name: value for name in sorted(off) if query.variables[name].accepts(value := query.reference[name])}
    chosen = {name: value for name, value in free.items() if name in likely}
    while rest := free.keys() - chosen:
        now = promise.without(lead.name, {**query.config, **chosen})
        odds = {name: promise.without(lead.name, {**query.config, **chosen, name: free[name]}) for name in sorted(rest)}
        best = max(odds, key=lambda name: odds[name])
        if odds[best] < now + GAIN_FOR_ONE_MORE:
            break
        chosen[best] = free[best]
    return chosen


def _of_options(
    case: _Case,
    judged: Judged,
    faults: tuple[Fault, ...],
    hypotheses: Sequence[Hypothesis],
    options: Collection[str],
    promise: Promise,
    against: str | None,
) -> _Advised:
    """What is advised of the options of the profile.

    Args:
        options: those that may have moved what broke.
        against: why nothing is advised whatever is found, None where nothing stands against it.
    """
    broken, as_driven = judged.broken, promise.as_driven()
    held = _failsafes_held(case, case.findings)
    held_too = held | _leads(faults)
    found = _fixes(case, options, held_too, promise)
    if idle := _idle(judged, found[:1], promise):
        found = _fixes(case, options, held_too | idle, promise)
    fixes = promised(found, promise)
    if against is not None:
        return _Advised(fixes, against)
    abstained = (
        _abstains(case, faults, fixes, held, promise)
        or falls_short(fixes[0], broken, as_driven)
        or untried(fixes[0], case.profile.schema.learned_elsewhere)
        or unrecorded(fixes[0], case.choice.fit.verdict)
        or no_stand_out(fixes[0], as_driven, hypotheses, _necessary(promise, fixes[0]))
    )
    shown = None if abstained is None else _shown_by_run(case, hypotheses)
    return _Advised(fixes, abstained) if shown is None else _Advised((shown,), None)


def _why_this(
    fixes: Sequence[Fix],
    abstained: str | None,
    as_driven: float,
    hypotheses: Sequence[Hypothesis],
    faults: Sequence[Fault],
) -> str:
    return "" if abstained or fixes[0].shown_by else explained(fixes[0], as_driven, hypotheses, faults)


def _weights(outside: Sequence[OutsideSuspect]) -> dict[str, float]:
    return {one.name: one.weight for one in outside}


def _all_back(case: _Case, promise: Promise, advised: float) -> AllBack | None:
    """Everything at its reference, where that promises more than the advised change, by as much as is worth one."""
    query, held = case.query, _failsafes_held(case, case.findings)
    off = sorted(_off(case) - query.kept - held)
    back = {name: value for name in off if query.variables[name].accepts(value := query.reference[name])}
    if len(back) < 2 or case.profile.schema.learned_elsewhere:
        return None
    odds = float(promise.odds([{**query.config, **back}])[0])
    return AllBack(len(back), odds) if odds >= max(advised + WORTH.value, MIN_PROBABILITY) else None


def _tell_more(case: _Case, faults: tuple[Fault, ...], health: Health, all_back: AllBack | None) -> tuple[str, ...]:
    upset = was_upset(case.run, health.findings)
    return tell_more(
        case.query,
        faults,
        case.run,
        case.unranked,
        observational=case.profile.schema.observational,
        again=f"try it {trial(case.run)}" if upset else AGAIN,
        nothing_else=bench(case.run) if upset else SAME_AGAIN,
        all_back=all_back,
    )


def _shown_by_run(case: _Case, hypotheses: Sequence[Hypothesis]) -> Fix | None:
    """The parameters that a critical finding of this run names, back at their reference: what it shows is worth a
    change where training says little of it, though nothing says what that promises. None where none stands above
    chance."""
    query, shown = case.query, next((one for one in case.run.evidence if one.kind == "found"), None)
    if shown is None or case.profile.schema.learned_elsewhere:
        return None
    chance = sum(one.probability for one in hypotheses if one.what == "chance")
    likely = {one.name for one in hypotheses if one.what == "parameter" and one.probability > chance}
    back = {name: query.reference[name] for name in shown.options if name not in query.kept}
    if not likely & back.keys() or not all(query.variables[name].accepts(value) for name, value in back.items()):
        return None
    fix = to_fix(query, back, float(query.probability([{**query.config, **back}])[0]))
    return replace(fix, predicted={}, shown_by=shown.text.partition(":")[0])


def _part(case: _Case, findings: Sequence[Finding]) -> Finding | None:
    """The part that comes before any parameter. A battery that is known to be full kept no vehicle from arming."""
    part = mend_first(findings)
    is_full = battery_is_low(case.run, case.query.model, case.profile.schema) is False
    return None if part is not None and part.kind == "prearm" and is_full else part


def _failsafes_held(case: _Case, findings: Sequence[Finding]) -> frozenset[str]:
    """The battery failsafes, where the battery may not have been full or well: they are lowered for no such flight."""
    suspected = any(
        one.kind == "battery" and one.suspect != "parameter" and one.severity != "info" and not one.after_impact
        for one in every_finding(findings)
    )
    if not suspected and not battery_is_low(case.run, case.query.model, case.profile.schema):
        return frozenset()
    return frozenset(one.name for one in case.profile.schema.options if one.safety and one.unit == "V")


def _leads(faults: Sequence[Fault]) -> set[str]:
    """Options that are only not ruled out: no fix changes them."""
    causes = [cause for fault in faults for cause in fault.causes]
    return {one.option.name for one in causes if one.is_lead} - {one.option.name for one in causes if not one.is_lead}


def _idle(judged: Judged, fixes: Sequence[Fix], promise: Promise) -> set[str]:
    """Options that a fix changes beside others for nothing that this run broke: it met all else, as far as can be."""
    if not fixes or any(result.status == "not_evaluated" for result in judged.results):
        return set()
    names = {change.option.name for change in fixes[0].changes}
    return {
        name for name in names if len(names) > 1 and _necessary(promise, fixes[0], names - {name}) < NECESSARY.value
    }


def _necessary(promise: Promise, fix: Fix, given: Collection[str] = frozenset()) -> float:
    """Probability of necessity of a fix. `given`: options of it that are changed already."""
    driven = promise.query.config
    changed = {one.option.name: one.suggested for one in fix.changes}
    first = {name: value for name, value in changed.items() if name in given}
    return promise.necessity({**driven, **changed}, {**driven, **first})


def _set_wrong(judged: Judged, explained: Sequence[Hypothesis], said: Mapping[str, Evidence]) -> Iterator[str]:
    """What a finding says of the options that explain a run of which no objective could be judged, and their values."""
    named = {one.name for one in explained if one.what == "parameter"}
    for title, evidence in said.items():
        values = [
            f"{name} {shown(judged.run.config[name])} (reference {shown(judged.reference.config.get(name))})"
            for name in evidence.options
            if name in named and name in judged.run.config
        ]
        if values:
            yield f"{title}: {evidence.says or 'it speaks of how the robot was set'}: {listed(values)}"


def unjudged(log: LogInfo, settings: Mapping[str, Setting], choice: ProfileChoice, health: Health) -> Diagnosis:
    """The answer for a log that no profile fits: what happened in it is all that can be said."""
    whole = MissionInfo(0, 0, 0.0, log.duration_s, ended=True, fits=False)
    run = Run({}, {}, {}, {}, settings, log, whole)
    explained = unasked(health.findings)
    return Diagnosis(choice, run, (), (), None, health=health, hypotheses=explained)


def without_profile(judged: Judged, choice: ProfileChoice, health: Health) -> Diagnosis:
    """The answer for a run that no profile fits: what it did and what failed, and no cause by parameters."""
    broken = tuple(result for result in judged.checks if result.status == "fault")
    outside = suspects_outside(judged.run, broken, health) if _failed(broken, health) else ()
    told = unasked(health.findings, failed=bool(broken), outside=_weights(outside))
    lead = leading_outside(told, outside, health.findings, judged.run)
    return Diagnosis(
        choice,
        judged.run,
        judged.checks,
        tuple(Fault(result, ()) for result in broken),
        None,
        missions=judged.missions,
        health=health,
        abstained=None if lead is None else check_first(lead),
        hypotheses=told,
        outside=outside,
    )


def _failed(missed: Sequence[ObjectiveResult], health: Health) -> bool:
    """Whether a run failed of which no model can be asked: by a check, or by what was found in it."""
    return bool(missed) or any(one.severity == "critical" for one in health.findings)


def _causes(case: _Case, result: ObjectiveResult, found: tuple[Suspect, ...], top: int) -> tuple[Cause, ...]:
    """Options that cost this run, those that a failed check names first; where none of them convinces, a few leads
    that are not ruled out behind them."""
    others = not_ruled_out(case.query, result.variable.name, found)
    refused = case.run.refused_by if result.variable.kind == "functional" else frozenset()
    first = [suspect for suspect in (*found, *others) if suspect.option in refused]
    named = [suspect for suspect in found if suspect.contribution >= MIN_CONTRIBUTION]
    if not first and (not named or named[0].contribution < CONVINCING):
        weak = [suspect for suspect in found if suspect.contribution < MIN_CONTRIBUTION <= suspect.weight]
        named = [suspect for suspect in found if suspect in named or suspect in weak[: max(0, MOST_LEADS - len(named))]]
        weak = [suspect for suspect in found if 0 <= suspect.contribution < MIN_CONTRIBUTION > suspect.weight]
        named += [*weak, *others][: max(0, MOST_LEADS - len(named))]
    named = first + [suspect for suspect in named if suspect not in first]
    return tuple(_cause(case, result, suspect, rank) for rank, suspect in enumerate(named[:top], start=1))


def _cause(case: _Case, result: ObjectiveResult, suspect: Suspect, rank: int) -> Cause:
    name, query = suspect.option, case.query
    option = case.profile.schema.variables[name]
    is_predictable = result.variable.name in query.model.outcomes and name not in query.kept
    best = best_alone(query, name) if is_predictable else None
    path = describe_path(suspect.path, query, case.run, by_physics=suspect.by_physics)
    in_support = query.model.supports(name, query.config[name])
    support = 1.0 if suspect.by_physics else (suspect.effect.support if suspect.effect is not None else None) or 0.0
    changed = query.config if best is None else {**query.config, name: best[0]}
    return Cause(
        rank=rank,
        option=option,
        path=path,
        path_ace=suspect.path.ace,
        total_effect=suspect.total_effect,
        contribution=suspect.contribution,
        current=query.config[name],
        suggested=None if best is None else best[0],
        predicted=None if best is None else prediction(query, result.variable.name, changed),
        p_fixed=None if best is None else best[1],
        confidence=_confidence(case, result, suspect, in_support, support),
        in_support=in_support,
        notes=_cause_notes(case, suspect, in_support, support),
        is_assumed=name in query.assumed,
        is_lead=suspect.weight < MIN_CONTRIBUTION and name not in case.run.refused_by,
    )


def _as_in_fix(case: _Case, fault: Fault, fix: Fix) -> tuple[Cause, ...]:
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
        changed = {**case.query.config, cause.option.name: value}
        promised = prediction(case.query, fault.objective.variable.name, changed)
        return replace(cause, suggested=value, predicted=promised, p_fixed=float(case.query.probability([changed])[0]))

    return tuple(map(as_in_fix, fault.causes))


def _as_ranked(faults: Sequence[Fault], failure: NoisyOr) -> tuple[Fault, ...]:
    """The faults with their causes in the order of the hypotheses: which of them acted is told in one order alone."""

    def ranked(causes: tuple[Cause, ...]) -> tuple[Cause, ...]:
        order = sorted(causes, key=lambda one: (one.is_lead, -round(failure.acts(("parameter", one.option.name)), 2)))
        return tuple(replace(one, rank=rank) for rank, one in enumerate(order, start=1))

    return tuple(replace(fault, causes=ranked(fault.causes)) for fault in faults)


def _confidence(case: _Case, result: ObjectiveResult, suspect: Suspect, in_support: bool, support: float) -> Confidence:
    """High where the option explains most of a fault that is one wherever in its interval the threshold lies, nearly
    every resample gives it a path there, the log holds its value, and no option that the training runs cannot judge is
    off its reference too.

    A check that refused this run and reads the option's value is worth more than a doubt about the model.
    """
    contribution = suspect.contribution
    if case.choice.fit.verdict != "fits":
        return "low"
    if not in_support or support < LOW_SUPPORT or contribution < UNSURE:
        return "medium" if suspect.option in case.run.refused_by else "low"
    if case.profile.schema.observational:
        # Operators chose the options: no table can rule a hidden reason out.
        return "low" if suspect.effect is None or suspect.effect.doubtful == 1.0 else "medium"
    is_rivalled = bool(case.unranked[suspect.path.nodes[-1]])
    is_recorded = suspect.option not in case.query.assumed
    if support >= HIGH_SUPPORT and contribution >= SURE and not is_rivalled and result.is_sure and is_recorded:
        return "high"
    return "medium"


def _cause_notes(case: _Case, suspect: Suspect, in_support: bool, support: float) -> tuple[Note, ...]:
    notes: list[Note] = []
    left = ": not ruled out" if suspect.weight < MIN_CONTRIBUTION else ""
    if suspect.effect is None and not suspect.by_physics:
        notes.append(Note(f"no effect on {suspect.path.nodes[-1]} was seen in training{left}"))
    elif suspect.contribution < MIN_CONTRIBUTION:
        notes.append(Note(f"costs this run little, by what training says{left}"))
    if suspect.symptom is not None and suspect.contribution < MIN_CONTRIBUTION <= suspect.weight:
        notes.append(Note(f"this run's {suspect.symptom} points at it"))
    if not in_support:
        summary = case.query.model.summaries[suspect.option]
        notes.append(Note(f"outside the training support ({summary.low:g} to {summary.high:g})", "outside_training"))
    if suspect.effect is not None and support < LOW_SUPPORT:
        notes.append(Note(f"a path to {suspect.path.nodes[-1]} was found in only {support:.0%} of resamples"))
    if suspect.not_borne_out:
        better = ", ".join(suspect.not_borne_out)
        notes.append(Note(f"better than expected in this run, so hardly the way it went: {better}"))
    if case.profile.schema.observational:
        notes.append(Note(_chosen_by_operators(suspect.effect)))
    if suspect.option in case.query.kept:
        notes.append(Note("pinned by --keep: not changed"))
    notes += map(Note, change_notes(case.profile.schema.variables[suspect.option]))
    notes += [Note(str(evidence), "in_the_log") for evidence in case.run.evidence if suspect.option in evidence.options]
    return tuple(notes)


def _chosen_by_operators(effect: EffectRecord | None) -> str:
    if effect is None or effect.robustness is None or effect.strongest is None:
        return "operators chose it, and the training runs are too few to say how strong a hidden cause would have to be"
    return (
        f"operators chose it: a hidden cause that explains {effect.robustness:.0%} of it and of "
        f"{effect.objective} would do as well (the strongest recorded one explains {effect.strongest:.0%})"
    )


def _fixes(case: _Case, options: Collection[str], held: Collection[str], promise: Promise) -> list[Fix]:
    """The suggested fix first, then up to three that trade changes for probability or take another way.

    Args:
        held: options that are not changed.
    """
    # Options off their reference that break another objective matter too once this fault is gone.
    off = deviating(case.query.config, case.query.reference)
    free = sorted({*options, *(name for name in off if _has_effect(case, name))} - {*held, *case.query.kept})
    found = _as_promised(search(case.query, free), promise)
    if not found:
        return []
    chosen = smallest_good(found)
    others = [found[i] for i in range(len(found)) if i != chosen and abs(i - chosen) == 1]
    without = [name for name in free if name not in found[chosen][0]]
    detour = _as_promised(search(case.query, without), promise)
    others += [detour[smallest_good(detour)]] if detour else []
    useful = [pair for pair in sorted(others, key=lambda pair: -pair[1]) if _is_choice(pair, found[chosen])]
    ranked = [found[chosen], *useful[:MAX_ALTERNATIVES]]
    fixes = [to_fix(case.query, *settled(case.query, assignment)) for assignment, _probability in ranked]
    return [fix for i, fix in enumerate(fixes) if fix.changes not in [earlier.changes for earlier in fixes[:i]]]


def _as_promised(found: Sequence[tuple[Assignment, float]], promise: Promise) -> list[tuple[Assignment, float]]:
    """The sets that the search found with what they promise for the next run."""
    if not found:
        return []
    odds = promise.odds([{**promise.query.config, **assignment} for assignment, _ in found])
    return [(assignment, float(share)) for (assignment, _), share in zip(found, odds, strict=True)]


def _is_choice(other: tuple[Assignment, float], chosen: tuple[Assignment, float]) -> bool:
    """Whether an operator might prefer it: likely enough, and not the same changes with one more for nothing."""
    adds_for_nothing = chosen[0].keys() <= other[0].keys() and other[1] < chosen[1] + MIN_CONTRIBUTION
    return other[1] >= MIN_PROBABILITY and not adds_for_nothing


def _has_effect(case: _Case, option: str) -> bool:
    effects = case.query.model.effects
    return any(effects[key].identified and effects[key].effect > 0 for key in effects if key[0] == option)


def _abstains(
    case: _Case, faults: tuple[Fault, ...], fixes: Sequence[Fix], held: Collection[str], promise: Promise
) -> str | None:
    as_driven = promise.as_driven()
    names = [fault.objective.variable.name for fault in faults]
    unknown = [name for name in names if name not in case.query.model.outcomes]
    if unknown:
        return f"too few training missions to predict {', '.join(unknown)}: the causes are named, no change is promised"
    for fault in faults:
        rival = next(iter(case.unranked[fault.objective.variable.name]), None)
        if rival is not None and rival.weight > max((cause.contribution for cause in fault.causes), default=0.0):
            return f"'{rival.option}' is as likely a cause, and the training runs cannot tell what it does"
    has_cause = any(not cause.is_lead for fault in faults for cause in fault.causes)
    if has_cause and fixes and is_worth(fixes[0], as_driven):
        return None
    if any(cause.option.name in held for fault in faults for cause in fault.causes if not cause.is_lead):
        return f"charge or replace the battery first: {', '.join(sorted(held))} is not lowered while it is not full"
    now = float(case.query.probability([case.query.config])[0])
    unsafe = needs_unsafe(case.query, max(MIN_PROBABILITY, now + WORTH.value))
    if unsafe is not None:
        return f"only '{unsafe}' past its default is likely to help, and a safety parameter is never made looser"
    if not case.run.config:
        return "not one of the parameters that this profile knows is in the log, and no file tells them"
    if not has_cause:
        return (
            "no parameter that this profile models explains the fault: look at what the run met "
            "(wind, battery, positioning, obstacles) or at parameters outside the profile"
        )
    pinned = f", with {', '.join(sorted(case.query.kept))} kept as it is" if case.query.kept else ""
    broken = [fault.objective for fault in faults]
    best = nearest(promised(_resets(case, faults), promise), broken)
    short = falls_short(best, broken, as_driven) if best else None
    return f"{short or 'no change inside the acceptable ranges is likely enough to meet every limit'}{pinned}"


def _resets(case: _Case, faults: tuple[Fault, ...]) -> list[Fix]:
    """Each named cause back at its reference, and all of them: where every probability is about zero, what comes
    nearest to the limits is told by its values."""
    query = case.query
    named = dict.fromkeys(cause.option.name for fault in faults for cause in fault.causes if not cause.is_lead)
    free = [name for name in named if name not in query.kept and query.config[name] != query.reference[name]]
    sets = [[name] for name in free] + ([free] if len(free) > 1 else [])
    resets = [{name: query.reference[name] for name in names} for names in sets]
    return [to_fix(query, one, float(query.probability([{**query.config, **one}])[0])) for one in resets]


def _out_of_reach(case: _Case, result: ObjectiveResult) -> str | None:
    """Said of what no training run came near, a threshold or a way to fail: no option can be blamed for it."""
    if result.variable.kind == "functional":
        return _new_way_to_fail(case)
    name, bound = result.variable.name, result.threshold
    summary = case.query.model.summary_at(name, case.query.reference)
    if bound is None or summary is None:
        return None
    best = summary.low if bound.op in ("<=", "<") else summary.high
    if bound.op == "==" or bound.met(best):
        return None
    unit = f" {result.variable.unit}" if result.variable.unit else ""
    nearest = f"the best: {best:g}{unit}"
    return f"no run of the profile's training met {name} {bound}{unit} ({nearest}): no parameter explains it"


def _refused_otherwise(case: _Case, health: Health) -> str | None:
    """Said where the run ended at a refusal to arm that speaks of no option of the profile: for what an operator has to
    do, or for none of the complaints that the profile tells apart. What options do in flight is no cause of it."""
    said = next((one for one in health.findings if one.kind == "prearm"), None)
    if said is None or case.run.refused_by:
        return None
    if said.parameters:
        read = listed(said.parameters)
        return f"{said.title}: that check reads {read}; look there first"
    if said.suspect == "operation":
        return f"{said.title}: that check reads no parameter of the profile, so none explains it"
    complaints = [one for one in case.profile.schema.metrics if _is_of_one_complaint(one)]
    if not complaints or any(case.run.metrics.get(one.name) == 1 for one in complaints):
        return None
    return f"{said.title}: that complaint speaks of no parameter of the profile, so none is blamed"


def _is_of_one_complaint(metric: Variable) -> bool:
    how = metric.extract
    return how is not None and how.kind == "arming_refused" and bool(how.args)


def _new_way_to_fail(case: _Case) -> str | None:
    for variable in case.profile.schema.metrics:
        summary, value = case.query.model.summaries.get(variable.name), case.run.metrics.get(variable.name)
        if variable.type != "bool" or summary is None or not is_known(value):
            continue
        if summary.low == summary.high != value:
            what = variable.doc or f"{variable.name} is {value:g}"
            return f"{what}, as in no training mission of the profile: it knows nothing of what leads to that"
    return None


def _off(case: _Case) -> frozenset[str]:
    return frozenset(deviating(case.run.config, case.query.reference))


def _promise(query: CounterfactualQuery, broken: Sequence[str]) -> str:
    """Which next run the probabilities are for, and what is known of how it resembles this one."""
    known = [query.model.training.carry_over[name] for name in broken if name in query.model.training.carry_over]
    same, another = (max((carry_over.pairs[i] for carry_over in known), default=0) for i in (0, 1))
    measured = f"measured on {same} pairs of training runs" if same else "not measured"
    if another and not same:
        measured = f"measured only between days ({another} pairs of training runs)"
    seen = f", seen in {1 + len(query.repeats)} runs" if query.repeats else ""
    return f"these odds assume similar conditions{seen}; run-to-run variation was {measured}"


def _reference(judged: Judged) -> str:
    """Whose configuration the run was judged against, and how far from it it was driven."""
    off = len(deviating(judged.run.config, judged.reference.config))
    count = f"{off} parameter differs" if off == 1 else f"{off} parameters differ"
    return f"compared with {judged.reference.source}; {count}"


def _odds(query: CounterfactualQuery) -> float:
    """Probability that the reference configuration meets every limit in a mission like this, whatever this run met."""
    return float(replace(query, observed={}, repeats=()).probability([query.reference])[0])


def _if_hidden(case: _Case, fix: Fix, now: float) -> str:
    """What is left of a fix's promise where something unrecorded moved options and objectives together."""
    names = {change.option.name for change in fix.changes}
    effects = [effect for (option, _), effect in case.query.model.effects.items() if option in names]
    doubt = max((effect.doubtful for effect in effects), default=1.0)
    left = min(fix.p_fixed, now + (1.0 - doubt) * (fix.p_fixed - now))
    return (
        f"operators chose the parameters of the training runs: the fix has {fix.p_fixed:.0%} if nothing unrecorded "
        f"made them choose so, {left:.0%} if something as strong as the strongest recorded cause did"
    )


def _notes(case: _Case, broken: Sequence[ObjectiveResult], fix: Fix | None, as_driven: float) -> tuple[str, ...]:
    notes = [case.reference]
    for name in (result.variable.name for result in broken):
        unknown = ", ".join(suspect.option for suspect in case.unranked[name])
        if unknown:
            notes.append(f"not ranked, as the training runs cannot tell their effect on {name}: {unknown}")
    notes += [
        f"no mechanism predicts {name}: it counts with its base rate, {rate:.0%} of the training missions"
        for name, rate in case.query.base_rates().items()
    ]
    notes.append(_promise(case.query, [result.variable.name for result in broken]))
    if fix is not None and not fix.shown_by:
        notes += filter(None, [by_chance(fix, as_driven, _odds(case.query))])
    if fix is not None and not fix.shown_by and case.profile.schema.observational:
        notes.append(_if_hidden(case, fix, as_driven))
    if not case.run.mission.fits and case.run.mission.mismatch not in notes:
        notes.append(case.run.mission.mismatch)
    unread = unread_options(case.profile.schema, case.run) & set(_off(case))
    if unread:
        named = ", ".join(option.name for option in case.profile.schema.options if option.name in unread)
        notes.append(f"no suspect, as no mode that reads it was entered: {named}")
    spoken_for = implied(case.run, case.profile.schema, case.profile.model, case.query.reference)
    notes += map(str, spoken_for.values())
    if names := sorted(case.query.assumed - spoken_for.keys()):
        shown = ", ".join(names[:5]) + (f" and {len(names) - 5} more" if len(names) > 5 else "")
        notes.append(f"not in the log, taken to be at their reference: {shown}")
    return tuple(notes)
