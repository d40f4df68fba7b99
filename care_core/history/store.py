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
from contextlib import closing, contextmanager
from datetime import datetime, timezone
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

from care_core import limits
from care_core.errors import CareError
from care_core.files import open_regular
from care_core.records import Record, Struct, UnfitError, field, plain, read
from care_core.run import Robot
from care_core.text import clean

SWITCH = "CARE_HISTORY"
"""Environment variable: `off`, or the file to use instead."""

_VERSION = 3
_OWN_FILE, _OWN_FOLDER = 0o600, 0o700
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
_SINCE_3 = """
create index triages_robot on triages (robot);
"""
"""What version 3 added: the earlier runs of one robot are found without a walk through every document in the file."""
_STEPS = (_TABLES, _SINCE_2, _SINCE_3)


JUDGED_BY = "log_sha256 = ? and (instr(about, ?) > 0 or (? = '' and instr(about, '\"terms\": ') = 0))"
"""A triage of this log by these terms; those of earlier versions do not tell theirs and count as the usual ones."""


def judged_by(sha256: str, terms: str) -> tuple[str, str, str]:
    """The values of JUDGED_BY."""
    return sha256, f'"terms": {json.dumps(terms)}', terms


class HistoryError(CareError):
    """The store cannot be used; the work it would have recorded is not affected."""


class About(Record):
    """What is remembered of a run beside its document: what belongs to one robot and is no part of a report."""

    robot: Robot | None = None
    asked: Mapping[str, float] = field(default_factory=dict)
    """What the mission asked for, by context of the profile."""
    firmware: str = ""
    settings: Mapping[str, float | str] = field(default_factory=dict)
    """All parameters that somebody sets, as driven; empty where the log holds none."""
    recording: str = ""
    """What copies of its log share; empty where that is not known."""
    terms: str = ""
    """What it was judged by where that was not the profile alone, as a digest."""
    individual: Mapping[str, float | str] = field(default_factory=dict)
    """The parameters that tell this vehicle from others of its kind; empty where the log holds none."""
    judged_with: str = ""
    """Options that gave it other limits or another reference than its own, as they were typed."""


class Triaged(About, kw_only=True):
    """One remembered triage, with what is remembered beside its document."""

    at: str
    """When, ISO 8601 in UTC."""
    log_path: str
    mission: int
    document: Mapping[str, Any]


class Verified(Record):
    """One remembered verification. `worked` is None where the change was not made or nobody could tell."""

    at: str
    profile: str
    version: str
    p_fixed: float
    worked: bool | None
    document: Mapping[str, Any]


class _Log(Struct):
    start: str | None = None


class _Profile(Struct):
    name: str


class _Need(Struct):
    value: float | None = None


class _Limit(Struct):
    op: str


class _Objective(Struct):
    name: str
    unit: str = ""
    value: float | None = None
    needs: _Need | None = None
    threshold: _Limit | None = None


class _Searched(Struct):
    """What is looked up in a remembered document before it is read as a whole."""

    log: _Log
    profile: _Profile | None
    objectives: list[_Objective]
    config: dict[str, float]


R = TypeVar("R", bound=Record)


def history_path() -> Path | None:
    """Where the store is, None when it is switched off."""
    wanted = os.environ.get(SWITCH, "")
    if wanted.casefold() in ("off", "0", "no", "false"):
        return None
    return Path(wanted) if wanted else _own_path()


