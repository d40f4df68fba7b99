"""Commands on configurations: diff, apply."""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from care_core.errors import ConfigError, ExitCode, UsageError
from care_core.text import clean
from care_tui.console import emit, say

if TYPE_CHECKING:
    from care_core.configs.compare import Side
    from care_core.configs.edit import EditedFile, Wanted
    from care_core.report.document import TriageDocument

app = typer.Typer()

_HEAD_BYTES = 4096


@app.command()
def diff(
    a: Annotated[str, typer.Argument(metavar="A", help="A configuration file, a log or a report.", show_default=False)],
    b: Annotated[str, typer.Argument(metavar="B", help="Likewise.", show_default=False)],
    everything: Annotated[bool, typer.Option("--all", help="Calibration and statistics too.")] = False,
) -> None:
    """Compare two configurations by parameter. - only in A, + only in B, ! changed. Ends with 0 same, 1 different."""
    from care_core.configs.compare import compare

    one, other = _side(a), _side(b)
    found = compare(one, other, everything=everything)
    emit("".join(f"{clean(str(difference))}\n" for difference in found))
    shared = len(found) - sum(difference.a is None or difference.b is None for difference in found)
    differ = f"{len(found)} {'parameter differs' if len(found) == 1 else 'parameters differ'}"
    say(f"{differ}, {shared} in value: {one.name} (-) against {other.name} (+)")
    raise typer.Exit(ExitCode.FAULT if found else ExitCode.OK)


def _side(name: str) -> Side:
    """A configuration out of whatever was named, told by its content."""
    from care_core.configs.compare import Side
    from care_core.configs.loading import read_configs, split_name
    from care_core.logs.opening import is_recording, open_log
    from care_core.report.reading import read_report

    path, _ = split_name(name)
    head = b"" if path.is_dir() else _head(path)
    if path.is_dir() or b"\0" in head or is_recording(path):
        histories = open_log(path).settings()
        if not histories:
            raise ConfigError("The log holds no parameters.", hint="Compare a configuration file.", where=str(path))
        return Side(str(path), {name: history[-1] for name, history in histories.items()})
    if b"care.triage/" in head:
        return _suggested(read_report(path), path)
    (file,) = read_configs([name])
    return Side(name, file.settings, file.format)


def _head(path: Path) -> bytes:
    """The first bytes of a file. Raises ConfigError for what is none, or empty."""
    try:
        if path.exists() and not path.is_file():
            raise ConfigError("This is no file but a pipe or a device.", hint="Save it to a file.", where=str(path))
        with path.open("rb") as stream:
            head = stream.read(_HEAD_BYTES)
    except OSError as err:
        hint = "Check the path."
        raise ConfigError(f"Cannot read the file: {err.strerror}.", hint=hint, where=str(path)) from err
    if not head:
        raise ConfigError("The file is empty.", hint="Was it copied whole?", where=str(path))
    return head


def _suggested(report: TriageDocument, path: Path) -> Side:
    """The configuration that a report suggests: what was driven, with its fix."""
    from care_core.configs.compare import Side
    from care_core.configs.driven import readable
    from care_core.profile.store import load_profile
    from care_core.run import Setting

    config = {name: float(value) for name, value in report.config.items()}
    if report.fix is not None:
        config.update({change.option: float(change.to) for change in report.fix.changes})
    options = [option for option in load_profile(report.profile.name).schema.options if option.name in config]
    keys = {parameter: config[option.name] for option in options for parameter in readable(option)}
    settings = {key: Setting(key, value, str(path)) for key, value in keys.items()}
    return Side(str(path), settings, partial=True)


