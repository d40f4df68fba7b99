"""Logs of a fleet: where they lie, how they come here, and what is refused."""

from __future__ import annotations

import pickle
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from care_core.errors import LogError, UsageError
from care_core.fleet import sources
from care_core.fleet.sources import fetched, gather, shown

fsspec = pytest.importorskip("fsspec")

FLIGHT = Path(__file__).parents[1] / "data" / "arducopter_good.BIN"


@pytest.fixture
def store() -> Iterator[Any]:
    memory = fsspec.filesystem("memory")
    yield memory
    memory.store.clear()
    memory.pseudo_dirs[:] = [""]


@pytest.fixture
def logs(tmp_path: Path) -> Path:
    for name in ("r1/a.BIN", "r1/b.BIN", "r2/deep/c.BIN"):
        path = tmp_path / "logs" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.symlink_to(FLIGHT)
    (tmp_path / "logs" / "notes.txt").write_text("no log")
    return tmp_path / "logs"


def test_files_folders_and_patterns_each_log_once(logs: Path) -> None:
    found = gather([str(logs / "r1" / "a.BIN"), str(logs), f"{logs}/**/*.BIN", f"{logs}/r?/*"])
    assert [source.path for source in found] == [logs / name for name in ("r1/a.BIN", "r1/b.BIN", "r2/deep/c.BIN")]
    assert [source.folder for source in found] == ["r1", "r1", "deep"]
    with fetched(found[0]) as path:
        assert path == logs / "r1" / "a.BIN"


def test_a_url_of_this_machine_is_read_where_it_lies(logs: Path) -> None:
    assert [source.path for source in gather([f"file://{logs}/r1"])] == [logs / "r1" / "a.BIN", logs / "r1" / "b.BIN"]
    assert len(gather([f"file://{logs}/*/*.BIN"])) == 2


def test_behind_a_url_folders_patterns_and_files_are_copied_and_the_copy_goes(store: Any) -> None:
    for name in ("/fleet/r1/a.BIN", "/fleet/r2/b.bag", "/fleet/r2/readme.md"):
        store.pipe(name, name.encode())
    for url in ("memory://fleet", "memory://fleet/*/*"):
        assert [source.name for source in gather([url])] == ["memory://fleet/r1/a.BIN", "memory://fleet/r2/b.bag"]
    (source,) = gather(["memory://fleet/r2/b.bag"])
    source = pickle.loads(pickle.dumps(source))
    assert source.folder == "r2"
    with fetched(source) as path:
        assert path.name == "b.bag"
        assert path.read_bytes() == b"/fleet/r2/b.bag"
    assert not path.parent.exists()


def test_a_split_recording_behind_a_url_is_one_log(store: Any) -> None:
    for name in ("metadata.yaml", "run_0.db3", "run_1.db3"):
        store.pipe(f"/bags/run/{name}", name.encode())
    store.pipe("/bags/alone.mcap", b"x")
    one, other = sorted(gather(["memory://bags"]), key=lambda source: -len(source.parts))
    assert (one.name, other.name) == ("memory://bags/run", "memory://bags/alone.mcap")
    with fetched(one) as path:
        assert sorted(file.name for file in path.iterdir()) == ["metadata.yaml", "run_0.db3", "run_1.db3"]


@pytest.mark.parametrize(("lies", "limit"), [(False, "COPIED_BYTES"), (True, "COPIED_BYTES"), (False, "LEFT_BYTES")])
def test_no_more_is_copied_than_is_allowed(store: Any, monkeypatch: pytest.MonkeyPatch, lies: bool, limit: str) -> None:
    store.pipe("/big.BIN", b"x" * 3_000_000)
    (source,) = gather(["memory://big.BIN"])
    monkeypatch.setattr(sources, limit, 1_000_000 if limit == "COPIED_BYTES" else 1 << 60)
    if lies:
        monkeypatch.setattr(type(store), "size", lambda _self, _path: 0)
    with pytest.raises(LogError, match="3 MB") as caught, fetched(source):
        raise AssertionError("it was copied")
    assert ("at most 1 MB" if limit == "COPIED_BYTES" else "0 MB of the temporary folder") in caught.value.message


def test_a_log_that_is_gone_says_so(store: Any) -> None:
    store.pipe("/a.BIN", b"x")
    (source,) = gather(["memory://a.BIN"])
    store.rm("/a.BIN")
    with pytest.raises(LogError, match="cannot be copied"), fetched(source):
        raise AssertionError("it was copied")


@pytest.mark.parametrize(
    ("place", "says"),
    [
        ("no/such/file.BIN", "No such file"),
        ("no/such/*.BIN", "No log is named like that"),
        ("memory://none.BIN", "No such file"),
        ("memory://none/*.BIN", "There is no log there"),
        ("nosuch://a/b.BIN", "cannot be listed"),
        ("file:///no/such/*.BIN", "No log is named like that"),
    ],
)
def test_a_place_without_logs_is_said(place: str, says: str, store: Any) -> None:
    assert store is not None
    with pytest.raises(UsageError, match=says):
        gather([place])


def test_a_url_is_told_without_its_secrets() -> None:
    assert shown("https://me:secret@robots.example/a.BIN?X-Amz-Signature=abc") == "https://robots.example/a.BIN"
