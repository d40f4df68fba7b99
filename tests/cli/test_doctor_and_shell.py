"""What works here, the shell's completion, and the manual page."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import jsonschema
import pytest

from care_core.application import checkup
from care_core.files import bundled, profile_folders
from care_core.profile import store
from care_core.records import read
from care_core.report.checkup import DoctorDocument, doctor_text
from tests.conftest import Care

ROOT = Path(__file__).parents[2]


def statuses(text: str) -> dict[str, str]:
    return {check["name"]: check["status"] for check in json.loads(text)["checks"]}


@pytest.fixture
def _few_profiles(monkeypatch: pytest.MonkeyPatch) -> None:
    """One that is bundled and the user's own: that all agree with themselves is for the tests of profiles."""

    def few() -> dict[str, Path]:
        return {name: folder for name, folder in profile_folders().items() if name in ("owlat", "mine")}

    monkeypatch.setattr(store, "profile_folders", few)


@pytest.mark.usefixtures("_few_profiles")
def test_where_all_is_well_the_doctor_says_so(care: Care) -> None:
    outcome = care("doctor", "--json")
    assert outcome.code == 0
    jsonschema.validate(json.loads(outcome.stdout), DoctorDocument.json_schema())
    found = statuses(outcome.stdout)
    assert found["profiles"] == found["history"] == found["folder of settings"] == "ok"
    assert found["terminal"] == "warn", "the tests have none"
    text = doctor_text(read(DoctorDocument, json.loads(outcome.stdout)))
    assert all(len(line) <= 80 for line in text.splitlines())
    assert "works here" in text


@pytest.mark.usefixtures("_few_profiles")
def test_what_is_broken_is_said_with_what_to_do(care: Care, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    history = tmp_path / "history.sqlite3"
    history.write_bytes(b"no database at all, but long enough to be read" * 30)
    monkeypatch.setenv("CARE_HISTORY", str(history))
    (tmp_path / "file").write_text("no folder", encoding="utf-8")
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "file"))
    unsound = Path(os.environ["XDG_DATA_HOME"]) / "care" / "profiles" / "mine"
    unsound.mkdir(parents=True)
    (unsound / "profile.yaml").write_text("nonsense: 1\n", encoding="utf-8")
    monkeypatch.setattr(checkup, "_is_installed", lambda name: name not in ("mcp", "textual"))
    outcome = care("doctor", "--json")
    assert outcome.code == 1
    found = statuses(outcome.stdout)
    broken = {name for name, status in found.items() if status == "fail"}
    assert broken == {"history", "folder of settings", "profile mine", "packages"}
    assert found["extra mcp"] == "warn"
    assert "pip install 'care-tui[mcp]'" in outcome.stdout
    assert all(check["do"] for check in json.loads(outcome.stdout)["checks"] if check["status"] == "fail")


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_a_shell_gets_its_script(care: Care, shell: str) -> None:
    outcome = care("completion", shell)
    assert outcome.code == 0
    assert f"complete_{shell}" in outcome.stdout
    assert care("completion", "tcsh").code == 2


@pytest.mark.parametrize(
    ("words", "found"),
    [
        ("care wat", {"watch"}),
        ("care watch --not", {"--notify-command"}),
        ("care triage --profile ardu", {"arducopter", "arduplane", "ardurover", "ardusub"}),
        ("care profiles sh", {"show"}),
        ("care profiles show husk", {"husky", "husky-care"}),
        ("care graph tur", {"turtlebot3"}),
        ("care triage a", set()),  # the shell names files itself
        ("care triage a.BIN --keep LAND_S", {"LAND_SPEED"}),
        ("care triage a.mcap --keep LAND_S", set()),  # no profile of such logs has it
        ("care triage --profile owlat --keep dig_s", {"dig_speed"}),
        ("care whatif a.BIN --set LAND_S", {"LAND_SPEED="}),
        ("care triage a.BIN --threshold mission_t", {"mission_time="}),
        ("care verify report.yaml a.BIN --threshold en", {"energy="}),
        ("care a.BIN --keep LAND_S", {"LAND_SPEED"}),
        ("care triage --profile nosuch --keep ", set()),
        ("care triage a.BIN --mission ", set()),
        ("care nonsense --ke", set()),
        ("care triage --nonsense --ke", {"--keep"}),
    ],
)
def test_commands_options_and_names_are_completed(words: str, found: set[str]) -> None:
    assert set(completed(words).split()) == found


