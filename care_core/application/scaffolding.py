"""What `care profiles new` does, and what `care profiles check` says of a profile that is not trained yet."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from care_core.errors import CareError, LogError, UsageError
from care_core.files import PROFILE_FILE
from care_core.profile.store import Profile, available_profiles, load_profile
from care_core.progress import Progress
from care_core.tables.readiness import RUNS_FILE, Readiness, read_columns, readiness
from care_core.text import none_of_logs

if TYPE_CHECKING:
    from care_core.profile.schema import Schema
    from care_core.scaffold.scaffold import Scaffold


_NAME = re.compile(r"[A-Za-z][\w.-]*")


def new_profile(logs: Sequence[Path], out: Path, *, force: bool, progress: Progress) -> tuple[Scaffold, dict[str, str]]:
    """Write `profile.yaml` and the table of the logs' runs into `out`; answers also the logs that failed, with why.

    Raises:
        UsageError: the folder cannot be made or holds a profile already, or the logs are of different robots.
        LogError: none of the logs can be read, or they hold nothing that a profile could be made of.
    """
    from care_core.files import write_atomically
    from care_core.outputs import REMOVE_HINT, check_replaceable
    from care_core.scaffold.inputs import open_input
    from care_core.scaffold.scaffold import scaffold
    from care_core.tables.rows import KIND, rows_of, write_table

    check_new(out, force=force)
    check_replaceable(out / RUNS_FILE, kind=KIND, hint=REMOVE_HINT)
    seen, failed = [], {}
    for number, path in enumerate(logs):
        progress(f"reading {path.name}", 0.5 * number / len(logs))
        try:
            seen.append(open_input(path))
        except CareError as err:
            failed[str(path)] = err.message
    if not seen:
        raise LogError(f"{none_of_logs(len(logs))} could be read.", hint="Look at one with 'care inspect'.")
    progress("trying what can be measured", 0.5)
    made = scaffold(seen, out.name, _bundled())
    out.mkdir(parents=True, exist_ok=True)
    write_atomically(out / PROFILE_FILE, made.text)
    rows = []
    for one in seen:
        try:
            rows += rows_of(one.path, made.schema)
        except CareError:  # said in the profile: the log holds no mission
            continue
    write_table(out / RUNS_FILE, rows, made.schema)
    return made, failed


def check_new(out: Path, *, force: bool) -> None:
    """Refuse, before any log is read, a folder that cannot become a profile. Raises UsageError."""
    if not _NAME.fullmatch(out.name):
        raise UsageError(
            f"'{out.name}' is no name for a profile.", hint="Use letters, digits, '-' and '_'.", where=str(out)
        )
    if out.exists() and not out.is_dir():
        raise UsageError("This is a file.", hint="Name a folder.", where=str(out))
    if not out.parent.is_dir():
        raise UsageError("The folder does not exist.", hint="Make it first.", where=str(out.parent))
    if (out / PROFILE_FILE).exists() and not force:
        raise UsageError("There is a profile already.", hint="Choose another folder, or add --force.", where=str(out))


def _bundled() -> list[Schema]:
    """Every profile that can be read, the user's own among them."""
    schemas = []
    for path in available_profiles():
        try:
            schemas.append(load_profile(path).schema)
        except CareError:  # 'care profiles check' says what is wrong with it
            continue
    return schemas


def is_trained(profile: Profile) -> bool:
    """Whether the profile's folder holds a model."""
    return (profile.path / "model.json").exists()


def ready_to_train(profile: Profile, runs: Path | None) -> Readiness:
    """What the runs of a profile lack to train it: those named, else those beside it. Raises UsageError."""
    table = runs or profile.path / RUNS_FILE
    if runs is None and not table.is_file():
        return readiness(profile.schema, {}, 0)
    columns, count = read_columns(table, profile.schema)
    return readiness(profile.schema, columns, count)


def summary(made: Scaffold, out: Path) -> str:
    """What was written, in a few lines, and what to do next."""
    schema, options = made.schema, made.options
    left = sum(map(len, options.left.values()))
    guesses = sum("a guess" in option.remark for option in options.chosen)
    measures = f"{len(schema.contexts)} contexts, {len(schema.metrics)} metrics"
    lines = [
        f"{out / PROFILE_FILE}: {schema.platform}",
        f"  missions    {schema.mission['kind']}, {len(made.measures.runs)} in {len(made.logs)} logs, "
        f"{len(made.good)} of them good",
        f"  parameters  {len(schema.options)} ({guesses} with a guessed range), {left} parameters left out",
        f"  measures    {measures}",
        *(f"  objective   {o.name} {o.threshold} {o.unit}".rstrip() for o in schema.objectives),
        "Read it and correct what is a guess. Then, with missions under varied parameters:",
        f"  care ingest LOG... -o {out.name}.parquet --profile {out}",
        f"  care train {out.name}.parquet --schema {out / PROFILE_FILE} -o {out}",
        f"What is missing for that: care profiles check {out}",
    ]
    return "\n".join(lines) + "\n"
