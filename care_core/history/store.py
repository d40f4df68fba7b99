"""The store: one SQLite file in the user's data folder. Never needed for an answer: whoever calls it goes on without.

Each record is a published document (`care.triage/1`, `care.verify/1`) as JSON beside the few columns that are searched.
A log that is triaged again replaces its record, a pair of report and log that is verified again likewise.
"""

from __future__ import annotations

import json
import os
import sqlite3
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from care_core.errors import CareError
from care_core.records import Record, field, plain
from care_core.run import Robot

SWITCH = "CARE_HISTORY"
"""Environment variable: `off`, or the file to use instead."""

_VERSION = 2
_WAIT_S = 30.0
"""How long a process waits for others that are writing: each takes milliseconds, a slow card may stop for seconds."""

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
_SINCE_2 = """
alter table triages add column robot text not null default '';
alter table triages add column about text not null default '{}';
alter table triages add column settings blob;
create table watched (
    log_sha256 text primary key, log_path text not null, stamp text not null, state text not null,
    attempts integer not null, holder text not null, until real not null, reason text not null
);
create index watched_stamp on watched (stamp);
"""
"""What version 2 added: whose runs they are, what was asked, all parameters; and what `care watch` has done."""


class HistoryError(CareError):
    """The store cannot be used; the work it would have recorded is not affected."""


class About(Record):
    """What is remembered of a run beside its document: what belongs to one robot and is no part of a report."""

    robot: Robot | None = None
    asked: Mapping[str, float] = field(default_factory=dict)
    firmware: str = ""
    settings: Mapping[str, float | str] = field(default_factory=dict)


class Triaged(Record):
    """One remembered triage."""

    at: str
    """When, ISO 8601 in UTC."""
    log_path: str
    mission: int
    document: Mapping[str, Any]
    robot: Robot | None = None
    asked: Mapping[str, float] = field(default_factory=dict)
    """What the mission asked for, by context of the profile."""
    firmware: str = ""
    settings: Mapping[str, float | str] = field(default_factory=dict)
    """All parameters that somebody sets, as driven; empty where the log holds none."""


class Verified(Record):
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


class History(Record):
    """The store at a path. Every call opens, works in one transaction, and closes: processes may share it."""

    path: Path

    def add_triage(self, document: Mapping[str, Any], mission: int, about: About | None = None) -> None:
        """Remember a `care.triage/1` document; one that no profile fits has the profile "". Raises HistoryError."""
        with self.writing() as connection:
            insert_triage(connection, document, mission, about or About())

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
            "select at, log_path, mission, document, about, settings from triages where ? is null or profile = ?"
            " order by id desc limit ?",
            (profile, profile, limit),
        )
        return tuple(
            Triaged(at, path, mission, self._document(text), *self._about(about), self._settings(settings))
            for at, path, mission, text, about, settings in rows
        )

    def triage_of(self, sha256: str) -> Triaged | None:
        """The last triage of a log by what it holds, None where there is none. Raises HistoryError."""
        rows = self._read(
            "select at, log_path, mission, document, about from triages where log_sha256 = ? order by id desc limit 1",
            (sha256,),
        )
        return next(
            (Triaged(at, path, mission, self._document(text), *self._about(about))
             for at, path, mission, text, about in rows),
            None,
        )  # fmt: skip

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

    def _about(self, text: str) -> tuple[Robot | None, Mapping[str, float], str]:
        about = self._document(text)
        robot = about.get("robot")
        try:
            return None if robot is None else Robot(**robot), about.get("asked", {}), about.get("firmware", "")
        except TypeError as err:
            raise self._unusable("a record in it is damaged") from err

    def _settings(self, packed: bytes | None) -> Mapping[str, float | str]:
        if packed is None:
            return {}
        try:
            return self._document(zlib.decompress(packed).decode())
        except (zlib.error, UnicodeDecodeError) as err:
            raise self._unusable("a record in it is damaged") from err

    def _document(self, text: str) -> Mapping[str, Any]:
        try:
            document = json.loads(text)
        except ValueError as err:
            raise self._unusable("a record in it is damaged") from err
        if not isinstance(document, dict):
            raise self._unusable("a record in it is damaged")
        return document

    def _write(self, statement: str, row: tuple[Any, ...]) -> None:
        with self.writing() as connection:
            connection.execute(statement, row)

    @contextmanager
    def writing(self) -> Iterator[sqlite3.Connection]:
        """One transaction that holds the store from its first statement on: what it reads stays true until it ends.

        Raises HistoryError.
        """
        with self._opened() as connection, connection:
            connection.execute("begin immediate")
            yield connection

    def _read(self, query: str, values: tuple[Any, ...]) -> list[Any]:
        if not self.path.exists():
            return []
        with self.reading() as connection:
            return connection.execute(query, values).fetchall()

    @contextmanager
    def reading(self) -> Iterator[sqlite3.Connection]:
        """The store, to be read. Raises HistoryError."""
        with self._opened() as connection:
            yield connection

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
            connection.execute("begin immediate")
            (version,) = connection.execute("pragma user_version").fetchone()  # another process may have been quicker
            for needed in (_TABLES, _SINCE_2)[version:]:
                for statement in filter(str.strip, needed.split(";")):
                    connection.execute(statement)
            connection.execute(f"pragma user_version = {_VERSION}")
            connection.commit()

    def _unusable(self, why: str) -> HistoryError:
        hint = f"Move the file away, or switch the history off with {SWITCH}=off."
        return HistoryError(f"The history cannot be used: {why}.", hint=hint, where=str(self.path))


def insert_triage(connection: sqlite3.Connection, document: Mapping[str, Any], mission: int, about: About) -> None:
    """Put a triage into the store, in the transaction of whoever has more to write with it."""
    log, profile = document["log"], document["profile"] or {"name": "", "version": ""}
    robot = None if about.robot is None else plain(about.robot)
    told = {"robot": robot, "asked": about.asked, "firmware": about.firmware}
    settings = zlib.compress(json.dumps(about.settings).encode()) if about.settings else None
    connection.execute(
        "insert into triages (at, profile, version, log_sha256, log_path, mission, document, robot, about, settings)"
        " values (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
        (
            _now(), profile["name"], profile["version"], log["sha256"], os.path.abspath(log["path"]), mission,
            json.dumps(document), "" if about.robot is None else about.robot.id, json.dumps(told), settings,
        ),
    )  # fmt: skip


def _now() -> str:
    return datetime.now(timezone.utc).isoformat(timespec="milliseconds")
