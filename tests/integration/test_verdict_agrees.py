"""The verdict, the objectives, the findings, the explanations and the exit code of a log contradict nowhere."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain
from pathlib import Path

import pytest

import care_core
from benchmarks.wild_logs import wild_files
from care_core import Request
from care_core.errors import CareError
from care_core.files import bundled
from care_core.report.document import build_document
from tests.contradictions import contradictions
from tests.restamped import dataflash_with
from tests.whole import one_in

pytestmark = pytest.mark.long

DATA = Path(__file__).parents[1] / "data"
SAMPLES = (
    "arducopter_failed.BIN", "arducopter_motor.BIN", "ardurover_failed.BIN", "arduplane_elevator.BIN",
    "arduplane_failed.BIN", "ardusub_failed.BIN", "quadplane_failed.BIN", "px4_failed.ulg", "px4_motor.ulg",
    "move_base_drive.bag", "nav2_failed.mcap", "nav2_good.mcap", "nav2_stall.mcap", "nav2_mppi_failed.mcap",
    "nav2_rpp_failed.mcap", "nav2_stock_failed.mcap", "owlat_failed.bag",
)  # fmt: skip
WILD, KNOWN = 3, 9
"""Of the logs from elsewhere, and of the recorded runs with known truth, one of so many is looked at."""


def told_of(path: Path) -> list[str]:
    """What contradicts in the report of a log, nothing where it is refused."""
    try:
        return contradictions(build_document(care_core.triage(path).diagnosis))
    except CareError:
        return []


@pytest.mark.parametrize("name", SAMPLES)
def test_a_sample_contradicts_itself_nowhere(name: str) -> None:
    assert told_of(bundled("samples", name)) == []


@pytest.mark.parametrize("name", ["arducopter_good.BIN", "move_base_good.bag"])
def test_a_good_run_contradicts_itself_nowhere(name: str) -> None:
    assert told_of(DATA / name) == []


@pytest.mark.parametrize(
    ("name", "limit_s"), [("nav2_mppi_failed.mcap", 30.0), ("arduplane_failed.BIN", 200.0), ("nav2_failed.mcap", 10.0)]
)
def test_a_limit_out_of_reach_contradicts_nothing(name: str, limit_s: float) -> None:
    asked = Request(bundled("samples", name), thresholds={"mission_time": limit_s})
    report = build_document(care_core.triage(asked).diagnosis)
    assert report.abstained
    assert contradictions(report) == []


@pytest.mark.parametrize("share", [0.4, 0.8, 0.97])
@pytest.mark.parametrize("name", ["arducopter_motor.BIN", "ardurover_failed.BIN", "nav2_stall.mcap"])
def test_a_log_that_breaks_off_contradicts_itself_nowhere(tmp_path: Path, name: str, share: float) -> None:
    whole = bundled("samples", name).read_bytes()
    cut = tmp_path / name
    cut.write_bytes(whole[: int(share * len(whole))])
    assert told_of(cut) == []


@pytest.mark.parametrize(("message", "field", "value"), [("BAT", "Volt", 11.2), ("ERR", "Subsys", 12.0)])
def test_a_log_with_a_planted_fault_contradicts_itself_nowhere(
    tmp_path: Path, message: str, field: str, value: float
) -> None:
    for name in ("arducopter_failed.BIN", "arducopter_motor.BIN"):
        made = tmp_path / name
        made.write_bytes(dataflash_with(bundled("samples", name), message, **{field: value}))
        assert told_of(made) == [], name


def test_recorded_logs_contradict_themselves_nowhere(recorded: Path) -> None:
    found = {path: names for path in _recorded(recorded) if (names := told_of(path))}
    assert not found


def _recorded(folder: Path) -> Iterator[Path]:
    """Logs from elsewhere, and some of the runs whose truth is known."""
    known = sorted((*folder.glob("data/**/*.BIN"), *folder.glob("data/**/*.bag")))
    others = (wild_files(folder / name) for name in ("logs", "logs_known", "attack") if (folder / name).is_dir())
    yield from one_in(WILD, chain.from_iterable(others))
    yield from one_in(KNOWN, known)
