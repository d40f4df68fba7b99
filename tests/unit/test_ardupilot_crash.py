"""A crash, a tip-over, what it lay on and what it hit; and what looks like one."""

from __future__ import annotations

import numpy as np
import pytest

from care_core.ecosystems.ardupilot.measures.events import fall_of
from care_core.ecosystems.findings import LEANED, STRUCK, every_finding
from care_core.ecosystems.measures import Mission, find_extractor
from tests.flights import ARMED_S, DOWN_S, END_S, FAILS_S, HOVER, UP_S, Made, falling, first


def test_what_lies_with_its_motors_down_lost_none_and_is_held_by_nothing() -> None:
    made = Made()
    lies = made.after(FAILS_S, DOWN_S)
    made.table["CTUN"]["ThO"][lies] = 0.13
    made.table["RCOU"]["C3"][lies] = made.table["RCOU"]["C1"][lies] = 1500.0
    made.table["RCOU"]["C1"][lies] += 200.0
    made.table["ATT"]["Roll"][lies] = made.table["ATT"]["DesRoll"][lies] = 45.0
    made.table["GPS"]["Spd"][lies] = 0.05
    assert not {"motor", "blocked"} & {one.kind for one in every_finding(made.find())}


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


def test_what_climbs_as_it_is_lost_has_not_come_down() -> None:
    made = Made()
    made.facts = {"firmware": "ArduPlane V4.5.4 (fd1bcc61)", "vehicle": "fixed wing"}
    made.table["ATT"]["Roll"][made.after(UP_S + 0.5)] = 120.0
    height = np.interp(made.t, [UP_S, UP_S + 3, UP_S + 5], [0.0, 6.0, 0.0])
    for table, field in (("POS", "RelHomeAlt"), ("CTUN", "Alt")):
        made.table[table][field] = height
    impact_s = made.flight().impact_s
    assert impact_s is not None
    assert impact_s > UP_S + 4


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


@pytest.mark.parametrize(("blow", "is_told"), [(90.0, True), (45.0, False)])
def test_a_blow_in_the_air_that_it_survives_is_what_it_hit(blow: float, is_told: bool) -> None:
    made = Made()
    made.table["ATT"]["Roll"][made.after(FAILS_S, FAILS_S + 0.6)] = 50.0
    made.table["IMU"]["AccX"][made.after(FAILS_S - 0.2, FAILS_S - 0.1)] = blow
    for name in ("VIBE", "VIBE#2"):
        made.table[name]["Clip"] = np.where(made.t > FAILS_S - 0.2, 1.0, 0.0)
    assert made.flight().lost_control_s is None
    told = [one for one in every_finding(made.find()) if one.title == STRUCK]
    assert [(one.suspect, "flew on" in one.evidence) for one in told] == [("world", True)] * is_told


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


def test_a_tip_over_at_take_off() -> None:
    made = Made()
    made.table["POS"]["RelHomeAlt"][:] = 0.1
    made.table["CTUN"]["Alt"][:] = made.table["CTUN"]["BAlt"][:] = 0.1 + made.noise(0.05)
    over = made.after(UP_S + 1)
    made.table["ATT"]["Roll"][over] = 85.0
    made.table["IMU"]["AccY"][over], made.table["IMU"]["AccZ"][over] = -9.8, 0.0
    made.rows["ERR"] = [(UP_S + 4, {"Subsys": 12.0, "ECode": 1.0})]
    assert first(made).kind == "takeoff"


def on_the_ground(made: Made) -> None:
    for table, field in (("POS", "RelHomeAlt"), ("CTUN", "Alt"), ("CTUN", "BAlt"), ("BARO", "Alt")):
        made.table[table][field][:] = 0.1 + made.noise(0.05)


def test_an_attitude_that_goes_over_while_nothing_is_felt_is_no_tip_over() -> None:
    made = Made()
    on_the_ground(made)
    made.table["ATT"]["Roll"][made.after(UP_S + 1)] = 85.0
    made.rows["ERR"] = [(UP_S + 4, {"Subsys": 12.0, "ECode": 1.0})]
    assert "takeoff" not in {one.kind for one in every_finding(made.find())}


@pytest.mark.parametrize(("leans_deg", "is_lost"), [(4.0, False), (25.0, True)])
def test_what_is_held_down_and_told_to_lean_has_lost_no_control(leans_deg: float, is_lost: bool) -> None:
    made = Made()
    on_the_ground(made)
    told = made.after(UP_S + 1, UP_S + 8)
    made.table["ATT"]["DesRoll"][told] = -45.0
    made.table["ATT"]["Roll"][told] = leans_deg
    made.table["IMU"]["AccX"] += made.noise(3.0)  # its motors shake it
    assert (made.flight().lost_control_s is not None) == is_lost


