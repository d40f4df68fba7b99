"""The runs table: one row a run, one column a variable of the profile, checked on entry."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from scipy.special import ndtri
from scipy.stats import rankdata

from care_core import limits
from care_core.errors import LearningError, nearest
from care_core.files import open_regular
from care_core.numbers import Floats
from care_core.profile.schema import Schema
from care_core.tables.readiness import MIN_RUNS
from care_core.tables.rows import CONDITIONS
from care_core.variables import Role, Variable

FORMATS = (".csv", ".parquet")
STARTED = "log_start"
"""What runs of one site and day share (any value); when the log of a run began."""


def read_table(path: Path, schema: Schema, at_least: int = MIN_RUNS) -> pd.DataFrame:
    """Read a runs table (CSV or Parquet) and keep the schema's variables, in the schema's order, as floats.

    `CONDITIONS` is kept, made from the date of the log where the table has none; other columns (the log's name,
    provenance) are dropped. Metrics and objectives may be missing in a row: a mission
    that was refused or failed does not have them. Options may not.

    Raises:
        LearningError: the file cannot be read, a variable has no column, a value is not a number, an option is missing
            in a row, or there are fewer rows than `at_least`.
    """
    return check_table(_read(path), schema, where=str(path), at_least=at_least)


def check_table(frame: pd.DataFrame, schema: Schema, where: str = "", at_least: int = MIN_RUNS) -> pd.DataFrame:
    """The checks of `read_table` on a table that is in memory; returns a new table."""
    unknown = [str(column) for column in frame.columns if column not in schema.variables]
    for name in schema.variables:
        if name not in frame.columns:
            hint = nearest(name, unknown) or "Add the column, or take the variable out of the profile."
            raise LearningError(f"The table has no column '{name}'.", hint=hint, where=where)
    if len(frame) < at_least:
        raise LearningError(
            f"The table has {len(frame)} runs; a model needs at least {at_least}.",
            hint="Collect more runs (care collect).",
            where=where,
        )
    columns = {name: _numbers(frame[name], variable, where) for name, variable in schema.variables.items()}
    checked: pd.DataFrame = pd.DataFrame(columns)
    if CONDITIONS in frame:
        checked[CONDITIONS] = frame[CONDITIONS].to_numpy()
    elif STARTED in frame:
        checked[CONDITIONS] = frame[STARTED].astype(str).str[:10].where(frame[STARTED].notna()).to_numpy()
    return checked


def varying(frame: pd.DataFrame, names: Iterable[str]) -> tuple[str, ...]:
    """Those of the columns that hold two different values or more."""
    asked = list(names)
    values = frame[asked].to_numpy(dtype=float)
    lowest, highest = np.fmin.reduce(values, axis=0, initial=np.inf), np.fmax.reduce(values, axis=0, initial=-np.inf)
    return tuple(name for name, differs in zip(asked, lowest < highest, strict=True) if differs)


def normal_scores(values: ArrayLike) -> Floats:
    """Rank-based normal (van der Waerden) scores: ties get the score of their mean rank, NaN stays NaN.

    Metrics are counts with heavy tails, which plain Pearson correlation loses.

    Args:
        values: shape (n,) or (n, k); columns are scored one by one.

    Returns:
        Same shape, each column with mean 0 and standard deviation 1 over its known values (0 if it is constant).
    """
    data = np.asarray(values, dtype=float)
    known = np.isfinite(data)
    ranks = _ranks(np.where(known, data, np.nan))
    scores = ndtri(ranks / (known.sum(axis=0) + 1))
    count = np.maximum(known.sum(axis=0), 1)
    scores = scores - np.where(known, scores, 0.0).sum(axis=0) / count
    sd = np.sqrt(np.where(known, scores**2, 0.0).sum(axis=0) / count)
    return np.asarray(np.where(known, scores / np.where(sd > 1e-12, sd, np.inf), np.nan))


def _ranks(data: Floats) -> Floats:
    """Ranks of each column from 1, equal values share their mean, NaN stays NaN. A column without equal values needs no
    more than to be sorted, which takes a third of the time."""
    order = np.argsort(data, axis=0)
    ordered = np.take_along_axis(data, order, axis=0)
    ranks = np.empty_like(data)
    places = np.arange(1.0, len(data) + 1).reshape(-1, *(1,) * (data.ndim - 1))
    np.put_along_axis(ranks, order, np.broadcast_to(places, data.shape), axis=0)
    ranks[np.isnan(data)] = np.nan
    tied = (ordered[1:] == ordered[:-1]).any(axis=0)
    if tied.any():
        ranks[..., tied] = rankdata(data[..., tied], axis=0, nan_policy="omit")
    return ranks


def _read(path: Path) -> pd.DataFrame:
    if path.suffix.lower() not in FORMATS:
        raise LearningError(
            f"Cannot tell the format of the table from '{path.suffix}'.",
            hint=f"Use one of {', '.join(FORMATS)}.",
            where=str(path),
        )
    try:
        with open_regular(path, most=limits.TABLE_BYTES) as stream:
            frame: pd.DataFrame = pd.read_csv(stream) if path.suffix.lower() == ".csv" else pd.read_parquet(stream)
    except OSError as err:  # pyarrow's errors too
        reason = err.strerror or "it is not a table of that format"
        raise LearningError(f"Cannot read the table: {reason}.", where=str(path)) from err
    except (ValueError, ImportError) as err:  # pandas' parser errors are ValueErrors
        detail = " ".join(str(err).split())[:200]
        raise LearningError(f"Cannot read the table: {detail}.", where=str(path)) from err
    if frame.columns.has_duplicates:
        name = frame.columns[frame.columns.duplicated()][0]
        raise LearningError(f"The table has two columns named '{name}'.", where=str(path))
    return frame


def _numbers(column: pd.Series[float], variable: Variable, where: str) -> Floats:
    """The column as floats, infinite values as missing."""
    numbers = pd.to_numeric(column, errors="coerce")
    values = np.asarray(numbers, dtype=float)
    wrong = np.isnan(values) & column.notna().to_numpy()
    if wrong.any():
        row = int(wrong.argmax())
        raise LearningError(
            f"'{variable.name}' holds {column.iloc[row]!r}, which is not a number.",
            hint="Write numbers (0 or 1 for yes and no), and leave a cell empty where the value is not known.",
            where=f"{where} row {row + 1}".strip(),
        )
    values = np.where(np.isfinite(values), values, np.nan)
    # A context such as the wind is measured in flight: a refused mission has none.
    if variable.role is Role.OPTION and np.isnan(values).any():
        row = int(np.isnan(values).argmax())
        raise LearningError(
            f"The option '{variable.name}' is missing in a run.",
            hint="Fill in the value as driven, or leave the run out.",
            where=f"{where} row {row + 1}".strip(),
        )
    return values
