"""`care compare`: two runs side by side."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from care_core.application.case import Request
from care_tui.commands.arguments import (
    Anonymous,
    AsJson,
    ConfigPaths,
    Force,
    Out,
    Positions,
    ProfileName,
    Site,
    Thresholds,
    bounds,
    chosen,
    format_named_by,
    sharing_for,
)
from care_tui.console import Progress, emit, painted

app = typer.Typer()


@app.command()
def compare(
    a: Annotated[Path, typer.Argument(metavar="A", help="The log to compare with, such as a good run.")],
    b: Annotated[Path, typer.Argument(metavar="B", help="The other log.")],
    profile: ProfileName = None,
    config: ConfigPaths = None,
    json: AsJson = False,
    markdown: Annotated[bool, typer.Option("--markdown", help="Print Markdown for a ticket or a forum.")] = False,
    html: Annotated[bool, typer.Option("--html", help="Print a page with the signals of both.")] = False,
    positions: Positions = None,
    anonymous: Anonymous = False,
    out: Out = None,
    force: Force = False,
    threshold: Thresholds = None,
    site: Site = None,
    mission_a: Annotated[int | None, typer.Option("--mission-a", min=1, help="Which mission of A; the last.")] = None,
    mission_b: Annotated[int | None, typer.Option("--mission-b", min=1, help="Which mission of B; the last.")] = None,
) -> None:
    """Put two runs side by side. Parameters, what differs first, objectives, phases, findings. Ends as triage of B."""
    from care_core.application.comparing import FORMATS
    from care_core.application.comparing import compare as put_beside
    from care_core.diagnose.verdict import verdict_of

    asked = chosen({"json": json, "markdown": markdown, "html": html})
    format = asked or format_named_by(out, FORMATS) or "text"
    one = Request(a, profile, tuple(config or ()), thresholds=bounds(threshold or ()), site=site, mission=mission_a)
    other = Request(b, profile, tuple(config or ()), thresholds=bounds(threshold or ()), site=site, mission=mission_b)
    with Progress() as progress:
        found = put_beside(one, other, progress)
    text = found.report(format, sharing_for(positions, anonymous=anonymous))
    emit(painted(text) if format == "text" and out is None else text, out, force=force, is_plain=format == "text")
    raise typer.Exit(verdict_of(found.b.diagnosis).exit_code)
