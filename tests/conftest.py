"""Fixtures for all tests: the folder of recorded runs, and a `care` that is called like the command."""

from __future__ import annotations

import gc
import os
import signal
from collections.abc import Callable
from fcntl import LOCK_EX, flock
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

# As the command does, and before numpy is loaded: threads that wait for each other cost several times the work.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# A shell's background job ignores interruptions, and so would the programs that the tests start and interrupt.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

import pytest
from hypothesis import settings

from care_core.ecosystems.registry import register_measures

if TYPE_CHECKING:
    from care_core.profile.store import Profile

register_measures()


class Outcome(NamedTuple):
    """What a call of the command gave."""

    code: int
    stdout: str
    stderr: str


Care = Callable[..., Outcome]
LONGEST_ID = 40

# How long an example takes says more of the machine's other work than of the code. A change is held against the same
# examples as the one before it; `make sweep` draws new ones, and more of them.
settings.register_profile("care", deadline=None, derandomize=True, max_examples=40)
settings.register_profile("sweep", deadline=None)
settings.load_profile("care")


def pytest_make_parametrize_id(val: object, argname: str) -> str | None:
    """A long text gives its test a short name."""
    return f"{argname}_of_{len(val)}" if isinstance(val, (str, bytes)) and len(val) > LONGEST_ID else None


@pytest.fixture(scope="session")
def shared_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder that all workers of this run share: it lies above the folder of each."""
    own = tmp_path_factory.getbasetemp()
    return own.parent if "PYTEST_XDIST_WORKER" in os.environ else own


@pytest.fixture(autouse=True)
def _own_home(tmp_path: Path, shared_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Hide the developer's home folder and terminal from the tests.

    The cache alone outlives a test, as it does an operator's runs: what it holds is never out of date, and to check
    fourteen profiles anew took a third of a triage.
    """
    home = tmp_path / "home"
    home.mkdir()
    monkeypatch.setenv("HOME", str(home))
    monkeypatch.setenv("XDG_CONFIG_HOME", str(home / ".config"))
    monkeypatch.setenv("XDG_DATA_HOME", str(home / ".local"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(shared_folder / "cache"))
    for name in ("CARE_DEBUG", "NO_COLOR"):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture(scope="session")
def recorded() -> Path:
    """The folder with `data` and `logs`; tests that need it are skipped where it is not set."""
    folder = os.environ.get("CARE_SHARED")
    if not folder:
        pytest.skip("CARE_SHARED does not name a folder of recorded runs")
    return Path(folder)


@pytest.fixture(scope="session")
def planted(shared_folder: Path) -> Profile:
    """A profile trained on 250 missions of the robot in `planted`, written and read as an installed one is."""
    from care_core.learn.train import train
    from care_core.profile.model import write_model
    from care_core.profile.store import Profile
    from tests.planted import SCHEMA, SETTINGS, fly_many

    # The first worker to come trains, the others wait for it.
    folder = shared_folder / "planted"
    folder.mkdir(exist_ok=True)
    with (folder / "lock").open("w") as lock:
        flock(lock, LOCK_EX)
        if not (folder / "mechanisms.npz").is_file():  # what is written last
            write_model(train(fly_many(250), SCHEMA, SETTINGS), folder)
    return Profile(folder, SCHEMA)


@pytest.fixture
def care(capsys: pytest.CaptureFixture[str]) -> Care:
    """Call the command in this process."""

    def call(*args: str | Path) -> Outcome:
        from care_tui.cli import command_line

        words = [str(arg) for arg in args]
        capsys.readouterr()
        with pytest.raises(SystemExit) as ended:
            command_line(words)(words, prog_name="care")
        code = ended.value.code
        captured = capsys.readouterr()
        return Outcome(code if isinstance(code, int) else 0 if code is None else 1, captured.out, captured.err)

    return call


def pytest_collection_finish() -> None:
    """Spare the collector what lives as long as the run, modules and thousands of tests, and have it look less often:
    it took a tenth of the time."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)
