"""Many logs to one table of runs, in parallel. A log that cannot be read is told apart and never stops the rest."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path

from care_core.errors import CareError, UsageError
from care_core.extract.read import read_runs
from care_core.logs import open_log, whole_recording
from care_core.profile.schema import Schema
from care_core.run import Run, is_known

LOG_SUFFIXES = (".bin", ".log", ".tlog", ".ulg", ".bag", ".active", ".mcap", ".db3", ".zstd")
INSTALL_LEARN = "Install what it needs with: pip install 'care-tui[learn]'"

Row = dict[str, str | int | float | None]


@dataclass(frozen=True, slots=True)
class Failure:
    """A log that gave no runs, and why."""

    path: Path
    reason: str


def find_logs(places: Iterable[Path]) -> tuple[Path, ...]:
    """The files named, and every log below the folders named, each once, in a stable order.

    A folder that is one recording of several files counts as one log.

    Raises:
        UsageError: a place does not exist, or there is no log at all.
    """
    found: dict[Path, None] = {}
    for place in places:
        if not place.exists():
            raise UsageError("No such file or folder.", hint="Check the path.", where=str(place))
        inside = sorted(path for path in place.rglob("*") if path.suffix.lower() in LOG_SUFFIXES and path.is_file())
        found.update(dict.fromkeys(map(whole_recording, inside) if place.is_dir() else [place]))
    if not found:
        raise UsageError("There is no log there.", hint=f"Logs end in {' or '.join(LOG_SUFFIXES)}.")
    return tuple(found)


def ingest(
    paths: Sequence[Path], schema: Schema, *, workers: int | None = None, progress: Callable[[str, float], None]
) -> tuple[list[Row], list[Failure]]:
    """Rows of `log`, `mission` and every variable of the schema (None: not known), one a mission, in order of paths."""
    rows: dict[Path, list[Row]] = {}
    failures: dict[Path, Failure] = {}
    count = min(workers or os.cpu_count() or 1, len(paths))
    with ProcessPoolExecutor(max_workers=max(count, 1)) as pool:
        jobs = {pool.submit(rows_of, path, schema): path for path in paths}
        for done, job in enumerate(as_completed(jobs), start=1):
            path = jobs[job]
            try:
                rows[path] = job.result()
            except CareError as err:
                failures[path] = Failure(path, err.message)
            except Exception as err:  # a defect met in one log must not lose the others
                failures[path] = Failure(path, f"unexpected {type(err).__name__}: {err}")
            progress(f"read {done} of {len(paths)} logs", done / len(paths))
    ordered = [row for path in paths for row in rows.get(path, ())]
    return ordered, [failures[path] for path in paths if path in failures]


def rows_of(path: Path, schema: Schema) -> list[Row]:
    """The rows of one log."""
    return [_row(path, run, schema) for run in read_runs(open_log(path), schema)]


def _row(path: Path, run: Run, schema: Schema) -> Row:
    row: Row = {"log": str(path), "mission": run.mission.index}
    for name in schema.variables:
        value = run.value(name)
        row[name] = value if is_known(value) else None
    return row


def write_table(path: Path, rows: Sequence[Row], schema: Schema) -> None:
    """Write the table as CSV or Parquet, by suffix; whole or not at all."""
    columns = ["log", "mission", *schema.variables]
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
