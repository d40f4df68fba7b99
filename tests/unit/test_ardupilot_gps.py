"""Jumps, leaps and losses of the satellite position, and what looks like one."""

from __future__ import annotations

import numpy as np
import pytest

from care_core.ecosystems.ardupilot.examining import find
from care_core.ecosystems.findings import every_finding
from tests.flights import END_S, FAILS_S, METRE, RATES, Made, first, flight_of


@pytest.mark.parametrize(
    ("rate_hz", "metres"),
    [(rate_hz, 25.0) for rate_hz in RATES] + [(rate_hz, 9.0) for rate_hz in RATES if rate_hz >= 1],
)
def test_a_gps_jump(rate_hz: float, metres: float) -> None:
    made = Made(rate_hz)
    made.table["GPS"]["Lat"][made.after(FAILS_S)] += metres * METRE
    finding = first(made)
    assert finding.kind == "gps"
    assert finding.onset_s == pytest.approx(FAILS_S, abs=1 / rate_hz + 0.1)


@pytest.mark.parametrize(("hole_s", "is_told"), [(0.0, True), (9.0, False)])
def test_a_jump_that_comes_with_a_hole_in_the_log_is_the_holes(hole_s: float, is_told: bool) -> None:
    made = Made()
    made.table["GPS"]["Lat"][made.after(FAILS_S)] += 20 * METRE
    recorded = {
        name: table.where((table.t < FAILS_S - hole_s) | (table.t >= FAILS_S - 0.15))
        for name, table in made.tables().items()
    }
    findings = every_finding(find(flight_of(recorded, made.known, made.facts, END_S)))
    assert any(one.title.startswith("the GPS position jumps") for one in findings) == is_told


def test_a_step_that_a_vehicle_could_have_flown_between_two_records_is_no_jump() -> None:
    made = Made(rate_hz=0.5)
    made.table["GPS"]["Lat"][made.after(FAILS_S)] += 9.0 * METRE
    assert not [one for one in made.find() if "jumps" in one.title]


def test_a_receiver_whose_velocity_never_fits_tells_of_no_jump() -> None:
    made = Made()
    made.table["GPS"]["Lat"] += made.noise(6.0) * METRE
    assert not [one for one in made.find() if "jumps" in one.title]


def test_two_vehicles_whose_records_take_turns_make_no_jump() -> None:
    made = Made()
    place = {name: np.full_like(made.t, made.table["GPS"][name][0]) for name in ("Lat", "Lng")}
    made.table["GPS"] |= place | {"Spd": np.zeros_like(made.t)}
    other = made.after(FAILS_S, FAILS_S + 2.0) & (np.arange(len(made.t)) % 2 == 0)
    made.table["GPS"]["Lat"][other] += 14.0 * METRE
    assert not [one for one in made.find() if "jumps" in one.title]


@pytest.mark.parametrize(("pace", "jumps"), [(1.3, False), (9.0, True)])
def test_records_that_waited_for_the_link_are_timed_by_the_receiver(pace: float, *, jumps: bool) -> None:
    """Of a simulation that runs at its own pace; a clock that keeps no time times nothing."""
    made = Made()
    gps = made.table["GPS"]
    gps["Lat"] = gps["Lat"][0] + np.cumsum(np.append(0.0, np.diff(made.t))) * 20.0 * METRE
    gps["Spd"], gps["GCrs"] = np.full_like(made.t, 20.0 / pace), np.zeros_like(made.t)
    gps["GMS"] = made.t * 1e3 * pace
    late = made.after(FAILS_S, FAILS_S + 2.0)
    gps["Lat"] = np.where(late, gps["Lat"][np.flatnonzero(late)[0]], gps["Lat"])
    gps["GMS"] = np.where(late, gps["GMS"][np.flatnonzero(late)[0]], gps["GMS"])
    assert ("jumps" in " ".join(one.title for one in made.find())) is jumps


