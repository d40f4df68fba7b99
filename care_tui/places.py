"""Where logs usually are, and which were opened last."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

PLACES = (Path(), Path("logs"), Path.home() / "logs", Path.home() / ".ros")
"""Folders that are looked through for logs."""

RECENT = 20
"""How many opened logs are remembered."""


@dataclass(frozen=True, slots=True)
class LogFile:
    """A log that could be opened; `modified_s` in seconds since 1970, `size` in bytes."""

    path: Path
    modified_s: float
    size: int
    is_recent: bool = False


def found_logs(places: Iterable[Path]) -> list[LogFile]:
    """Logs of these folders and those opened before, the newest first. What cannot be looked at is left out."""
    from care_core.extract.table import LOG_SUFFIXES

    recent = recent_logs()
    files = [path for place in places for path in _files(place) if path.suffix.lower() in LOG_SUFFIXES]
    unique = {path.absolute(): path.absolute() in recent for path in (*files, *recent)}
    logs = [log for path, is_recent in unique.items() if (log := _look(path, is_recent)) is not None]
    return sorted(logs, key=lambda log: -log.modified_s)


def newest_log(places: Iterable[Path]) -> Path | None:
    """The log that was written last in these folders, None when they hold none."""
    from care_core.extract.table import LOG_SUFFIXES

    logs = [_look(path, False) for place in places for path in _files(place) if path.suffix.lower() in LOG_SUFFIXES]
    newest = max((log for log in logs if log), key=lambda log: log.modified_s, default=None)
    return None if newest is None else newest.path


def _files(place: Path) -> list[Path]:
    try:
        return list(place.expanduser().iterdir())
    except OSError:  # no such folder, or not ours to read
        return []


def _look(path: Path, is_recent: bool) -> LogFile | None:
    try:
        facts = path.stat()
    except OSError:
        return None
    return LogFile(path, facts.st_mtime, facts.st_size, is_recent) if path.is_file() else None


def recent_logs() -> list[Path]:
    """Logs that were opened before, the last one first."""
    try:
        return [Path(line) for line in _recent_file().read_text(encoding="utf-8").splitlines() if line]
    except (OSError, UnicodeDecodeError):
        return []


def remember(path: Path) -> None:
    """Put a log at the head of the recent ones. A disk that cannot be written to is no reason to stop."""
    from care_core.errors import CareError
    from care_core.report import write_atomically

    path = path.absolute()
    recent = [path, *(other for other in recent_logs() if other != path)][:RECENT]
    try:
        _recent_file().parent.mkdir(parents=True, exist_ok=True)
        write_atomically(_recent_file(), "".join(f"{log}\n" for log in recent))
    except (OSError, CareError):
        return


def _recent_file() -> Path:
    from platformdirs import user_state_path

    return user_state_path("care") / "recent-logs"


def as_path(typed: str) -> Path:
    """The path that was typed, pasted, or dropped on the terminal (quoted, escaped, or as a file: address)."""
    typed = typed.strip()
    if len(typed) > 1 and typed[0] == typed[-1] and typed[0] in "'\"":
        typed = typed[1:-1]
    elif not Path(typed).exists():
        typed = typed.replace("\\ ", " ")
    if typed.startswith("file://"):
        from urllib.parse import unquote

        typed = unquote(typed.removeprefix("file://"))
    return Path(typed).expanduser()


def entries(typed: str) -> list[Path]:
    """Folders and logs that the typed path could go on with, folders first; hidden ones only when asked for."""
    from care_core.extract.table import LOG_SUFFIXES

    path = as_path(typed)
    folder, start = (path, "") if typed.endswith("/") else (path.parent, path.name.casefold())
    found = [
        entry
        for entry in _files(folder)
        if entry.name.casefold().startswith(start) and (start.startswith(".") or not entry.name.startswith("."))
    ]
    folders = sorted((entry for entry in found if entry.is_dir()), key=lambda entry: entry.name.casefold())
    logs = [entry for entry in found if entry.suffix.lower() in LOG_SUFFIXES and entry.is_file()]
    return [*folders, *sorted(logs, key=lambda entry: entry.name.casefold())]