class History(Record):
    """The store at a path. Every call opens, works in one transaction, and closes: processes may share it."""

    path: Path

    def add_triage(self, document: Mapping[str, Any], mission: int, about: About | None = None) -> None:
        """Remember a `care.triage/1` document; one that no profile fits has the profile "". Raises HistoryError."""
        with self.writing() as connection:
            insert_triage(connection, document, mission, about or About())

    def add_verification(self, document: Mapping[str, Any]) -> None:
        """Remember a `care.verify/1` document; nothing of one that no odds were promised for. Raises HistoryError."""
        if document["p_fixed"] is None:
            return
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
        """The remembered triages, the latest first: by order, for a robot's clock may jump. Of copies of one recording
        the latest counts. Raises HistoryError."""
        rows = self._read(
            "select at, log_path, mission, document, about, settings from triages where ? is null or profile = ?"
            " order by id desc limit ?",
            (profile, profile, limit),
        )
        newest: dict[tuple[str, int, str], Triaged] = {}
        for number, row in enumerate(rows):
            triaged = self._triaged(*row)
            of_profile = (triaged.document["profile"] or {}).get("name", "")
            newest.setdefault((triaged.recording or str(number), triaged.mission, of_profile), triaged)
        return tuple(newest.values())

    def runs_of(self, robot: str) -> Iterator[Triaged]:
        """The remembered triages of the robot with this id, the latest first, each read when it is asked for. Raises
        HistoryError."""
        numbers = self._read("select id from triages where robot = ? order by id desc", (robot,))
        for (number,) in numbers:
            columns = "at, log_path, mission, document, about, settings"
            yield from (
                self._triaged(*row) for row in self._read(f"select {columns} from triages where id = ?", (number,))
            )

    def triage_of(self, sha256: str, terms: str = "") -> Triaged | None:
        """The last triage of a log by what it holds, judged by these terms; None where there is none. Raises
        HistoryError."""
        return self._last(JUDGED_BY, judged_by(sha256, terms))

    def last_of(self, log_path: str) -> Triaged | None:
        """The last triage of the log at a path, None where there is none. Raises HistoryError."""
        return self._last("log_path = ?", (log_path,))

    def _last(self, which: str, values: tuple[str, ...]) -> Triaged | None:
        columns = "at, log_path, mission, document, about"
        rows = self._read(f"select {columns} from triages where {which} order by id desc limit 1", values)
        return next((self._triaged(at, path, mission, text, about) for at, path, mission, text, about in rows), None)

    def verifications(self, profile: str | None = None) -> tuple[Verified, ...]:
        """The remembered verifications, the latest first. Raises HistoryError."""
        rows = self._read(
            "select at, profile, version, p_fixed, worked, document from verifications where ? is null or profile = ?"
            " order by id desc",
            (profile, profile),
        )
        return tuple(self._verified(at, name, version, p, worked, text) for at, name, version, p, worked, text in rows)

    def _triaged(
        self, at: str, path: str, mission: int, text: str, about: str, settings: bytes | None = None
    ) -> Triaged:
        said = {**plain(About()), **self._document(about), "settings": {}}  # an earlier version told less
        if settings is not None:
            said["settings"] = self._document(self._unpacked(settings))
        document = self._document(text)
        try:
            read(_Searched, {name: document.get(name) for name in _Searched.__struct_fields__})
        except (UnfitError, OverflowError) as err:
            raise self._unusable("a record in it is damaged") from err
        known = {name: said[name] for name in About.__struct_fields__}
        return self._checked(Triaged, at=at, log_path=path, mission=mission, document=document, **known)

    def _verified(self, at: str, name: str, version: str, p: float, worked: int | None, text: str) -> Verified:
        did_work = None if worked is None else bool(worked)
        document = self._document(text)
        return self._checked(
            Verified, at=at, profile=name, version=version, p_fixed=p, worked=did_work, document=document
        )

    def _checked(self, kind: type[R], **values: Any) -> R:
        """A record of these values, each of the type that the record declares."""
        try:
            return read(kind, values)
        except (UnfitError, OverflowError) as err:
            raise self._unusable("a record in it is damaged") from err

    def _unpacked(self, packed: bytes) -> str:
        try:
            unpacker = zlib.decompressobj()
            text = unpacker.decompress(packed, limits.SMALL_FILE_BYTES)
            if unpacker.unconsumed_tail:
                raise self._unusable("a record in it is too large")
            return text.decode()
        except (zlib.error, UnicodeDecodeError, TypeError) as err:
            raise self._unusable("a record in it is damaged") from err

    def _document(self, text: str) -> dict[str, Any]:
        try:
            document = json.loads(text)
        except (ValueError, TypeError, RecursionError) as err:
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
            self._make_private()
            connection = sqlite3.connect(self.path, timeout=_WAIT_S)
        except (OSError, ValueError, sqlite3.Error) as err:
            raise self._unusable(getattr(err, "strerror", None) or str(err)) from err
        try:
            connection.execute("pragma trusted_schema = off")
            self._prepare(connection)
            yield connection
        except sqlite3.Error as err:
            raise self._unusable(str(err)) from err
        finally:
            connection.close()

    def _make_private(self) -> None:
        """Have a file, and a folder of the program's own, that nobody else can look into: it says where a robot was and
        whose. SQLite's own files beside it get the mode of the file. Raises OSError."""
        self.path.parent.mkdir(mode=_OWN_FOLDER, parents=True, exist_ok=True)
        if self.path == _own_path():
            _restrict(self.path.parent, _OWN_FOLDER)
        try:
            os.close(os.open(self.path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, _OWN_FILE))
        except FileExistsError:
            open_regular(self.path).close()
            _restrict(self.path, _OWN_FILE)

    def _prepare(self, connection: sqlite3.Connection) -> None:
        """Make the tables of a new store; leave one of a later version of this program alone."""
        (version,) = connection.execute("pragma user_version").fetchone()
        if not 0 <= version <= _VERSION:
            raise self._unusable("a later version of this program wrote it")
        if version < _VERSION:
            connection.execute("begin immediate")
            (version,) = connection.execute("pragma user_version").fetchone()  # another process may have been quicker
            self._check_schema(connection, version)
            _bring_up_to_date(connection, version)
            connection.commit()
        self._check_schema(connection, _VERSION)

    def _check_schema(self, connection: sqlite3.Connection, version: int) -> None:
        """Refuse a file whose tables are not the program's own: a view or a trigger computes what its maker wants."""
        for kind, name, made in set(_schema_of(connection)) ^ _schema(version):
            which = f"a {kind} that this program did not make" if made else "a table of another shape"
            raise self._unusable(f"it is not this program's own ('{clean(str(name))}' is {which})")

    def _unusable(self, why: str) -> HistoryError:
        hint = f"Move the file away, or switch the history off with {SWITCH}=off."
        return HistoryError(f"The history cannot be used: {why}.", hint=hint, where=str(self.path))


