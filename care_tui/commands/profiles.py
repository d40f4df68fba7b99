"""`care profiles`: what is installed, whether it is sound, and a first one for a robot that none is known of."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from care_core.errors import ExitCode, UsageError
from care_core.text import wrapped
from care_tui.completing import profile_names
from care_tui.console import Progress, emit, say

if TYPE_CHECKING:
    from care_core.profile.schema import Schema
    from care_core.profile.store import Profile
    from care_core.variables import Variable

app = typer.Typer(
    name="profiles",
    help="What is installed, and whether it is sound.",
    invoke_without_command=True,
    rich_markup_mode=None,
)


@app.callback()
def _profiles(ctx: typer.Context) -> None:
    if ctx.invoked_subcommand is None:
        list_profiles()


@app.command("list")
def list_profiles() -> None:
    """List the installed profiles, your own among them."""
    emit(listed_profiles())


def listed_profiles() -> str:
    """A line for each installed profile. What is wrong with one that is left out goes to stderr."""
    from care_core.extract.select import sound_profiles

    sound, problems = sound_profiles()
    rows = [(s.name, s.version, s.platform) for s in (profile.schema for profile in sound)]
    if not rows:
        say("No profile is installed.")
    for problem in problems:
        say(f"care: {problem}")
    table = [("profile", "version", "platform"), *rows] if rows else []
    widths = [max((len(row[column]) for row in table), default=0) for column in range(2)]
    lines = [wrapped(what, first=f"{name:<{widths[0]}}  {version:<{widths[1]}}  ") for name, version, what in table]
    return "".join(f"{line}\n" for line in chain(*lines))


@app.command("show")
def show(name: Annotated[str, typer.Argument(metavar="PROFILE", autocompletion=profile_names)]) -> None:
    """Show what a profile knows. Its variables, ranges and thresholds, and which effects its runs cannot tell."""
    emit(shown_profile(name))


def shown_profile(name: str) -> str:
    """What a profile knows, in lines. Raises ProfileError."""
    from care_core.profile.store import load_profile

    profile = load_profile(name)
    schema = profile.schema
    lines = [f"{schema.name} {schema.version}: {schema.platform}", schema.doc]
    for role, variables in _by_role(schema).items():
        lines += ["", f"{role} ({len(variables)})", *(f"  {_described(variable)}" for variable in variables)]
    lines += ["", *_identified(profile)]
    verified = _verified(schema)
    lines += ["", verified] if verified else []
    return "\n".join(lines) + "\n"


def _identified(profile: Profile) -> list[str]:
    """How many effects the training runs identify, and which they do not."""
    from care_core.errors import ProfileError

    try:
        effects = profile.model.effects.values()
    except ProfileError as err:
        return [f"no effects: {err.message}"]
    unknown = [f"  {e.option} on {e.objective}" for e in effects if not e.identified]
    counted = f"effects of a parameter on an objective: {len(effects) - len(unknown)} identified"
    return [counted, *([f"not identified, never ranked ({len(unknown)})", *unknown] if unknown else [])]


def _verified(schema: Schema) -> str:
    """How the fixes of this profile's version held up on this computer; empty where no history is kept."""
    from care_core.history.store import History, HistoryError, history_path
    from care_core.history.track_record import track_record
    from care_core.report.history import verified_line

    path = history_path()
    if path is None:
        return ""
    try:
        past = [one for one in History(path).verifications(schema.name) if one.version == schema.version]
    except HistoryError as err:
        say(f"care: {err}")
        return ""
    record = track_record(past)
    return verified_line(record.count, record.worked, record.expected)


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


@app.command("new")
def new(
    logs: Annotated[list[Path], typer.Argument(metavar="LOG...", help="Logs of one robot, or folders of them.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="The folder of the new profile; its name is the profile's.")],
    force: Annotated[bool, typer.Option("--force", help="Write over the profile.yaml that is there.")] = False,
) -> None:
    """Write a first profile from logs. What is set, measured and could be judged, with a comment on each.

    Ends with 0 written, 3 written though some logs could not be read, 4 none could be read.
    """
    from care_core.application.scaffolding import check_new, new_profile, summary
    from care_core.logs.finding import find_logs

    check_new(out, force=force)
    with Progress() as progress:
        made, failed = new_profile(find_logs(logs), out, force=force, progress=progress)
    for path, reason in failed.items():
        say(f"  {path}  {reason}")
    emit(summary(made, out))
    raise typer.Exit(ExitCode.NOT_EVALUATED if failed else ExitCode.OK)


@app.command("check")
def check(
    name: Annotated[str | None, typer.Argument(metavar="[PROFILE]", autocompletion=profile_names)] = None,
    runs: Annotated[
        Path | None, typer.Option("--runs", metavar="TABLE", help="Say what these runs lack to train the profile.")
    ] = None,
) -> None:
    """Check that profiles are sound. What can be recomputed from their files is.

    Of a profile that is not trained yet, what its runs lack.
    """
    from care_core.application.scaffolding import is_trained
    from care_core.extract.read import reading_plan
    from care_core.profile.store import available_profiles, load_profile

    if runs is not None and name is None:
        raise UsageError("Runs are of one profile.", hint="Name it before --runs.", where="--runs")
    paths: list[Path] | list[str] = available_profiles() if name is None else [name]
    unsound = False
    for path in paths:
        profile = load_profile(path)
        if profile.schema.logs:
            reading_plan(profile.schema)
        if is_trained(profile):
            unsound = not _is_sound(profile) or unsound
        if runs is not None or not is_trained(profile):
            _say_ready(profile, runs)
    if unsound:
        raise typer.Exit(ExitCode.USAGE)


def _is_sound(profile: Profile) -> bool:
    """Say what the files of a trained profile contradict."""
    from care_core.application.training import relearned_problems
    from care_core.profile.check import problems

    relearned = relearned_problems(profile)
    found = (*problems(profile), *(relearned or ()))
    rest = "; identification and model card not recomputed (needs the extra 'learn')" if relearned is None else ""
    counts = f"{len(profile.schema.variables)} variables, {len(profile.model.edges)} edges"
    emit(f"{profile.schema.name}: {'not sound' if found else 'sound'}, {counts}{rest}\n")
    emit("".join(f"  {sentence}\n" for sentence in found))
    return not found


def _say_ready(profile: Profile, runs: Path | None) -> None:
    """Say what is missing to train a profile."""
    from care_core.application.scaffolding import is_trained, ready_to_train

    ready = ready_to_train(profile, runs)
    if not is_trained(profile):
        emit(f"{profile.schema.name}: sound as written, {len(profile.schema.variables)} variables, not trained yet\n")
    emit("".join(f"  missing to train: {sentence}\n" for sentence in ready.obstacles))
    emit("".join(f"  poorer without: {sentence}\n" for sentence in ready.gaps))
    if not ready.obstacles:
        emit(f"  {ready.runs} runs are enough to train with\n")
