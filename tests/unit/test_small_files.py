"""Files that are read: regular ones of a bounded size and nothing else, by one way in."""

from __future__ import annotations

import ast
import os
import socket
import tracemalloc
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from care_core import limits
from care_core.application.baselining import site_text
from care_core.application.configuring import side_of
from care_core.collect.campaign import read_campaign
from care_core.collect.journal import Journal
from care_core.configs.loading import read_config
from care_core.errors import CareError
from care_core.files import open_regular, open_to_append, read_small_bytes, read_small_text
from care_core.learn.table import read_table
from care_core.logs.digest import log_digest
from care_core.logs.opening import open_log
from care_core.logs.recording import recording_at
from care_core.profile.reading import read_schema
from care_core.profile.site import load_site
from care_core.report.reading import read_report
from care_core.tables.readiness import read_columns
from care_tui.settings import load_settings
from tests.planted import SCHEMA

ROOT = Path(__file__).parents[2]
HUGE = 1 << 40


def pipe(path: Path) -> None:
    os.mkfifo(path)


def listening(path: Path) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(path.parent)  # the name of a socket may have 107 characters
        socket.socket(socket.AF_UNIX).bind(path.name)


def sparse(path: Path) -> None:
    with path.open("wb") as stream:
        stream.truncate(HUGE)


STRANGE: dict[str, Callable[[Path], object]] = {
    "endless device": lambda path: path.symlink_to("/dev/zero"),
    "pipe": pipe,
    "socket": listening,
    "folder": Path.mkdir,
    "sparse file": sparse,
    "link to itself": lambda path: path.symlink_to(path.name),
    "link to nowhere": lambda path: path.symlink_to("nowhere"),
}
READERS: dict[str, Callable[[Path], object]] = {
    "configuration": read_config,
    "side of a diff": lambda path: side_of(str(path)),
    "site": load_site,
    "campaign": read_campaign,
    "report": read_report,
    "profile": read_schema,
    "settings": load_settings,
    "table": lambda path: read_columns(path, SCHEMA),
    "table of parquet": lambda path: read_columns(path.rename(path.with_suffix(".parquet")), SCHEMA),
    "table to learn from": lambda path: read_table(path.rename(path.with_suffix(".csv")), SCHEMA),
}


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize("kind", STRANGE)
def test_what_is_no_small_file_is_refused_in_a_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str, reader: str
) -> None:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "file.yaml"
    STRANGE[kind](path)
    tracemalloc.start()
    try:
        with pytest.raises(CareError) as refused:
            READERS[reader](path)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert "None" not in str(refused.value)
    assert "\n" not in str(refused.value)
    assert peak < 50_000_000


@pytest.mark.parametrize("kind", STRANGE)
def test_a_log_that_is_no_file_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str) -> None:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "flight.BIN"
    STRANGE[kind](path)
    with pytest.raises(CareError):
        open_log(path)
    if kind not in ("folder", "sparse file"):
        with pytest.raises(CareError):
            log_digest(path)


@pytest.mark.parametrize("kind", STRANGE)
def test_strange_metadata_of_a_recording_is_none(tmp_path: Path, kind: str) -> None:
    (tmp_path / "a.mcap").write_bytes(b"\x89MCAP0\r\n")
    STRANGE[kind](tmp_path / "metadata.yaml")
    assert [file.name for file in recording_at(tmp_path).files] == ["a.mcap"]


