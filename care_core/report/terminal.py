"""A diagnosis as plain text for a terminal: the answer first, then what it rests on."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
from pathlib import Path

from care_core.configs.changes import apply_commands, unified_diff
from care_core.configs.formats import format_for
from care_core.diagnose.records import Cause, Diagnosis, Fault, Fix, PathNode, first_named, told_in_full
from care_core.diagnose.verdict import STATUS_WORDS, Verdict, alone, chance, fit_text, promise, verdict_of
from care_core.report.health import EVENTS_SHOWN, finding_lines, reason_lines, telling, timeline_lines
from care_core.report.shared_causes import together
from care_core.report.wording import below
from care_core.run import Evidence, Value, gathered, is_known, place_of_damage
from care_core.text import but_for_numbers, listed, log_time, log_times, wrapped
from care_core.variables import Variable

EVIDENCE_SHOWN = 5
BEGINNING = 60
"""Letters by which a message is known again: what happened shortens it."""
_HOW_OFTEN = re.compile(r" \(\d+ times\)$")
DAMAGE_SHOWN = 5
CHANGES_SHOWN = 20
"""Of parameters that are no options of the profile; the options are all shown."""


def to_text(diagnosis: Diagnosis) -> str:
    """The diagnosis in lines of at most 80 columns (a diff or command may be longer: it is to be copied)."""
    health, verdict = diagnosis.health, verdict_of(diagnosis)
    sections = [
        _verdict(verdict),
        reason_lines(verdict.reasons),
        finding_lines(health.findings, health.timeline) if health.timeline or health.findings else (),
        timeline_lines(health.timeline, health.findings, health.robot),
        _origin(diagnosis),
        _missions(diagnosis),
        _objectives(diagnosis),
        *(_causes(faults, diagnosis) for faults in _explained(diagnosis)),
        _fix(diagnosis),
        _evidence(diagnosis),
        _since(diagnosis),
        _rivals(diagnosis),
        _tell_more(diagnosis),
        _notes(diagnosis),
    ]
    return "\n\n".join(text for text in ("\n".join(section) for section in sections) if text) + "\n"


def _verdict(verdict: Verdict) -> Iterator[str]:
    for line in verdict.lines:
        yield from wrapped(line)


def _origin(diagnosis: Diagnosis) -> Iterator[str]:
    run, profile = diagnosis.run, diagnosis.profile
    told = ("vehicle", "frame") if diagnosis.health.timeline else ()  # the account begins with them
    facts = "".join(f", {name} {fact}" for name, fact in run.log.facts.items() if name not in told)
    mission = f"{run.noun} {run.mission.index} of {run.mission.count}"
    duration = log_time(run.mission.end_s - run.mission.start_s, 0)
    which = f", {mission}" if run.mission.count else ""
    yield from wrapped(f"{Path(run.log.path).name}{which}, {duration}{facts}", "Log      ")
    if profile.name:
        yield from wrapped(f"{profile.title} {profile.version}: {profile.reason}", "Profile  ")
        if diagnosis.profile.fit.reasons:
            yield from wrapped(fit_text(profile.title, diagnosis.profile.fit), "Fit      ")
    elif diagnosis.profile.fit.verdict == "no":
        yield from wrapped("none fits", "Profile  ")
    for damage in run.log.damage[:DAMAGE_SHOWN]:
        label = "Note     " if damage.is_whole else "Damage   "
        yield from wrapped(damage.what + place_of_damage(damage.what, None, damage.time_s), label)
    if len(run.log.damage) > DAMAGE_SHOWN:
        rest = len(run.log.damage) - DAMAGE_SHOWN
        yield f"Damage   and {rest} more {'places' if rest > 1 else 'place'}, 'care inspect' lists them"


def _missions(diagnosis: Diagnosis) -> Iterator[str]:
    """Every mission of a log that holds several, with its verdict."""
    if len(diagnosis.missions) < 2:
        return
    yield f"{diagnosis.run.noun.capitalize()}s of this log"
    for verdict in diagnosis.missions:
        one = verdict.mission
        here = "  <- this report" if one.index == diagnosis.run.mission.index else ""
        span = f"{log_time(one.start_s, 0)} to {log_time(one.end_s, 0)}"
        reason = f": {verdict.reason}" if verdict.reason else ""
        yield from wrapped(f"{STATUS_WORDS[verdict.status]}, {span}{reason}{here}", f"  {one.index:>2}  ")


def _objectives(diagnosis: Diagnosis) -> Iterator[str]:
    if not diagnosis.objectives:
        return
    yield "Objectives"
    name_width = max((len(objective.variable.name) for objective in diagnosis.objectives), default=0)
    for reason, group in groupby(diagnosis.objectives, key=lambda objective: objective.reason):
        for objective in group:
            name, word = objective.variable.name, STATUS_WORDS[objective.status]
            value = "-" if objective.value is None else f"{objective.value:.4g}"
            bound = "" if objective.value is None or objective.threshold is None else f"{objective.threshold}"
            wanted = f"{bound} {objective.variable.unit if bound else ''}"
            yield f"  {word:<13}  {name:<{name_width}}  {value:>8}  {wanted}".rstrip()
            if objective.basis and objective.value is not None:
                yield from wrapped(objective.basis, " " * 17)
        if reason:
            yield from wrapped(reason, " " * 17)


def _explained(diagnosis: Diagnosis) -> list[Sequence[Fault]]:
    """Faults that share their causes together; none where no profile could name any, or a parameter explains them that
    none holds."""
    if diagnosis.profile.fit.verdict == "no":
        return []
    led = first_named(diagnosis.hypotheses)
    is_outside = led is not None and led.what == "parameter"
    return [faults for faults in together(diagnosis.faults, _paths) if faults[-1].causes or not is_outside]


def _paths(fault: Fault) -> list[list[str]]:
    return [[node.name for node in cause.path] for cause in fault.causes]


def _causes(faults: Sequence[Fault], diagnosis: Diagnosis) -> Iterator[str]:
    yield from wrapped(f"Causes of {listed([fault.objective.variable.name for fault in faults])}")
    fault = faults[-1]
    named = [cause for cause in fault.causes if not cause.is_lead]
    shown = [cause for cause in named if not _is_unlikely(cause, diagnosis)]
    if not named:
        yield "  none of the profile's parameters is likely"
    for cause in shown:
        yield from _cause(cause, diagnosis.odds_as_driven)
    if unlikely := [cause.option.name for cause in named if cause not in shown]:
        yield from wrapped(below(unlikely, after=len(shown)), "  ", "    ")
    leads = [f"{c.option.name} ({c.option.driven(c.current, c.is_assumed)})" for c in fault.causes if c.is_lead]
    if leads:
        yield from wrapped(f"not ruled out, as driven: {', '.join(leads)}", "  ", "    ")


def _is_unlikely(cause: Cause, diagnosis: Diagnosis) -> bool:
    changed = {change.option.name for fix in (diagnosis.fix, *diagnosis.alternatives) if fix for change in fix.changes}
    return not told_in_full(cause.option.name, diagnosis.hypotheses, changed)


def _cause(cause: Cause, as_driven: float | None) -> Iterator[str]:
    option = cause.option
    change = option.driven(cause.current, cause.is_assumed)
    if cause.suggested is not None:
        change += f" -> {option.show(cause.suggested)}"
    facts = [f"{cause.confidence} confidence"]
    if cause.p_fixed is not None:
        facts.append(alone(cause.p_fixed, as_driven))
    if not cause.in_support:
        facts.append("outside the training runs")
    yield from wrapped(f"{option.name}  {change} {option.unit}  ({', '.join(facts)})", f"  {cause.rank}. ")
    yield from wrapped(" -> ".join(node.name for node in cause.path), "     ", "       ")
    for node in cause.path[1:]:
        if node.value is not None or node.expected is not None:
            yield from wrapped(_node(node), "       ", "         ")
    for note in cause.notes:
        yield from wrapped(note.text, "     ! ")


def _node(node: PathNode) -> str:
    here = "unknown" if node.value is None else f"{node.value:.4g} {node.unit}".rstrip()
    expected = "" if node.expected is None else f", {node.expected:.3g} expected"
    return f"{node.name}: {here} in this run{expected}"


def _fix(diagnosis: Diagnosis) -> Iterator[str]:
    fix = diagnosis.fix
    if fix is None:
        return
    as_driven = diagnosis.odds_as_driven
    title = "Fix, chosen by hand" if fix.by_hand else "Fix"
    yield from wrapped(f"{title} ({promise(fix.odds, as_driven, fix.is_guess)})")
    if fix.why_not_measured:
        yield from wrapped(f"odds not measured: {fix.why_not_measured}", "  ", "    ")
    for change in fix.changes:
        option = change.option
        restart = ", needs a restart" if option.reboot_required else ""
        values = f"{change.values} {option.unit}".rstrip()
        yield from wrapped(f"{option.name}  {values}{restart}", "  ", "    ")
        for note in change.notes:
            yield from wrapped(note, "    ! ")
    for objective in (result.variable for result in diagnosis.objectives):
        if objective.name in fix.predicted:
            yield from wrapped(_prediction(objective, fix, diagnosis.run.objectives), "  ", "    ")
    for other in diagnosis.alternatives:
        likely = promise(other.odds, as_driven, other.is_guess)
        yield from wrapped(f"or {', '.join(map(str, other.changes))}: {likely}", "  ", "     ")
    yield ""
    diff = unified_diff(diagnosis.run, fix.changes, by_hand=fix.by_hand)
    yield from (f"  {line}" for line in diff.splitlines())
    yield ""
    yield from (
        f"  {line}"
        for line in apply_commands(fix.changes, format_for(diagnosis.run.log.format, diagnosis.run.settings))
    )


def _prediction(objective: Variable, fix: Fix, had: Mapping[str, Value]) -> str:
    """A yes-or-no objective has a probability, any other a value beside that of this run: what the change costs."""
    predicted, value = fix.predicted[objective.name], had.get(objective.name)
    likely = None if predicted.p_ok is None else chance(predicted.p_ok, fix.is_guess)
    probability = likely or STATUS_WORDS[predicted.status()]
    if objective.kind == "functional":
        return f"predicted {objective.name}: {probability}"
    interval = f"{predicted.value:.4g} ({predicted.low:.4g} to {predicted.high:.4g}) {objective.unit}".rstrip()
    now = f" (now {value:.4g})" if is_known(value) else ""
    return f"predicted {objective.name}: {interval}{now}, {probability}"


def _evidence(diagnosis: Diagnosis) -> Iterator[str]:
    evidence = _untold(diagnosis)
    if not evidence or not diagnosis.faults:
        return
    yield "Messages of this run"
    shown = evidence[-EVIDENCE_SHOWN:]
    for time, item in zip(log_times([item.time_s for item in shown]), shown, strict=True):
        says = f": {item.says}" if item.says else ""
        points = f" (points at {', '.join(item.options)})" if item.options else ""
        yield from wrapped(f"{item.text}{says}{points}", f"  {time:>9}  ")


def _untold(diagnosis: Diagnosis) -> list[Evidence]:
    """The robot's own messages that stand nowhere above: not in what happened, and not beside a cause."""
    health = diagnosis.health
    happened = [but_for_numbers(one.text) for one in telling(health.timeline, EVENTS_SHOWN, health.findings)]
    shown = (c for fault in diagnosis.faults for c in fault.causes if not c.is_lead and not _is_unlikely(c, diagnosis))
    named = {cause.option.name for cause in shown}
    own = (one for one in diagnosis.run.evidence if not one.is_concluded and named.isdisjoint(one.options))
    return list(gathered(one for one in own if not any(_start(one.text) in event for event in happened)))


