"""The table of runs: its rows, and how it is written."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from care_core.diagnose.judging import judge
from care_core.ecosystems.registry import run_model
from care_core.errors import UsageError
from care_core.extract.read import read_runs
from care_core.extras import install_hint
from care_core.logs.opening import open_log
from care_core.outputs import REMOVE_HINT, check_replaceable, write_output
from care_core.profile.schema import Schema
from care_core.run import Run, Setting, is_known
from care_core.tables import parquet
from care_core.text import csv_table

ABOUT = ("log", "mission", "log_format", "log_start", "log_sha256")
"""The columns before the variables."""
KIND = "runs"
"""What `outputs` calls such a table."""
CONDITIONS = "conditions"
"""A column that a table may have: runs with one value in it met the same conditions, others did not."""

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
    """Write the table as CSV or Parquet, by suffix; whole or not at all. Raises UsageError."""
    write_rows(path, rows, [*ABOUT, *schema.variables], KIND)


def write_rows(path: Path, rows: Sequence[TableRow], columns: Sequence[str], kind: str) -> None:
    """Write rows as CSV or Parquet, by suffix; whole or not at all, over a table of the same kind only.

    A row may lack columns. Raises UsageError.
    """
    if path.suffix.lower() == parquet.SUFFIX:
        parquet.write_parquet(path, rows, columns, kind)
    else:
        text = csv_table([columns, *([row.get(name) for name in columns] for row in rows)])
        write_output(path, text, hint=REMOVE_HINT)


def check_table_path(path: Path, kind: str = KIND) -> None:
    """Refuse, before any log is read, a table that could not be written. Raises UsageError."""
    if path.suffix.lower() not in (".csv", parquet.SUFFIX):
        raise UsageError("A table of runs ends in .csv or .parquet.", hint="Rename it.", where=str(path))
    check_replaceable(path, kind=kind, hint=REMOVE_HINT)
    if not path.parent.is_dir():
        raise UsageError("The folder does not exist.", hint="Make it first.", where=str(path.parent))
    if path.suffix.lower() == parquet.SUFFIX:
        parquet.check_parquet(f"{install_hint('learn')}, or write .csv.")
