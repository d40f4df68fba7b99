"""Commands that read logs without judging them: inspect, params, ingest."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from care_core.errors import CareError, LogError
from care_tui.commands.arguments import AsJson, LogPath, Out, ProfileName
from care_tui.console import Progress, emit, say

if TYPE_CHECKING:
    from care_core.profile.schema import Schema

app = typer.Typer()


@app.command()
def inspect(log: LogPath, json: AsJson = False) -> None:
    """Show what a log holds: format, span, channels, parameters, damage, missions, and which profiles fit."""
    from care_core.logs import open_log
    from care_tui.inspection import as_json, as_text, inspect_log

    with Progress() as progress:
        progress("reading the log", 0.0)
        inspection = inspect_log(open_log(log))
    emit(as_json(inspection) if json else as_text(inspection))


@app.command()
def params(
    log: LogPath,
    changed: Annotated[
        bool, typer.Option("--changed", help="Only what differs from its default or changed, with what it was before.")
    ] = False,
    everything: Annotated[
        bool, typer.Option("--all", help="With --changed: calibration, statistics and device identities too.")
    ] = False,
    sources: Annotated[bool, typer.Option("--sources", help="Say of each value where it came from.")] = False,
    out: Out = None,
) -> None:
    """Print the configuration as driven, as a file that the robot's software reads."""
    from care_core.configs import format_for, write_params
    from care_core.extract.settings import differing, remark
    from care_core.logs import open_log

    opened = open_log(log)
    histories = opened.settings()
    if not histories:
        say("The log holds no parameters. The files that the robot was started with hold them.")
    if changed:
        chosen = differing(histories, everything=everything)
        if histories and not any(setting.default is not None for history in histories.values() for setting in history):
            say("The log holds no defaults, so only what changed during it is shown.")
        if not everything and (hidden := len(differing(histories, everything=True)) - len(chosen)):
            say(f"{hidden} that the vehicle writes itself are left out (calibration, statistics): --all shows them.")
        histories = chosen
    remarks = {name: remark(history, source=sources) for name, history in histories.items() if changed or sources}
    settings = {name: history[-1] for name, history in histories.items()}
    emit(write_params(settings, format_for(opened.format.value, settings), remarks), out)


@app.command()
def ingest(
    logs: Annotated[list[Path], typer.Argument(metavar="LOG...", help="Logs, or folders of them.", show_default=False)],
    out: Annotated[Path, typer.Option("--out", "-o", help="The table to write: .csv or .parquet.", show_default=False)],
    profile: ProfileName = None,
    workers: Annotated[int | None, typer.Option("--workers", min=1, help="Processes; one a core.")] = None,
) -> None:
    """Read many logs into a table of runs, one row a mission, for 'care train'."""
    from care_core.extract.table import check_table_path, find_logs, ingest, write_table
    from care_core.profile.store import load_profile

    check_table_path(out)
    paths = find_logs(logs)
    schema = load_profile(profile).schema if profile else _schema_for(paths)
    with Progress() as progress:
        rows, failures = ingest(paths, schema, workers=workers, progress=progress)
    for failure in failures:
        say(f"  {failure.path}  {failure.reason}")
    if not rows:
        raise LogError(f"None of the {len(paths)} logs could be read.", hint="Look at one with 'care inspect'.")
    write_table(out, rows, schema)
    say(f"wrote {out}: {len(rows)} runs of {len(paths) - len(failures)} logs, {len(failures)} logs failed")


def _schema_for(paths: Sequence[Path]) -> Schema:
    """The schema that fits the first log that can be read."""
    from care_core.logs import open_log
    from care_core.profile.select import choose_profile
    from care_core.profile.store import available_profiles, load_profile

    profiles = [load_profile(path) for path in available_profiles()]
    for path in paths:
        try:
            return choose_profile(open_log(path), profiles)[0].schema
        except CareError:  # 'ingest' tells why, of every log
            continue
    raise LogError(f"None of the {len(paths)} logs fits a profile.", hint="Look at one with 'care inspect'.")
