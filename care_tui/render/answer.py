"""The answer of a run in few lines: the fault, its cause, the change with its odds, what is next, what limits it."""

from __future__ import annotations

from collections.abc import Iterator

from textual.content import Content

from care_core.diagnose.records import Diagnosis, Hypothesis
from care_core.diagnose.verdict import LINE, fit_line, hypothesis_text, verdict_of
from care_core.ecosystems.findings import every_finding
from care_core.text import clean, listed, percent
from care_tui.render.health import warnings_of
from care_tui.render.odds import bar, promise
from care_tui.render.rows import Glyphs, change_text, progress_bar, status, text
from care_tui.session import Session

_LABEL = 9
_FITS = "profile fits"
_MARK = "! "
_NARROW = 70
"""Cells below which a reason is told beyond the edge."""
_STANDS_OUT = 0.25
"""Probability below which the likeliest explanation is one of many."""
_LEAST = 12
"""Cells that are left of a change, however narrow the terminal."""


def answer_lines(session: Session, glyphs: Glyphs, width: int, *, is_low: bool, is_tall: bool = False) -> list[Content]:
    """The answer as far as it is known; `is_low`: there is room for few lines, `is_tall`: for every one of them."""
    name = "" if session.path is None else clean(session.path.name)
    if session.state == "empty":
        return [
            Content.styled("No log is open", "bold"),
            Content("Enter opens one of the list of logs (L), o any other"),
        ]
    if session.state == "error" and session.error is not None:
        return [
            Content.styled(f"{glyphs.fault} No diagnosis of {name}", "bold $text-error"),
            text(session.error.message),
        ]
    if session.state == "loading":
        step, fraction = session.progress or ("starting", 0.0)
        head = Content.assemble("Reading ", (name, "bold"), ("  esc stops", "dim"))
        return [head, progress_bar(fraction, glyphs) + text(f"  {step}")]
    failed = _head(session.diagnosis, glyphs, width, is_tall=is_tall)
    lines = [*failed, *_cause_and_change(session, glyphs, width, is_low=is_low)]
    next_step = verdict_of(session.diagnosis).next_step
    is_said = session.diagnosis.fix is not None and not session.diagnosis.abstained  # the change is what to do next
    if next_step and not is_low and (is_tall or not is_said):
        lines += _over_two(_labelled("Next") + text(next_step), width, is_tall=is_tall)
    return [*lines, *_limits(session.diagnosis, width, is_tall=is_tall)]


def _head(diagnosis: Diagnosis, glyphs: Glyphs, width: int, *, is_tall: bool) -> list[Content]:
    """The fault in words; that the profile fits stands in the corner, where there is one."""
    verdict = verdict_of(diagnosis)
    told = Content.assemble(status(verdict.status, glyphs), "  ", (clean(verdict.failed), "bold"))
    if diagnosis.profile.fit.verdict != "fits":
        return _over_two(told, width, is_tall=is_tall)
    first, *rest = _over_two(told, width - len(_FITS) - 2, is_tall=is_tall)
    first = _cut(first, width - len(_FITS) - 2, glyphs)
    return [first.pad_right(width - len(_FITS) - first.cell_length) + Content.styled(_FITS, "dim"), *rest]


def _over_two(line: Content, width: int, *, is_tall: bool) -> list[Content]:
    """The line; where there is room and it does not fit, what is left of it on a second one."""
    if not is_tall or line.cell_length <= width:
        return [line]
    first = line.wrap(width)[0].rstrip()
    left = line[len(first.plain) :]
    return [first, Content(" " * _LABEL) + left[len(left.plain) - len(left.plain.lstrip()) :]]


def _cause_and_change(session: Session, glyphs: Glyphs, width: int, *, is_low: bool) -> Iterator[Content]:
    diagnosis = session.diagnosis
    hypotheses = session.hypotheses()
    if hypotheses:
        first = hypotheses[0]
        doubt = "  weak training support" if _is_doubtful(diagnosis, first) else ""
        found = [one for one in every_finding(diagnosis.health.findings) if one.title == first.name]
        lead = "" if first.probability >= _STANDS_OUT else "nothing stands out; likeliest is "
        yield (
            _labelled("Cause")
            + bar(first.probability, glyphs)
            + Content.assemble(
                (f" {percent(first.probability):>4}  ", "bold"),
                lead,
                text(hypothesis_text(first, found, diagnosis.outside), "bold"),
                (doubt, "$text-warning"),
            )
        )
    elif causes := [cause for fault in diagnosis.faults for cause in fault.causes if not cause.is_lead]:
        yield _labelled("Cause") + text(causes[0].option.name, "bold")
    change = _change(session, glyphs, width)
    if change is not None:
        yield change
    if diagnosis.abstained:
        yield _labelled("Change") + text(f"none advised: {diagnosis.abstained}", "$text-warning")
    elif change is None and diagnosis.faults and not is_low:
        is_left = diagnosis.fix is not None
        yield _labelled("Change") + Content("nothing is ticked (4)" if is_left else "none is known that helps")


