"""`care collect`: every run of the plan is made once, whatever fails, hangs or kills it; its logs become a table."""

from __future__ import annotations

import csv
import errno
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from care_core.collect import guard
from care_core.collect.journal import FILE
from care_core.errors import ExitCode
from care_core.starting import script_command
from tests.campaigns import campaign_in, drive
from tests.conftest import Care

pytestmark = pytest.mark.long

ROOT = Path(__file__).parents[2]

pytest.importorskip("scipy")


def table(folder: Path) -> list[dict[str, str]]:
    with (folder / "campaign" / "runs.csv").open(encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def document(care: Care, path: Path, *words: str) -> tuple[int, Any]:
    outcome = care("collect", path, "--json", *words)
    return outcome.code, json.loads(outcome.stdout)


def test_a_campaign_of_the_bundled_robot(care: Care, tmp_path: Path) -> None:
    command = "{python} -m care_samples.robot --params {params} --log {logs}/drive.bag --seed {seed}"
    path = campaign_in(tmp_path, command=command, runs=3, repeats=0.34, at_reference=0.0, slots=2)
    plan = list(csv.DictReader(care("collect", path, "--plan").stdout.splitlines()))
    code, told = document(care, path)
    assert code == ExitCode.OK
    assert (told["planned"], told["done"], told["failed"], told["missions"]) == (3, 3, 0, 3)
    rows = table(tmp_path)
    for run, row in zip(plan, rows, strict=True):
        assert float(row["max_speed"]) == float(run["max_speed"])
        assert float(row["controller_frequency"]) == float(run["controller_frequency"])
        assert float(row["mission_time"]) > 10
    assert rows[2]["max_speed"] == rows[0]["max_speed"]
    assert rows[2]["mission_time"] != rows[0]["mission_time"]  # a repeat meets conditions of its own
    assert [row["conditions"] for row in rows] == [run["seed"] for run in plan]
    params = (tmp_path / "campaign" / "runs" / "0002" / "1" / "courier.yaml").read_text()
    assert "# m/s^2" in params  # comments stay


def test_a_campaign_that_is_done_is_not_made_again(care: Care, tmp_path: Path) -> None:
    path = campaign_in(tmp_path, command=["sh", "-c", 'echo >> started; cp drive.bag "$CARE_LOGS"'])
    assert document(care, path)[0] == ExitCode.OK
    before = (tmp_path / "campaign" / "runs.csv").read_bytes()
    code, told = document(care, path)
    assert (code, told["resumed"]) == (ExitCode.OK, 4)
    assert len((tmp_path / "started").read_text().splitlines()) == 4
    assert (tmp_path / "campaign" / "runs.csv").read_bytes() == before


def test_a_kill_loses_nothing_and_repeats_nothing(tmp_path: Path) -> None:
    script = 'echo $CARE_RUN >> started; sleep 0.2; cp drive.bag "$CARE_LOGS"; echo $CARE_RUN >> ended'
    path = campaign_in(tmp_path, command=["sh", "-c", script], runs=8, slots=2)
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "care_tui", "collect", str(path)]
    over: set[int] = set()
    for wanted, sign in ((2, signal.SIGKILL), (4, signal.SIGINT)):
        process = subprocess.Popen(
            command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True
        )
        while len(_done(tmp_path)) < wanted and process.poll() is None:
            time.sleep(0.02)
        process.send_signal(sign)
        process.communicate(timeout=60)
        assert process.returncode == (-9 if sign is signal.SIGKILL else ExitCode.INTERRUPTED)
        assert over <= set(_done(tmp_path))
        over = set(_done(tmp_path))
        before = Counter((tmp_path / "started").read_text().split())
    last = subprocess.run(command, env=environment, capture_output=True, check=False, timeout=120)
    assert last.returncode == ExitCode.OK
    after = Counter((tmp_path / "started").read_text().split())
    assert all(after[str(run)] == before[str(run)] for run in over)
    assert Counter(_done(tmp_path)) == Counter(range(1, 9))
    assert len(table(tmp_path)) == 8
    # Two slots, two kills: what was under way was begun again, and what had not ended was ended with the program.
    assert after.total() <= 8 + 4
    assert set((tmp_path / "ended").read_text().split()) == {str(run) for run in range(1, 9)}


