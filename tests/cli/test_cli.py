"""The command line: what is said where, exit codes, and what a wrong word is answered with."""

from __future__ import annotations

import csv
import json
import os
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest
from typer.core import TyperGroup
from typer.main import get_command

from care_core.application import api
from care_core.application.case import Case, Request
from care_core.diagnose.records import Diagnosis
from care_core.ecosystems.findings import NOTHING_SEEN
from care_core.profile.store import load_profile
from care_core.records import replace
from care_core.tables.rows import ABOUT
from care_tui import __version__, console
from care_tui.cli import FAMILIES, GROUPS, command_line, route
from care_tui.commands.opening import newest_log
from tests.conftest import Care
from tests.made import HEALTH, made_diagnosis

COMMANDS = ("triage", "inspect", "params", "ingest", "collect", "train", "demo", "profiles", "schema")
ROOT = Path(__file__).parents[2]
SAMPLE = ROOT / "samples" / "arducopter_failed.BIN"


def run_process(*args: str, **variables: str) -> subprocess.CompletedProcess[str]:
    code = "from care_tui.cli import main; main()"
    environment = {**os.environ, "PYTHONPATH": str(ROOT), **variables}
    return subprocess.run(
        [sys.executable, "-c", code, *args], capture_output=True, text=True, timeout=60, env=environment, check=False
    )


