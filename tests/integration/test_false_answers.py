"""A broken clock or a dead sensor: what is computed from it is not evaluated, with the reason."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest

from care_core.errors import ExitCode
from care_core.files import bundled
from tests import restamped
from tests.conftest import Care

pytestmark = pytest.mark.long

DATA = Path(__file__).parents[1] / "data"
GOOD, FAILED = DATA / "arducopter_good.BIN", bundled("samples", "arducopter_failed.BIN")
DRIVE = DATA / "move_base_good.bag"


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


@pytest.mark.parametrize("clock", restamped.CLOCKS)
@pytest.mark.parametrize("source", [GOOD, FAILED], ids=["good", "failed"])
def test_a_flight_whose_clock_is_broken(care: Care, tmp_path: Path, source: Path, clock: str) -> None:
    check_not_judged(*judged(care, restamped.written(tmp_path, source, restamped.CLOCKS[clock], "BIN")))


@pytest.mark.parametrize("clock", restamped.CLOCKS)
@pytest.mark.parametrize("source", [GOOD, FAILED], ids=["good", "failed"])
def test_telemetry_whose_clock_is_broken_is_judged_by_the_vehicles_own_time_or_not_at_all(
    care: Care, tmp_path: Path, source: Path, clock: str
) -> None:
    sound = judged(care, restamped.written(tmp_path, source, lambda stamp: stamp, "tlog"))[1]
    broken = judged(care, restamped.written(tmp_path, source, restamped.CLOCKS[clock], "tlog"))[1]
    for name, one in broken.items():
        if one["status"] != "not_evaluated":
            assert (one["status"], one["value"]) == (sound[name]["status"], pytest.approx(sound[name]["value"], 0.02))


def test_a_receiver_that_stands_still_is_a_finding(care: Care, tmp_path: Path) -> None:
    (tmp_path / "a.BIN").write_bytes(restamped.dataflash_with(GOOD, "GPS", Lat=-353632610, Lng=1491652300))
    _, out, _ = care("triage", tmp_path / "a.BIN", "--json", "--profile", "arducopter")
    titles = [one["title"] for one in json.loads(out)["findings"]]
    assert "the GPS is frozen" in titles
    _, out, _ = care("triage", GOOD, "--json", "--profile", "arducopter")
    assert "the GPS is frozen" not in [one["title"] for one in json.loads(out)["findings"]]


@pytest.mark.parametrize("clock", ["constant", "zero", "milliseconds"])
def test_a_drive_whose_clock_is_broken(care: Care, tmp_path: Path, clock: str) -> None:
    check_not_judged(*judged(care, restamped.written(tmp_path, DRIVE, restamped.CLOCKS[clock], "mcap"), "move_base"))


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


@pytest.mark.parametrize("source", [GOOD, FAILED], ids=["good", "failed"])
@pytest.mark.parametrize("volts", [0.0, 0.0126, 12.6])
def test_a_dead_voltage_sensor(care: Care, tmp_path: Path, source: Path, volts: float) -> None:
    path = tmp_path / "a.BIN"
    path.write_bytes(restamped.dataflash_with(source, "BAT", Volt=volts))
    sound = judged(care, source)[1]
    code, objectives = judged(care, path)
    energy = objectives.pop("energy")
    assert code != ExitCode.OK
    assert energy["status"] == "not_evaluated"
    assert "voltage" in energy["reason"]
    assert {name: one["status"] for name, one in objectives.items()} == {
        name: sound[name]["status"] for name in objectives
    }


@pytest.mark.parametrize("factor", [1e-3, 0.2, 5.0, 1e3])
def test_a_current_in_the_wrong_unit(care: Care, tmp_path: Path, factor: float) -> None:
    """Both it and the counter by a thousand, or the counter alone."""
    names = ("Curr", "EnrgTot", "CurrTot") if factor in (1e-3, 1e3) else ("EnrgTot",)
    path = tmp_path / "a.BIN"
    path.write_bytes(restamped.dataflash_times(GOOD, "BAT", factor, *names))
    code, objectives = judged(care, path)
    assert code == ExitCode.NOT_EVALUATED
    assert objectives["energy"]["status"] == "not_evaluated", objectives["energy"]
    assert "BAT" in objectives["energy"]["reason"]


@pytest.mark.parametrize(
    ("name", "factor"), [("voltage", 0.0), ("voltage", 1e3), ("voltage", 1e-3), ("current", 1e3), ("current", 1e-3)]
)
def test_a_robots_battery_in_the_wrong_unit(care: Care, tmp_path: Path, name: str, factor: float) -> None:
    def change(battery: Any) -> None:
        setattr(battery, name, getattr(battery, name) * factor)

    code, objectives = judged(care, restamped.bag(DRIVE, tmp_path / "a.bag", "/battery_state", change), "move_base")
    energy = objectives.pop("energy")
    assert code == ExitCode.NOT_EVALUATED
    assert energy["status"] == "not_evaluated"
    assert "the battery" in energy["reason"]
    assert {one["status"] for one in objectives.values()} == {"ok"}


@pytest.mark.parametrize("factor", [0.5, 2.0])
@pytest.mark.parametrize("source", [GOOD, FAILED], ids=["good", "failed"])
def test_a_clock_that_is_not_the_satellites(care: Care, tmp_path: Path, source: Path, factor: float) -> None:
    path = tmp_path / "a.BIN"
    path.write_bytes(restamped.dataflash(source, lambda stamp: int(stamp * factor)))
    code, objectives = judged(care, path)
    check_not_judged(code, objectives)
    assert "satellites" in objectives["mission_time"]["reason"]


def test_where_a_clock_goes_wrong_it_is_told_what_to_record(care: Care, tmp_path: Path) -> None:
    path = restamped.written(tmp_path, GOOD, restamped.CLOCKS["standing still half the time"], "BIN")
    _, out, _ = care("triage", path, "--profile", "arducopter")
    assert "messages carry the time" in " ".join(out.split("\n\n")[0].split())


def test_energy_is_integrated_where_the_counter_is_no_number(care: Care, tmp_path: Path) -> None:
    path = tmp_path / "a.BIN"
    path.write_bytes(restamped.dataflash_with(GOOD, "BAT", EnrgTot=math.nan))
    sound, energy = (judged(care, log)[1]["energy"] for log in (GOOD, path))
    assert energy["status"] == "ok"
    assert energy["value"] == pytest.approx(sound["value"], rel=0.05)


@pytest.mark.parametrize(
    "values",
    [
        {"Lat": -353632610, "Lng": 1491652300, "RelHomeAlt": 10.0},
        {"Lat": -353632610, "Lng": 1491652300},
        {"Lat": 0, "Lng": 0},
    ],
    ids=["all", "the height moves", "nowhere"],
)
def test_a_position_that_never_changes(care: Care, tmp_path: Path, values: dict[str, float]) -> None:
    path = tmp_path / "a.BIN"
    path.write_bytes(restamped.dataflash_with(GOOD, "POS", **values))
    code, objectives = judged(care, path)
    assert code == ExitCode.NOT_EVALUATED
    assert "measures nothing" in objectives["mission_success"]["reason"]
    assert objectives["path_error_max"]["status"] == "not_evaluated"


@pytest.mark.parametrize(
    ("message", "values"),
    [("POS", {"RelHomeAlt": math.nan}), ("PARM", {"Value": math.nan}), ("PARM", {"Value": 0.0}), ("ATT", {"Roll": 0})],
)
def test_values_that_cannot_be_raise_nothing(
    care: Care, tmp_path: Path, message: str, values: dict[str, float]
) -> None:
    path = tmp_path / "a.BIN"
    path.write_bytes(restamped.dataflash_with(GOOD, message, **values))
    code, _ = judged(care, path)
    assert code in (ExitCode.OK, ExitCode.NOT_EVALUATED)


def test_nothing_found_is_not_said_of_a_log_whose_clock_cannot_be(tmp_path: Path, care: Care) -> None:
    path = tmp_path / "fast.BIN"
    path.write_bytes(restamped.dataflash(GOOD, restamped.CLOCKS["a thousand times too fast"]))
    code, out, _ = care("inspect", path, "--json")
    (finding,) = json.loads(out)["findings"]
    assert code == ExitCode.OK
    assert "clock" in finding["title"]
