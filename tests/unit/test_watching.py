"""Watching folders: each log once, whatever is bad, comes back, grows, or is watched by two."""

from __future__ import annotations

import json
import os
import sqlite3
import sys
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from hashlib import sha256
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from care_core.application.notifying import Notifier, filled, parse_notifier
from care_core.application.watching import Task, Triage, Watcher, overall_code
from care_core.errors import UsageError
from care_core.history.store import About, History
from care_core.history.watched import MOST_ATTEMPTS, WatchBook
from care_core.parallel import Failed
from care_core.records import replace
from care_core.report.document import build_document
from care_core.report.watching import WatchEntry, entry_line, judged_entry, unread_entry
from care_core.report.writers import published
from care_core.run import Robot
from care_core.text import clean
from tests.made import HOSTILE, made_diagnosis

DOCUMENT = published(build_document(made_diagnosis()))
ROBOT = Robot("003F", f"Cube {HOSTILE}", "serial of the board", is_sure=True)


def judge(path: Path, _task: Task) -> Triage | Failed:
    """Stands for the engine: says the same of every log, and reads the content of bad ones as what goes wrong."""
    content = path.read_bytes()
    if content.startswith(b"bad"):
        return Failed("It is bad.", is_final=True)
    if content.startswith(b"kill"):
        return Failed("reading it ended the process", is_final=False)
    log = {**DOCUMENT["log"], "path": clean(str(path)), "sha256": sha256(content).hexdigest()}
    return {**DOCUMENT, "log": log}, 1, About(ROBOT)


