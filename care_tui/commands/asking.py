"""Commands that ask a run, or compare it with what was promised: whatif, verify."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from care_core.application import api
from care_core.application.case import Request, read_case
from care_core.application.history_writing import remember
from care_core.errors import UsageError
from care_tui.commands.arguments import (
    AsJson,
    ConfigPaths,
    Force,
    LogPath,
    Mission,
    Out,
    ProfileName,
    Reference,
    Site,
    Thresholds,
    bounds,
    is_json,
)
from care_tui.commands.past import NoHistory, mention
from care_tui.completing import changes, option_names
from care_tui.console import Progress, emit

app = typer.Typer()


@app.command()
def whatif(
    log: LogPath,
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="OPTION=VALUE", help="Ask with this changed.", autocompletion=changes),
    ] = None,
    over: Annotated[
        str | None,
        typer.Option(
            "--over", metavar="OPTION", help="Ask for values across this one's range.", autocompletion=option_names
        ),
    ] = None,
    profile: ProfileName = None,
    config: ConfigPaths = None,
    threshold: Thresholds = None,
    site: Site = None,
    reference: Reference = None,
    mission: Mission = None,
    json: AsJson = False,
    out: Out = None,
    force: Force = False,
) -> None:
    """Predict what a run would have done with other options. Ends with 0, whatever the probability."""
    from care_core.diagnose.whatif import ask_over, parse_change
    from care_core.report.whatif import whatif_document, whatif_text

    if not set_ and over is None:
        hint = "Change a parameter with --set OPTION=VALUE, or ask for all of its values with --over OPTION."
        raise UsageError("Nothing is asked.", hint=hint, where="--set")
    request = Request(
        log,
        profile,
        tuple(config or ()),
        thresholds=bounds(threshold or ()),
        site=site,
        reference=reference,
        mission=mission,
    )
    with Progress() as progress:
        question = read_case(request, progress).question
    changes = dict(parse_change(text, question.schema) for text in set_ or ())
    answer, values = question.ask(changes), None if over is None else ask_over(question, over, changes)
    as_json = json or is_json(out)
    asked = (question, answer, values)
    text = whatif_document(*asked).to_json() if as_json else whatif_text(*asked)
    emit(text, out, force=force, is_plain=not as_json)


@app.command()
def verify(
    report: Annotated[Path, typer.Argument(metavar="REPORT", help="The report, YAML or JSON.", show_default=False)],
    log: LogPath,
    profile: ProfileName = None,
    config: ConfigPaths = None,
    threshold: Thresholds = None,
    site: Site = None,
    reference: Reference = None,
    mission: Mission = None,
    json: AsJson = False,
    out: Out = None,
    force: Force = False,
    no_history: NoHistory = False,
) -> None:
    """Tell whether a fix did what it promised. Ends with 0 recovered, 1 still a fault, 3 cannot tell."""
    from care_core.report.verification import EXIT_CODES, verify_text

    if out is not None and out.exists() and report.exists() and out.samefile(report):
        raise UsageError("That is the report itself.", hint="Name another file.", where=str(out))
    request = Request(
        log,
        profile,
        tuple(config or ()),
        thresholds=bounds(threshold or ()),
        site=site,
        reference=reference,
        mission=mission,
    )
    with Progress() as progress:
        progress("reading the log", 0.0)
        document = api.verify(report, request)
    if not no_history:
        verified = document.plain()
        mention(remember(lambda history: history.add_verification(verified)))
    as_json = json or is_json(out)
    text = document.to_json() if as_json else verify_text(document)
    emit(text, out, force=force, is_plain=not as_json)
    raise typer.Exit(EXIT_CODES[document.verdict])
