"""The terminal app: settings, keys and colours that hold everywhere. The walk does the work."""

from __future__ import annotations

import asyncio
import os
import signal
import sys
import threading
import time
from collections.abc import Generator, Iterable
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

from textual.app import App, SystemCommand
from textual.binding import ActiveBinding, Binding, BindingType
from textual.command import CommandPalette
from textual.driver import Driver
from textual.events import CursorPosition, Paste, Resize
from textual.reactive import Reactive
from textual.screen import Screen

from care_core.application.case import Case, Request
from care_core.diagnose.verdict import verdict_of
from care_core.errors import CareError, ExitCode, UsageError, nearest
from care_core.text import clean
from care_tui.engine import Engine
from care_tui.hangup import on_hangup
from care_tui.link import Link, linked
from care_tui.page_names import LOGS, STEPS, VIEWS
from care_tui.pages.page import OPEN, label_of
from care_tui.places import as_path, is_openable
from care_tui.render.rows import ASCII, UNICODE
from care_tui.screens.case import CaseScreen
from care_tui.screens.help import HelpScreen, Keys
from care_tui.settings import SERVER, Settings
from care_tui.themes import DEFAULT, HIGH_CONTRAST, OWN_COLOURS
from care_tui.threads import DaemonThreads
from care_tui.workspace import Workspace

