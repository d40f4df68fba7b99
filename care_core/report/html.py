"""The report as one HTML file that needs nothing else: no script, no font, no picture from elsewhere.

The page is made of `templates/`, which escape every text whoever wrote it. Only the drawings come as markup.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from care_core.diagnose.verdict import STATUS_WORDS
from care_core.records import Record, replace
from care_core.report.comparison import CompareDocument, head_of, sections_of
from care_core.report.document import FaultEntry, FixEntry, Report
from care_core.report.path_drawing import MOST, paths_svg
from care_core.report.plots import NOTHING_DRAWN, Drawing, Plot, plot_figure
from care_core.report.responses import Response, response_figure
from care_core.report.shared_causes import together
from care_core.report.wording import SEVERITY_WORDS, below, noted
from care_core.run import shown
from care_core.text import clean, listed, log_time, percent

_SIGNS = {"ok": "✓", "fault": "✗", "not_evaluated": "?"}
_CODE = Markup("<code>{}</code>")


class Part(Record):
    """A part of the page. `kind` names the macro that writes its content; one without content is left out."""

    name: str
    title: str
    kind: str
    content: Any


def to_html(report: Report, drawing: Drawing = NOTHING_DRAWN) -> str:
    """A page to mail or to keep beside the log."""
    parts = [part for part in _parts(report, drawing) if part.content]
    name = Path(report.log.path).name
    return _pages().get_template("page.html").render(report=report, name=name, facts=_facts(report), parts=parts)


def to_fragment(report: Report) -> str:
    """The answer in short, to stand in a page of others."""
    return _pages().get_template("fragment.html").render(report=report, name=Path(report.log.path).name)


def comparison_html(document: CompareDocument, drawing: Drawing = NOTHING_DRAWN) -> str:
    """Two runs side by side as a page, with the signals of both over each other."""
    names = [Path(side.log).name for side in (document.a, document.b)]
    return (
        _pages()
        .get_template("comparison.html")
        .render(
            document=document,
            names=names,
            head=list(head_of(document)),
            sections=sections_of(document),
            drawing=drawing,
        )
    )


def _pages() -> Environment:
    """The templates, which escape every text."""
    pages = Environment(
        loader=FileSystemLoader(Path(__file__).with_name("templates")),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    pages.globals |= {"words": STATUS_WORDS, "severities": SEVERITY_WORDS, "signs": _SIGNS}
    pages.filters |= {
        "clean": clean,
        "curve": _curve,
        "figure": _figure,
        "log_time": log_time,
        "share": percent,
        "shown": shown,
    }
    return pages


def _parts(report: Report, drawing: Drawing) -> Iterator[Part]:
    yield Part("explains", "What explains it", "reasons", report.verdict.reasons)
    yield Part("findings", "Findings, the first cause first", "findings", noted(report.findings))
    yield Part("objectives", "Objectives", "objectives", report.objectives)
    groups = together(report.faults, lambda fault: [cause.path for cause in fault.causes])
    for number, faults in enumerate(groups, start=1):
        names = listed([str(_CODE.format(one.objective)) for one in faults])
        content = _causes(report, faults[-1], drawing, f"paths{number}")
        yield Part(f"causes{number}", Markup(f"Causes of {names}"), "causes", content)
    yield Part("fix", "Fix", "fix", report.fix and _fix(report, report.fix, drawing))
    yield Part("signals", "Signals", "signals", drawing if drawing.plots else None)
    yield Part("account", "What happened", "account", report.account)
    if report.since is not None:
        title = Markup("Changed since <code>{}</code>").format(Path(report.since.log).name)
        yield Part("since", title, "since", report.since)
    yield Part("rivals", "It may not be a parameter", "items", [f"{r.circumstance}: {r.text}" for r in report.rivals])
    yield Part("more", "How to find out more", "items", report.tell_more)
    aside = [_CODE.format(one.option) + f": {one.reason}" for one in report.dismissed]
    yield Part("aside", "Set aside by the operator", "items", aside)
    yield Part("notes", "Notes", "items", report.notes)


def _facts(report: Report) -> list[tuple[str, str]]:
    """What run this is, in a few words each."""
    log = report.log
    robot = next((one.text for one in report.account if one.kind == "vehicle"), "")
    judged = next((one for one in report.missions if one.judged), None)
    mission = f"{judged.index} of {len(report.missions)}" if judged and len(report.missions) > 1 else ""
    return [
        ("Robot", robot),
        ("Recorded (UTC)", (log.start or "")[:19].replace("T", " ")),
        ("Length of the log", log_time(log.duration_s)),
        ("Mission", mission),
        ("Profile", f"{report.profile.title} {report.profile.version}" if report.profile else ""),
        ("Damage", f"{len(log.damage)} place{'s' if len(log.damage) > 1 else ''}" if log.damage else ""),
    ]


def _causes(report: Report, fault: FaultEntry, drawing: Drawing, name: str) -> dict[str, Any]:
    causes, unlikely = report.told(fault)
    judged = next((one for one in drawing.faults if one.objective.name == fault.objective), None)
    drawn = [one for one in judged.causes if one.option.name not in unlikely][:MOST] if judged else []
    paths = Markup("\n".join(paths_svg(replace(judged, causes=tuple(drawn)), name))) if judged and drawn else ""
    others = below(unlikely, after=len(causes)) if unlikely else ""
    return {"causes": causes, "others": others, "paths": paths, "drawn": len(drawn)}


def _fix(report: Report, fix: FixEntry, drawing: Drawing) -> dict[str, Any]:
    objectives = {objective.name: objective for objective in report.objectives}
    rows = [(name, objectives[name].prediction(one), one.odds(fix.guess)) for name, one in fix.predicted.items()]
    others = [other.sentence(report.odds_as_driven) for other in fix.alternatives]
    return {
        "changes": list(map(str, fix.changes)),
        "rows": rows,
        "responses": drawing.responses,
        "diff": report.diff.splitlines(),
        "apply": report.apply,
        "alternatives": others,
    }


def _figure(plot: Plot, drawing: Drawing) -> Markup:
    return Markup("\n".join(plot_figure(plot, drawing, f"plot{drawing.plots.index(plot) + 1}")))


def _curve(response: Response, place: int) -> Markup:
    return Markup("\n".join(response_figure(response, f"odds{place}")))