@pytest.mark.parametrize(("throttle", "is_told"), [(0.0, True), (HOVER, False)], ids=["cut", "swinging in the air"])
def test_a_copter_that_lies_tilted_when_it_has_landed_turned_over(throttle: float, is_told: bool) -> None:
    made = Made()
    lies = made.after(DOWN_S)
    made.table["CTUN"]["ThO"][lies] = made.table["CTUN"]["ThI"][lies] = throttle
    made.table["ATT"]["Pitch"][lies], made.table["ATT"]["DesPitch"][lies] = -46.0, -46.0
    made.lies(lies, 46.0 if throttle == 0.0 else 0.0)  # in the air thrust alone is felt
    assert (made.flight().lost_control_s is not None) == is_told


def test_what_gravity_holds_on_its_legs_does_not_lie_whatever_its_attitude_says() -> None:
    """A gyro that turns by itself carries the attitude away, with motors that idle and shake it."""
    made = Made()
    made.table["CTUN"]["ThO"][:] = np.where(made.after(UP_S), 0.3, 0.0)
    for table, field in (("POS", "RelHomeAlt"), ("CTUN", "Alt"), ("CTUN", "BAlt"), ("BARO", "Alt")):
        if field in made.table[table]:
            made.table[table][field] = made.noise(0.05)
    made.table["ATT"]["Roll"] = np.clip(15.0 * (made.t - UP_S), 0.0, 140.0)
    made.table["IMU"]["AccX"] += made.noise(2.0)
    assert made.flight().lost_control_s is None
    made.lies(made.after(UP_S), 90.0)
    assert made.flight().lost_control_s is not None


@pytest.mark.parametrize(("felt", "by_barometer"), [(8.7, True), (9.7, False)])
def test_accelerometers_that_feel_no_gravity_carry_the_height_off(felt: float, by_barometer: bool) -> None:
    made = Made()
    made.table["IMU"]["AccZ"] = -felt + made.noise(0.05)
    for table, field in (("POS", "RelHomeAlt"), ("CTUN", "Alt")):
        made.table[table][field] -= np.where(made.after(UP_S), 8.0, 0.0)
    flight = made.flight()
    height, told = flight.height, flight.barometer if by_barometer else flight.estimated_height
    assert height is not None
    assert told is not None
    assert np.allclose(height[1], told[1])


def test_a_copter_that_flew_before_it_fell_did_not_tip_over_at_take_off() -> None:
    """Its throttle was down as it fell past the ground by its estimate: it stood nowhere."""
    made = Made()
    fell = made.after(DOWN_S - 6.0)
    made.table["CTUN"]["ThO"][made.after(DOWN_S - 6.0, DOWN_S - 5.0)] = 0.0
    for table, field in (("POS", "RelHomeAlt"), ("CTUN", "Alt")):
        made.table[table][field][fell] = 0.2
    made.table["CTUN"]["ThO"][made.after(DOWN_S - 5.0)] = 0.4
    made.table["ATT"]["Roll"][made.after(DOWN_S - 4.5)] = 120.0
    made.lies(made.after(DOWN_S - 4.5), 120.0)
    assert "it tipped over at take-off" not in [one.title for one in every_finding(made.find())]


def test_what_leans_as_it_is_told_flies_whatever_its_height_is_said_to_be() -> None:
    made = Made()
    for table, field in (("POS", "RelHomeAlt"), ("CTUN", "Alt")):
        made.table[table][field] = -0.01 * made.t + made.noise(0.05)
    assert not made.flight().airborne
    lean = np.where(made.after(UP_S, DOWN_S), 12.0 * np.sin(made.t), 0.0)
    for field in ("Roll", "DesRoll"):
        made.table["ATT"][field] += lean
    assert sum(end - start for start, end in made.flight().airborne) > 0.8 * (DOWN_S - UP_S)


@pytest.mark.parametrize(("fell_ms", "said"), [(13.0, "it was falling at 13 m/s as the log ends"), (5.5, "")])
def test_a_fall_at_the_end_of_a_log_is_a_crash_where_no_copter_is_told_to_come_down_so(
    fell_ms: float, said: str
) -> None:
    made = Made()
    before = np.clip(made.t - (END_S - 4.0), 0.0, None)
    for table, field in (("POS", "RelHomeAlt"), ("CTUN", "Alt"), ("CTUN", "BAlt"), ("BARO", "Alt")):
        made.table[table][field] = 80.0 - fell_ms * before
    made.table["CTUN"]["ThO"][:] = HOVER
    made.rows["ARM"] = made.rows["ARM"][:1]
    assert fall_of(Mission(made.flight(), {}, ARMED_S, END_S, False, {}, {})) == said


