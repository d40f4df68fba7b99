"""Each health check on a made flight: silent where nothing fails, at any rate; what fails is named with its onset."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from care_core.ecosystems.ardupilot.checks import CHECKS
from care_core.ecosystems.ardupilot.examining import find
from care_core.ecosystems.ardupilot.instances import instances
from care_core.ecosystems.ardupilot.messages import expanded
from care_core.ecosystems.spans import runs
from care_core.logs.base import Table
from tests.flights import ARMED_S, DOWN_S, END_S, RATES, UP_S, Made, flight_of
from tests.whole import examples


@pytest.mark.parametrize("rate_hz", RATES)
@pytest.mark.parametrize("seed", [1, 2])
def test_a_healthy_flight_is_silent(rate_hz: float, seed: int) -> None:
    assert Made(rate_hz, seed).find() == ()


def test_the_course_of_a_flight() -> None:
    flight = Made().flight()
    assert flight.armed == ((ARMED_S, DOWN_S + 5),)
    (span,) = flight.airborne
    assert span == pytest.approx((UP_S + 0.5, DOWN_S - 1.0), abs=0.6)
    assert flight.lost_control_s is None
    assert flight.impact_s is None


def test_a_plane_was_armed_when_its_status_says_so() -> None:
    made = Made()
    made.rows = {"MODE": [(0.0, {"ModeNum": 15.0})]}
    made.settings["LOG_DISARMED"] = 0.0
    made.table["STAT"] = {"Armed": ((made.t > 20) & (made.t < 60)).astype(float)}
    ((start, end),) = made.flight().armed
    assert [start, end] == pytest.approx([20, 60], abs=0.2)


def test_old_names_and_units_are_read() -> None:
    t = np.arange(5.0)
    old = {
        "CURR": Table(t, {"Volt": np.full(5, 1153.0), "Curr": np.full(5, 297.0)}),
        "CTUN": Table(t, {"ThrOut": np.full(5, 730.0), "BarAlt": t}),
        "MOT": Table(t, {"Mot1": np.full(5, 1500.0)}),
        "MAG2": Table(t, {"MagX": t}),
        "MAG": Table(t, {"MagX": t}),
    }
    assert instances(old, "BAT")[0]["Volt"][0] == pytest.approx(11.53)
    assert instances(old, "CTUN")[0]["ThO"][0] == pytest.approx(0.73)
    assert instances(old, "RCOU")[0]["C1"][0] == 1500
    assert len(instances(old, "MAG")) == 2
    assert {"ThrOut", "ThO"} <= set(expanded({"CTUN": ("ThO",)})["CTUN"])


def test_spans_of_a_mask() -> None:
    t = np.arange(10.0)
    mask = np.isin(t, [1, 2, 4, 8])
    assert runs(t, mask) == [(1.0, 2.0), (4.0, 4.0), (8.0, 8.0)]
    assert runs(t, mask, gap_s=2.0) == [(1.0, 4.0), (8.0, 8.0)]
    assert runs(t, t < 0) == []


@settings(max_examples=examples(60), deadline=None)
@given(
    drop=st.lists(st.sampled_from(sorted(Made(0.5).tables())), max_size=12),
    keep_rows=st.integers(0, 6),
    damage=st.sampled_from(["none", "nan", "constant", "short", "huge"]),
    which=st.sampled_from(sorted(Made(0.5).tables())),
)
def test_whatever_is_missing_or_broken_nothing_is_raised(
    drop: list[str], keep_rows: int, damage: str, which: str
) -> None:
    made = Made(2.5)
    tables = {name: table for name, table in made.tables().items() if name not in drop}
    if which in tables:
        table = tables[which]
        if damage == "short":
            tables[which] = table.where(slice(0, keep_rows))
        elif damage in ("nan", "constant", "huge"):
            value = {"nan": np.nan, "constant": 1.0, "huge": 1e30}[damage]
            broken = {f: c if c.dtype == object else np.full(len(c), value) for f, c in table.columns.items()}
            tables[which] = Table(table.t, broken)
    flight = made.flight()
    for facts in (flight.log.facts, {}, {"firmware": "ArduRover V4.5.4", "vehicle": "rover"}):
        for finding in find(flight_of(tables, flight.settings if keep_rows else {}, facts, END_S)):
            assert 0.0 <= finding.probability <= 1.0
            assert np.isfinite(finding.onset_s)


def test_every_check_says_what_it_reads() -> None:
    for check in CHECKS:
        assert all(isinstance(fields, tuple) for fields in check.reads.values())


def test_a_planes_throttle_is_in_percent() -> None:
    (table,) = instances({"CTUN": Table(np.arange(3.0), {"ThO": np.array([0.0, 15.0, 40.0])})}, "CTUN")
    assert table["ThO"].tolist() == pytest.approx([0.0, 0.15, 0.4])