@app.command()
def apply(
    report: Annotated[Path, typer.Argument(metavar="REPORT", help="The report, YAML or JSON.", show_default=False)],
    config: Annotated[
        list[str],
        typer.Argument(metavar="CONFIG...", help="Files in the order they are loaded, for ROS also NAMESPACE=FILE."),
    ],
    out: Annotated[Path | None, typer.Option("--out", "-o", help="The new file; a folder for several.")] = None,
    in_place: Annotated[bool, typer.Option("--in-place", help="Change the files, each kept as FILE.bak.")] = False,
    alternative: Annotated[int, typer.Option("--alternative", min=0, help="Another of the report's fixes.")] = 0,
) -> None:
    """Put a report's fix into configuration files. Comments and order stay. Without -o, print the patch."""
    from care_core.configs.edit import apply_changes
    from care_core.report.reading import read_report

    if out is not None and in_place:
        raise UsageError("Either --out or --in-place.", hint="Leave one out.", where="--in-place")
    edited = apply_changes(config, _wanted(read_report(report), report, alternative))
    for line in _told(edited):
        say(line)
    changed = [file for file in edited if file.edits]
    if out is None and not in_place:
        emit("".join(_patch(file) for file in changed))
    elif in_place:
        for file in changed:
            _replace(file)
    else:
        _write_to(out or Path(), edited)


def _wanted(report: TriageDocument, path: Path, alternative: int) -> list[Wanted]:
    """The parameters that the report's fix sets, or one of its alternatives."""
    from care_core.configs.edit import Wanted
    from care_core.profile.store import load_profile

    if report.fix is None:
        raise UsageError("The report suggests no change.", where=str(path))
    sets = [report.fix, *report.fix.alternatives]
    if alternative >= len(sets):
        held = "none" if len(sets) == 1 else f"1 to {len(sets) - 1}"
        raise UsageError(f"There is no alternative {alternative}: the report has {held}.", where="--alternative")
    variables = load_profile(report.profile.name).schema.variables
    wanted = []
    for change in sets[alternative].changes:
        option = variables.get(change.option)
        if option is None:
            raise ConfigError(f"The profile has no option '{clean(change.option)}'.", where=str(path))
        named = [change.parameter] if isinstance(change.parameter, str) else change.parameter
        wanted += [Wanted(option, parameter, float(change.to)) for parameter in named]
    return wanted


def _told(edited: Sequence[EditedFile]) -> Iterator[str]:
    from care_core.run import shown

    for edit in (edit for file in edited for edit in file.edits):
        yield f"{edit.where}: {', '.join(edit.parameters)}  {shown(edit.before)} -> {edit.after}"
        if len(edit.parameters) > 1:
            yield f"  ! one line sets {len(edit.parameters)} parameters"
        for note in edit.notes:
            yield f"  ! {note}"


def _patch(file: EditedFile) -> str:
    before, after = file.before.splitlines(), file.after.splitlines()
    lines = difflib.unified_diff(before, after, f"a/{file.path}", f"b/{file.path}", lineterm="")
    return "".join(f"{clean(line)}\n" for line in lines)


def _replace(file: EditedFile) -> None:
    from care_core.files import write_atomically

    backup = next(path for path in _backups(file.path) if not path.exists())
    write_atomically(backup, file.before)
    write_atomically(file.path, file.after)
    say(f"wrote {file.path}, the old one is {backup}")


def _backups(path: Path) -> Iterator[Path]:
    yield path.with_name(f"{path.name}.bak")
    number = 1
    while True:
        yield path.with_name(f"{path.name}.bak{number}")
        number += 1


def _write_to(out: Path, edited: Sequence[EditedFile]) -> None:
    from care_core.files import write_atomically

    targets = [out / file.path.name if len(edited) > 1 or out.is_dir() else out for file in edited]
    if len(set(targets)) < len(targets):
        raise UsageError("Two of the files have the same name.", hint="Use --in-place.", where=str(out))
    if any(target.exists() and target.samefile(file.path) for target, file in zip(targets, edited, strict=True)):
        raise UsageError("That is the file itself.", hint="Use --in-place, which keeps a backup.", where=str(out))
    if len(edited) > 1:
        out.mkdir(parents=True, exist_ok=True)
    for target, file in zip(targets, edited, strict=True):
        write_atomically(target, file.after)
        say(f"wrote {target}")
