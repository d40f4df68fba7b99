"""A real cluster of processes: workers that die in the middle, logs that kill, hang or are none, and what listens."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from care_core.application.case import Request
from care_core.application.fleet import Cluster, triage_all
from care_core.errors import UsageError
from care_core.fleet import cluster
from care_core.fleet.cluster import TRIES, connected, each, patiently
from care_core.fleet.sources import Source, gather
from care_core.parallel import Failed
from tests.conftest import Care

pytestmark = pytest.mark.long

distributed = pytest.importorskip("distributed")

FLIGHT = Path(__file__).parents[1] / "data" / "arducopter_good.BIN"


@pytest.fixture(scope="module")
def client() -> Iterator[Any]:
    with connected(workers=2) as found:
        yield found


def work(item: tuple[str, Path]) -> str:
    """What an item asks for: an answer, a defect, or the death of its process, the first time or always."""
    what, marks = item
    tries = len(list(marks.glob(f"{what}.*")))
    (marks / f"{what}.{tries}.{os.getpid()}").touch()
    if what == "kills" or (what == "once" and tries == 0):
        os.kill(os.getpid(), signal.SIGKILL)
    if what == "hangs":
        time.sleep(1e6)
    if what == "defect":
        raise ValueError("a defect")
    return what


def test_workers_that_die_are_replaced_and_what_kills_them_is_told(client: Any, tmp_path: Path) -> None:
    wanted = ["a", "kills", "b", "once", "defect", "c", "d", "e"]
    answers = dict(each(client, work, [(what, tmp_path) for what in wanted], limit_s=1e6))
    assert [answers[place] for place in (0, 2, 3, 5, 6, 7)] == ["a", "b", "once", "c", "d", "e"]
    assert answers[1] == Failed("it ended the process that read it 3 times: too little memory, or a defect", True)
    assert answers[4] == Failed("unexpected ValueError: a defect", False)
    assert len(list(tmp_path.glob("kills.*"))) == 1 + TRIES
    assert len(list(tmp_path.glob("once.*"))) == 2


def test_an_item_that_hangs_is_given_up_and_the_others_go_on(client: Any, tmp_path: Path) -> None:
    # The item comes last, so that a busy machine gives up no other.
    assert dict(each(client, work, [("a", tmp_path), ("b", tmp_path)], limit_s=1e6)) == {0: "a", 1: "b"}
    hung = dict(each(client, work, [("hangs", tmp_path)], limit_s=0.5))
    assert hung == {0: Failed("reading it took longer than 0.5 s", False)}
    assert dict(each(client, work, [("c", tmp_path), ("d", tmp_path)], limit_s=1e6)) == {0: "c", 1: "d"}


def test_a_start_that_the_machine_was_too_busy_for_is_tried_again() -> None:
    tries: list[int] = []

    def start() -> str:
        tries.append(len(tries))
        assert len(tries) > TRIES
        return "started"

    assert patiently(start) == "started"


def test_no_more_items_are_handed_out_than_there_are_threads(client: Any, tmp_path: Path) -> None:
    answers = each(client, work, [(f"{n}", tmp_path) for n in range(20)], limit_s=1e6)
    waiting = []
    for _ in answers:
        waiting.append(sum(len(keys) for keys in client.processing().values()))
    assert len(waiting) == 20
    assert max(waiting) <= 2


def test_nothing_listens_beyond_this_machine_and_nobody_without_the_certificate_is_heard(client: Any) -> None:
    import psutil

    processes = [psutil.Process(), *psutil.Process().children(recursive=True)]
    listening = {c.laddr for p in processes for c in p.net_connections("inet") if c.status == psutil.CONN_LISTEN}
    assert listening
    assert {address.ip for address in listening} <= {"127.0.0.1", "::1"}
    address = client.scheduler.address
    assert address.startswith("tls://127.0.0.1:")
    with pytest.raises(UsageError, match="No scheduler answers"), connected(address):
        raise AssertionError("it was let in")


def test_logs_are_triaged_by_a_scheduler_that_is_named(tmp_path: Path) -> None:
    (tmp_path / "none.BIN").write_bytes(b"no log")
    fsspec = pytest.importorskip("fsspec")
    store = fsspec.filesystem("memory")
    store.pipe("/robots/r1/flight.BIN", FLIGHT.read_bytes())
    broken = [Source(str(path), path) for path in (tmp_path / "none.BIN", tmp_path / "gone.bag")]
    sources = [*gather(["memory://robots"]), *broken]
    said: list[str] = []
    here = {"host": "127.0.0.1", "protocol": "tcp", "dashboard_address": "127.0.0.1:0", "processes": False}
    with patiently(lambda: distributed.LocalCluster(n_workers=1, **here)) as running:
        named = Cluster(running.scheduler_address)
        rows = triage_all(sources, Request(Path()), named, lambda step, _share: said.append(step))
    assert [row.status for row in rows] == ["ok", "unreadable", "unreadable"]
    assert (rows[0].log, rows[0].folder) == ("memory://robots/r1/flight.BIN", "r1")
    store.rm("/robots", recursive=True)
    assert all(row.reason for row in rows[1:])
    assert said[-1].startswith("triaged 3 of 3 logs, 2 unreadable")


@pytest.mark.parametrize("name", ["distributed", "cryptography"])
def test_without_the_extra_it_is_said_how_to_have_it(care: Care, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    monkeypatch.setitem(sys.modules, name, None)
    outcome = care("fleet", FLIGHT)
    assert outcome.code == 2
    assert f"A fleet needs {name}" in outcome.stderr
    assert "pip install 'care-tui[fleet]'" in outcome.stderr


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["nothing.BIN"], "No such file"),
        ([FLIGHT, "--parquet", "rows.csv"], ".parquet"),
        ([FLIGHT, "--scheduler", "tcp://127.0.0.1:1"], "No scheduler answers there"),
        ([FLIGHT, "--scheduler", "nonsense"], "No scheduler answers there"),
        ([FLIGHT, "--memory", "much"], "--memory"),
        ([FLIGHT, "--profile", "nosuch"], "There is no profile"),
    ],
)
def test_what_cannot_be_is_said_before_any_work(
    care: Care, monkeypatch: pytest.MonkeyPatch, arguments: list[str | Path], says: str
) -> None:
    monkeypatch.setattr(cluster, "_CONNECT_S", 0.2)
    outcome = care("fleet", *arguments)
    assert outcome.code == 2
    assert says in outcome.stderr
    assert outcome.stdout == ""
