"""A vehicle that flies far above all that its mission asks for, and the offset that lifts it there."""

from __future__ import annotations

import numpy as np
import pytest

from care_core.ecosystems.ardupilot.checks import mission_height
from tests.flights import HEIGHT_M, Made

PLANE = {"firmware": "ArduPlane V4.5.4 (fd1bcc61)", "vehicle": "fixed wing"}


def flown(up_m: float, mode: float = 10.0, frame: float = 3.0, offset: float = 0.0) -> Made:
    """A plane whose mission is as high as the flight of the tests, and which flies `up_m` above that."""
    made = Made()
    made.facts = dict(PLANE)
    made.settings["ALT_OFFSET"] = offset
    made.rows["MODE"] = [(0.0, {"ModeNum": mode})]
    places = ({"CNum": n, "CId": 16.0, "Lat": -35.0, "Lng": 149.0 + n / 1000, "Alt": HEIGHT_M} for n in (1.0, 2.0))
    made.rows["CMD"] = [(1.0, {**place, "Frame": frame, "CTot": 3.0}) for place in places]
    lifted = np.interp(made.t, [20, 40, 90, 99], [0, up_m, up_m, 0])
    for name, field in (("POS", "RelHomeAlt"), ("CTUN", "Alt"), ("BARO", "Alt"), ("GPS", "Alt")):
        made.table[name][field] = made.table[name][field] + lifted
    return made


def test_what_lifts_a_mission_is_named_with_its_default() -> None:
    (found,) = mission_height.find(flown(400.0, offset=500.0).flight())
    assert (found.title, found.severity) == ("it flew far above its mission", "critical")
    assert (found.parameters, found.wanted) == (("ALT_OFFSET",), (("ALT_OFFSET", 0.0),))
    assert "the mission asks for 12 m at most" in found.evidence


def test_without_an_offset_no_parameter_is_named() -> None:
    (found,) = mission_height.find(flown(400.0).flight())
    assert (found.parameters, found.suspect) == ((), "parameter")


@pytest.mark.parametrize(
    ("up_m", "mode", "frame"),
    [(60.0, 10.0, 3.0), (400.0, 5.0, 3.0), (400.0, 10.0, 0.0)],
    ids=["an overshoot", "flown by hand", "heights above the sea"],
)
def test_what_a_mission_does_not_rule_out_is_not_told(up_m: float, mode: float, frame: float) -> None:
    assert not list(mission_height.find(flown(up_m, mode, frame).flight()))


def test_the_height_of_its_return_belongs_to_a_mission_that_returns() -> None:
    made = flown(150.0)
    for _, item in made.rows["CMD"]:
        item["CTot"] = 4.0
    home: dict[str, float | str] = {
        "CNum": 3.0,
        "CId": 20.0,
        "Lat": 0.0,
        "Lng": 0.0,
        "Alt": 0.0,
        "Frame": 3.0,
        "CTot": 4.0,
    }
    made.rows["CMD"].append((1.0, home))
    assert list(mission_height.find(made.flight()))
    made.settings["RTL_ALTITUDE"] = 120.0
    assert not list(mission_height.find(made.flight()))


def sunk(least_m: float, *, throttle: float = 1.0, last: float = 20.0) -> Made:
    """A copter that sinks in the middle of a mission at its height, and rises again."""
    made = Made()
    made.rows["MODE"] = [(0.0, {"ModeNum": 3.0})]
    items = [(1.0, 16.0), (2.0, 16.0), (3.0, last)]
    made.rows["CMD"] = [
        (
            1.0,
            {"CNum": n, "CId": what, "Lat": -35.0, "Lng": 149.0 + n / 1000, "Alt": HEIGHT_M, "Frame": 3.0, "CTot": 4.0},
        )
        for n, what in items
    ]
    low = made.after(50.0, 54.0)
    for table, field in (("POS", "RelHomeAlt"), ("CTUN", "Alt")):
        made.table[table][field][low] = least_m
    made.table["CTUN"]["ThO"][low] = throttle
    return made


@pytest.mark.parametrize(
    ("least_m", "title"),
    [(-0.2, "it came down to the ground in its mission"), (4.0, "it sank far below its mission"), (9.0, None)],
)
def test_a_copter_that_sinks_at_full_throttle_is_told(least_m: float, title: str | None) -> None:
    assert [one.title for one in mission_height.find(sunk(least_m).flight())] == ([title] if title else [])


def test_what_descends_by_itself_or_was_to_land_did_not_sink() -> None:
    assert not list(mission_height.find(sunk(1.0, throttle=0.3).flight()))
    landing = sunk(1.0)
    landing.rows["CMD"][1][1]["CId"] = 21.0
    landing.rows["CMD"][2][1]["CId"] = 16.0
    assert not list(mission_height.find(landing.flight()))
