"""Vibration, clipping, and blows that are none."""

from __future__ import annotations

import numpy as np
import pytest

from tests.flights import DOWN_S, FAILS_S, RATES, UP_S, Made, first


@pytest.mark.parametrize("rate_hz", RATES)
def test_vibration(rate_hz: float) -> None:
    made = Made(rate_hz)
    for number in ("", "#2"):
        made.table[f"VIBE{number}"]["VibeZ"][made.after(FAILS_S, DOWN_S)] = 45.0
    finding = first(made)
    assert (finding.kind, finding.severity) == ("vibration", "warning")
    assert finding.onset_s == pytest.approx(FAILS_S, abs=2.0 + 1 / rate_hz)


@pytest.mark.parametrize("rate_hz", RATES)
def test_a_single_blow_is_no_vibration(rate_hz: float) -> None:
    made = Made(rate_hz)
    blow = 400.0 * np.exp(-2 * np.pi * np.clip(made.t - FAILS_S, 0.0, None)) * (made.t >= FAILS_S)
    for number in ("", "#2"):
        made.table[f"VIBE{number}"]["VibeZ"] += blow
    assert made.find() == ()


def test_vibration_that_upsets_the_estimator_is_critical() -> None:
    made = Made()
    made.table["VIBE"]["VibeZ"][made.after(FAILS_S, DOWN_S)] = 45.0
    made.table["XKF4"]["SV"][made.after(FAILS_S + 5, DOWN_S)] = 1.5
    finding = first(made)
    assert (finding.kind, finding.severity) == ("vibration", "critical")
    assert [one.kind for one in finding.consequences] == ["estimator"]


def test_vibration_that_was_there_from_the_take_off_on_did_not_rise() -> None:
    made = Made()
    made.table["VIBE"]["VibeZ"][made.after(UP_S, DOWN_S)] = 35.0
    (finding,) = made.find()
    assert finding.severity == "warning"
    assert "from" not in finding.evidence


def test_what_good_propellers_shake_is_no_finding() -> None:
    """As of real flights with good propellers: 20 m/s^2, and two gyros that differ by 0.22 degrees/s for each."""
    made = Made()
    made.table["VIBE"]["VibeZ"][made.after(UP_S, DOWN_S)] = 20.0
    for axis in ("GyrX", "GyrY", "GyrZ"):
        made.table["IMU#2"][axis] += np.where(made.after(UP_S, DOWN_S), made.noise(np.radians(4.4)), 0.0)
    assert not made.find()


def test_clipping() -> None:
    made = Made()
    made.table["VIBE"]["Clip"] = np.where(made.t > FAILS_S, (made.t - FAILS_S) * 10, 0.0)
    assert "clips" in first(made).evidence


def test_a_blow_that_stops_it_is_no_vibration() -> None:
    made = Made()
    hit = made.t >= 50.0
    made.table["VIBE"]["VibeX"] = np.where(hit, 300.0 * np.exp(-(made.t - 50.0)), 0.1)
    made.table["VIBE"]["Clip"] = np.where(hit, 3.0, 0.0)
    made.table["GPS"]["Spd"] = np.where(hit, 0.1, 4.0)
    made.table["ATT"]["Roll"] = np.where(made.t > 52.5, 70.0, made.table["ATT"]["Roll"])
    found = [one for finding in made.find() for one in (finding, *finding.below)]
    assert "vibration" not in [one.kind for one in found]
    assert made.flight().struck_s == pytest.approx(50.0, abs=0.2)
