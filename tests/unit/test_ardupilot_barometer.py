"""Barometers that are noisy or drift."""

from __future__ import annotations

import numpy as np
import pytest

from care_core.ecosystems.findings import every_finding
from tests.flights import FAILS_S, RATES, Made, first


@pytest.mark.parametrize("rate_hz", RATES[1:])
def test_a_noisy_barometer(rate_hz: float) -> None:
    made = Made(rate_hz)
    bad = made.after(FAILS_S)
    made.table["BARO"]["Alt"][bad] += made.noise(1.5)[bad]
    finding = first(made)
    assert finding.kind == "barometer"
    assert finding.onset_s == pytest.approx(FAILS_S, abs=6.0)


@pytest.mark.parametrize(("noise_m", "kinds"), [(0.05, []), (3.0, ["barometer"])])
def test_a_copter_that_dives_and_climbs_has_no_noisy_barometer(noise_m: float, kinds: list[str]) -> None:
    made = Made(rate_hz=5.0)
    dives = 15.0 * np.sin(2 * np.pi * np.maximum(made.t - 30.0, 0.0) / 8.0) * made.after(30.0, 94.0)
    for name, field in (("POS", "RelHomeAlt"), ("CTUN", "Alt"), ("CTUN", "BAlt"), ("CTUN", "DAlt"), ("GPS", "Alt")):
        made.table[name][field] += dives
    for name in ("BARO", "BARO#2"):
        made.table[name]["Alt"] += dives + made.noise(0.1) * np.gradient(dives, made.t)  # sampled up to 0.2 s off
    made.table["BARO"]["Alt"] += made.noise(noise_m)
    assert [one.kind for one in every_finding(made.find()) if "record to record" in one.evidence] == kinds


def test_a_drifting_barometer_is_told_by_the_second_one() -> None:
    made = Made()
    made.table["BARO"]["Alt"] += np.maximum(made.t - FAILS_S, 0) * 0.2
    finding = first(made)
    assert finding.kind == "barometer"
    assert finding.onset_s == pytest.approx(FAILS_S + 15, abs=3.0)


@pytest.mark.parametrize(("drift_m", "kinds"), [(0.0, []), (6.0, ["barometer"])])
def test_a_barometer_that_drifts_from_the_range_finder_on_the_ground_is_noted(drift_m: float, kinds: list[str]) -> None:
    made = Made()
    del made.table["BARO"], made.table["BARO#2"]
    height = made.table["CTUN"]["Alt"]
    made.table["POS"]["Lat"][:] = 47.0  # it lands where it began
    made.table["RFND"] = {"Dist": 0.2 + np.minimum(height, 8.0), "Stat": np.full(len(made.t), 4.0)}
    made.table["CTUN"]["BAlt"] = height + np.interp(made.t, [0, 8, 100], [0, 0, drift_m])
    found = made.find()
    assert [one.kind for one in found] == kinds
    assert all(one.severity == "info" for one in found)


@pytest.mark.parametrize(("drift_m", "kinds"), [(0.0, []), (8.0, ["barometer"])])
def test_the_barometer_of_a_submarines_board_feels_its_hull_and_no_depth(drift_m: float, kinds: list[str]) -> None:
    dive = Made()
    dive.facts = {"firmware": "ArduSub V4.5.0"}
    depth, drift = np.interp(dive.t, [20, 40, 80, 95], [0, 12, 12, 0]), np.interp(dive.t, [30, 60], [0, drift_m])
    warms = np.interp(dive.t, [0, 100], [0, 9])
    air, water = 101_325.0, 9_800.0
    dive.table["BARO"] |= {"Alt": warms, "Press": air - 12.0 * warms}
    dive.table["BARO#2"] |= {"Alt": -depth + dive.noise(0.02), "Press": air + water * depth}
    assert [one for one in every_finding(dive.find()) if one.kind == "barometer"] == []
    dive.table["BARO"] |= {"Alt": -depth + drift, "Press": air + water * (depth - drift)}  # two in the water
    assert [one.kind for one in every_finding(dive.find()) if one.kind == "barometer"] == kinds