class Bench:
    """A folder, a history, and a watcher whose clock stands still until it is moved."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder / "logs"
        self.folder.mkdir()
        self.history = History(folder / "history.sqlite3")
        self.now_s = 0.0
        self.told: list[str] = []
        self.watcher = self.started()

    def started(self, judging: Callable[[Path, Task], Triage | Failed] = judge) -> Watcher:
        """A watcher that was just started."""
        task = Task((self.folder,), quiet_s=5.0, abandoned_s=60.0)
        self.watcher = Watcher(task, self.history, self.told.append, lambda: self.now_s, judging)
        return self.watcher

    def put(self, name: str, content: str) -> Path:
        path = self.folder / name
        path.write_text(content, encoding="utf-8")
        return path

    def looks(self) -> list[WatchEntry]:
        """What two looks give, far enough apart for what does not change."""
        found = list(self.watcher.look())
        self.now_s += 6.0
        return [*found, *self.watcher.look()]


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path)


def test_each_log_is_judged_once_and_a_bad_one_stops_nothing(bench: Bench) -> None:
    for name, content in (("1.BIN", "bad"), ("2.BIN", "good"), ("3.BIN", "kill")):
        bench.put(name, content)
    found = bench.looks()
    assert [(Path(entry.log).name, entry.verdict) for entry in found] == [
        ("1.BIN", "unreadable"), ("2.BIN", "fault"), ("3.BIN", "unreadable"),
    ]  # fmt: skip
    assert found[0].says == "It is bad."
    assert bench.looks() == []
    assert [Path(one.log_path).name for one in bench.history.triages()] == ["2.BIN"]
    assert overall_code(found, 0) == 1
    assert overall_code(found[:1], 0) == 4
    assert overall_code([], 1) == 3


def test_a_new_start_knows_what_is_done_by_place_and_by_content(bench: Bench) -> None:
    bench.put("1.BIN", "good")
    bench.put("2.BIN", "bad")
    assert len(bench.looks()) == 2
    bench.started()
    assert bench.looks() == []
    assert bench.watcher.known == 2
    (bench.folder / "1.BIN").rename(bench.folder / "another name.BIN")
    bench.started()
    assert bench.looks() == []
    assert bench.watcher.known == 2


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere names are text")
def test_a_name_that_is_no_text_stops_nothing(bench: Bench) -> None:
    (bench.folder / os.fsdecode(b"\xff\xfe.BIN")).write_text("good")
    assert [entry.verdict for entry in bench.looks()] == ["fault"]
    bench.started()
    assert bench.looks() == []


def test_a_copy_that_comes_later_is_shown_and_not_judged_again(bench: Bench) -> None:
    bench.put("1.BIN", "good")
    bench.looks()
    bench.put("copy.BIN", "good")
    bench.watcher.triage = lambda _path, _task: pytest.fail("it was judged before")
    (entry,) = bench.looks()
    assert (Path(entry.log).name, entry.verdict, entry.is_new) == ("copy.BIN", "fault", False)
    assert "judged before" in entry_line(entry, "12:00", None)


def test_what_was_triaged_by_hand_is_not_triaged_again(bench: Bench) -> None:
    path = bench.put("1.BIN", "good")
    answer = judge(path, bench.watcher.task)
    assert not isinstance(answer, Failed)
    bench.history.add_triage(answer[0], 1)
    assert bench.looks() == []
    assert bench.watcher.known == 1


def test_a_log_that_goes_on_growing_is_judged_again(bench: Bench) -> None:
    bench.put("1.BIN", "good")
    assert len(bench.looks()) == 1
    bench.put("1.BIN", "good and longer")
    assert len(bench.looks()) == 1
    assert len(bench.history.triages()) == 2


def test_one_that_grows_while_it_is_read_is_waited_for(bench: Bench) -> None:
    def judge_and_grow(path: Path, task: Task) -> Triage | Failed:
        answer = judge(path, task)
        path.write_bytes(path.read_bytes() + b" more")
        return answer

    bench.put("1.BIN", "good")
    bench.started(judge_and_grow)
    assert bench.looks() == []
    assert bench.history.triages() == ()
    bench.watcher.triage = judge
    (entry,) = bench.looks()
    assert entry.verdict == "fault"


def test_a_stick_that_is_pulled_out_and_comes_back(bench: Bench) -> None:
    bench.put("1.BIN", "good")
    bench.put("2.BIN", "gone")
    away = bench.folder.with_name("away")

    def pull(path: Path, task: Task) -> Triage | Failed:
        if path.name == "2.BIN":
            bench.folder.rename(away)
            return Failed("Cannot read the file: Input/output error.", is_final=True)
        return judge(path, task)

    bench.started(pull)
    assert [Path(entry.log).name for entry in bench.looks()] == ["1.BIN"]
    assert bench.looks() == []
    assert bench.told == [f"{bench.folder} is not there: waiting for it"]
    away.rename(bench.folder)
    bench.watcher.triage = judge
    assert [Path(entry.log).name for entry in bench.looks()] == ["2.BIN"]
    assert bench.told[-1] == f"{bench.folder} is there again"


def test_what_nobody_closed_is_judged_after_long_and_said(bench: Bench) -> None:
    bench.put("drive.bag.active", "good")
    assert bench.looks() == []
    assert [sight.path.name for sight in bench.watcher.waiting] == ["drive.bag.active"]
    bench.now_s += 60.0
    (entry,) = bench.looks()
    assert entry.unfinished == "its recorder has not closed it (.active)"
    assert "unfinished" in entry_line(entry, "12:00", None)


def test_a_log_that_ends_the_program_is_not_tried_for_ever(bench: Bench) -> None:
    bench.put("1.BIN", "kill")
    seen = []
    for _ in range(MOST_ATTEMPTS + 2):
        bench.started()
        seen.append(len(bench.looks()))
    assert seen == [1] * MOST_ATTEMPTS + [0, 0]


def test_a_watcher_that_is_ended_gives_its_log_back(bench: Bench) -> None:
    def end(_path: Path, _task: Task) -> Triage | Failed:
        raise SystemExit(143)

    bench.put("1.BIN", "good")
    for _ in range(MOST_ATTEMPTS + 1):
        bench.started(end)
        with pytest.raises(SystemExit):
            bench.looks()
    bench.started()
    assert len(bench.looks()) == 1


def test_the_claim_of_a_process_that_is_gone_holds_nobody_up(bench: Bench) -> None:
    path = bench.put("1.BIN", "good")
    digest = sha256(b"good").hexdigest()
    ledger = WatchBook(bench.history)
    assert ledger.claim(digest, path, "s", 60.0) == "mine"
    with sqlite3.connect(bench.history.path) as connection:
        connection.execute("update watched set holder = 'elsewhere:1:1'")
    assert ledger.claim(digest, path, "s", 60.0) == "taken"
    assert bench.looks() == []
    assert bench.watcher.is_shared
    with sqlite3.connect(bench.history.path) as connection:
        connection.execute("update watched set until = 0")
    assert len(bench.looks()) == 1


def test_a_history_that_cannot_be_used_costs_a_sentence_and_no_log(bench: Bench, tmp_path: Path) -> None:
    bench.history = History(tmp_path / "file" / "history.sqlite3")
    (tmp_path / "file").write_text("no folder", encoding="utf-8")
    bench.put("1.BIN", "good")
    bench.started()
    assert [entry.verdict for entry in bench.looks()] == ["fault"]
    assert bench.looks() == []
    assert all("The history cannot be used" in text for text in bench.told)


def _watch(folder: Path, store: Path) -> list[tuple[str, bool]]:
    """Body of a watcher's process: what it said, until every log is done."""
    watcher = Watcher(Task((folder,), quiet_s=0.0), History(store), print, triage=judge)
    found = list(watcher.look())
    while watcher.waiting:
        time.sleep(0.05)
        found += watcher.look()
    return [(Path(entry.log).name, entry.is_new) for entry in found]


