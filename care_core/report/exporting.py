"""The history as a table: a row for each run that is remembered, for whatever reads CSV or Parquet."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from care_core.history.store import Triaged
from care_core.report.document import remembered_verdict
from care_core.report.reading import remembered
from care_core.tables.rows import TableRow, write_rows
from care_core.text import clean

KIND = "history"
"""What `outputs` calls such a table."""
ABOUT = (
    "at", "start", "robot", "robot_name", "log", "sha256", "mission", "profile", "profile_version", "firmware",
    "status", "cause", "changes", "p_fixed", "odds_as_driven",
)  # fmt: skip
"""The columns before those of objectives (`objective.NAME`, with `.limit` and `.status`), contexts, metrics and
options."""


def history_rows(triages: Sequence[Triaged]) -> tuple[list[TableRow], list[str]]:
    """The rows, the oldest first, and all columns."""
    rows = [_row(one) for one in reversed(triages)]
    others = dict.fromkeys(name for row in rows for name in row if name not in ABOUT)
    return rows, [*ABOUT, *sorted(others)]


def export_history(path: Path, triages: Sequence[Triaged]) -> int:
    """Write the table, .csv or .parquet, and return its rows. Raises UsageError."""
    rows, columns = history_rows(triages)
    write_rows(path, rows, columns, KIND)
    return len(rows)


def _row(one: Triaged) -> TableRow:
    document = remembered(one.document)
    causes = [cause.option for fault in document.faults for cause in fault.causes]
    profile, fix = document.profile, document.fix
    row: TableRow = {
        "at": one.at,
        "start": document.log.start,
        "robot": None if one.robot is None else clean(one.robot.id),
        "robot_name": None if one.robot is None else clean(one.robot.name),
        "log": clean(one.log_path),
        "sha256": document.log.sha256,
        "mission": one.mission,
        "profile": profile.name if profile else None,
        "profile_version": profile.version if profile else None,
        "firmware": clean(one.firmware) or None,
        "status": remembered_verdict(document).status,
        "cause": causes[0] if causes else None,
        "changes": ", ".join(map(str, fix.changes)) if fix else None,
        "p_fixed": fix.odds if fix else None,
        "odds_as_driven": document.odds_as_driven,
    }
    for entry in document.objectives:
        name = f"objective.{entry.name}"
        row[name] = entry.value
        row[f"{name}.limit"] = entry.threshold.value if entry.threshold else None
        row[f"{name}.status"] = entry.status
    for kind, values in (("context", document.context), ("metric", document.metrics), ("option", document.config)):
        row.update({f"{kind}.{name}": value for name, value in values.items()})
    return row
