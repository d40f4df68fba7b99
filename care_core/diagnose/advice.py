"""What is advised of a failed run: the fixes, the advised one first, or why none is."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence

from care_core.causal.counterfactual import CounterfactualQuery
from care_core.diagnose.blame import Blame
from care_core.diagnose.causes import MIN_CONTRIBUTION
from care_core.diagnose.circumstances import battery_is_low
from care_core.diagnose.estimates import NECESSARY, WORTH
from care_core.diagnose.failed_run import FailedRun
from care_core.diagnose.fixes import (
    GAIN_FOR_ONE_MORE,
    MAX_ALTERNATIVES,
    Assignment,
    is_needed,
    needs_unsafe,
    search,
    settled,
    smallest_good,
    to_fix,
)
from care_core.diagnose.judging import Judged
from care_core.diagnose.next_step import KEPT
from care_core.diagnose.outside.change import (
    ENOUGH,
    Advisable,
    asked_beside,
    asked_by_findings,
    check_first,
    leading_outside,
    outside_fix,
)
from care_core.diagnose.parts import mend_first, set_wrong, unmended, was_refused
from care_core.diagnose.promise import Promise
from care_core.diagnose.ranking import deviating
from care_core.diagnose.records import Fault, Fix, Hypothesis
from care_core.diagnose.remedies import CHARGE
from care_core.diagnose.tell_more import AllBack
from care_core.diagnose.worth import (
    LOOK_FIRST,
    falls_short,
    is_worth,
    nearest,
    no_stand_out,
    outweighed,
    promised,
    unrecorded,
    untried,
)
from care_core.ecosystems.findings import Finding, Severity, every_finding
from care_core.profile.schema import Schema
from care_core.records import Record, replace
from care_core.run import Evidence
from care_core.text import percent
from care_core.variables import Change

BESIDE = 0.3
"""Share of the leading parameter's probability from which an option is changed with it."""
MOST_LIKELY = 0.5
"""Probability of a parameter over which it is likelier than all else together."""
MIN_PROBABILITY = 0.2
"""Best probability below which the engine abstains: a confident wrong answer costs a field day."""


class Advised(Record):
    """The fixes, the advised one first, or why none is advised."""

    fixes: Sequence[Fix]
    abstained: str | None
    why: str = ""
    lead: Advisable | None = None
    """The parameter outside the profile of which it is, None where options of the profile were searched."""
    is_part_first: bool = False
    """Whether a part comes before any change."""

    @property
    def fix(self) -> Fix | None:
        """The advised one."""
        return None if self.abstained else self.fixes[0]

    @property
    def alternatives(self) -> tuple[Fix, ...]:
        """What else may be changed instead."""
        return () if self.abstained else tuple(self.fixes[1:])


def advise(
    failed: FailedRun,
    judged: Judged,
    faults: tuple[Fault, ...],
    blamed: Blame,
    hypotheses: Sequence[Hypothesis],
    promise: Promise,
    unheard: str | None,
) -> Advised:
    """What is advised of a failed run: what leads the ranking decides whether it is of a parameter outside the profile,
    of a part or of the options.

    Args:
        unheard: why training says nothing of this failure, None where it does.
    """
    part = part_first(failed, failed.findings)
    lead = leading_outside(hypotheses, blamed.outside, failed.findings, failed.run)
    if lead is not None and (part is None or lead.is_found):
        advised = of_outside(lead, failed, hypotheses, promise)
    else:
        failed_part = part and unmended(part, likelier_than(part, hypotheses, failed))
        against = failed_part or outweighed(hypotheses, failed.findings)
        options = {suspect.option for group in blamed.ranked.values() for suspect in group}
        advised = of_options(failed, judged, faults, hypotheses, options, promise, against, unheard)
        is_part_first = bool(failed_part) or (against or "").endswith(LOOK_FIRST)
        advised = replace(advised, is_part_first=is_part_first)
    return with_refusals(advised, failed, promise)


