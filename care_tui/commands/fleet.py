"""`care fleet`: many robots and runs at once."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from care_core.application.case import Request
from care_tui.commands.arguments import (
    AsJson,
    ConfigPaths,
    Force,
    Out,
    ProfileName,
    Reference,
    Site,
    Thresholds,
    bounds,
    is_json,
)
from care_tui.console import Progress, emit, painted, say

app = typer.Typer()


@app.command()
def fleet(
    logs: Annotated[
        list[str],
        typer.Argument(
            metavar="LOG...", help="Logs, folders, patterns such as 'logs/**/*.BIN', URLs.", show_default=False
        ),
    ],
    profile: ProfileName = None,
    config: ConfigPaths = None,
    threshold: Thresholds = None,
    site: Site = None,
    reference: Reference = None,
    by_folder: Annotated[
        bool, typer.Option("--by-folder", help="A log that names no robot is of the robot its folder is called.")
    ] = False,
    json: AsJson = False,
    out: Out = None,
    force: Force = False,
    parquet: Annotated[Path | None, typer.Option("--parquet", help="Write the rows to this .parquet too.")] = None,
    workers: Annotated[int | None, typer.Option("--workers", min=1, help="Processes; one a core.")] = None,
    memory: Annotated[
        str | None, typer.Option("--memory", metavar="SIZE", help="Of each process, such as 2GB; an equal share.")
    ] = None,
    limit: Annotated[float, typer.Option("--limit", min=0.1, help="Seconds that one log may take.")] = 600.0,
    scheduler: Annotated[
        str | None,
        typer.Option("--scheduler", metavar="URL", help="A Dask cluster, tcp://HOST:PORT, not this machine."),
    ] = None,
) -> None:
    """Triage many logs and find what they share. One row a log, and one change for all where it is right.

    Nothing leaves this machine unless a URL or a scheduler is named. Ends as triage does: 0 all fine, 1 a fault in any,
    3 not all evaluated, 4 none readable.
    """
    from care_core.application.fleet import Cluster, survey
    from care_core.outputs import check_replaceable
    from care_core.report.fleet import check_parquet_path, fleet_document, write_parquet

    if parquet is not None:
        check_parquet_path(parquet)
    if out is not None:
        check_replaceable(out, kind="care.fleet" if json or is_json(out) else "text", force=force)
    asked = Request(
        Path(),
        profile,
        configs=tuple(config or ()),
        thresholds=bounds(threshold or ()),
        site=site,
        reference=reference,
    )
    with Progress() as progress:
        found = survey(logs, asked, Cluster(scheduler, workers, memory, limit), progress, folders=by_folder)
    if parquet is not None:
        write_parquet(parquet, found)
        say(f"wrote {parquet}")
    if json or is_json(out):
        emit(fleet_document(found).to_json(), out, force=force)
    else:
        from care_tui.render.fleet import fleet_text

        text = fleet_text(found)
        emit(text if out else painted(text), out, force=force, is_plain=True)
    raise typer.Exit(found.exit_code)
