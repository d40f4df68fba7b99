"""`care serve`: the terminal app in a browser."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from care_core.errors import UsageError
from care_core.extras import install_hint
from care_core.text import clean
from care_tui.commands.arguments import ConfigPaths, ProfileName
from care_tui.console import emit, say
from care_tui.settings import SERVER
from care_tui.start import own_command

app = typer.Typer()


@app.command()
def serve(
    log: Annotated[Path | None, typer.Argument(metavar="[LOG]", show_default=False)] = None,
    profile: ProfileName = None,
    config: ConfigPaths = None,
    port: Annotated[int, typer.Option("--port", min=1, max=65535, help="Port on this machine.")] = 8765,
) -> None:
    """Open the terminal app in a browser of this machine. For another one: ssh -L 8765:127.0.0.1:8765 ROBOT."""
    import secrets
    import shlex

    try:
        from care_tui.web import HOST, TokenServer
    except ModuleNotFoundError as err:
        raise UsageError(f"'{err.name}' is not installed.", hint=f"{install_hint('serve')}.") from err

    _check_free(HOST, port)
    os.environ[SERVER] = str(os.getpid())
    words = [str(log.absolute())] if log else []
    words += ["--profile", profile] if profile else []
    words += [word for path in config or () for word in ("--config", path)]
    title = f"{clean(log.name)} - care" if log else "care"
    replaced = "exec " if os.name == "posix" else ""  # the app is to be the server's own child, not a shell's
    server = TokenServer(f"{replaced}{shlex.join(own_command(*words))}", port, secrets.token_urlsafe(24), title)
    emit(f"{server.address}\n")
    say("Open this address in a browser of this machine. Ctrl+C ends it.")
    server.serve()


def _check_free(host: str, port: int) -> None:
    import socket

    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError as err:
            hint = "Choose another with --port."
            raise UsageError(f"Port {port} cannot be used: {err.strerror}.", hint=hint) from err
