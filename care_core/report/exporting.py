"""The history as a table: a row for each run that is remembered, for whatever reads CSV or Parquet."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from care_core.history.store import Triaged
from care_core.report.history import profile_of, status_of
from care_core.tables.rows import TableRow, write_rows
from care_core.text import cell

ABOUT = (
    "at", "start", "robot", "robot_name", "log", "sha256", "mission", "profile", "profile_version", "firmware",
    "status", "cause", "changes", "p_fixed",
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
    write_rows(path, rows, columns)
    return len(rows)


def _row(one: Triaged) -> TableRow:
    document = one.document
    profile = document["profile"] or {"name": "", "version": ""}
    causes = [cause["option"] for fault in document["faults"] for cause in fault["causes"]]
    fix = document["fix"]
    row: TableRow = {
        "at": one.at,
        "start": document["log"].get("start"),
        "robot": None if one.robot is None else cell(one.robot.id),
        "robot_name": None if one.robot is None else cell(one.robot.name),
        "log": cell(one.log_path),
        "sha256": document["log"]["sha256"],
        "mission": one.mission,
        "profile": profile_of(document) or None,
        "profile_version": profile["version"] or None,
        "firmware": cell(one.firmware) or None,
        "status": status_of(document),
        "cause": causes[0] if causes else None,
        "changes": ", ".join(f"{c['option']} {c['from']:g} -> {c['to']:g}" for c in fix["changes"]) if fix else None,
        "p_fixed": fix["p_fixed"] if fix else None,
    }
    for entry in document["objectives"]:
        name = f"objective.{entry['name']}"
        row[name] = entry["value"]
        row[f"{name}.limit"] = entry["threshold"]["value"] if entry.get("threshold") else None
        row[f"{name}.status"] = entry["status"]
    for kind, key in (("context", "context"), ("metric", "metrics"), ("option", "config")):
        row.update({f"{kind}.{name}": value for name, value in document[key].items() if not isinstance(value, str)})
    return row