def _done(folder: Path) -> list[int]:
    path = folder / "campaign" / FILE
    lines = path.read_text().split("\n")[1:-1] if path.exists() else []
    return [entry["run"] for entry in map(json.loads, lines) if "run" in entry]


LAUNCHER = """
import subprocess, sys
left = "import os, time; open('elsewhere', 'w').write(str(os.getpid())); time.sleep(60)"
subprocess.Popen([sys.executable, "-c", left], start_new_session=True)
"""
"""Starts a process in a session of its own, as launchers of simulators do."""


def test_commands_do_not_outlive_a_program_that_was_killed(tmp_path: Path) -> None:
    (tmp_path / "launcher.py").write_text(LAUNCHER)
    script = f"echo $$ > pid; {sys.executable} launcher.py; sleep 60 & echo $! > child; wait"
    path = campaign_in(tmp_path, command=["sh", "-c", script])
    command = [sys.executable, "-m", "care_tui", "collect", str(path)]
    process = subprocess.Popen(command, env={**os.environ, "PYTHONPATH": str(ROOT)}, stderr=subprocess.DEVNULL)
    # Only Linux says what belongs to whom once it left its group.
    started = [tmp_path / name for name in ("pid", "child", *(["elsewhere"] if sys.platform == "linux" else []))]
    while not all(file.exists() and file.read_text().strip() for file in started):
        time.sleep(0.02)
    process.kill()
    process.wait()
    for file in started:
        _wait_for_the_end_of(int(file.read_text()))


def _is_zombie(process: int) -> bool:
    try:
        return ") Z " in Path(f"/proc/{process}/stat").read_text()
    except OSError:  # it ended meanwhile, or this is no Linux
        return False


