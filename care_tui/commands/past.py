"""`care history`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from care_core.errors import CareError, UsageError, nearest
from care_tui.commands.arguments import AsJson, Force, Out, is_json, profile_option
from care_tui.console import emit, say

if TYPE_CHECKING:
    from care_core.history.store import Triaged

app = typer.Typer()

NoHistory = Annotated[bool, typer.Option("--no-history", help="Do not remember this in the history.")]


def mention(problem: CareError | None) -> None:
    """Say why something was not remembered. A history that cannot be used costs a sentence, never the work."""
    if problem is not None:
        say(f"care: {problem}")


@app.command()
def history(
    profile: Annotated[str | None, profile_option("Only runs of this profile.")] = None,
    robot: Annotated[str | None, typer.Option("--robot", metavar="NAME", help="Only runs of this robot.")] = None,
    limit: Annotated[int, typer.Option("--limit", min=1, help="How many triages are listed.")] = 20,
    json: AsJson = False,
    ascii: Annotated[bool, typer.Option("--ascii", help="Draw trends without block characters.")] = False,
    everything: Annotated[
        bool, typer.Option("--all", help="Robots and missions with too few runs to show a trend, too.")
    ] = False,
    card: Annotated[
        Path | None,
        typer.Option("--card", metavar="FOLDER", help="Write this profile's verified fixes beside its card."),
    ] = None,
    export: Annotated[
        Path | None, typer.Option("--export", metavar="FILE", help="Write a row for each run to this .csv or .parquet.")
    ] = None,
    out: Out = None,
    force: Force = False,
) -> None:
    """List past triages and verified fixes. Says whether it gets worse, on which robot, since which change."""
    from care_core.history.store import SWITCH, History, history_path
    from care_core.history.track_record import track_record, write_record
    from care_core.profile.store import load_profile
    from care_core.report.history import history_document, history_text

    path = history_path()
    if path is None:
        raise UsageError("The history is switched off.", hint=f"Unset {SWITCH}.", where=SWITCH)
    store = History(path)
    if card is not None:
        chosen = load_profile(card)
        written = write_record(chosen.path, track_record(store.verifications(chosen.schema.name)))
        say(f"wrote {written}")
    triages = store.triages(profile)
    if robot is not None:
        triages = _of_robot(triages, robot)
    if export is not None:
        from care_core.report.exporting import KIND, export_history
        from care_core.tables.rows import check_table_path

        check_table_path(export, KIND)
        say(f"wrote {export}: {export_history(export, triages)} runs")
        return
    document = history_document(triages, store.verifications(profile), limit)
    as_json = json or is_json(out)
    text = document.to_json() if as_json else history_text(document, ascii=ascii, everything=everything)
    emit(text, out, force=force, is_plain=not as_json)


def _of_robot(triages: tuple[Triaged, ...], name: str) -> tuple[Triaged, ...]:
    """Those of the robot of this id or name, whatever the case. Raises UsageError where there is none."""
    known = {word: one.robot for one in triages if one.robot for word in (one.robot.id, one.robot.name)}
    found = {robot.id for word, robot in known.items() if word.casefold() == name.casefold()}
    if not found:
        hint = nearest(name, known) or "'care history' lists them."
        raise UsageError(f"No run of a robot '{name}' is remembered.", hint=hint, where="--robot")
    return tuple(one for one in triages if one.robot is not None and one.robot.id in found)
