"""`care collect`: runs of a robot or of its simulator, made by the operator's own command."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from care_core.errors import ExitCode
from care_tui.commands.arguments import AsJson
from care_tui.console import Progress, emit, say

app = typer.Typer()


@app.command()
def collect(
    campaign: Annotated[Path, typer.Argument(metavar="CAMPAIGN", help="The campaign.yaml.", show_default=False)],
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="The folder of its runs; one of its name beside it if absent.")
    ] = None,
    plan: Annotated[bool, typer.Option("--plan", help="Print what would be run, as CSV, and run nothing.")] = False,
    retry_failed: Annotated[
        bool, typer.Option("--retry-failed", help="Make those runs once more that failed before.")
    ] = False,
    json: AsJson = False,
) -> None:
    """Vary options and run your command for each configuration.

    Its logs are read into a table of runs for 'care train'.

    What is interrupted goes on where it was when the command is given again. Ends with 0 every run gave a mission, 3
    some did not, 4 none did.
    """
    from care_core.application.collecting import document_of, exit_code, plan_table, run_campaign
    from care_core.report.collection import collect_text

    if plan:
        found, table = plan_table(campaign)
        for name, reason in found.space.left_out:
            say(f"{name} does not vary: {reason}")
        if found.sampling == "adaptive":
            say(f"the first round; the other of {found.runs} runs are chosen by what these give")
        emit(table)
        return
    try:
        with Progress() as progress:
            collected = run_campaign(campaign, out, retry_failed=retry_failed, progress=progress)
    except KeyboardInterrupt:
        say("interrupted: what was done is kept; give the same command again to go on")
        raise typer.Exit(ExitCode.INTERRUPTED) from None
    document = document_of(collected)
    emit(document.to_json() if json else collect_text(document))
    if collected.failed:
        say("give the same command with --retry-failed to make those runs again that failed")
    raise typer.Exit(exit_code(collected))
