"""The terminal app: settings, keys and colours that hold everywhere. The walk does the work."""

from __future__ import annotations

import asyncio
import os
import signal
import threading
import time
from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import ClassVar

from textual.app import App, SystemCommand
from textual.binding import Binding, BindingType
from textual.events import CursorPosition, Paste
from textual.reactive import Reactive
from textual.screen import Screen
from textual.scrollbar import ScrollBar, ScrollBarRender

from care_core.application.case import Case, Request
from care_core.diagnose.verdict import verdict_of
from care_core.errors import CareError, ExitCode, UsageError, nearest
from care_tui.hangup import on_hangup
from care_tui.jobs import Engine
from care_tui.link import Link
from care_tui.places import as_path, is_openable
from care_tui.render.rows import ASCII, UNICODE
from care_tui.screens.base import CareScreen
from care_tui.screens.help import HelpScreen, Keys
from care_tui.screens.panes import PanesScreen
from care_tui.screens.walk import VIEWS, WalkScreen
from care_tui.settings import SERVER, Settings
from care_tui.themes import DEFAULT, HIGH_CONTRAST
from care_tui.widgets.step_bar import STEPS

_LEAVE_S, _MOST_S = 0.05, 3.0
"""How often an app that is about to end looks whether the terminal's last answer is there: a shell would take it for
typed."""
_LOOK_S = 2.0
"""How often an app in a browser looks for its server."""


class PlainScrollBar(ScrollBarRender):
    """A scroll bar without block characters, which not every terminal has."""

    VERTICAL_BARS: ClassVar[list[str]] = [" "] * 8