@pytest.fixture
def flights(recorded: Path) -> tuple[Path, ...]:
    return tuple(sorted((recorded / "data" / "arducopter" / "faults").glob("*.BIN"))[:3])


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Puts a diagnosis made by hand in the place of the engine, and keeps what the engine was asked."""
    asked: dict[str, Any] = {"answer": made_diagnosis()}

    def triage(request: Request, progress: object) -> Case:
        asked["request"] = request
        return Case(asked["answer"])

    monkeypatch.setattr(api, "triage", triage)
    return asked


def test_version_and_help(care: Care) -> None:
    assert care("--version").stdout == f"care {__version__}\n"
    listing = care("--help")
    assert listing.code == 0
    assert all(f"\n  {command}" in listing.stdout for command in COMMANDS)
    assert "\n  open" not in listing.stdout


def test_the_help_groups_every_command_by_what_one_wants(care: Care) -> None:
    listing = care("--help").stdout
    grouped = [name for names in GROUPS.values() for name in names]
    assert sorted(grouped) == sorted({name for names in FAMILIES.values() for name in names} - {"open"})
    places = [listing.index(f"\n{title}:\n") for title in GROUPS]
    assert places == sorted(places)
    assert places[-1] < listing.index("\nOptions")
    lines = listing.splitlines()
    assert max(map(len, lines)) <= 80
    assert [line for line in lines[1:] if line.endswith("...")] == []


@pytest.mark.parametrize(("family", "commands"), FAMILIES.items())
def test_a_command_is_built_with_its_own_family_alone(family: str, commands: tuple[str, ...]) -> None:
    words = [] if family == "opening" else [commands[0]]
    group = get_command(command_line(words))
    assert isinstance(group, TyperGroup)
    assert tuple(group.commands) == commands


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help(care: Care, command: str) -> None:
    outcome = care(command, "--help")
    assert outcome.code == 0
    assert "Usage: care " in outcome.stdout


@pytest.mark.parametrize(
    ("words", "routed"),
    [
        ([], ["open"]),
        (["flight.BIN"], ["open", "flight.BIN"]),
        (["logs/flight", "--profile", "x"], ["open", "logs/flight", "--profile", "x"]),
        (["--profile", "x", "flight.BIN"], ["open", "--profile", "x", "flight.BIN"]),
        (["triage", "flight.BIN"], ["triage", "flight.BIN"]),
        (["--help"], ["--help"]),
    ],
)
def test_a_log_may_stand_where_a_command_does(words: list[str], routed: list[str]) -> None:
    assert route(words, {"triage", "open"}, {"--help", "--version"}) == routed


def test_a_misspelt_command_is_answered_with_the_nearest(care: Care) -> None:
    outcome = care("triag", "a.BIN")
    assert (outcome.code, outcome.stdout) == (2, "")
    assert outcome.stderr == "care: There is no command 'triag'. Did you mean 'triage'?\n"


def test_a_missing_log_is_unreadable(care: Care) -> None:
    for words in (("missing.BIN",), ("triage", "missing.BIN"), ("inspect", "missing.BIN"), ("params", "missing.BIN")):
        outcome = care(*words)
        assert (outcome.code, outcome.stdout) == (4, "")
        assert "missing.BIN: No such file." in outcome.stderr


def test_the_app_asks_for_a_terminal(care: Care, tmp_path: Path) -> None:
    log = tmp_path / "a.bag"
    log.write_bytes(b"#ROSBAG V2.0\n")
    outcome = care(log)
    assert outcome.code == 2
    assert "care triage LOG" in outcome.stderr


def test_the_app_takes_what_triage_takes_and_the_help_shows_it(care: Care, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Request | None] = []

    def run(request: Request | None, _settings: object) -> int:
        asked.append(request)
        return 0

    monkeypatch.setenv("TEXTUAL_DRIVER", "none is started")
    monkeypatch.setattr("care_tui.app.run", run)
    words = ("--mission", "2", "--threshold", "energy=9.5", "--keep", "LAND_SPEED", "--keep", "RTL_ALT")
    assert care(SAMPLE, *words, "--since", SAMPLE).code == 0
    (request,) = asked
    assert request is not None
    assert (request.log, request.mission, request.since) == (SAMPLE, 2, SAMPLE)
    assert dict(request.thresholds) == {"energy": 9.5}
    assert request.keep == ("LAND_SPEED", "RTL_ALT")
    assert care(SAMPLE, "--threshold", "energy=low").code == 2
    shown = care("--help").stdout
    assert all(f"--{name} " in shown for name in ("mission", "threshold", "keep", "since", "config", "ascii"))


def test_the_newest_log_is_found(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "rosbag2_today").mkdir()
    for age, name in enumerate(("old.BIN", "rosbag2_today/metadata.yaml", "new.bag", "newest.txt", "now.bag.active")):
        path = tmp_path / name
        path.touch()
        os.utime(path, (age, age))
    assert newest_log([tmp_path / "none", tmp_path]) == tmp_path / "new.bag"
    assert "now.bag.active is still being written" in capsys.readouterr().err
    (tmp_path / "new.bag").unlink()
    assert newest_log([tmp_path]) == tmp_path / "rosbag2_today"
    assert newest_log([tmp_path / "none"]) is None


def test_triage_prints_data_on_stdout_alone(care: Care, made: dict[str, Any]) -> None:
    outcome = care("triage", "a.BIN")
    assert outcome.code == 1
    assert outcome.stdout.startswith("FAULT: too slow: ")
    assert outcome.stderr == ""
    assert json.loads(care("triage", "a.BIN", "--json").stdout)["schema"] == "care.triage/1"
    assert "diff: |" in care("triage", "a.BIN", "--yaml").stdout
    assert care("triage", "a.BIN", "--markdown").stdout.startswith("# Triage")


def test_triage_passes_its_options_on(care: Care, made: dict[str, Any]) -> None:
    care(
        "triage", "a.BIN", "-p", "arducopter", "--config", "b.param", "--config", "c.param", "--keep", "A",
        "--threshold", "energy=12", "--mission", "2", "--top", "3", "--since", "good.BIN",
    )  # fmt: skip
    assert made["request"] == Request(
        Path("a.BIN"),
        "arducopter",
        ("b.param", "c.param"),
        ("A",),
        {"energy": 12.0},
        top=3,
        mission=2,
        since=Path("good.BIN"),
    )


def test_the_exit_code_says_what_was_found(care: Care, made: dict[str, Any]) -> None:
    fault: Diagnosis = made["answer"]
    ok, _, unknown = fault.objectives
    for objectives, health, code in (
        ((ok,), NOTHING_SEEN, 0),
        (fault.objectives, NOTHING_SEEN, 1),
        ((ok, unknown), NOTHING_SEEN, 3),
        ((), NOTHING_SEEN, 3),
        ((ok,), HEALTH, 1),
        ((), HEALTH, 1),
    ):
        made["answer"] = replace(fault, objectives=objectives, health=health, faults=(), fix=None)
        assert care("triage", "a.BIN").code == code


def test_a_report_is_written_in_the_format_of_its_name(care: Care, made: dict[str, Any], tmp_path: Path) -> None:
    out = tmp_path / "report.yaml"
    outcome = care("triage", "a.BIN", "--out", out)
    assert (outcome.code, outcome.stdout, outcome.stderr) == (1, "", f"wrote {out}\n")
    *verdict, schema = out.read_text().partition("\nfit:")[0].splitlines()
    assert verdict[0].startswith("# FAULT: too slow: 190 s")
    assert verdict[-1].startswith("# Profile ")
    assert schema == "schema: care.triage/1"
    assert care("triage", "a.BIN", "--out", tmp_path / "none" / "report.json").code == 2


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_disk_behind_stdout_is_said() -> None:
    with Path("/dev/full").open("w") as full:
        outcome = subprocess.run(
            [sys.executable, "-c", "from care_tui.cli import main; main()", "schema", "triage"],
            stdout=full, stderr=subprocess.PIPE, text=True, timeout=60, check=False, cwd=ROOT,
        )  # fmt: skip
    assert outcome.returncode == 2
    assert outcome.stderr.startswith("care: Cannot write the output: ")


def test_ingest_chooses_the_profile_by_a_log_that_can_be_read(
    care: Care, flights: tuple[Path, ...], tmp_path: Path
) -> None:
    empty = tmp_path / "empty.BIN"
    empty.touch()
    outcome = care("ingest", empty, flights[0], "-o", tmp_path / "runs.csv")
    assert outcome.code == 3
    assert "1 log failed" in outcome.stderr


@pytest.mark.parametrize("command", ["triage", "compare", "graph"])
def test_a_file_whose_ending_is_no_format_is_refused(
    care: Care, flights: tuple[Path, ...], tmp_path: Path, command: str
) -> None:
    logs = flights[:1] * (2 if command == "compare" else 1)
    outcome = care(command, *logs, "--out", tmp_path / "x.pdf")
    assert (outcome.code, outcome.stdout) == (2, "")
    assert "The file name must end in ." in outcome.stderr
    assert "Plain text takes .txt." in outcome.stderr
    assert not (tmp_path / "x.pdf").exists()


def test_only_one_format_can_be_printed(care: Care, made: dict[str, Any]) -> None:
    assert care("triage", "a.BIN", "--json", "--yaml").code == 2


@pytest.mark.parametrize(
    ("option", "value", "reason"),
    [
        ("--keep", "WPNAV_SPED", "Did you mean 'WPNAV_SPEED'?"),
        ("--threshold", "enery=3", "Did you mean 'energy'?"),
        ("--threshold", "energy=much", "--threshold energy=NUMBER"),
        ("--threshold", "energy=nan", "--threshold energy=NUMBER"),
        ("--threshold", "energy=inf", "--threshold energy=NUMBER"),
        ("--threshold", "mission_success=0", "is met or not: it has no other threshold"),
        ("--threshold", "energy=0", "No mission can keep a limit of 0 or less."),
        ("--profile", "arducoptr", "Did you mean 'arducopter'?"),
    ],
)
def test_unknown_names_are_answered_with_the_nearest(
    care: Care, flights: tuple[Path, ...], option: str, value: str, reason: str
) -> None:
    outcome = care("triage", flights[0], option, value)
    assert (outcome.code, outcome.stdout) == (2, "")
    assert reason in outcome.stderr


def test_a_configuration_that_cannot_be_read_is_named(care: Care, flights: tuple[Path, ...], tmp_path: Path) -> None:
    broken = tmp_path / "a.param"
    broken.write_text("A 1\nB\n")
    outcome = care("triage", flights[0], "--config", broken)
    assert outcome.code == 2
    assert f"{broken}:2" in outcome.stderr


def test_inspect_shows_what_a_log_holds(care: Care, flights: tuple[Path, ...]) -> None:
    data = json.loads(care("inspect", flights[0], "--json").stdout)
    assert data["log"]["format"] == "dataflash-bin"
    assert data["parameters"]["count"] > 100
    assert data["profiles"][0]["name"] == "arducopter"
    assert any(channel["name"] == "PARM" for channel in data["channels"])
    assert "dataflash-bin" in care("inspect", flights[0]).stdout


def test_params_are_a_file_that_can_be_loaded(care: Care, flights: tuple[Path, ...], tmp_path: Path) -> None:
    from care_core.configs.loading import read_config

    out = tmp_path / "driven.param"
    assert care("params", flights[0], "--out", out).code == 0
    driven = read_config(out)
    changed = care("params", flights[0], "--changed").stdout.splitlines()
    assert 0 < len(changed) < len(driven)
    assert all(line.split(",")[0] in driven for line in changed)


def test_params_tell_what_was_changed_and_from_where(care: Care) -> None:
    changed = care("params", SAMPLE, "--changed")
    assert "LAND_SPEED,16  # default 50" in changed.stdout
    assert "INS_GYROFFS_X" not in changed.stdout
    assert "--all shows them" in changed.stderr
    assert "INS_GYROFFS_X" in care("params", SAMPLE, "--changed", "--all").stdout
    assert "LAND_SPEED,16  # default 50, from PARM" in care("params", SAMPLE, "--sources").stdout


def test_what_a_file_says_and_what_changed_is_told(care: Care, tmp_path: Path) -> None:
    wrong, other = tmp_path / "wrong.param", tmp_path / "other.yaml"
    wrong.write_text("LAND_SPEED 40\n")
    other.write_text("DWAPlannerROS: {sim_time: 2.0}\n")
    outcome = care("triage", SAMPLE, "--config", wrong, "--config", f"move_base={other}", "--since", SAMPLE, "--json")
    document = json.loads(outcome.stdout)
    assert f"LAND_SPEED was 16 when driven, {wrong}:1 says 40; the driven value is used" in document["notes"]
    assert f"move_base={other} holds nothing that profile arducopter knows" in document["notes"]
    assert document["sources"]["LAND_SPEED"] == "PARM"
    assert document["since"]["changes"] == []
    assert "it is the same log" in document["since"]["warnings"]
    missing = care("triage", SAMPLE, "--since", tmp_path / "none.BIN")
    assert (missing.code, "No such file" in missing.stderr) == (4, True)


def test_ingest_goes_on_after_a_log_that_fails(care: Care, flights: tuple[Path, ...], tmp_path: Path) -> None:
    folder = tmp_path / "logs"
    folder.mkdir()
    for path in flights:
        (folder / path.name).symlink_to(path)
    (folder / "broken.bin").write_bytes(b"no log")
    out = tmp_path / "runs.csv"
    outcome = care("ingest", folder, "-o", out, "--profile", "arducopter", "--failures", tmp_path / "failed.csv")
    assert outcome.code == 3
    assert "Not a log of a known format." in (tmp_path / "failed.csv").read_text()
    assert "broken.bin  Not a log of a known format." in outcome.stderr
    with out.open() as stream:
        rows = list(csv.reader(stream))
    assert rows[0] == [*ABOUT, *load_profile("arducopter").schema.variables]
    assert len(rows) == 1 + len(flights)


def test_ingest_refuses_before_it_reads(care: Care, tmp_path: Path) -> None:
    for out, place in ((tmp_path / "runs.txt", tmp_path), (tmp_path / "runs.csv", tmp_path / "none")):
        assert care("ingest", place, "-o", out).code == 2
    (tmp_path / "a.bin").write_bytes(b"no log")
    outcome = care("ingest", tmp_path, "-o", tmp_path / "runs.csv", "--profile", "arducopter")
    assert outcome.code == 4
    assert not (tmp_path / "runs.csv").exists()


def test_the_published_schema_is_printed(care: Care) -> None:
    assert json.loads(care("schema", "triage").stdout)["title"] == "care.triage/1"
    assert json.loads(care("schema", "inspect").stdout)["title"] == "care.inspect/1"


def test_profiles_are_listed_and_shown(care: Care) -> None:
    assert care("profiles").stdout == care("profiles", "list").stdout
    assert "arducopter" in care("profiles").stdout
    shown = care("profiles", "show", "arducopter").stdout
    assert "objectives (4)" in shown
    assert "effects of a parameter on an objective:" in shown
    assert "not identified" not in shown
    assert care("profiles", "show", "none").code == 2


def test_the_demo_finds_its_fault(care: Care) -> None:
    outcome = care("demo")
    assert outcome.code == 1, outcome.stderr
    assert outcome.stdout.startswith("FAULT: ")
    assert "\nProfile arducopter fits\n" in outcome.stdout
    assert max(map(len, outcome.stdout.splitlines())) <= 80


def test_an_unexpected_error_is_one_sentence(care: Care, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object, **__: object) -> Diagnosis:
        raise RuntimeError("oops \x1b[31m")

    monkeypatch.setattr(api, "triage", fail)
    outcome = care("triage", "a.BIN")
    assert outcome.code == 2
    assert outcome.stderr == (
        "care: unexpected RuntimeError: oops \\x1b[31m. Set CARE_DEBUG=1 to see where it comes from.\n"
    )
    monkeypatch.setenv("CARE_DEBUG", "1")
    assert "Traceback" in care("triage", "a.BIN").stderr


def test_interrupted(care: Care, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(*_: object, **__: object) -> Diagnosis:
        raise KeyboardInterrupt

    monkeypatch.setattr(api, "triage", interrupt)
    assert care("triage", "a.BIN").code == 130


def test_a_reader_that_goes_away_is_no_error() -> None:
    code = "from care_tui.cli import main; main()"
    with subprocess.Popen(
        [sys.executable, "-c", code, "schema", "triage"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        assert process.stderr.read() == b""
        assert process.wait(timeout=60) == console.PIPE_CLOSED


def test_colour_only_on_a_terminal_that_wants_it(monkeypatch: pytest.MonkeyPatch) -> None:
    assert console.painted("FAULT: x") == "FAULT: x"
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    monkeypatch.setenv("TERM", "xterm")
    assert console.painted("FAULT: x") == "\x1b[1;31mFAULT\x1b[0m: x"
    monkeypatch.setenv("NO_COLOR", "1")
    assert console.painted("FAULT: x") == "FAULT: x"


def test_slow_work_says_so_and_again_each_minute(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    times: Iterable[float] = iter((0.0, 0.5, 1.5, 2.0, 62.0))
    monkeypatch.setattr("time.monotonic", lambda: next(iter(times)))
    with console.Progress() as progress:
        for step in range(1, 5):
            progress(f"{step} of 5", step / 5)
        progress("5 of 5", 1.0)
    assert capsys.readouterr().err == "2 of 5 ...\n4 of 5 ...\n"


def test_the_command_runs_as_a_process() -> None:
    assert run_process("--version").stdout == f"care {__version__}\n"
    outcome = run_process("triage", "missing.BIN")
    assert (outcome.returncode, outcome.stdout) == (4, "")
    assert "Traceback" not in outcome.stderr
