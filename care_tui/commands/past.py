"""`care history`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from care_core.errors import CareError, UsageError
from care_tui.commands.arguments import AsJson, Force, Out, is_json
from care_tui.console import emit, say

app = typer.Typer()

NoHistory = Annotated[bool, typer.Option("--no-history", help="Do not remember this in the history.")]


def mention(problem: CareError | None) -> None:
    """Say why something was not remembered. A history that cannot be used costs a sentence, never the work."""
    if problem is not None:
        say(f"care: {problem}")


@app.command()
def history(
    profile: Annotated[str | None, typer.Option("--profile", "-p", help="Only runs of this profile.")] = None,
    limit: Annotated[int, typer.Option("--limit", min=1, help="How many triages are listed.")] = 20,
    json: AsJson = False,
    ascii: Annotated[bool, typer.Option("--ascii", help="Draw trends without block characters.")] = False,
    card: Annotated[
        Path | None,
        typer.Option("--card", metavar="FOLDER", help="Write this profile's verified fixes beside its card."),
    ] = None,
    out: Out = None,
    force: Force = False,
) -> None:
    """List past triages and verified fixes. With the trend of each objective, and how often fixes worked."""
    from care_core.history.store import SWITCH, History, history_path
    from care_core.history.track_record import track_record, write_record
    from care_core.profile.store import load_profile
    from care_core.report.history import history_document, history_json, history_text

    path = history_path()
    if path is None:
        raise UsageError("The history is switched off.", hint=f"Unset {SWITCH}.", where=SWITCH)
    store = History(path)
    if card is not None:
        chosen = load_profile(card)
        written = write_record(chosen.path, track_record(store.verifications(chosen.schema.name)))
        say(f"wrote {written}")
    document = history_document(store.triages(profile, limit), store.verifications(profile))
    emit(history_json(document) if json or is_json(out) else history_text(document, ascii=ascii), out, force=force)