def _start(message: str) -> str:
    """As much of a message as what happened tells of a long one, without how often it came."""
    return but_for_numbers(_HOW_OFTEN.sub("", message))[:BEGINNING]


def _rivals(diagnosis: Diagnosis) -> Iterator[str]:
    if diagnosis.rivals:
        yield "It may not be a parameter"
    for rival in diagnosis.rivals:
        yield from wrapped(f"{rival.name}: {rival.text}", "  - ")


def _tell_more(diagnosis: Diagnosis) -> Iterator[str]:
    if diagnosis.tell_more:
        yield "How to find out more"
    for advice in diagnosis.tell_more:
        yield from wrapped(advice, "  - ")


def _since(diagnosis: Diagnosis) -> Iterator[str]:
    since = diagnosis.since
    if since is None:
        return
    yield from wrapped(f"Changed since {Path(since.log).name}")
    for warning in since.warnings:
        yield from wrapped(warning, "  ! ")
    options = [change for change in since.changes if change.option is not None]
    others = [change for change in since.changes if change.option is None]
    for change in (*options, *others[:CHANGES_SHOWN]):
        named = "" if change.option is None or change.option.name == change.parameter else f" ({change.option.name})"
        yield from wrapped(f"{change.parameter}{named}  {change.text}", "  ", "    ")
    if len(others) > CHANGES_SHOWN:
        yield f"  and {len(others) - CHANGES_SHOWN} more, which the profile does not model; --json lists them"
    if not since.changes:
        yield "  no parameter that anybody sets"


def _notes(diagnosis: Diagnosis) -> Iterator[str]:
    if diagnosis.notes:
        yield "Notes"
    for note in diagnosis.notes:
        yield from wrapped(note, "  - ")
