"""A defect ends the app with its traceback, without the values of variables: a diagnosis fills megabytes, which would
take a slow link minutes."""

from __future__ import annotations

from typing import Any

import rich.traceback
from rich.console import Console, ConsoleOptions, RenderResult

REPORT = "This is a defect of care, not of your robot: please report it with the log."


class ShortTraceback(rich.traceback.Traceback):
    """Rich's traceback as Textual asks for it, but without locals, and with what to do."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **{**kwargs, "show_locals": False})

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        yield from super().__rich_console__(console, options)
        yield REPORT


def shorten() -> None:
    """Have Textual print short ones: it has no setting for that, and looks the class up when it needs it."""
    rich.traceback.Traceback = ShortTraceback  # type: ignore[misc]
