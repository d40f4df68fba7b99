"""`care baseline`: limits from good runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from care_core.errors import ExitCode
from care_tui.commands.arguments import AsJson, Force, Out, ProfileName, is_json
from care_tui.console import Progress, emit, say

app = typer.Typer()


@app.command()
def baseline(
    logs: Annotated[
        list[Path], typer.Argument(metavar="GOOD_LOG...", help="Logs of good runs, or folders.", show_default=False)
    ],
    profile: ProfileName = None,
    json: AsJson = False,
    out: Out = None,
    force: Force = False,
) -> None:
    """Propose limits from good runs. With --out they become a site file, which triage and the app judge by.

    Ends with 0 all runs counted and every objective has a limit, 3 some did not, 4 no log could be read.
    """
    from care_core.application.baselining import baseline as propose
    from care_core.application.baselining import site_text
    from care_core.profile.site import site_path
    from care_core.report.baseline import baseline_document, baseline_text

    with Progress() as progress:
        found = propose(logs, profile, progress)
    if is_json(out):
        emit(baseline_document(found).to_json(), out, force=force)
    else:
        emit(baseline_document(found).to_json() if json else baseline_text(found))
        if out is not None and any(proposal.limit is not None for proposal in found.proposals):
            emit(site_text(found, out), out, force=True)  # it keeps what the file holds
            if out.resolve() != site_path():
                say(f"judge by it with --site {out}, or always as {site_path()}")
        elif out is not None:
            say(f"there is no limit to write, {out} is left as it is")
    raise typer.Exit(ExitCode.OK if found.is_whole else ExitCode.NOT_EVALUATED)
