"""Arguments and options that several commands share."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from care_core.errors import UsageError
from care_core.files import format_by_ending, is_stream
from care_tui.completing import limits, missions, option_names, profile_names
from care_tui.console import check_writable

if TYPE_CHECKING:
    from care_core.application.sharing import Sharing

PLAIN = ("", ".txt")
"""Endings of files that hold plain text."""

LogPath = Annotated[Path, typer.Argument(metavar="LOG", help="The log to read.", show_default=False)]


def profile_option(text: str) -> Any:
    """`--profile` with its help; a shell completes it."""
    return typer.Option("--profile", "-p", metavar="PROFILE", help=text, autocompletion=profile_names)


ProfileName = Annotated[str | None, profile_option("Name or folder; chosen by the log if absent.")]
ConfigPaths = Annotated[
    list[str] | None,
    typer.Option(
        "--config",
        metavar="[NAMESPACE=]FILE",
        help="The robot's configuration file, for what the log lacks; may be repeated, a later one wins.",
    ),
]


def _writable(out: Path | None) -> Path | None:
    if out is not None:
        check_writable(out)
    return out


def is_json(out: Path | None) -> bool:
    """Whether the file that was named is to hold JSON."""
    return out is not None and out.suffix.lower() == ".json"


def format_named_by(out: Path | None, formats: Mapping[str, Sequence[str]]) -> str | None:
    """The format that the name of a file chooses, None for plain text. Raises UsageError for an unknown ending."""
    if out is None or is_stream(out) or out.suffix.lower() in PLAIN:
        return None
    try:
        return format_by_ending(out, formats)
    except UsageError as err:
        raise UsageError(err.message, hint="Plain text takes .txt.", where="--out") from err


Out = Annotated[
    Path | None, typer.Option("--out", "-o", callback=_writable, help="Write to this file instead of stdout.")
]
Force = Annotated[bool, typer.Option("--force", help="Replace a file of another kind with --out; never a log.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON.")]
Thresholds = Annotated[
    list[str] | None,
    typer.Option(
        "--threshold", metavar="NAME=VALUE", help="Judge this objective by this bound.", autocompletion=limits
    ),
]
Keep = Annotated[
    list[str] | None,
    typer.Option(
        "--keep",
        metavar="OPTION",
        help="Never change this parameter; may be repeated.",
        autocompletion=option_names,
    ),
]
Since = Annotated[
    Path | None,
    typer.Option("--since", metavar="GOOD_LOG", help="List what changed since this good run, and judge against it."),
]
Reference = Annotated[
    Path | None,
    typer.Option("--reference", metavar="FILE", help="Judge against this configuration, a file or a log."),
]
Site = Annotated[
    Path | None,
    typer.Option("--site", metavar="FILE", help="Judge by the limits of this file; your own site.yaml if absent."),
]
RobotName = Annotated[
    str | None, typer.Option("--robot", metavar="NAME", help="Whose log it is; by what the log says if absent.")
]
Mission = Annotated[
    int | None,
    typer.Option(
        "--mission",
        min=1,
        metavar="NUMBER",
        help="Which mission of the log; the last if absent.",
        autocompletion=missions,
    ),
]


Positions = Annotated[
    bool | None,
    typer.Option(
        "--positions/--no-positions",
        help="With or without where the robot was; without in Markdown, HTML, JUnit and bundles if absent.",
        show_default=False,
    ),
]
Anonymous = Annotated[
    bool, typer.Option("--anonymous", help="Leave out names, hosts, serial numbers, paths, positions and dates.")
]


def sharing_for(positions: bool | None, *, anonymous: bool) -> Sharing | None:
    """What of a run goes into a document; None where its format says so."""
    if positions is None and not anonymous:
        return None
    from care_core.application.sharing import Sharing

    return Sharing(positions=bool(positions), anonymous=anonymous)


def chosen(flags: Mapping[str, bool]) -> str | None:
    """The one format that is asked for by its flag, None for none. Raises UsageError for more than one."""
    names = [name for name, is_wanted in flags.items() if is_wanted]
    if len(names) > 1:
        raise UsageError(f"Only one of --{' and --'.join(names)} can be printed.", hint="Leave the others out.")
    return names[0] if names else None


def bounds(texts: Iterable[str]) -> dict[str, float]:
    """The operator's thresholds out of NAME=VALUE. Raises UsageError for a value that is not a number."""
    found = {}
    for text in texts:
        name, _, value = text.partition("=")
        try:
            bound = float(value)
        except ValueError:
            bound = math.nan
        if not math.isfinite(bound):
            raise UsageError(f"'{text}' is no bound.", hint=f"Write --threshold {name}=NUMBER.", where="--threshold")
        found[name.strip()] = bound
    return found
