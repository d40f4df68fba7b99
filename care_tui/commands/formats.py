"""`care schema`: the published formats."""

from __future__ import annotations

import typer

from care_tui.console import emit

app = typer.Typer(help="Published formats.", rich_markup_mode=None)


@app.callback()
def _formats() -> None:
    pass


@app.command("triage")
def triage() -> None:
    """Print the JSON Schema of 'care triage --json'."""
    from json import dumps

    from care_core.report import json_schema

    emit(dumps(json_schema(), indent=2) + "\n")


@app.command("inspect")
def inspect() -> None:
    """Print the JSON Schema of 'care inspect --json'."""
    from json import dumps

    from care_core.report.inspection import inspection_schema

    emit(dumps(inspection_schema(), indent=2) + "\n")
