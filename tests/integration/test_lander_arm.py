"""The simulated lander arm: the paper's failed excavation, its cause, and the repair driven."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from care_core.errors import ExitCode
from care_core.files import bundled
from care_core.profile.store import load_profile
from care_samples.arm.__main__ import START, main
from care_samples.arm.excavation import DEFAULTS, RANGES, SUCCEEDED, Arm, Soil
from care_samples.arm.recording import NODE, write_bag
from care_samples.parameters import read_parameters
from tests.conftest import Care

SAMPLE = bundled("samples", "owlat_failed.bag")


def test_the_failed_excavation_is_laid_to_the_force_threshold_by_its_path(care: Care) -> None:
    outcome = care("triage", SAMPLE, "--json")
    assert outcome.code == ExitCode.FAULT
    told = json.loads(outcome.stdout)
    assert told["profile"]["name"] == "owlat"
    (fault,) = told["faults"]
    assert fault["objective"] == "mission_success"
    assert fault["causes"][0]["option"] == "force_threshold"
    assert fault["causes"][0]["path"][:2] == ["force_threshold", "surface_found"]
    assert fault["causes"][0]["path"][-1] == "mission_success"
    assert [change["option"] for change in told["fix"]["changes"]] == ["force_threshold"]


def test_the_suggested_threshold_finds_the_surface(care: Care) -> None:
    told = json.loads(care("triage", SAMPLE, "--json").stdout)
    suggested = {change["option"]: change["to"] for change in told["fix"]["changes"]}
    driven = {name: float(value) for name, value in told["config"].items()}
    repaired = [Arm({**driven, **suggested}, Soil.of(seed)).run().is_success for seed in range(900, 920)]
    failed = [Arm(driven, Soil.of(seed)).run().is_success for seed in range(900, 920)]
    assert sum(repaired) >= 18
    assert sum(failed) <= 4


def test_a_threshold_that_is_too_low_takes_the_shaking_arm_for_contact() -> None:
    story = Arm({"force_threshold": 3.0, "approach_speed": 0.05, "joint_speed": 0.1}, Soil.of(1)).run()
    search = next(one for one in story.commands if one.name == "ARM_MOVE_CARTESIAN_GUARDED")
    assert search.found
    assert search.height > Soil.of(1).surface
    assert not story.is_success


@pytest.mark.parametrize("seed", range(4))
def test_the_reference_takes_its_sample(seed: int) -> None:
    story = Arm({}, Soil.of(seed)).run()
    assert story.is_success
    assert [one.status for one in story.commands] == [SUCCEEDED] * 5


def test_the_command_writes_the_same_bag_for_the_same_seed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--start", str(tmp_path)]) == 0
    assert read_parameters(tmp_path / "arm.yaml", NODE, DEFAULTS, RANGES) == DEFAULTS
    made = []
    for seed in ("3", "3", "4"):
        log = tmp_path / "a.bag"
        log.unlink(missing_ok=True)
        assert main(["--params", str(tmp_path / "arm.yaml"), "--log", str(log), "--seed", seed]) == 0
        made.append(log.read_bytes())
    assert made[0] == made[1] != made[2]
    assert "ARM_MOVE_CARTESIAN_GUARDED  done" in capsys.readouterr().out


def test_the_bundled_profile_is_that_of_the_files_to_begin_with_and_says_where_it_comes_from(tmp_path: Path) -> None:
    folder = bundled("profiles", "owlat")
    assert (folder / "profile.yaml").read_text() == (START / "profile.yaml").read_text()
    assert "not validated on the testbed" in " ".join((folder / "MODEL_CARD.md").read_text().split())
    assert load_profile("owlat").model.training.runs == 300


def test_a_log_of_another_robot_is_not_taken_for_an_arm(tmp_path: Path) -> None:
    from care_core.extract.select import choose_profile, sound_profiles
    from care_core.logs.opening import open_log

    write_bag(tmp_path / "arm.bag", Arm({}, Soil.of(1)).run(), DEFAULTS)
    logs = {"owlat": tmp_path / "arm.bag", "move_base": bundled("samples", "move_base_drive.bag")}
    for name, log in logs.items():
        profile, choice = choose_profile(open_log(log), sound_profiles()[0])
        assert profile is not None
        assert (profile.schema.name, choice.fit.verdict) == (name, "fits")