def of_outside(lead: Advisable, failed: FailedRun, hypotheses: Sequence[Hypothesis], promise: Promise) -> Advised:
    """What is advised of a parameter outside the profile that leads the ranking, with the options that stand beside
    it."""
    if not lead.is_advised:
        return Advised((), check_first(lead), lead=lead)
    query = failed.query
    beside = _beside(lead, failed, hypotheses, promise)
    odds = _without(failed, promise, [lead.name], beside)
    changes = to_fix(query, beside, odds).changes if beside else ()
    fix = outside_fix(lead, odds, failed.run, changes)
    return Advised((fix, *_with_one_more(lead, failed, beside, odds, promise)), None, lead.why, lead)


def _with_one_more(
    lead: Advisable, failed: FailedRun, beside: Assignment, odds: float, promise: Promise
) -> Iterator[Fix]:
    """The same with the option put back that adds most to the odds: of a vehicle that was refused, whose mission is
    still before it, and of an option that is likelier not needed."""
    free = _free(failed)
    sets = [{**beside, name: free[name]} for name in sorted(free.keys() - beside)]
    reached = [_without(failed, promise, [lead.name], options) for options in sets]
    if reached and (most := max(reached)) >= odds + GAIN_FOR_ONE_MORE:
        options = sets[reached.index(most)]
        yield outside_fix(lead, most, failed.run, to_fix(failed.query, options, most).changes)


def _free(failed: FailedRun) -> dict[str, float]:
    """The options off their reference that a change may put back, with their references."""
    query = failed.query
    off = failed.off - query.kept - failsafes_held(failed, failed.findings)
    return {name: value for name in sorted(off) if query.variables[name].accepts(value := query.reference[name])}


def with_refusals(advised: Advised, failed: FailedRun, promise: Promise) -> Advised:
    """The advised change of a vehicle that never armed with what else its findings ask for: two checks that refuse it
    both have to pass. A parameter that one names has one value, the one that it says."""
    if advised.abstained is not None or not advised.fixes or not was_refused(failed.findings):
        return advised
    fix = _as_asked(advised.fixes[0], failed, promise)
    advised = replace(advised, fixes=(fix, *advised.fixes[1:]))
    named = {change.option.name: change.suggested for change in fix.changes}
    more = asked_beside(failed.findings, failed.run, {*named, *failed.query.config})
    if not more:
        return advised
    outside = [*(named.keys() - failed.query.config), *(change.option.name for change in more)]
    options = {name: value for name, value in named.items() if name in failed.query.config}
    odds = _without(failed, promise, outside, options)
    return replace(advised, fixes=(replace(fix, changes=(*fix.changes, *more), p_fixed=odds), *advised.fixes[1:]))


def _as_asked(fix: Fix, failed: FailedRun, promise: Promise) -> Fix:
    """The fix with the values that findings ask for, where they name its options."""
    query, asked = failed.query, asked_by_findings(failed.findings)
    changed = {one.option.name: one.suggested for one in fix.changes}
    if fix.shown_by or changed.keys() - query.config:
        return fix
    wanted = {name: asked[name] for name in changed if name in asked and query.variables[name].accepts(asked[name])}
    config = {**changed, **wanted}
    if config == changed:
        return fix
    return to_fix(query, config, float(promise.odds([{**query.config, **config}])[0]))


def _without(failed: FailedRun, promise: Promise, outside: Collection[str], options: Assignment) -> float:
    """Probability that the next run meets every limit with these options changed, and parameters right that the profile
    does not know. A vehicle that was refused has its mission still before it."""
    query = failed.query
    config = {**query.config, **options}
    odds = promise.without(outside, config)
    if was_refused(failed.findings):
        odds *= float(query.unobserved().probability([config])[0])
    return odds


