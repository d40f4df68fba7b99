"""`--since`: a good run is what the next one is judged against, a failed one and another robot's are not."""

from __future__ import annotations

from pathlib import Path

from care_core.errors import ExitCode
from tests.conftest import Care

ROOT = Path(__file__).parents[2]
SAMPLES = ROOT / "samples"
SLOW, GOOD = SAMPLES / "arducopter_failed.BIN", ROOT / "tests" / "data" / "arducopter_good.BIN"


def test_a_good_run_is_the_reference_and_that_is_said_at_the_top(care: Care) -> None:
    done = care("triage", SLOW, "--since", GOOD, "--no-history")
    assert done.code == ExitCode.FAULT
    assert "Judged against the configuration of arducopter_good.BIN" in done.stdout.partition("Next:")[0]


def test_a_run_that_failed_itself_is_no_reference(care: Care) -> None:
    done = care("triage", SLOW, "--since", SAMPLES / "arducopter_motor.BIN", "--no-history")
    alone = care("triage", SLOW, "--no-history")
    assert done.code == alone.code == ExitCode.FAULT
    assert done.stdout.splitlines()[:4] == alone.stdout.splitlines()[:4]
    assert "it has a fault itself" in done.stdout


def test_another_kind_of_robot_has_no_good_run_to_compare_with(care: Care) -> None:
    for name, kind in (("ardurover_failed.BIN", "rover under ArduPilot"), ("nav2_good.mcap", "robot under ROS")):
        done = care("triage", SLOW, "--since", SAMPLES / name, "--no-history")
        assert done.code == ExitCode.USAGE
        said = f"the log of a {kind}, and this one is of a copter under ArduPilot. Name a good run of the same robot."
        assert said in done.stderr
