"""The table of runs: its rows, and how it is written."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path

from care_core.diagnose.judging import judge
from care_core.ecosystems.registry import run_model
from care_core.errors import UsageError
from care_core.extract.read import read_runs
from care_core.logs.opening import open_log
from care_core.profile.schema import Schema
from care_core.run import Run, Setting, is_known
from care_core.tables import parquet

ABOUT = ("log", "mission", "log_format", "log_start", "log_sha256")
"""The columns before the variables."""
CONDITIONS = "conditions"
"""A column that a table may have: runs with one value in it met the same conditions, others did not."""
INSTALL_LEARN = "Install what it needs with: pip install 'care-tui[learn]'"

TableRow = dict[str, str | int | float | None]


def rows_of(path: Path, schema: Schema, overrides: Mapping[str, Setting] | None = None) -> list[TableRow]:
    """The rows of one log; objectives that mean nothing for their mission are empty.

    `overrides` are settings by the name of the parameter in the log, for options that the log does not hold.
    """
    runs = read_runs(run_model(open_log(path)), schema, overrides=overrides)
    return [_row(path, judge(run, schema, None).run, schema) for run in runs]


def _row(path: Path, run: Run, schema: Schema) -> TableRow:
    about = (_as_text(path), run.mission.index, run.log.format, run.log.start, run.log.sha256)
    row: TableRow = dict(zip(ABOUT, about, strict=True))
    for name in schema.variables:
        value = run.value(name)
        row[name] = value if is_known(value) else None
    return row


def _as_text(path: Path) -> str:
    """The path; bytes that are no text are escaped, since a table cannot hold them."""
    return str(path).encode("utf-8", "backslashreplace").decode("utf-8")


def write_table(path: Path, rows: Sequence[TableRow], schema: Schema) -> None:
    """Write the table as CSV or Parquet, by suffix; whole or not at all."""
    write_rows(path, rows, [*ABOUT, *schema.variables])


def write_rows(path: Path, rows: Sequence[TableRow], columns: list[str]) -> None:
    """Write rows as CSV or Parquet, by suffix; whole or not at all. A row may lack columns."""
    if path.suffix.lower() == parquet.SUFFIX:
        parquet.write_parquet(path, rows, columns)
        return
    from care_core.files import write_atomically

    stream = io.StringIO()
    writer = csv.DictWriter(stream, columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    write_atomically(path, stream.getvalue())


def check_table_path(path: Path) -> None:
    """Refuse, before any log is read, a table that could not be written. Raises UsageError."""
    if path.suffix.lower() not in (".csv", parquet.SUFFIX):
        raise UsageError("A table of runs ends in .csv or .parquet.", hint="Rename it.", where=str(path))
    from care_core.files import refuse_recording

    refuse_recording(path)
    if not path.parent.is_dir():
        raise UsageError("The folder does not exist.", hint="Make it first.", where=str(path.parent))
    if path.suffix.lower() == parquet.SUFFIX:
        parquet.check_parquet(f"{INSTALL_LEARN}, or write .csv.")
