"""The store: one SQLite file in the user's data folder. Never needed for an answer: whoever calls it goes on without.

Each record is a published document (`care.triage/1`, `care.verify/1`) as JSON beside the few columns that are searched.
A log that is triaged again replaces its record, a pair of report and log that is verified again likewise.
"""

from __future__ import annotations

import json
import os
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from care_core.errors import CareError

SWITCH = "CARE_HISTORY"
"""Environment variable: `off`, or the file to use instead."""

_VERSION = 1
_WAIT_S = 2.0
"""How long a process waits for another that is writing."""

_TABLES = """
create table if not exists triages (
    id integer primary key, at text not null, profile text not null, version text not null, log_sha256 text not null,
    log_path text not null, mission integer not null, document text not null,
    unique (log_sha256, mission, profile) on conflict replace
);
create table if not exists verifications (
    id integer primary key, at text not null, profile text not null, version text not null, report_sha256 text not null,
    log_sha256 text not null, p_fixed real not null, worked integer, document text not null,
    unique (report_sha256, log_sha256, profile) on conflict replace
);
"""


class HistoryError(CareError):
    """The store cannot be used; the work it would have recorded is not affected."""


@dataclass(frozen=True, slots=True)
class Triaged:
    """One remembered triage."""

    at: str
    """When, ISO 8601 in UTC."""
    log_path: str
    mission: int
    document: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Verified:
    """One remembered verification. `worked` is None where the change was not made or nobody could tell."""

    at: str
    profile: str
    version: str
    p_fixed: float
    worked: bool | None
    document: Mapping[str, Any]


def history_path() -> Path | None:
    """Where the store is, None when it is switched off."""
    wanted = os.environ.get(SWITCH, "")
    if wanted.casefold() in ("off", "0", "no", "false"):
        return None
    if wanted:
        return Path(wanted)
    from platformdirs import user_data_path

    return user_data_path("care", appauthor=False) / "history.sqlite3"


@dataclass(frozen=True, slots=True)
class History:
    """The store at a path. Every call opens, works in one transaction, and closes: processes may share it."""

    path: Path

    def add_triage(self, document: Mapping[str, Any], mission: int) -> None:
        """Remember a `care.triage/1` document; one that no profile fits has the profile "". Raises HistoryError."""
        log, profile = document["log"], document["profile"] or {"name": "", "version": ""}
        row = (_now(), profile["name"], profile["version"], log["sha256"], log["path"], mission, json.dumps(document))
        self._write(
            "insert into triages (at, profile, version, log_sha256, log_path, mission, document)"
            " values (?, ?, ?, ?, ?, ?, ?)",
            row,
        )

    def add_verification(self, document: Mapping[str, Any]) -> None:
        """Remember a `care.verify/1` document. Raises HistoryError."""
        profile = document["profile"]
        row = (
            _now(), profile["name"], profile["version"], document["report_log"]["sha256"], document["log"]["sha256"],
            document["p_fixed"], document["worked"], json.dumps(document),
        )  # fmt: skip
        self._write(
            "insert into verifications (at, profile, version, report_sha256, log_sha256, p_fixed, worked, document)"
            " values (?, ?, ?, ?, ?, ?, ?, ?)",
            row,
        )

    def triages(self, profile: str | None = None, limit: int = -1) -> tuple[Triaged, ...]:
        """The remembered triages, the latest first: by order, for a robot's clock may jump. Raises HistoryError."""
        rows = self._read(
            "select at, log_path, mission, document from triages where ? is null or profile = ?"
            " order by id desc limit ?",
            (profile, profile, limit),
        )
        return tuple(Triaged(at, path, mission, self._document(text)) for at, path, mission, text in rows)

    def verifications(self, profile: str | None = None) -> tuple[Verified, ...]:
        """The remembered verifications, the latest first. Raises HistoryError."""
        rows = self._read(
            "select at, profile, version, p_fixed, worked, document from verifications where ? is null or profile = ?"
            " order by id desc",
            (profile, profile),
        )
        return tuple(
            Verified(at, name, version, p, None if worked is None else bool(worked), self._document(text))
            for at, name, version, p, worked, text in rows
        )

    def _document(self, text: str) -> Mapping[str, Any]:
        try:
            document = json.loads(text)
        except ValueError as err:
            raise self._unusable("a record in it is damaged") from err
        if not isinstance(document, dict):
            raise self._unusable("a record in it is damaged")
        return document

    def _write(self, statement: str, row: tuple[Any, ...]) -> None:
        with self._opened() as connection, connection:
            connection.execute(statement, row)

    def _read(self, query: str, values: tuple[Any, ...]) -> list[Any]:
        if not self.path.exists():
            return []
        with self._opened() as connection:
            return connection.execute(query, values).fetchall()

    @contextmanager
    def _opened(self) -> Iterator[sqlite3.Connection]:
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            connection = sqlite3.connect(self.path, timeout=_WAIT_S)
        except (OSError, sqlite3.Error) as err:
            raise self._unusable(getattr(err, "strerror", None) or str(err)) from err
        try:
            self._prepare(connection)
            yield connection
        except sqlite3.Error as err:
            raise self._unusable(str(err)) from err
        finally:
            connection.close()

    def _prepare(self, connection: sqlite3.Connection) -> None:
        """Make the tables of a new store; leave one of a later version of this program alone."""
        (version,) = connection.execute("pragma user_version").fetchone()
        if version > _VERSION:
            raise self._unusable("a later version of this program wrote it")
        if version < _VERSION:
            # Every statement is harmless where another process was quicker.
            connection.executescript(f"begin immediate; {_TABLES} pragma user_version = {_VERSION}; commit;")

    def _unusable(self, why: str) -> HistoryError:
        hint = f"Move the file away, or switch the history off with {SWITCH}=off."
        return HistoryError(f"The history cannot be used: {why}.", hint=hint, where=str(self.path))


def _now() -> str:
    return datetime.now(timezone.utc).isoformat(timespec="milliseconds")