_LEAVE_S, _MOST_S = 0.05, 3.0
"""How often an app that is about to end looks whether the terminal's last answer is there: a shell would take it for
typed."""
_LOOK_S = 2.0
"""How often an app in a browser looks for its server."""
_FREE_S = 0.05
"""How often is looked whether the terminal has shown the last frame, where it does not say so itself."""


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
        self.register_theme(HIGH_CONTRAST)
        if settings.theme:
            if settings.theme not in self.available_themes:
                hint = nearest(settings.theme, self.available_themes) or f"Such as '{HIGH_CONTRAST.name}'."
                raise UsageError(f"There is no theme '{settings.theme}'.", hint=hint, where="theme")
            self.theme = settings.theme
        self.set_keymap(dict(settings.keys))
        self.set_class(settings.ascii, "-ascii")
        self.code = ExitCode.INTERRUPTED if request else ExitCode.OK
        glyphs = ASCII if settings.ascii else UNICODE
        folder = None if request is None or not is_folder_of_logs(request.log) else request.log.absolute()
        self.workspace = Workspace(engine or Engine(), settings, glyphs, request, request, folder=folder)
        self._case = CaseScreen(self.workspace)
        self._held = ExitStack()
        """Updates that are held back while the last frame is under way to the terminal."""
        self.is_held = False
        self._batches = 0
        self._lost_a_frame = False

    def get_driver_class(self) -> type[Driver]:
        self.link = Link()  # Textual asks for the driver's class while the app is built
        return linked(super().get_driver_class(), self.link)

    def get_css_variables(self) -> dict[str, str]:
        own = OWN_COLOURS if self.theme == DEFAULT else {}
        return {**super().get_css_variables(), "frame": "ansi_bright_black", **own}

    def on_mount(self) -> None:
        asyncio.get_running_loop().set_default_executor(DaemonThreads())
        self._end_on_signals()
        if SERVER in os.environ:
            self.set_interval(_LOOK_S, self._end_with_server)
        self.push_screen(self._case)
        self.call_after_refresh(_shorten_tracebacks)

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

    # The link to the terminal

    def write_control(self, sequence: str) -> None:
        """Send a control sequence to the terminal."""
        if self.link.write is not None:
            self.link.write(sequence)

    @contextmanager
    def batch_update(self) -> Generator[None, None, None]:
        """Hold all repaints back. What Textual would draw at once meanwhile, as after a change of size, it drops: then
        all is painted at the end."""
        self._batches += 1
        try:
            with super().batch_update():
                yield
        finally:
            self._batches -= 1
            if self._lost_a_frame and not self._batches and self.screen_stack:
                self._lost_a_frame = False
                self.screen.refresh()

    def post_display_hook(self) -> None:
        """A frame was drawn: what changes from now on waits until the terminal has shown it."""
        if self._batches:
            self._lost_a_frame = True
            return
        self.link.drawn()
        if self.link.is_busy and not self.is_held:
            self.is_held = True
            self._held.enter_context(self.batch_update())
            self.set_timer(_FREE_S, self._release_when_free)

    def _release_when_free(self) -> None:
        if self.link.is_busy and self.is_held:
            self.set_timer(_FREE_S, self._release_when_free)
        else:
            self.release()

    def release(self) -> None:
        """Draw what was held back."""
        if self.is_held:
            self.is_held = False
            self._held.close()
            if self.screen_stack:  # none is left as the app closes
                self.screen.check_idle()

    def on_resize(self, event: Resize) -> None:
        self.link.width = event.size.width

    def on_cursor_position(self, _event: CursorPosition) -> None:
        self.link.answered()
        self.release()

    async def on_paste(self, event: Paste) -> None:
        """A file that is dropped on the terminal arrives as its pasted path."""
        path = as_path(event.text)
        if event.text.strip() and "\n" not in event.text.strip() and (os.path.isfile(path) or is_openable(path)):
            while self.screen is not self._case:
                await self.pop_screen()
            await self._case.open_log(path)

    def notify(self, message: str, **how: Any) -> None:
        """Tell something in passing, in place of what was told before: the same word thrice is one."""
        self.clear_notifications()
        super().notify(message, **how)

    # Keys and commands that work everywhere

    async def action_quit(self) -> None:
        self._leave(self.code)

    def action_interrupt(self) -> None:
        self._leave(ExitCode.INTERRUPTED)

    def _leave(self, code: ExitCode) -> None:
        self.workers.cancel_all()
        self._exit_with(code, time.monotonic() + _MOST_S)

    def _lose_terminal(self) -> None:
        self.workers.cancel_all()
        self.exit(ExitCode.INTERRUPTED)

    def _exit_with(self, code: ExitCode, at_the_latest_s: float) -> None:
        """Once the terminal has shown the last frame; one that takes nothing any more is not waited for."""
        if self.link.is_busy and time.monotonic() < at_the_latest_s:
            self.set_timer(_LEAVE_S, lambda: self._exit_with(code, at_the_latest_s))
        else:
            self.exit(code)

    def action_help(self) -> None:
        screen = self.screen
        if isinstance(screen, CaseScreen):
            self.push_screen(
                HelpScreen(self.workspace.glyphs, screen.page.HELP, self._keys_of(screen), screen.page.help_first())
            )

    def _keys_of(self, screen: CaseScreen) -> Keys:
        """Every key that works on the screen, keys of one action together, those of the page first."""
        keys: dict[tuple[str, str], list[str]] = {}
        nodes = list(screen.page.ancestors_with_self)

        def order(active: ActiveBinding) -> int:
            return -1 if active.node is screen.page else nodes.index(active.node) if active.node in nodes else 0

        for key, active in sorted(screen.active_bindings.items(), key=lambda item: order(item[1])):
            binding = active.binding
            if active.enabled and binding.description and binding.id:
                keys.setdefault((label_of(active), binding.id), []).append(self.get_key_display(binding.with_key(key)))
        return [(" ".join(shown), description, id) for (description, id), shown in keys.items()]

    def get_key_display(self, binding: Binding) -> str:
        """How a key is written; by its name where arrows and the like cannot be drawn."""
        shown = super().get_key_display(binding)
        is_named = binding.key == "enter" or (self.workspace.glyphs is ASCII and not shown.isascii())
        return (binding.key_display or binding.key) if is_named else shown

    def action_command_palette(self) -> None:
        """Show the command palette."""
        if not isinstance(self.screen, CommandPalette):
            self.push_screen(CommandPalette(placeholder="Search for commands...", id="--command-palette"))

    def get_system_commands(self, screen: Screen[object]) -> Iterable[SystemCommand]:
        """What the command palette offers, each with its keys: the pages by the names of their tabs, and what the page
        does; but for Enter, which leads to one of the pages."""
        if isinstance(screen, CaseScreen):
            keys = {id: shown for shown, _, id in self._keys_of(screen)}
            for page in (*STEPS, *VIEWS, LOGS):
                about = f"{page.about} ({keys.get(page.binding, page.key)})"
                yield SystemCommand(page.title, about, partial(screen.run_action, f"screen.go('{page.name}')"))
            own = {one.binding.id: one for one in screen.active_bindings.values() if one.node is screen.page}
            for id, active in own.items():
                if id in keys and id != OPEN:
                    binding = active.binding
                    action = binding.action.partition("(")[0]
                    doc = binding.tooltip or getattr(screen.page, f"action_{action}").__doc__ or ""
                    about = f"{doc.strip().rstrip('.')} ({keys[id]})"
                    yield SystemCommand(label_of(active), about, partial(screen.page.run_action, binding.action))
        yield SystemCommand("Help", "The keys that work here", self.action_help)
        yield SystemCommand("Theme", "Change the colours", self.action_change_theme)
        yield SystemCommand("Quit", "Leave care", self.action_quit)


def is_folder_of_logs(path: Path) -> bool:
    """Whether this is a folder to choose a log from, and no recording that is a folder."""
    return os.path.isdir(path) and not is_openable(path)


def _shorten_tracebacks() -> None:
    """After the first frame, which the import of what prints them would hold up."""
    from care_tui.tracebacks import shorten

    shorten()


def run(request: Request | None, settings: Settings) -> int:
    """Open the app; answers the exit code."""
    app = CareApp(request, settings=settings)
    answer = app.run(mouse=settings.mouse)
    for file in dict.fromkeys(app.workspace.written):
        print(f"wrote {clean(str(file))}", file=sys.stderr)
    return int(ExitCode.USAGE if answer is None else answer)
