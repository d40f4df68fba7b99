"""A speed in Guided that nobody means."""

from __future__ import annotations

import numpy as np
import pytest

from tests.flights import Made

TITLE = "a program asks it for 45 m/s"


@pytest.mark.parametrize(
    ("mode", "asked_ms", "flown_ms", "is_told"),
    [
        (4.0, 45.0, 44.0, True),
        (4.0, 45.0, 3.0, False),  # it is asked for and not flown
        (4.0, 14.0, 14.0, False),  # fast, and what a task may need
        (5.0, 45.0, 44.0, False),  # a pilot's
    ],
)
def test_a_speed_that_no_task_needs_is_told(mode: float, asked_ms: float, flown_ms: float, is_told: bool) -> None:
    made = Made()
    made.settings["WPNAV_SPEED"] = 1000.0
    made.rows["MODE"] = [(0.0, {"ModeNum": mode})]
    grows = np.interp(made.t, [40.0, 60.0], [0.0, 1.0])
    made.table["PSCN"] = {"DVN": asked_ms * grows, "VN": flown_ms * grows}
    made.table["PSCE"] = {"DVE": 0.0 * grows, "VE": 0.0 * grows}
    found = [one for one in made.find() if one.kind == "commands"]
    assert [(one.title, one.severity) for one in found] == [(TITLE, "critical")] * is_told
