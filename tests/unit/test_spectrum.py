"""Where the motors' noise stands in the gyros' spectrum, against notch and low pass."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from care_core.ecosystems.ardupilot.checks import spectrum
from care_core.ecosystems.findings import Finding
from care_core.logs.base import Table
from care_core.numbers import Floats
from tests.flights import DOWN_S, HOVER, UP_S
from tests.unit.test_settings_shown import MadeWithDefaults

RATE_HZ, SAMPLES, MUL, ROW = 2000.0, 1024, 938.0, 32
NOTCH = {"INS_HNTCH_ENABLE": 1.0, "INS_HNTCH_MODE": 0.0, "INS_HNTCH_BW": 40.0, "INS_HNTCH_HMNCS": 3.0}


class Sampled(MadeWithDefaults):
    """A flight whose log holds batches of its gyro, or all of its samples, with a line at some frequency."""

    def __init__(
        self, settings: Mapping[str, float], line_hz: float = 180.0, dps: float = 20.0, *, raw: bool = False
    ) -> None:
        super().__init__()
        self.settings |= settings
        self.line_hz, self.dps, self.raw = line_hz, dps, raw

    def samples(self, count: int) -> Floats:
        """Of three axes, in rad/s; the line has an effective value of `dps` on the first."""
        made = self.rng.normal(0.0, 0.002, (count, 3))
        made[:, 0] += (
            math.sqrt(2) * math.radians(self.dps) * np.sin(2 * np.pi * self.line_hz * np.arange(count) / RATE_HZ)
        )
        return made

    def tables(self) -> dict[str, Table]:
        made = super().tables()
        if self.raw:
            at_s = np.arange(UP_S, UP_S + 10, 1 / RATE_HZ)
            columns = {f"Gyr{axis}": values for axis, values in zip("XYZ", self.samples(len(at_s)).T, strict=True)}
            return made | {"GYR": Table(at_s, {"I": np.zeros(len(at_s)), "SampleUS": at_s * 1e6, **columns})}
        times = np.arange(UP_S - 6, DOWN_S, 4.0)
        made["ISBH"] = Table(times, {
            "N": np.arange(len(times), dtype=float), "type": np.ones(len(times)), "instance": np.zeros(len(times)),
            "mul": np.full(len(times), MUL), "smp_cnt": np.full(len(times), float(SAMPLES)),
            "smp_rate": np.full(len(times), RATE_HZ),
        })  # fmt: skip
        rows: dict[str, list[object]] = {name: [] for name in ("N", "seqno", "x", "y", "z")}
        for number in range(len(times)):
            whole = np.round(self.samples(SAMPLES) * MUL).astype(int)
            for part in range(SAMPLES // ROW):
                cells = whole[part * ROW : (part + 1) * ROW]
                values = (float(number), float(part), *(tuple(column.tolist()) for column in cells.T))
                for name, value in zip(rows, values, strict=True):
                    rows[name].append(value)
        at = np.repeat(times, SAMPLES // ROW)
        columns = {name: _column(values) for name, values in rows.items()}
        return made | {"ISBD": Table(at, columns)}


def _column(values: list[object]) -> NDArray[Any]:
    if isinstance(values[0], float):
        return np.array(values)
    made = np.empty(len(values), dtype=object)
    made[:] = values
    return made


def told(made: Sampled) -> tuple[Finding, ...]:
    return tuple(spectrum.find(made.flight()))


@pytest.mark.parametrize("raw", [False, True], ids=["batches", "all samples"])
def test_a_notch_beside_the_noise_is_named_with_where_that_is(raw: bool) -> None:
    (finding,) = told(Sampled(NOTCH | {"INS_HNTCH_FREQ": 80.0, "INS_HNTCH_HMNCS": 1.0}, raw=raw))
    ((parameter, wanted),) = finding.wanted
    assert parameter == "INS_HNTCH_FREQ"
    assert wanted == pytest.approx(180.0, abs=2.0)
    assert "at 180 Hz, 2" in finding.evidence
    assert "INS_HNTCH stands at 80 Hz, 40 Hz wide in this flight" in finding.evidence


@pytest.mark.parametrize("settings", [{"INS_HNTCH_FREQ": 175.0}, {"INS_HNTCH_FREQ": 88.0}, {"INS_HNTCH_MODE": 3.0}])
def test_noise_in_the_notch_or_its_harmonic_or_one_that_follows_the_motors_is_none(settings: dict[str, float]) -> None:
    assert told(Sampled(NOTCH | {"INS_HNTCH_FREQ": 60.0} | settings)) == ()


def test_a_harmonic_that_the_notch_leaves_is_named() -> None:
    (finding,) = told(Sampled(NOTCH | {"INS_HNTCH_FREQ": 90.0}, 270.0))
    assert finding.wanted == (("INS_HNTCH_HMNCS", 7.0),)


def test_a_notch_by_the_throttle_stands_where_this_throttle_puts_it() -> None:
    by_throttle = NOTCH | {"INS_HNTCH_MODE": 1.0, "INS_HNTCH_REF": HOVER / 4}
    assert told(Sampled(by_throttle | {"INS_HNTCH_FREQ": 90.0})) == ()
    (finding,) = told(Sampled(by_throttle | {"INS_HNTCH_FREQ": 60.0}, 330.0))
    ((parameter, wanted),) = finding.wanted
    assert parameter == "INS_HNTCH_FREQ"
    assert wanted == pytest.approx(165.0, abs=2.0)


def test_a_low_pass_that_was_raised_above_the_noise_is_named_where_no_notch_is() -> None:
    made = Sampled({})
    made.drive("INS_GYRO_FILTER", 200.0, 20.0)
    (finding,) = told(made)
    assert finding.wanted == (("INS_GYRO_FILTER", 20.0),)
    made.drive("INS_GYRO_FILTER", 120.0, 20.0)
    assert told(made) == ()


def test_little_noise_a_vehicle_that_moves_and_a_log_without_samples_say_nothing() -> None:
    beside = NOTCH | {"INS_HNTCH_FREQ": 80.0}
    assert told(Sampled(beside, 180.0, 2.0)) == told(Sampled(beside, 10.0, 60.0)) == ()
    made = MadeWithDefaults()
    made.settings |= beside
    assert tuple(spectrum.find(made.flight())) == ()


def test_it_stands_among_the_findings_of_a_flight() -> None:
    found = Sampled(NOTCH | {"INS_HNTCH_FREQ": 65.0}, raw=True).find()
    assert [name for one in found for name in one.parameters] == ["INS_HNTCH_FREQ"]
