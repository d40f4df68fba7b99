"""What a hostile operator may type or name: one sentence, the right exit code, nothing on stdout, nothing lost."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import jsonschema
import pytest

from care_core.configs.loading import read_config
from care_core.errors import ConfigError, UsageError
from care_core.files import bundled, write_atomically
from tests.conftest import Care

ROOT = Path(__file__).parents[2]
SAMPLE = ROOT / "samples" / "arducopter_failed.BIN"
GOOD = ROOT / "tests" / "data" / "arducopter_good.BIN"
DRIVE = ROOT / "samples" / "owlat_failed.bag"
"""The quickest to triage."""


@pytest.fixture
def log(tmp_path: Path) -> Path:
    return Path(shutil.copy(SAMPLE, tmp_path / "flight.BIN"))


def refused(care: Care, code: int, words: str, *args: object) -> None:
    outcome = care(*map(str, args))
    assert (outcome.code, outcome.stdout) == (code, ""), outcome
    lines = outcome.stderr.splitlines()
    (said,) = [line for line in lines if not line.endswith(" ...")]  # a slow machine says what it is at
    assert said.startswith("care: ")
    assert words in said


@pytest.mark.parametrize("command", ["triage", "params", "whatif", "verify", "apply"])
def test_a_log_is_never_overwritten(care: Care, log: Path, tmp_path: Path, command: str) -> None:
    digest = hashlib.sha256(log.read_bytes()).hexdigest()
    other, link = tmp_path / "old.bag", tmp_path / "link.json"
    other.write_bytes(b"#ROSBAG V1.2\n")
    link.symlink_to(log)
    args: list[object] = {"whatif": [log, "--set", "WPNAV_SPEED=500"], "verify": ["r.json", log]}.get(command, [log])
    if command == "apply":
        args = [report_of(care, log, tmp_path), tmp_path / "a.param"]
        (tmp_path / "a.param").write_text("LAND_SPEED,16\n")
    for target in (log, other, link):
        outcome = care(command, *args, "--out", target)
        assert (outcome.code, outcome.stdout) == (2, "")
        assert "logs are never overwritten" in outcome.stderr
    assert hashlib.sha256(log.read_bytes()).hexdigest() == digest
    assert other.read_bytes() == b"#ROSBAG V1.2\n"


def report_of(care: Care, log: Path, folder: Path) -> Path:
    assert care("triage", log, "--no-history", "--out", folder / "report.json").code == 1
    return folder / "report.json"


def test_a_report_is_not_overwritten_by_its_own_verification(care: Care, log: Path, tmp_path: Path) -> None:
    report = report_of(care, log, tmp_path)
    refused(care, 2, "That is the report itself", "verify", report, GOOD, "--out", report)
    assert care("verify", report, GOOD, "--no-history", "--out", tmp_path / "v.json").code == 0
    assert json.loads((tmp_path / "v.json").read_text())["schema"] == "care.verify/1"


def test_a_link_is_not_written_through_and_a_device_stays_one(tmp_path: Path) -> None:
    (tmp_path / "real.yaml").write_text("old")
    (tmp_path / "link.yaml").symlink_to("real.yaml")
    (tmp_path / "nowhere.yaml").symlink_to("new.yaml")
    for name in ("link.yaml", "nowhere.yaml"):
        with pytest.raises(UsageError, match="links are not written through"):
            write_atomically(tmp_path / name, "new")
        assert (tmp_path / name).is_symlink()
    assert (tmp_path / "real.yaml").read_text() == "old"
    assert not (tmp_path / "new.yaml").exists()
    write_atomically(Path(os.devnull), "gone")
    assert Path(os.devnull).is_char_device()


@pytest.mark.parametrize("command", ["triage", "inspect", "params", "diff"])
def test_a_pipe_is_not_waited_for(care: Care, tmp_path: Path, command: str) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    args = [pipe, SAMPLE] if command == "diff" else [pipe]
    refused(care, 2 if command == "diff" else 4, "no file but a pipe", command, *args)


def test_what_can_be_compared(care: Care, tmp_path: Path) -> None:
    from tests.rewritten import write_text

    text = write_text(tmp_path / "a.log", SAMPLE, only=("PARM",))
    assert care("diff", text, SAMPLE).code == 0
    (tmp_path / "empty.param").write_text("")
    refused(care, 2, "The file is empty", "diff", tmp_path / "empty.param", SAMPLE)
    refused(care, 4, "A folder, not a log", "diff", tmp_path, SAMPLE)


def bomb(first: str, rest: str) -> str:
    return f"a0: &a0 {first}\n" + "".join(f"a{n}: &a{n} {rest.replace('?', f'*a{n - 1}')}\n" for n in range(1, 40))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (bomb("{x: 1}", "{p: ?, q: ?}"), "more than 200000 values, its aliases followed"),
        (bomb("{}", "{p: ?, q: ?}"), "more than 200000 values, its aliases followed"),
        (bomb("[1, 2]", "[?, ?]"), "more than 200000 values, its aliases followed"),
        ("a: &a\n  b: *a\n", "an alias stands inside"),
        ("a: &a [*a]\n", "an alias stands inside"),
        ("[" * 20_000, "nested deeper than 64 levels"),
        ("a:\t1\n\tb: 2\n", "Not valid YAML: found a tab character"),
        ("a: 1\n---\nb: 2\n", "expected a single document in the stream but found another document"),
        ("- 1\n", "no mapping of names"),
        ("a: " + "1" * 1_000_000, "larger than 1 MB"),
    ],
)
def test_yaml_that_is_no_configuration(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "a.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=words) as caught:
        read_config(path)
    assert caught.value.hint


def test_odd_values_of_a_configuration(tmp_path: Path) -> None:
    path = tmp_path / "a.yaml"
    path.write_text("a: 1\na: 2\nb: -.INF\nc: 0x1F\ne: !!python/object/apply:os.system [x]\nf: !foo 3\n")
    values = {name: setting.value for name, setting in read_config(path).items()}
    assert values == {"a": 2, "b": float("-inf"), "c": 31, "f": "3"}


def test_names_of_files_do_not_steer_the_terminal(care: Care, tmp_path: Path) -> None:
    for name in ("e\x1b[31m[red]x\x07\n.BIN", os.fsdecode(b"n\xff\xfe.BIN")):
        path = tmp_path / name
        try:
            shutil.copy(DRIVE, path)
        except OSError:
            pytest.skip("the file system refuses such names")
        for command in (("triage",), ("triage", "--json"), ("triage", "--markdown"), ("inspect",)):
            outcome = care(*command, path)
            assert outcome.code in (0, 1)
            assert "\x1b" not in outcome.stdout + outcome.stderr
            outcome.stdout.encode("utf-8")
        assert care("history", "--json").code == 0


@pytest.mark.parametrize("closed", ["stdout", "stderr"])
def test_a_closed_stream_is_no_error(closed: str) -> None:
    redirect = {"stdout": ">&-", "stderr": "2>&- >/dev/null"}[closed]
    command = f'"{sys.executable}" -c "from care_tui.cli import main; main()" inspect "{DRIVE}" {redirect}'
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(["sh", "-c", command], stderr=subprocess.PIPE, timeout=60, env=environment, check=False)
    assert (done.returncode, done.stderr) == (0, b"")


def test_every_json_is_as_published(care: Care, log: Path, tmp_path: Path) -> None:
    report = report_of(care, log, tmp_path)
    printed = {
        "triage": care("triage", log, "--json"),
        "inspect": care("inspect", log, "--json"),
        "whatif": care("whatif", log, "--set", "WPNAV_SPEED=500", "--json"),
        "verify": care("verify", report, GOOD, "--json"),
        "history": care("history", "--json"),
    }
    for name, outcome in printed.items():
        document = json.loads(outcome.stdout, parse_constant=lambda text: pytest.fail(f"{text} is no JSON"))
        jsonschema.validate(document, json.loads(care("schema", name).stdout))


def test_ingest_does_not_overwrite_a_log(care: Care, log: Path, tmp_path: Path) -> None:
    table = Path(shutil.copy(SAMPLE, tmp_path / "runs.csv"))
    refused(care, 2, "logs are never overwritten", "ingest", log, "--profile", "arducopter", "--out", table)
    assert table.read_bytes() == SAMPLE.read_bytes()


def test_summaries_of_commands_are_whole_sentences(care: Care) -> None:
    listing = care("--help").stdout.partition("Commands:")[2]
    assert "..." not in listing
    assert all(line.endswith(".") for line in listing.strip().splitlines())


LONG = 300 * "a"


@pytest.mark.parametrize(
    "words",
    [("triage", f"{LONG}.BIN"), ("watch", LONG, "--once"), ("fleet", LONG), ("diff", LONG, LONG),
     ("bundle", bundled("samples", "arducopter_failed.BIN"), "-o", f"{LONG}.zip")],
    ids=lambda words: words[0],
)  # fmt: skip
def test_a_name_that_no_file_can_have_is_said_to_be_one(care: Care, words: tuple[str, ...]) -> None:
    ended = care(*words)
    assert ended.code == 2
    assert "longer than names of files can be. Check the path." in ended.stderr


@pytest.fixture
def closed(log: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The log as it is for a user who may not read it, whoever runs the tests."""
    may, reads = os.access, os.open

    def opened(path: str | Path, flags: int, *more: int, **others: int) -> int:
        if Path(path) == log and not flags & os.O_WRONLY:
            raise PermissionError(13, "Permission denied", str(path))
        return reads(path, flags, *more, **others)

    def access(path: str | Path, mode: int, **others: bool) -> bool:
        return not (Path(path) == log and mode & os.R_OK) and may(path, mode, **others)

    monkeypatch.setattr(os, "open", opened)
    monkeypatch.setattr(os, "access", access)
    return log