def _wait_for_the_end_of(process: int) -> None:
    deadline = time.monotonic() + 30
    while time.monotonic() < deadline:
        try:
            os.kill(process, 0)
        except ProcessLookupError:
            return
        if _is_zombie(process):
            return
        time.sleep(0.05)
    pytest.fail(f"process {process} is still there")


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux says what belongs to whom")
@pytest.mark.parametrize("program_too", [False, True])
def test_a_mission_does_not_outlive_its_guard(program_too: bool, tmp_path: Path) -> None:
    """Nor does what it started in sessions of its own, or without its environment; also where the whole program goes
    and the same command is given again. A slot never has two missions."""
    (tmp_path / "launcher.py").write_text(LAUNCHER)
    script = (
        "for file in pid child bare elsewhere; do test -e $file && "
        "grep -qs '^State:.[^Z]' /proc/$(cat $file)/status && cat $file >> left; done; touch left; "
        'test -e pid && {{ cp drive.bag "$CARE_LOGS"; exit; }}; '
        f"echo $PPID > guard; sleep 60 & echo $! > child; env -i sleep 60 & echo $! > bare; "
        f"{sys.executable} launcher.py; while ! test -s elsewhere; do sleep 0.02; done; echo $$ > pid; wait"
    )
    path = campaign_in(tmp_path, command=["sh", "-c", script], runs=2)
    command = [sys.executable, "-m", "care_tui", "collect", str(path)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    process = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    while not (tmp_path / "pid").exists() or not (tmp_path / "pid").read_text().strip():
        time.sleep(0.02)
    guard = int((tmp_path / "guard").read_text())
    if program_too:
        process.kill()
        os.kill(guard, signal.SIGKILL)
        process.wait()
        process = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    else:
        os.kill(guard, signal.SIGKILL)
    assert process.wait(60) == ExitCode.OK
    left = (tmp_path / "left").read_text().split()
    bare = (tmp_path / "bare").read_text().strip()
    # Whose guard and program are both gone, and who dropped its environment, nobody knows any more.
    assert [one for one in left if not (program_too and one == bare)] == []
    for name in ("pid", "child", "elsewhere"):
        _wait_for_the_end_of(int((tmp_path / name).read_text()))
    if program_too:
        os.kill(int(bare), signal.SIGKILL)


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A disk of few megabytes."""
    disk = tmp_path / "disk"
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=4m", "none", str(disk)]
    if shutil.which("mount") is None or subprocess.run(mount, capture_output=True, check=False).returncode:
        pytest.skip("needs the right to mount a small disk")
    yield disk
    subprocess.run(["umount", "-l", str(disk)], check=True)


@pytest.mark.parametrize("ends", ["exit 0", "exit 1", "sleep 3600"])
def test_a_full_disk_is_said_to_be_one_and_costs_no_run(
    care: Care, tmp_path: Path, small_disk: Path, ends: str
) -> None:
    script = (
        'cp drive.bag "$CARE_LOGS"; test $CARE_RUN = 3 -a ! -e filled && '
        f"{{{{ touch filled; cat /dev/zero > disk/fill; {ends}; }}}}; true"
    )
    limit_s = 3.0 if ends.startswith("sleep") else 60.0
    path = campaign_in(tmp_path, command=["sh", "-c", script], time_limit_s=limit_s, retries=2, slots=2)
    began = time.monotonic()
    code, _, said = care("collect", path, "--out", small_disk / "campaign")
    assert code == ExitCode.USAGE
    assert "is full" in said or "No space left" in said
    assert "longer than" not in said
    assert time.monotonic() - began < 60.0
    assert 3 not in _done(small_disk)  # the fourth may have ended beside it, before the disk was full
    (small_disk / "fill").unlink()
    code, out, _ = care("collect", path, "--out", small_disk / "campaign", "--json")
    assert (code, json.loads(out)["done"], json.loads(out)["failed"]) == (ExitCode.OK, 4, 0)


def test_a_guard_that_cannot_write_how_it_ended_says_so(tmp_path: Path) -> None:
    for command in ("true", "nothing-of-this-name"):
        words = script_command(guard.__file__, "1", str(tmp_path / "none" / "ended.json"), command)
        with subprocess.Popen(words, stdin=subprocess.PIPE) as process:
            assert process.wait(30) == guard.NO_RECORD + errno.ENOENT


def test_a_run_that_takes_too_long_is_ended_and_the_others_are_made(care: Care, tmp_path: Path) -> None:
    script = 'test $CARE_RUN = 2 && sleep 3600; cp drive.bag "$CARE_LOGS"'
    path = campaign_in(tmp_path, command=["sh", "-c", script], time_limit_s=1.5, retries=0)
    code, told = document(care, path)
    assert code == ExitCode.NOT_EVALUATED
    assert [run["status"] for run in told["runs"]] == ["done", "failed", "done", "done"]
    assert told["runs"][1]["reason"] == "the command took longer than 1.5 s"
    assert len(table(tmp_path)) == 3


def test_a_command_that_fails_is_tried_again_and_then_recorded(care: Care, tmp_path: Path) -> None:
    script = (
        'echo >> tries-$CARE_RUN; test $CARE_RUN = 2 -a $(wc -l < tries-2) = 1 && exit 7; '
        'test $CARE_RUN = 3 && {{ echo "no simulator" >&2; exit 9; }}; cp drive.bag "$CARE_LOGS"'
    )  # fmt: skip
    path = campaign_in(tmp_path, command=["sh", "-c", script], retries=2)
    code, told = document(care, path)
    assert code == ExitCode.NOT_EVALUATED
    assert [(run["status"], run["attempts"]) for run in told["runs"]] == [
        ("done", 1), ("done", 2), ("failed", 3), ("done", 1)
    ]  # fmt: skip
    assert told["runs"][2]["reason"] == "the command failed (exit code 9): no simulator"
    assert document(care, path)[1]["runs"][2]["attempts"] == 3  # not made again unless asked
    assert (tmp_path / "tries-3").read_text().count("\n") == 3
    path = campaign_in(tmp_path, retries=2)
    code, told = document(care, path, "--retry-failed")
    assert (code, told["done"], told["failed"]) == (ExitCode.OK, 4, 0)


@pytest.mark.parametrize(
    ("command", "reason"),
    [
        ("true", "the command left no log in {logs}"),
        ("nothing-of-this-name {params}", "could not be started: No such file or directory: nothing-of-this-name"),
        (["sh", "-c", "echo no log > $CARE_LOGS/a.bag"], "a.bag: "),
    ],
)
def test_what_fails_again_and_again_stops_the_campaign(care: Care, tmp_path: Path, command: Any, reason: str) -> None:
    path = campaign_in(tmp_path, command=command, runs=9, retries=0, stop_after=2)
    code, told = document(care, path)
    assert code == ExitCode.UNREADABLE
    assert "2 runs failed one after the other" in told["stopped"]
    assert reason in told["stopped"]
    assert (told["failed"], told["table"]) == (2, None)


def test_a_robot_that_takes_no_notice_of_its_parameters_stops_the_campaign(care: Care, tmp_path: Path) -> None:
    path = campaign_in(tmp_path, runs=9, at_reference=0.0, stop_after=2)
    (tmp_path / "drive.bag").write_bytes(drive(recorded=True))
    code, told = document(care, path)
    assert code == ExitCode.NOT_EVALUATED
    assert told["stopped"] == "no run drove the values that were asked: does the command read {params}?"
    assert told["runs"][1]["ignored"] == ["max_speed", "controller_frequency"]
    assert {row["max_speed"] for row in table(tmp_path)} == {"0.6"}  # the table has what was driven


def test_an_adaptive_campaign_goes_on_by_what_it_found(care: Care, tmp_path: Path) -> None:
    pytest.importorskip("sklearn")
    path = campaign_in(tmp_path, sampling="adaptive", batch=4, runs=9, tell_apart=["max_speed", "controller_frequency"])
    code, told = document(care, path)
    assert (code, told["planned"], told["done"]) == (ExitCode.OK, 9, 9)
    asked = [
        (row["max_speed"], row["controller_frequency"]) for row in table(tmp_path)
    ]  # the drive holds no parameters: they are those that were asked
    assert len(set(asked)) == 9


def test_another_campaign_does_not_mix_with_the_runs_that_are_there(care: Care, tmp_path: Path) -> None:
    assert care("collect", campaign_in(tmp_path)).code == ExitCode.OK
    assert care("collect", campaign_in(tmp_path, slots=3)).code == ExitCode.OK
    outcome = care("collect", campaign_in(tmp_path, seed=2))
    assert outcome.code == ExitCode.USAGE
    assert "These are the runs of another campaign" in outcome.stderr


def test_two_campaigns_do_not_share_a_folder_at_a_time(care: Care, tmp_path: Path) -> None:
    from care_core.collect.campaign import read_campaign
    from care_core.collect.journal import Journal

    path = campaign_in(tmp_path)
    (tmp_path / "campaign").mkdir()
    with Journal.open(tmp_path / "campaign", read_campaign(path).digest):
        outcome = care("collect", path)
    assert outcome.code == ExitCode.USAGE
    assert "Another 'care collect' is at work there." in outcome.stderr


def test_a_journal_that_was_cut_off_goes_on(care: Care, tmp_path: Path) -> None:
    path = campaign_in(tmp_path)
    assert care("collect", path).code == ExitCode.OK
    journal = tmp_path / "campaign" / FILE
    journal.write_bytes(journal.read_bytes()[:-30])
    code, told = document(care, path)
    assert (code, told["resumed"], told["done"]) == (ExitCode.OK, 3, 4)
    assert sorted(_done(tmp_path)) == [1, 2, 3, 4]


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"rons": 4}, "Unknown key 'rons'. Did you mean 'runs'?"),
        ({"command": None}, "'command' is missing."),
        ({"runs": 0}, "'runs': Input should be greater than or equal to 1."),
        ({"command": "drive {parms}"}, "The command names '{parms}'. Did you mean 'params'?"),
        ({"command": "drive {params!r}"}, "a placeholder is a name in brackets"),
        ({"command": "drive 'a"}, "The command cannot be split into words"),
        ({"options": ["max_sped"]}, "The profile has no parameter 'max_sped'. Did you mean 'max_speed'?"),
        ({"options": {"max_speed": [0.1, 5.0]}}, "goes beyond the profile's 0.2 to 1.2"),
        ({"options": {"max_speed": [0.7, 1.0]}}, "The reference of max_speed is 0.6, outside 0.7 to 1."),
        ({"limits": ["max_speed <= 0.5"]}, "The reference breaks the limit 'max_speed <= 0.5'."),
        ({"limits": ["max_speed = 0.5"]}, "'max_speed = 0.5' is not a limit."),
        ({"parameters": "missing.yaml"}, "Cannot read the configuration"),
        ({"profile": "corier"}, "There is no profile 'corier'."),
        ({"sampling": "sobel"}, "'sampling': Input should be"),
        ({"tell_apart": ["max_speed", "patience"]}, "belong to 'sampling: adaptive'"),
        ({"sampling": "adaptive", "tell_apart": ["max_speed", "patience"]}, "'patience' does not vary"),
    ],
)
def test_what_is_wrong_with_a_campaign_is_said(care: Care, tmp_path: Path, changes: dict[str, Any], said: str) -> None:
    outcome = care("collect", campaign_in(tmp_path, **changes))
    assert outcome.code == ExitCode.USAGE
    assert said in outcome.stderr
    assert outcome.stderr.count("\n") == 1
    assert not (tmp_path / "campaign").exists()


def test_a_profile_of_a_table_has_no_logs_to_collect(care: Care, tmp_path: Path) -> None:
    (tmp_path / "table").mkdir()
    option = "{role: option, range: [0, 1], default: 0.5, parameter: /n/a}"
    (tmp_path / "table" / "profile.yaml").write_text(
        f'schema_version: 1\nname: table\nversion: "1"\nplatform: a table\nvariables: {{a: {option}}}\n'
    )
    outcome = care("collect", campaign_in(tmp_path, profile=str(tmp_path / "table")))
    assert outcome.code == ExitCode.USAGE
    assert "Profile 'table' reads no logs." in outcome.stderr


def test_a_safety_option_varies_only_where_it_is_named(care: Care, tmp_path: Path) -> None:
    outcome = care("collect", campaign_in(tmp_path, options=None, runs=2), "--plan")
    assert "low_voltage_stop does not vary: a safety option" in outcome.stderr
    assert "low_voltage_stop" not in outcome.stdout
    assert "low_voltage_stop" in care("collect", campaign_in(tmp_path, options=["low_voltage_stop"]), "--plan").stdout


def test_the_json_is_of_its_schema(care: Care, tmp_path: Path) -> None:
    validate = pytest.importorskip("jsonschema").validate
    _, told = document(care, campaign_in(tmp_path))
    validate(told, json.loads(care("schema", "collect").stdout))


def test_a_parameter_that_no_file_holds_is_found_before_the_first_run(care: Care, tmp_path: Path) -> None:
    path = campaign_in(tmp_path)
    (tmp_path / "courier.yaml").write_text("courier: {controller: {max_speed: 0.6}}\n")
    outcome = care("collect", path)
    assert outcome.code == ExitCode.USAGE
    assert "No file holds /courier/controller/frequency." in outcome.stderr
    assert not (tmp_path / "campaign").exists()


def test_a_journal_that_is_damaged_inside_is_refused_and_kept(care: Care, tmp_path: Path) -> None:
    path = campaign_in(tmp_path)
    assert document(care, path)[0] == ExitCode.OK
    journal = tmp_path / "campaign" / FILE
    lines = journal.read_bytes().splitlines(keepends=True)
    damaged = b"".join([*lines[:2], b'{"run": 1, "attem\n', *lines[2:]])
    journal.write_bytes(damaged)
    code, _, err = care("collect", path)
    assert code == ExitCode.USAGE
    assert "line 3" in err
    assert journal.read_bytes() == damaged
