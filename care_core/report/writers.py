"""The report in the formats that files have."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from io import StringIO
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.scalarstring import LiteralScalarString

from care_core.diagnose.records import Status, overall
from care_core.report.document import (
    CauseEntry,
    FixEntry,
    FixSet,
    ObjectiveEntry,
    PredictedValue,
    Report,
    SinceEntry,
    TriageDocument,
    wanted_text,
)
from care_core.report.happened import finding_sentence
from care_core.report.together import listed, together
from care_core.report.wording import SEVERITY_WORDS, chance, fit_text, hypothesis_text, noted, said_without_profile
from care_core.run import shown
from care_core.text import seconds
from care_core.variables import ASSUMED

STATUS_WORDS = {"ok": "OK", "fault": "FAULT", "not_evaluated": "NOT EVALUATED"}

_PUBLISHED = set(TriageDocument.model_fields)
_YAML_WIDTH = 100
_DAMAGE_SHOWN = 5
_MARKDOWN_SPECIAL = re.compile(r"([\\`*_{}\[\]<>#|~])")


def to_json(report: Report) -> str:
    """The document `care.triage/1`, one object."""
    return report.model_dump_json(by_alias=True, include=_PUBLISHED, indent=2) + "\n"


def published(report: Report) -> dict[str, Any]:
    """The document `care.triage/1` as plain values."""
    return report.model_dump(by_alias=True, include=_PUBLISHED, mode="json")


def to_yaml(report: Report) -> str:
    """The document with the unified diff and the commands that apply it, below how well the profile fits."""
    data = report.model_dump(by_alias=True)
    if report.diff:
        data["diff"] = LiteralScalarString(report.diff)
    yaml = YAML()
    yaml.width = _YAML_WIDTH
    stream = StringIO()
    yaml.dump(data, stream)
    return f"# {fit_text(report.profile.name if report.profile else '', report.fit)}\n{stream.getvalue()}"


def to_markdown(report: Report) -> str:
    """A report to paste into a ticket."""
    return "\n".join(_markdown(report)) + "\n"


def _markdown(report: Report) -> Iterator[str]:
    yield f"# Triage of {_escape(Path(report.log.path).name)}"
    yield ""
    yield _escape(fit_text(report.profile.name if report.profile else "", report.fit)) + "."
    yield ""
    yield _verdict(report)
    yield from _listed("What explains it", (f"{h.probability:.0%}: {hypothesis_text(h)}" for h in report.hypotheses))
    told = (f"{SEVERITY_WORDS[one.severity]}: {finding_sentence(one)}" for one in noted(report.findings))
    yield from _listed("Findings, the first cause first", told)
    if report.account:
        yield from ("", "## What happened", "")
        rows = ((seconds(one.time_s), _escape(one.text), f"`{one.source}`") for one in report.account)
        yield from _table(("Time", "What", "Source"), rows)
    if report.objectives:
        yield from ("", "## Objectives", "")
        yield from _table(("Objective", "Value", "Wanted", "Status", "Why"), map(_objective_row, report.objectives))
    for faults in together(report.faults, lambda fault: [cause.path for cause in fault.causes]):
        fault = faults[-1]
        yield ""
        yield f"## Causes of {listed([f'`{one.objective}`' for one in faults])}"
        yield ""
        if fault.causes:
            yield from _table(
                ("", "Option", "Path", "Driven", "Suggested", "Probability"), map(_cause_row, fault.causes)
            )
        else:
            yield "None was found among the options of the profile."
    if report.fix is not None:
        yield ""
        yield from _fix_section(report, report.fix)
    if report.since is not None:
        yield ""
        yield from _since_section(report.since)
    yield from _listed("It may be no parameter", (f"{one.circumstance}: {one.text}" for one in report.rivals))
    yield from _listed("What would tell more", report.tell_more)
    yield from _listed("Set aside by the operator", (f"{one.option}: {one.reason}" for one in report.dismissed))
    yield from _listed("Notes", report.notes)
    yield ""
    yield from _origin(report)


def _listed(title: str, sentences: Iterable[str]) -> Iterator[str]:
    lines = [f"- {_escape(sentence)}" for sentence in sentences]
    if lines:
        yield from ("", f"## {title}", "", *lines)


def plain_verdict(report: Report) -> tuple[Status, str]:
    """The verdict of a document on a run that no profile fits, and what it says."""
    severities = {one.severity for one in report.findings}
    status = overall({one.status for one in report.objectives}, severities, report.fit.verdict)
    worst = [one.title for one in report.findings if one.severity == "critical" and not one.after_impact]
    return status, said_without_profile(status, report.objectives, worst, report.findings)


def _verdict(report: Report) -> str:
    if report.fit.verdict == "no":
        status, said = plain_verdict(report)
        return f"**{STATUS_WORDS[status].capitalize()}**: {_escape(said)}."
    broken = [objective.name for objective in report.objectives if objective.status == "fault"]
    names = ", ".join(f"`{name}`" for name in broken)
    if report.abstained:
        found = f"**Fault**: {names}. " if broken else ""
        return f"{found}**No change advised**: {_escape(report.abstained)}"
    worst = [_escape(one.title) for one in report.findings if one.severity == "critical" and not one.after_impact]
    if not broken and worst:
        return f"**Fault**: {'; '.join(worst)}."
    if not broken:
        unknown = any(objective.status == "not_evaluated" for objective in report.objectives)
        return "**No fault found**, but not everything could be evaluated." if unknown else "**No fault found.**"
    if report.fix is None:
        return f"**Fault**: {names}."
    fix = report.fix
    likely = f"{chance(fix.p_fixed, fix.guess)} that all objectives are met"
    return f"**Fault**: {names}. Change {_changes(fix)}: {likely}."


def _changes(fix: FixSet) -> str:
    return ", ".join(f"`{change.option}` {change.values}" for change in fix.changes)


def _objective_row(objective: ObjectiveEntry) -> tuple[str, ...]:
    value = "" if objective.value is None else f"{objective.value:.4g} {objective.unit}".strip()
    reason = _escape(objective.reason or "")
    return f"`{objective.name}`", value, _escape(wanted_text(objective)), STATUS_WORDS[objective.status], reason


def _cause_row(cause: CauseEntry) -> tuple[str, ...]:
    suggested = "" if cause.suggested is None else f"{cause.suggested:g}"
    probability = cause.confidence if cause.p_fixed is None else f"{cause.p_fixed:.0%}, {cause.confidence}"
    if not cause.in_support:
        probability += ", outside the training runs"
    driven = f"{cause.current:g}{ASSUMED if cause.assumed else ''}"
    return str(cause.rank), f"`{cause.option}`", " → ".join(cause.path), driven, suggested, probability


def _fix_section(report: Report, fix: FixEntry) -> Iterator[str]:
    yield "## Fix"
    yield ""
    objectives = {objective.name: objective for objective in report.objectives}
    rows = (
        (f"`{name}`", _prediction(objectives[name], predicted, fix.guess), STATUS_WORDS[predicted.status])
        for name, predicted in fix.predicted.items()
    )
    yield from _table(("Objective", "Predicted (80 %)", "Status"), rows)
    yield ""
    yield "```diff"
    yield report.diff.rstrip("\n")
    yield "```"
    yield ""
    yield "```sh"
    yield from report.apply
    yield "```"
    if fix.alternatives:
        yield ""
        yield "Or:"
        yield ""
        yield from (f"- {_changes(other)}: {chance(other.p_fixed, other.guess)}" for other in fix.alternatives)


def _since_section(since: SinceEntry) -> Iterator[str]:
    yield f"## Changed since {_code(Path(since.log).name)}"
    yield ""
    if since.warnings:
        yield from (f"- {_escape(warning)}" for warning in since.warnings)
        yield ""
    if not since.changes:
        yield "No parameter that anybody sets."
        return
    rows = (
        (_code(change.parameter), change.option or "", _escape(shown(change.from_)), _escape(shown(change.to)))
        for change in since.changes
    )
    yield from _table(("Parameter", "Option", "Then", "Now"), rows)


def _prediction(objective: ObjectiveEntry, predicted: PredictedValue, is_guess: bool) -> str:
    """A yes-or-no objective has a probability, not a value."""
    if objective.kind == "functional":
        return chance(predicted.value, is_guess)
    return f"{predicted.value:.4g} ({predicted.low:.4g} to {predicted.high:.4g}) {objective.unit}".rstrip()


def _origin(report: Report) -> Iterator[str]:
    log, profile = report.log, report.profile
    yield f"Log {_code(log.path)}, {log.format}, {log.duration_s:.0f} s, SHA-256 `{log.sha256}`."
    if profile is not None:
        yield f"Profile {profile.name} {profile.version} ({profile.platform})."
    for damage in log.damage[:_DAMAGE_SHOWN]:
        yield f"Damage: {_escape(damage.what)}."
    if len(log.damage) > _DAMAGE_SHOWN:
        yield f"Damage: {len(log.damage) - _DAMAGE_SHOWN} more places."


def _table(heads: Iterable[str], rows: Iterable[Iterable[str]]) -> Iterator[str]:
    heads = tuple(heads)
    yield f"| {' | '.join(heads)} |"
    yield f"|{'---|' * len(heads)}"
    for row in rows:
        yield f"| {' | '.join(row)} |"


def _escape(text: str) -> str:
    return _MARKDOWN_SPECIAL.sub(r"\\\1", text)


def _code(text: str) -> str:
    """A code span: nothing in it is escaped, so its fence is longer than any run of backticks inside."""
    fence = "`" * (1 + max(map(len, re.findall("`+", text)), default=0))
    pad = " " if "`" in text else ""
    return f"{fence}{pad}{text}{pad}{fence}"