def _beside(lead: Advisable, failed: FailedRun, hypotheses: Sequence[Hypothesis], promise: Promise) -> dict[str, float]:
    """The options that go back to their reference with a parameter outside the profile: those that are about as likely,
    and those without which its change promises much less."""
    query = failed.query
    likely = {one.name for one in hypotheses if one.what == "parameter" and one.acts >= BESIDE * lead.probability}
    free = _free(failed)
    chosen = {name: value for name, value in free.items() if name in likely}
    while rest := free.keys() - chosen:
        now = promise.without([lead.name], {**query.config, **chosen})
        odds = {
            name: promise.without([lead.name], {**query.config, **chosen, name: free[name]}) for name in sorted(rest)
        }
        best = max(odds, key=lambda name: odds[name])
        if not is_needed(now, odds[best]):
            break
        chosen[best] = free[best]
    return chosen


def of_options(
    failed: FailedRun,
    judged: Judged,
    faults: tuple[Fault, ...],
    hypotheses: Sequence[Hypothesis],
    options: Collection[str],
    promise: Promise,
    against: str | None,
    unheard: str | None,
) -> Advised:
    """What is advised of the options of the profile.

    Args:
        options: those that may have moved what broke.
        against: why nothing is advised whatever is found, None where nothing stands against it.
        unheard: why training says nothing of this failure, None where it does. What the run itself shows is heard.
    """
    broken, as_driven = judged.broken, promise.as_driven()
    held = failsafes_held(failed, failed.findings)
    held_too = held | _leads(faults)
    found = _fixes(failed, options, held_too, promise)
    if idle := _idle(judged, found[:1], promise):
        found = _fixes(failed, options, held_too | idle, promise)
    fixes = promised(found, promise)
    if against is not None:
        return Advised(fixes, against)
    abstained = (
        unheard
        or _abstains(failed, faults, fixes, held, promise)
        or falls_short(fixes[0], broken, as_driven)
        or untried(fixes[0], failed.profile.schema.learned_elsewhere)
        or unrecorded(fixes[0], failed.choice.fit.verdict)
        or no_stand_out(fixes[0], as_driven, hypotheses, _necessary(promise, fixes[0]))
    )
    shown = None if abstained is None else _shown_by_run(failed, hypotheses)
    return Advised(fixes, abstained) if shown is None else Advised((shown,), None)


def _fixes(failed: FailedRun, options: Collection[str], held: Collection[str], promise: Promise) -> list[Fix]:
    """The suggested fix first, then up to three that trade changes for probability or take another way.

    Args:
        held: options that are not changed.
    """
    # Options off their reference that break another objective matter too once this fault is gone.
    off = deviating(failed.query.config, failed.query.reference)
    free = sorted({*options, *(name for name in off if _has_effect(failed, name))} - {*held, *failed.query.kept})
    found = _as_promised(search(failed.query, free), promise)
    if not found:
        return []
    at = smallest_good(found)
    chosen, others = found[at], [found[i] for i in (at - 1, at + 1) if 0 <= i < len(found)]
    without = [name for name in free if name not in chosen[0]]
    if detour := _as_promised(search(failed.query, without), promise):
        way = detour[smallest_good(detour)]
        # the search goes by this run, the promise by the next one: it may prefer the other way
        is_better = way[1] > chosen[1] and len(way[0]) <= len(chosen[0])
        chosen, others = (way, [chosen, *others]) if is_better else (chosen, [*others, way])
    useful = [pair for pair in sorted(others, key=lambda pair: -pair[1]) if _is_choice(pair, chosen)]
    ranked = [chosen, *useful[:MAX_ALTERNATIVES]]
    fixes = [to_fix(failed.query, *settled(failed.query, assignment)) for assignment, _probability in ranked]
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


def _has_effect(failed: FailedRun, option: str) -> bool:
    effects = failed.query.model.effects
    return any(effects[key].identified and effects[key].effect > 0 for key in effects if key[0] == option)


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


def _leads(faults: Sequence[Fault]) -> set[str]:
    """Options that are only not ruled out: no fix changes them."""
    causes = [cause for fault in faults for cause in fault.causes]
    return {one.option.name for one in causes if one.is_lead} - {one.option.name for one in causes if not one.is_lead}


