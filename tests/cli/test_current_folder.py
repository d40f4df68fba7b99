"""In a stranger's folder of logs nothing is run that lies there, whatever the command starts, however it is called."""

from __future__ import annotations

import asyncio
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pexpect
import pytest

from care_core.files import bundled
from tests.campaigns import COPY, campaign_in
from tests.strangers_folder import MARK, plant, what_ran
from tests.tui.test_serve import causes_behind, serve

pytestmark = pytest.mark.long

ROOT = Path(__file__).parents[2]
SAMPLE = bundled("samples", "arducopter_failed.BIN")


@pytest.fixture
def care(tmp_path: Path) -> Path:
    """The command as it is installed: a script in another folder."""
    script = tmp_path / "bin" / "care"
    script.parent.mkdir()
    script.write_text("from care_tui.start import main\nif __name__ == '__main__':\n    main()\n")
    return script


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Two logs, and what a stranger put beside them."""
    folder = tmp_path / "logs"
    folder.mkdir()
    for name in ("1.BIN", "2.BIN"):
        shutil.copy(SAMPLE, folder / name)
    monkeypatch.setenv("CARE_HISTORY", str(tmp_path / "history.sqlite3"))
    monkeypatch.setenv("PYTHONPATH", f"{ROOT}{os.pathsep}{ROOT / 'samples'}")
    monkeypatch.setenv("PATH", f".{os.pathsep}{os.environ['PATH']}")
    return folder


def call(care: Path, folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, care, *words], cwd=folder, capture_output=True, text=True, check=False, timeout=120
    )


COMMANDS = {
    "ingest": (0, ("ingest", ".", "--profile", "arducopter", "-o", "table.csv")),
    "watch": (1, ("watch", ".", "--once", "--quiet", "0", "--notify-command", "true {log}")),
    "fleet": (1, ("fleet", ".", "--workers", "1")),
    "triage": (1, ("triage", "1.BIN")),
    "doctor": (0, ("doctor",)),
}


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_runs_nothing_that_lies_beside_the_logs(
    name: str, care: Path, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TMUX", "/tmp/none,1,0")  # the doctor asks tmux
    mark = plant(folder)
    code, words = COMMANDS[name]
    ran = call(care, folder, *words)
    assert what_ran(mark) == []
    assert ran.returncode == code, ran.stderr


def test_a_campaign_beside_a_strangers_files(care: Path, folder: Path) -> None:
    campaign_in(folder, command=f"/bin/{COPY}", runs=2)
    mark = plant(folder)
    ran = call(care, folder, "collect", "campaign.yaml")
    assert what_ran(mark) == []
    assert ran.returncode == 0, ran.stderr


HELPER = """
import shutil, subprocess
if __name__ == "__main__":
    import care_tui
    subprocess.run(["fc-list"], check=False) if shutil.which("fc-list") else None
"""


@pytest.mark.parametrize("path", [":{usual}", ".:{usual}", "{usual}::", "../logs:{usual}"])
def test_what_a_library_starts_by_its_name_is_not_the_strangers(
    path: str, care: Path, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A plotting library, which one for learning imports, asks `fc-list` for the fonts."""
    usual = os.environ["PATH"].removeprefix(f".{os.pathsep}")
    monkeypatch.setenv("PATH", path.format(usual=usual))
    care.write_text(HELPER)
    mark = plant(folder)
    assert call(care, folder).returncode == 0
    assert what_ran(mark) == []


LEARNING = """
from functools import partial
from care_core.learn.processes import answers
if __name__ == "__main__":
    assert answers([partial(int, "4"), partial(int, "2")], 2) == [4, 2]
"""


def test_the_processes_that_learn_beside_a_strangers_files(care: Path, folder: Path) -> None:
    pytest.importorskip("threadpoolctl")
    care.write_text(LEARNING)
    mark = plant(folder)
    ran = call(care, folder)
    assert what_ran(mark) == []
    assert ran.returncode == 0, ran.stderr


def test_the_app_that_a_watcher_opens_is_the_operators(care: Path, folder: Path) -> None:
    mark = plant(folder)
    words = [str(care), "watch", ".", "--quiet", "0", "--no-history"]
    with pexpect.spawn(sys.executable, words, cwd=folder, timeout=60, dimensions=(40, 120)) as terminal:
        terminal.expect("2.BIN")
        terminal.send("\r")
        terminal.expect("mission_time")
        terminal.send("q")
        terminal.expect("waiting for logs")
    assert what_ran(mark) == []


def test_the_app_that_is_served_is_the_operators(care: Path, folder: Path) -> None:
    mark = plant(folder)
    server, address = serve(sys.executable, str(care), cwd=folder)
    with server:
        try:
            assert b"LAND_SPEED" in asyncio.run(causes_behind(address))
        finally:
            server.terminate()
    assert what_ran(mark) == []


LATER = ("multiprocessing", "signal", "typing", "json", "numpy", "msgspec", "typer", "textual", "yaml")
"""What the program imports after Python itself has begun."""


@pytest.mark.parametrize(
    ("start", "path"),
    [
        (("-m", "care_tui"), "{root}"),
        (("-c", "from care_tui.start import main; main()"), "{root}"),
        (("{care}",), "{root}:"),
        (("{care}",), "../logs:{root}"),
    ],
)
def test_however_it_is_called_it_imports_nothing_from_there(
    start: tuple[str, ...], path: str, care: Path, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What Python itself imports before it begins with the program cannot be kept from it: see the guide."""
    monkeypatch.setenv("PYTHONPATH", path.format(root=ROOT))
    (folder / "2.BIN").unlink()
    mark = folder / MARK
    for name in LATER:
        (folder / f"{name}.py").write_text(f"open({str(mark)!r}, 'a').write(__name__)\n")
    ran = subprocess.run(
        [sys.executable, *(word.format(care=care) for word in start), *COMMANDS["watch"][1]],
        cwd=folder, capture_output=True, text=True, check=False, timeout=120,
    )  # fmt: skip
    assert what_ran(mark) == []
    assert ran.returncode == COMMANDS["watch"][0], ran.stderr


def test_a_checkout_of_the_program_can_be_run_where_it_lies(tmp_path: Path) -> None:
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    code = "import care_tui, care_core; print(care_core.__file__)"
    ran = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, env=environment, capture_output=True, text=True, check=True
    )
    assert ran.stdout.strip() == str(ROOT / "care_core" / "__init__.py")
