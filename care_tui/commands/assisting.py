"""`care mcp`: the answers for an assistant."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from care_core.errors import UsageError
from care_core.extras import install_hint

app = typer.Typer()


@app.command("mcp")
def serve_assistant(
    folders: Annotated[
        list[Path], typer.Argument(metavar="FOLDER...", help="What the assistant may read: logs below these folders.")
    ],
) -> None:
    """Answer an assistant over MCP on stdin and stdout. It can only read, and only logs below these folders."""
    try:
        from care_tui.assistant.server import serve
    except ModuleNotFoundError as err:
        raise UsageError(f"'{err.name}' is not installed.", hint=f"{install_hint('mcp')}.") from err
    serve(folders)
