"""`care triage --open`: the page is a file of this user's, a browser is asked to show it, and no stranger's program."""

from __future__ import annotations

import os
import stat
import time
from pathlib import Path

import pytest

from care_core.files import bundled
from tests.conftest import Care

FAILED = bundled("samples", "arducopter_failed.BIN")
GOOD = bundled("samples", "nav2_good.mcap")


def program(path: Path, script: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"#!/bin/sh\n{script}\n")
    path.chmod(0o755)


@pytest.fixture
def desktop(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of PATH for a desktop's programs, and a display."""
    for name in ("SSH_CONNECTION", "SSH_TTY", "WAYLAND_DISPLAY", "WSL_DISTRO_NAME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv("DISPLAY", ":9")
    monkeypatch.setenv("PATH", str(tmp_path / "bin"))
    return tmp_path / "bin"


def page_of(stderr: str) -> Path:
    return Path(stderr.partition("wrote ")[2].splitlines()[0])


def test_the_browser_of_the_desktop_is_given_the_page(care: Care, desktop: Path, tmp_path: Path) -> None:
    program(desktop / "xdg-open", f'echo "$1" > {tmp_path}/asked; echo noise; echo noise >&2')
    outcome = care("triage", FAILED, "--no-history", "--open")
    assert (outcome.code, outcome.stdout) == (1, "")
    page = page_of(outcome.stderr)
    assert (tmp_path / "asked").read_text() == f"{page.as_uri()}\n"
    assert page.read_text().startswith("<!doctype html>")
    assert stat.S_IMODE(page.stat().st_mode) == 0o600
    assert stat.S_IMODE(page.parent.stat().st_mode) == 0o700
    assert "no browser" not in outcome.stderr


def test_the_page_is_where_out_says(care: Care, desktop: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    program(desktop / "xdg-open", f'echo "$1" > {tmp_path}/asked')
    monkeypatch.chdir(tmp_path)
    outcome = care("triage", GOOD, "--no-history", "--open", "--out", "a page.html")
    assert outcome.code == 0
    assert (tmp_path / "asked").read_text() == f"{(tmp_path / 'a page.html').as_uri()}\n"
    (tmp_path / "notes.html").write_text("mine\n")
    assert care("triage", GOOD, "--no-history", "--open", "--out", "notes.html").code == 2
    assert (tmp_path / "notes.html").read_text() == "mine\n"


@pytest.mark.parametrize(
    ("variable", "value", "says"),
    [
        ("SSH_CONNECTION", "10.0.0.1 5 10.0.0.2 22", "over SSH"),
        ("DISPLAY", "", "There is no display"),
        ("PATH", "/nonexistent", "None was found"),
    ],
)
def test_where_no_browser_can_be_the_place_is_said(
    care: Care, desktop: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, variable: str, value: str, says: str
) -> None:
    program(desktop / "xdg-open", f"touch {tmp_path}/asked")
    monkeypatch.setenv(variable, value)
    outcome = care("triage", GOOD, "--no-history", "--open")
    assert outcome.code == 0
    assert says in outcome.stderr
    assert f"the page is {page_of(outcome.stderr)}" in outcome.stderr
    assert not (tmp_path / "asked").exists()


def test_a_desktop_without_a_browser_is_told(care: Care, desktop: Path) -> None:
    program(desktop / "xdg-open", "exit 3")
    outcome = care("triage", GOOD, "--no-history", "--open")
    assert outcome.code == 0
    assert "None was found, so no browser was opened" in outcome.stderr


def test_nobody_waits_for_the_browser(care: Care, desktop: Path) -> None:
    program(desktop / "xdg-open", "exec /bin/sleep 20")
    began = time.monotonic()
    assert care("triage", GOOD, "--no-history", "--open").code == 0
    assert time.monotonic() - began < 15


def test_no_program_of_the_current_folder_is_run(
    care: Care, desktop: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "strangers"
    for name in ("xdg-open", "sensible-browser", "x-www-browser", "wslview", "open", "firefox"):
        program(folder / name, f"touch {tmp_path}/ran")
    monkeypatch.chdir(folder)
    monkeypatch.setenv("PATH", f".{os.pathsep}{os.pathsep}{desktop}")
    monkeypatch.setenv("BROWSER", "./firefox")
    outcome = care("triage", GOOD, "--no-history", "--open")
    assert (outcome.code, "None was found" in outcome.stderr) == (0, True)
    assert not (tmp_path / "ran").exists()


def test_only_a_page_can_be_opened(care: Care) -> None:
    outcome = care("triage", GOOD, "--open", "--json")
    assert (outcome.code, outcome.stdout) == (2, "")
    assert "not json" in outcome.stderr
