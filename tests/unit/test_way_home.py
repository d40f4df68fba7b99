"""The way home of a copter against the parameters that make it long, and fences that a mission crosses."""

from __future__ import annotations

import numpy as np
import pytest

from care_core.ecosystems.ardupilot.checks import fence, way_home
from care_core.ecosystems.findings import Finding
from tests.flights import DOWN_S, HEIGHT_M, UP_S, Made

RTL_S = 20.0
AS_SHIPPED = {
    "RTL_ALT": 1200.0, "RTL_SPEED": 0.0, "RTL_LOIT_TIME": 5000.0, "RTL_ALT_FINAL": 0.0, "RTL_CLIMB_MIN": 0.0,
    "LAND_SPEED": 50.0, "LAND_SPEED_HIGH": 0.0, "LAND_ALT_LOW": 1000.0, "WPNAV_SPEED": 1000.0,
    "WPNAV_SPEED_UP": 250.0, "WPNAV_SPEED_DN": 150.0,
}  # fmt: skip
"""Of a flight at 12 m, whose way home is no higher."""
METRE = 1 / 111319.5


def homeward(*points: tuple[float, float, float], **settings: float) -> Made:
    """A flight that sets out for home at RTL_S: (time, metres north of home, height)."""
    made = Made()
    made.settings |= AS_SHIPPED | settings
    made.rows["MODE"] = [(0.0, {"ModeNum": 5.0}), (RTL_S, {"ModeNum": 6.0})]
    t, north, height = zip((0.0, 0.0, 0.0), (UP_S, 0.0, 0.0), *points, strict=True)
    for name, field in (("POS", "RelHomeAlt"), ("CTUN", "Alt"), ("CTUN", "DAlt")):
        made.table[name][field] = np.interp(made.t, t, height)
    made.table["POS"]["Lat"] = 47.0 + (np.interp(made.t, t, north) + made.noise(0.01)) * METRE
    return made


def told(made: Made) -> tuple[Finding, ...]:
    return tuple(way_home.find(made.flight()))


WAITS = homeward((14, 0, 12), (RTL_S, 30, 12), (25, 0, 12), (75, 0, 12), (81, 0, 10), (DOWN_S, 0, 0))
SLOW = homeward((14, 60, 12), (RTL_S, 60, 12), (RTL_S + 60, 0, 12), (85, 0, 10), (DOWN_S + 5, 0, 0))
STAYS = homeward((14, 0, 12), (RTL_S, 30, 12), (25, 0, 12), (30, 0, 6.5), (DOWN_S, 0, 6.5), (DOWN_S + 5, 0, 6.5))
SINKS = homeward((14, 0, 12), (RTL_S, 0, 12), (22, 0, 10), (DOWN_S, 0, 0))
CLIMBS = homeward((14, 0, 12), (RTL_S, 20, 12), (36, 20, 52), (38, 0, 52), (66, 0, 10), (86, 0, 0))


@pytest.mark.parametrize(
    ("made", "parameter", "value", "wanted", "shown"),
    [
        (WAITS, "RTL_LOIT_TIME", 50000.0, 5000.0, "it stayed 48 s at 12.0 m over home"),
        (SLOW, "RTL_SPEED", 100.0, 0.0, "it came 60 m home at 1.0 m/s"),
        (STAYS, "RTL_ALT_FINAL", 650.0, 0.0, "at 6.5 m over home, where 0 makes it land"),
        (SINKS, "LAND_SPEED", 13.0, 50.0, "at 0.13 m/s from 10 m on"),
        (CLIMBS, "RTL_CLIMB_MIN", 4000.0, 0.0, "it climbed from 12 to 52 m"),
    ],
)
def test_a_phase_names_the_parameter_that_it_follows(
    made: Made, parameter: str, value: float, wanted: float, shown: str
) -> None:
    made.settings[parameter] = value
    (finding,) = told(made)
    assert (finding.parameters, finding.wanted) == ((parameter,), ((parameter, wanted),))
    assert shown in finding.evidence
    assert finding.severity == "warning"
    assert finding.mission_lost is not None
    assert finding.mission_lost >= 0.3
    made.settings[parameter] = AS_SHIPPED[parameter]
    assert told(made) == ()  # it took as long, and not for that


