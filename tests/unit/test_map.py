"""The map of where a robot went, drawn in a terminal."""

from __future__ import annotations

import pytest

from care_core.application.track import Way
from care_tui.render.map import map_rows
from care_tui.render.rows import ASCII


def lines_of(way: Way) -> list[str]:
    return [row.content.plain for row in map_rows(way, (), 40, 14, ASCII)]


@pytest.mark.parametrize(("reach_m", "ruler_m"), [(0.02, 0.91), (2.0, 0.91), (40.0, 18.0)])
def test_a_robot_that_stood_is_a_place_and_one_that_went_fills_the_map(reach_m: float, ruler_m: float) -> None:
    way = Way(((0.0, 0.0), (reach_m / 2, reach_m), (reach_m, reach_m)), (0.0, 1.0, 2.0))
    *drawn, scale, _ = lines_of(way)
    assert float(scale.split()[1]) == pytest.approx(ruler_m, rel=0.1)
    high = sum(bool(line.strip()) for line in drawn)
    assert high <= 2 if reach_m < 0.1 else high > 8
    stood = next(place for place, line in enumerate(drawn) if "E" in line)
    assert 4 <= stood <= 7 or reach_m > 0.1  # in the middle
