"""Commands that read logs without judging them: inspect, params, ingest."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from care_core.errors import ExitCode, LogError
from care_core.text import none_of_logs, number_of
from care_tui.commands.arguments import AsJson, Force, LogPath, Out, ProfileName
from care_tui.console import Progress, check_writable, emit, say

if TYPE_CHECKING:
    from care_core.tables.ingest import Failure

app = typer.Typer()

MOST_FAILURES = 20
"""More logs that failed are shown by reason."""


@app.command()
def inspect(log: LogPath, json: AsJson = False) -> None:
    """Show what a log holds. Span, channels, parameters, damage, missions, and what each profile would miss."""
    from care_core.application import api
    from care_core.report.inspection import inspection_text

    with Progress() as progress:
        progress("reading the log", 0.0)
        document = api.inspect(log)
    emit(document.to_json() if json else inspection_text(document))


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
    force: Force = False,
) -> None:
    """Print the configuration as driven. It is a file that the robot's software reads."""
    from care_core.configs.driven import differing, remark
    from care_core.configs.formats import format_for, write_params
    from care_core.logs.opening import open_log
    from care_core.outputs import signed_parameters

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
    text = write_params(settings, format_for(opened.format.name, settings), remarks)
    emit(text if out is None else signed_parameters(text, opened.facts.get("firmware", "")), out, force=force)


@app.command()
def ingest(
    logs: Annotated[list[Path], typer.Argument(metavar="LOG...", help="Logs, or folders of them.", show_default=False)],
    out: Annotated[Path, typer.Option("--out", "-o", help="The table to write: .csv or .parquet.", show_default=False)],
    profile: ProfileName = None,
    workers: Annotated[int | None, typer.Option("--workers", min=1, help="Processes; one a core.")] = None,
    limit: Annotated[float, typer.Option("--limit", min=0.1, help="Seconds that one log may take.")] = 600.0,
    failures: Annotated[Path | None, typer.Option("--failures", help="Write logs that failed to this .csv.")] = None,
) -> None:
    """Read many logs into a table of runs. It has one row a mission and is for 'care train'.

    What is interrupted goes on where it was when the command is given again. Ends with 0 all read, 3 some failed,
    4 none could be read.
    """
    from care_core.logs.finding import find_logs
    from care_core.outputs import REMOVE_HINT, check_replaceable
    from care_core.profile.store import load_profile
    from care_core.tables import ingest as ingesting
    from care_core.tables.rows import check_table_path, write_table

    check_table_path(out)
    if failures is not None:
        check_writable(failures)
        check_replaceable(failures, kind="failures", hint=REMOVE_HINT)
    paths = find_logs(logs)
    journal = ingesting.journal_of(out)
    try:
        schema = load_profile(profile).schema if profile else ingesting.schema_that_fits(paths, limit_s=limit)
        with Progress() as progress:
            found = ingesting.ingest(paths, schema, out, workers=workers, limit_s=limit, progress=progress)
    except KeyboardInterrupt:
        say(f"interrupted: what was read is kept in {journal}; give the same command again to go on")
        raise typer.Exit(ExitCode.INTERRUPTED) from None
    if found.resumed:
        say(f"{found.resumed} of {len(paths)} logs were read before the interruption")
    _say_failures(found.failures)
    if failures is not None:
        emit(ingesting.failures_table(found.failures), failures, hint=REMOVE_HINT)
    if not found.rows:
        journal.unlink(missing_ok=True)
        raise LogError(f"{none_of_logs(len(paths))} could be read.", hint="Look at one with 'care inspect'.")
    write_table(out, found.rows, schema)
    journal.unlink(missing_ok=True)
    runs, failed = number_of(len(found.rows), "run"), number_of(len(found.failures), "log")
    say(f"wrote {out}: {runs} of {number_of(len(paths) - len(found.failures), 'log')}, {failed} failed")
    raise typer.Exit(ExitCode.NOT_EVALUATED if found.failures else ExitCode.OK)


def _say_failures(failures: Sequence[Failure]) -> None:
    """A line for each log that failed; where they are many, a line for each reason."""
    from care_core.tables.ingest import by_reason

    if len(failures) <= MOST_FAILURES:
        for failure in failures:
            say(f"  {failure.path}  {failure.reason}")
        return
    for reason, count, first in by_reason(failures):
        say(f"  {count:>6}  {reason} ({'' if count == 1 else 'such as '}{first})")
