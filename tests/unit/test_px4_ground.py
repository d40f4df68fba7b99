"""PX4 vehicles that stay on the ground though nothing of their flight is wrong, and missions that land on their way."""

from __future__ import annotations

import numpy as np
import pytest

from care_core.logs.base import Table
from care_core.run import Unavailable
from tests.unit.test_px4_measures import BEGUN_S, item, mission, table, value

TAKEOFF, PLACE, LAND, RETURN = 22, 16, 21, 20
FIELDS = ("sequence_current", "nav_cmd", "latitude", "longitude", "altitude", "time_inside", "altitude_is_relative")


def landing_on_the_way() -> Table:
    """Out 100 m, a landing there, and back again."""
    there, home = (0.0, 100.0, 20.0), (0.0, 0.0, 20.0)
    ways = ((TAKEOFF, home), (PLACE, there), (LAND, there), (TAKEOFF, there), (PLACE, home), (LAND, home))
    begun = np.linspace(5.0, BEGUN_S[-1] + 15.0, len(ways)).tolist()
    return table([item(t, n, *way) for n, (t, way) in enumerate(zip(begun, ways, strict=True))], *FIELDS)


def test_a_mission_that_lands_on_its_way_ends_where_it_lands_last() -> None:
    result = [(5.0, -1.0), *((20.0 + 15.0 * n, float(n)) for n in range(6))]
    rows = [(t, n, 6.0, 0.0, 0.0, 1.0, 1.0) for t, n in result]
    fields = ("seq_reached", "seq_total", "finished", "failure", "mission_id", "instance_count")
    flight = mission(navigator_mission_item=landing_on_the_way(), mission_result=table(rows, *fields))
    assert value("px4_landing_error", flight) == pytest.approx(0.0, abs=1.0)
    assert value("px4_mission_success", flight) == 1.0
    asked = value("px4_mission_asked", flight, what="path_length")
    assert isinstance(asked, Unavailable)
    assert "lands on its way" in asked.reason
    assert value("px4_path_error", flight) == asked
