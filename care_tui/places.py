"""Where logs usually are, and which were opened last."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from care_core.files import read_small_text
from care_core.folders import entries_in, files_in
from care_core.records import Record

WINDOWS_HOMES = Path("/mnt/c/Users")
"""Where Linux on Windows (WSL) sees the home folders in which ground stations keep their logs."""

_AIRCRAFT = "*/logs/*-*-*/flight*"
"""Where MAVProxy puts the flights of an --aircraft, below the folder that it was started in."""


def usual_places() -> tuple[Path, ...]:
    """Where `care` without a log looks for the newest one: here, and where recorders and ground stations put theirs."""
    from platformdirs import user_documents_path

    home = Path.home()
    seen_from_wsl = sorted(WINDOWS_HOMES.glob("*/Documents")) + sorted(WINDOWS_HOMES.glob("*/OneDrive/Documents"))
    documents = dict.fromkeys((home / "Documents", user_documents_path(), *seen_from_wsl))
    return (
        Path(),
        Path("logs"),  # MAVProxy in the folder of --aircraft, simulators
        *sorted({flight.parent.parent for flight in Path().glob(_AIRCRAFT)}),
        Path("dataflash"),  # MAVProxy's dataflash_logger
        Path("APM/LOGS"),
        home / "logs",
        home / ".ros",
        home / ".ros" / "bags",
        home / "APM" / "LOGS",
        home / "Mission Planner" / "logs",  # where Mono takes the home folder for Documents
        home / "apmplanner2" / "dataflashLogs",
        home / "apmplanner2" / "tlogs",
        Path("/var/log/flight-stack"),  # mavlink-router on a companion computer
        *(place / station for place in documents for station in _OF_STATIONS),
    )


_OF_STATIONS = tuple(
    Path(*parts)
    for parts in (
        ("Mission Planner", "logs"),
        ("QGroundControl", "Logs"),
        ("QGroundControl", "Telemetry"),
        ("QGroundControl Daily", "Logs"),
        ("QGroundControl Daily", "Telemetry"),
    )
)
"""Below the user's folder for documents."""
PLACES = usual_places()

DEEP = 3
"""Folders below a place that are looked into: Mission Planner sorts by vehicle and system."""

RECENT = 20
"""How many opened logs are remembered."""


class LogFile(Record):
    """A log that could be opened; `modified_s` in seconds since 1970, `size` in bytes."""

    path: Path
    modified_s: float
    size: int
    is_recent: bool = False


def found_logs(places: Iterable[Path], opened: Path | None = None, *, with_recent: bool = True) -> list[LogFile]:
    """Logs of these folders and the open one, and those opened before, the newest first.

    What cannot be looked at is left out.
    """
    recent = recent_logs()
    files = [path for place in places if os.path.isdir(place) for path in logs_in(place)]
    files += [] if opened is None else [opened]
    files += recent if with_recent else []
    unique = {path.absolute(): path.absolute() in recent for path in files}
    logs = [log for path, is_recent in unique.items() if (log := _look(path, is_recent)) is not None]
    return sorted(logs, key=lambda log: -log.modified_s)


def logs_in(folder: Path, deep: int = DEEP) -> Iterator[Path]:
    """The logs and recordings in a folder, and in those so deep below it."""
    from care_core.logs.finding import is_log, is_recorder_folder

    for path, is_folder in entries_in(folder):
        if is_recorder_folder(path) if is_folder else is_log(path):
            yield path
        elif is_folder and deep > 1:
            # The working folder may be anything: what lies in its folders counts only where a recorder made it.
            inside_it = logs_in(path, deep - 1 if folder != Path() else 1)
            yield from (log for log in inside_it if folder != Path() or log.is_dir() or _is_recorded(path))


def _is_recorded(folder: Path) -> bool:
    """Whether a ROS 2 recorder named this folder, though it was stopped before it wrote what is in it."""
    return folder.name.startswith("rosbag2_")


def files_of(path: Path) -> list[Path]:
    """The files of a log; a recording may be a folder of them."""
    return files_in(path) if path.is_dir() else [path]


def written_s(path: Path) -> float:
    """When a log was last written to, seconds since 1970."""
    return max((file.stat().st_mtime for file in files_of(path)), default=0.0)


def _look(path: Path, is_recent: bool) -> LogFile | None:
    try:
        size = sum(file.stat().st_size for file in files_of(path))
        return LogFile(path, written_s(path), size, is_recent)
    except OSError:  # gone, or not ours to look at
        return None


def recent_logs() -> list[Path]:
    """Logs that were opened before, the last one first."""
    try:
        return [Path(line) for line in read_small_text(_recent_file()).splitlines() if line]
    except (OSError, UnicodeDecodeError):
        return []


def remember(path: Path) -> None:
    """Put a log at the head of the recent ones. A disk that cannot be written to is no reason to stop."""
    from care_core.errors import CareError
    from care_core.files import write_atomically

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


def short(folder: Path) -> str:
    """A folder as the operator says it: from here, or from home."""
    for start, name in ((Path.cwd(), ""), (Path.home(), "~/")):
        if folder.is_relative_to(start):
            return f"{name}{folder.relative_to(start)}"
    return str(folder)


def named(places: Iterable[Path]) -> str:
    """Folders as an answer names them where nothing was found in them."""
    return ", ".join("this folder" if place == Path() else short(place) for place in places)


def as_path(typed: str) -> Path:
    """The path that was typed, pasted, or dropped on the terminal (quoted, escaped, or as a file: address)."""
    typed = typed.strip()
    if len(typed) > 1 and typed[0] == typed[-1] and typed[0] in "'\"":
        typed = typed[1:-1]
    elif not os.path.exists(typed):  # a folder that is closed to us is no error
        typed = typed.replace("\\ ", " ")
    if typed.startswith("file://"):
        from urllib.parse import unquote

        typed = unquote(typed.removeprefix("file://"))
    return at_home(typed)


def at_home(typed: str) -> Path:
    """A path in which `~` stands for somebody's folder; that of nobody stays as it was typed."""
    return Path(os.path.expanduser(typed))


def entries(typed: str, accepts: Callable[[Path], bool]) -> list[Path]:
    """Folders, and what is accepted, that the typed path could go on with, folders first; hidden ones only when asked
    for."""
    path = as_path(typed)
    folder, start = (path, "") if typed.endswith("/") else (path.parent, path.name.casefold())
    try:
        inside = list(folder.iterdir())
    except OSError:  # no such folder, or not ours to look into
        return []
    found = [
        entry
        for entry in inside
        if entry.name.casefold().startswith(start) and (start.startswith(".") or not entry.name.startswith("."))
        if os.path.isdir(entry) or accepts(entry)
    ]
    return sorted(found, key=lambda entry: (accepts(entry), entry.name.casefold()))


def is_no_log(path: Path) -> bool:
    """Whether this is a file that may be a configuration: it is no log."""
    return os.path.isfile(path) and not is_openable(path)


def is_openable(path: Path) -> bool:
    """Whether this may be a log, or a recording that is a folder."""
    from care_core.logs.finding import is_log, is_recorder_folder

    return is_log(path) or is_recorder_folder(path)
