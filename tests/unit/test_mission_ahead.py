"""A vehicle that reached nothing of its mission has the whole of it before it, with every limit."""

from __future__ import annotations

import pytest

from care_core.diagnose.parts import is_ahead
from care_core.ecosystems.findings import Finding
from care_core.records import replace
from tests.planted import planted_run

REFUSED = Finding("prearm", "arming was refused: Check fence", 1.0, 2.0, "critical", "", "", probability=0.9)


@pytest.mark.parametrize(("reached", "is_whole"), [(0.0, True), (1.0, False), (None, False)])
def test_a_mission_of_which_nothing_was_reached_is_ahead(reached: float | None, is_whole: bool) -> None:
    run = replace(planted_run(), metrics={} if reached is None else {"waypoints_reached": reached})
    assert is_ahead(run, ()) == is_whole
    assert is_ahead(run, (REFUSED,))
