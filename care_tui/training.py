"""What `care train` does: a table of runs and a schema become a profile folder."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

from care_core.errors import UsageError
from care_core.extract.table import INSTALL_LEARN
from care_core.profile.model import write_model
from care_core.profile.schema import read_schema
from care_core.profile.store import PROFILE_FILE

CARD_FILE = "MODEL_CARD.md"


def train_profile(
    runs: Path, schema_path: Path, out: Path, *, seed: int, resamples: int, progress: Callable[[str, float], None]
) -> None:
    """Learn the model and write it into `out` with `profile.yaml` and the model card.

    Raises:
        UsageError: the learning libraries are not installed, or the folder cannot be made.
        ProfileError: the schema is unsound.
        LearningError: the table cannot be read, or cannot carry a model.
    """
    schema = read_schema(schema_path)
    try:
        from care_core.learn.card import model_card
        from care_core.learn.table import read_table
        from care_core.learn.train import Settings, train
    except ModuleNotFoundError as err:
        raise UsageError(f"Learning needs {err.name}, which is not installed.", hint=f"{INSTALL_LEARN}.") from err
    frame = read_table(runs, schema)
    model = train(frame, schema, Settings(seed=seed, resamples=resamples, origin=runs.name), progress)
    try:
        out.mkdir(parents=True, exist_ok=True)
        write_model(model, out)
        if schema_path.resolve() != (out / PROFILE_FILE).resolve():
            shutil.copyfile(schema_path, out / PROFILE_FILE)
        (out / CARD_FILE).write_text(model_card(schema, model), encoding="utf-8")
    except OSError as err:
        raise UsageError(f"Cannot write the profile: {err.strerror}.", where=str(out)) from err