@pytest.mark.parametrize(("turns_deg_s", "is_told"), [(570.0, True), (100.0, False)])
def test_a_blow_that_a_sensor_clips_at_and_that_whirls_it_is_what_it_hit(turns_deg_s: float, is_told: bool) -> None:
    made = Made()
    made.table["ATT"]["Roll"][made.after(FAILS_S, FAILS_S + 0.6)] = 50.0
    made.table["IMU"]["GyrX"][made.after(FAILS_S - 0.2, FAILS_S)] = np.radians(turns_deg_s)
    for name in ("VIBE", "VIBE#2"):
        made.table[name]["Clip"] = np.where(made.t > FAILS_S - 0.2, 1.0, 0.0)
    assert (STRUCK in {one.title for one in every_finding(made.find())}) == is_told


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


@pytest.mark.parametrize("throttle", [0.0, 0.35], ids=["cut", "level and slow"])
def test_what_tips_as_it_touches_down_hit_nothing(throttle: float) -> None:
    made = Made()
    tips = made.after(DOWN_S + 0.3)
    made.rows["ERR"] = [(DOWN_S + 2.5, {"Subsys": 12.0, "ECode": 1.0})]
    made.table["CTUN"]["ThO"][made.t > DOWN_S - 0.1] = throttle
    made.table["CTUN"]["ThO"][made.after(DOWN_S - 3.0, DOWN_S - 0.2)] = HOVER
    made.table["ATT"]["Pitch"][tips] = 70.0
    made.lies(tips, 70.0)
    made.table["IMU"]["AccZ"][made.after(DOWN_S, DOWN_S + 0.15)] = -45.0
    assert "it turned over at landing" in [one.title for one in every_finding(made.find())]


def test_a_descent_into_the_ground_by_the_stick_is_no_failure() -> None:
    made = Made()
    made.rows["ERR"] = [(DOWN_S, {"Subsys": 12.0, "ECode": 1.0})]
    made.table["RCIN"] = {"C3": np.where(made.t > DOWN_S - 12, 1000.0, 1500.0)}
    finding = first(made)
    assert (finding.kind, finding.suspect) == ("crash", "operation")


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
    for number in ("", "#2"):
        made.table[f"IMU{number}"]["AccZ"][made.after(since_s)] *= -1
    assert [one.title for one in made.find() if one.kind == "attitude"] == ([title] if title else [])


def test_home_that_is_set_as_it_is_armed_is_no_climb() -> None:
    made = Made()
    lift = np.where(made.t < ARMED_S + 0.3, -3.5, 0.0)
    made.table["POS"]["RelHomeAlt"] = made.table["POS"]["RelHomeAlt"] + lift
    t, height = made.flight().estimated_height or (np.empty(0), np.empty(0))
    assert float(np.max(height[t < ARMED_S + 2])) < 1.0
    assert float(np.max(height)) == pytest.approx(12.0, abs=1.0)


@pytest.mark.parametrize(("hit_s", "title"), [(52.0, "it hit the ground at 9.0 m/s"), (80.0, "it crashed")])
def test_what_lay_on_the_ground_for_long_did_not_end_by_a_later_blow(hit_s: float, title: str) -> None:
    made = Made()
    made.rows["ERR"] = [(50.0, {"Subsys": 12.0, "ECode": 1.0})]
    made.rows["MSG"] = [(hit_s, {"Message": "SIM Hit ground at 9.0 m/s"})]
    assert [one.title for one in every_finding(made.find()) if one.kind == "crash"] == [title]


@pytest.mark.parametrize(("asked_deg", "title"), [(26.0, LEANED), (3.0, "it tipped over at take-off")])
def test_what_stood_again_and_was_told_to_lean_tipped_over(asked_deg: float, title: str) -> None:
    """It had flown, stood for seconds, and goes over its gear as it fell on its back nothing had struck it."""
    made = Made()
    made.rows["ERR"] = [(DOWN_S + 4.5, {"Subsys": 12.0, "ECode": 1.0})]
    made.table["CTUN"]["ThO"][made.after(DOWN_S, DOWN_S + 2)] = 0.0
    made.table["CTUN"]["ThO"][made.after(DOWN_S + 2.1, DOWN_S + 5)] = 0.35
    tips = made.after(DOWN_S + 2.5)
    made.table["ATT"]["DesPitch"][tips] = asked_deg
    made.table["ATT"]["Pitch"][tips] = np.minimum(60.0 * (made.t[tips] - DOWN_S - 2.5), 170.0)
    made.lies(made.after(DOWN_S + 3.5), 90.0)
    made.table["IMU"]["AccZ"][made.after(DOWN_S + 4.0, DOWN_S + 4.2)] = -45.0
    found = every_finding(made.find())
    assert [one.title for one in found if one.kind in ("crash", "takeoff")] == [title]


@pytest.mark.parametrize(("speed", "is_caught"), [(0.2, True), (8.0, False)])
def test_what_goes_on_its_way_lies_on_nothing(speed: float, is_caught: bool) -> None:
    made = Made()
    made.table["ATT"]["Roll"][made.after(FAILS_S)] = 100.0
    made.table["GPS"]["Spd"][made.after(FAILS_S)] = speed
    assert made.flight().is_caught == is_caught