class CareApp(App[int], inherit_bindings=False):
    """Owns the exit code and what works everywhere."""

    TITLE = "care"
    # Set before the app is built: only then does Textual honour NO_COLOR with the terminal's own colours.
    theme = Reactive(os.environ.get("TEXTUAL_THEME", DEFAULT))
    CSS_PATH: ClassVar[list[str | Path]] = ["styles/app.tcss", "styles/dialogs.tcss"]  # type: ignore[assignment]
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("question_mark,f1", "help", "Help", key_display="?", id="app.help"),
        Binding("q", "quit", "Quit", id="app.quit"),
        # With priority, for a dialog shuts out the keys of the app.
        Binding("ctrl+z", "suspend_process", "To the shell", show=False, priority=True, id="app.suspend"),
        Binding("ctrl+c", "interrupt", "Interrupt", show=False, priority=True, id="app.interrupt"),
    ]

    def __init__(
        self,
        request: Request | None = None,
        *,
        engine: Engine | None = None,
        settings: Settings | None = None,
    ) -> None:
        super().__init__()
        settings = settings or Settings()
        self.animation_level = "none"
        ScrollBar.renderer = PlainScrollBar
        self.register_theme(HIGH_CONTRAST)
        if settings.theme:
            if settings.theme not in self.available_themes:
                hint = nearest(settings.theme, self.available_themes) or f"Such as '{HIGH_CONTRAST.name}'."
                raise UsageError(f"There is no theme '{settings.theme}'.", hint=hint, where="theme")
            self.theme = settings.theme
        self.set_keymap(dict(settings.keys))
        self.set_class(settings.ascii, "-ascii")
        self.link = Link(self.write_control, self._writes_waiting)
        self.code = ExitCode.INTERRUPTED if request else ExitCode.OK
        self._glyphs = ASCII if settings.ascii else UNICODE
        self._walk = WalkScreen(engine or Engine(), settings, self._glyphs, request=request)

    def on_mount(self) -> None:
        self._end_on_signals()
        if SERVER in os.environ:
            self.set_interval(_LOOK_S, self._end_with_server)
        self.push_screen(self._walk)

    def _end_on_signals(self) -> None:
        """A lost connection or a polite kill ends the app as `q` does, so the terminal is given back as it was."""
        loop = asyncio.get_running_loop()
        if threading.current_thread() is threading.main_thread():  # no other thread may be told of signals
            loop.add_signal_handler(signal.SIGTERM, self.action_interrupt)
            on_hangup(
                partial(loop.call_soon_threadsafe, self.action_interrupt),
                partial(loop.call_soon_threadsafe, self._lose_terminal),
            )

    def _end_with_server(self) -> None:
        """In a browser, end when the server is gone, however it ended: nobody could close the app any more."""
        server = os.environ.get(SERVER)
        if server is not None and os.getppid() != int(server):
            self.exit()

    def note(self, answer: Case | CareError) -> None:
        """Remember what the last diagnosis means for the exit code."""
        self.code = answer.exit_code if isinstance(answer, CareError) else verdict_of(answer.diagnosis).exit_code

    def write_control(self, sequence: str) -> None:
        """Send a control sequence to the terminal."""
        if self._driver is not None:
            self._driver.write(sequence)

    def _writes_waiting(self) -> int:
        """Writes that the thread which writes to the terminal has not begun; drivers without one keep none."""
        thread = getattr(self._driver, "_writer_thread", None)
        return 0 if thread is None else int(thread._queue.qsize())

    def post_display_hook(self) -> None:
        if self._driver is not None and not self.is_headless and not self.is_web:
            self.link.drawn()

    def on_cursor_position(self, _event: CursorPosition) -> None:
        self.link.answered()

    def on_paste(self, event: Paste) -> None:
        """A file that is dropped on the terminal arrives as its pasted path."""
        path = as_path(event.text)
        if event.text.strip() and "\n" not in event.text.strip() and (path.is_file() or is_openable(path)):
            while self.screen is not self._walk:
                self.pop_screen()
            self._walk.open_log(path)

    def _fatal_error(self) -> None:
        """End after a defect with its traceback, without the values of variables: a diagnosis fills megabytes."""
        from rich.console import Group
        from rich.traceback import Traceback

        report = "This is a defect of care, not of your robot: please report it with the log."
        self.panic(Group(Traceback(show_locals=False), report))

    # Keys and commands that work everywhere

    async def action_quit(self) -> None:
        self._leave(self.code)

    def action_interrupt(self) -> None:
        self._leave(ExitCode.INTERRUPTED)

    def _leave(self, code: ExitCode) -> None:
        self._cancel_all()
        self._exit_with(code, time.monotonic() + _MOST_S)

    def _lose_terminal(self) -> None:
        self._cancel_all()
        self.exit(ExitCode.INTERRUPTED)

    def _cancel_all(self) -> None:
        for screen in self.screen_stack:
            if isinstance(screen, PanesScreen):
                screen.cancel_all()

    def _exit_with(self, code: ExitCode, at_the_latest_s: float) -> None:
        """Once the terminal has shown the last frame; one that takes nothing any more is not waited for."""
        if self.link.is_busy and time.monotonic() < at_the_latest_s:
            self.set_timer(_LEAVE_S, lambda: self._exit_with(code, at_the_latest_s))
        else:
            self.exit(code)

    def action_help(self) -> None:
        screen = self.screen
        if isinstance(screen, CareScreen):
            self.push_screen(HelpScreen(screen.help_text(), self._keys_of(screen), screen.help_first()))

    def _keys_of(self, screen: CareScreen) -> Keys:
        """Every key that works on the screen, keys of one action together, those of the page first."""
        keys: dict[tuple[str, str], list[str]] = {}
        for key, active in sorted(screen.active_bindings.items(), key=lambda item: _order(item[1].binding)):
            binding = active.binding
            if active.enabled and binding.description and binding.id:
                does = (
                    screen.described(binding),
                    binding.id.split(".")[0] if binding.id.startswith("step.") else binding.id,
                )
                keys.setdefault(does, []).append(self.get_key_display(binding.with_key(key)))
        return [(" ".join(shown), description, id) for (description, id), shown in keys.items()]

    def get_key_display(self, binding: Binding) -> str:
        """How a key is written; by its name where arrows and the like cannot be drawn."""
        is_named = self._glyphs is ASCII or binding.key == "enter"
        return (binding.key_display or binding.key) if is_named else super().get_key_display(binding)

    def get_system_commands(self, screen: Screen[object]) -> Iterable[SystemCommand]:
        """What the command palette offers: the steps, and every action of the page."""
        if isinstance(screen, WalkScreen):
            for number, name in enumerate(STEPS, start=1):
                yield SystemCommand(f"Go to {name}", f"Step {number}", lambda number=number: screen.action_go(number))
            for view in VIEWS:
                yield SystemCommand(view.capitalize(), VIEWS[view], lambda view=view: screen.action_view(view))
        if isinstance(screen, PanesScreen):
            for name in sorted(filter(screen.page.works, screen.page.ACTIONS)):
                about = (getattr(screen.page, name).__doc__ or "").strip().splitlines()
                yield SystemCommand(
                    name.replace("_", " ").capitalize(), about[0] if about else "", getattr(screen.page, name)
                )
        yield SystemCommand("Help", "The keys that work here", self.action_help)
        yield SystemCommand("Theme", "Change the colours", self.action_change_theme)
        yield SystemCommand("Quit", "Leave care", self.action_quit)


def _order(binding: Binding) -> int:
    """Where a key belongs in the list of keys: what only this page can do first, what works everywhere last."""
    places = ("do(", "open", "back", "filter", "go(", "view(", "move(")
    if binding.priority and not binding.action.startswith("do("):
        return len(places) + 1
    return next((place for place, start in enumerate(places) if binding.action.startswith(start)), len(places))


def run(request: Request | None, settings: Settings) -> int:
    """Open the app; answers the exit code."""
    app = CareApp(request, settings=settings)
    answer = app.run(mouse=settings.mouse)
    return int(ExitCode.USAGE if answer is None else answer)
