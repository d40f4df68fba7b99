"""Tables as Parquet: the one place that knows pyarrow, which only the extras `learn` and `fleet` install."""

from __future__ import annotations

import importlib.util
import io
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from care_core.errors import UsageError
from care_core.files import replace_file

SUFFIX = ".parquet"


def check_parquet(install: str) -> None:
    """Refuse, before any log is read, what could not be written. Raises UsageError with the line that installs it."""
    if importlib.util.find_spec("pyarrow") is None:
        raise UsageError("Parquet cannot be written here.", hint=install)


def write_parquet(path: Path, rows: Sequence[Mapping[str, Any]], columns: Iterable[str]) -> None:
    """Write rows, which may lack columns, whole or not at all; NaN becomes null. Raises UsageError."""
    import pyarrow as pa
    from pyarrow import parquet

    content = io.BytesIO()
    table = pa.table({name: pa.array([row.get(name) for row in rows], from_pandas=True) for name in columns})
    parquet.write_table(table, content)
    try:
        replace_file(path, content.getvalue())
    except OSError as err:
        raise UsageError(
            f"Cannot write the table: {err.strerror}.", hint="Choose another place.", where=str(path)
        ) from err


def read_parquet(path: Path) -> list[dict[str, Any]]:
    """The rows of a table.

    Raises:
        ImportError: pyarrow is not installed.
        OSError, ValueError: the file cannot be read or is no table.
    """
    from pyarrow import parquet

    rows: list[dict[str, Any]] = parquet.read_table(path).to_pylist()
    return rows
