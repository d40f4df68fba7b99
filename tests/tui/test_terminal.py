"""The program in a real terminal: from start to the exported report, and the terminal as it was afterwards."""

from __future__ import annotations

import os
import signal
import sys
import termios
import time
from pathlib import Path
from typing import Any

import pytest

from care_core.files import bundled

pexpect = pytest.importorskip("pexpect", reason="needs a terminal to drive")
pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs a POSIX terminal")

CODE = "from care_tui.cli import main; main()"
CRASH = """
from care_tui.screens.case import CaseScreen
async def crash(self, *_): raise RuntimeError("made to fail")
CaseScreen._go = crash
from care_tui.cli import main
main()
"""
ALT_SCREEN_OFF, CURSOR_ON, MOUSE_ON, MOUSE_OFF = b"\x1b[?1049l", b"\x1b[?25h", b"\x1b[?1000h", b"\x1b[?1000l"


class Terminal:
    """A child in a pseudo-terminal of 80 x 24, with its own home."""

    def __init__(self, folder: Path, *arguments: str, code: str = CODE, **variables: str) -> None:
        root = str(Path(__file__).parents[2])
        env = {**os.environ, "TERM": "xterm-256color", "HOME": str(folder), "PYTHONPATH": root}
        env |= {"XDG_CONFIG_HOME": str(folder), "XDG_STATE_HOME": str(folder)}
        for name in ("NO_COLOR", "TMUX", "SSH_CONNECTION"):
            env.pop(name, None)
        env |= variables
        self.seen = b""
        self.child = pexpect.spawn(
            sys.executable, ["-c", code, *arguments], cwd=str(folder), env=env, dimensions=(24, 80), timeout=60
        )
        self.before = termios.tcgetattr(self.child.child_fd)

    def expect(self, text: str) -> None:
        self.child.expect_exact(text.encode())
        self.seen += self.child.before + self.child.after

    def press(self, keys: str, until: str) -> None:
        self.child.send(keys)
        self.expect(until)

    def end(self) -> int:
        """Wait for the end; answers the exit code and checks that the terminal is as it was."""
        attributes: Any = None
        try:
            deadline = time.monotonic() + 20
            while self.child.isalive() and time.monotonic() < deadline:
                try:
                    self.seen += self.child.read_nonblocking(65536, timeout=0.2)
                    attributes = termios.tcgetattr(self.child.child_fd)
                except pexpect.TIMEOUT:
                    continue
            self.seen += self.child.read()
        except (pexpect.EOF, OSError, termios.error):
            pass
        self.child.close()
        tail = self.seen[self.seen.rfind(b"\x1b[?1049h") :]
        assert ALT_SCREEN_OFF in tail, "back on the normal screen"
        assert tail.rfind(CURSOR_ON) > tail.rfind(b"\x1b[?25l"), "the cursor is shown"
        assert (MOUSE_ON in tail) == (MOUSE_OFF in tail), "the mouse is the terminal's again"
        if attributes is not None:
            echo = termios.ECHO | termios.ICANON | termios.ISIG
            assert attributes[3] & echo == self.before[3] & echo, "keys are echoed and lines edited again"
        code: int = self.child.exitstatus
        return code


@pytest.fixture
def sample() -> str:
    path = bundled("samples", "arducopter_failed.BIN")
    return str(path)


QUICK = bundled("samples", "owlat_failed.bag")
"""Triaged in a fifth of the time, where it does not matter what is shown."""


def test_from_start_to_the_exported_report(tmp_path: Path, sample: str) -> None:
    terminal = Terminal(tmp_path, sample)
    terminal.expect("Objectives")
    terminal.expect("mission_time")  # diagnosed, at the first fault
    terminal.press("\r", "LAND_SPEED")  # its causes
    terminal.press("\r", "What to change")  # the fix
    terminal.press("\r", "+++ suggested")  # the diff
    terminal.press("\r", "care.triage/1")  # the report
    terminal.press("\r", "Write the report to")
    terminal.press("\r", "written to")
    terminal.child.send("q")
    assert terminal.end() == 1, "a fault was found"
    report = (tmp_path / "arducopter_failed.care.yaml").read_text()
    assert "option: LAND_SPEED" in report
    assert "apply:" in report


