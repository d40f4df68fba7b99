"""Judged run -> causes -> fix: nothing else strings these steps together.

What comes before them, `judging.read_and_judge`, is the one way from a log to a run that can be asked about: what-if,
comparison and verification come by it too.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence

from care_core.diagnose import provenance
from care_core.diagnose.advice import Advised, advise, all_back, shown_back
from care_core.diagnose.blame import blame
from care_core.diagnose.causes import UNSURE, as_in_fix, as_ranked, causes_of
from care_core.diagnose.circumstances import circumstances, unusual
from care_core.diagnose.failed_run import FailedRun
from care_core.diagnose.hypotheses import evidence_of_findings, hypotheses_of, hypotheses_without_model
from care_core.diagnose.judging import Judged, check_wishes, facing_mission, query_of
from care_core.diagnose.next_step import again, bench, was_upset
from care_core.diagnose.outside import suspects_outside
from care_core.diagnose.outside.change import check_first, leading_outside, shown_fix
from care_core.diagnose.parts import is_ahead
from care_core.diagnose.promise import Promise
from care_core.diagnose.records import Diagnosis, Fault, Fix, Hypothesis, ObjectiveResult, OutsideSuspect
from care_core.diagnose.remarks import notes_of, reference_note
from care_core.diagnose.since import compare, with_evidence
from care_core.diagnose.tell_more import SAME_AGAIN, tell_more, to_record
from care_core.diagnose.unexplained import out_of_reach, refused_otherwise
from care_core.diagnose.worth import explained, promised_causes
from care_core.ecosystems.findings import NOTHING_SEEN, Health
from care_core.logs.base import Log
from care_core.profile.schema import Schema
from care_core.profile.store import Profile
from care_core.progress import Progress
from care_core.records import replace
from care_core.run import Evidence, LogInfo, MissionInfo, ProfileChoice, Run, Setting, shown
from care_core.text import listed

FROM_HISTORY = "what was changed since this robot's last good run in the history counts as evidence"


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
    said = evidence_of_findings(health.findings, schema, judged.run.config)
    run = judged.run.with_evidence(*said.values())
    choice = replace(choice, fit=choice.fit.with_objection(*unusual(run, profile)))
    if not broken:
        return _within_limits(judged, schema, choice, run, said, health, good)
    report("ranking the causes", 0.7)
    query = query_of(judged, profile, keep)
    blamed = blame(judged, profile, query, health, good)
    if is_ahead(run, health.findings):
        query = facing_mission(query, judged, profile)
    failed = FailedRun(profile, choice, run, query, reference_note(judged), blamed.unranked, health.findings)
    unheard = _unheard(failed, broken, health)
    needs = {one.variable.name: one.need.value for one in judged.results if one.need is not None}
    faults = tuple(
        Fault(result, () if why else causes_of(failed, result, blamed.ranked[result.variable.name], top, needs))
        for result, why in zip(broken, unheard, strict=True)
    )
    hypotheses = hypotheses_of(blamed.failure)
    report("searching for a fix", 0.85)
    promise = Promise(blamed.failure, query, [result.variable.name for result in broken])
    advised = advise(failed, judged, faults, blamed, hypotheses, promise, next(filter(None, unheard), None))
    fix, as_driven = advised.fix, promise.as_driven()
    unsure = fix is None or any(fault.causes[0].confidence != "high" for fault in faults if fault.causes)
    if fix is not None and advised.lead is None:
        faults = tuple(replace(fault, causes=as_in_fix(failed, fault, fix)) for fault in faults)
    faults = as_ranked(promised_causes(faults, promise), blamed.failure, 0.0 if advised.lead is None else UNSURE)
    report("done", 1.0)
    return Diagnosis(
        profile=choice,
        run=run,
        objectives=(*judged.results, *judged.checks),
        faults=faults,
        fix=fix,
        alternatives=advised.alternatives,
        odds_as_driven=None if fix is not None and fix.shown_by else as_driven,  # none measured, none told
        abstained=advised.abstained,
        why_this=advised.why or _why_this(fix, as_driven, hypotheses, faults),
        notes=notes_of(failed, broken, fix if advised.lead is None else None, as_driven),
        missions=judged.missions,
        rivals=circumstances(run, query, schema) if unsure and advised.lead is None else (),
        tell_more=_tell_more(failed, faults, advised, promise) if unsure and not any(unheard) else (),
        health=health,
        hypotheses=hypotheses,
        failure=blamed.failure,
        outside=blamed.outside,
    )


def _unheard(failed: FailedRun, broken: Sequence[ObjectiveResult], health: Health) -> list[str | None]:
    """Of each objective that was missed why training says nothing of it, None where it does."""
    refused = refused_otherwise(failed, health)
    return [refused or out_of_reach(failed, result) for result in broken]


def _within_limits(
    judged: Judged,
    schema: Schema,
    choice: ProfileChoice,
    run: Run,
    said: Mapping[str, Evidence],
    health: Health,
    good: Mapping[str, Setting] | None,
) -> Diagnosis:
    """The answer for a run that missed no objective of the profile, or of which none could be judged: what it failed in
    besides, and what explains that."""
    missed = [result for result in judged.checks if result.status == "fault"]
    outside = suspects_outside(run, missed, health, schema, good=good) if _failed(missed, health) else ()
    weights = _weights(outside)
    told = hypotheses_without_model(
        health.findings, missed=missed, shown=said, verdict=choice.fit.verdict, outside=weights
    )
    lead = leading_outside(told, outside, health.findings, run)
    fix = shown_fix(lead, run, health.findings) or shown_back(judged, schema, told, said, health.findings)
    return Diagnosis(
        choice,
        run,
        (*judged.results, *judged.checks),
        (),
        fix,
        notes=(*_set_wrong(judged, told, said), *(() if run.checks else (reference_note(judged),))),
        missions=judged.missions,
        health=health,
        abstained=None if lead is None or fix is not None else check_first(lead),
        hypotheses=told,
        outside=outside,
    )


def _why_this(fix: Fix | None, as_driven: float, hypotheses: Sequence[Hypothesis], faults: Sequence[Fault]) -> str:
    return "" if fix is None or fix.shown_by else explained(fix, as_driven, hypotheses, faults)


def _weights(outside: Sequence[OutsideSuspect]) -> dict[str, float]:
    return {one.name: one.weight for one in outside}


def _tell_more(failed: FailedRun, faults: tuple[Fault, ...], advised: Advised, promise: Promise) -> tuple[str, ...]:
    """How to find out more; of what is named already, what to record."""
    if advised.is_part_first or (advised.lead is not None and advised.fix is None):
        return to_record(faults, failed.run)
    promised = promise.as_driven() if advised.fix is None or advised.fix.odds is None else advised.fix.odds
    upset = was_upset(failed.run, failed.findings)
    return tell_more(
        failed.query,
        faults,
        failed.run,
        failed.unranked,
        observational=failed.profile.schema.observational,
        again=again(failed.run, upset=upset),
        nothing_else=bench(failed.run) if upset else SAME_AGAIN,
        all_back=all_back(failed, promise, promised),
    )


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
    explained = hypotheses_without_model(health.findings)
    return Diagnosis(choice, run, (), (), None, health=health, hypotheses=explained)


def without_profile(judged: Judged, choice: ProfileChoice, health: Health) -> Diagnosis:
    """The answer for a run that no profile fits: what it did and what failed, and no cause by parameters."""
    broken = tuple(result for result in judged.checks if result.status == "fault")
    outside = suspects_outside(judged.run, broken, health) if _failed(broken, health) else ()
    told = hypotheses_without_model(health.findings, missed=broken, outside=_weights(outside))
    lead = leading_outside(told, outside, health.findings, judged.run)
    fix = shown_fix(lead, judged.run, health.findings)
    return Diagnosis(
        choice,
        judged.run,
        judged.checks,
        tuple(Fault(result, ()) for result in broken),
        fix,
        missions=judged.missions,
        health=health,
        abstained=None if lead is None or fix is not None else check_first(lead),
        hypotheses=told,
        outside=outside,
    )


def _failed(missed: Sequence[ObjectiveResult], health: Health) -> bool:
    """Whether a run failed of which no model can be asked: by a check, or by what was found in it."""
    return bool(missed) or any(one.severity == "critical" for one in health.findings)