def test_missions_are_those_that_the_history_knows(care: Care, tmp_path: Path) -> None:
    log = bundled("samples", "arducopter_failed.BIN")
    assert care("triage", log, "--out", tmp_path / "a.txt").code == 1
    assert completed(f"care triage {log} --mission ").split() == ["1"]


def test_completing_reads_no_yaml_of_a_profile_that_was_read_before() -> None:
    """Reading it takes as long as all the rest of what a shell waits for."""
    read_profiles = "from care_core.extract.select import sound_profiles; sound_profiles()"
    subprocess.run([sys.executable, "-c", read_profiles], env={**os.environ, "PYTHONPATH": str(ROOT)}, check=True)
    assert completed("care triage a.BIN --keep LAND_S", "ruamel") == "LAND_SPEED\n"


def completed(words: str, *unread: str) -> str:
    """What bash is offered for the last word, which begins behind the last blank.

    Args:
        unread: what may not be imported for it, beside what never may.
    """
    variables = {
        "_CARE_COMPLETE": "complete_bash", "COMP_WORDS": words, "COMP_CWORD": str(words.count(" ")),
        "PYTHONPATH": str(ROOT),
    }  # fmt: skip
    heavy = {"numpy", "pandas", "pydantic", "rich", "textual", *unread}
    code = f"import sys; from care_tui.start import main\ntry: main()\nfinally: assert not {heavy} & {{*sys.modules}}"
    answer = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env={**os.environ, **variables}, check=False
    )
    assert answer.stderr == ""
    return answer.stdout


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_the_usual_options_tell_the_shell_that_asks(care: Care, shell: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("typer.completion._get_shell_name", lambda: shell)
    monkeypatch.setattr("typer._completion_shared._get_shell_name", lambda: shell)
    home = Path(os.environ["HOME"])
    assert care("--show-completion").stdout == care("completion", shell).stdout
    assert care("--install-completion").code == 0
    assert any(f"complete_{shell}" in path.read_text() for path in home.rglob("*") if path.is_file())


def test_the_demo_ends_with_a_command_that_works_as_printed(tmp_path: Path) -> None:
    """Called as the script of a venv, from inside the project, and from another folder."""
    script = ROOT / ".venv" / "bin" / "care"
    if not script.exists():
        pytest.skip("the command is not installed in the project's venv")
    for folder in (ROOT, tmp_path):
        ended = subprocess.run([script, "demo"], cwd=folder, capture_output=True, text=True, check=False)
        assert ended.returncode == 1
        (line,) = [line for line in ended.stderr.splitlines() if line.startswith("Now open it: ")]
        command = line.removeprefix("Now open it: ")
        opened = subprocess.run(
            ["sh", "-c", command], cwd=folder, capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL
        )
        assert "The terminal app needs a terminal" in opened.stderr, command
        assert (folder == ROOT) == ("samples/arducopter_failed.BIN" in command.split())


def test_the_manual_page_is_that_of_the_help(care: Care) -> None:
    page = care("man").stdout
    assert page == (ROOT / "docs" / "care.1").read_text(encoding="utf-8"), "make man"
    for text in (".TH CARE 1", "care watch", "\\-\\-notify\\-command CMD", ".SH EXIT STATUS", "care profiles check"):
        assert text in page.replace('"care" "', "care ").replace("\\fB", "")
    assert not [line for line in page.splitlines() if line.startswith("'")]
