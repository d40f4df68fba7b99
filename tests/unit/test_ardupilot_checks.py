"""Each health check on a made flight: silent where nothing fails, at any rate; what fails is named with its onset."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from care_core.diagnose.parts import is_pack
from care_core.ecosystems import not_numbers
from care_core.ecosystems.ardupilot.checks import CHECKS
from care_core.ecosystems.ardupilot.examining import find
from care_core.ecosystems.ardupilot.instances import instances
from care_core.ecosystems.ardupilot.messages import expanded
from care_core.ecosystems.findings import (
    CUT,
    DROPPED,
    MONITOR_SILENT,
    NO_BATTERY,
    STRUCK,
    UNCHARGED,
    Finding,
    every_finding,
)
from care_core.ecosystems.measures import Mission, find_extractor
from care_core.ecosystems.spans import runs
from care_core.logs.base import Table
from care_core.run import Damage, Setting
from tests.flights import ARMED_S, DOWN_S, END_S, HEIGHT_M, HOVER, UP_S, Made, flight_of
from tests.whole import examples

JUMP = Damage("the clock jumps", 0, 40.0, is_jump=True)

RATES = (0.5, 1.0, 2.5, 10.0, 50.0)
FAILS_S = 50.0
METRE = 1 / 111319.5


def first(made: Made) -> Finding:
    findings = made.find()
    assert findings, "nothing was found"
    return findings[0]


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


@pytest.mark.parametrize("rate_hz", RATES)
def test_a_weak_motor_is_named(rate_hz: float) -> None:
    made = Made(rate_hz)
    made.table["RCOU"]["C3"][made.after(FAILS_S, DOWN_S)] += 250
    finding = first(made)
    assert (finding.kind, finding.title) == ("motor", "motor 3 (front left) lost thrust")
    assert finding.onset_s == pytest.approx(FAILS_S, abs=2.0 + 1 / rate_hz)
    assert finding.probability > 0.8


@pytest.mark.parametrize(("speed_ms", "rests"), [(0.3, False), (0.05, True)])  # a gale moves it
def test_motors_that_push_against_an_obstacle_tell_nothing_of_themselves(speed_ms: float, rests: bool) -> None:
    made = Made()
    leaning = made.after(FAILS_S, DOWN_S)
    made.table["ATT"]["Roll"][leaning] = made.table["ATT"]["DesRoll"][leaning] = 25.0
    made.table["GPS"]["Spd"][leaning] = speed_ms
    made.table["RCOU"]["C1"][leaning] += 300.0
    assert ("blocked" in [one.kind for one in made.find()]) == rests
    made.table["VIBE"]["Clip"][made.after(FAILS_S)] = 3.0
    finding = first(made)
    assert (finding.kind, finding.title) == ("blocked", "something holds it: it leans and does not move")
    assert "motor" not in [one.kind for one in (finding, *finding.consequences)]


def test_what_lies_with_its_motors_down_lost_none_and_is_held_by_nothing() -> None:
    made = Made()
    lies = made.after(FAILS_S, DOWN_S)
    made.table["CTUN"]["ThO"][lies] = 0.13
    made.table["RCOU"]["C3"][lies] = made.table["RCOU"]["C1"][lies] = 1500.0
    made.table["RCOU"]["C1"][lies] += 200.0
    made.table["ATT"]["Roll"][lies] = made.table["ATT"]["DesRoll"][lies] = 45.0
    made.table["GPS"]["Spd"][lies] = 0.05
    assert not {"motor", "blocked"} & {one.kind for one in every_finding(made.find())}


def test_a_plane_was_armed_when_its_status_says_so() -> None:
    made = Made()
    made.rows = {"MODE": [(0.0, {"ModeNum": 15.0})]}
    made.settings["LOG_DISARMED"] = 0.0
    made.table["STAT"] = {"Armed": ((made.t > 20) & (made.t < 60)).astype(float)}
    ((start, end),) = made.flight().armed
    assert [start, end] == pytest.approx([20, 60], abs=0.2)


def test_an_uneven_load_moves_motors_in_pairs_and_is_no_lost_motor() -> None:
    made = Made()
    for output in ("C1", "C3"):
        made.table["RCOU"][output][made.after(UP_S, DOWN_S)] += 120
    assert made.find() == ()


@pytest.mark.parametrize(("since_s", "kinds"), [(UP_S, []), (FAILS_S, ["motor"])])
def test_the_load_of_a_tricopter_may_lie_on_one_motor_from_the_start(since_s: float, kinds: list[str]) -> None:
    made = Made()
    made.settings |= {
        "FRAME_CLASS": 7,
        "FRAME_TYPE": 0,
        "SERVO3_FUNCTION": 0,
        "SERVO4_FUNCTION": 36,
        "SERVO7_FUNCTION": 39,
    }
    made.table["RCOU"]["C4"][made.after(since_s, DOWN_S)] += 250.0
    assert [one.kind for one in made.find() if one.kind == "motor"] == kinds


def test_a_motor_that_is_up_now_and_then_is_not_weak() -> None:
    made = Made()
    for start in range(30, 90, 12):
        made.table["RCOU"]["C2"][made.after(start, start + 5)] += 300
    assert not [one for one in made.find() if one.kind == "motor"]


def falling(made: Made, roll: float, pitch: float) -> None:
    """Control is lost at FAILS_S: it falls to one side within a second, then to the ground, and stays there."""
    t, lost = made.t, made.after(FAILS_S)
    grow = np.clip((t - FAILS_S) / 0.5, 0, 1)[lost]
    made.table["ATT"]["Roll"][lost] = roll * grow
    made.table["ATT"]["Pitch"][lost] = pitch * grow
    ground = np.clip(12.0 - 5 * np.maximum(t - FAILS_S, 0) ** 2, 0, None)
    for name, field in (("POS", "RelHomeAlt"), ("CTUN", "Alt")):
        made.table[name][field][lost] = ground[lost]
    made.rows["ERR"] = [(FAILS_S + 4.0, {"Subsys": 12.0, "ECode": 1.0})]
    made.rows["ARM"][1] = (FAILS_S + 4.0, {"ArmState": 0.0, "Forced": 0.0})


def test_a_motor_that_stops_leads_the_crash_it_makes() -> None:
    made = Made()
    falling(made, -60.0, 40.0)  # to the rear left, where motor 2 is
    lost = made.after(FAILS_S, FAILS_S + 2)
    made.table["RCOU"]["C2"][lost] = 1950
    made.table["RCOU"]["C1"][lost] = 1100
    finding = first(made)
    assert finding.title == "motor 2 (rear left) gave too little thrust"
    assert finding.onset_s == pytest.approx(FAILS_S, abs=1.0)
    assert {"attitude", "crash"} <= {one.kind for one in finding.consequences}


def test_an_impact_is_after_the_loss_of_control_and_what_follows_it_is_marked() -> None:
    made = Made()
    falling(made, -60.0, 40.0)
    made.rows["MSG"].append((FAILS_S + 10, {"Message": "Battery 1 failsafe"}))
    flight = made.flight()
    assert flight.lost_control_s == pytest.approx(FAILS_S + 0.3, abs=0.4)
    assert flight.impact_s is not None
    assert flight.lost_control_s is not None
    assert flight.lost_control_s < flight.impact_s <= FAILS_S + 2.5
    assert all(one.after_impact for one in made.find() if one.onset_s > flight.impact_s)


def test_a_mission_has_failed_that_fell_though_the_log_ends_armed_and_nothing_was_said_of_it() -> None:
    made = Made()
    falling(made, -60.0, 40.0)
    made.rows = {"MODE": [(0.0, {"ModeNum": 3.0})], "ARM": made.rows["ARM"][:1]}
    flight = made.flight()
    mission = Mission(flight, {}, ARMED_S, END_S, False, {}, {})
    assert find_extractor("mission_success").compute(mission, {}) == 0.0


@pytest.mark.parametrize(("reached_s", "is_lost"), [(FAILS_S - 5, True), (FAILS_S + 3, True), (FAILS_S + 20, False)])
def test_what_reaches_a_waypoint_later_has_lost_no_control(reached_s: float, is_lost: bool) -> None:
    made = Made()
    swinging = made.after(FAILS_S)
    made.table["ATT"]["Roll"][swinging] = 50.0 * np.sign(np.sin(8.0 * made.t[swinging]))
    made.rows["MSG"].append((reached_s, {"Message": "Reached command #4"}))
    assert (made.flight().lost_control_s is not None) == is_lost


def test_what_climbs_on_after_a_low_pass_did_not_crash() -> None:
    made = Made()
    falling(made, -60.0, 40.0)
    del made.rows["ERR"]
    for name, field in (("POS", "RelHomeAlt"), ("CTUN", "Alt")):
        made.table[name][field][made.after(FAILS_S + 4)] = 80.0
    flight = made.flight()
    assert flight.lost_control_s is not None
    assert flight.impact_s is None


def test_a_blow_before_control_is_lost_blames_no_motor() -> None:
    made = Made()
    falling(made, -60.0, 40.0)
    made.table["RCOU"]["C2"][made.after(FAILS_S, FAILS_S + 2)] = 1950
    made.table["IMU"]["AccX"][made.after(FAILS_S - 0.2, FAILS_S)] = 60.0
    findings = made.find()
    assert not any(one.kind == "motor" for one in findings)
    assert made.flight().impact_s == pytest.approx(FAILS_S - 0.2, abs=0.05)


@pytest.mark.parametrize(("shakes_s", "is_told"), [(FAILS_S - 4.0, True), (FAILS_S - 7.0, False)])
def test_a_blow_out_of_the_blue_that_a_sensor_clips_at_is_what_it_hit(shakes_s: float, is_told: bool) -> None:
    """What shakes itself clips again and again."""
    made = Made()
    falling(made, -60.0, 40.0)
    struck = made.after(FAILS_S - 4.0, FAILS_S - 3.9)
    made.table["IMU"]["AccX"][struck] = 45.0
    for name in ("VIBE", "VIBE#2"):
        made.table[name]["Clip"] = np.where(made.t > shakes_s, 1.0, 0.0) + np.where(made.t > FAILS_S - 4.0, 1.0, 0.0)
    assert (STRUCK in {one.title for one in every_finding(made.find())}) == is_told


def test_a_stopped_controller_is_told_by_its_speed() -> None:
    made = Made()
    t = made.t
    rpm = np.where(np.repeat(t, 4) > UP_S, 5000.0, 0.0)
    rpm[(np.repeat(t, 4) > FAILS_S) & (np.tile(np.arange(4), len(t)) == 3)] = 0.0
    tables = {**made.tables(), "ESC": Table(np.repeat(t, 4), {"Instance": np.tile(np.arange(4.0), len(t)), "RPM": rpm})}
    flight = made.flight()
    finding = find(flight_of(tables, flight.settings, flight.log.facts, END_S))[0]
    assert finding.title == "motor 4 (rear right) stopped"


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


def test_default_gains_that_swing_in_a_simulator_are_a_note() -> None:
    made = Made()
    oscillating(made)
    flight = made.flight()
    simulator = {"SIM_RATE_HZ": (Setting("SIM_RATE_HZ", 1200.0, "PARM"),)}
    for value, severity in ((0.135, "info"), (0.4, "warning")):
        gains = {"ATC_RAT_RLL_P": (Setting("ATC_RAT_RLL_P", value, "PARM", default=0.135),)}
        known = {**flight.settings, **simulator, **gains}
        (finding,) = find(flight_of(made.tables(), known, flight.log.facts, END_S))
        assert (finding.title, finding.severity) == ("pitch oscillates", severity)


def test_clipping() -> None:
    made = Made()
    made.table["VIBE"]["Clip"] = np.where(made.t > FAILS_S, (made.t - FAILS_S) * 10, 0.0)
    assert "clips" in first(made).evidence


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


@pytest.mark.parametrize(("speed_ms", "held"), [(0.05, True), (1.0, False)])
def test_what_leans_far_beyond_its_demand_and_rests_is_held(speed_ms: float, held: bool) -> None:
    made = Made()
    leans = made.after(FAILS_S, FAILS_S + 7)
    made.table["ATT"]["Roll"][leans] = 30.0
    made.table["ATT"]["DesRoll"][leans] = 12.0
    made.table["RCOU"]["C1"][leans] = 1950.0
    made.table["GPS"]["Spd"][leans] = speed_ms
    titles = [one.title for one in every_finding(made.find())]
    assert ("something holds it: it leans and does not move" in titles) == held


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


@pytest.mark.parametrize("rate_hz", RATES)
def test_a_compass_that_goes_off(rate_hz: float) -> None:
    made = Made(rate_hz)
    made.table["MAG"]["MagX"][made.after(FAILS_S)] += 260
    made.table["XKF4"]["SM"][made.after(FAILS_S + 2)] = 1.6
    finding = first(made)
    assert (finding.kind, finding.title, finding.severity) == ("compass", "compass 1 is disturbed", "critical")
    assert finding.evidence.startswith("the difference of compasses 1 and 2 changes by 2")  # what is over its limit
    assert finding.onset_s == pytest.approx(FAILS_S, abs=3.0)


def test_a_difference_of_compasses_is_told_by_what_exceeds_its_limit() -> None:
    made = Made()
    made.table["MAG"]["MagX"][made.after(FAILS_S)] += np.where(np.sin(made.t[made.after(FAILS_S)] / 2) > 0.6, 190, 120)
    finding = first(made)
    found = re.search(r"changes by (\d+) mGauss in flight \(limit (\d+)\)", finding.evidence)
    assert found is not None
    assert int(found[1]) > int(found[2])


def test_compasses_that_differ_in_flips_alone_are_sound() -> None:
    made = Made()
    turns = made.after(FAILS_S, FAILS_S + 10)
    made.rows["MODE"].append((FAILS_S - 1, {"ModeNum": 1.0}))  # acro
    made.rows["MODE"].append((FAILS_S + 11, {"ModeNum": 5.0}))
    for demand in ("", "Des"):
        made.table["ATT"][f"{demand}Roll"][turns] = 170.0
    made.table["MAG#2"]["MagX"][turns] += 260
    assert not [one for one in made.find() if one.kind == "compass"]


def test_a_compass_that_is_not_used_is_nobodys_business() -> None:
    made = Made()
    made.table["MAG#2"]["MagX"][made.after(FAILS_S)] += 260
    made.settings["COMPASS_USE2"] = 0
    assert made.find() == ()


def test_motors_that_disturb_a_compass() -> None:
    made = Made()
    for number in ("", "#2"):
        made.table[f"MAG{number}"]["MagZ"] += 700 * made.table["CTUN"]["ThO"]
    assert first(made).title == "the motors' currents disturb the compass"


def test_a_dead_compass() -> None:
    made = Made()
    for axis in "XYZ":
        made.table["MAG"][f"Mag{axis}"][made.after(FAILS_S)] = 0.0
    assert first(made).title == "the compass reads nothing"


def test_a_calibration_that_is_no_number_is_the_dead_compass() -> None:
    made = Made()
    for number in ("", "#2"):
        for axis in "XYZ":
            made.table[f"MAG{number}"][f"Mag{axis}"][made.after(FAILS_S)] = 0.0
    made.settings["COMPASS_MOT_X"] = math.nan
    finding = first(made)
    assert (finding.severity, finding.suspect) == ("critical", "parameter")
    assert "COMPASS_MOT_X" in finding.evidence
    assert (first(made).parameters, first(made).wanted) == (("COMPASS_MOT_X",), (("COMPASS_MOT_X", 0.0),))
    assert not [one for one in made.find() if one.title == "the compass reads nothing"]


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_what_is_not_a_number_is_named_with_the_value_to_put(value: float) -> None:
    made = Made()
    made.settings["ATC_RAT_RLL_P"] = value
    (finding,) = made.find()
    assert finding.title == "ATC_RAT_RLL_P is not a number"
    assert finding.wanted == (("ATC_RAT_RLL_P", 0.135),)
    assert finding.severity == "warning", "it flew well"


def test_what_is_not_a_number_is_critical_where_control_was_lost() -> None:
    known = {name: (Setting(name, math.nan, "PARM"),) for name in ("ATC_RAT_RLL_P", "ATC_RAT_PIT_P", "BATT_CAPACITY")}
    gains, battery = not_numbers.find(known, lambda _: None, END_S, failed=not_numbers.FLY, source="PARM")
    assert (gains.severity, battery.severity) == ("critical", "warning")
    assert gains.title == "ATC_RAT_RLL_P and ATC_RAT_PIT_P are not numbers"
    assert gains.wanted == ()


def test_a_refusal_that_names_the_compass_is_the_compass() -> None:
    made = Made()
    del made.rows["ARM"]
    made.table["CTUN"]["ThO"][:] = 0.0
    made.rows["MSG"] = [(t, {"Message": f"Arm: Check mag field (xy diff:{180 + t:.0f}>100)"}) for t in range(5, 105, 5)]
    finding = first(made)
    assert (finding.kind, finding.severity) == ("compass", "critical")
    assert [one.kind for one in finding.consequences] == ["prearm"]


def test_a_refusal_is_told_by_its_words() -> None:
    made = Made()
    del made.rows["ARM"]
    made.table["CTUN"]["ThO"][:] = 0.0
    words = ["Arm: Gyros inconsistent"] * 3 + ["Arm: Check ANGLE_MAX"] * 20
    made.rows["MSG"] = [(5.0 * n, {"Message": text}) for n, text in enumerate(words)]
    finding = first(made)
    assert (finding.kind, finding.title) == ("prearm", "arming was refused: Check ANGLE_MAX")


@pytest.mark.parametrize("rate_hz", RATES[1:])
def test_a_noisy_barometer(rate_hz: float) -> None:
    made = Made(rate_hz)
    bad = made.after(FAILS_S)
    made.table["BARO"]["Alt"][bad] += made.noise(1.5)[bad]
    finding = first(made)
    assert finding.kind == "barometer"
    assert finding.onset_s == pytest.approx(FAILS_S, abs=6.0)


@pytest.mark.parametrize(("noise_m", "kinds"), [(0.05, []), (3.0, ["barometer"])])
def test_a_copter_that_dives_and_climbs_has_no_noisy_barometer(noise_m: float, kinds: list[str]) -> None:
    made = Made(rate_hz=5.0)
    dives = 15.0 * np.sin(2 * np.pi * np.maximum(made.t - 30.0, 0.0) / 8.0) * made.after(30.0, 94.0)
    for name, field in (("POS", "RelHomeAlt"), ("CTUN", "Alt"), ("CTUN", "BAlt"), ("CTUN", "DAlt"), ("GPS", "Alt")):
        made.table[name][field] += dives
    for name in ("BARO", "BARO#2"):
        made.table[name]["Alt"] += dives + made.noise(0.1) * np.gradient(dives, made.t)  # sampled up to 0.2 s off
    made.table["BARO"]["Alt"] += made.noise(noise_m)
    assert [one.kind for one in every_finding(made.find()) if "record to record" in one.evidence] == kinds


def test_a_drifting_barometer_is_told_by_the_second_one() -> None:
    made = Made()
    made.table["BARO"]["Alt"] += np.maximum(made.t - FAILS_S, 0) * 0.2
    finding = first(made)
    assert finding.kind == "barometer"
    assert finding.onset_s == pytest.approx(FAILS_S + 15, abs=3.0)


@pytest.mark.parametrize("rate_hz", RATES)
def test_noisy_gyros_are_told_from_an_oscillation(rate_hz: float) -> None:
    made = Made(rate_hz)
    bad = made.after(FAILS_S)
    for axis in "XYZ":
        made.table["IMU"][f"Gyr{axis}"][bad] += np.radians(made.noise(8.0)[bad])
    finding = first(made)
    assert (finding.kind, finding.title) == ("imu", "the gyros are noisy")
    assert finding.onset_s == pytest.approx(FAILS_S, abs=5.0 + 4 / rate_hz)
    swinging = Made(rate_hz)
    swing = np.radians(120 * np.sin(2 * np.pi * 4.3 * swinging.t))
    swinging.table["IMU"]["GyrX"] += swing
    swinging.table["IMU#2"]["GyrX"] += 0.95 * swing
    assert not [one for one in swinging.find() if one.kind == "imu"]


def offset_gyro(made: Made, dps: float) -> None:
    for table in ("IMU", "IMU#2"):
        made.table[table]["GyrX"] += np.radians(dps)


@pytest.mark.parametrize(("dps", "is_told"), [(8.0, True), (1.0, False)])
def test_a_gyro_that_turns_at_rest_while_gravity_stays_is_offset(dps: float, is_told: bool) -> None:
    made = Made()
    made.table["CTUN"]["ThO"][made.t < UP_S] = 0.0
    offset_gyro(made, dps)
    assert ("the gyro is offset at rest" in [one.title for one in made.find()]) is is_told


def test_what_is_turned_about_the_vertical_as_it_stands_has_no_offset_gyro() -> None:
    made = Made()
    made.table["CTUN"]["ThO"][made.t < UP_S] = 0.0
    for table in ("IMU", "IMU#2"):
        made.table[table]["GyrZ"] += np.radians(20.0)
    assert "the gyro is offset at rest" not in [one.title for one in made.find()]


def test_control_was_not_lost_where_gravity_contradicts_the_attitude_at_rest() -> None:
    made = Made()
    made.table["CTUN"]["ThO"][(made.t < UP_S) | (made.t > DOWN_S)] = 0.0
    offset_gyro(made, 8.0)
    made.table["ATT"]["Roll"] = np.interp(made.t, [0.0, 20.0, END_S], [20.0, 50.0, 60.0])
    assert made.flight().lost_control_s is not None
    titles = [one.title for one in every_finding(made.find())]
    assert "the gyro is offset at rest" in titles
    assert "control was lost" not in titles


def test_a_failed_gyro() -> None:
    made = Made()
    made.table["IMU"]["GH"][made.after(FAILS_S)] = 0
    assert first(made).title == "gyro 1 failed"


def test_a_battery_that_was_not_charged() -> None:
    made = Made()
    made.table["BAT"]["Volt"] -= 1.5
    finding = first(made)
    assert (finding.kind, finding.title, finding.severity) == ("battery", "the battery was not charged", "warning")
    assert "3 cells" in finding.evidence
    assert finding.mission_lost == 0.05, "it held"
    made.rows["ERR"] = [(40.0, {"Subsys": 6.0, "ECode": 1.0})]
    assert (first(made).severity, first(made).mission_lost) == ("critical", None)


def test_a_battery_is_no_reason_for_a_refusal_that_names_another() -> None:
    made = Made()
    made.rows = {"MSG": [(t, {"Message": "PreArm: RC not found"}) for t in (20.0, 50.0, 80.0)]}
    made.table["BAT"]["Volt"][:] = 11.4 + made.noise(0.01)
    for name in ("CTUN", "POS"):
        made.table.pop(name)
    refusal, battery = made.find()
    assert (refusal.kind, battery.kind, battery.severity) == ("prearm", "battery", "info")


def test_a_failsafe_above_what_a_battery_needs_is_a_parameter() -> None:
    made = Made()
    made.settings["BATT_LOW_VOLT"] = 11.9
    made.rows["ERR"] = [(40.0, {"Subsys": 6.0, "ECode": 1.0})]
    finding = first(made)
    assert (finding.kind, finding.suspect) == ("battery", "parameter")
    assert "BATT_LOW_VOLT=11.9" in finding.evidence


def test_a_failsafe_of_a_monitor_that_measures_nothing_blames_no_threshold() -> None:
    made = Made()
    made.settings["BATT_LOW_VOLT"] = 9.0
    made.rows["ERR"] = [(40.0, {"Subsys": 6.0, "ECode": 1.0})]
    made.table["BAT"]["Volt"][:] = 3.248
    finding = first(made)
    assert (finding.title, finding.parameters) == (f"{NO_BATTERY}, and its failsafe acted", ())
    made.settings["BATT_FS_LOW_ACT"] = 0.0
    assert first(made).title == f"{NO_BATTERY}, and its failsafe was told"
    made.rows["MODE"].append((40.2, {"ModeNum": 9.0}))
    assert first(made).title == f"{NO_BATTERY}, and its failsafe acted"


def test_a_monitor_that_fell_silent_is_no_empty_battery() -> None:
    made = Made()
    made.rows["MSG"].append((ARMED_S - 2.0, {"Message": "Battery 1 is missing, last: 15.60V used 0 mAh"}))
    made.table["BAT"]["Volt"] -= float(made.table["BAT"]["Volt"][0]) - 3 * 3.88
    finding = first(made)
    assert (finding.title, finding.severity) == (MONITOR_SILENT, "warning")
    made.rows["MSG"].append((ARMED_S - 1.0, {"Message": "Battery Failsafe - Disarming"}))
    finding = first(made)
    assert (finding.title, finding.severity) == (MONITOR_SILENT, "critical")
    assert not is_pack(finding)
    assert UNCHARGED not in {one.title for one in finding.below}


def test_of_a_battery_that_was_not_full_it_is_none() -> None:
    made = Made()
    made.settings["BATT_LOW_VOLT"] = 11.9
    made.rows["ERR"] = [(40.0, {"Subsys": 6.0, "ECode": 1.0})]
    made.table["BAT"]["Volt"] -= float(made.table["BAT"]["Volt"][0]) - 3 * 4.03
    finding = first(made)
    assert (finding.title, finding.suspect) == ("battery failsafe", "operation")
    assert "not full before take-off: 4.03 V a cell" in finding.evidence


def test_a_sagging_battery() -> None:
    made = Made()
    made.table["BAT"]["Volt"][made.after(FAILS_S, DOWN_S)] = 8.7
    assert first(made).title == "the battery sags under its load"
    assert first(made).severity == "critical"
    assert first(made).probability > 0.5, "a charged pack lasts longer"
    assert "down to 8.7 V over 2 s, 2.90 V for each of 3 cells" in first(made).evidence


def test_a_board_that_loses_its_supply() -> None:
    made = Made()
    made.table["POWR"]["Vcc"][made.after(FAILS_S, FAILS_S + 3)] = 4.1
    assert first(made).title == "the autopilot's own supply dips"


def test_a_supply_that_is_low_all_along_does_not_dip_and_is_no_battery() -> None:
    made = Made()
    made.table["POWR"]["Vcc"] = made.table["POWR"]["Vcc"] - 0.75
    finding = first(made)
    assert (finding.title, finding.severity) == ("the autopilot's own supply is low", "warning")
    assert not is_pack(finding)


@pytest.mark.parametrize(("asked", "stopped"), [(0.5, True), (0.02, False)])
def test_a_motor_that_turns_slowly_as_it_is_told_has_not_stopped(asked: float, stopped: bool) -> None:
    made = Made()
    slow = made.after(FAILS_S, FAILS_S + 3)
    made.table["RCOU"]["C1"][slow] = 1000 + 1000 * asked
    for number in range(4):
        rpm = np.where(made.after(UP_S, DOWN_S), 4000.0, 0.0)
        made.table[f"ESC{number}"] = {"Instance": np.full(len(made.t), float(number)), "RPM": rpm}
    made.table["ESC0"]["RPM"][slow] = 300.0
    tables = made.tables()
    parts = [tables.pop(f"ESC{number}") for number in range(4)]
    t = np.concatenate([one.t for one in parts])
    order = np.argsort(t, kind="stable")
    tables["ESC"] = Table(t[order], {f: np.concatenate([one[f] for one in parts])[order] for f in ("Instance", "RPM")})
    found = find(flight_of(tables, made.known, made.facts))
    assert any(one.title == "motor 1 (front right) stopped" for one in found) is stopped


def test_a_fence_is_held_against_what_was_asked_before_it_acted() -> None:
    made = Made()
    made.settings |= {"FENCE_ALT_MAX": HEIGHT_M + 2.0, "RTL_ALT": 9000}
    made.rows["MODE"] = [(0.0, {"ModeNum": 3.0}), (50.0, {"ModeNum": 6.0})]
    made.rows["ERR"] = [(50.0, {"Subsys": 9.0, "ECode": 1.0})]
    made.table["CTUN"]["DAlt"][made.t >= 50.0] = 90.0
    assert "it was sent across its fence" not in [one.title for one in made.find()]
    made.table["CTUN"]["DAlt"][made.t >= 45.0] = 90.0
    assert "it was sent across its fence" in [one.title for one in made.find()]


def test_a_monitor_that_does_not_move() -> None:
    made = Made()
    made.table["BAT"]["Volt"][:] = 12.0
    assert (first(made).kind, first(made).severity) == ("battery", "info")


def test_too_little_thrust_and_an_option_that_keeps_it_down() -> None:
    made = Made()
    high = made.after(30.0, DOWN_S)
    made.table["CTUN"]["ThO"][high] = 0.98
    for name, field in (("CTUN", "Alt"), ("CTUN", "BAlt"), ("BARO", "Alt"), ("BARO#2", "Alt"), ("POS", "RelHomeAlt")):
        made.table[name][field][high] -= 6.0
    finding = first(made)
    assert (finding.kind, finding.severity, finding.suspect) == ("thrust", "critical", "hardware")
    made.settings["MOT_SPIN_MAX"] = 0.6
    assert first(made).suspect == "parameter"


@pytest.mark.parametrize(
    ("sinks_ms", "throttle", "is_told"), [(1.5, 0.92, True), (1.5, 0.8, False), (0.3, 0.92, False)]
)
def test_what_sinks_on_with_nearly_all_its_thrust_lacks_it(sinks_ms: float, throttle: float, is_told: bool) -> None:
    made = Made()
    made.rows["MODE"] = [(0.0, {"ModeNum": 0.0})]
    down = made.after(50.0, 54.0)
    made.table["CTUN"]["ThO"][down] = throttle
    for name, field in (("POS", "RelHomeAlt"), ("CTUN", "Alt"), ("CTUN", "BAlt"), ("BARO", "Alt"), ("BARO#2", "Alt")):
        made.table[name][field] -= sinks_ms * np.clip(made.t - 50.0, 0.0, 4.0)
    found = [one for one in every_finding(made.find()) if one.title == "too little thrust"]
    assert [one.severity for one in found] == ["critical"] * is_told


@pytest.mark.parametrize("is_cleared", [True, False])
def test_an_estimator_check_that_fails_on_the_ground_and_is_never_cleared_is_told(is_cleared: bool) -> None:
    made = Made()
    made.rows["ERR"] = [(ARMED_S + 1.0, {"Subsys": 16.0, "ECode": 2.0})]
    if is_cleared:
        made.rows["ERR"].append((ARMED_S + 2.0, {"Subsys": 16.0, "ECode": 0.0}))
    found = [one for one in every_finding(made.find()) if one.kind == "estimator"]
    assert [one.severity for one in found] == ["warning"] * (not is_cleared)


def test_a_radio_that_comes_back_at_once_explains_little() -> None:
    made = Made()
    made.rows["ERR"] = [(50.0, {"Subsys": 5.0, "ECode": 1.0}), (50.2, {"Subsys": 5.0, "ECode": 0.0})]
    assert (first(made).kind, first(made).severity) == ("radio", "warning")
    made.rows["ERR"][1] = (80.0, {"Subsys": 5.0, "ECode": 0.0})
    assert first(made).severity == "critical"
    made.rows["ERR"][1] = (50.2, {"Subsys": 5.0, "ECode": 0.0})
    made.rows["MODE"] = [(0.0, {"ModeNum": 5.0, "Rsn": 1.0}), (50.1, {"ModeNum": 6.0, "Rsn": 3.0})]  # it acted
    assert first(made).severity == "critical"


def test_an_oscillation_is_a_parameter() -> None:
    made = Made()
    t = made.t
    swing = np.where(made.after(30.0, 90.0), 120 * np.sin(2 * np.pi * 3.1 * t), 0.0)
    made.table["RATE"] = {"R": swing, "P": made.noise(1), "RDes": made.noise(2), "PDes": made.noise(2)}
    finding = first(made)
    assert (finding.kind, finding.title, finding.suspect) == ("tuning", "roll oscillates", "parameter")


def oscillating(made: Made, start: float = 30.0, end: float = 90.0) -> None:
    swing = np.where(made.after(start, end), 120 * np.sin(2 * np.pi * 3.1 * made.t), 0.0)
    made.table["RATE"] = {"R": made.noise(1), "P": swing, "RDes": made.noise(2), "PDes": made.noise(2)}


def test_a_controller_that_asks_for_all_the_motors_have_oscillates_though_its_demand_swings_too() -> None:
    made = Made()
    oscillating(made)
    made.table["RATE"]["PDes"] = 0.6 * np.roll(made.table["RATE"]["P"], 3)
    assert made.find() == ()
    made.table["RATE"] |= {"ROut": made.noise(0.02), "POut": -made.table["RATE"]["P"] / 50}
    assert first(made).title == "pitch oscillates"


def test_an_oscillation_that_takes_all_the_thrust_leads_what_it_brings_about() -> None:
    made = Made()
    oscillating(made)
    made.table["CTUN"]["ThO"][made.after(50.0, 80.0)] = 0.98
    finding = first(made)
    assert (finding.title, finding.severity) == ("pitch oscillates", "critical")
    assert "at their limit for 30 s" in finding.evidence
    assert [one.title for one in finding.consequences] == ["too little thrust"]


def test_motors_at_their_limit_before_it_swings_are_not_the_oscillations_doing() -> None:
    made = Made()
    oscillating(made, start=60.0)
    made.table["CTUN"]["ThO"][made.after(30.0, 80.0)] = 0.98
    found = {one.title: one for root in made.find() for one in (root, *root.below)}
    assert found["pitch oscillates"].severity == "warning"
    assert first(made).title == "too little thrust"


def test_a_log_too_slow_to_show_each_swing_shows_that_they_come_out_even() -> None:
    made = Made(rate_hz=2.0)
    slow = np.where(made.after(30.0, 42.0), 60 * np.sin(2 * np.pi * (made.t - 30.0) / 9.0), 0.0)
    made.table["RATE"] = {"R": slow, "P": made.noise(1), "RDes": made.noise(1), "PDes": made.noise(1)}
    assert first(made).title == "roll oscillates"
    made.table["RATE"]["R"] = np.abs(slow)
    assert made.find() == ()


def test_coming_down_and_staying_there_is_told() -> None:
    made = Made()
    down = made.after(FAILS_S)
    for name, field in (("POS", "RelHomeAlt"), ("CTUN", "Alt"), ("CTUN", "BAlt"), ("BARO", "Alt"), ("BARO#2", "Alt")):
        made.table[name][field][down] = 0.0
    made.table["CTUN"]["ThO"][down] = 0.7
    made.table["CTUN"]["DAlt"][down] = 12.0
    found = {one.title: one for one in made.find()}
    stranded = found["it came down and could not rise again"]
    assert stranded.severity == "critical"
    assert stranded.onset_s == pytest.approx(FAILS_S, abs=0.5)
    assert made.flight().down_s == stranded.onset_s


def test_a_fall_that_lasts_a_second_is_a_loss_of_control_and_names_the_motor_in_a_slow_log() -> None:
    made = Made(rate_hz=2.5)
    fall, after = made.after(FAILS_S, FAILS_S + 1.0), made.after(FAILS_S + 1.0)
    made.table["ATT"]["Roll"][fall], made.table["ATT"]["Pitch"][fall] = -70.0, 40.0  # to the rear left
    made.table["RCOU"]["C2"][fall], made.table["RCOU"]["C1"][fall] = 1950, 1100
    for name, field in (("POS", "RelHomeAlt"), ("CTUN", "Alt")):
        made.table[name][field][fall] = np.linspace(HEIGHT_M, 1.5, int(fall.sum()))
        made.table[name][field][after] = 0.0
    for field in ("Roll", "Pitch", "DesRoll", "DesPitch"):
        made.table["ATT"][field][after] = 0.0
    assert made.flight().lost_control_s == pytest.approx(FAILS_S, abs=0.5)
    assert first(made).title == "motor 2 (rear left) gave too little thrust"


@pytest.mark.parametrize(("mode", "lost_s"), [(5.0, FAILS_S), (0.0, None)])
def test_a_plane_that_turns_over_where_it_is_levelled_has_lost_control(mode: float, lost_s: float | None) -> None:
    made = Made()
    made.facts = {"firmware": "ArduPlane V4.5.4", "vehicle": "plane"}
    made.rows["MODE"] = [(0.0, {"ModeNum": mode})]
    over = made.after(FAILS_S, FAILS_S + 20)
    made.table["ATT"]["Roll"][over] = (200.0 * (made.t[over] - FAILS_S) + 180) % 360 - 180
    made.table["ATT"]["Roll"][made.after(FAILS_S + 20)] = 170.0
    assert made.flight().lost_control_s == (None if lost_s is None else pytest.approx(lost_s, abs=0.5))


def test_a_lurch_at_touch_down_is_no_loss_of_control() -> None:
    made = Made()
    made.table["ATT"]["Roll"][made.after(DOWN_S - 1.0, DOWN_S - 0.5)] = 45.0
    assert made.flight().lost_control_s is None


def test_an_attitude_that_does_not_follow() -> None:
    made = Made()
    made.table["ATT"]["DesRoll"][made.after(FAILS_S, FAILS_S + 5)] += 22
    assert first(made).title == "the attitude does not follow its demand"


def test_a_tip_over_at_take_off() -> None:
    made = Made()
    made.table["POS"]["RelHomeAlt"][:] = 0.1
    made.table["CTUN"]["Alt"][:] = made.table["CTUN"]["BAlt"][:] = 0.1 + made.noise(0.05)
    made.table["ATT"]["Roll"][made.after(UP_S + 1)] = 85.0
    made.rows["ERR"] = [(UP_S + 4, {"Subsys": 12.0, "ECode": 1.0})]
    assert first(made).kind == "takeoff"


@pytest.mark.parametrize(("mode", "suspect"), [(1.0, "operation"), (0.0, "hardware")])
@pytest.mark.parametrize(
    ("throttle", "lasts_s", "felt", "turned"),
    [
        (0.05, 97.0, 9.8, True),  # on its back until it is disarmed, its motors driven by little: a light vehicle
        (0.0, 97.0, 9.8, False),  # turned over by hand with its motors at rest
        (0.05, 2.0, 9.8, False),  # a flip, upright again
        (0.05, 97.0, 2.0, False),  # upside down in the air: what falls feels little of gravity
    ],
)
def test_a_copter_that_turned_over_and_lay_on_its_back(
    mode: float, suspect: str, throttle: float, lasts_s: float, felt: float, turned: bool
) -> None:
    made = Made()
    over = made.after(UP_S + 2, UP_S + 2 + lasts_s)
    made.rows["MODE"] = [(0.0, {"ModeNum": mode})]
    made.table["POS"]["RelHomeAlt"][:] = made.table["CTUN"]["Alt"][:] = made.table["CTUN"]["BAlt"][:] = 0.1
    made.table["CTUN"]["ThO"][:] = np.where(made.after(UP_S, UP_S + 3), throttle, 0.0)
    made.table["ATT"]["Roll"][over] = 168.0
    made.table["IMU"]["AccZ"][over] = felt
    crashes = [one for one in every_finding(made.find()) if one.kind == "crash"]
    assert [(one.title, one.suspect) for one in crashes] == [("it turned over", suspect)] * turned
    assert made.flight().impact_s == (pytest.approx(UP_S + 2, abs=0.2) if turned else None)


def test_what_turned_over_and_was_disarmed_at_once_lies_on() -> None:
    made = Made()
    made.rows["ARM"] = [(ARMED_S, {"ArmState": 1.0, "Forced": 0.0}), (UP_S + 3, {"ArmState": 0.0, "Forced": 0.0})]
    over = made.after(UP_S + 1.2)
    for name in ("POS", "CTUN"):
        made.table[name].update(
            {field: 0.1 + made.noise(0.01) for field in ("RelHomeAlt", "Alt") if field in made.table[name]}
        )
    made.table["CTUN"]["ThO"][:] = np.where(made.after(UP_S, UP_S + 1), 0.19, 0.0)
    made.table["ATT"]["Roll"][over] = 168.0
    made.table["IMU"]["AccZ"][over] = 9.8
    assert made.flight().turned_over_s == pytest.approx(UP_S + 1.2, abs=0.2)
    assert first(made).title == "it tipped over at take-off"


def test_what_tips_as_it_touches_down_with_its_throttle_cut_hit_nothing() -> None:
    made = Made()
    tips = made.after(DOWN_S + 0.3)
    made.rows["ERR"] = [(DOWN_S + 2.5, {"Subsys": 12.0, "ECode": 1.0})]
    made.table["CTUN"]["ThO"][made.t > DOWN_S - 0.1] = 0.0
    made.table["CTUN"]["ThO"][made.after(DOWN_S - 3.0, DOWN_S - 0.2)] = HOVER
    made.table["ATT"]["Pitch"][tips] = 70.0
    made.table["IMU"]["AccZ"][made.after(DOWN_S, DOWN_S + 0.15)] = -45.0
    assert "it turned over at landing" in [one.title for one in every_finding(made.find())]


def test_a_descent_into_the_ground_by_the_stick_is_no_failure() -> None:
    made = Made()
    made.rows["ERR"] = [(DOWN_S, {"Subsys": 12.0, "ECode": 1.0})]
    made.table["RCIN"] = {"C3": np.where(made.t > DOWN_S - 12, 1000.0, 1500.0)}
    finding = first(made)
    assert (finding.kind, finding.suspect) == ("crash", "operation")


def test_a_log_that_ends_in_the_air_and_one_with_a_hole() -> None:
    made = Made()
    made.rows["ARM"].pop()
    tables = {name: table.between(0.0, 70.0) for name, table in made.tables().items()}
    flight = made.flight()
    (finding,) = find(flight_of(tables, flight.settings, flight.log.facts, 70.0))
    assert (finding.kind, finding.title, finding.severity) == ("log", "the log ends in the air", "warning")
    made.table["POWR"]["Vcc"][made.after(69.5)] = 4.5
    tables = {name: table.between(0.0, 70.0) for name, table in made.tables().items()}
    finding = find(flight_of(tables, flight.settings, flight.log.facts, 70.0))[0]
    assert (finding.kind, finding.title) == ("battery", "power was lost in the air")
    holed = {name: table.where((table.t < 40) | (table.t > 48)) for name, table in Made().tables().items()}
    (finding,) = find(flight_of(holed, flight.settings, flight.log.facts, END_S))
    assert finding.title == "the log has 1 hole"
    assert find(flight_of(holed, flight.settings, flight.log.facts, END_S, [JUMP])) == ()  # not by such a clock


@pytest.mark.parametrize(("sinks_ms", "titles"), [(12.0, ["the log ends in the air"]), (2.0, [])])
def test_a_log_that_ends_in_a_fall_below_its_home(sinks_ms: float, titles: list[str]) -> None:
    made = Made()
    made.rows["ARM"].pop()
    falls = made.after(60.0)
    made.table["CTUN"]["ThO"][falls] = 0.0
    for name, field in (("POS", "RelHomeAlt"), ("CTUN", "Alt"), ("CTUN", "BAlt"), ("CTUN", "DAlt"), ("BARO", "Alt"),
                        ("BARO#2", "Alt"), ("GPS", "Alt")):  # fmt: skip
        made.table[name][field][falls] -= sinks_ms * (made.t[falls] - 60.0)
    tables = {name: table.between(0.0, 70.0) for name, table in made.tables().items()}
    findings = every_finding(find(flight_of(tables, made.known, made.facts, 70.0)))
    assert [one.title for one in findings if one.kind == "log"] == titles


def test_a_log_ends_on_the_ground_by_the_barometer_whatever_the_estimate_says() -> None:
    made = Made()
    made.rows["ARM"].pop()
    for name in ("BARO", "BARO#2"):
        made.table[name]["Alt"][made.after(60.0)] = 0.0
    made.table["CTUN"]["BAlt"][made.after(60.0)] = 0.0
    tables = {name: table.between(0.0, 70.0) for name, table in made.tables().items()}
    findings = every_finding(find(flight_of(tables, made.known, made.facts, 70.0)))
    assert "the log ends in the air" not in [one.title for one in findings]


def test_an_overloaded_autopilot() -> None:
    made = Made()
    made.table["PM"]["NLon"][made.after(FAILS_S)] = 1500
    assert first(made).kind == "cpu"


def test_parameters_changed_in_the_air() -> None:
    made = Made()
    flight = made.flight()
    changed = {**flight.settings, "ATC_RAT_RLL_P": (
        Setting("ATC_RAT_RLL_P", 0.135, "PARM"), Setting("ATC_RAT_RLL_P", 0.4, "PARM", changed_at_s=60.0),
    )}  # fmt: skip
    (finding,) = find(flight_of(made.tables(), changed, flight.log.facts, END_S))
    assert (finding.title, finding.severity) == ("parameters were changed in the air", "info")
    driven = find(flight_of(made.tables(), changed, {"firmware": "ArduRover V4.5.4", "vehicle": "rover"}, END_S))
    assert [one.title for one in driven if one.kind == "tuning"] == ["parameters were changed under way"]


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


@pytest.mark.parametrize(("drift_m", "kinds"), [(0.0, []), (6.0, ["barometer"])])
def test_a_barometer_that_drifts_from_the_range_finder_on_the_ground_is_noted(drift_m: float, kinds: list[str]) -> None:
    made = Made()
    del made.table["BARO"], made.table["BARO#2"]
    height = made.table["CTUN"]["Alt"]
    made.table["POS"]["Lat"][:] = 47.0  # it lands where it began
    made.table["RFND"] = {"Dist": 0.2 + np.minimum(height, 8.0), "Stat": np.full(len(made.t), 4.0)}
    made.table["CTUN"]["BAlt"] = height + np.interp(made.t, [0, 8, 100], [0, 0, drift_m])
    found = made.find()
    assert [one.kind for one in found] == kinds
    assert all(one.severity == "info" for one in found)


@pytest.mark.parametrize(("felt", "is_told"), [(9.8, False), (9.2, False), (7.8, True)])
def test_accelerometers_that_do_not_feel_gravity_at_rest_are_told(felt: float, is_told: bool) -> None:
    made = Made()
    for name in ("IMU", "IMU#2"):
        made.table[name]["AccZ"] += 9.8 - felt
    titles = [one.title for one in every_finding(made.find())]
    assert ("the accelerometers do not feel gravity at rest" in titles) == is_told


@pytest.mark.parametrize(("roll_deg", "is_told"), [(0.0, True), (180.0, False)])
def test_gravity_that_is_felt_upside_down_is_told_unless_the_vehicle_hangs_so(roll_deg: float, is_told: bool) -> None:
    made = Made()
    for name in ("IMU", "IMU#2"):
        made.table[name]["AccZ"] *= -1
    made.table["ATT"]["Roll"] += roll_deg
    titles = [one.title for one in every_finding(made.find())]
    assert ("the accelerometers feel gravity upside down" in titles) == is_told


def test_gyros_that_turn_fast_differ_by_their_scale_and_are_not_noisy() -> None:
    made = Made()
    flips = made.after(FAILS_S, FAILS_S + 30)
    for axis, period in zip("XYZ", (3.0, 4.0, 5.0), strict=True):
        turn = np.radians(300 * np.sin(2 * np.pi * made.t / period))[flips]
        made.table["IMU"][f"Gyr{axis}"][flips] += turn
        made.table["IMU#2"][f"Gyr{axis}"][flips] += 0.97 * turn
    assert not [one for one in made.find() if one.kind == "imu"]


def test_a_log_that_is_written_while_armed_only_tells_of_no_arming() -> None:
    made = Made()
    del made.rows["ARM"], made.rows["MSG"]
    made.table["CTUN"]["ThO"][:] = 0.0
    assert made.flight().armed == ()
    made.settings["LOG_DISARMED"] = 0
    assert made.flight().armed == ((0.0, END_S),)
    outputs = {name: made.table["RCOU"][name].copy() for name in ("C1", "C2", "C3", "C4")}
    for name in outputs:
        made.table["RCOU"][name][:] = 1000.0
    assert made.flight().armed == ()  # a log was forced open on the ground
    made.table["RCOU"].update(outputs)
    made.rows["MSG"] = [(5.0, {"Message": "PreArm: Need 3D Fix"})]  # a refusal opens a log as well
    assert made.flight().armed == ()


def test_a_planes_throttle_is_in_percent() -> None:
    (table,) = instances({"CTUN": Table(np.arange(3.0), {"ThO": np.array([0.0, 15.0, 40.0])})}, "CTUN")
    assert table["ThO"].tolist() == pytest.approx([0.0, 0.15, 0.4])


def test_a_log_whose_last_record_is_the_disarming_does_not_end_in_the_air() -> None:
    made = Made()
    made.rows["ARM"][-1] = (70.0, {"ArmState": 0.0, "Forced": 0.0})
    tables = {name: table.between(0.0, 70.0) for name, table in made.tables().items()}
    flight = made.flight()
    assert find(flight_of(tables, flight.settings, flight.log.facts, 70.0)) == ()


def test_what_is_not_recorded_between_two_flights_is_no_hole() -> None:
    made = Made()
    made.rows["ARM"] += [(40.0, {"ArmState": 0.0, "Forced": 0.0}), (60.0, {"ArmState": 1.0, "Forced": 0.0})]
    tables = {name: table.where((table.t <= 40.2) | (table.t >= 59.9)) for name, table in made.tables().items()}
    flight = made.flight()
    assert not [one for one in find(flight_of(tables, flight.settings, flight.log.facts, END_S)) if one.kind == "log"]


@pytest.mark.parametrize(
    ("text", "suspect"),
    [
        ("PreArm: RC not calibrated", "operation"),
        ("Arm: RTL mode not armable", "operation"),
        ("Arm: Throttle too high", "operation"),
        ("PreArm: Check ANGLE_MAX", "parameter"),
        ("PreArm: Need Position Estimate", "parameter"),
    ],
)
def test_a_refusal_for_what_an_operator_has_to_do_is_no_parameters(text: str, suspect: str) -> None:
    made = Made()
    del made.rows["ARM"]
    made.table["CTUN"]["ThO"][:] = 0.0
    made.rows["MSG"] = [(20.0, {"Message": text}), (50.0, {"Message": text})]
    (finding,) = [one for one in made.find() if one.kind == "prearm"]
    assert finding.suspect == suspect
    assert (finding.probability > 0.9) == (suspect == "operation")


def test_the_throttle_of_a_helicopter_is_its_collective_pitch() -> None:
    made = Made()
    made.table["CTUN"]["ThO"][made.after(UP_S, DOWN_S)] = 0.75
    assert [one.kind for one in made.find()] == ["thrust"]
    made.settings["H_COL_MIN"] = 1250  # firmware before 3.5 names no frame class
    assert made.flight().vehicle.kind == "heli"
    assert "thrust" not in [one.kind for one in made.find()]


def test_a_simulated_battery_and_computer_are_nobodys_business() -> None:
    made = Made()
    made.settings["SIM_BATT_VOLTAGE"] = 12.6
    made.table["BAT"]["Volt"][:] = 12.6
    made.table["PM"]["NLon"][made.after(FAILS_S)] = 1500
    assert made.find() == ()


def test_a_receiver_that_starts_has_not_lost_its_satellites() -> None:
    made = Made()
    del made.rows["ARM"]
    made.table["CTUN"]["ThO"][:] = 0.0
    made.rows["MSG"] = [(20.0, {"Message": "Arm: RTL mode not armable"})]
    starts = made.after(0.0, 8.0)
    made.table["GPS"]["Status"][starts] = 1
    made.table["GPS"]["NSats"][starts] = 0
    assert [one.kind for one in made.find()] == ["prearm"]


def test_a_logger_that_is_opened_by_the_arming_tells_of_it_in_words_alone() -> None:
    made = Made()
    made.rows["ARM"] = [(DOWN_S + 5, {"ArmState": 0.0, "Forced": 0.0})]
    made.rows["MSG"] = [(2.0, {"Message": "Arm: Need Position Estimate"}), (40.0, {"Message": "Arming motors"})]
    tables = {name: table.where((table.t < 20.0) | (table.t >= 39.9)) for name, table in made.tables().items()}
    flight = flight_of(tables, made.flight().settings, made.facts, END_S)
    assert flight.armed == ((40.0, DOWN_S + 5),)
    assert not [one for one in find(flight) if one.kind in ("log", "prearm")]  # it was closed, and then it did arm


def test_what_is_armed_once_more_was_disarmed_while_nothing_was_recorded() -> None:
    made = Made()
    made.rows["ARM"].insert(1, (60.0, {"ArmState": 1.0, "Forced": 0.0}))
    whole = made.flight()
    assert whole.armed == ((ARMED_S, 60.0), (60.0, DOWN_S + 5))
    tables = {name: table.where((table.t < 40.0) | (table.t >= 59.9)) for name, table in made.tables().items()}
    flight = flight_of(tables, whole.settings, whole.log.facts, END_S)
    assert np.ravel(flight.armed).tolist() == pytest.approx([ARMED_S, 39.9, 60.0, DOWN_S + 5])
    assert not [one for one in find(flight) if one.kind == "log"]


@pytest.mark.parametrize("text", ["PreArm: Compass not calibrated", "PreArm: Compass calibrated requires reboot"])
def test_a_compass_that_is_to_be_calibrated_is_not_wrong(text: str) -> None:
    made = Made()
    del made.rows["ARM"]
    made.table["CTUN"]["ThO"][:] = 0.0
    made.rows["MSG"] = [(20.0, {"Message": text}), (50.0, {"Message": text})]
    assert [(one.kind, one.suspect) for one in made.find()] == [("prearm", "operation")]


def test_a_transmitter_that_is_off_on_the_ground_is_noted() -> None:
    made = Made()
    del made.rows["ARM"]
    made.table["CTUN"]["ThO"][:] = 0.0
    made.rows["MSG"] = [(20.0, {"Message": "PreArm: Need 3D Fix"}), (30.0, {"Message": "Radio Failsafe - Disarming"})]
    assert [one.severity for one in made.find() if one.kind == "radio"] == ["info"]


@pytest.mark.parametrize(("mates", "kinds"), [((2,), ["motor"]), ((1, 2), [])])
def test_two_motors_that_are_asked_for_alike_turn_the_vehicle_and_are_not_weak(
    mates: tuple[int, ...], kinds: list[str]
) -> None:
    made = Made()
    for n in mates:  # 1 and 2 turn the same way
        made.table["RCOU"][f"C{n}"][made.after(50.0, 56.0)] += 250
    made.rows["MSG"].append((53.0, {"Message": "Potential Thrust Loss (2)"}))
    assert [one.kind for one in made.find() if one.kind == "motor"] == kinds


def test_a_heading_that_turns_to_a_demand_given_at_once_follows_it() -> None:
    made = Made()
    yaw = np.interp(made.t, [50.0, 54.0], [20.0, 199.0])
    made.table["ATT"].update({"Yaw": yaw, "DesYaw": np.where(made.t < 50.0, 20.0, 199.0)})
    assert not [one for one in made.find() if one.kind == "attitude"]
    made.table["ATT"]["Yaw"] = np.where(made.t < 54.0, yaw, 20.0 + 40.0 * (made.t - 54.0))  # and spins on
    assert [one.title for one in made.find() if one.kind == "attitude"] == ["the heading does not follow its demand"]


@pytest.mark.parametrize(
    ("firmware", "mode", "since_s", "title"),
    [
        ("ArduRover V4.5.4", 0.0, 50.0, "the vehicle turned over"),
        ("ArduSub V4.5.6", 4.0, 0.0, "the vehicle is upside down"),
        ("ArduSub V4.5.6", 19.0, 0.0, None),
    ],
)
def test_what_lies_on_its_back_is_told(firmware: str, mode: float, since_s: float, title: str | None) -> None:
    made = Made()
    made.facts = {"firmware": firmware}
    made.rows["MODE"] = [(0.0, {"ModeNum": mode})]
    made.table["ATT"]["Roll"][made.after(since_s)] = 175.0
    assert [one.title for one in made.find() if one.kind == "attitude"] == ([title] if title else [])


@pytest.mark.parametrize(("output", "named"), [("ROut", "roll"), ("YOut", "heading")])
def test_a_submarine_that_fights_to_hold_still_lacks_a_thruster(output: str, named: str) -> None:
    dive = Made()
    dive.facts = {"firmware": "ArduSub V4.5.0"}
    dive.rows["MODE"] = [(0.0, {"ModeNum": 2.0})]
    dive.table["RATE"] = {"ROut": dive.noise(0.02), "YOut": dive.noise(0.02)}
    dive.table["ATT"]["DesYaw"][:] = 90.0
    assert not [one for one in every_finding(dive.find()) if "thruster" in one.title]
    dive.table["RATE"][output][dive.after(40.0, 80.0)] = 0.5
    (found,) = [one for one in every_finding(dive.find()) if "thruster" in one.title]
    assert found.title == f"a thruster is weak, off or reversed: it fights to hold its {named}"
    assert found.kind == "motor"


def test_motor_detection_that_fails_is_told_by_its_thruster() -> None:
    dive = Made()
    dive.facts = {"firmware": "ArduSub V4.7.0"}
    dive.rows["MSG"] += [
        (FAILS_S, {"Message": "Bad thrust read, trying to push the other way..."}),
        (FAILS_S + 2, {"Message": "Failed! Please check Thruster 3 and frame setup!"}),
    ]
    (found,) = [one for one in every_finding(dive.find()) if "thruster" in one.title]
    assert (found.title, found.kind, found.severity) == ("motor detection fails at thruster 3", "motor", "warning")
    assert found.onset_s == FAILS_S + 2


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


def test_the_noise_of_a_monitor_is_no_cell_more() -> None:
    made = Made()
    made.settings.pop("MOT_BAT_VOLT_MAX")
    made.table["BAT"]["Volt"] += 12 * 4.2 - made.table["BAT"]["Volt"][0]
    assert "the battery was not charged" not in [one.title for one in made.find()]
    made.table["BAT"]["Volt"] += made.noise(1.0)
    assert "the battery was not charged" not in [one.title for one in made.find()]


def leaks(firmware: str, code: float = 0.0, message: str = "") -> list[float | None]:
    """When water is told of in a dive whose log says these at 60 s."""
    dive = Made()
    dive.facts = {"firmware": firmware}
    dive.rows["ERR"] = [(60.0, {"Subsys": 27.0, "ECode": code})]
    dive.rows["MSG"] = [(60.0, {"Message": message})]
    found = [one for one in every_finding(dive.find()) if one.kind == "leak"]
    assert all(one.severity == "critical" for one in found)
    return [one.onset_s for one in found]


def test_a_submarine_that_leaks() -> None:
    assert leaks("ArduSub V4.5.0", code=1.0) == [60.0]
    assert leaks("ArduSub V4.5.0", message="Leak Detected") == [60.0]
    assert leaks("ArduSub V4.5.0", message="Leak detector is set up") == []
    assert leaks("ArduSub V4.5.0") == [], "code 0 says that it is over"
    assert leaks("ArduCopter V4.5.0", code=1.0) == []


@pytest.mark.parametrize(("out", "told"), [(-0.5, True), (0.5, False)])
def test_a_turn_that_its_own_control_drives_on_is_told(out: float, told: bool) -> None:
    made = Made()
    turns = np.where((made.t > 40.0) & (made.t < 60.0), 30.0 + 3.0 * (made.t - 40.0), 0.0)
    pushes = np.where(turns > 0, out, 0.0)
    zero = np.zeros_like(made.t)
    made.table["RATE"] = {"R": zero, "P": zero, "RDes": zero, "PDes": zero, "ROut": zero, "POut": zero,
                          "Y": turns, "YDes": np.sign(pushes) * 60.0, "YOut": pushes}  # fmt: skip
    assert ("it spins against its control" in [one.title for one in made.find()]) is told


@pytest.mark.parametrize(("begins_dps", "told"), [(0.0, True), (150.0, False)])
def test_what_starts_to_turn_against_its_control_spins_and_what_stops_does_not(begins_dps: float, told: bool) -> None:
    made = Made()
    since = made.t - 40.0
    turns = np.where(since < 3.0, begins_dps + (60.0 - begins_dps) * since / 3.0, 60.0 - 10.0 * (since - 3.0))
    turns = np.where((since > 0.0) & (since < 7.0), turns, 0.0)
    zero = np.zeros_like(made.t)
    made.table["RATE"] = {"R": zero, "P": zero, "RDes": zero, "PDes": zero, "ROut": zero, "POut": zero,
                          "Y": turns, "YDes": zero, "YOut": np.where(turns > 0, -0.6, 0.0)}  # fmt: skip
    assert ("it spins against its control" in [one.title for one in made.find()]) is told


def test_a_heading_that_swings_against_its_control_does_not_spin() -> None:
    made = Made()
    swung = np.where(made.after(40.0, 46.0), 100.0 * np.sin(2 * np.pi * made.t), 0.0)
    zero = np.zeros_like(made.t)
    made.table["RATE"] = {"R": zero, "P": zero, "RDes": zero, "PDes": zero, "ROut": zero, "POut": zero,
                          "Y": swung, "YDes": zero + 200.0, "YOut": np.where(swung != 0, 0.5, 0.0)}  # fmt: skip
    assert "it spins against its control" not in [one.title for one in made.find()]


def test_what_idles_on_the_ground_has_no_weak_motor() -> None:
    made = Made()
    for table in made.table.values():
        for height in {"Alt", "BAlt", "RelHomeAlt"} & table.keys():
            table[height] = np.full_like(table[height], 20.0)
    made.table["CTUN"]["ThO"][:] = 0.05
    made.table["RCOU"]["C1"] = 1250 + 8 * np.clip(made.t - 20, 0, 40)  # an integrator that winds up
    assert "motor" not in [one.kind for one in made.find()]


@pytest.mark.parametrize(("at_s", "told"), [(50.0, True), (2.0, False)])
def test_motors_that_the_emergency_switch_stops_in_the_air_are_told(at_s: float, told: bool) -> None:
    made = Made()
    made.settings["RC8_OPTION"] = 31
    made.table["RCIN"] = {f"C{n}": np.full_like(made.t, 1500.0) for n in range(1, 15)}
    made.table["RCIN"]["C8"] = np.where(made.t > at_s, 1934.0, 1094.0)
    title = "the emergency switch stopped the motors in the air"
    recorded = Made()
    recorded.rows["EV"] = [(at_s, {"Id": 54.0})]
    for one in (made, recorded):
        _drop(one, at_s)
    assert (title in [one.title for one in made.find()]) is told
    assert (title in [one.title for one in recorded.find()]) is told


def _drop(made: Made, at_s: float) -> None:
    """It falls to the ground from a time on."""
    left = np.where(made.t > at_s, np.maximum(12.0 - 5 * (made.t - at_s) ** 2, 0.0) / 12.0, 1.0)
    made.table["POS"]["RelHomeAlt"] *= left
    made.table["CTUN"]["Alt"] *= left


@pytest.mark.parametrize(("falls_s", "is_told"), [(50.0, True), (None, False), (44.0, False)])
def test_what_is_disarmed_in_the_air_and_falls_is_told(falls_s: float | None, is_told: bool) -> None:
    made = Made()
    made.rows["ARM"][1] = (50.0, {"ArmState": 0.0, "Forced": 0.0})
    if falls_s is not None:
        _drop(made, falls_s)
    assert (DROPPED in [one.title for one in made.find()]) is is_told


@pytest.mark.parametrize(("pulse_us", "is_told"), [(1000.0, True), (1140.0, False)])
def test_motors_that_stop_in_the_air_while_it_is_armed_are_told(pulse_us: float, is_told: bool) -> None:
    made = Made()
    _drop(made, FAILS_S)
    for column in made.table["RCOU"].values():
        column[made.after(FAILS_S)] = pulse_us
    assert (CUT in {one.title for one in every_finding(made.find())}) == is_told


def test_a_height_that_is_set_anew_when_it_is_disarmed_is_no_fall() -> None:
    made = Made()
    made.rows["ARM"][1] = (50.0, {"ArmState": 0.0, "Forced": 0.0})
    for table, name in (("POS", "RelHomeAlt"), ("CTUN", "Alt")):
        made.table[table][name][made.after(51.0)] = 0.0
    assert DROPPED not in [one.title for one in made.find()]


def test_what_keeps_its_height_without_motors_stands_whatever_its_barometer_says() -> None:
    made = Made()
    made.rows["EV"] = [(50.0, {"Id": 54.0})]
    assert "the emergency switch stopped the motors in the air" not in [one.title for one in made.find()]


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


def test_home_that_is_set_as_it_is_armed_is_no_climb() -> None:
    made = Made()
    lift = np.where(made.t < ARMED_S + 0.3, -3.5, 0.0)
    made.table["POS"]["RelHomeAlt"] = made.table["POS"]["RelHomeAlt"] + lift
    t, height = made.flight().estimated_height or (np.empty(0), np.empty(0))
    assert float(np.max(height[t < ARMED_S + 2])) < 1.0
    assert float(np.max(height)) == pytest.approx(12.0, abs=1.0)


@pytest.mark.parametrize(("growth", "oscillates"), [(2.6, True), (1.0, False)])
def test_swings_that_grow_until_control_is_lost_are_an_oscillation(growth: float, *, oscillates: bool) -> None:
    """Of two half swings a second: as they grow, and as one push turns it over."""
    made = Made(rate_hz=25.0)
    swings = np.clip(np.floor((made.t - 50.0) * 2), 0, 5)
    rate = np.where(made.after(50.0, 53.0), 4.0 * growth**swings * np.sin(2 * np.pi * (made.t - 50.0)), made.noise(0.5))
    tumbles = made.after(53.0)
    made.table["RATE"] = {"R": rate, "P": made.noise(0.5), "RDes": made.noise(0.5), "PDes": made.noise(0.5)}
    made.table["ATT"]["Roll"] = np.where(tumbles, 150.0, np.cumsum(rate) / 25.0)
    made.table["CTUN"]["ThO"][tumbles] = 0.9
    titles = [one.title for one in every_finding(made.find())]
    assert ("roll oscillates" in titles) is oscillates
    assert "control was lost" in titles


@pytest.mark.parametrize(("hit_s", "title"), [(52.0, "it hit the ground at 9.0 m/s"), (80.0, "it crashed")])
def test_what_lay_on_the_ground_for_long_did_not_end_by_a_later_blow(hit_s: float, title: str) -> None:
    made = Made()
    made.rows["ERR"] = [(50.0, {"Subsys": 12.0, "ECode": 1.0})]
    made.rows["MSG"] = [(hit_s, {"Message": "SIM Hit ground at 9.0 m/s"})]
    assert [one.title for one in every_finding(made.find()) if one.kind == "crash"] == [title]


@pytest.mark.parametrize("stays", [True, False])
def test_gyros_disagree_by_an_offset_and_not_by_swings_that_the_record_turns_into_slow_ones(stays: bool) -> None:
    made = Made()
    apart = np.full_like(made.t, 9.0) if stays else 14.0 * np.sin(2 * np.pi * made.t / 40.0)
    made.table["IMU#2"]["GyrX"] += np.where(made.after(UP_S, DOWN_S), np.radians(apart), 0.0)
    assert ("the gyros disagree" in [one.title for one in every_finding(made.find())]) is stays