def _abstains(
    failed: FailedRun, faults: tuple[Fault, ...], fixes: Sequence[Fix], held: Collection[str], promise: Promise
) -> str | None:
    as_driven = promise.as_driven()
    names = [fault.objective.variable.name for fault in faults]
    unknown = [name for name in names if name not in failed.query.model.outcomes]
    if unknown:
        return f"too few training missions to predict {', '.join(unknown)}: the causes are named, no change is promised"
    for fault in faults:
        rival = next(iter(failed.unranked[fault.objective.variable.name]), None)
        if rival is not None and rival.weight > max((cause.contribution for cause in fault.causes), default=0.0):
            return f"'{rival.option}' is as likely a cause, and the training runs cannot tell what it does"
    has_cause = any(not cause.is_lead for fault in faults for cause in fault.causes)
    if has_cause and fixes and is_worth(fixes[0], as_driven):
        return None
    if any(cause.option.name in held for fault in faults for cause in fault.causes if not cause.is_lead):
        return f"{CHARGE} first: {', '.join(sorted(held))} is not lowered while it is not full"
    now = float(failed.query.probability([failed.query.config])[0])
    unsafe = needs_unsafe(failed.query, max(MIN_PROBABILITY, now + WORTH.value))
    if unsafe is not None:
        return f"only '{unsafe}' past its default is likely to help, and a safety parameter is never made looser"
    if not failed.run.config:
        return "not one of the parameters that this profile knows is in the log, and no file tells them"
    if not has_cause:
        return (
            "no parameter that this profile models explains the fault: look at what the run met "
            "(wind, battery, positioning, obstacles) or at parameters outside the profile"
        )
    pinned = f", with {', '.join(sorted(failed.query.kept))}{KEPT}" if failed.query.kept else ""
    broken = [fault.objective for fault in faults]
    best = nearest(promised(_resets(failed, faults), promise), broken)
    short = falls_short(best, broken, as_driven) if best else None
    return f"{short or 'no change inside the acceptable ranges is likely enough to meet every limit'}{pinned}"


def _resets(failed: FailedRun, faults: tuple[Fault, ...]) -> list[Fix]:
    """Each named cause back at its reference, and all of them: where every probability is about zero, what comes
    nearest to the limits is told by its values."""
    query = failed.query
    named = dict.fromkeys(cause.option.name for fault in faults for cause in fault.causes if not cause.is_lead)
    free = [name for name in named if name not in query.kept and query.config[name] != query.reference[name]]
    sets = [[name] for name in free] + ([free] if len(free) > 1 else [])
    resets = [{name: query.reference[name] for name in names} for names in sets]
    return [to_fix(query, one, float(query.probability([{**query.config, **one}])[0])) for one in resets]


def _shown_by_run(failed: FailedRun, hypotheses: Sequence[Hypothesis]) -> Fix | None:
    """The parameters that a finding of this run names, back at their reference: what it shows is worth a change where
    training says little of it, though nothing says what that promises. None where none stands above chance; of a
    warning they have to be likelier than all else, and the limits such as the reference meets."""
    query, (title, named) = failed.query, _named_by_run(failed, "critical")
    if not named:
        title, named = _named_by_run(failed, "warning")
        acts = {one.name for one in hypotheses if one.what == "parameter" and one.probability > MOST_LIKELY}
        named = named if acts & set(named) and _reference_meets(query) else ()
    if not named or failed.profile.schema.learned_elsewhere:
        return None
    chance = sum(one.probability for one in hypotheses if one.what == "chance")
    likely = {one.name for one in hypotheses if one.what == "parameter" and one.probability > chance}
    back = {name: query.reference[name] for name in named if name not in query.kept}
    if not likely & back.keys() or not all(query.variables[name].accepts(value) for name, value in back.items()):
        return None
    fix = to_fix(query, back, float(query.probability([{**query.config, **back}])[0]))
    return replace(fix, predicted={}, shown_by=title)


