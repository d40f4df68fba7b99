"""The map of where a robot went, drawn in a terminal."""

from __future__ import annotations

import math

import numpy as np
import pytest

from care_core.application.track import Way, _placed, _while_it_went
from care_core.report.marks import Mark
from care_tui.render.map import map_rows
from care_tui.render.rows import ASCII


def lines_of(way: Way) -> list[str]:
    return [row.content.plain for row in map_rows(way, (), 40, 14, ASCII)]


@pytest.mark.parametrize(("reach_m", "ruler_m"), [(0.02, 1.0), (2.0, 1.0), (40.0, 20.0)])
def test_a_robot_that_stood_is_a_place_and_one_that_went_fills_the_map(reach_m: float, ruler_m: float) -> None:
    way = Way(((0.0, 0.0), (reach_m / 2, reach_m), (reach_m, reach_m)), (0.0, 1.0, 2.0))
    *drawn, scale, _ = lines_of(way)
    assert float(scale.split()[1]) == pytest.approx(ruler_m, rel=0.1)
    high = sum(bool(line.strip()) for line in drawn)
    assert high <= 2 if reach_m < 0.1 else high > 8
    stood = next(place for place, line in enumerate(drawn) if "E" in line)
    assert 4 <= stood <= 7 or reach_m > 0.1  # in the middle


@pytest.mark.parametrize("reach_m", [3.0, 11.0, 70.0, 450.0, 3100.0])
def test_the_bar_of_the_scale_is_a_round_length(reach_m: float) -> None:
    *_, scale, _ = lines_of(Way(((0.0, 0.0), (reach_m, reach_m)), (0.0, 1.0)))
    assert scale.split()[1].rstrip("0").rstrip(".") in ("1", "2", "5")
    assert 1 <= len(scale.split()[0]) <= 14


def test_what_leads_away_after_a_crash_is_no_way_of_the_vehicle() -> None:
    """An estimator without a vehicle goes on; what lies where it flew may be told."""
    track = ((0.0, 0.0), (50.0, 20.0), (40.0, 10.0), (41.0, 11.0), (3000.0, 600.0))
    way = Way(track, (0.0, 1.0, 2.0, 3.0, 4.0))
    assert _while_it_went(way, 2.0).track == track[:4]
    assert _while_it_went(way, math.inf) == way


def test_a_vehicle_that_knows_no_place_is_at_none() -> None:
    t, lng, lat = np.arange(3.0), np.array([0.0, 8.1, 8.2]), np.array([0.0, 47.1, 47.2])
    known = _placed(t, lng, lat)
    assert known is not None
    assert known[0].tolist() == [1.0, 2.0]
    assert _placed(t, np.zeros(3), np.zeros(3)) is None


def test_an_error_is_no_end_of_the_way() -> None:
    way = Way(((0.0, 0.0), (20.0, 0.0), (40.0, 30.0)), (0.0, 1.0, 2.0))
    mark = Mark(1.0, "error", "the estimator fails", 1)
    *drawn, _, legend = (row.content.plain for row in map_rows(way, [mark], 40, 14, ASCII))
    assert sum(line.count("E") for line in drawn) == 1
    assert "! warning" in legend
