"""Past runs from the local history: how each objective went, what was set otherwise, and two of them side by side."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from textual.binding import Binding, BindingType
from textual.content import Content

from care_core.application.case import Request
from care_core.application.viewing import Past, past_runs
from care_core.diagnose.verdict import fit_words
from care_core.errors import CareError
from care_core.progress import silent
from care_core.report.entries import health_again
from care_core.text import clean, number_of
from care_tui.messages import OpenLog
from care_tui.pages.figured import FiguredPage
from care_tui.pages.page import OPEN, View, enter_to, sentence, view_of
from care_tui.render.health import happened_rows, health_rows
from care_tui.render.rows import (
    ASCII,
    Glyphs,
    Row,
    Rows,
    by_options,
    error_rows,
    heading,
    labelled,
    padded,
    plain_rows,
    text,
    warning,
    without_middle,
)
from care_tui.render.trend import measured, trend_rows
from care_tui.widgets.choices import Listing
from care_tui.widgets.pane import Pane

if TYPE_CHECKING:  # trends bring statistics that the page does not ask for
    from care_core.history.trends import Changed

NAME_WIDTH, VALUE_WIDTH, LOG_WIDTH = 18, 16, 26
RUNS, WHOLE, CHECK = "runs", "both logs", "what became of it"
TREND = 24
"""Newest runs that a trend shows."""
CHANGES = 12
"""Most parameters that are named of those that changed since the run before."""


class HistoryPage(FiguredPage):
    HELP = (
        "Runs that were triaged before, the newest first, with the trend of every objective up to the one under the "
        "cursor. Enter opens its log. c tells whether the change that it was advised was made in the open log, and "
        "what that brought. x marks a run; then every other is compared with it, and Enter puts both logs side by "
        "side in full. From 120 columns each objective is drawn over the runs, with its limits. / filters, Esc leaves."
    )
    OPENS_ITEM = True
    BINDINGS: ClassVar[list[BindingType]] = [
        enter_to("Open its log"),
        Binding("x", "mark", "Compare", id="history.mark"),
        Binding("c", "check", "Check its change", id="history.check"),
    ]
    _marked: Past | None = None
    _compared: tuple[Past, Past] | None = None
    """The marked run and the one whose log was put beside it in full."""
    _checked: Past | None = None
    """The run whose advice is held against the open log."""

    def enter(self) -> None:
        self.forget(RUNS)

    def view(self) -> View:
        return view_of("History", self.fetched(RUNS, past_runs), self._show)

    @property
    def _runs(self) -> list[Past]:
        found = self._answers.get(RUNS)
        return found if isinstance(found, list) else []

    def _show(self, runs: list[Past]) -> View:
        if not runs and (problem := self.session.not_remembered) is not None:
            return View(Content("History"), lambda _: error_rows(problem))
        if not runs:
            nothing = "No run was triaged before: 'care triage' and this app remember those they judge."
            return View(Content("History"), lambda _: sentence(nothing))
        listing = Listing(
            len(runs),
            lambda i, _width: (self._item(runs[i]),),
            lambda i: f"{runs[i].log} {runs[i].profile} {runs[i].verdict} {runs[i].cause}",
        )
        title = Content(f"{number_of(len(runs), 'run')}; x marks one to compare with")
        if self._marked is not None:
            title = Content(f"Compared with {_named(self._marked)}; Enter: both in full; x again unmarks")
        return View(title, lambda i: Rows([]) if i is None else self._detail(runs[i]), listing)

    def beside(self) -> tuple[str, list[Row]]:
        past = self._here
        if past is None:
            return "", []
        rows = [*self._about(past), *self._changes(past)]
        return _named(past), [*rows, *self._happened(past, self.choices)] if self._is_drawn(past) else rows

    def _detail(self, past: Past) -> Rows:
        """What stands beside a run: what became of its advice, or both logs in full, where that was asked for; else how
        it compares with the marked one, or with those before it."""
        if self._checked == past:
            return self._became(past)
        other = self._marked
        if other is None or other == past:
            return Rows(self._trends(past))
        if self._compared != (other, past):
            return Rows(comparison(past, other))
        a, b = (Request(Path(run.log), mission=run.mission or None) for run in self._compared)
        compare = self.workspace.engine.compare
        whole = self.fetched(WHOLE, lambda: compare(a, b, silent))
        if isinstance(whole, CareError):
            return error_rows(whole)
        if whole is None:
            return sentence("Putting both side by side...")
        return plain_rows(whole(self.reader.room.width))

    def _became(self, past: Past) -> Rows:
        """What the change that a run was advised brought in the open log."""
        case, request, verify = self.session.case, self.workspace.request, self.workspace.engine.verify
        assert case is not None
        bounds = {} if request is None else request.thresholds
        told = self.fetched(CHECK, lambda: verify(case, past.report, bounds))
        if isinstance(told, CareError):
            return error_rows(told)
        if told is None:
            return sentence("Holding it against this run...")
        return plain_rows(told(self.reader.room.width))

    @property
    def _may_check(self) -> bool:
        """Whether the run under the cursor was advised a change, and another log is open that may have it."""
        past, case = self._here, self.session.case
        if past is None or past.report.fix is None or case is None:
            return False
        return past.report.log.sha256 != case.diagnosis.run.log.sha256

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        if action == "mark":
            return self.index is not None
        return self._may_check if action == "check" else super().check_action(action, parameters)

    def _item(self, past: Past) -> Content:
        mark = "*" if past == self._marked else " "
        line = Content(f"{mark} {past.at[:16].replace('T', ' ')}  ")
        fit = "" if past.fit == "fits" else f"  ({fit_words(past.profile, past.fit).removeprefix('Profile ')})"
        name = without_middle(_named(past), LOG_WIDTH - 1, self.glyphs)
        told = f" {by_options(past.judged_with)}{past.verdict}"
        return line + padded(name, LOG_WIDTH, "bold") + text(told) + text(fit, "dim")

    def _about(self, past: Past) -> list[Row]:
        """What was found of a run, and what became of its advice."""
        rows = [
            labelled("Log", past.log),
            labelled("Fit", fit_words(past.profile, past.fit)),
            labelled("Verdict", past.verdict),
        ]
        if past.judged_with:
            rows.append(labelled("Judged", f"with {past.judged_with}, not by its own limits"))
        if past.cause:
            rows.append(labelled("Cause", past.cause))
        if past.report.fix is not None:
            rows.append(labelled("Advice", past.advice))
        return rows + [labelled("" if place else "Outcome", told) for place, told in enumerate(past.became)]

    def _changes(self, past: Past) -> list[Row]:
        """What was set otherwise than in the run before."""
        if not past.before:
            return []
        head = [Row(Content()), heading(f"Changed since {Path(past.before).name}, the run before")]
        rows = [_changed(one, self.glyphs) for one in past.changed[:CHANGES]]
        more = len(past.changed) - len(rows)
        left_out = [Row(Content(f"and {more} more"))] if more else []
        return [*head, *rows, *left_out] if rows else [*head, Row(Content("no parameter that both logs hold"))]

    def _happened(self, past: Past, pane: Pane) -> list[Row]:
        """What happened in a run, as it is remembered, in lines for a pane as wide as this."""
        health = health_again(past.report.account, past.report.findings)
        return happened_rows(health_rows(health), pane.room.width - 1, self.glyphs)

    def _alike(self, past: Past) -> list[Past]:
        """The runs of the same robot that were judged by the same profile, oldest first; of one that nothing tells the
        robot of itself alone."""
        if not past.robot:
            return [past]
        return [run for run in reversed(self._runs) if (run.robot, run.profile) == (past.robot, past.profile)]

    def _is_drawn(self, past: Past) -> bool:
        """Whether the objectives are drawn over the runs."""
        alike = self._alike(past)
        return self.is_wide and len(alike) > 1 and bool(measured(alike))

    def _trends(self, past: Past) -> list[Row]:
        """How each objective went up to a run, or over all of its kind where there is room to draw them."""
        alike = self._alike(past)
        here = alike.index(past)
        if self._is_drawn(past):
            return trend_rows(alike, here, *self.reader.room, self.glyphs)
        until = alike[: here + 1]
        rows = [_columns("Objective", "this run", f"{number_of(len(until), 'run')} up to it", "bold")]
        for name, value in past.values.items():
            rows.append(_columns(name, _shown(value), self._trend([run.values.get(name) for run in until])))
        if self.is_wide:  # all else stands below the list
            return [*rows, *self._happened(past, self.reader)]
        return [*self._about(past), Row(Content()), *rows, *self._changes(past)]

    def _trend(self, values: Sequence[float | None]) -> str:
        from care_core.history.track_record import sparkline

        known = [value for value in values if value is not None][-TREND:]
        if len(known) < 2:
            return ""
        return f"{sparkline(known, ascii=self.glyphs is ASCII)}  {min(known):.4g} to {max(known):.4g}"

    @property
    def _here(self) -> Past | None:
        """The run under the cursor."""
        return self._runs[self.index] if self._runs and self.index is not None else None

    @property
    def _is_beside(self) -> bool:
        """Whether another run is marked, to be compared with that under the cursor."""
        return self._marked is not None and self._here != self._marked

    def label(self, binding: Binding) -> str:
        return "Both in full" if binding.id == OPEN and self._is_beside else super().label(binding)

    def moved(self, index: int) -> None:
        self.refresh_bindings()

    def action_open(self) -> None:
        """Open the log of the run under the cursor, or put it beside the one that is marked."""
        past = self._here
        if past is None:
            return
        if self._marked is None or not self._is_beside:
            is_last = past.mission >= len(past.report.missions)  # which is judged where none is asked for
            self.post_message(OpenLog(Path(past.log), None if is_last else past.mission))
            return
        self._compared = self._marked, past
        self.forget(WHOLE)
        self.show_text()

    def action_check(self) -> None:
        """Tell whether the change that this run was advised was made in the open log, and what it brought."""
        self._checked = None if self._checked == self._here else self._here
        self.forget(CHECK)
        self.show_text()

    def action_mark(self) -> None:
        """Mark the run under the cursor to compare others with, or take the mark away."""
        past = self._here
        if past is not None:
            self._marked = None if past == self._marked else past
            self.show()
            self.refresh_bindings()
            if self._marked is not None and len(self._runs) > 1:
                self.say("Marked: go to another run to compare it with this one.")


def comparison(past: Past, other: Past) -> list[Row]:
    """Two runs side by side: objectives, then the parameters that differ."""
    rows: list[Row] = []
    if past.profile != other.profile:
        judged = f"this run was judged by {past.profile or 'no profile'}, the other by {other.profile or 'no profile'}"
        rows += [warning("Note", judged), Row(Content())]
    rows += [_columns("Objective", "this run", _named(other), "bold")]
    rows += [_columns(name, _shown(value), _shown(other.values.get(name))) for name, value in past.values.items()]
    names = [name for name in past.config if past.config[name] != other.config.get(name)]
    rows += [Row(Content()), _columns("Parameter", "this run", _named(other), "bold")]
    if not names:
        rows.append(Row(Content("all parameters are alike")))
    return rows + [_columns(name, f"{past.config[name]:.6g}", _known(other.config.get(name))) for name in names]


def _columns(name: str, here: str, there: str, style: str = "") -> Row:
    line = padded(name, NAME_WIDTH, style or "bold") + Content(" ") + padded(here, VALUE_WIDTH, style)
    return Row(line + text(f" {there}", style), NAME_WIDTH + VALUE_WIDTH + 2)


def _named(past: Past) -> str:
    mission = f" #{past.mission}" if past.mission > 1 else ""
    return f"{clean(Path(past.log).name)}{mission}"


def _shown(value: float | None) -> str:
    return "not evaluated" if value is None else f"{value:.4g}"


def _changed(one: Changed, glyphs: Glyphs) -> Row:
    before, after = (value if isinstance(value, str) else f"{value:.6g}" for value in (one.before, one.after))
    return Row(padded(one.name, NAME_WIDTH) + text(f" {before} {glyphs.to} {after}"), 2)


def _known(value: float | None) -> str:
    return "not known" if value is None else f"{value:.6g}"
