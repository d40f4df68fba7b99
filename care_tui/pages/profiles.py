"""The installed profiles with their model cards."""

from __future__ import annotations

from textual.content import Content

from care_core.application.viewing import Installed, installed_profiles
from care_tui.pages.page import Fetch, Page, View, sentence
from care_tui.render.rows import Row, Rows, padded, plain_rows, text
from care_tui.screens.panes import PanesScreen
from care_tui.widgets.choices import Listing


class ProfilesPage(Page):
    name = "Profiles"
    HELP = "The installed profiles. The text is the model card: what it was learned from, how good it is, its limits."

    def __init__(self, screen: PanesScreen, used: str | None = None) -> None:
        super().__init__(screen)
        self._used = used
        self._found: Fetch[list[Installed]] = Fetch(self, "profiles")
        self._placed = False

    def enter(self) -> None:
        self._found.start(installed_profiles)

    def view(self) -> View:
        return self._found.view("Profiles", self._show)

    def _show(self, profiles: list[Installed]) -> View:
        title = Content(f"Profiles  {len(profiles)} installed")
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
        return View(title, lambda i: Rows([]) if i is None else self._card(profiles[i]), listing, index)

    def _item(self, profile: Installed) -> Content:
        mark = self.glyphs.here if profile.name == self._used else " "
        line = (
            Content(f"{mark} ") + padded(profile.name, 16, "bold") + text(f" {profile.version:<5} {profile.platform}")
        )
        return line + Content("  (used)") if profile.name == self._used else line

    @staticmethod
    def _card(profile: Installed) -> Rows:
        return Rows(
            Row(text(row.content.plain.lstrip("# "), "bold")) if row.content.plain.startswith("#") else row
            for row in plain_rows(profile.card).rows
        )