def _own_path() -> Path:
    from platformdirs import user_data_path

    return user_data_path("care", appauthor=False) / "history.sqlite3"


def _restrict(path: Path, mode: int) -> None:
    """Take from others what they may do with a file or folder of ours; what is somebody else's stays as it is."""
    found = path.stat()
    if found.st_mode & 0o777 & ~mode and found.st_uid == os.geteuid():
        path.chmod(found.st_mode & mode)


def _bring_up_to_date(connection: sqlite3.Connection, version: int) -> None:
    for needed in _STEPS[version:]:
        for statement in filter(str.strip, needed.split(";")):
            connection.execute(statement)
    connection.execute(f"pragma user_version = {_VERSION}")


_SCHEMA = "select type, name, sql from sqlite_master where name not like 'sqlite\\_%' escape '\\'"


def _schema_of(connection: sqlite3.Connection) -> list[tuple[str, str, str]]:
    """Kind, name and definition of everything in a database but what SQLite makes by itself."""
    return [(str(kind), str(name), "".join(str(sql).split())) for kind, name, sql in connection.execute(_SCHEMA)]


@cache
def _schema(version: int) -> frozenset[tuple[str, str, str]]:
    """What `_schema_of` finds in a store of a version that this program made."""
    with closing(sqlite3.connect(":memory:")) as connection:
        for needed in _STEPS[:version]:
            connection.executescript(needed)
        return frozenset(_schema_of(connection))


def insert_triage(connection: sqlite3.Connection, document: Mapping[str, Any], mission: int, about: About) -> None:
    """Put a triage into the store, in the transaction of whoever has more to write with it."""
    log, profile = document["log"], document["profile"] or {"name": "", "version": ""}
    told = {name: value for name, value in plain(about).items() if name != "settings"}
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
