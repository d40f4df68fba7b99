"""Faults whose causes are known, as published: a table of runs a fault, the faulty ones first, and tables of causes."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from care_core import limits
from care_core.errors import LearningError
from care_core.files import open_regular
from care_core.profile.schema import Schema
from care_core.records import Record

FAULTY_RUNS = 2
"""The first rows of a fault file are the faulty runs; the others were given with them."""

_FAULT_FILE = re.compile(r"(?P<robot>.+)_fault_(?P<objective>.+)_(?P<number>\d+)\.csv")


class FaultFile(Record, eq=False):
    """One fault: its runs (the faulty ones first), the objective that it breaks, and what is known of its causes."""

    name: str
    objective: str
    runs: pd.DataFrame
    true: frozenset[str]
    published: frozenset[str] | None
    fixed: frozenset[str]
    """True causes that do not vary in the file."""

    def varies(self, option: str) -> bool:
        return bool(self.runs[option].nunique() > 1)


def read_faults(folder: Path, schema: Schema, truths: Sequence[Path] = ()) -> tuple[FaultFile, ...]:
    """Every fault of the profile's objectives in a folder (`ROBOT_fault_OBJECTIVE_N.csv`), with its true causes.

    Truths (`ROBOT_ground_truth_*.csv`, row N for fault N, a column an option) and published predictions
    (`ROBOT_predictions_*.csv`) are found beside the faults, unless `truths` names the former.

    Raises:
        LearningError: no fault file, a file without the profile's columns, or no truth for an objective.
    """
    found: dict[str, dict[int, Path]] = {}
    robots = set()
    for path in sorted(folder.glob("*_fault_*.csv")):
        match = _FAULT_FILE.fullmatch(path.name)
        if match and match["objective"] in {objective.name for objective in schema.objectives}:
            found.setdefault(match["objective"], {})[int(match["number"])] = path
            robots.add(match["robot"])
    if not found:
        raise LearningError(
            f"The folder holds no fault of profile '{schema.name}'.",
            hint="Its files are called ROBOT_fault_OBJECTIVE_N.csv.",
            where=str(folder),
        )
    if len(robots) > 1:
        raise LearningError(
            f"The folder holds faults of several robots: {', '.join(sorted(robots))}.",
            hint="Put each robot's faults in a folder of its own.",
            where=str(folder),
        )
    robot = robots.pop()
    truth = _by_objective(truths or sorted(folder.glob(f"{robot}_ground_truth_*.csv")), list(found))
    published = _by_objective(sorted(folder.glob(f"{robot}_predictions_*.csv")), list(found))
    faults = []
    for objective, files in found.items():
        if objective not in truth:
            raise LearningError(
                f"There is no table of true causes for '{objective}'.", hint="Name it with --truth.", where=str(folder)
            )
        true = _causes(truth[objective], schema)
        answers = _causes(published[objective], schema) if objective in published else {}
        faults += [
            _fault(f"{objective} {n}", objective, path, schema, true.get(n), answers.get(n))
            for n, path in sorted(files.items())
        ]
    return tuple(faults)


def _by_objective(files: Sequence[Path], objectives: Sequence[str]) -> dict[str, Path]:
    """Which file belongs to which objective: by its name in the file's, the one left over to the one left over."""
    matched = {name: path for name in objectives for path in files if name.casefold() in path.stem.casefold()}
    left = [path for path in files if path not in matched.values()]
    missing = [name for name in objectives if name not in matched]
    if len(left) == len(missing) == 1:
        matched[missing[0]] = left[0]
    return matched


def _read(path: Path, wanted: Sequence[str]) -> pd.DataFrame:
    try:
        with open_regular(path, most=limits.TABLE_BYTES) as stream:
            frame = pd.read_csv(stream)
    except OSError as err:
        raise LearningError(f"Cannot read the table: {err.strerror}.", where=str(path)) from err
    except ValueError as err:
        raise LearningError(f"Cannot read the table: {err}.", where=str(path)) from err
    absent = [name for name in wanted if name not in frame]
    if absent:
        raise LearningError(
            f"The table has no column '{absent[0]}'.", hint="It needs a column for every option.", where=str(path)
        )
    return frame


def _causes(path: Path, schema: Schema) -> dict[int, frozenset[str]]:
    """Fault number (from 1) to the options whose cell is 1."""
    names = [option.name for option in schema.options]
    frame = _read(path, names)
    return {n: frozenset(name for name in names if row[name] == 1) for n, (_, row) in enumerate(frame.iterrows(), 1)}


def _fault(
    name: str,
    objective: str,
    path: Path,
    schema: Schema,
    true: frozenset[str] | None,
    published: frozenset[str] | None,
) -> FaultFile:
    if true is None:
        raise LearningError(f"The table of true causes has no row for {name}.", where=str(path))
    runs = _read(path, [*(option.name for option in schema.options), objective])
    if len(runs) <= FAULTY_RUNS:
        raise LearningError(
            f"The file needs more than {FAULTY_RUNS} runs: the faulty ones, then others.", where=str(path)
        )
    fixed = frozenset(cause for cause in true if runs[cause].nunique() == 1)
    return FaultFile(name, objective, runs, true, published, fixed)