@pytest.mark.parametrize("words", [["triage"], ["inspect"], [], ["triage", GOOD, "--since"], ["bundle"]])
def test_a_log_that_may_not_be_read_is_said_to_be(care: Care, closed: Path, words: list[str]) -> None:
    refused(care, 4, f"{closed}: No permission to read the file. Check its owner and mode.", *words, closed)


def test_a_log_of_a_folder_that_may_not_be_read_is_a_line_of_it(care: Care, closed: Path) -> None:
    shutil.copy(GOOD, closed.parent / "good.BIN")
    outcome = care("triage", closed.parent, "--no-history")
    assert outcome.code == 4
    assert "UNREADABLE     No permission to read the file." in outcome.stdout
    assert "good.BIN" in outcome.stdout


def test_a_log_in_a_folder_that_is_closed_is_said_to_be(care: Care, log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    looks = os.stat

    def stat(path: object, *more: object, **others: object) -> object:
        if str(path) == str(log):
            raise PermissionError(13, "Permission denied", str(path))
        return looks(path, *more, **others)  # type: ignore[arg-type]

    monkeypatch.setattr(os, "stat", stat)
    refused(care, 4, f"{log}: No permission to look there.", "triage", log)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["-v"], "There is no option '-v'. Did you mean '--version'?"),
        (["--helpp"], "There is no option '--helpp'. Did you mean '--help'?"),
        (["--versoin"], "There is no option '--versoin'. Did you mean '--version'?"),
        (["triage", "--jsn"], "There is no option '--jsn'. Did you mean '--json'?"),
        (["-q"], "There is no option '-q'. 'care --help' lists what there is."),
        (["triage", "--bogus"], "There is no option '--bogus'. 'care triage --help' lists what there is."),
        (["compare", "a"], "Missing argument 'B'. 'care compare --help' lists what there is."),
        (["profiles", "show", "--xyz"], "'care profiles show --help' lists what there is."),
    ],
)
def test_a_command_line_that_cannot_be_taken_is_told_in_a_sentence(care: Care, words: list[str], says: str) -> None:
    refused(care, 2, says, *words)


@pytest.mark.parametrize("word", ["-h", "--help"])
def test_the_help_of_the_program_is_under_both_names(care: Care, word: str) -> None:
    outcome = care(word)
    assert (outcome.code, outcome.stderr) == (0, "")
    assert outcome.stdout.startswith("Usage: care [OPTIONS] COMMAND")
