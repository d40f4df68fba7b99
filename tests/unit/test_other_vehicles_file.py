"""A fix goes into the file of the vehicle that flew: what speaks against the one that was named is said before."""

from __future__ import annotations

from pathlib import Path

import pytest

from care_core import triage
from care_core.application.case import Case
from care_core.application.configuring import doubts_of
from care_core.files import bundled
from care_core.logs.opening import open_log
from care_core.records import replace

SAMPLES = bundled("samples")
FLIGHT = SAMPLES / "arducopter_failed.BIN"


@pytest.fixture(scope="module")
def flight() -> Case:
    return triage(FLIGHT)


def doubts(flight: Case, file: Path) -> tuple[str, ...]:
    assert flight.diagnosis.fix is not None
    return doubts_of(replace(flight, configs=(str(file),)), flight.diagnosis.fix)


def parameters_of(log: Path, file: Path) -> Path:
    lines = [f"{name},{history[-1].value}\n" for name, history in open_log(log).settings().items()]
    file.write_text("".join(lines), encoding="utf-8")
    return file


def test_nothing_speaks_against_the_file_of_the_vehicle_that_flew(flight: Case, tmp_path: Path) -> None:
    assert doubts(flight, parameters_of(FLIGHT, tmp_path / "own.parm")) == ()


def test_a_rovers_file_is_not_a_copters(flight: Case, tmp_path: Path) -> None:
    file = parameters_of(SAMPLES / "ardurover_failed.BIN", tmp_path / "rover.parm")
    assert doubts(flight, file)[0].endswith("it is another vehicle's file")


def test_a_file_of_other_firmware_is_told_by_how_little_of_it_the_log_has(flight: Case, tmp_path: Path) -> None:
    file = parameters_of(SAMPLES / "px4_failed.ulg", tmp_path / "px4.parm")
    first, *_others = doubts(flight, file)
    assert " of its " in first
    assert first.endswith("it is another vehicle's file")


def test_a_few_parameters_of_ones_own_are_no_other_vehicles(flight: Case, tmp_path: Path) -> None:
    file = tmp_path / "tune.parm"
    file.write_text("LAND_SPEED,16\nWPNAV_SPEED,1000\nMY_OWN,3\n", encoding="utf-8")
    assert not any("another vehicle" in doubt for doubt in doubts(flight, file))