@pytest.mark.parametrize("kind", STRANGE)
def test_a_strange_site_or_journal_is_not_written_over(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "journal.jsonl"
    STRANGE[kind](path)
    before = os.lstat(path)
    with pytest.raises(CareError):
        Journal.open(tmp_path, "digest")
    assert os.lstat(path).st_size == before.st_size
    assert [one.name for one in tmp_path.iterdir() if one.name != "home"] == ["journal.jsonl"]


def test_the_limit_counts_what_is_read_where_a_file_says_no_size(tmp_path: Path) -> None:
    path = tmp_path / "a.yaml"
    path.write_bytes(b"a" * 100)
    assert read_small_bytes(path, 100) == b"a" * 100
    with pytest.raises(OSError, match="larger than"):
        read_small_bytes(path, 99)
    assert read_small_text(Path("/proc/self/status")).startswith("Name:")
    with pytest.raises(OSError, match="larger than"):
        read_small_bytes(Path("/proc/self/status"), 10)
    assert limits.SMALL_FILE_BYTES == 16_000_000


def test_the_ends_of_lines_are_one_unless_they_are_asked_for(tmp_path: Path) -> None:
    path = tmp_path / "a.param"
    path.write_bytes(b"A,1\r\nB,2\rC,3\n")
    assert read_small_text(path) == "A,1\nB,2\nC,3\n"
    assert read_small_text(path, as_it_is=True) == "A,1\r\nB,2\rC,3\n"


def test_a_name_that_no_file_can_have_is_an_error_of_reading() -> None:
    for opened in (open_regular, read_small_bytes, read_small_text):
        with pytest.raises(OSError, match="character"):
            opened(Path("a\0b"))


def test_what_is_appended_to_is_no_link(tmp_path: Path) -> None:
    (tmp_path / "bashrc").write_text("mine\n")
    (tmp_path / "journal").symlink_to("bashrc")
    with pytest.raises(OSError, match="link"):
        open_to_append(tmp_path / "journal")
    assert (tmp_path / "bashrc").read_text() == "mine\n"


def test_a_site_that_is_none_keeps_its_file(tmp_path: Path) -> None:
    path = tmp_path / "site.yaml"
    path.write_text("# my robot\nmax_vel_x: 0.5\n")
    with pytest.raises(CareError, match="no site file"):
        site_text(None, path)  # type: ignore[arg-type]


READING = {"read_text", "read_bytes", "open", "fdopen", "read_csv", "read_parquet", "read_table", "fromfile", "loadtxt"}
"""Calls that open a file to read it."""
OWN_WAYS = {
    "care_core/files.py": "the way in itself",
    "care_core/collect/guard.py": "a program of its own, which imports nothing of this one",
}
PASSED_A_STREAM, TABLES = {"read_csv", "read_parquet", "read_table"}, {"pd", "parquet"}
OURS = {"FileArray", "Journal", "chunk", "store", "page", "source"}
"""What has a method `open` that opens no file by a name."""


def other_ways_in(path: Path) -> Iterator[str]:
    text = path.read_text(encoding="utf-8")
    for node in ast.walk(ast.parse(text)) if any(name in text for name in READING) else ():
        if not isinstance(node, ast.Call):
            continue
        name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        if name not in READING or (isinstance(node.func, ast.Name) and name != "open"):
            continue
        owner = node.func.value if isinstance(node.func, ast.Attribute) else None
        said = owner.attr if isinstance(owner, ast.Attribute) else getattr(owner, "id", "")
        modes = [arg.value for arg in (*node.args, *(k.value for k in node.keywords)) if isinstance(arg, ast.Constant)]
        is_written = name in ("open", "fdopen") and bool({"w", "wb", "x", "xb"} & set(map(str, modes)))
        is_system = said == "os" and name == "open" and "O_RDONLY" not in ast.unparse(node)
        is_stream = name in PASSED_A_STREAM and (said not in TABLES or ast.unparse(node.args[0]) == "stream")
        if not (is_written or is_system or is_stream or said in OURS or (name == "open" and _opens_no_file(node))):
            yield f"{path.relative_to(ROOT)}:{node.lineno}: {ast.unparse(node)[:80]}"


def _opens_no_file(node: ast.Call) -> bool:
    """Pages and bars of the app open with an index or nothing."""
    return isinstance(node.func, ast.Attribute) and not any(
        isinstance(arg, ast.Constant) and isinstance(arg.value, str) for arg in node.args
    )


def test_every_file_is_read_by_the_one_way_in() -> None:
    found = [
        way
        for package in ("care_core", "care_tui")
        for path in sorted((ROOT / package).rglob("*.py"))
        if str(path.relative_to(ROOT)) not in OWN_WAYS
        for way in other_ways_in(path)
    ]
    assert found == []