def test_two_watchers_on_one_history_lose_nothing_and_judge_each_log_once(tmp_path: Path) -> None:
    folder, store = tmp_path / "logs", tmp_path / "deep" / "history.sqlite3"
    folder.mkdir()
    names = {f"{number:08}.BIN" for number in range(16)}
    for name in names:
        (folder / name).write_text(f"good {name}", encoding="utf-8")
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        said = [one for answer in pool.map(_watch, [folder] * 2, [store] * 2) for one in answer]
    assert sorted(name for name, is_new in said if is_new) == sorted(names)
    assert sorted(Path(one.log_path).name for one in History(store).triages()) == sorted(names)


# What is said


def entry_of(name: str = "a.BIN", **changes: Any) -> WatchEntry:
    document = {**DOCUMENT, "log": {**DOCUMENT["log"], "path": f"/logs/{name}"}}
    return replace(judged_entry(1, "2024-01-01T00:00:00+00:00", document, ROBOT), **changes)


@pytest.mark.parametrize(
    "name", ["a.BIN", f"{HOSTILE}.BIN", "日本語のとても長い名前のログファイル.BIN", "x" * 200 + ".BIN"]
)
@pytest.mark.parametrize("width", [59, 79, 119])
def test_a_line_fits_and_nothing_in_it_steers_the_terminal(name: str, width: int) -> None:
    import unicodedata

    line = entry_line(entry_of(name), "12:00", width)
    assert line.isprintable()
    assert sum(2 if unicodedata.east_asian_width(one) in "WF" else 1 for one in line) <= width
    assert "FAULT" in line
    assert line.endswith(".BIN")
    assert "70% land_speed" in entry_line(entry_of(), "12:00", 119)
    assert entry_line(entry_of("x" * 200), "12:00", width, ascii=True).isascii()


def test_a_line_of_json_fits_its_schema() -> None:
    for entry in (entry_of(), unread_entry(2, "t", Path("/a\x1b"), HOSTILE, sha256=None, unfinished="")):
        text = entry.to_json(indent=None)
        assert text.count("\n") == 1
        jsonschema.validate(json.loads(text), WatchEntry.json_schema())
        assert "\\u001b" not in text


# Telling others


def test_a_log_adds_no_word_option_or_command() -> None:
    words = parse_notifier("send --to 'a b' {verdict} {says} 'robot {robot}' {name}").words
    entry = entry_of("-rf $(reboot) `x`; y.BIN", says="--delete; rm -rf ~", robot=None)
    made = filled(words, entry)
    assert made[:4] == ["send", "--to", "a b", "fault"]
    assert made[4] == " --delete; rm -rf ~"
    assert made[5] == "robot -"
    assert made[6] == " -rf $(reboot) `x`; y.BIN"
    assert len(made) == len(words)


@pytest.mark.parametrize("command", ["", "send 'open", "send {verdikt}", "{says}"])
def test_a_command_that_cannot_be_meant_is_refused(command: str) -> None:
    with pytest.raises(UsageError):
        parse_notifier(command)


def test_the_command_gets_its_words_and_the_entry(tmp_path: Path) -> None:
    out = tmp_path / "out"
    script = f"import sys, pathlib; pathlib.Path({str(out)!r}).write_text(sys.argv[1] + sys.stdin.read())"
    assert Notifier((sys.executable, "-c", script, "{verdict} {name}")).tell(entry_of()) == ""
    said, _, line = out.read_text().partition("{")
    assert said == "fault a.BIN"
    assert json.loads("{" + line)["verdict"] == "fault"


def test_a_command_that_fails_hangs_or_is_not_there_costs_a_sentence() -> None:
    hang = "import time; time.sleep(60)"
    for notifier, said in (
        (Notifier(("/no/such/command",)), "cannot be started"),
        (Notifier((sys.executable, "-c", "raise SystemExit('no net')")), "ended with 1: no net"),
        (Notifier((sys.executable, "-c", hang), limit_s=0.2), "took longer than 0.2 s"),
    ):
        assert said in notifier.tell(entry_of())


def test_what_was_judged_by_other_limits_is_judged_again(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    """Bounds, the profile and the site file count; a watcher that judges alike does nothing twice."""

    def seen(**asked: Any) -> int:
        bench.watcher = Watcher(
            Task((bench.folder,), quiet_s=5.0, **asked), bench.history, bench.told.append, lambda: bench.now_s, judge
        )
        return len(bench.looks())

    bench.put("1.BIN", "good")
    site = bench.folder.parent / "site.yaml"
    site.write_text("{}")
    ways: tuple[dict[str, Any], ...] = (
        {"thresholds": {"energy": 5.0}}, {"thresholds": {"energy": 9.0}}, {}, {"profile": "mine"}, {"site": site},
    )  # fmt: skip
    assert [seen(**way) for way in ways] == [1] * 5
    assert [seen(**way) for way in ways] == [0] * 5
    site.write_text("{} # another")
    assert seen(site=site) == 1
    bench.put("again.BIN", "good")
    assert [seen(**way) for way in ways] == [0] * 5
