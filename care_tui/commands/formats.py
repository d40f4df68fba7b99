"""`care schema`: the published formats."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from json import dumps
from typing import TYPE_CHECKING

import typer

from care_tui.console import emit

if TYPE_CHECKING:
    from care_core.report.published import Document

app = typer.Typer(name="schema", help="Published formats.", rich_markup_mode=None)

DOCUMENTS: Mapping[str, tuple[str, str]] = {
    "baseline": ("baseline", "BaselineDocument"),
    "collect": ("collection", "CollectDocument"),
    "fleet": ("fleet", "FleetDocument"),
    "graph": ("graph", "GraphDocument"),
    "compare": ("comparison", "CompareDocument"),
    "doctor": ("checkup", "DoctorDocument"),
    "history": ("history", "HistoryDocument"),
    "lint": ("linting", "LintDocument"),
    "triage": ("document", "TriageDocument"),
    "inspect": ("inspection", "InspectDocument"),
    "verify": ("verification", "VerifyDocument"),
    "watch": ("watching", "WatchEntry"),
    "whatif": ("whatif", "WhatIfDocument"),
}
"""By the command that prints it with --json, the module of `care_core.report` and the document."""


@app.callback()
def _formats() -> None:
    pass


def document(command: str) -> type[Document]:
    """What a command prints with --json, imported when it is asked for."""
    module, name = DOCUMENTS[command]
    kind: type[Document] = getattr(import_module(f"care_core.report.{module}"), name)
    return kind


def _printing(command: str) -> Callable[[], None]:
    return lambda: emit(dumps(document(command).json_schema(), indent=2) + "\n")


for _command in DOCUMENTS:
    _what = "a line of " if _command == "watch" else ""
    app.command(_command, help=f"Print the JSON Schema of {_what}'care {_command} --json'.")(_printing(_command))
