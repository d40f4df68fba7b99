"""The installed profiles with their model cards."""

from __future__ import annotations

from textual.app import ComposeResult
from textual.containers import VerticalScroll
from textual.content import Content
from textual.widgets import Markdown

from care_core.application.viewing import Installed, installed_profiles
from care_core.text import clean
from care_tui.pages.page import Page, View, sentence, view_of
from care_tui.render.rows import Rows, padded, text
from care_tui.widgets.choices import Choices, Listing
from care_tui.widgets.reader import Reader

PROFILES = "profiles"


class ProfilesPage(Page):
    HELP = "The installed profiles. The text is the model card: what it was learned from, how good it is, its limits."
    _placed = False

    def compose(self) -> ComposeResult:
        yield Choices(self.glyphs.more, id="list")
        yield Reader(id="text")
        with VerticalScroll(id="card"):
            yield Markdown(open_links=False)

    @property
    def _used(self) -> str | None:
        return None if self.session.case is None else self.session.diagnosis.profile.name

    def view(self) -> View:
        return view_of("Profiles", self.fetched(PROFILES, installed_profiles), self._show)

    def _show(self, profiles: list[Installed]) -> View:
        title = Content(f"{len(profiles)} profiles are installed")
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
        return View(title, lambda _: Rows([]), listing, index)

    def _item(self, profile: Installed) -> Content:
        mark = self.glyphs.here if profile.name == self._used else " "
        line = (
            Content(f"{mark} ") + padded(profile.name, 16, "bold") + text(f" {profile.version:<5} {profile.platform}")
        )
        return line + Content("  (used)") if profile.name == self._used else line

    def show(self, index: int | None = None) -> None:
        super().show(index)
        self._show_card()

    def show_text(self, *, from_top: bool = True) -> None:
        super().show_text(from_top=from_top)
        self._show_card()

    def _show_card(self) -> None:
        """The card of the profile under the cursor, as Markdown."""
        found, index = self._answers.get(PROFILES), self.index
        card = self.query_one("#card")
        card.display = isinstance(found, list) and index is not None
        self.reader.display = not card.display
        if isinstance(found, list) and index is not None:
            card.border_title = clean(found[index].name)
            self.query_one(Markdown).update(_safe(found[index].card))


def _safe(card: str) -> str:
    """A card is written by people: nothing in it may steer the terminal."""
    return "\n".join(clean(line) for line in card.splitlines())
