"""What all pages work with: the engine, the settings, and the session of the log that is open."""

from __future__ import annotations

from pathlib import Path

from care_core.application.case import Request
from care_core.records import Struct, field
from care_tui.engine import Engine
from care_tui.render.rows import Glyphs
from care_tui.session import Session
from care_tui.settings import Settings


class Workspace(Struct, eq=False):
    """Handed to every page; the screen replaces the session when another log is opened."""

    engine: Engine
    settings: Settings
    glyphs: Glyphs
    request: Request | None = None
    session: Session = field(default_factory=Session)
    written: list[Path] = field(default_factory=list)
    """Files that were written, for the terminal to name when the app is left."""
    folder: Path | None = None
    """The folder of logs that was named instead of one."""

    @property
    def places(self) -> tuple[Path, ...]:
        """Where logs are looked for."""
        return self.settings.places if self.folder is None else (self.folder,)
