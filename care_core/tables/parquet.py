"""Tables as Parquet: the one place that knows pyarrow, which only the extras `learn` and `fleet` install."""

from __future__ import annotations

import importlib.util
import io
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from care_core import limits
from care_core.errors import UsageError
from care_core.files import open_regular
from care_core.outputs import PARQUET_KEY, REMOVE_HINT, write_binary

SUFFIX = ".parquet"


def check_parquet(install: str) -> None:
    """Refuse, before any log is read, what could not be written. Raises UsageError with the line that installs it."""
    if importlib.util.find_spec("pyarrow") is None:
        raise UsageError("Parquet cannot be written here.", hint=install)


def write_parquet(path: Path, rows: Sequence[Mapping[str, Any]], columns: Iterable[str], kind: str) -> None:
    """Write rows, which may lack columns, whole or not at all; NaN becomes null. Raises UsageError.

    Args:
        kind: of the rows, which the file is marked with: only a table of the same kind is replaced.
    """
    import pyarrow as pa
    from pyarrow import parquet

    content = io.BytesIO()
    table = pa.table({name: pa.array([row.get(name) for row in rows], from_pandas=True) for name in columns})
    parquet.write_table(table.replace_schema_metadata({f"{PARQUET_KEY}{kind}": "1"}), content)
    write_binary(path, content.getvalue(), kind, hint=REMOVE_HINT)


def read_parquet(path: Path) -> list[dict[str, Any]]:
    """The rows of a table.

    Raises:
        ImportError: pyarrow is not installed.
        OSError, ValueError: the file cannot be read or is no table.
    """
    from pyarrow import parquet

    with open_regular(path, most=limits.TABLE_BYTES) as stream:
        rows: list[dict[str, Any]] = parquet.read_table(stream).to_pylist()
    return rows
