"""Rates in degrees a second and outputs from -1 to 1, whatever unit the firmware wrote."""

from __future__ import annotations

import numpy as np
import pytest

from care_core.ecosystems.ardupilot.rates import in_degrees
from care_core.logs.base import Table
from tests.tables import TablesLog

T = np.arange(0.0, 60.0, 0.1)
TURN_DPS = 3.0 * np.sin(T)


def read(rate: float, output: float, *, with_gyros: bool = True, firmware: str = "") -> tuple[float, float]:
    """The largest rate and output of a log whose firmware writes so many units for a degree a second and for all."""
    tables = {"RATE": Table(T, {"R": rate * TURN_DPS, "RDes": rate * TURN_DPS, "ROut": output * TURN_DPS / 300})}
    if with_gyros:
        tables["IMU"] = Table(T, {"GyrX": np.radians(TURN_DPS), "GyrY": np.zeros(len(T))})
    log = TablesLog(tables, 60.0, facts={"firmware": firmware})
    made = in_degrees(log).read({"RATE": ("R", "RDes", "ROut")})["RATE"]
    assert made["RDes"].max() == made["R"].max()
    return float(made["R"].max()), float(made["ROut"].max())


@pytest.mark.parametrize("with_gyros", [True, False])
def test_rates_and_outputs_of_any_release_are_read_alike(with_gyros: bool) -> None:
    assert read(100.0, 9000.0, with_gyros=with_gyros) == pytest.approx((3.0, 0.02), rel=1e-3)
    assert read(1.0, 1.0, with_gyros=with_gyros) == pytest.approx((3.0, 0.01), rel=1e-3)


def test_a_rate_that_the_gyros_say_as_well_is_one_in_degrees() -> None:
    assert read(1.0, 9000.0)[0] == pytest.approx(3.0, rel=1e-3)


def test_a_controller_that_asks_for_more_than_there_is_writes_no_other_unit() -> None:
    assert read(1.0, 2200.0) == pytest.approx((3.0, 22.0), rel=1e-3)


@pytest.mark.parametrize(
    ("firmware", "rate", "output"),
    [
        ("APM:Copter V3.4-dev (abcdef12)", 100.0, 9000.0),
        ("APM:Copter V3.4 (abcdef12)", 1.0, 1.0),
        ("APM:Copter V3.5.7 (abcdef12)", 1.0, 1.0),
    ],
)
def test_early_builds_of_a_release_may_write_the_old_unit(firmware: str, rate: float, output: float) -> None:
    assert read(rate, output, firmware=firmware)[0] == pytest.approx(3.0, rel=1e-3)


def test_other_messages_are_left_alone() -> None:
    log = in_degrees(TablesLog({"ATT": Table(T, {"Roll": TURN_DPS})}, 60.0))
    assert log.read({"ATT": ("Roll",)})["ATT"]["Roll"].max() == TURN_DPS.max()
