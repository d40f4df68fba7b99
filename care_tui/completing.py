"""What the shell is offered for a word that is being typed: profiles, parameters, objectives, missions.

Each answer is ready within a fraction of a second, so nothing here opens a log, checks a profile or imports numpy.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import typer

from care_core.files import PROFILE_FILE, profile_folders
from care_core.variables import Role


def profile_names(incomplete: str) -> list[str]:
    """Installed profiles whose names begin so; where none does, the shell names folders."""
    return [name for name in profile_folders() if name.startswith(incomplete)]


def option_names(ctx: typer.Context, incomplete: str) -> list[str]:
    """Parameters of the profile, or of all that may fit."""
    return _beginning(incomplete, _names(ctx, Role.OPTION))


def changes(ctx: typer.Context, incomplete: str) -> list[str]:
    """`PARAMETER=`, to be followed by a value."""
    return _beginning(incomplete, (f"{name}=" for name in _names(ctx, Role.OPTION)))


def limits(ctx: typer.Context, incomplete: str) -> list[str]:
    """`OBJECTIVE=`, to be followed by a value."""
    return _beginning(incomplete, (f"{name}=" for name in _names(ctx, Role.OBJECTIVE)))


def missions(ctx: typer.Context, incomplete: str) -> list[str]:
    """The missions of the log, as far as the history knows it."""
    from care_core.errors import CareError
    from care_core.history.store import History, history_path

    log, path = _log(ctx), history_path()
    if log is None or path is None:
        return []
    try:
        triaged = History(path).last_of(str(log.absolute()))
    except CareError:
        return []
    found = [] if triaged is None else triaged.document.get("missions", [])
    return _beginning(incomplete, (str(one["index"]) for one in found))


def _beginning(incomplete: str, names: Iterator[str]) -> list[str]:
    return [name for name in dict.fromkeys(names) if name.startswith(incomplete)]


def _names(ctx: typer.Context, role: Role) -> Iterator[str]:
    from care_core.profile.names import variable_names

    for folder in _profiles(ctx):
        yield from variable_names(folder, role)


def _profiles(ctx: typer.Context) -> list[Path]:
    """The folder of the profile that is named, else those that read logs such as the one that is named, else all."""
    from care_core.logs.formats import FORMATS
    from care_core.profile.names import log_formats

    installed = profile_folders()
    if named := ctx.params.get("profile"):
        path = Path(named)
        return [installed.get(named) or (path.parent if path.name == PROFILE_FILE else path)]
    log = _log(ctx)
    suffix = "" if log is None else log.suffix.lower()
    formats = {one.name for one in FORMATS if suffix in one.suffixes}
    return [one for one in installed.values() if not formats or formats & {*log_formats(one)}]


def _log(ctx: typer.Context) -> Path | None:
    """The log that is named so far; before an option without its value, what was named is not sorted yet."""
    from care_core.logs.formats import log_suffixes

    named = (ctx.params.get("log"), *(ctx.params.get("logs") or ()), *ctx.args)
    return next((Path(word) for word in named if word and Path(word).suffix.lower() in log_suffixes()), None)
