"""`care checks`: what every log is looked at for."""

from __future__ import annotations

from typing import Annotated

import typer

from care_tui.console import emit

app = typer.Typer()

Explain = Annotated[bool, typer.Option("--explain", help="With each limit, its unit and where it comes from.")]


@app.command()
def checks(
    explain: Explain = False,
) -> None:
    """List the health checks, and what each looks for."""
    from care_core.report.checks import checks_text

    emit(checks_text(explain=explain))
