"""`care schema`: the published formats."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import typer

from care_tui.console import emit

app = typer.Typer(name="schema", help="Published formats.", rich_markup_mode=None)


@app.callback()
def _formats() -> None:
    pass


@app.command("baseline")
def baseline() -> None:
    """Print the JSON Schema of 'care baseline --json'."""
    from care_core.report.baseline import baseline_schema

    _print(baseline_schema())


@app.command("collect")
def collect() -> None:
    """Print the JSON Schema of 'care collect --json'."""
    from care_core.report.collection import collect_schema

    _print(collect_schema())


@app.command("fleet")
def fleet() -> None:
    """Print the JSON Schema of 'care fleet --json'."""
    from care_core.report.fleet import fleet_schema

    _print(fleet_schema())


@app.command("graph")
def graph() -> None:
    """Print the JSON Schema of 'care graph --json'."""
    from care_core.report.graph import graph_schema

    _print(graph_schema())


@app.command("compare")
def compare() -> None:
    """Print the JSON Schema of 'care compare --json'."""
    from care_core.report.comparison import compare_schema

    _print(compare_schema())


@app.command("doctor")
def doctor() -> None:
    """Print the JSON Schema of 'care doctor --json'."""
    from care_core.report.checkup import doctor_schema

    _print(doctor_schema())


@app.command("history")
def history() -> None:
    """Print the JSON Schema of 'care history --json'."""
    from care_core.report.history import history_schema

    _print(history_schema())


@app.command("lint")
def lint() -> None:
    """Print the JSON Schema of 'care lint --json'."""
    from care_core.report.linting import lint_schema

    _print(lint_schema())


@app.command("triage")
def triage() -> None:
    """Print the JSON Schema of 'care triage --json'."""
    from care_core.report.document import json_schema

    _print(json_schema())


@app.command("inspect")
def inspect() -> None:
    """Print the JSON Schema of 'care inspect --json'."""
    from care_core.report.inspection import inspection_schema

    _print(inspection_schema())


@app.command("verify")
def verify() -> None:
    """Print the JSON Schema of 'care verify --json'."""
    from care_core.report.verification import verify_schema

    _print(verify_schema())


@app.command("watch")
def watch() -> None:
    """Print the JSON Schema of a line of 'care watch --json'."""
    from care_core.report.watching import watch_schema

    _print(watch_schema())


@app.command("whatif")
def whatif() -> None:
    """Print the JSON Schema of 'care whatif --json'."""
    from care_core.report.whatif import whatif_schema

    _print(whatif_schema())


def _print(schema: Mapping[str, Any]) -> None:
    from json import dumps

    emit(dumps(schema, indent=2) + "\n")
