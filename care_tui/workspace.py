"""What all pages work with: the engine, the settings, and the session of the log that is open."""

from __future__ import annotations

from pathlib import Path

from care_core.application.case import Request
from care_core.records import Struct, field, replace
from care_tui.engine import CAUSES, Engine
from care_tui.render.rows import Glyphs
from care_tui.session import Session
from care_tui.settings import Settings

_CHOSEN = {
    "profile": "the profile that was named",
    "configs": "the configuration file",
    "keep": "what is to be kept",
    "thresholds": "your limits",
    "since": "the good run",
    "reference": "the reference",
}
"""What a log is judged by, in the words that name it to whoever chose it."""


class Workspace(Struct, eq=False):
    """Handed to every page; the screen replaces the session when another log is opened."""

    engine: Engine
    settings: Settings
    glyphs: Glyphs
    given: Request | None = None
    """What was asked for when the app was called."""
    request: Request | None = None
    """What the log that is open is judged by."""
    session: Session = field(default_factory=Session)
    written: list[Path] = field(default_factory=list)
    """Files that were written, for the terminal to name when the app is left."""
    folder: Path | None = None
    """The folder of logs that was named instead of one."""

    def request_for(self, path: Path) -> Request:
        """How a log is judged: as it was asked for on this log before, or on its folder. The options that were given
        for another log are that one's, but for the limits of the site."""
        for asked in (self.request, self.given):
            if asked is not None and asked.log.absolute() == path.absolute():
                return asked
        if self.given is not None and self.folder is not None and path.absolute().is_relative_to(self.folder):
            return replace(self.given, log=path)
        return Request(path, top=CAUSES, site=self.given.site if self.given else None)

    @property
    def places(self) -> tuple[Path, ...]:
        """Where logs are looked for."""
        return self.settings.places if self.folder is None else (self.folder,)


def left_out(before: Request, now: Request) -> list[str]:
    """By what one log is judged and another is not: options of the command line, or what was chosen in the app."""
    return [
        words
        for name, words in _CHOSEN.items()
        if getattr(before, name) and getattr(before, name) != getattr(now, name)
    ]