def _reference_meets(query: CounterfactualQuery) -> bool:
    """Whether the reference configuration mostly meets every limit: one out of reach no change meets."""
    return float(query.unobserved().probability([query.reference])[0]) > MOST_LIKELY


def _named_by_run(failed: FailedRun, severity: Severity) -> tuple[str, Collection[str]]:
    """The first finding so severe that names options off their reference, by the profile's rules or by itself."""
    for finding in (one for one in failed.findings if one.severity == severity and set_wrong(one)):
        said = (e.options for e in failed.run.evidence if e.text == finding.title)
        named = next(said, finding.parameters)
        if named and failed.off.issuperset(named):
            return finding.title, named
    return "", ()


def all_back(failed: FailedRun, promise: Promise, advised: float) -> AllBack | None:
    """Everything at its reference, where that promises more than the advised change, by as much as is worth one."""
    query, held = failed.query, failsafes_held(failed, failed.findings)
    off = sorted(failed.off - query.kept - held)
    back = {name: value for name in off if query.variables[name].accepts(value := query.reference[name])}
    if len(back) < 2 or failed.profile.schema.learned_elsewhere:
        return None
    odds = float(promise.odds([{**query.config, **back}])[0])
    return AllBack(len(back), odds) if odds >= max(advised + WORTH.value, MIN_PROBABILITY) else None


def part_first(failed: FailedRun, findings: Sequence[Finding]) -> Finding | None:
    """The part that comes before any parameter. A battery that is known to be full kept no vehicle from arming."""
    part = mend_first(findings)
    is_full = battery_is_low(failed.run, failed.query.model, failed.profile.schema) is False
    return None if part is not None and part.kind == "prearm" and is_full else part


def likelier_than(part: Finding, hypotheses: Sequence[Hypothesis], failed: FailedRun) -> str:
    """What is changed once a part is mended, since it is likelier the cause than that; empty where nothing is."""
    query, first = failed.query, next(iter(hypotheses), None)
    if first is None or first.what != "parameter" or first.name not in failed.off - query.kept:
        return ""
    rival = sum(one.probability for one in hypotheses if one.name == part.title)
    if first.probability < ENOUGH or first.probability <= rival:
        return ""
    option = query.variables[first.name]
    values = (option.show(config[first.name]) for config in (query.config, query.reference))
    return f"then put {first.name} back from {' to '.join(values)}, {percent(first.probability)} the cause"


def shown_back(
    judged: Judged,
    schema: Schema,
    explained: Sequence[Hypothesis],
    said: Mapping[str, Evidence],
    findings: Sequence[Finding],
) -> Fix | None:
    """The option that leads the explanations and that a critical finding speaks of, back at its reference, where no
    objective could be judged and nothing has odds; None where there is none."""
    first = next(iter(explained), None)
    option = next((one for one in schema.options if first is not None and one.name == first.name), None)
    if first is None or option is None or first.what != "parameter" or first.probability < ENOUGH:
        return None
    grave = {one.title for one in findings if one.severity == "critical"}
    shown_by = next((title for title, one in said.items() if title in grave and option.name in one.options), None)
    driven, reference = judged.run.config, judged.reference.config
    back = reference.get(option.name)
    if shown_by is None or back is None or option.safety or not option.accepts(back):
        return None
    if option.name not in deviating(driven, reference):
        return None
    return Fix((Change(option, driven[option.name], back),), first.probability, {}, shown_by=shown_by)


def failsafes_held(failed: FailedRun, findings: Sequence[Finding]) -> frozenset[str]:
    """The battery failsafes, where the battery may not have been full or well: they are lowered for no such flight."""
    suspected = any(
        one.kind == "battery" and one.suspect != "parameter" and one.severity != "info" and not one.after_impact
        for one in every_finding(findings)
    )
    if not suspected and not battery_is_low(failed.run, failed.query.model, failed.profile.schema):
        return frozenset()
    return frozenset(one.name for one in failed.profile.schema.options if one.safety and one.unit == "V")
