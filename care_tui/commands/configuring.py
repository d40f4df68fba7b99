"""Commands on configurations: diff, apply, lint."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from care_core.application import api
from care_core.errors import ExitCode, UsageError
from care_core.text import clean
from care_tui import __version__
from care_tui.commands.arguments import AsJson, Force, Out, is_json, profile_option
from care_tui.console import emit, say

if TYPE_CHECKING:
    from care_core.configs.edit import EditedFile

app = typer.Typer()


@app.command()
def diff(
    a: Annotated[str, typer.Argument(metavar="A", help="A configuration file, a log or a report.", show_default=False)],
    b: Annotated[str, typer.Argument(metavar="B", help="Likewise.", show_default=False)],
    everything: Annotated[bool, typer.Option("--all", help="Calibration, statistics, what is read-only too.")] = False,
) -> None:
    """Compare two configurations by parameter. - only in A, + only in B, ! changed. Ends with 0 same, 1 different."""
    from care_core.application.configuring import side_of
    from care_core.configs.compare import compare

    one, other = side_of(a), side_of(b)
    found = compare(one, other, everything=everything)
    emit("".join(f"{clean(str(difference))}\n" for difference in found))
    shared = len(found) - sum(difference.a is None or difference.b is None for difference in found)
    differ = f"{len(found)} {'parameter differs' if len(found) == 1 else 'parameters differ'}"
    say(f"{differ}, {shared} in value: {one.name} (-) against {other.name} (+)")
    raise typer.Exit(ExitCode.FAULT if found else ExitCode.OK)


@app.command()
def apply(
    report: Annotated[Path, typer.Argument(metavar="REPORT", help="The report, YAML or JSON.", show_default=False)],
    config: Annotated[
        list[str],
        typer.Argument(metavar="CONFIG...", help="Files in the order they are loaded, for ROS also NAMESPACE=FILE."),
    ],
    out: Annotated[Path | None, typer.Option("--out", "-o", help="The new file; a folder for several.")] = None,
    override: Annotated[
        bool, typer.Option("--override", help="Leave the files alone: write the changes into one to be loaded last.")
    ] = False,
    in_place: Annotated[bool, typer.Option("--in-place", help="Change the files, each kept as FILE.bak.")] = False,
    force: Force = False,
    alternative: Annotated[int, typer.Option("--alternative", min=0, help="Another of the report's fixes.")] = 0,
    profile: Annotated[str | None, profile_option("The report's profile, where it is not installed.")] = None,
) -> None:
    """Put a report's fix into configuration files. Comments and order stay. Without -o, print the patch."""
    from care_core.application.configuring import override_of, patch_of

    if in_place and (override or out is not None):
        raise UsageError(
            f"Either {'--override' if override else '--out'} or --in-place.", hint="Leave one out.", where="--in-place"
        )
    if override:
        _write_or_print(override_of(report, config, alternative, profile), out, force=force)
        return
    edited = api.apply(report, *config, alternative=alternative, profile=profile)
    for line in _edit_lines(edited):
        say(line)
    changed = [file for file in edited if file.edits]
    if out is None and not in_place:
        emit(patch_of(changed))
        if changed:
            say("no file was changed: -o NEW writes a new one, --in-place changes this one and keeps a backup")
    elif in_place:
        for file in changed:
            _replace(file)
    else:
        _write_to(out or Path(), edited, force=force)


@app.command()
def lint(
    config: Annotated[
        list[str], typer.Argument(metavar="CONFIG...", help="Configuration files, for ROS also NAMESPACE=FILE.")
    ],
    target: Annotated[
        str,
        typer.Option(
            "--target", "-t", help="What they are for: noetic, humble, copter-4.6, px4-1.15; else the files tell."
        ),
    ] = "",
    profile: Annotated[str | None, profile_option("Check against this profile's acceptable values as well.")] = None,
    as_json: AsJson = False,
    sarif: Annotated[bool, typer.Option("--sarif", help="Print SARIF 2.1.0, for code hosts and editors.")] = False,
    out: Out = None,
    force: Force = False,
) -> None:
    """Find dead keys, wrong values and contradictions in files. 1 if there are any."""
    from json import dumps

    from care_core.lint.linting import lint as lint_files
    from care_core.lint.problems import Severity
    from care_core.report.linting import counted, lint_document, lint_sarif, lint_text

    if as_json and sarif:
        raise UsageError("Either --json or --sarif.", hint="Leave one out.", where="--sarif")
    schema = None
    if profile is not None:
        from care_core.profile.store import load_profile

        schema = load_profile(profile).schema
    found = lint_files(config, target.casefold(), schema)
    if sarif:
        emit(dumps(lint_sarif(found, __version__), indent=2) + "\n", out, force=force)
    elif as_json or is_json(out):
        emit(lint_document(found, target).to_json(), out, force=force)
    else:
        emit(lint_text(found), out, force=force, is_plain=True)
    say(counted(found))
    severe = [one for file in found for one in file.problems if one.severity is not Severity.NOTE]
    raise typer.Exit(ExitCode.FAULT if severe else ExitCode.OK)


def _edit_lines(edited: Sequence[EditedFile]) -> Iterator[str]:
    from care_core.run import shown

    for edit in (edit for file in edited for edit in file.edits):
        yield f"{edit.where}: {', '.join(edit.parameters)}  {shown(edit.before)} -> {edit.after}"
        if len(edit.parameters) > 1:
            yield f"  ! one line sets {len(edit.parameters)} parameters"
        if edit.shared:
            yield f"  ! the file is loaded for {', '.join(sorted(edit.shared))} too: --override leaves that as it is"
        for note in edit.notes:
            yield f"  ! {note}"


def _write_or_print(text: str, out: Path | None, *, force: bool) -> None:
    from care_core.outputs import signed_parameters

    emit(text if out is None else signed_parameters(text), out, force=force)
    if out is not None:
        say("load it after the other files")


def _replace(file: EditedFile) -> None:
    from care_core.configs.writing import replace_with_backup

    backup = replace_with_backup(file)
    say(f"wrote {file.path}, the old one is {backup}")


def _write_to(out: Path, edited: Sequence[EditedFile], *, force: bool) -> None:
    from care_core.configs.writing import write_checked
    from care_core.outputs import check_replaceable

    targets = [out / file.path.name if len(edited) > 1 or out.is_dir() else out for file in edited]
    if len(set(targets)) < len(targets):
        raise UsageError("Two of the files have the same name.", hint="Use --in-place.", where=str(out))
    if any(target.exists() and target.samefile(file.path) for target, file in zip(targets, edited, strict=True)):
        raise UsageError("That is the file itself.", hint="Use --in-place, which keeps a backup.", where=str(out))
    if len(edited) > 1:
        out.mkdir(parents=True, exist_ok=True)
    for target, file in zip(targets, edited, strict=True):
        check_replaceable(target, file.after.encode(), force=force)
        write_checked(file, target)
        say(f"wrote {target}")
