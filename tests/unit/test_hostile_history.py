"""A history that somebody else made or changed: refused with a sentence, left as it is, and nobody else's to read."""

from __future__ import annotations

import json
import os
import sqlite3
import zlib
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest

from care_core.application.viewing import past_runs
from care_core.history.store import History, HistoryError, history_path
from care_core.report.document import build_document
from care_core.report.history import history_document
from care_core.report.writers import published
from tests.conftest import Care
from tests.made import made_diagnosis

DOCUMENT = published(build_document(made_diagnosis()))
MANY_DIGITS = "9" * 400


@pytest.fixture
def history(tmp_path: Path) -> History:
    made = History(tmp_path / "history.sqlite3")
    made.add_triage(DOCUMENT, 1)
    return made


HOSTILE = {
    "a view": "create view fine as select * from triages",
    "a view in a table's place": "alter table triages rename to t; create view triages as select * from t",
    "a trigger": "create trigger t after insert on triages begin delete from verifications; end",
    "an endless trigger": (
        "create trigger t before insert on triages begin select count(*) from triages a, triages b, triages c; end"
    ),
    "a virtual table": "create virtual table v using fts5(a)",
    "a column that is computed": "alter table triages add column bomb as (zeroblob(1000000000))",
    "an index that computes": "create index i on triages (length(document))",
    "another table": "create table mine (a)",
    "a table less": "drop table watched",
    "a version before the first": "pragma user_version = -1",
    "a version to come": "pragma user_version = 99",
}


@pytest.mark.parametrize("kind", HOSTILE)
def test_a_history_of_another_shape_is_refused_and_kept(history: History, kind: str) -> None:
    with closing(sqlite3.connect(history.path)) as database:
        try:
            database.executescript(HOSTILE[kind])
        except sqlite3.OperationalError as err:
            pytest.skip(f"not with this SQLite: {err}")
    content = history.path.read_bytes()
    for use in (history.triages, history.verifications, lambda: history.add_triage(DOCUMENT, 2)):
        with pytest.raises(HistoryError, match="Move the file away"):
            use()
    assert history.path.read_bytes() == content


def test_a_database_of_another_program_is_no_history(tmp_path: Path) -> None:
    path = tmp_path / "robot.db"
    with closing(sqlite3.connect(path)) as database:
        database.executescript("create table missions (a); insert into missions values (1)")
    content = path.read_bytes()
    with pytest.raises(HistoryError, match="not this program's own"):
        History(path).add_triage(DOCUMENT, 1)
    assert path.read_bytes() == content


def changed(**parts: object) -> str:
    return json.dumps({**DOCUMENT, **parts})


RECORDS: dict[str, tuple[str, object]] = {
    "no JSON": ("document", "{"),
    "a list": ("document", "[]"),
    "deep": ("document", "[" * 100_000),
    "bytes": ("document", b"\xff\xfe"),
    "no text": ("document", 17.5),
    "objectives that are a number": ("document", changed(objectives=5)),
    "an objective without a name": ("document", changed(objectives=[{}])),
    "a log that is a text": ("document", changed(log="a.BIN")),
    "a profile that is a list": ("document", changed(profile=[1])),
    "an integer of 400 digits": ("document", changed(config={"A": 1}).replace('{"A": 1}', f'{{"A": {MANY_DIGITS}}}')),
    "an integer of 5000 digits": ("document", changed(config={"A": 1}).replace('{"A": 1}', f'{{"A": {"9" * 5000}}}')),
    "faults of another shape": ("document", changed(faults=[{"objective": 1}])),
    "a time that is a number": ("at", b"\0"),
    "a mission that is a text": ("mission", "first"),
    "a robot of another shape": ("about", '{"robot": {"id": 5}}'),
    "questions that are texts": ("about", '{"asked": {"distance": "far"}}'),
    "settings that are no archive": ("settings", b"x"),
    "settings that are a text": ("settings", "x"),
    "settings that unpack to a gigabyte": ("settings", zlib.compress(b" " * 100_000_000)),
    "settings that are lists": ("settings", zlib.compress(b'{"A": [1]}')),
}


@pytest.mark.parametrize("kind", RECORDS)
def test_a_damaged_record_is_refused_with_a_sentence(
    history: History, monkeypatch: pytest.MonkeyPatch, care: Care, kind: str
) -> None:
    column, value = RECORDS[kind]
    with closing(sqlite3.connect(history.path)) as database:
        database.execute(f"update triages set {column} = ?", (value,))
        database.commit()
    with pytest.raises(HistoryError, match="The history cannot be used"):
        history_document(history.triages(), ())
    monkeypatch.setenv("CARE_HISTORY", str(history.path))
    with pytest.raises(HistoryError):
        past_runs()
    for command in (("history",), ("history", "--json"), ("history", "--export", str(history.path.parent / "a.csv"))):
        code, out, err = care(*command)
        assert (code, out) == (2, "")
        assert "The history cannot be used" in err
        assert err.count("\n") == 1


STRANGE: dict[str, Callable[[Path], object]] = {
    "a folder": Path.mkdir,
    "a pipe": os.mkfifo,
    "a device": lambda path: path.symlink_to("/dev/zero"),
    "a text": lambda path: path.write_text("my notes\n" * 1000),
}


@pytest.mark.parametrize("kind", STRANGE)
def test_what_is_no_database_is_no_history(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "history"
    STRANGE[kind](path)
    for use in (History(path).triages, lambda: History(path).add_triage(DOCUMENT, 1)):
        with pytest.raises(HistoryError, match="The history cannot be used"):
            use()


def test_the_history_is_its_owners_alone(tmp_path: Path) -> None:
    path = history_path()
    assert path is not None
    umask = os.umask(0)
    try:
        History(path).add_triage(DOCUMENT, 1)
        assert (path.stat().st_mode & 0o777, path.parent.stat().st_mode & 0o777) == (0o600, 0o700)
        path.chmod(0o644)  # as an earlier version made them
        path.parent.chmod(0o755)
        assert len(History(path).triages()) == 1
        assert (path.stat().st_mode & 0o777, path.parent.stat().st_mode & 0o777) == (0o600, 0o700)
        shared = tmp_path / "shared"
        shared.mkdir(mode=0o755)
        History(shared / "h.sqlite3").add_triage(DOCUMENT, 1)
        assert ((shared / "h.sqlite3").stat().st_mode & 0o777, shared.stat().st_mode & 0o777) == (0o600, 0o755)
    finally:
        os.umask(umask)


def test_a_record_of_an_earlier_version_tells_less_and_is_read(history: History) -> None:
    (before,) = history.triages()
    with closing(sqlite3.connect(history.path)) as database, database:
        database.execute("update triages set about = '{}'")
    assert history.triages() == (before,)
    assert history.triage_of(DOCUMENT["log"]["sha256"]) is not None
