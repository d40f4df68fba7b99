"""A broken clock or a dead sensor: what is computed from it is not evaluated, with the reason."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from care_core.errors import ExitCode
from care_core.files import bundled
from tests import restamped
from tests.conftest import Care
from tests.groundstation import write_tlog

DATA = Path(__file__).parents[1] / "data"
GOOD, FAILED = DATA / "arducopter_good.BIN", bundled("samples", "arducopter_failed.BIN")
DRIVE = DATA / "move_base_good.bag"

CLOCKS: dict[str, Callable[[int], int]] = {
    "constant": lambda stamp: 60_000_000,
    "zero": lambda stamp: 0,
    "milliseconds": lambda stamp: stamp // 1000,
    "a thousand times too fast": lambda stamp: stamp * 1000 % 2**63,
    "standing still half the time": lambda stamp: stamp - stamp % 40_000_000,
}


def written(folder: Path, source: Path, clock: Callable[[int], int], kind: str) -> Path:
    path = folder / f"log.{kind}"
    if kind == "tlog":
        heard = write_tlog(folder / "heard.tlog", source, np.random.default_rng(0))
        path.write_bytes(restamped.telemetry(heard, clock))
    elif kind == "mcap":
        path.write_bytes(restamped.mcap(source, lambda time_ns: 1000 * clock(time_ns // 1000)))
    else:
        path.write_bytes(restamped.dataflash(source, clock))
    return path


def judged(care: Care, path: Path, profile: str = "arducopter") -> tuple[int, dict[str, Any]]:
    code, out, err = care("triage", path, "--json", "--profile", profile)
    if code in (ExitCode.USAGE, ExitCode.UNREADABLE):  # no mission is found, or not even a log, which is said
        assert "mission" in err or "Not a log" in err or "no sound MAVLink packet" in err, err
        return code, {}
    return code, {one["name"]: one for one in json.loads(out)["objectives"]}


def check_not_judged(code: int, objectives: dict[str, Any]) -> None:
    assert code not in (ExitCode.OK, ExitCode.FAULT), objectives
    for one in objectives.values():
        assert one["status"] == "not_evaluated", one
        assert one["reason"]


@pytest.mark.parametrize("clock", CLOCKS)
@pytest.mark.parametrize("source", [GOOD, FAILED], ids=["good", "failed"])
@pytest.mark.parametrize("kind", ["BIN", "tlog"])
def test_a_flight_whose_clock_is_broken(care: Care, tmp_path: Path, kind: str, source: Path, clock: str) -> None:
    check_not_judged(*judged(care, written(tmp_path, source, CLOCKS[clock], kind)))


@pytest.mark.parametrize("clock", ["constant", "zero", "milliseconds"])
def test_a_drive_whose_clock_is_broken(care: Care, tmp_path: Path, clock: str) -> None:
    check_not_judged(*judged(care, written(tmp_path, DRIVE, CLOCKS[clock], "mcap"), "move_base"))


@pytest.mark.parametrize("source", [GOOD, FAILED], ids=["good", "failed"])
@pytest.mark.parametrize(
    "values",
    [{"Curr": 0.0, "EnrgTot": 0.0}, {"Curr": 30.0, "EnrgTot": 5.0}, {"Curr": math.nan, "EnrgTot": math.nan}],
    ids=["zero", "stuck", "nan"],
)
def test_a_dead_current_sensor(care: Care, tmp_path: Path, source: Path, values: dict[str, float]) -> None:
    path = tmp_path / "a.BIN"
    path.write_bytes(restamped.dataflash_with(source, "BAT", **values))
    sound = judged(care, source)[1]
    code, objectives = judged(care, path)
    energy = objectives.pop("energy")
    assert code != ExitCode.OK
    assert energy["status"] == "not_evaluated"
    assert "current" in energy["reason"] or "not accomplished" in energy["reason"]
    assert {name: one["status"] for name, one in objectives.items()} == {
        name: sound[name]["status"] for name in objectives
    }


def test_energy_is_integrated_where_the_counter_is_no_number(care: Care, tmp_path: Path) -> None:
    path = tmp_path / "a.BIN"
    path.write_bytes(restamped.dataflash_with(GOOD, "BAT", EnrgTot=math.nan))
    sound, energy = (judged(care, log)[1]["energy"] for log in (GOOD, path))
    assert energy["status"] == "ok"
    assert energy["value"] == pytest.approx(sound["value"], rel=0.05)


def test_a_position_that_never_changes(care: Care, tmp_path: Path) -> None:
    path = tmp_path / "a.BIN"
    path.write_bytes(restamped.dataflash_with(GOOD, "POS", Lat=-353632610, Lng=1491652300, RelHomeAlt=10.0))
    code, objectives = judged(care, path)
    assert code == ExitCode.NOT_EVALUATED
    assert "measures nothing" in objectives["mission_success"]["reason"]
    assert objectives["path_error_max"]["status"] == "not_evaluated"


def test_nothing_found_is_not_said_of_a_log_whose_clock_cannot_be(tmp_path: Path, care: Care) -> None:
    path = tmp_path / "fast.BIN"
    path.write_bytes(restamped.dataflash(GOOD, CLOCKS["a thousand times too fast"]))
    code, out, _ = care("inspect", path, "--json")
    (finding,) = json.loads(out)["findings"]
    assert code == ExitCode.OK
    assert "clock" in finding["title"]
