"""The report as one HTML file that needs nothing else: no script, no font, no picture from elsewhere.

Every text goes through `escape`, whoever wrote it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from html import escape
from pathlib import Path

from care_core.report.document import (
    CauseEntry,
    FixEntry,
    FixSet,
    ObjectiveEntry,
    PredictedObjective,
    Report,
    SinceEntry,
    wanted_text,
)
from care_core.report.happened import finding_sentence
from care_core.report.together import listed, together
from care_core.report.wording import SEVERITY_WORDS, chance, fit_text, hypothesis_text, noted
from care_core.report.writers import STATUS_WORDS, plain_verdict
from care_core.run import shown
from care_core.text import seconds
from care_core.variables import ASSUMED

_STYLE = """
:root { color-scheme: light dark; --line: #8886; --ok: #16803c; --fault: #c0261c; --unknown: #9a6a00; }
@media (prefers-color-scheme: dark) { :root { --ok: #5fd38d; --fault: #ff8a80; --unknown: #ffc14d; } }
body { font: 16px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; }
table { border-collapse: collapse; width: 100%; margin: .5rem 0 1rem; }
th, td { text-align: left; vertical-align: top; padding: .3rem .8rem .3rem 0; border-bottom: 1px solid var(--line); }
td.number { font-variant-numeric: tabular-nums; white-space: nowrap; }
code, pre { font: 14px/1.45 ui-monospace, monospace; }
pre { overflow-x: auto; padding: .8rem; border: 1px solid var(--line); border-radius: 4px; }
.status { font-weight: 600; white-space: nowrap; }
.ok { color: var(--ok); } .fault { color: var(--fault); } .not_evaluated { color: var(--unknown); }
ins { color: var(--ok); text-decoration: none; } del { color: var(--fault); text-decoration: none; }
footer { border-top: 1px solid var(--line); margin-top: 2rem; font-size: 14px; overflow-wrap: anywhere; }
"""
_SIGNS = {"ok": "✓", "fault": "✗", "not_evaluated": "?"}
_SEVERITY_CLASSES = {"critical": "fault", "warning": "not_evaluated", "info": "ok"}
_POLICY = "default-src 'none'; style-src 'unsafe-inline'"


def to_html(report: Report) -> str:
    """A page to mail or to keep beside the log."""
    return "\n".join(_page(report)) + "\n"


def _page(report: Report) -> Iterator[str]:
    title = f"Triage of {escape(Path(report.log.path).name)}"
    yield '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">'
    yield f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">'
    yield '<meta name="viewport" content="width=device-width, initial-scale=1">'
    yield f"<title>{title}</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n<h1>{title}</h1>"
    yield f"<p>{escape(fit_text(report.profile.name if report.profile else '', report.fit))}.</p>"
    yield f"<p>{_verdict(report)}</p>"
    yield from _happened(report)
    if report.objectives:
        yield "<h2>Objectives</h2>"
        yield from _table(("Objective", "Value", "Wanted", "Status", "Why"), map(_objective_row, report.objectives))
    for faults in together(report.faults, lambda fault: [cause.path for cause in fault.causes]):
        fault = faults[-1]
        yield f"<h2>Causes of {listed([f'<code>{escape(one.objective)}</code>' for one in faults])}</h2>"
        if fault.causes:
            heads = ("", "Option", "Path", "Driven", "Suggested", "Probability", "Confidence", "Notes")
            yield from _table(heads, map(_cause_row, fault.causes))
        else:
            yield "<p>None was found among the options of the profile.</p>"
    if report.fix is not None:
        yield from _fix(report, report.fix)
    if report.since is not None:
        yield from _since(report.since)
    if report.rivals:
        yield "<h2>It may be no parameter</h2>"
        yield from _list(f"{escape(rival.circumstance)}: {escape(rival.text)}" for rival in report.rivals)
    if report.tell_more:
        yield "<h2>What would tell more</h2>"
        yield from _list(escape(advice) for advice in report.tell_more)
    if report.dismissed:
        yield "<h2>Set aside by the operator</h2>"
        yield from _list(f"<code>{escape(entry.option)}</code>: {escape(entry.reason)}" for entry in report.dismissed)
    if report.notes:
        yield "<h2>Notes</h2>"
        yield from _list(escape(note) for note in report.notes)
    yield from _footer(report)
    yield "</body>\n</html>"


def _happened(report: Report) -> Iterator[str]:
    if report.hypotheses:
        yield "<h2>What explains it</h2>"
        yield from _list(f"{h.probability:.0%}: {escape(hypothesis_text(h))}" for h in report.hypotheses)
    findings = noted(report.findings)
    if findings:
        yield "<h2>Findings, the first cause first</h2>"
        yield from _list(
            f'<span class="status {_SEVERITY_CLASSES[f.severity]}">{SEVERITY_WORDS[f.severity]}</span> '
            f"{escape(finding_sentence(f))}"
            for f in findings
        )
    if report.account:
        yield "<h2>What happened</h2>"
        rows = ((seconds(one.time_s), escape(one.text), escape(one.source)) for one in report.account)
        yield from _table(("Time", "What", "Source"), rows)


def _verdict(report: Report) -> str:
    if report.fit.verdict == "no":
        status, said = plain_verdict(report)
        return f"<strong>{STATUS_WORDS[status].capitalize()}</strong>: {escape(said)}."
    worst = [escape(one.title) for one in report.findings if one.severity == "critical" and not one.after_impact]
    broken = ", ".join(
        f"<code>{escape(objective.name)}</code>" for objective in report.objectives if objective.status == "fault"
    )
    if not broken and worst:
        return f"<strong>Fault</strong>: {'; '.join(worst)}."
    found = f"<strong>Fault</strong>: {broken}." if broken else "<strong>No fault found.</strong>"
    if not broken and any(objective.status == "not_evaluated" for objective in report.objectives):
        found += " Not everything could be evaluated."
    if report.abstained:
        return f"{found} <strong>No change advised</strong>: {escape(report.abstained)}"
    if report.fix is None:
        return found
    likely = f"{chance(report.fix.p_fixed, report.fix.guess)} that all objectives are met"
    return f"{found} Change {_changes(report.fix)}: {likely}."


def _changes(fix: FixSet) -> str:
    return ", ".join(f"<code>{escape(change.option)}</code> {change.values}" for change in fix.changes)


def _objective_row(objective: ObjectiveEntry) -> tuple[str, ...]:
    value = "" if objective.value is None else f"{objective.value:.4g} {objective.unit}".strip()
    return (
        f"<code>{escape(objective.name)}</code>",
        escape(value),
        escape(wanted_text(objective)),
        _status(objective.status),
        escape(objective.reason or ""),
    )


def _status(status: str) -> str:
    return f'<span class="status {status}">{_SIGNS[status]} {STATUS_WORDS[status]}</span>'


def _cause_row(cause: CauseEntry) -> tuple[str, ...]:
    return (
        str(cause.rank),
        f"<code>{escape(cause.option)}</code>",
        " → ".join(escape(node) for node in cause.path),
        f"{cause.current:g}{ASSUMED if cause.assumed else ''}",
        "" if cause.suggested is None else f"{cause.suggested:g}",
        "" if cause.p_fixed is None else f"{cause.p_fixed:.0%}",
        cause.confidence + ("" if cause.in_support else ", outside the training runs"),
        "<br>".join(escape(note) for note in cause.notes),
    )


def _fix(report: Report, fix: FixEntry) -> Iterator[str]:
    yield "<h2>Fix</h2>"
    objectives = {objective.name: objective for objective in report.objectives}
    rows = (
        (f"<code>{escape(name)}</code>", escape(_prediction(objectives[name], one, fix.guess)), _status(one.status))
        for name, one in fix.predicted.items()
    )
    yield from _table(("Objective", "Predicted (80 %)", "Status"), rows)
    yield f"<pre>{chr(10).join(_diff_line(line) for line in report.diff.splitlines())}</pre>"
    yield f"<pre>{escape(chr(10).join(report.apply))}</pre>"
    if fix.alternatives:
        yield "<h3>Alternatives</h3>"
        yield from _list(_alternative(alternative) for alternative in fix.alternatives)


def _since(since: SinceEntry) -> Iterator[str]:
    yield f"<h2>Changed since <code>{escape(Path(since.log).name)}</code></h2>"
    if since.warnings:
        yield from _list(escape(warning) for warning in since.warnings)
    if not since.changes:
        yield "<p>No parameter that anybody sets.</p>"
        return
    rows = (
        (f"<code>{escape(c.parameter)}</code>", escape(c.option or ""), escape(shown(c.from_)), escape(shown(c.to)))
        for c in since.changes
    )
    yield from _table(("Parameter", "Option", "Then", "Now"), rows)


def _prediction(objective: ObjectiveEntry, predicted: PredictedObjective, is_guess: bool) -> str:
    """A yes-or-no objective has a probability, not a value."""
    if objective.kind == "functional":
        return chance(predicted.value, is_guess)
    return f"{predicted.value:.4g} ({predicted.low:.4g} to {predicted.high:.4g}) {objective.unit}".rstrip()


def _alternative(fix: FixSet) -> str:
    return f"{_changes(fix)}: {chance(fix.p_fixed, fix.guess)}"


def _diff_line(line: str) -> str:
    tag = {"+": "ins", "-": "del"}.get(line[:1])
    return f"<{tag}>{escape(line)}</{tag}>" if tag else escape(line)


def _footer(report: Report) -> Iterator[str]:
    log, profile = report.log, report.profile
    yield "<footer>"
    yield f"<p>Log <code>{escape(log.path)}</code>, {escape(log.format)}, {log.duration_s:.0f} s,"
    yield f"SHA-256 <code>{escape(log.sha256)}</code>.<br>"
    if profile is not None:
        yield f"Profile {escape(profile.name)} {escape(profile.version)} ({escape(profile.platform)})."
    yield "</p>"
    if log.damage:
        yield from _list(f"Damage: {escape(damage.what)}" for damage in log.damage)
    yield "</footer>"


def _table(heads: Iterable[str], rows: Iterable[Iterable[str]]) -> Iterator[str]:
    yield "<table>"
    yield f"<tr>{''.join(f'<th>{head}</th>' for head in heads)}</tr>"
    for row in rows:
        yield f"<tr>{''.join(f'<td>{cell}</td>' for cell in row)}</tr>"
    yield "</table>"


def _list(items: Iterable[str]) -> Iterator[str]:
    yield "<ul>"
    yield from (f"<li>{item}</li>" for item in items)
    yield "</ul>"
