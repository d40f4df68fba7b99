"""The `care` command. Only what `--help` needs is imported here; each command imports its own work.

Data goes to stdout and talk to stderr (`console`); exit codes are `care_core.errors.ExitCode`.
"""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from care_core.errors import CareError, ExitCode, LogError, UsageError, nearest
from care_tui import __version__
from care_tui.console import Progress, emit, explain, painted, say

if TYPE_CHECKING:
    from care_core.diagnose.records import Diagnosis, ProfileChoice
    from care_core.logs.base import Log
    from care_core.profile.schema import Schema
    from care_core.profile.store import Profile
    from care_core.variables import Variable

OPEN = "open"
"""The hidden command behind `care LOG`."""

SAMPLE = "arducopter_failed.BIN"
PLACES = (Path(), Path("logs"), Path.home() / "logs", Path.home() / ".ros")
"""Where `care` without a log looks for the newest one."""


class CareGroup(TyperGroup):
    """Lets `care LOG` stand beside the commands, and turns every error into a sentence and an exit code."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        own = {name for parameter in self.params for name in (*parameter.opts, "--help")}
        return super().parse_args(ctx, args if ctx.resilient_parsing else route(args, self.commands, own))

    def main(self, *args: Any, **extra: Any) -> Any:
        try:
            return super().main(*args, **extra)
        except Exception as err:
            raise SystemExit(int(explain(err))) from None


def route(args: list[str], commands: Iterable[str], own: Iterable[str]) -> list[str]:
    """The arguments with `open` put first where they name a log instead of a command.

    Raises:
        UsageError: the first word is neither a command nor a path.
    """
    first = args[0] if args else ""
    if first in {*commands} - {OPEN} or first in own:
        return args
    is_path = os.sep in first or Path(first).suffix != "" or Path(first).exists()
    if not first or first.startswith("-") or is_path:
        return [OPEN, *args]
    hint = nearest(first, {*commands} - {OPEN}) or "See 'care --help', or give the path of a log."
    raise UsageError(f"There is no command '{first}'.", hint=hint)


app = typer.Typer(
    cls=CareGroup,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Which parameter made the run fail, along which path, and what to change. 'care LOG' opens the terminal app.",
)
schema_app = typer.Typer(help="Published formats.", rich_markup_mode=None)
profiles_app = typer.Typer(help="What is installed, and whether it is sound.", rich_markup_mode=None)
app.add_typer(schema_app, name="schema")
app.add_typer(profiles_app, name="profiles", invoke_without_command=True)

LogPath = Annotated[Path, typer.Argument(metavar="LOG", help="The log to read.", show_default=False)]
ProfileName = Annotated[
    str | None, typer.Option("--profile", "-p", help="Name or folder; chosen by the log if absent.")
]
ConfigPaths = Annotated[
    list[Path] | None, typer.Option("--config", help="The robot's configuration file, for what the log lacks.")
]
Out = Annotated[Path | None, typer.Option("--out", "-o", help="Write to this file instead of stdout.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON.")]


def main() -> None:
    """Entry point of the console script."""
    app(prog_name="care")


def _print_version(wanted: bool) -> None:
    if wanted:
        emit(f"care {__version__}\n")
        raise typer.Exit()


@app.callback()
def _care(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version.", callback=_print_version, is_eager=True)
    ] = False,
) -> None:
    pass


@app.command(OPEN, hidden=True)
def _open(
    log: Annotated[Path | None, typer.Argument(metavar="[LOG]", show_default=False)] = None,
    profile: ProfileName = None,
    config: ConfigPaths = None,
    ascii: Annotated[bool, typer.Option("--ascii", help="Draw without box characters.")] = False,
) -> None:
    """Open a log in the terminal app: the newest one when none is named."""
    from care_core.logs import sniff

    path = log or newest_log(PLACES)
    sniff(path)
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        raise UsageError("The terminal app needs a terminal.", hint="Use 'care triage LOG' here.")
    from care_tui.app import run

    raise typer.Exit(run(path, profile, config or [], ascii=ascii))


def newest_log(places: Iterable[Path]) -> Path:
    """The log that was written last in these folders. Raises UsageError when they hold none."""
    from care_core.extract.table import LOG_SUFFIXES

    files = (path for place in places if place.is_dir() for path in place.iterdir())
    logs = [path for path in files if path.suffix.lower() in LOG_SUFFIXES and path.is_file()]
    if not logs:
        raise UsageError("There is no log in the usual places.", hint="Name one, 'care LOG', or try 'care demo'.")
    return max(logs, key=lambda path: path.stat().st_mtime)


@app.command()
def triage(
    log: LogPath,
    profile: ProfileName = None,
    config: ConfigPaths = None,
    json: AsJson = False,
    yaml: Annotated[bool, typer.Option("--yaml", help="Print YAML, with the diff and its commands.")] = False,
    markdown: Annotated[bool, typer.Option("--markdown", help="Print Markdown for a ticket.")] = False,
    out: Out = None,
    top: Annotated[int, typer.Option("--top", min=1, help="How many causes a fault may have.")] = 5,
    keep: Annotated[
        list[str] | None, typer.Option("--keep", metavar="OPTION", help="Never change this option.")
    ] = None,
    threshold: Annotated[
        list[str] | None, typer.Option("--threshold", metavar="NAME=VALUE", help="Judge this objective by this bound.")
    ] = None,
    mission: Annotated[int | None, typer.Option("--mission", min=1, help="Which mission of the log; the last.")] = None,
) -> None:
    """Find the fault of a run, its causes and a fix. Ends with 0 fine, 1 fault, 3 not all evaluated, 4 unreadable."""
    formats = [name for name, wanted in (("json", json), ("yaml", yaml), ("markdown", markdown)) if wanted]
    if len(formats) > 1:
        raise UsageError("Only one of --json, --yaml and --markdown can be printed.", hint="Leave the others out.")
    diagnosis = diagnose(
        log, profile, configs=config or (), keep=keep or (), thresholds=threshold or (), top=top, mission=mission
    )
    emit(_written(diagnosis, formats[0] if formats else _format_of(out), to_file=out is not None), out)
    raise typer.Exit(_exit_code(diagnosis))


@app.command()
def demo() -> None:
    """Triage the failed flight that comes with the program."""
    from care_core.resources import bundled

    path = bundled("samples", SAMPLE)
    if not path.is_file():
        raise LogError("The bundled sample is missing.", hint="Install the program again.", where=str(path))
    diagnosis = diagnose(path, None)
    emit(_written(diagnosis, None, to_file=False))
    raise typer.Exit(_exit_code(diagnosis))


def diagnose(
    path: Path,
    profile: str | None,
    *,
    configs: Iterable[Path] = (),
    keep: Iterable[str] = (),
    thresholds: Iterable[str] = (),
    top: int = 5,
    mission: int | None = None,
) -> Diagnosis:
    """From a log file to its diagnosis, with progress on stderr."""
    from care_core.configs import read_configs
    from care_core.diagnose.triage import triage as run_triage
    from care_core.logs import open_log

    with Progress() as progress:
        overrides = read_configs(configs)
        progress("opening the log", 0.0)
        log = open_log(path)
        chosen, choice = _choose(log, profile)
        schema = chosen.schema
        return run_triage(
            log,
            chosen,
            choice,
            configs=overrides,
            keep=tuple(_known(name, schema.options, "option", "--keep").name for name in keep),
            thresholds=dict(_bound(text, schema) for text in thresholds),
            mission=mission,
            top=top,
            progress=progress,
        )


def _choose(log: Log, profile: str | None) -> tuple[Profile, ProfileChoice]:
    from care_core.profile.select import choose_profile
    from care_core.profile.store import available_profiles, load_profile

    names: list[Path] | list[str] = available_profiles() if profile is None else [profile]
    return choose_profile(log, [load_profile(name) for name in names])


def _known(name: str, variables: Iterable[Variable], what: str, where: str) -> Variable:
    by_name = {variable.name: variable for variable in variables}
    if name not in by_name:
        hint = nearest(name, by_name) or f"Known are {', '.join(by_name)}."
        raise UsageError(f"The profile has no {what} '{name}'.", hint=hint, where=where)
    return by_name[name]


def _bound(text: str, schema: Schema) -> tuple[str, float]:
    name, _, value = text.partition("=")
    objective = _known(name.strip(), schema.objectives, "objective", "--threshold")
    try:
        bound = float(value)
    except ValueError:
        bound = math.nan
    if not math.isfinite(bound):
        raise UsageError(f"'{text}' is no bound.", hint=f"Write --threshold {name}=NUMBER.", where="--threshold")
    if objective.kind == "functional" and bound not in (0, 1):
        raise UsageError(f"{objective.name} is 0 or 1, never {bound:g}.", hint="Write 0 or 1.", where="--threshold")
    return objective.name, bound


def _format_of(out: Path | None) -> str | None:
    suffixes = {".json": "json", ".yaml": "yaml", ".yml": "yaml", ".md": "markdown"}
    return None if out is None else suffixes.get(out.suffix.lower())


def _written(diagnosis: Diagnosis, format: str | None, *, to_file: bool) -> str:
    from care_core import report

    if format is None:
        text = report.to_text(diagnosis)
        return text if to_file else painted(text)
    write = {"json": report.to_json, "yaml": report.to_yaml, "markdown": report.to_markdown}[format]
    return write(report.build_document(diagnosis))


def _exit_code(diagnosis: Diagnosis) -> ExitCode:
    from care_tui.jobs import exit_code

    return exit_code(diagnosis)


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
    changed: Annotated[bool, typer.Option("--changed", help="Only what differs from its default or changed.")] = False,
    out: Out = None,
) -> None:
    """Print the configuration as driven, as a file that the robot's software reads."""
    from care_core.configs import format_for, write_params
    from care_core.logs import open_log

    opened = open_log(log)
    histories = opened.settings()
    settings = {name: history[-1] for name, history in histories.items()}
    if changed:
        settings = {
            name: setting
            for name, setting in settings.items()
            if len(histories[name]) > 1 or (setting.default is not None and setting.value != setting.default)
        }
        if not any(setting.default is not None for history in histories.values() for setting in history):
            say("The log holds no defaults, so only what changed during it is shown.")
    if not histories:
        say("The log holds no parameters.")
    emit(write_params(settings, format_for(opened.format.value)), out)