def test_of_several_jumps_the_first_is_named_and_the_largest_told_with_its_time() -> None:
    made = Made()
    for at, metres in ((50.0, 20.0), (70.0, 60.0)):
        made.table["GPS"]["Lat"][made.after(at)] += metres / 111319.5
    finding = next(one for one in made.find() if one.kind == "gps")
    assert finding.title == "the GPS position jumps by 20 m"
    assert finding.onset_s == pytest.approx(50.0, abs=0.2)
    assert "2 jumps, the largest of 60." in finding.evidence
    made.rows["ERR"] = [(47.0, {"Subsys": 11.0, "ECode": 2.0}), (55.0, {"Subsys": 11.0, "ECode": 0.0})]
    assert next(one for one in made.find() if one.kind == "gps").onset_s == 47.0  # its glitch began earlier


@pytest.mark.parametrize(("leaps_s", "kinds"), [(0.5, ["gps"]), (40.0, ["barometer"])])
def test_a_height_of_the_receiver_that_leaps_is_no_drift_of_the_barometer(leaps_s: float, kinds: list[str]) -> None:
    made = Made()
    made.table["GPS"]["Alt"] += np.interp(made.t, [45.0, 45.0 + leaps_s], [0.0, 100.0])
    found = list(every_finding(made.find()))
    assert [one.kind for one in found] == kinds
    assert ("the GPS height leaps" in [one.title for one in found]) == (kinds == ["gps"])


def test_a_rover_that_another_controller_drives_loses_its_fix_on_the_way() -> None:
    made = Made()
    made.facts = {"firmware": "ArduRover V4.3.0", "vehicle": "rover"}
    made.table["CTUN"]["ThO"][:] = 0.0
    made.table["GPS"]["Status"][made.after(70.0, 80.0)] = 1.0
    assert "the GPS fix was lost on the way" in [one.title for one in every_finding(made.find())]
    made.table["GPS"]["Spd"][:] = 0.3
    assert "the GPS fix was lost on the way" not in [one.title for one in every_finding(made.find())]


def test_few_satellites() -> None:
    made = Made()
    made.table["GPS"]["NSats"][made.after(FAILS_S)] = 5
    finding = first(made)
    assert (finding.kind, finding.title) == ("gps", "only 5 satellites")
    assert finding.onset_s == pytest.approx(FAILS_S, abs=0.2)


def test_a_receiver_with_a_fix_that_counts_no_satellites_sees_enough() -> None:
    made = Made()
    made.table["GPS"]["NSats"][:] = 0
    assert made.find() == ()


def test_a_fix_lost_in_the_air_counts_and_one_lost_before_arming_does_not() -> None:
    made = Made()
    made.table["GPS"]["Status"][made.after(0.0, 3.0)] = 0
    assert made.find() == ()
    made.table["GPS"]["Status"][made.after(FAILS_S, FAILS_S + 20)] = 1
    assert (first(made).kind, first(made).severity) == ("gps", "critical")


def test_a_receiver_that_starts_has_not_lost_its_satellites() -> None:
    made = Made()
    del made.rows["ARM"]
    made.table["CTUN"]["ThO"][:] = 0.0
    made.rows["MSG"] = [(20.0, {"Message": "Arm: RTL mode not armable"})]
    starts = made.after(0.0, 8.0)
    made.table["GPS"]["Status"][starts] = 1
    made.table["GPS"]["NSats"][starts] = 0
    assert [one.kind for one in made.find()] == ["prearm"]


@pytest.mark.parametrize(
    ("needs", "position_s", "is_told"), [(0.0, 40.0, True), (1.0, 40.0, False), (0.0, 15.0, False)]
)
def test_a_rover_that_is_armed_as_it_boots_has_no_position_yet(
    needs: float, position_s: float, *, is_told: bool
) -> None:
    made = Made()
    made.facts = {"firmware": "ArduRover V4.5.4"}
    made.settings |= {"ARMING_REQUIRE": needs, "LOG_DISARMED": 0.0}
    made.rows = {
        "MODE": [(0.0, {"ModeNum": 0.0})],
        "MSG": [(position_s, {"Message": "EKF3 IMU0 is using GPS"})],
        "ERR": [(20.0, {"Subsys": 17.0, "ECode": 1.0}), (41.0, {"Subsys": 17.0, "ECode": 0.0})],
    }
    (estimator,) = [one for one in every_finding(made.find()) if one.kind == "estimator"]
    assert (estimator.title == "it was armed before it had a position") == is_told
    assert estimator.parameters == (("ARMING_REQUIRE",) if is_told else ())
