"""What `care train` does: a table of runs and a schema become a profile folder."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from care_core.errors import LearningError, UsageError
from care_core.extract.table import INSTALL_LEARN
from care_core.profile.model import write_model
from care_core.profile.schema import read_schema
from care_core.profile.store import PROFILE_FILE

if TYPE_CHECKING:
    import pandas as pd


def train_profile(
    runs: Path, schema_path: Path, out: Path, *, seed: int, resamples: int, progress: Callable[[str, float], None]
) -> None:
    """Learn the model and write `profile.yaml` with it into `out`.

    Raises:
        UsageError: the learning libraries are not installed.
        ProfileError: the schema is unsound.
        LearningError: the table cannot be read, or cannot carry a model.
    """
    schema = read_schema(schema_path)
    try:
        from care_core.learn.train import train
    except ModuleNotFoundError as err:
        raise UsageError(f"Learning needs {err.name}, which is not installed.", hint=f"{INSTALL_LEARN}.") from err
    frame = read_runs_table(runs)
    progress("learning", 0.0)
    model = train(frame, schema, seed=seed, resamples=resamples)
    out.mkdir(parents=True, exist_ok=True)
    write_model(model, out)
    if schema_path.resolve() != (out / PROFILE_FILE).resolve():
        shutil.copyfile(schema_path, out / PROFILE_FILE)


def read_runs_table(path: Path) -> pd.DataFrame:
    """A table of runs from CSV or Parquet."""
    import pandas as pd

    try:
        return pd.read_parquet(path) if path.suffix.lower() == ".parquet" else pd.read_csv(path)
    except ImportError as err:
        raise UsageError("Parquet cannot be read here.", hint=f"{INSTALL_LEARN}, or give a .csv.") from err
    except (OSError, ValueError) as err:
        detail = " ".join(str(err).split())[:200]
        raise LearningError(f"Cannot read the table of runs: {detail}.", where=str(path)) from err
