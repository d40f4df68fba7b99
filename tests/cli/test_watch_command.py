"""`care watch` as it is called: what it prints, how it ends, and the app on a log that is asked for."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from care_core.application import watching as core
from care_core.history.store import History
from care_tui.commands import watching
from tests.conftest import Care
from tests.unit.test_watching import entry_of, judge

ROOT = Path(__file__).parents[2]
SAMPLE = ROOT / "samples" / "arducopter_failed.BIN"


@pytest.fixture
def logs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("CARE_HISTORY", str(tmp_path / "history.sqlite3"))
    folder = tmp_path / "logs"
    folder.mkdir()
    return folder


def test_a_real_log_and_a_bad_one_are_judged_once_in_processes_of_their_own(logs: Path, care: Care) -> None:
    (logs / "1.BIN").write_bytes(b"this is no log")
    (logs / "2.BIN").write_bytes(SAMPLE.read_bytes())
    code, out, _ = care("watch", logs, "--once", "--quiet", "0", "--json", "--robot", "no 7")
    bad, good = (json.loads(line) for line in out.splitlines())
    assert code == 1
    assert (bad["verdict"], good["verdict"], good["robot"]["name"]) == ("unreadable", "fault", "no 7")
    assert good["explanation"]["name"] == "LAND_SPEED"
    (past,) = History(Path(os.environ["CARE_HISTORY"])).triages()
    assert past.robot is not None
    assert past.robot.id == "no 7"
    assert past.asked["legs"] == 5
    assert past.settings["LAND_SPEED"] == 16
    assert past.firmware.startswith("ArduCopter V4.5.4")
    code, out, err = care("watch", logs, "--once", "--quiet", "0")
    assert (code, out) == (0, "")
    assert "2 logs were done before" in err


def test_what_is_not_finished_is_said_at_the_end(logs: Path, care: Care, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(core, "triage_apart", judge)
    (logs / "a.bag.active").write_text("good", encoding="utf-8")
    code, out, err = care("watch", logs, "--once", "--quiet", "0")
    assert (code, out) == (3, "")
    assert "a.bag.active: not finished: its recorder has not closed it" in err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("none", "--once"), "no such folder"),
        ((str(SAMPLE),), "no such folder"),
        ((".", "--notify-command", "x {nme}"), "{name}"),
        ((".", "--profile", "arducoptr"), "arducopter"),
        ((".", "--threshold", "energy=x"), "no bound"),
    ],
)
def test_what_cannot_be_meant_is_refused_before_anything_is_waited_for(
    care: Care, words: tuple[str, ...], said: str
) -> None:
    outcome = care("watch", *words)
    assert outcome.code == 2
    assert said.strip("{}") in outcome.stderr


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_ends_it_cleanly(logs: Path, number: signal.Signals, code: int) -> None:
    command = [sys.executable, "-m", "care_tui", "watch", str(logs), "--quiet", "0.2"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment
    ) as process:
        assert process.stderr is not None
        assert "watching" in process.stderr.readline()
        time.sleep(0.5)
        process.send_signal(number)
        _, said = process.communicate(timeout=60)
    assert process.returncode == code
    assert "Traceback" not in said


def test_the_number_of_a_log_opens_the_app_on_it(monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[list[str]] = []

    class Opened:
        def __init__(self, command: list[str]) -> None:
            opened.append(command[command.index("-c") + 2 :])

        def wait(self, _limit_s: float | None = None) -> int:
            return 0

        def terminate(self) -> None:
            raise AssertionError("it ended by itself")

    monkeypatch.setattr(subprocess, "Popen", Opened)
    screen: Any = watching._Screen(False, False, ["--profile", "mine"])
    screen.show(entry_of("a.BIN", number=1))
    screen.show(entry_of("b.BIN", number=2))
    for typed in ("1\n", "\n", "9\n"):
        screen._asked(typed)
        screen.show(entry_of("later.BIN", number=3)) if typed == "\n" else None
        screen._await_app(0.0)
        screen.wait(0.01)
    assert opened == [["/logs/a.BIN", "--profile", "mine"], ["/logs/b.BIN", "--profile", "mine"]]


def test_lines_wait_while_the_app_is_open(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    screen: Any = watching._Screen(False, False, [])
    screen._app = type("App", (), {"wait": lambda self, limit_s=None: 0})()
    screen.show(entry_of("a.BIN"))
    assert capsys.readouterr().out == ""
    screen._await_app(1.0)
    assert "a.BIN" in capsys.readouterr().out


@pytest.mark.parametrize("words", [[], ["--once"]])
def test_a_folder_that_may_not_be_entered_is_said_to_be(
    care: Care, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: list[str]
) -> None:
    may = os.access
    monkeypatch.setattr(os, "access", lambda path, mode, **more: Path(path) != tmp_path and may(path, mode, **more))
    outcome = care("watch", tmp_path, *words, "--no-history")
    assert outcome.code == 2
    assert f"{tmp_path}: No permission to read the folder. Check its owner and mode." in outcome.stderr
