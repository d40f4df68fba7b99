"""Writers that never stop, to be killed: `python -m tests.killing JOB FOLDER` says "ready" and writes until it dies.

Each job writes what the program keeps by the program's own code, in versions that differ throughout, so that a file
made of two of them, or of half of one, is told from a whole one. `check` looks at what a kill left.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Sequence
from itertools import count
from pathlib import Path
from typing import NamedTuple

from care_core.configs.loading import read_config
from care_core.diagnose.records import Diagnosis
from care_core.files import bundled, write_atomically
from care_core.history.store import History
from care_core.outputs import write_output
from care_core.profile.model import read_model, write_model
from care_core.records import replace
from care_core.report.document import build_document
from care_core.report.reading import read_report
from care_core.report.writers import published, to_yaml
from care_core.tables.rows import write_table
from tests.made import made_diagnosis

LONG = 20_000


class Job(NamedTuple):
    """`write` writes the version of a number; `check` says how many versions are surely there, and raises where what
    is there is not whole."""

    write: Callable[[Path, int], None]
    check: Callable[[Path], int]


def _diagnosis(version: int) -> Diagnosis:
    made = made_diagnosis()
    return replace(made, notes=tuple(f"version {version}, line {line}" for line in range(LONG // 10)))


def _check_notes(notes: Sequence[str]) -> None:
    versions = [note.partition(",")[0] for note in notes if note.startswith("version ")]
    assert len(versions) == LONG // 10
    assert len(set(versions)) == 1


def _write_report(folder: Path, version: int) -> None:
    path, text = folder / "report.yaml", to_yaml(build_document(_diagnosis(version % 2)))
    write_output(path, text)


def _check_report(folder: Path) -> int:
    if (folder / "report.yaml").exists():
        _check_notes(read_report(folder / "report.yaml").notes)
    return 0


def _write_history(folder: Path, version: int) -> None:
    document = published(build_document(_diagnosis(version)))
    document["log"]["sha256"] = f"{version:064x}"
    History(folder / "history.sqlite3").add_triage(document, 1)


def _check_history(folder: Path) -> int:
    kept = History(folder / "history.sqlite3").triages()
    for one in kept:
        _check_notes(one.document["notes"])
    return len(kept)


def _write_profile(folder: Path, version: int) -> None:
    model = read_model(bundled("profiles", ("arducopter", "move_base")[version % 2]))
    write_model(model, folder)


def _check_profile(folder: Path) -> int:
    if (folder / "model.json").exists():
        read_model(folder)
    return 0


def _write_table(folder: Path, version: int) -> None:
    from care_core.profile.store import load_profile

    schema = load_profile("arducopter").schema
    rows = [dict.fromkeys(schema.variables, float(version)) for _ in range(2_000)]
    for name in ("runs.parquet", "runs.csv"):
        write_table(folder / name, rows, schema)  # type: ignore[arg-type]


def _check_table(folder: Path) -> int:
    import pandas as pd

    for name, read in (("runs.parquet", pd.read_parquet), ("runs.csv", pd.read_csv)):
        if (folder / name).exists():
            table = read(folder / name)
            assert len(table) == 2_000
            assert table["LAND_SPEED"].nunique() == 1
    return 0


def _write_config(folder: Path, version: int) -> None:
    """As `care apply --in-place` does: the backup before the file."""
    path = folder / "vehicle.param"
    if path.exists():
        write_atomically(folder / "vehicle.param.bak", path.read_text(), 0o600)
    write_atomically(path, "".join(f"P{n},{version}\n" for n in range(LONG)), 0o600)


def _check_config(folder: Path) -> int:
    for path in folder.glob("vehicle.param*"):
        values = read_config(path)
        assert len(values) == LONG
        assert len({setting.value for setting in values.values()}) == 1
        assert path.stat().st_mode & 0o777 == 0o600
    return 0


JOBS: dict[str, Job] = {
    "report": Job(_write_report, _check_report),
    "history": Job(_write_history, _check_history),
    "profile": Job(_write_profile, _check_profile),
    "table": Job(_write_table, _check_table),
    "configuration": Job(_write_config, _check_config),
}


def main() -> None:
    name, folder = sys.argv[1], Path(sys.argv[2])
    first = JOBS[name].check(folder)
    for version in count(first):
        JOBS[name].write(folder, version)
        print(json.dumps(version + 1 if name == "history" else 0), flush=True)


if __name__ == "__main__":
    main()