def _is_doubtful(diagnosis: Diagnosis, first: Hypothesis) -> bool:
    """Whether training says too little of the parameter that leads to be relied on."""
    causes = (cause for fault in diagnosis.faults for cause in fault.causes)
    sure = [cause.confidence for cause in causes if cause.option.name == first.name]
    return first.what == "parameter" and sure[:1] == ["low"]


def _change(session: Session, glyphs: Glyphs, width: int) -> Content | None:
    """What is ticked, with the odds of it and without it, of which none is cut off; None where nothing is."""
    ticked = session.basket.ticked
    options = {option.name: option for option in session.options()} if ticked else {}
    if not ticked:
        return None
    name, value = next(iter(ticked.items()))
    option = options[name]
    change = change_text(option, session.current(option), session.is_assumed(option), value, glyphs)
    more = f" and {len(ticked) - 1} more" if len(ticked) > 1 else ""
    without = session.odds_unchanged()
    fix = session.fix
    if session.fix_error is not None:
        odds = Content.styled("no prediction", "$text-warning")
    elif fix is None:
        odds = Content("...")
    elif fix.odds is None:
        odds = Content("odds not measured")
    else:
        odds = promise(fix.odds, glyphs) + Content.styled(" a guess" if fix.is_guess else "", "$text-warning")
    beside = Content.styled("" if without is None else f"  without {percent(without)}", "dim")
    again = Content.styled("  unless it happens again", "$text-warning") if session.diagnosis.lost_by else Content()
    is_asked = bool(session.diagnosis.abstained) or (fix is not None and fix.by_hand)
    head = _labelled("Asked" if is_asked else "Change") + odds + Content("  ")
    what, room = Content.assemble(text(name, "bold"), " ", change), width - head.cell_length - len(more)
    # Of what does not fit beside the change the page of the fix tells the rest.
    tails = (beside + again, again or beside, beside)
    tail = next((one for one in tails if what.cell_length + one.cell_length <= room), beside)
    return head + _cut(what, max(room - tail.cell_length, _LEAST), glyphs) + more + tail


def _limits(diagnosis: Diagnosis, width: int, *, is_tall: bool) -> Iterator[Content]:
    """What the answer does not tell, the gravest first: each in a line where there is room, else all of it in one."""
    fit, warnings = diagnosis.profile.fit, warnings_of(diagnosis)
    told = list(_worse(diagnosis, is_tall=is_tall))
    if fit.verdict != "fits":
        told.append(fit_line(diagnosis.profile.title, fit, line=_room_of_fit(width)))
    told += ["; ".join(warnings)] if warnings else []
    style = "bold $text-error" if fit.verdict == "no" else "$text-warning"
    for line in told if is_tall or not told else ["; ".join(told)]:
        yield Content.styled(_MARK + clean(line), style)


def _worse(diagnosis: Diagnosis, *, is_tall: bool) -> Iterator[str]:
    """That another mission of the log failed, and where it is told."""
    own = diagnosis.run.mission.index
    failed = [one for one in diagnosis.missions if one.status == "fault" and one.mission.index != own]
    if failed:
        numbers = listed([str(one.mission.index) for one in failed])
        missions = "missions" if len(failed) > 1 else "mission"
        why = f": {failed[0].reason}" if is_tall and len(failed) == 1 else ""
        yield f"FAULT in {missions} {numbers} of this log, too (t){why}"


def _room_of_fit(width: int) -> int:
    """Where there is little room the first reason says more than how many others there are, which are cut off then."""
    room = width - len(_MARK)
    return room if room >= _NARROW else LINE


def _cut(line: Content, room: int, glyphs: Glyphs) -> Content:
    return line if line.cell_length <= room else line.truncate(room - 1) + glyphs.more


def _labelled(label: str) -> Content:
    return Content.styled(f"{label:<{_LABEL}}", "dim")
