"""The report as one HTML file that needs nothing else: no script, no font, no picture from elsewhere.

Every text goes through `escape`, whoever wrote it; what is no text of the document, through `clean` before.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from html import escape
from pathlib import Path

from care_core.report.document import (
    CauseEntry,
    FaultEntry,
    FixEntry,
    FixSet,
    ObjectiveEntry,
    PredictedObjective,
    Report,
    SinceEntry,
    wanted_text,
)
from care_core.report.happened import FindingEntry
from care_core.report.path_drawing import MOST, paths_svg
from care_core.report.plots import NOTHING_DRAWN, Drawn, mark_list, plot_figure
from care_core.report.together import together
from care_core.report.wording import SEVERITY_WORDS, chance, fit_text, hypothesis_text, noted
from care_core.report.writers import STATUS_WORDS, plain_verdict
from care_core.run import shown
from care_core.text import clean, listed, seconds
from care_core.variables import ASSUMED

_SIGNS = {"ok": "✓", "fault": "✗", "not_evaluated": "?"}
_SEVERITY_CLASSES = {"critical": "fault", "warning": "not_evaluated", "info": "ok"}
_POLICY = "default-src 'none'; style-src 'unsafe-inline'"


def to_html(report: Report, drawn: Drawn = NOTHING_DRAWN) -> str:
    """A page to mail or to keep beside the log."""
    return "\n".join(_page(report, drawn)) + "\n"


def _page(report: Report, drawn: Drawn) -> Iterator[str]:
    title = f"Triage of {escape(Path(report.log.path).name)}"
    yield '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">'
    yield f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">'
    yield '<meta name="viewport" content="width=device-width, initial-scale=1">'
    style = Path(__file__).with_name("page.css").read_text(encoding="utf-8")
    yield f"<title>{title}</title>\n<style>{style}</style>\n</head>\n<body>\n<header>\n<h1>{title}</h1>"
    yield f"<p>{escape(fit_text(report.profile.name if report.profile else '', report.fit))}.</p>"
    yield from _verdict(report)
    yield from _facts(report)
    sections = [(name, head, lines) for name, head, made in _sections(report, drawn) if (lines := list(made))]
    links = [f'<a href="#{name}">{_plain(head)}</a>' for name, head, _ in sections]
    yield f'<nav aria-label="Contents">{" ".join(links)}</nav>'
    yield "</header>\n<main>"
    for name, head, lines in sections:
        yield f'<section id="{name}">\n<h2>{head}</h2>'
        yield from lines
        yield "</section>"
    yield "</main>"
    yield from _footer(report)
    yield "</body>\n</html>"


def _plain(head: str) -> str:
    """A heading without its tags, for the list of contents."""
    return head.replace("<code>", "").replace("</code>", "")


def _sections(report: Report, drawn: Drawn) -> Iterator[tuple[str, str, Iterable[str]]]:
    """Name, heading and lines of each part; one without lines is left out."""
    yield "explains", "What explains it", _explanations(report)
    yield "findings", "Findings, the first cause first", _findings(report)
    yield "objectives", "Objectives", _objectives(report)
    groups = together(report.faults, lambda fault: [cause.path for cause in fault.causes])
    for number, faults in enumerate(groups, start=1):
        names = listed([f"<code>{escape(one.objective)}</code>" for one in faults])
        yield f"causes{number}", f"Causes of {names}", _causes(faults[-1], drawn, number)
    if report.fix is not None:
        yield "fix", "Fix", _fix(report, report.fix)
    yield "signals", "Signals", _signals(drawn)
    yield "account", "What happened", _account(report, drawn)
    if report.since is not None:
        yield "since", f"Changed since <code>{escape(Path(report.since.log).name)}</code>", _since(report.since)
    yield (
        "rivals",
        "It may be no parameter",
        _list(f"{escape(r.circumstance)}: {escape(r.text)}" for r in report.rivals),
    )
    yield "more", "What would tell more", _list(map(escape, report.tell_more))
    aside = (f"<code>{escape(entry.option)}</code>: {escape(entry.reason)}" for entry in report.dismissed)
    yield "aside", "Set aside by the operator", _list(aside)
    yield "notes", "Notes", _list(map(escape, report.notes))


def _verdict(report: Report) -> Iterator[str]:
    status, text = _said(report)
    yield f'<p class="verdict {status}">{text}</p>'


def _said(report: Report) -> tuple[str, str]:
    """The verdict as status and sentence."""
    if report.fit.verdict == "no":
        status, said = plain_verdict(report)
        return status, f"<strong>{STATUS_WORDS[status].capitalize()}</strong>: {escape(said)}."
    worst = [escape(one.title) for one in report.findings if one.severity == "critical" and not one.after_impact]
    broken = ", ".join(
        f"<code>{escape(objective.name)}</code>" for objective in report.objectives if objective.status == "fault"
    )
    if not broken and worst:
        return "fault", f"<strong>Fault</strong>: {'; '.join(worst)}."
    status = "fault" if broken else "ok"
    found = f"<strong>Fault</strong>: {broken}." if broken else "<strong>No fault found.</strong>"
    if not broken and any(objective.status == "not_evaluated" for objective in report.objectives):
        status, found = "not_evaluated", f"{found} Not everything could be evaluated."
    if report.abstained:
        return status, f"{found} <strong>No change advised</strong>: {escape(report.abstained)}"
    if report.fix is None:
        return status, found
    likely = f"{chance(report.fix.p_fixed, report.fix.guess)} that all objectives are met"
    return status, f"{found} Change {_changes(report.fix)}: {likely}."


def _facts(report: Report) -> Iterator[str]:
    """What run this is, in a few words each."""
    log = report.log
    robot = next((one.text for one in report.account if one.kind == "vehicle"), "")
    judged = next((one for one in report.missions if one.judged), None)
    mission = f"{judged.index} of {len(report.missions)}" if judged and len(report.missions) > 1 else ""
    facts = (
        ("Robot", robot),
        ("Recorded (UTC)", (log.start or "")[:19].replace("T", " ")),
        ("Length of the log", seconds(log.duration_s)),
        ("Mission", mission),
        ("Profile", f"{report.profile.name} {report.profile.version}" if report.profile else ""),
        ("Damage", f"{len(log.damage)} place{'s' if len(log.damage) > 1 else ''}" if log.damage else ""),
    )
    yield '<dl class="facts">'
    yield from (f"<div><dt>{name}</dt><dd>{escape(value)}</dd></div>" for name, value in facts if value)
    yield "</dl>"


def _explanations(report: Report) -> Iterator[str]:
    if not report.hypotheses:
        return
    yield '<ol class="chances">'
    for one in report.hypotheses:
        bar = f'<span class="bar" aria-hidden="true"><i style="width:{one.probability:.0%}"></i></span>'
        share = f'<span class="number">{one.probability:.0%}</span>'
        yield f"<li>{share}{bar}<span>{escape(hypothesis_text(one, report.findings))}</span></li>"
    yield "</ol>"


def _findings(report: Report) -> Iterator[str]:
    findings = noted(report.findings)
    if findings:
        yield '<ul class="findings">'
        for one in findings:
            yield from _finding(one)
        yield "</ul>"


def _finding(one: FindingEntry) -> Iterator[str]:
    style = _SEVERITY_CLASSES[one.severity]
    late = ", after it was down" if one.after_impact else ""
    yield f'<li class="{style}"><p><span class="status {style}">{SEVERITY_WORDS[one.severity]}</span> '
    yield f"<strong>{escape(one.title)}</strong>, at {seconds(one.onset_s)}{late}</p>"
    if one.evidence:
        yield f"<p>{escape(one.evidence)}</p>"
    if one.consequences:
        led = "; ".join(f"{escape(below.title)} ({seconds(below.onset_s)})" for below in one.consequences)
        yield f"<p>Led to: {led}</p>"
    if one.source:
        yield f'<p class="quiet">Seen in {escape(one.source)}</p>'
    yield "</li>"


def _objectives(report: Report) -> Iterator[str]:
    if report.objectives:
        heads = ("Objective", "Value", "Wanted", "Status", "Why")
        has_reason = any(one.reason for one in report.objectives)
        rows = (_objective_row(one)[: 5 if has_reason else 4] for one in report.objectives)
        styles = ("", "value", "", "status-cell", "why")
        yield from _table("Objectives", heads[: 5 if has_reason else 4], rows, styles, "objectives")


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


def _causes(fault: FaultEntry, drawn: Drawn, number: int) -> Iterator[str]:
    if not fault.causes:
        yield "<p>None was found among the options of the profile.</p>"
        return
    judged = next((one for one in drawn.faults if one.objective.variable.name == fault.objective), None)
    if judged is not None:
        drawing = list(paths_svg(judged, f"paths{number}"))
        if drawing:
            yield '<figure><div class="scroll" tabindex="0" role="group" aria-label="Causal paths, may be scrolled">'
            yield from drawing
            yield '</div><figcaption><span class="quiet">From the option to the objective, the best cause first'
            yield f" ({min(MOST, len(fault.causes))} of {len(fault.causes)} drawn). On each step: its effect in "
            yield "standard deviations, and in how many resamples of the training runs it was found; broken where in "
            yield "less than half. Expected is what the reference configuration would give.</span></figcaption>"
            yield "</figure>"
    for cause in fault.causes:
        yield from _cause(cause)


def _cause(cause: CauseEntry) -> Iterator[str]:
    driven = f"{cause.current:g}{ASSUMED if cause.assumed else ''}"
    to = "" if cause.suggested is None else f" → {cause.suggested:g}"
    fixed = "" if cause.p_fixed is None else f"{cause.p_fixed:.0%} fixed by it alone, "
    outside = "" if cause.in_support else ", outside the training runs"
    yield (
        f'<div class="cause"><p>{cause.rank}. <strong><code>{escape(cause.option)}</code></strong> '
        f'<span class="number">{driven}{to}</span> ({fixed}{cause.confidence} confidence{outside})</p>'
    )
    yield f'<p class="quiet">{" → ".join(escape(node) for node in cause.path)}</p>'
    yield from _list(map(escape, cause.notes))
    yield "</div>"


def _changes(fix: FixSet) -> str:
    return ", ".join(f"<code>{escape(change.option)}</code> {change.values}" for change in fix.changes)


def _fix(report: Report, fix: FixEntry) -> Iterator[str]:
    objectives = {objective.name: objective for objective in report.objectives}
    rows = (
        (f"<code>{escape(name)}</code>", escape(_prediction(objectives[name], one, fix.guess)), _status(one.status))
        for name, one in fix.predicted.items()
    )
    yield from _table("What the change is predicted to bring", ("Objective", "Predicted (80 %)", "Status"), rows)
    yield "<h3>Difference to the configuration as driven</h3>"
    yield f"<pre>{chr(10).join(_diff_line(line) for line in report.diff.splitlines())}</pre>"
    yield "<h3>Commands</h3>"
    yield f"<pre>{escape(chr(10).join(report.apply))}</pre>"
    if fix.alternatives:
        yield "<h3>Alternatives</h3>"
        yield from _list(_alternative(alternative) for alternative in fix.alternatives)


def _prediction(objective: ObjectiveEntry, predicted: PredictedObjective, is_guess: bool) -> str:
    """A yes-or-no objective has a probability, not a value."""
    if objective.kind == "functional":
        return chance(predicted.value, is_guess)
    return f"{predicted.value:.4g} ({predicted.low:.4g} to {predicted.high:.4g}) {objective.unit}".rstrip()


def _alternative(fix: FixSet) -> str:
    return f"{_changes(fix)}: {chance(fix.p_fixed, fix.guess)}"


def _diff_line(line: str) -> str:
    tag = None if line.startswith(("---", "+++")) else {"+": "ins", "-": "del"}.get(line[:1])
    return f"<{tag}>{escape(line)}</{tag}>" if tag else escape(line)


def _signals(drawn: Drawn) -> Iterator[str]:
    """The plots that matter, then the others folded away."""
    if not drawn.plots:
        return
    yield f'<p class="quiet">Over {drawn.end_s - drawn.start_s:.0f} s from {drawn.since}; the axis counts seconds'
    yield f" from it ({drawn.start_s:.1f} s into the log). Spikes are kept. Numbers mark what happened:</p>"
    yield from mark_list(drawn)
    for limit in drawn.deadlines:
        if drawn.start_s < limit.value < drawn.end_s:
            yield f'<p class="quiet">The broken upright line at {limit.value - drawn.start_s:.1f} s: '
            yield f"{escape(clean(limit.words))}.</p>"
    numbered = list(enumerate(drawn.plots, start=1))
    for number, plot in numbered:
        if plot.matters:
            yield from plot_figure(plot, drawn, f"plot{number}")
    others = [(number, plot) for number, plot in numbered if not plot.matters]
    if others:
        yield f"<details><summary>{len(others)} other signals</summary>"
        for number, plot in others:
            yield from plot_figure(plot, drawn, f"plot{number}")
        yield "</details>"


def _account(report: Report, drawn: Drawn) -> Iterator[str]:
    if not report.account:
        return
    start_s = drawn.start_s if drawn.is_mission else 0.0
    heads = ("In the log", *(("In the mission",) if start_s else ()), "What", "Source")
    rows = []
    for one in report.account:
        times = [seconds(one.time_s)]
        if start_s:
            times.append("" if one.time_s is None else f"{one.time_s - start_s:+.1f} s".replace("-", "\u2212"))
        rows.append((*times, escape(one.text), escape(one.source)))
    styles = ("time", *(("time",) if start_s else ()), "", "source")
    yield from _table("What happened, in order of time", heads, rows, styles, "account")


def _since(since: SinceEntry) -> Iterator[str]:
    yield from _list(escape(warning) for warning in since.warnings)
    if not since.changes:
        yield "<p>No parameter that anybody sets.</p>"
        return
    rows = (
        (f"<code>{escape(c.parameter)}</code>", escape(c.option or ""), escape(shown(c.from_)), escape(shown(c.to)))
        for c in since.changes
    )
    yield from _table("Parameters that changed", ("Parameter", "Option", "Then", "Now"), rows)


def _footer(report: Report) -> Iterator[str]:
    log, profile = report.log, report.profile
    yield "<footer>"
    yield f"<p>Log <code>{escape(Path(log.path).name)}</code>, {escape(log.format)}, {log.duration_s:.0f} s"
    yield f", SHA-256 <code>{escape(log.sha256)}</code>.<br>" if log.sha256 else ".<br>"
    if profile is not None:
        yield f"Profile {escape(profile.name)} {escape(profile.version)} ({escape(profile.platform)})."
    yield "</p>"
    yield from _list(f"Damage: {escape(damage.what)}" for damage in log.damage)
    yield "</footer>"


def _table(
    caption: str, heads: Sequence[str], rows: Iterable[Sequence[str]], styles: Sequence[str] = (), name: str = ""
) -> Iterator[str]:
    """A table that may be scrolled where the page is narrow; `styles` are classes of its columns."""
    classes = [f' class="{style}"' if style else "" for style in (*styles, *[""] * (len(heads) - len(styles)))]
    yield f'<div class="scroll" tabindex="0" role="group" aria-label="{escape(caption)}"><table'
    yield f' role="table" class="{name}">' if name else ">"
    heading = "".join(f'<th scope="col"{style}>{head}</th>' for head, style in zip(heads, classes, strict=False))
    yield f"<thead><tr>{heading}</tr></thead><tbody>"
    for row in rows:
        cells = "".join(f'<td role="cell"{style}>{cell}</td>' for cell, style in zip(row, classes, strict=False))
        yield f'<tr role="row">{cells}</tr>'
    yield "</tbody></table></div>"


def _list(items: Iterable[str]) -> Iterator[str]:
    lines = [f"<li>{item}</li>" for item in items]
    if lines:
        yield from ("<ul>", *lines, "</ul>")