def test_a_height_to_come_home_at_is_named_and_left_to_the_site() -> None:
    made = homeward((14, 0, 12), (RTL_S, 20, 12), (36, 20, 52), (38, 0, 52), (66, 0, 10), (86, 0, 0), RTL_ALT=5200.0)
    (finding,) = told(made)
    assert (finding.parameters, finding.wanted) == (("RTL_ALT",), ())
    assert "only the site can tell" in finding.evidence


def test_a_high_start_of_the_slow_descent_is_named() -> None:
    made = homeward((14, 0, 40), (RTL_S, 0, 40), (RTL_S + 78, 0, 1), (DOWN_S, 0, 0), LAND_ALT_LOW=10000.0, RTL_ALT=4000)
    (finding,) = told(made)
    assert finding.wanted == (("LAND_ALT_LOW", 1000.0),)


def test_a_slow_phase_that_costs_little_says_nothing() -> None:
    made = homeward((14, 0, 12), (RTL_S, 30, 12), (25, 0, 12), (38, 0, 12), (44, 0, 10), (64, 0, 0))
    made.settings["RTL_LOIT_TIME"] = 13000.0
    assert told(made) == ()


def test_a_battery_that_gave_out_in_the_time_that_was_lost_makes_it_sure() -> None:
    made = homeward((14, 0, 12), (RTL_S, 30, 12), (25, 0, 12), (55, 0, 12), (61, 0, 10), (DOWN_S, 0, 0))
    made.settings["RTL_LOIT_TIME"] = 30000.0
    (before,) = told(made)
    made.rows["ERR"] = [(52.0, {"Subsys": 6.0, "ECode": 1.0})]
    (after,) = told(made)
    assert (before.mission_lost or 0.0) < (after.mission_lost or 0.0) == 0.9


def fenced(code: float, **settings: float) -> Made:
    made = Made()
    made.settings |= {"FENCE_ENABLE": 1.0, **settings}
    made.rows["ERR"] = [(40.0, {"Subsys": 9.0, "ECode": code})]
    made.rows["MODE"] = [(0.0, {"ModeNum": 3.0}), (40.0, {"ModeNum": 6.0})]
    place: dict[str, float | str] = {
        "CNum": 1.0,
        "CId": 16.0,
        "Lat": 47.0 + 160 * METRE,
        "Lng": 8.0,
        "Alt": HEIGHT_M,
        "Frame": 3.0,
    }
    made.rows["CMD"] = [(1.0, place)]
    return made


@pytest.mark.parametrize(
    ("code", "parameter", "limit", "shown"),
    [(1.0, "FENCE_ALT_MAX", 10.0, "12 m high"), (2.0, "FENCE_RADIUS", 100.0, "160 m from home")],
)
def test_a_fence_that_the_mission_crosses_is_named(code: float, parameter: str, limit: float, shown: str) -> None:
    made = fenced(code, **{parameter: limit})
    (finding,) = fence.find(made.flight())
    assert (finding.parameters, finding.wanted) == ((parameter,), ())  # a protection is not made looser
    assert shown in finding.evidence


def test_a_fence_that_the_vehicle_strays_across_is_no_parameters_fault() -> None:
    assert not [*fence.find(fenced(1.0, FENCE_ALT_MAX=30.0).flight())]
    assert not [*fence.find(fenced(2.0, FENCE_RADIUS=300.0).flight())]


def test_a_pilot_who_crosses_the_fence_is_no_parameters_fault() -> None:
    made = fenced(1.0, FENCE_ALT_MAX=10.0)
    made.rows["MODE"] = [(0.0, {"ModeNum": 2.0}), (40.0, {"ModeNum": 6.0})]
    assert not [*fence.find(made.flight())]
