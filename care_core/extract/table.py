"""The table of runs: which logs go into it, its rows, and how it is written."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from pathlib import Path

from care_core.errors import LogError, UsageError
from care_core.extract.read import read_runs
from care_core.logs import open_log, sniff, whole_recording
from care_core.profile.schema import Schema
from care_core.run import Run, is_known

LOG_SUFFIXES = (".bin", ".log", ".tlog", ".bag", ".active", ".mcap", ".db3", ".zstd", ".ulg")
SHARED_SUFFIX = ".log"
"""An ending that many files have: only those that begin like a log are taken out of a folder."""
ABOUT = ("log", "mission", "log_format", "log_start", "log_sha256")
"""The columns before the variables."""
INSTALL_LEARN = "Install what it needs with: pip install 'care-tui[learn]'"

Row = dict[str, str | int | float | None]


def find_logs(places: Iterable[Path]) -> tuple[Path, ...]:
    """The logs named, and every log below the folders named, each once, in a stable order.

    A folder that a ROS 2 recorder made is one log.

    A folder that is one recording of several files counts as one log.

    Raises:
        UsageError: a place does not exist, or there is no log at all.
    """
    found: dict[Path, None] = {}
    for place in places:
        if not place.exists():
            raise UsageError("No such file or folder.", hint="Check the path.", where=str(place))
        inside = map(whole_recording, logs_below(place)) if place.is_dir() else [place]
        found.update(dict.fromkeys(inside))
    if not found:
        raise UsageError("There is no log there.", hint=f"Logs end in {', '.join(LOG_SUFFIXES)}.")
    return tuple(found)


def logs_below(folder: Path) -> list[Path]:
    """Every log in a folder and in those below it, by name; the folder itself where it is one recording."""
    if is_recording(folder):
        return [folder]
    found: list[Path] = []
    for path in sorted(folder.iterdir()):
        if path.is_dir() and not path.is_symlink():
            found += logs_below(path)
        elif is_log(path):
            found.append(path)
    return found


def is_recording(folder: Path) -> bool:
    """Whether a ROS 2 recorder made this folder."""
    return (folder / "metadata.yaml").is_file()


def is_log(path: Path) -> bool:
    """Whether a file in a folder is a log, by its ending, and by its beginning where others end like that too."""
    suffix = path.suffix.lower()
    if suffix not in LOG_SUFFIXES or not path.is_file():
        return False
    return suffix != SHARED_SUFFIX or _begins_like_a_log(path)


def _begins_like_a_log(path: Path) -> bool:
    try:
        sniff(path)
    except LogError:
        return False
    return True


def rows_of(path: Path, schema: Schema) -> list[Row]:
    """The rows of one log."""
    return [_row(path, run, schema) for run in read_runs(open_log(path), schema)]


def _row(path: Path, run: Run, schema: Schema) -> Row:
    about = (_as_text(path), run.mission.index, run.log.format, run.log.start, run.log.sha256)
    row: Row = dict(zip(ABOUT, about, strict=True))
    for name in schema.variables:
        value = run.value(name)
        row[name] = value if is_known(value) else None
    return row


def _as_text(path: Path) -> str:
    """The path; bytes that are no text are escaped, since a table cannot hold them."""
    return str(path).encode("utf-8", "backslashreplace").decode("utf-8")


def write_table(path: Path, rows: Sequence[Row], schema: Schema) -> None:
    """Write the table as CSV or Parquet, by suffix; whole or not at all."""
    columns = [*ABOUT, *schema.variables]
    if path.suffix.lower() == ".parquet":
        _write_parquet(path, rows, columns)
        return
    from care_core.report.writers import write_atomically

    stream = io.StringIO()
    writer = csv.DictWriter(stream, columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    write_atomically(path, stream.getvalue())


def check_table_path(path: Path) -> None:
    """Refuse, before any log is read, a table that could not be written. Raises UsageError."""
    if path.suffix.lower() not in (".csv", ".parquet"):
        raise UsageError("A table of runs ends in .csv or .parquet.", hint="Rename it.", where=str(path))
    from care_core.report.writers import refuse_recording

    refuse_recording(path)
    if not path.parent.is_dir():
        raise UsageError("The folder does not exist.", hint="Make it first.", where=str(path.parent))
    if path.suffix.lower() == ".parquet":
        from importlib.util import find_spec

        if find_spec("pyarrow") is None:
            raise UsageError("Parquet cannot be written here.", hint=f"{INSTALL_LEARN}, or write .csv.")


def _write_parquet(path: Path, rows: Sequence[Row], columns: list[str]) -> None:
    import pandas as pd

    temporary = path.with_name(f".{path.name}.part")
    try:
        pd.DataFrame(rows, columns=columns).to_parquet(temporary, index=False)
        temporary.replace(path)
    except OSError as err:
        raise UsageError(
            f"Cannot write the table: {err.strerror}.", hint="Choose another place.", where=str(path)
        ) from err
    finally:
        temporary.unlink(missing_ok=True)