@pytest.mark.parametrize("arguments", [(), ("--ascii", "--no-mouse"), ("--color", "16"), ("--color", "none")])
def test_q_gives_the_terminal_back(tmp_path: Path, arguments: tuple[str, ...]) -> None:
    terminal = Terminal(tmp_path, *arguments, str(QUICK))
    terminal.expect("Objectives")
    terminal.child.send("q")
    assert terminal.end() in (1, 130)


def test_ctrl_c_gives_the_terminal_back(tmp_path: Path, sample: str) -> None:
    terminal = Terminal(tmp_path, sample)
    terminal.expect("Objectives")
    terminal.child.send("\x03")
    assert terminal.end() == 130


def test_ctrl_z_gives_the_terminal_to_the_shell_and_fg_brings_the_app_back(tmp_path: Path, sample: str) -> None:
    terminal = Terminal(tmp_path, sample)
    terminal.expect("mission_time")
    terminal.press("\x1a", ALT_SCREEN_OFF.decode())
    stat = Path(f"/proc/{terminal.child.pid}/stat")
    deadline = time.monotonic() + 10
    while stat.read_text().rsplit(")", 1)[1].split()[0] != "T" and time.monotonic() < deadline:
        time.sleep(0.05)
    assert stat.read_text().rsplit(")", 1)[1].split()[0] == "T", "stopped"
    terminal.child.kill(signal.SIGCONT)
    terminal.expect("\x1b[?1049h")
    terminal.expect("mission_time")  # drawn again, all of it
    terminal.press("\r", "LAND_SPEED")
    terminal.child.send("q")
    assert terminal.end() == 1


@pytest.mark.parametrize("variables", [{"PYTHONIOENCODING": "latin-1"}, {"TERM": "linux"}])
def test_a_terminal_without_the_signs_gets_ascii_and_no_escapes_in_their_place(
    tmp_path: Path, variables: dict[str, str]
) -> None:
    named = tmp_path / "f\N{LATIN SMALL LETTER U WITH DIAERESIS}r \N{CJK UNIFIED IDEOGRAPH-4E2D}.BIN"
    named.write_bytes(QUICK.read_bytes())
    terminal = Terminal(tmp_path, str(named), **variables)
    terminal.expect("x FAULT")
    terminal.press("1", "What happened")
    terminal.child.send("q")
    assert terminal.end() == 1
    assert b"\\u" not in terminal.seen
    assert "\N{BLACK RIGHT-POINTING SMALL TRIANGLE}".encode() not in terminal.seen


@pytest.mark.parametrize("number", [signal.SIGHUP, signal.SIGTERM])
def test_a_lost_connection_gives_the_terminal_back(tmp_path: Path, sample: str, number: signal.Signals) -> None:
    terminal = Terminal(tmp_path, sample)
    terminal.expect("Objectives")
    terminal.child.kill(number)
    assert terminal.end() == 130


def test_nothing_outlives_its_terminal(tmp_path: Path, sample: str) -> None:
    terminal = Terminal(tmp_path, sample)
    terminal.expect("Objectives")
    child = terminal.child.pid
    os.close(terminal.child.child_fd)  # as when a connection is lost or tmux is killed: SIGHUP, and then SIGCONT
    deadline = time.monotonic() + 20
    ended, status = os.waitpid(child, os.WNOHANG)
    while not ended and time.monotonic() < deadline:
        time.sleep(0.05)
        ended, status = os.waitpid(child, os.WNOHANG)
    if not ended:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
    assert ended, "it went on without a terminal"
    assert os.waitstatus_to_exitcode(status) == 130


def test_a_crash_gives_the_terminal_back_and_says_so(tmp_path: Path, sample: str) -> None:
    terminal = Terminal(tmp_path, sample, code=CRASH)
    terminal.expect("Objectives")
    terminal.expect("made to fail")  # turning to the objectives fails, once the log is read
    terminal.expect("please report it")
    assert terminal.end() == 2
    assert len(terminal.seen) < 100_000, "the values of variables would take a slow link minutes"
