"""What the command writes over, leaves behind, and does when it is ended: nothing of the operator's is lost."""

from __future__ import annotations

import os
import signal
import stat
import subprocess
import sys
import time
from pathlib import Path

import pytest
import zstandard

from care_core.errors import ExitCode
from care_core.files import bundled, write_atomically
from care_tui.start import main
from tests.conftest import Care

SAMPLE = bundled("samples", "arducopter_failed.BIN")
DATA = Path(__file__).parents[1] / "data"
GOOD = DATA / "move_base_good.bag"


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("flight.BIN", b"\0\xff" * 40 + SAMPLE.read_bytes()[80:200_000]),
        ("flight.json", b"\0\xff" * 40 + SAMPLE.read_bytes()[80:200_000]),
        ("flight.log", b"x, broken\nMSG, 100, ArduCopter\n" * 50),
        ("notes.json", b'{"my": "notes"}\n'),
        ("notes.md", b"Buy batteries.\n"),
        ("notes.txt", b"Buy batteries.\n"),
        ("thesis.json", "über\n".encode("latin-1")),
    ],
)
def test_a_file_of_another_kind_is_kept(care: Care, tmp_path: Path, name: str, content: bytes) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    flags = {".md": ("--markdown",), ".txt": ()}.get(path.suffix, ("--json",))
    command = ("triage", GOOD, "--no-history", *flags, "--out", path)
    code, _, err = care(*command)
    assert code == ExitCode.USAGE
    assert "--force" in err or "never overwritten" in err
    assert path.read_bytes() == content
    assert care(*command, "--force").code in (ExitCode.OK, ExitCode.USAGE)


@pytest.mark.parametrize("flags", [["--json"], ["--yaml"], ["--markdown"], []], ids=str)
def test_a_report_replaces_its_like(care: Care, tmp_path: Path, flags: list[str]) -> None:
    path = tmp_path / "report"
    path.write_bytes(b"")
    for _ in range(2):
        assert care("triage", GOOD, "--no-history", *flags, "--out", path).code == ExitCode.OK
    assert path.stat().st_size


def test_a_sound_log_is_kept_whatever_is_asked(care: Care, tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_bytes(SAMPLE.read_bytes())
    assert "never overwritten" in care("triage", GOOD, "--json", "--out", path, "--force").stderr
    assert path.read_bytes() == SAMPLE.read_bytes()


def test_the_backup_is_as_private_as_the_file(care: Care, tmp_path: Path) -> None:
    config, report = tmp_path / "vehicle.param", tmp_path / "report.yaml"
    assert care("params", SAMPLE, "--out", config).code == ExitCode.OK
    assert care("triage", SAMPLE, "--no-history", "--yaml", "--out", report).code == ExitCode.FAULT
    config.chmod(0o600)
    before = config.read_bytes()
    assert "no file was changed: -o NEW writes a new one" in care("apply", report, config).stderr
    assert config.read_bytes() == before
    assert care("apply", report, config, "--in-place").code == ExitCode.OK
    assert care("apply", report, config, "-o", tmp_path / "new.param").code == ExitCode.OK
    for name in ("vehicle.param", "vehicle.param.bak", "new.param"):
        assert (tmp_path / name).stat().st_mode & 0o777 == 0o600, name


def test_a_file_is_on_the_disk_before_it_gets_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Else a power cut leaves the name with nothing behind it."""
    done: list[str] = []
    sync, rename = os.fsync, Path.replace

    def synced(handle: int) -> None:
        done.append("file" if stat.S_ISREG(os.fstat(handle).st_mode) else "folder")
        sync(handle)

    def renamed(path: Path, target: Path) -> Path:
        done.append("name")
        return rename(path, target)

    monkeypatch.setattr(os, "fsync", synced)
    monkeypatch.setattr(Path, "replace", renamed)
    write_atomically(tmp_path / "report.md", "whole\n")
    assert done == ["file", "name", "folder"]


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_polite_kill_or_a_lost_connection_leaves_no_temporary_files(tmp_path: Path, number: signal.Signals) -> None:
    log = tmp_path / "a.mcap.zstd"
    with log.open("wb") as stream, zstandard.ZstdCompressor().stream_writer(stream) as packer:
        packer.write(b"\x89MCAP0\r\n")
        for _ in range(4000):
            packer.write(bytes(range(256)) * 200)
    temporary = tmp_path / "tmp"
    temporary.mkdir()
    environment = {"PATH": "/usr/bin:/bin", "TMPDIR": str(temporary), "HOME": str(tmp_path)}
    command = [sys.executable, "-m", "care_tui", "inspect", str(log)]
    folder = Path(__file__).parents[2]
    before = signal.signal(number, signal.SIG_DFL)  # what nohup starts ignores a lost connection, as do its children
    process = subprocess.Popen(command, env=environment, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    signal.signal(number, before)
    deadline = time.monotonic() + 20
    # A folder alone may not be the program's to remove yet.
    while not list(temporary.glob("*/*")) and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.001)
    assert process.poll() is None, "the log was read before it could be ended"
    process.send_signal(number)
    _, err = process.communicate(timeout=20)
    assert process.returncode == 128 + number
    assert b"Traceback" not in err
    assert not list(temporary.iterdir())


# What ends an interpreter before the first line of this program is not its own: until then the system's way does.
INTERRUPTIBLE = """
import signal, sys
signal.signal(signal.SIGINT, signal.SIG_DFL)
print("begins", flush=True)
from care_tui.start import main
sys.argv[0] = "care"
main()
"""


@pytest.mark.parametrize("delay_ms", [0, 30, 100, 200, 300])
def test_an_interruption_at_any_time_is_no_traceback(delay_ms: int, tmp_path: Path) -> None:
    command = [sys.executable, "-c", INTERRUPTIBLE, "triage", str(SAMPLE), "--no-history", "--json"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=Path(__file__).parents[2])
    assert process.stdout is not None
    assert process.stdout.readline() == b"begins\n"
    time.sleep(delay_ms / 1000)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=20)
    assert process.returncode in (ExitCode.FAULT, ExitCode.INTERRUPTED, -signal.SIGINT), err.decode()
    assert b"Traceback" not in err


def test_an_interruption_while_the_commands_are_built_is_no_traceback(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted() -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("care_tui.cli.main", interrupted)
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        with pytest.raises(SystemExit) as ended:
            main()
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    assert ended.value.code == ExitCode.INTERRUPTED


LOST_IN_A_CALLBACK = """
import time, weakref
import care_tui.cli

class Lock: pass

def interrupted(_): raise KeyboardInterrupt

def run():
    lock = Lock()
    kept = weakref.ref(lock, interrupted)
    del lock
    time.sleep(20)

care_tui.cli.main = run
from care_tui.start import main
main()
"""


def test_an_interruption_that_meets_a_callback_is_not_lost() -> None:
    ended = subprocess.run(
        [sys.executable, "-c", LOST_IN_A_CALLBACK], capture_output=True, cwd=Path(__file__).parents[2], check=False
    )
    assert (ended.returncode, ended.stderr) == (ExitCode.INTERRUPTED, b"")
