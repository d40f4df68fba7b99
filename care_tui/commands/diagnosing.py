"""Commands that diagnose: triage, demo."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from care_core.application import api
from care_core.application.case import Case, Request
from care_core.application.history_writing import remember_triage
from care_core.errors import ExitCode, LogError, NoRepeatsError, UsageError
from care_core.records import replace
from care_core.report.formats import ENDINGS
from care_core.text import command
from care_tui.commands.arguments import (
    Anonymous,
    AsJson,
    ConfigPaths,
    Force,
    Keep,
    Mission,
    Out,
    Positions,
    ProfileName,
    Reference,
    RobotName,
    Since,
    Site,
    Thresholds,
    bounds,
    chosen,
    format_named_by,
    sharing_for,
)
from care_tui.commands.opening import newest_named
from care_tui.commands.past import NoHistory, mention
from care_tui.console import Progress, emit, painted, say
from care_tui.start import called

if TYPE_CHECKING:
    from care_core.application.each import Answered
    from care_core.application.sharing import Sharing

app = typer.Typer()

SAMPLE = "arducopter_failed.BIN"


@app.command()
def triage(
    logs: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="[LOG...]",
            help="The log to read, the newest one of the usual places if absent; more of the same configuration: what"
            " they share; of several, or a folder of them: a line each.",
            show_default=False,
        ),
    ] = None,
    profile: ProfileName = None,
    config: ConfigPaths = None,
    json: AsJson = False,
    yaml: Annotated[bool, typer.Option("--yaml", help="Print YAML, with the diff and its commands.")] = False,
    markdown: Annotated[bool, typer.Option("--markdown", help="Print Markdown for a ticket or a forum.")] = False,
    html: Annotated[bool, typer.Option("--html", help="Print a page with paths and signals drawn.")] = False,
    junit: Annotated[bool, typer.Option("--junit", help="Print JUnit XML for a CI, each log by itself.")] = False,
    open_page: Annotated[
        bool,
        typer.Option("--open", help="Write the page to --out or a file of this user's, and open it in the browser."),
    ] = False,
    positions: Positions = None,
    anonymous: Anonymous = False,
    out: Out = None,
    force: Force = False,
    top: Annotated[int, typer.Option("--top", min=1, help="How many causes a fault may have.")] = 5,
    keep: Keep = None,
    threshold: Thresholds = None,
    site: Site = None,
    mission: Mission = None,
    since: Since = None,
    reference: Reference = None,
    robot: RobotName = None,
    no_history: NoHistory = False,
) -> None:
    """Find the fault of a run, its causes and a fix. Ends with 0 fine, 1 fault, 3 not all evaluated, 4 unreadable."""
    from care_core.application.each import logs_of
    from care_tui.browser import show_page

    flags = {"json": json, "yaml": yaml, "markdown": markdown, "html": html, "junit": junit}
    format = chosen(flags) or ("html" if open_page else format_named_by(out, ENDINGS))
    if open_page and format != "html":
        raise UsageError(f"What a browser opens is a page, not {format}.", hint="Leave one of both out.")
    found = logs_of(logs or [newest_named()])
    request = Request(
        found[0],
        profile,
        repeats=found[1:],
        configs=tuple(config or ()),
        keep=tuple(keep or ()),
        thresholds=bounds(threshold or ()),
        site=site,
        top=top,
        mission=mission,
        since=since,
        reference=reference,
        robot=robot,
    )
    sharing = sharing_for(positions, anonymous=anonymous)
    if format == "junit":
        raise typer.Exit(_write_junit(request, sharing, out, force=force, no_history=no_history))
    try:
        if len(found) > len(logs or found):
            raise NoRepeatsError("The folder holds several logs.", hint="Name one of them.")
        with Progress() as progress:
            case = api.triage(request, progress)
    except (LogError, NoRepeatsError) as err:
        if format is not None or len(found) == 1:
            raise
        say(f"{err.where + ': ' if err.where else ''}{err.message} Each is triaged by itself.")
        raise typer.Exit(_write_lines(request, out, force=force, no_history=no_history)) from None
    if not no_history:
        mention(remember_triage(case.diagnosis, request))
    if open_page:
        show_page(case.report("html", sharing), case.diagnosis.run.log, out, force=force)
    else:
        emit(_written(case, format, sharing, to_file=out is not None), out, force=force, is_plain=format is None)
    raise typer.Exit(_exit_code(case))


def _write_junit(
    request: Request, sharing: Sharing | None, out: Path | None, *, force: bool, no_history: bool
) -> ExitCode:
    """Triage each log by itself and write a suite for each; the gravest of their exit codes."""
    from care_core.application.suites import suite_of_log
    from care_core.diagnose.verdict import exit_code
    from care_core.report.junit import to_junit

    answers = _each(request, no_history=no_history)
    emit(to_junit([suite_of_log(one, sharing) for one in answers]), out, force=force)
    return exit_code(*(one.status for one in answers))


def _write_lines(request: Request, out: Path | None, *, force: bool, no_history: bool) -> ExitCode:
    """Triage each log by itself and write a line for each; the gravest of their exit codes."""
    from care_core.diagnose.verdict import exit_code
    from care_core.report.watching import log_lines

    answers = _each(request, no_history=no_history)
    text = "".join(f"{line}\n" for line in log_lines([(one.log, one.status, one.says) for one in answers]))
    emit(text if out else painted(text), out, force=force, is_plain=True)
    return exit_code(*(one.status for one in answers))


def _each(request: Request, *, no_history: bool) -> list[Answered]:
    """Every log of a request by itself."""
    from care_core.application.each import answer_of

    answers = []
    with Progress() as progress:
        for log in (request.log, *request.repeats):
            own = replace(request, log=log, repeats=())
            answers.append(answer_of(own, progress))
            if (case := answers[-1].case) is not None and not no_history:
                mention(remember_triage(case.diagnosis, own))
    return answers


def _exit_code(case: Case) -> ExitCode:
    from care_core.diagnose.verdict import verdict_of  # not for '--help' nor a shell that completes

    return verdict_of(case.diagnosis).exit_code


@app.command()
def demo() -> None:
    """Triage the failed flight that comes with the program."""
    from care_core.files import bundled

    path = bundled("samples", SAMPLE)
    if not path.is_file():
        raise LogError("The bundled sample is missing.", hint="Install the program again.", where=str(path))
    with Progress() as progress:
        case = api.triage(path, progress)
    emit(_written(case, None, None, to_file=False))
    say(f"Now open it: {command(*called(), _short(path))}")
    raise typer.Exit(_exit_code(case))


def _short(path: Path) -> str:
    """The sample as it is called in a checkout, else by its path."""
    here = Path("samples", path.name)
    return str(here if here.exists() and here.samefile(path) else path)


def _written(case: Case, format: str | None, sharing: Sharing | None, *, to_file: bool) -> str:
    text = case.report(format or "text", sharing)
    return text if to_file or format else painted(text)
