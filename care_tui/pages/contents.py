"""What a log holds, whether or not a profile fits it: what `care inspect` prints."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from textual.content import Content

from care_core.text import clean
from care_tui.pages.page import Page, View, view_of
from care_tui.render.rows import plain_rows


class ContentsPage(Page):
    FITS = True
    HELP = (
        "What the log holds: span, damage, parameters, what each profile finds in it, channels. / filters, Esc leaves."
    )

    def view(self) -> View:
        log = self.session.path
        title = f"Contents of {'' if log is None else clean(log.name)}"

        def inspect() -> Callable[[int], str]:
            import care_core
            from care_core.report.inspection import holdings_text

            assert log is not None
            return partial(holdings_text, care_core.inspect(log))

        def show(text_for: Callable[[int], str]) -> View:
            return View(Content(title), lambda _: plain_rows(text_for(self.reader.room.width)))

        return view_of(title, self.fetched("contents", inspect), show)
