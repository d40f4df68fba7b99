"""Commands that diagnose: triage, demo."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import care_core
from care_core.application.case import SUFFIXES, Case, ReportFormat, Request, exit_code
from care_core.application.remembering import remember_triage
from care_core.errors import LogError, UsageError
from care_tui.commands.arguments import (
    AsJson,
    ConfigPaths,
    Force,
    Keep,
    Mission,
    Out,
    ProfileName,
    Reference,
    RobotName,
    Since,
    Site,
    Thresholds,
    bounds,
)
from care_tui.commands.past import NoHistory, mention
from care_tui.console import Progress, emit, painted

if TYPE_CHECKING:
    pass

app = typer.Typer()

SAMPLE = "arducopter_failed.BIN"


@app.command()
def triage(
    logs: Annotated[
        list[Path],
        typer.Argument(metavar="LOG...", help="The log to read; more of the same configuration: what they share."),
    ],
    profile: ProfileName = None,
    config: ConfigPaths = None,
    json: AsJson = False,
    yaml: Annotated[bool, typer.Option("--yaml", help="Print YAML, with the diff and its commands.")] = False,
    markdown: Annotated[bool, typer.Option("--markdown", help="Print Markdown for a ticket.")] = False,
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
    flags: tuple[tuple[ReportFormat, bool], ...] = (("json", json), ("yaml", yaml), ("markdown", markdown))
    formats = [name for name, wanted in flags if wanted]
    if len(formats) > 1:
        raise UsageError("Only one of --json, --yaml and --markdown can be printed.", hint="Leave the others out.")
    request = Request(
        logs[0],
        profile,
        repeats=tuple(logs[1:]),
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
    with Progress() as progress:
        case = care_core.triage(request, progress)
    if not no_history:
        mention(remember_triage(case.diagnosis))
    emit(_written(case, formats[0] if formats else _format_of(out), to_file=out is not None), out, force=force)
    raise typer.Exit(exit_code(case.diagnosis))


@app.command()
def demo() -> None:
    """Triage the failed flight that comes with the program."""
    from care_core.files import bundled

    path = bundled("samples", SAMPLE)
    if not path.is_file():
        raise LogError("The bundled sample is missing.", hint="Install the program again.", where=str(path))
    with Progress() as progress:
        case = care_core.triage(path, progress)
    emit(_written(case, None, to_file=False))
    raise typer.Exit(exit_code(case.diagnosis))


def _format_of(out: Path | None) -> ReportFormat | None:
    return None if out is None else SUFFIXES.get(out.suffix.lower())


def _written(case: Case, format: ReportFormat | None, *, to_file: bool) -> str:
    text = case.report(format or "text")
    return text if to_file or format else painted(text)
