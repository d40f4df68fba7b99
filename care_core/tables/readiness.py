"""What a table of runs lacks to learn a profile from: runs, options that vary, values, and missions that differ."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Mapping, Sequence
from io import StringIO
from pathlib import Path

from care_core import limits
from care_core.errors import UsageError
from care_core.extras import install_hint
from care_core.files import read_small_text
from care_core.profile.schema import Schema
from care_core.records import Record
from care_core.tables.parquet import SUFFIX, read_parquet
from care_core.text import first_of
from care_core.variables import Role, Variable

MIN_RUNS = 30
"""Below this, Fisher's z at the default alpha sees only correlations above 0.5."""
ADVISED_RUNS = 100
"""From so many on the first cause named is mostly the true one: `python -m benchmarks.few_runs`."""
_NAMED = 12
"""Names in a line; of more the first."""
RUNS_FILE = "runs.csv"
"""The table of the logs that a profile was written from, beside its `profile.yaml`."""

Columns = Mapping[str, Sequence[float | None]]


class Readiness(Record):
    """What stands between a table of runs and a model. `obstacles` make learning impossible, `gaps` make it poorer."""

    runs: int
    obstacles: tuple[str, ...]
    gaps: tuple[str, ...]


def readiness(schema: Schema, columns: Columns, runs: int) -> Readiness:
    """Compare a table with what its profile declares."""
    return Readiness(runs, tuple(_obstacles(schema, columns, runs)), tuple(_gaps(schema, columns, runs)))


def _obstacles(schema: Schema, columns: Columns, runs: int) -> Iterator[str]:
    if runs < MIN_RUNS:
        yield (
            f"{runs} runs, a model needs at least {MIN_RUNS} under varied options (better {ADVISED_RUNS}): "
            f"{MIN_RUNS - runs} more"
        )
    if not schema.options:
        yield "no option is declared: record parameters, or declare them"
    elif not any(_varies(columns, option) for option in schema.options):
        yield "no option varies: nothing can be learned about any"
    gone = [option.name for option in schema.options if any(value is None for value in columns.get(option.name, ()))]
    if gone:
        yield f"options without a value in some run ({len(gone)}): {first_of(gone, _NAMED)}"
    if not schema.objectives:
        yield "no objective is declared: nothing tells a good mission from a bad one"
    elif not any(_varies(columns, objective) for objective in schema.objectives):
        yield "no objective varies: record missions that come out differently"


def _gaps(schema: Schema, columns: Columns, runs: int) -> Iterator[str]:
    still = [option.name for option in schema.options if not _varies(columns, option)]
    if still and len(still) < len(schema.options):
        yield f"options that never vary, of which nothing can be learned ({len(still)}): {first_of(still, _NAMED)}"
    for role in (Role.OBJECTIVE, Role.METRIC, Role.CONTEXT):
        empty = [v.name for v in schema.of(role) if not _known(columns, v)]
        if empty and runs:
            plural = "s" if len(empty) > 1 else ""
            yield f"{role.value}{plural} without a value in any run ({len(empty)}): {first_of(empty, _NAMED)}"
    for objective in schema.objectives:
        bound = objective.fixed
        met = {bound.met(value) for value in _known(columns, objective)} if bound is not None else set()
        if runs > 1 and len(met) == 1:
            yield f"{objective.name}: every run {'meets' if met == {True} else 'misses'} its threshold"


def _known(columns: Columns, variable: Variable) -> list[float]:
    return [value for value in columns.get(variable.name, ()) if value is not None]


def _varies(columns: Columns, variable: Variable) -> bool:
    return len(set(_known(columns, variable))) > 1


def read_columns(path: Path, schema: Schema) -> tuple[dict[str, list[float | None]], int]:
    """The columns of a table of runs that a profile declares, and how many runs it has; what is no number is None.

    Raises:
        UsageError: the table cannot be read.
    """
    try:
        rows = _parquet_rows(path) if path.suffix.lower() == SUFFIX else _csv_rows(path)
    except (OSError, ValueError, csv.Error) as err:
        reason = (err.strerror if isinstance(err, OSError) else "") or "it is no table of runs"
        raise UsageError(
            f"Cannot read the table: {reason}.", hint="Make one with 'care ingest'.", where=str(path)
        ) from err
    held = set(rows[0]) if rows else set()
    return {name: [_number(row[name]) for row in rows] for name in schema.variables if name in held}, len(rows)


def _csv_rows(path: Path) -> list[dict[str, object]]:
    text = read_small_text(path, encoding="utf-8-sig", as_it_is=True, most=limits.TABLE_BYTES)
    return [dict(row) for row in csv.DictReader(StringIO(text, newline=""))]


def _parquet_rows(path: Path) -> list[dict[str, object]]:
    try:
        return read_parquet(path)
    except ImportError as err:
        raise UsageError(
            "Parquet cannot be read here.", hint=f"{install_hint('learn')}, or use .csv.", where=str(path)
        ) from err


def _number(value: object) -> float | None:
    try:
        number = float(str(value)) if value is not None else math.nan
    except ValueError:
        return None
    return number if math.isfinite(number) else None
