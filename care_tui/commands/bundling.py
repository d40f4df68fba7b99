"""`care bundle`: a run packed for somebody who knows more."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from care_core.application import api
from care_core.application.case import Request
from care_core.text import clean
from care_tui import __version__
from care_tui.commands.arguments import (
    Anonymous,
    ConfigPaths,
    Force,
    LogPath,
    Mission,
    Positions,
    ProfileName,
    Site,
    Thresholds,
    bounds,
)
from care_tui.console import Progress, check_place, emit, say

app = typer.Typer()


@app.command()
def bundle(
    log: LogPath,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="The zip; LOG.care.zip in this folder if absent.")
    ] = None,
    profile: ProfileName = None,
    config: ConfigPaths = None,
    threshold: Thresholds = None,
    site: Site = None,
    mission: Mission = None,
    positions: Positions = None,
    anonymous: Anonymous = False,
    force: Force = False,
) -> None:
    """Pack what an expert needs into one zip below 2 MB. Reports, parameters, signals; without positions.

    The log itself stays where it is. Ends with 0 whatever the verdict, 4 where the log cannot be read.
    """
    from care_core.application.bundling import bundle_of
    from care_core.application.sharing import Sharing
    from care_core.outputs import check_replaceable, write_binary

    target = out or Path("run.care.zip" if anonymous else f"{clean(log.stem)}.care.zip")
    check_place(target)
    check_replaceable(target, kind="bundle", force=force)
    request = Request(log, profile, tuple(config or ()), thresholds=bounds(threshold or ()), site=site, mission=mission)
    sharing = Sharing(positions=bool(positions), anonymous=anonymous)
    with Progress() as progress:
        case = api.triage(request, progress)
        progress("packing", 0.9)
        packed = bundle_of(case, sharing, __version__)
    write_binary(target, packed.content, "bundle", force=force)
    emit("".join(f"{size:>9,}  {name}\n" for name, size in packed.files.items()))
    left_out = "" if sharing.positions else ", without positions"
    say(f"wrote {target}: {len(packed.content):,} bytes{left_out}{', anonymous' if anonymous else ''}")
