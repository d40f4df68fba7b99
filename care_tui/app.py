"""The terminal app: reads one log in a worker, then walks the operator from the fault to the report."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from typing import ClassVar

from textual import on, work
from textual.app import App, SystemCommand
from textual.binding import Binding, BindingType
from textual.reactive import Reactive
from textual.screen import Screen
from textual.scrollbar import ScrollBar, ScrollBarRender
from textual.worker import Worker, get_current_worker

from care_core.errors import CareError, ExitCode
from care_tui.jobs import CancelledError, Engine, Request, as_care_error, exit_code
from care_tui.messages import DiagnosisFailed, DiagnosisReady, Progressed
from care_tui.render import ASCII, UNICODE
from care_tui.screens.base import CareScreen
from care_tui.screens.diagnosis import DiagnosisScreen
from care_tui.screens.help import HelpScreen, Keys
from care_tui.screens.loading import ErrorScreen, LoadingScreen
from care_tui.widgets.step_bar import STEPS

THEME = "ansi-dark"
"""The terminal's own colours: right on any background, with 16 colours, and half the bytes on a slow link."""


class PlainScrollBar(ScrollBarRender):
    """A scroll bar without block characters, which not every terminal has."""

    VERTICAL_BARS: ClassVar[list[str]] = [" "] * 8


class CareApp(App[int], inherit_bindings=False):
    """Owns the log being diagnosed, the exit code and the keys that work everywhere."""

    TITLE = "care"
    # Set before the app is built: only then does Textual honour NO_COLOR with the terminal's own colours.
    theme = Reactive(os.environ.get("TEXTUAL_THEME", THEME))
    CSS_PATH: ClassVar[list[str | Path]] = ["styles/app.tcss", "styles/diagnosis.tcss", "styles/dialogs.tcss"]  # type: ignore[assignment]
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("question_mark,f1", "help", "Help", key_display="?", id="app.help"),
        Binding("q", "quit", "Quit", id="app.quit"),
        # With priority, for a dialog shuts out the keys of the app.
        Binding("ctrl+c", "interrupt", "Interrupt", show=False, priority=True, id="app.interrupt"),
    ]

    def __init__(
        self,
        request: Request,
        *,
        engine: Engine | None = None,
        ascii: bool = False,
    ) -> None:
        super().__init__()
        self.animation_level = "none"
        ScrollBar.renderer = PlainScrollBar
        self.set_class(ascii, "-ascii")
        self.code = ExitCode.INTERRUPTED
        self._request = request
        self._engine = engine or Engine()
        self._glyphs = ASCII if ascii else UNICODE
        self._job: Worker[None] | None = None

    def on_mount(self) -> None:
        self.push_screen(LoadingScreen(self._request.log, self._glyphs))
        self._job = self._diagnose()

    # The work

    @work(thread=True, exclusive=True, group="diagnose", exit_on_error=False)
    def _diagnose(self) -> None:
        worker = get_current_worker()

        def progress(step: str, fraction: float) -> None:
            if worker.is_cancelled:
                raise CancelledError
            self.post_message(Progressed(step, fraction))

        try:
            diagnosis = self._engine.diagnose(self._request, progress)
            progress("Done", 1.0)
        except CancelledError:
            return
        except Exception as err:
            self.post_message(DiagnosisFailed(as_care_error(err)))
        else:
            self.post_message(DiagnosisReady(diagnosis))

    @on(Progressed)
    def _show_progress(self, event: Progressed) -> None:
        if isinstance(self.screen, LoadingScreen):
            self.screen.advance(event.step, event.fraction)

    @on(DiagnosisReady)
    def _show_diagnosis(self, event: DiagnosisReady) -> None:
        self.code = exit_code(event.diagnosis)
        self._replace(DiagnosisScreen(event.diagnosis, self._engine, self._glyphs))

    @on(DiagnosisFailed)
    def _show_error(self, event: DiagnosisFailed) -> None:
        self.code = event.error.exit_code
        self._replace(ErrorScreen(event.error))

    def _replace(self, screen: CareScreen) -> None:
        """Put the next screen in place of the current one, below a help screen that may be open."""
        while isinstance(self.screen, HelpScreen):
            self.pop_screen()
        self.switch_screen(screen)

    def action_cancel(self) -> None:
        """Stop the engine at its next step; what it still answers is ignored."""
        if self._job is not None:
            self._job.cancel()
        self.code = ExitCode.INTERRUPTED
        self._replace(ErrorScreen(CareError("The diagnosis was cancelled.", hint="r starts it again, q quits.")))

    def action_retry(self) -> None:
        self.code = ExitCode.INTERRUPTED
        self._replace(LoadingScreen(self._request.log, self._glyphs))
        self._job = self._diagnose()

    # Keys and commands that work everywhere

    async def action_quit(self) -> None:
        self.workers.cancel_all()
        self.exit(self.code)

    def action_interrupt(self) -> None:
        self.workers.cancel_all()
        self.exit(ExitCode.INTERRUPTED)

    def action_help(self) -> None:
        screen = self.screen
        if isinstance(screen, CareScreen):
            self.push_screen(HelpScreen(screen.help_text(), self._keys_of(screen)))

    def _keys_of(self, screen: Screen[None]) -> Keys:
        """Every key that works on the screen, keys of one action together, in the order they are looked up."""
        keys: dict[str, list[str]] = {}
        # Keys with priority come first there; they are those of the app and belong at the end.
        for key, active in sorted(screen.active_bindings.items(), key=lambda item: item[1].binding.priority):
            description = active.binding.description
            if active.enabled and description and active.binding.id:
                keys.setdefault(description, []).append(self.get_key_display(active.binding.with_key(key)))
        return [(" ".join(shown), description) for description, shown in keys.items()]

    def get_key_display(self, binding: Binding) -> str:
        """How a key is written; by its name where arrows and the like cannot be drawn."""
        return (binding.key_display or binding.key) if self._glyphs is ASCII else super().get_key_display(binding)

    def get_system_commands(self, screen: Screen[object]) -> Iterable[SystemCommand]:
        """What the command palette offers."""
        if isinstance(screen, DiagnosisScreen):
            for number, name in enumerate(STEPS, start=1):
                yield SystemCommand(f"Go to {name}", f"Step {number}", lambda number=number: screen.action_go(number))
            yield SystemCommand("Export the report", "Write it to a file", screen.action_export)
        yield SystemCommand("Help", "The keys that work here", self.action_help)
        yield SystemCommand("Theme", "Change the colours", self.action_change_theme)
        yield SystemCommand("Quit", "Leave care", self.action_quit)


def run(request: Request, *, ascii: bool = False) -> int:
    """Open the app on a log; answers the exit code."""
    app = CareApp(request, ascii=ascii)
    answer = app.run()
    return int(app.code if answer is None else answer)
