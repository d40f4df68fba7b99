"""A text sent to the operator's clipboard, and to a file, for no terminal says whether it took it."""

from __future__ import annotations

import os
import tempfile
from typing import TYPE_CHECKING, Any, cast

from textual.app import App

from care_tui.clipboard import fits, osc52

if TYPE_CHECKING:
    from care_tui.app import CareApp


def copy(app: App[Any], text: str, what: str, suffix: str) -> str:
    """Send the text; answers what there is to say of it."""
    handle, name = tempfile.mkstemp(prefix="care-", suffix=suffix)
    with os.fdopen(handle, "w", encoding="utf-8") as stream:
        stream.write(text)
    if not fits(text):
        return f"Too long for the clipboard: {what} are in {name}"
    cast("CareApp", app).write_control(osc52(text))
    return f"Sent {what} to the clipboard; also in {name}"