@schema_app.command("triage")
def schema_triage() -> None:
    """Print the JSON Schema of 'care triage --json'."""
    from json import dumps

    from care_core.report import json_schema

    emit(dumps(json_schema(), indent=2) + "\n")


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

    for path in paths:
        try:
            return _choose(open_log(path), None)[0].schema
        except CareError:  # 'ingest' tells why, of every log
            continue
    raise LogError(f"None of the {len(paths)} logs fits a profile.", hint="Look at one with 'care inspect'.")


@app.command()
def train(
    runs: Annotated[Path, typer.Argument(metavar="RUNS", help="A table of runs: .csv or .parquet.")],
    schema: Annotated[Path, typer.Option("--schema", help="The profile.yaml that describes its columns.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="The folder of the new profile.")],
    seed: Annotated[int, typer.Option("--seed", help="Seed of every random choice.")] = 0,
    resamples: Annotated[int, typer.Option("--resamples", min=2, help="Bootstrap resamples.")] = 50,
) -> None:
    """Learn a profile from a table of runs."""
    from care_tui.training import train_profile

    with Progress() as progress:
        train_profile(runs, schema, out, seed=seed, resamples=resamples, progress=progress)
    say(f"wrote {out}")


@profiles_app.callback()
def _profiles(ctx: typer.Context) -> None:
    if ctx.invoked_subcommand is None:
        profiles_list()


@profiles_app.command("list")
def profiles_list() -> None:
    """List the profiles that come with this installation."""
    from care_core.profile.store import available_profiles, load_profile

    rows = [(s.name, s.version, s.platform) for s in (load_profile(path).schema for path in available_profiles())]
    if not rows:
        say("No profile is installed.")
    widths = [max((len(row[column]) for row in rows), default=0) for column in range(2)]
    emit("".join(f"{name:<{widths[0]}}  {version:<{widths[1]}}  {platform}\n" for name, version, platform in rows))


@profiles_app.command("show")
def profiles_show(name: Annotated[str, typer.Argument(metavar="PROFILE")]) -> None:
    """Show what a profile knows: its variables, ranges and thresholds."""
    from care_core.profile.store import load_profile

    schema = load_profile(name).schema
    lines = [f"{schema.name} {schema.version}: {schema.platform}", schema.doc]
    for role, variables in _by_role(schema).items():
        lines += ["", f"{role} ({len(variables)})", *(f"  {_described(variable)}" for variable in variables)]
    emit("\n".join(lines) + "\n")


def _by_role(schema: Schema) -> Mapping[str, tuple[Variable, ...]]:
    return {
        "options": schema.options,
        "context": schema.contexts,
        "metrics": schema.metrics,
        "objectives": schema.objectives,
    }


def _described(variable: Variable) -> str:
    facts = [variable.name]
    if variable.range is not None:
        facts.append(f"{variable.range[0]:g} to {variable.range[1]:g}")
    if variable.threshold is not None:
        facts.append(str(variable.threshold))
    facts += [text for text in (variable.unit, variable.doc) if text]
    return "  ".join(facts)


@profiles_app.command("check")
def profiles_check(name: Annotated[str | None, typer.Argument(metavar="[PROFILE]")] = None) -> None:
    """Check that profiles are sound: their files, their extractors, and that the model fits the schema."""
    from care_core.extract.read import reading_plan
    from care_core.profile.store import available_profiles, load_profile

    paths: list[Path] | list[str] = available_profiles() if name is None else [name]
    for path in paths:
        profile = load_profile(path)
        if profile.schema.logs:
            reading_plan(profile.schema)
        edges = len(profile.model.edges)
        emit(f"{profile.schema.name}: sound, {len(profile.schema.variables)} variables, {edges} edges\n")
