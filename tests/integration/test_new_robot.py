"""The bundled robot; every command of docs/new-robot.md runs, with a small campaign in place of the large one."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import pytest

from benchmarks.tools.documents import ROOT, prepare, printed, sessions
from care_core import plain_yaml
from care_core.collect.campaign import Campaign, read_campaign
from care_core.collect.sampling import points
from care_core.logs.opening import open_log
from care_core.profile.reading import read_schema
from care_core.tables.rows import TableRow, rows_of, write_table
from care_samples.parameters import read_parameters
from care_samples.robot.__main__ import main
from care_samples.robot.mission import DEFAULTS, Robot
from care_samples.robot.ranges import RANGES
from care_samples.robot.recording import NODE, write_bag, write_mcap
from care_samples.robot.starting import write_robot
from care_samples.robot.world import Conditions

pytestmark = pytest.mark.long

DOCUMENT = ROOT / "docs" / "new-robot.md"
VARIED = ("slow_distance", "max_speed", "patience", "controller_frequency")


def reduced(campaign: Path) -> None:
    """Four runs of four options."""
    data = plain_yaml.editable(campaign.read_text(encoding="utf-8"))
    data.update(runs=4, options=list(VARIED))
    campaign.write_text(plain_yaml.written(data), encoding="utf-8")


def enlarge(table: Path, campaign: Campaign, folder: Path) -> None:
    """More runs into the table, made in this process: starting a program for each is what takes the time."""
    rows: list[TableRow] = rows_of(_driven(campaign, campaign.space.reference, 500, folder), campaign.schema)
    for seed, config in enumerate(points(campaign.space, "sobol", 44, 0.5, 1, alike=True)):
        rows += rows_of(_driven(campaign, config, seed, folder), campaign.schema)
    write_table(table, rows, campaign.schema)


def _driven(campaign: Campaign, config: Mapping[str, float], seed: int, folder: Path) -> Path:
    options = campaign.schema.variables
    parameters = {options[name].parameters[0].removeprefix(f"/{NODE}/"): value for name, value in config.items()}
    path = folder / f"{seed}.bag"
    write_bag(path, Robot(parameters, Conditions.of(seed)).run(), {**DEFAULTS, **parameters})
    return path


def test_every_command_of_the_tutorial_runs(tmp_path: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    for name in ("scipy", "sklearn", "causallearn", "ananke"):
        pytest.importorskip(name)
    prepare(tmp_path)
    said: dict[str, str] = {}
    for session in sessions(DOCUMENT.read_text(encoding="utf-8"), slow=True):
        for command in session.commands:
            less = ""
            if command.startswith("care train"):
                campaign = read_campaign(tmp_path / "courier" / "campaign.yaml")
                enlarge(tmp_path / "courier/campaign/runs.csv", campaign, tmp_path_factory.mktemp("drives"))
                less = " --resamples 2"
            said[command] = printed(command + less, tmp_path)
            assert "Traceback" not in said[command], command
            assert "care: " not in said[command], (command, said[command])
            if "--start" in command:
                reduced(tmp_path / "courier" / "campaign.yaml")
    assert "4 of 4 runs have a log" in said["care collect courier/campaign.yaml"]
    triage = next(text for command, text in said.items() if command.startswith("care triage late.bag"))
    assert re.search(r"FAULT: too slow: ", triage)
    assert re.search(r"Change slow_distance 0\.8 -> 0\.\d+", triage)
    verified = next(text for command, text in said.items() if command.startswith("care verify"))
    assert "the change was made" in verified
    assert re.search(r"OK +mission_time", verified)


def test_both_kinds_of_log_say_the_same(tmp_path: Path) -> None:
    parameters = {**DEFAULTS, "controller/slow_distance": 0.7, "controller/frequency": 7}
    story = Robot(parameters, Conditions.of(4)).run()
    found = []
    for ros, name, write in ((1, "a.bag", write_bag), (2, "a.mcap", write_mcap)):
        write_robot(tmp_path / str(ros), ros)
        write(tmp_path / name, story, parameters)
        (row,) = rows_of(tmp_path / name, read_schema(tmp_path / str(ros) / "profile.yaml"))
        found.append({key: value for key, value in row.items() if not key.startswith("log")})
    assert found[0] == pytest.approx(found[1], rel=1e-6, nan_ok=True)
    assert found[0]["slow_distance"] == 0.7
    assert found[0]["controller_frequency"] == 7
    assert all(value is not None for value in found[0].values())


@pytest.mark.parametrize("name", ["a.bag", "a.mcap"])
def test_a_mission_depends_on_its_parameters_and_seed_alone(tmp_path: Path, name: str) -> None:
    write_robot(tmp_path, 1)
    made = []
    for seed in (3, 3, 4):
        log = tmp_path / name
        log.unlink(missing_ok=True)
        words = ["--params", str(tmp_path / "courier.yaml"), "--log", str(log), "--seed", str(seed)]
        assert main(words) == 0
        made.append(log.read_bytes())
    assert made[0] == made[1] != made[2]


def test_a_robot_that_is_too_slow_or_too_wide_fails_its_mission() -> None:
    def outcome(**changes: float) -> tuple[int, str]:
        given = {name.replace("__", "/"): value for name, value in changes.items()}
        story = Robot(given, Conditions.of(1)).run()
        return story.reached, story.results[-1][2]

    assert outcome() == (5, "succeeded")
    assert outcome(planner__footprint_padding=0.4)[1] == "aborted"
    assert outcome(battery__low_voltage_stop=12.4)[1] == "aborted"
    assert outcome(controller__max_speed=0.2, controller__slow_distance=1.5)[1] == "preempted"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("other: {}", "there are no parameters of 'courier'"),
        ("courier: {planner: {radius: 1}}", "there is no parameter planner/radius"),
        ("courier: {planner: {obstacle_weight: many}}", "obstacle_weight is many, not 0 to 30"),
        ("courier: {planner: {obstacle_weight: 31}}", "obstacle_weight is 31, not 0 to 30"),
        ("courier: [", "this is no YAML"),
    ],
)
def test_the_robot_refuses_what_it_cannot_drive(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, said: str
) -> None:
    (tmp_path / "p.yaml").write_text(text)
    assert main(["--params", str(tmp_path / "p.yaml"), "--log", str(tmp_path / "a.bag")]) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "a.bag").exists()


def test_the_files_to_begin_with_hold_the_defaults(tmp_path: Path) -> None:
    for ros in (1, 2):
        write_robot(tmp_path / str(ros), ros)
        assert read_parameters(tmp_path / str(ros) / "courier.yaml", NODE, DEFAULTS, RANGES) == DEFAULTS
        campaign = read_campaign(tmp_path / str(ros) / "campaign.yaml")
        assert len(campaign.space.axes) == len(DEFAULTS)
        options = campaign.schema.options
        assert {option.name: option.default for option in options} == dict(campaign.space.reference)


def test_healthy_drives_raise_hardly_an_alarm(tmp_path: Path) -> None:
    from care_core.ecosystems.examine import examine
    from care_core.ecosystems.registry import run_model

    alarms = 0
    for seed in range(12):
        write_bag(tmp_path / f"{seed}.bag", Robot({}, Conditions.of(seed)).run(), DEFAULTS)
        alarms += bool(examine(run_model(open_log(tmp_path / f"{seed}.bag"))).findings)
    assert alarms <= 1
