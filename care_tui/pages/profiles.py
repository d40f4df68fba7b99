"""The installed profiles with their model cards."""

from __future__ import annotations

from textual.content import Content

from care_core.application.viewing import Installed, installed_profiles
from care_core.text import number_of
from care_tui.pages.page import Page, View, sentence, view_of
from care_tui.render.rows import Row, Rows, padded, plain_rows, text
from care_tui.widgets.choices import Listing


class ProfilesPage(Page):
    HELP = "The installed profiles. The text is the model card: what it was learned from, how good it is, its limits."
    _placed = False

    @property
    def _used(self) -> str | None:
        return None if self.session.case is None else self.session.diagnosis.profile.name

    def view(self) -> View:
        return view_of("Profiles", self.fetched("profiles", installed_profiles), self._show)

    def _show(self, profiles: list[Installed]) -> View:
        title = Content(f"{number_of(len(profiles), 'profile')} installed")
        if not profiles:
            return View(title, lambda _: sentence("No profile is installed."))
        names = [profile.name for profile in profiles]
        index = names.index(self._used) if self._used in names and not self._placed else None
        self._placed = True
        listing = Listing(
            len(profiles),
            lambda i, _width: (self._item(profiles[i]),),
            lambda i: f"{profiles[i].name} {profiles[i].platform}",
        )
        return View(title, lambda i: Rows([]) if i is None else _card(profiles[i]), listing, index, "Model card")

    def _item(self, profile: Installed) -> Content:
        mark = self.glyphs.here if profile.name == self._used else " "
        line = (
            Content(f"{mark} ") + padded(profile.name, 16, "bold") + text(f" {profile.version:<5} {profile.platform}")
        )
        return line + Content("  (used)") if profile.name == self._used else line


def _card(profile: Installed) -> Rows:
    """The card with its headings bold. Textual's Markdown is a widget a block: a card took five seconds to open."""
    return Rows(
        Row(text(row.content.plain.lstrip("# "), "bold")) if row.content.plain.startswith("#") else row
        for row in plain_rows(profile.card).rows
    )
