"""A diagnosis opens no socket and starts no program: an operator in the field has neither network nor patience."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from care_core.errors import ExitCode
from care_core.files import bundled

ROOT = Path(__file__).parents[2]
WATCHED = """
import os, sys
def watch(event, args):
    if event.split(".")[0] in ("socket", "urllib", "http") or event in ("subprocess.Popen", "os.system"):
        os.write(2, f"met {event} {args}".encode())
        os._exit(99)
sys.addaudithook(watch)
from care_tui.start import main
main()
"""


@pytest.mark.parametrize(
    ("command", "log"),
    [
        ("triage", bundled("samples", "arducopter_failed.BIN")),
        ("triage", ROOT / "tests" / "data" / "move_base_good.bag"),
        ("inspect", bundled("samples", "arducopter_failed.BIN")),
        ("params", ROOT / "tests" / "data" / "move_base_good.bag"),
    ],
)
def test_no_socket_and_no_other_program(command: str, log: Path) -> None:
    ran = subprocess.run([sys.executable, "-c", WATCHED, command, str(log)], cwd=ROOT, capture_output=True, check=False)
    assert ran.returncode in (ExitCode.OK, ExitCode.FAULT, ExitCode.NOT_EVALUATED), ran.stderr.decode()
    assert b"met " not in ran.stderr


def test_the_watch_sees_a_socket() -> None:
    code = WATCHED.replace("from care_tui.start import main\nmain()", "import socket; socket.socket()")
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, check=False).returncode == 99
